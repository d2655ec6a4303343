//! Counters: counting, and those that have risen since the last log to the debug probe.

use crate::event::event;
use link::{Counter, Health};

/// Adds to a counter, which saturates.
pub(crate) fn add(counter: &mut u32, more: u32) {
    *counter = counter.saturating_add(more);
}

/// Time between two comparisons, in µs.
const COMPARE_US: u64 = 1_000_000;

/// Logs risen event counters once a second.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct CounterLog {
    logged: Health,
    next_us: u64,
}

impl CounterLog {
    pub(crate) fn is_due(&self, now_us: u64) -> bool {
        now_us >= self.next_us
    }

    pub(crate) fn compare(&mut self, health: &Health, now_us: u64) {
        self.next_us = now_us + COMPARE_US;
        for (counter, more) in risen(&self.logged, health) {
            event!(warn, "{=str} +{=u32}: {=u32}", counter.name, more, counter.value);
        }
        self.logged = *health;
    }
}

/// Event counters that have risen, also since a reset, with the increase.
fn risen(before: &Health, now: &Health) -> impl Iterator<Item = (Counter, u32)> {
    let pairs = before.counters().into_iter().zip(now.counters());
    let risen = pairs.map(|(before, now)| (now, now.value.checked_sub(before.value).unwrap_or(now.value)));
    risen.filter(|(counter, more)| counter.counts_events && *more > 0)
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use std::vec::Vec;

    #[test]
    fn every_event_counter_is_reported_when_it_rises() {
        // Numbers 1, 2, 3, … in the wire format's order.
        let bytes: Vec<u8> = (1..=Health::COUNTERS as u8).collect();
        let health: Health = postcard::from_bytes(&bytes).expect("as many varints as there are counters");
        let all = health.counters();
        assert!(all.iter().map(|counter| counter.value).eq(1..=Health::COUNTERS as u32), "{all:?}");
        let (events, figures): (Vec<Counter>, Vec<Counter>) = all.iter().partition(|counter| counter.counts_events);
        let load = ["awake_permille", "sampling_cycles", "estimator_cycles", "stack_bytes", "stack_size"];
        let others = ["bursts", "used", "queue_peak"].into_iter().chain(load);
        assert!(figures.iter().map(|counter| counter.name).eq(others), "{figures:?}");
        assert!(risen(&Health::default(), &health).eq(events.iter().map(|counter| (*counter, counter.value))));
        assert_eq!(risen(&health, &health).count(), 0);
        // The counter was reset and has risen again.
        let again = Health { lost_edges: 3, ..Health::default() };
        assert!(risen(&health, &again).map(|(counter, more)| (counter.name, more)).eq([("lost_edges", 3)]));
    }
}
