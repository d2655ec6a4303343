//! `bench`, the command of the host, on the emulated boards: its steps are typed one after the other, and every check passes.

use super::bench::{feather_image, image, run};
use emulation::{FEATHER, H405, Outcome, Scenario, Sensor, Wiring};
use host_sim::bench::{BenchPlan, Step, Transcript, checks, write_table};
use link::Decoder;
use std::path::Path;

const PLAN: BenchPlan = BenchPlan { reads: 10_000, noise_s: 1.5, bursts_s: 2.0 };

/// Time before the first step, s: the sensor is left alone for its start-up, and probed.
const FIRST_S: f64 = 0.8;

/// The steps with their times in s, which are enough for a board whose report takes `report_s`, and the end.
fn schedule(report_s: f64) -> (Vec<(f64, Step)>, f64) {
    let mut now_s = FIRST_S;
    let mut steps = Vec::new();
    for step in PLAN.steps() {
        let seconds = match step.command.split(' ').next().unwrap_or_default() {
            "w" if step.command == "w 1" => step.seconds,
            "r" => report_s,
            "compare" | "check" | "measure" | "deflect" => 0.8,
            "g" | "n" | "f" => 0.6,
            _ => 0.15,
        };
        steps.push((now_s, step));
        now_s += seconds;
    }
    (steps, now_s)
}

/// The keys that type the steps.
fn keys(steps: &[(f64, Step)]) -> impl Iterator<Item = (f64, String)> {
    steps.iter().map(|(at_s, step)| (*at_s, format!("{}\r", step.command)))
}

/// Asserts that every check passes, of what a port has sent, each byte with its time in ns.
fn assert_passes(steps: &[(f64, Step)], received: &[(u64, u8)]) {
    let (mut decoder, mut transcript, mut bytes) = (Decoder::new(), Transcript::default(), received.iter().peekable());
    for (index, (_, step)) in steps.iter().enumerate() {
        let end_s = steps.get(index + 1).map_or(f64::INFINITY, |(at_s, _)| *at_s);
        let mut answer = Vec::new();
        while let Some(&(_, byte)) = bytes.next_if(|(at, _)| (*at as f64) < end_s * 1e9) {
            answer.extend(decoder.push(byte));
        }
        transcript.push(step, answer);
    }
    transcript.counters = decoder.counters();
    let checks = checks(&transcript);
    let mut table = Vec::new();
    write_table(&checks, &mut table).expect("memory");
    println!("{}", String::from_utf8(table).expect("text"));
    for check in &checks {
        // One port, and so no second one.
        assert!(check.cause.is_none() && (!check.measured.is_empty() || check.name == "second port"), "{check:?}");
    }
    assert!(checks.len() >= 20, "{}", checks.len());
    let sck = checks.iter().find(|check| check.name == "SCK").expect("a check");
    assert!(sck.measured.ends_with(" Hz in a burst"), "{sck:?}");
}

fn assert_stm32_passes(image: &Path, wiring: Wiring, seed: u64) {
    let (steps, seconds) = schedule(3.0);
    let keys = keys(&steps).map(|(at_s, text)| (at_s, text.into_bytes())).collect();
    let sensor = Some(Sensor::Published(seed));
    let Outcome { received, sensor, .. } =
        run(image, Scenario { wiring, sensor, keys, seconds, ..Scenario::default() });
    assert_passes(&steps, &received);
    assert_eq!(sensor.expect("a sensor").violations, [""; 0]);
}

#[test]
fn every_check_of_the_bench_passes_on_the_h405() {
    assert_stm32_passes(image(), H405, 41);
}

#[test]
#[ignore = "long: the same on the other board with this microcontroller; run with --long"]
fn every_check_of_the_bench_passes_on_the_feather() {
    assert_stm32_passes(feather_image(), FEATHER, 42);
}

#[test]
#[ignore = "long: 40 emulated seconds with software floating point take a minute; run with --long"]
fn every_check_of_the_bench_passes_on_the_pico() {
    let (steps, seconds) = schedule(9.0);
    let keys: Vec<String> = keys(&steps).map(|(at_s, text)| format!("{at_s}={text}")).collect();
    let keys: Vec<&str> = keys.iter().map(String::as_str).collect();
    let (received, part) = super::pico::run_sound(43, seconds, &keys);
    assert_passes(&steps, &received);
    assert_eq!(part.violations(), []);
}
