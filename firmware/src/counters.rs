//! The counters of a health message by name, and which of them have risen since a bench was told last.

use crate::bench_log::bench_log;
use link::{Health, TextLine, text_line};

/// Number of counters in [`Health`].
const COUNTERS: usize = 48;
/// Time between two comparisons, in µs.
const COMPARE_US: u64 = 1_000_000;

/// A counter or figure of [`Health`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Counter {
    pub(crate) name: &'static str,
    pub(crate) value: u32,
    /// It counts events, and stands still while all is well. The others count samples, or are figures of the load.
    counts_events: bool,
}

const fn event(name: &'static str, value: u32) -> Counter {
    Counter { name, value, counts_events: true }
}

const fn figure(name: &'static str, value: u32) -> Counter {
    Counter { name, value, counts_events: false }
}

/// All counters, in the order of the message. The pattern has no rest, so that none is forgotten.
pub(crate) fn counters(health: &Health) -> [Counter; COUNTERS] {
    let Health {
        bursts,
        used,
        no_new_data,
        error_alarm,
        supply,
        stuck_low,
        stuck_high,
        shifted,
        frozen,
        impossible_rate,
        x_sign,
        repeated,
        bus_errors,
        queue_full,
        queue_peak,
        lost_edges,
        spurious_edges,
        suspect,
        recoveries,
        raw_dropped,
        serial_overruns,
        bad_commands,
        awake_permille,
        sampling_cycles,
        estimator_cycles,
        stack_bytes,
        stack_size,
        partly_used,
        marked,
        implausible_supply,
        diag_reads,
        diag_supply_low,
        diag_supply_high,
        diag_flash_update,
        diag_spi,
        diag_over_range,
        diag_self_test,
        diag_flash_checksum,
        diag_alarm,
        rereads,
        bus_resets,
        sensor_resets,
        reset_lines,
        settling,
        data_ready_masked,
        gross_errors,
        usb_dropped,
        mixed_alarm,
    } = *health;
    [
        figure("bursts", bursts),
        figure("used", used),
        event("no_new_data", no_new_data),
        event("error_alarm", error_alarm),
        event("supply", supply),
        event("stuck_low", stuck_low),
        event("stuck_high", stuck_high),
        event("shifted", shifted),
        event("frozen", frozen),
        event("impossible_rate", impossible_rate),
        event("x_sign", x_sign),
        event("repeated", repeated),
        event("bus_errors", bus_errors),
        event("queue_full", queue_full),
        figure("queue_peak", queue_peak),
        event("lost_edges", lost_edges),
        event("spurious_edges", spurious_edges),
        event("suspect", suspect),
        event("recoveries", recoveries),
        event("raw_dropped", raw_dropped),
        event("serial_overruns", serial_overruns),
        event("bad_commands", bad_commands),
        figure("awake_permille", awake_permille),
        figure("sampling_cycles", sampling_cycles),
        figure("estimator_cycles", estimator_cycles),
        figure("stack_bytes", stack_bytes),
        figure("stack_size", stack_size),
        event("partly_used", partly_used),
        event("marked", marked),
        event("implausible_supply", implausible_supply),
        event("diag_reads", diag_reads),
        event("diag_supply_low", diag_supply_low),
        event("diag_supply_high", diag_supply_high),
        event("diag_flash_update", diag_flash_update),
        event("diag_spi", diag_spi),
        event("diag_over_range", diag_over_range),
        event("diag_self_test", diag_self_test),
        event("diag_flash_checksum", diag_flash_checksum),
        event("diag_alarm", diag_alarm),
        event("rereads", rereads),
        event("bus_resets", bus_resets),
        event("sensor_resets", sensor_resets),
        event("reset_lines", reset_lines),
        event("settling", settling),
        event("data_ready_masked", data_ready_masked),
        event("gross_errors", gross_errors),
        event("usb_dropped", usb_dropped),
        event("mixed_alarm", mixed_alarm),
    ]
}

/// Logs once a second, for the bench, every counter of events that has risen.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CounterLog {
    logged: Health,
    next_us: u64,
}

impl CounterLog {
    /// Nothing has been counted.
    pub(crate) fn new() -> Self {
        Self { logged: Health::default(), next_us: 0 }
    }

    /// Whether the counters are to be compared at `now_us`.
    pub(crate) fn is_due(&self, now_us: u64) -> bool {
        now_us >= self.next_us
    }

    /// Logs what has risen.
    pub(crate) fn compare(&mut self, health: &Health, now_us: u64) {
        self.next_us = now_us + COMPARE_US;
        risen(&self.logged, health).for_each(|line| bench_log(&line));
        self.logged = *health;
    }
}

/// A line for every counter of events that has risen, or that was reset and has risen since.
fn risen(before: &Health, now: &Health) -> impl Iterator<Item = TextLine> {
    let pairs = counters(before).into_iter().zip(counters(now));
    pairs.filter(|(_, now)| now.counts_events).filter_map(|(before, now)| {
        let more = if now.value >= before.value { now.value - before.value } else { now.value };
        (more > 0).then(|| text_line(format_args!("{} +{more}: {}", now.name, now.value)))
    })
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use std::vec::Vec;

    #[test]
    fn every_counter_of_events_is_told_when_it_rises() {
        // Of the numbers 1, 2, 3, … by the order of the fields, which the wire format has.
        let bytes: Vec<u8> = (1..=COUNTERS as u8).collect();
        let health: Health = postcard::from_bytes(&bytes).expect("as many varints as there are counters");
        let all = counters(&health);
        assert!(all.iter().map(|counter| counter.value).eq(1..=COUNTERS as u32), "{all:?}");
        let lines: Vec<TextLine> = risen(&Health::default(), &health).collect();
        let (events, figures): (Vec<&Counter>, Vec<&Counter>) = all.iter().partition(|counter| counter.counts_events);
        let load = ["awake_permille", "sampling_cycles", "estimator_cycles", "stack_bytes", "stack_size"];
        let others = ["bursts", "used", "queue_peak"].into_iter().chain(load);
        assert!(figures.iter().map(|counter| counter.name).eq(others), "{figures:?}");
        assert_eq!(lines.len(), events.len());
        for (line, counter) in lines.iter().zip(events) {
            assert!(
                line.starts_with(counter.name) && line.ends_with(&std::format!("+{0}: {0}", counter.value)),
                "{line}"
            );
        }
        assert_eq!(risen(&health, &health).count(), 0);
        // Reset, and risen again.
        let again = Health { lost_edges: 3, ..Health::default() };
        assert_eq!(
            risen(&health, &again).map(|line| std::string::String::from(line.as_str())).collect::<Vec<_>>(),
            ["lost_edges +3: 3"]
        );
    }
}
