//! The device at its worst: a hang, a panic, a fault, a supply that dips. It starts again and says why.

use crate::bench::{Event, Outcome, Scenario, run};
use crate::decoded::Decoded;
use crate::{image, sensor};
use link::{BootCause, Health, Hello};

const RATE_HZ: f64 = 204.8;
/// A report takes less.
const REPORT_S: f64 = 2.5;

/// What the report says that is asked for at the end of a run with one event in it.
fn after(event: Event, at_s: f64, seconds: f64) -> (Hello, Health) {
    let keys = vec![(0.1, b"i 0\r".to_vec()), (seconds - REPORT_S, b"\rr".to_vec())];
    let scenario = Scenario { sensor: Some(sensor(7)), keys, events: vec![(at_s, event)], seconds };
    let Outcome { sensor, received, complaints, .. } = run(image(), scenario);
    let restarts = complaints.iter().filter(|complaint| complaint.starts_with("reset")).count();
    assert_eq!(restarts, 1, "{complaints:?}");
    let decoded = Decoded::of(&received);
    let (hello, health) = (decoded.hellos()[0].clone(), **decoded.healths().last().expect("a report"));
    println!("{event:?}: {:?}", hello.boot);
    // It samples again, loses nothing, and counts from the restart on.
    assert!(hello.sampling, "{hello:?}");
    assert_eq!((health.used, health.lost_edges), (health.bursts, 0), "{health:?}");
    let up_s = hello.uptime_us as f64 * 1e-6;
    let counted_s = f64::from(health.bursts) / RATE_HZ;
    assert!((up_s - 0.07..up_s + REPORT_S).contains(&counted_s), "{counted_s} s of bursts, up for {up_s} s");
    assert!(sensor.is_some_and(|sensor| sensor.bursts.len() as u32 >= health.bursts));
    (hello, health)
}

/// The end of a burst is never told. The sensor seems silent, and the main loop waits for the bus for ever.
#[test]
fn the_watchdog_ends_a_hang() {
    let (hello, _) = after(Event::LoseBurstEnd, 3.0, 15.0);
    assert_eq!(hello.boot.cause, BootCause::Watchdog);
    assert_eq!((hello.boot.starts, hello.boot.restored_channels), (2, 8), "{:?}", hello.boot);
    assert_eq!(hello.boot.crash_record, "");
    // 8 s by an oscillator of 32 kHz; the part's may be 47 % faster or slower.
    let up_s = hello.uptime_us as f64 * 1e-6;
    assert!((15.0 - REPORT_S - 3.0 - up_s - 8.0).abs() < 0.6, "up for {up_s} s");
}

/// 64 samples have not come yet, so the programmed period is divided by, of which nothing is left.
#[test]
fn a_panic_leaves_its_place() {
    const PERIOD: u64 = 8 * 156_250; // 8 ticks of 1/1638.4 s in 1/256 us
    let (hello, _) = after(Event::Lose(PERIOD), 0.25, 4.0);
    assert_eq!((hello.boot.cause, hello.boot.starts), (BootCause::Software, 2));
    let words = hello.boot.crash_record.as_str();
    assert!(words.starts_with("panic at ") && words.contains("acquisition.rs:"), "{words}");
}

#[test]
fn a_fault_leaves_its_place() {
    let (hello, _) = after(Event::BusError, 3.0, 6.5);
    assert_eq!((hello.boot.cause, hello.boot.starts, hello.boot.restored_channels), (BootCause::Software, 2, 8));
    let words = hello.boot.crash_record.as_str();
    assert!(words.starts_with("hard fault at 0x0800") || words.starts_with("hard fault at 0x0801"), "{words}");
}

/// Memory holds noise: nothing of it is taken for statistics, settings or last words.
#[test]
fn a_brown_out_is_a_clean_start() {
    let (hello, health) = after(Event::BrownOut, 3.0, 6.5);
    assert_eq!((hello.boot.cause, hello.boot.starts, hello.boot.restored_channels), (BootCause::BrownOut, 1, 0));
    assert_eq!((hello.boot.crash_record.as_str(), hello.epoch, hello.sample_rate_hz), ("", 0, RATE_HZ));
    assert_eq!(health.recoveries, 0);
}
