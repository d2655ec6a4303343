//! Faults of the sensor, the serial line and the processor: the device recovers from each, counts it, and reports the
//! cause of a restart.

use super::bench::{image, run};
use super::costs::counter;
use super::decoded::{Decoded, in_stretches};
use super::images;
use emulation::{Event, Outcome, RATE_HZ, SYSCFG_MEMRMP, Scenario, Sensor};
use link::{Boot, BootCause, Health, Hello, Message};

/// Upper bound on the time that a report takes.
const REPORT_S: f64 = 2.5;
/// The sample period that is programmed: 8 ticks of 1/1638.4 s in 1/256 us.
pub(crate) const PERIOD: u64 = 8 * 156_250;

/// Random bytes for the serial line from a linear congruential generator (Knuth's MMIX constants).
fn noise(count: usize) -> Vec<u8> {
    let mut state = 1_u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 56) as u8
    };
    (0..count).map(|_| next()).collect()
}

#[test]
fn faults_at_full_speed_are_recovered_from_and_counted() {
    assert_recovers_from_every_fault(819.2, 8);
}

#[test]
#[ignore = "long: the faults of the test above at a lower rate; run with --long"]
fn faults_of_the_sensor_and_the_line_are_recovered_from_and_counted() {
    assert_recovers_from_every_fault(RATE_HZ, 3);
}

fn assert_recovers_from_every_fault(rate_hz: f64, seed: u64) {
    /// The rate is set 0.5 s after the start, which takes 50 ms.
    const CONFIGURED_S: f64 = 0.55;
    let report = |at: f64| (at, b"\rr".to_vec());
    let mut keys: Vec<(f64, Vec<u8>)> = vec![(0.5, format!("i 0\rf {rate_hz}\r").into_bytes())];
    keys.extend([1.5, 6.0, 8.5, 11.0, 12.8, 17.5].map(report));
    keys.push((19.0, noise(20_000)));
    keys.push(report(20.5));
    let events = vec![
        (3.5, Event::SensorReset),
        (8.0, Event::Stuck(Some(0x00))),
        (8.3, Event::Stuck(None)),
        (10.5, Event::Stuck(Some(0xFF))),
        (10.8, Event::Stuck(None)),
        (12.5, Event::LoseEdges(3)),
        (14.5, Event::Unplugged(true)),
        (15.7, Event::Unplugged(false)),
    ];
    let scenario =
        Scenario { sensor: Some(Sensor::Published(seed)), keys, events, seconds: 24.0, ..Scenario::default() };
    let Outcome { sensor, received, diagnostics, .. } = run(image(), scenario);
    assert_eq!(diagnostics, [""; 0], "neither a reset nor an access to an unmapped address");
    let sensor = sensor.expect("a sensor");
    let decoded = Decoded::decode(&received);
    assert_eq!(decoded.counters.missing, 0);
    let healths = decoded.healths();
    let logs = decoded.logs();
    println!("{logs:#?}");
    let [quiet, reset, low, high, lost, unplugged, .., flood] = healths[..] else { panic!("{healths:?}") };
    assert_eq!((quiet.lost_edges, quiet.suspect, quiet.recoveries), (0, 0, 0), "{quiet:?}");

    // After its reset the sensor gives no edge for at least 100 ms, and is configured before its samples are used.
    assert_eq!(reset.recoveries, 1);
    assert!(f64::from(reset.lost_edges) >= 0.1 * rate_hz, "{reset:?}");
    // A burst that the reset cuts short is refused: its bits are shifted. The sensor reports a frame with a wrong number of clocks then.
    assert!(reset.shifted <= 1 && reset.used + reset.shifted == reset.bursts, "{reset:?}");
    assert_eq!(reset.shifted, reset.diag_spi, "{reset:?}");

    // After 16 bursts of a stuck line sampling stops, and the sensor is probed until it answers.
    assert_eq!((low.stuck_low, low.recoveries), (16, 2), "{low:?}");
    assert_eq!((high.stuck_high, high.recoveries), (16, 3), "{high:?}");
    assert!(logs.iter().any(|log| log.contains("PROD_ID answered 0 ")) && logs.iter().any(|log| log.contains("65535")));

    // Three lost edges are a gap of three samples and nothing else.
    assert_eq!((lost.lost_edges - high.lost_edges, lost.recoveries), (3, 3), "{lost:?}");

    // Unplugged for 1.2 s.
    assert_eq!(unplugged.recoveries, 4);
    assert!(f64::from(unplugged.lost_edges - lost.lost_edges) >= 1.2 * rate_hz - 1.0, "{unplugged:?}");

    // 20,000 random bytes cost no sample and change no setting; lost bytes and invalid commands are counted.
    assert_eq!(flood.lost_edges, unplugged.lost_edges, "{flood:?}");
    assert!(flood.bad_commands > unplugged.bad_commands);
    assert_eq!(decoded.hellos().iter().filter(|hello| hello.sample_rate_hz != rate_hz).count(), 0);
    assert_eq!(flood.queue_full, 0);

    // Every sample period since the configuration is counted. A report begins with the time and ends with the counters,
    // up to 2 s later, as the random bytes request tables too.
    let health_at = decoded.messages.iter().rposition(|message| matches!(message, Message::Health(_)));
    let before = &decoded.messages[..health_at.expect("a report")];
    let hello =
        before.iter().rev().find_map(|message| if let Message::Hello(hello) = message { Some(hello) } else { None });
    let periods = (hello.expect("a report begins with its hello").uptime_us as f64 * 1e-6 - CONFIGURED_S) * rate_hz;
    let counted = f64::from(flood.bursts + flood.lost_edges + flood.suspect + flood.settling);
    assert!(
        (periods - 0.07 * rate_hz..periods + 2.0 * rate_hz).contains(&counted),
        "{counted} of {periods}: {flood:?}"
    );
    assert!(sensor.bursts.len() as u32 >= flood.bursts);
}

#[test]
fn a_reset_by_pin_costs_at_most_a_second_of_statistics() {
    const RESET_S: f64 = 4.0;
    let keys = vec![(0.5, b"i 0\re 3600\r".to_vec()), (3.9, b"r".to_vec()), (6.0, b"r".to_vec())];
    let events = vec![(RESET_S, Event::ResetPin)];
    let scenario = Scenario { sensor: Some(Sensor::Published(4)), keys, events, seconds: 8.0, ..Scenario::default() };
    let Outcome { sensor, received, diagnostics, .. } = run(image(), scenario);
    assert!(diagnostics.iter().all(|diagnostic| diagnostic.starts_with("reset")), "{diagnostics:?}");
    let sensor = sensor.expect("a sensor");
    let decoded = Decoded::decode(&received);
    let hello = decoded.hellos()[decoded.hellos().len() - 1].clone();
    assert_eq!((hello.boot.cause, hello.boot.starts, hello.boot.restored_channels), (BootCause::Pin, 2, 8));
    assert_eq!(hello.epoch_s, 3600, "settings are kept");

    // The statistics are those of the first stretch up to the last checkpoint, and those of the second.
    let restarted = sensor.bursts.windows(2).rposition(|pair| pair[1].0 != pair[0].0 + 1).expect("a gap") + 1;
    let (before, after) = sensor.bursts.split_at(restarted);
    let used = decoded.healths()[decoded.healths().len() - 1].used as usize;
    let channels = decoded.channels();
    for report in &channels[channels.len() - 8..] {
        // The report is made channel by channel while sampling continues, so a channel may lack the latest samples.
        let kept = (0..used).map(|fewer| report.samples as usize - (used - fewer)).find(|&kept| {
            let stretches = [&before[..kept.min(before.len())], after];
            kept <= before.len() && in_stretches(&stretches, &hello, report).octaves == report.octaves
        });
        let kept = kept.expect("the sums of two stretches");
        assert!((before.len() - kept) as f64 <= 1.2 * 204.8, "{kept} of {} samples kept", before.len());
        println!("channel {}: {kept} of {} samples kept over the reset", report.channel, before.len());
    }
}

/// Runs the image with one event that restarts it, and returns the report requested at the end.
fn report_after(event: Event, at_s: f64, seconds: f64) -> (Hello, Health) {
    let keys = vec![(0.1, b"i 0\r".to_vec()), (seconds - REPORT_S, b"\rr".to_vec())];
    let events = vec![(at_s, event)];
    let scenario = Scenario { sensor: Some(Sensor::Published(7)), keys, events, seconds, ..Scenario::default() };
    let Outcome { sensor, received, diagnostics, .. } = run(image(), scenario);
    let restarts = diagnostics.iter().filter(|diagnostic| diagnostic.starts_with("reset")).count();
    assert_eq!(restarts, 1, "{diagnostics:?}");
    let decoded = Decoded::decode(&received);
    let (hello, health) = (decoded.hellos()[0].clone(), **decoded.healths().last().expect("a report"));
    println!("{event:?}: {:?}", hello.boot);
    // Since the restart it samples, and has lost nothing.
    assert!(hello.sampling, "{hello:?}");
    assert_eq!((health.used, health.lost_edges), (health.bursts, 0), "{health:?}");
    let up_s = hello.uptime_us as f64 * 1e-6;
    let counted_s = f64::from(health.bursts + health.settling) / RATE_HZ;
    // The self-test takes 48 ms at this rate: 12 ms at 819.2 SPS (data sheet Rev. B, Table 1).
    assert!((up_s - 0.11..up_s + REPORT_S).contains(&counted_s), "{counted_s} s of bursts, up for {up_s} s");
    assert!(sensor.is_some_and(|sensor| sensor.bursts.len() as u32 >= health.bursts));
    (hello, health)
}

/// A failed DMA transfer costs that burst and nothing else: no byte of it is left for the next one. One whose end raises no
/// interrupt is ended when no burst has come for 25 ms; after such a silence the sensor is left alone for its start-up time of
/// 290 ms.
#[test]
fn a_failed_transfer_costs_one_sample() {
    let keys = vec![(0.1, b"i 0\r".to_vec()), (2.0, b"r".to_vec()), (6.0, b"r".to_vec())];
    // The second comes when the first report has been sent.
    let events = vec![(1.5, Event::StopReceiving), (2.0 + REPORT_S, Event::LoseBurstEnd)];
    let sensor = Some(Sensor::Published(11));
    let scenario = Scenario { sensor, keys, events, seconds: 6.0 + REPORT_S, ..Scenario::default() };
    let Outcome { sensor, received, diagnostics, .. } = run(image(), scenario);
    assert_eq!(diagnostics, [""; 0]);
    let decoded = Decoded::decode(&received);
    let healths = decoded.healths();
    let [stopped, silent] = healths[..] else { panic!("{healths:?}") };
    for (health, recoveries) in [(stopped, 0), (silent, 1)] {
        println!("{health:?}");
        assert_eq!((health.bus_errors, health.recoveries), (1, recoveries), "{health:?}");
        assert_eq!((health.used, health.shifted, health.frozen), (health.bursts, 0, 0), "{health:?}");
        assert!(f64::from(health.lost_edges) < 0.4 * RATE_HZ * f64::from(recoveries) + 1.0, "{health:?}");
    }
    assert!(f64::from(stopped.used) > 1.5 * RATE_HZ, "{stopped:?}");
    assert!(f64::from(silent.used) > 4.8 * RATE_HZ, "{silent:?}");
    assert_eq!(sensor.expect("a sensor").violations.len(), 1, "the short frame");
}

/// The counter of microseconds stops, without which no wait would end.
#[test]
#[ignore = "long: eight emulated seconds of a busy loop take half a minute; run with --long"]
fn the_watchdog_ends_a_hang() {
    let (hello, _) = report_after(Event::StopCounter, 3.0, 15.0);
    assert_eq!(hello.boot.cause, BootCause::Watchdog);
    assert_eq!((hello.boot.starts, hello.boot.restored_channels), (2, 8), "{:?}", hello.boot);
    assert_eq!(hello.boot.crash_record, "");
    // The watchdog's time of 8 s counts an oscillator of 32 kHz, exact here; a real one may be 47 % faster or slower.
    let up_s = hello.uptime_us as f64 * 1e-6;
    assert!((15.0 - REPORT_S - 3.0 - up_s - 8.0).abs() < 0.6, "up for {up_s} s");
}

/// The period that was programmed is overwritten with 0, which the main loop finds; the interrupts go on.
#[test]
fn a_panic_is_recorded_with_its_place() {
    let (hello, _) = report_after(Event::ClearInMemory(PERIOD), 0.25, 4.0);
    assert_eq!((hello.boot.cause, hello.boot.starts), (BootCause::Software, 2));
    let record = hello.boot.crash_record.as_str();
    assert!(record.starts_with("panic at device.rs:"), "{record}");
    assert!(record.ends_with(": memory is damaged: the sample period is 0"), "{record}");
}

#[test]
fn a_hard_fault_is_recorded_with_its_address() {
    let (hello, _) = report_after(Event::BusError, 3.0, 6.5);
    assert_eq!((hello.boot.cause, hello.boot.starts, hello.boot.restored_channels), (BootCause::Software, 2, 8));
    let record = hello.boot.crash_record.as_str();
    assert!(record.starts_with("hard fault at 0x0800") || record.starts_with("hard fault at 0x0801"), "{record}");
}

/// The random contents of memory are not taken for statistics, settings or a crash record.
#[test]
fn after_a_brown_out_the_image_starts_afresh() {
    let (hello, health) = report_after(Event::BrownOut, 3.0, 6.5);
    assert_eq!((hello.boot.cause, hello.boot.starts, hello.boot.restored_channels), (BootCause::BrownOut, 1, 0));
    assert_eq!((hello.boot.crash_record.as_str(), hello.epoch, hello.sample_rate_hz), ("", 0, RATE_HZ));
    assert_eq!(health.recoveries, 0);
}

/// A report takes more stack than there is. After the restart everything else works, and the statistics continue.
#[test]
fn a_stack_overflow_faults_and_is_recorded() {
    let typed = |keys: &str| (1.5, keys.as_bytes().to_vec());
    let quiet = (0.1, b"i 0\r".to_vec());
    let scenario = |keys| Scenario { sensor: Some(Sensor::Published(5)), keys, seconds: 5.0, ..Scenario::default() };
    let whole = run(image(), scenario(vec![quiet.clone(), typed("r")]));
    let used = Decoded::decode(&whole.received).healths()[0].stack_bytes;

    let shallow = images::with_stack(image(), (used - 1024) & !7);
    let keys = vec![quiet, typed("r"), (3.5, b"s".to_vec()), (4.5, b"k".to_vec())];
    let Outcome { sensor, received, diagnostics, .. } = run(&shallow, scenario(keys));
    let lines = Decoded::decode(&received).lines;
    println!("with enough stack {used} B were used; {diagnostics:?}; {lines:#?}");
    assert_eq!(diagnostics.iter().filter(|diagnostic| diagnostic.starts_with("reset")).count(), 1, "{diagnostics:?}");
    for expected in ["start 2: Software, 8 channels restored", "crash record: stack overflow", "sensor sampled"] {
        assert!(lines.iter().any(|line| line.contains(expected)), "{expected}: {lines:?}");
    }
    // All bursts since the restart were used: at 204.8 SPS more than 300 until the counters were printed.
    let counter = |name: &str| counter(&lines, name).unwrap_or(0);
    assert_eq!(counter("used"), counter("bursts"));
    assert!(counter("lost_edges") == 0 && counter("bursts") > 300, "{lines:?}");
    assert!(sensor.is_some_and(|sensor| sensor.violations.is_empty()));
}

/// A sensor that sleeps without end is woken by the pulse of the second step of recovery, which is as long as the data sheet
/// asks for (Rev. B, Table 1: 20 us), or by a frame of the first.
#[test]
fn a_sleeping_sensor_is_woken() {
    let keys = vec![(0.1, b"i 0\r".to_vec()), (6.0, b"r".to_vec())];
    let events = vec![(2.0, Event::SensorSleep)];
    let sensor = Some(Sensor::Published(26));
    let Outcome { sensor, received, .. } =
        run(image(), Scenario { sensor, keys, events, seconds: 8.0, ..Scenario::default() });
    let (sensor, decoded) = (sensor.expect("a sensor"), Decoded::decode(&received));
    println!("{:#?}, pulses of {:?} ns", decoded.logs(), sensor.pulses_ns);
    assert!(sensor.pulses_ns.iter().all(|&pulse| pulse >= 20_000), "{:?}", sensor.pulses_ns);
    let health = **decoded.healths().last().expect("a report");
    assert_eq!((health.recoveries, health.bus_resets <= 1, health.sensor_resets), (1, true, 0), "{health:?}");
    // Two seconds before, and at least two of the four after: steps come once a second.
    assert!(f64::from(health.used) > 4.0 * RATE_HZ, "{health:?}");
}

/// A data-ready line that oscillates at 125 kHz for 50 ms is masked, and told; the next step of recovery takes its edges again.
#[test]
fn an_oscillating_data_ready_line_is_masked() {
    let keys = vec![(0.1, b"i 0\r".to_vec()), (5.0, b"r".to_vec())];
    let events = vec![(2.0, Event::Oscillate(50_000_000))];
    let sensor = Some(Sensor::Published(28));
    let Outcome { received, diagnostics, .. } =
        run(image(), Scenario { sensor, keys, events, seconds: 7.0, ..Scenario::default() });
    assert_eq!(diagnostics, [""; 0], "no restart");
    let decoded = Decoded::decode(&received);
    println!("{:#?}", decoded.logs());
    assert!(decoded.logs().iter().any(|log| log.contains("oscillates and is masked")), "{:?}", decoded.logs());
    let health = **decoded.healths().last().expect("a report");
    assert_eq!((health.data_ready_masked, health.recoveries, health.queue_full), (1, 1, 0), "{health:?}");
    assert!(f64::from(health.used) > 3.3 * RATE_HZ, "{health:?}");
}

/// A fit that takes more stack than there is crashes whenever the epoch is learned from: after the second time it is not, and the device
/// samples on with its statistics.
#[test]
fn an_epoch_whose_fit_crashes_is_given_up() {
    let sensor = Some(Sensor::Published(33));
    let keys = vec![(0.1, b"i 0\re 10\r".to_vec()), (11.5, b"e 0\r".to_vec())];
    let scenario = Scenario { sensor, keys, seconds: 30.0, ..Scenario::default() };
    let whole = run(image(), scenario.clone());
    let healths =
        Decoded::decode(&whole.received).healths().iter().map(|health| health.stack_bytes).collect::<Vec<_>>();
    let learned = *healths.last().expect("the report of the epoch");
    let keys = vec![(0.1, b"i 0\r".to_vec()), (8.0, b"r".to_vec())];
    let reported = run(image(), Scenario { keys, seconds: 11.0, ..scenario.clone() });
    let reported = Decoded::decode(&reported.received).healths()[0].stack_bytes;
    assert!(learned > reported + 1024, "{learned} B to learn, {reported} B to report");

    let shallow = images::with_stack(image(), reported.midpoint(learned) & !7);
    // Keys may come while the device starts.
    let typed = [(13.0, "\re 0\r"), (15.0, "\re 0\r"), (24.0, "s"), (24.5, "r")];
    let typed = typed.map(|(at_s, keys)| (at_s, keys.as_bytes().to_vec()));
    let keys = [&scenario.keys[..], &typed].concat();
    let Outcome { received, diagnostics, .. } = run(&shallow, Scenario { keys, seconds: 30.0, ..scenario });
    let decoded = Decoded::decode(&received);
    println!("{diagnostics:?}; {:#?}", decoded.lines);
    let restarts = diagnostics.iter().filter(|diagnostic| diagnostic.starts_with("reset")).count();
    assert_eq!(restarts, 2, "{diagnostics:?}");
    for expected in ["start 3: Software, ", "crash record: stack overflow", "sensor sampled"] {
        assert!(decoded.lines.iter().any(|line| line.contains(expected)), "{expected}: {:?}", decoded.lines);
    }
    let (hello, health) = (decoded.hellos(), decoded.healths());
    let (hello, health) = (hello.last().expect("a report"), health.last().expect("a report"));
    assert_eq!((hello.epoch, hello.boot.safe_mode), (1, false), "{hello:?}");
    assert_eq!((health.used, health.lost_edges), (health.bursts, 0), "{health:?}");
}

/// After the third crash within ten minutes the device starts without anything that was stored, says so, and takes commands.
#[test]
fn the_third_crash_in_a_row_is_followed_by_safe_mode() {
    let keys =
        vec![(0.1, b"i 0\re 3600\r".to_vec()), (6.5, b"s".to_vec()), (7.0, b"e 60\r".to_vec()), (7.5, b"r".to_vec())];
    let events = [1.5, 3.0, 4.5].map(|at_s| (at_s, Event::ClearInMemory(PERIOD))).to_vec();
    let scenario = Scenario { sensor: Some(Sensor::Published(34)), keys, events, seconds: 10.0, ..Scenario::default() };
    let Outcome { received, diagnostics, .. } = run(image(), scenario);
    let decoded = Decoded::decode(&received);
    println!("{diagnostics:?}; {:#?} {:#?}", decoded.logs(), decoded.lines);
    assert_eq!(diagnostics.iter().filter(|diagnostic| diagnostic.starts_with("reset")).count(), 3, "{diagnostics:?}");
    assert_eq!(decoded.logs().iter().filter(|log| log.starts_with("safe mode")).count(), 1, "{:?}", decoded.logs());
    assert!(decoded.lines.iter().any(|line| line.starts_with("safe mode after three crashes")), "{:?}", decoded.lines);
    let hello = decoded.hellos()[0];
    let Boot { starts, restored_channels, safe_mode, ref crash_record, .. } = hello.boot;
    assert_eq!((starts, restored_channels, safe_mode), (4, 0, true), "{hello:?}");
    assert!(crash_record.starts_with("panic at device.rs:"), "{crash_record}");
    assert_eq!((hello.epoch_s, hello.sampling), (60, true), "it takes commands: {hello:?}");
    let health = **decoded.healths().last().expect("a report");
    assert_eq!((health.used, health.recoveries), (health.bursts, 0), "{health:?}");
}

/// The boot loader in the system memory of the part is started from a reset, with that memory at address 0. In the emulator it is empty: the
/// stack pointer that is loaded from there is 0, and the first push goes to the word below.
#[test]
fn the_boot_loader_is_started_on_command() {
    let keys = vec![(0.1, b"i 0\r".to_vec()), (1.5, b"bootsel\r".to_vec())];
    let scenario = Scenario { sensor: Some(Sensor::Published(35)), keys, seconds: 2.0, ..Scenario::default() };
    let Outcome { diagnostics, registers, .. } = run(image(), scenario);
    println!("{diagnostics:#?}");
    assert_eq!(diagnostics.iter().filter(|diagnostic| diagnostic.starts_with("reset")).count(), 1, "{diagnostics:?}");
    assert!(diagnostics.iter().any(|diagnostic| diagnostic.starts_with("unmapped at=0xfffffffc")), "{diagnostics:?}");
    assert_eq!(registers[&SYSCFG_MEMRMP] & 0b11, 0b01, "the memory at address 0");
}
