//! The host's command `bench` on the emulated boards: its steps are typed one after the other, and every check must pass.

use super::bench::{feather_image, run};
use emulation::{FEATHER, Outcome, Scenario, Sensor};
use host_sim::bench::{BenchPlan, Transcript, checks, write_table};
use link::Decoder;
use system_tests::stm32f4::Typed;

const PLAN: BenchPlan = BenchPlan { reads: 10_000, noise_s: 1.5, bursts_s: 2.0 };

/// The typed steps for a board whose report takes `report_s`.
fn typed(report_s: f64) -> Typed {
    Typed::nothing().then_steps(PLAN.steps().into_iter().map(|step| (step.command, step.seconds)), report_s)
}

/// Asserts that every check passes for what a port has sent, bytes with their times in ns.
fn assert_passes(typed: &Typed, received: &[(u64, u8)]) {
    let (mut decoder, mut transcript) = (Decoder::new(), Transcript::default());
    for (step, (_, answer)) in PLAN.steps().iter().zip(typed.answers(received)) {
        transcript.push(step, answer.into_iter().filter_map(|byte| decoder.push(byte)).collect());
    }
    transcript.counters = decoder.counters();
    let checks = checks(&transcript);
    let mut table = Vec::new();
    write_table(&checks, &mut table).expect("memory");
    println!("{}", String::from_utf8(table).expect("text"));
    for check in &checks {
        // There is one port, so the check of a second port is not run.
        assert!(check.cause.is_none() && (!check.measured.is_empty() || check.name == "second port"), "{check:?}");
    }
    assert!(checks.len() >= 20, "{}", checks.len());
    let sck = checks.iter().find(|check| check.name == "SCK").expect("a check");
    assert!(sck.measured.ends_with(" Hz in a burst"), "{sck:?}");
}

// The test of the page with a device does the same with the H405.
#[test]
#[ignore = "long: the same on the other board with this microcontroller; run with --long"]
fn every_check_of_the_bench_passes_on_the_feather() {
    let typed = typed(3.0);
    let keys = typed.keys().map(|(at_s, text)| (at_s, text.into_bytes())).collect();
    let (sensor, seconds) = (Some(Sensor::Published(42)), typed.end_s);
    let scenario = Scenario { wiring: FEATHER, sensor, keys, seconds, ..Scenario::default() };
    let Outcome { received, sensor, .. } = run(feather_image(), scenario);
    assert_passes(&typed, &received);
    assert_eq!(sensor.expect("a sensor").violations, [""; 0]);
}

#[test]
#[ignore = "long: 40 emulated seconds with software floating point take a minute; run with --long"]
fn every_check_of_the_bench_passes_on_the_pico() {
    let typed = typed(9.0);
    let keys: Vec<String> = typed.keys().map(|(at_s, text)| format!("{at_s}={text}")).collect();
    let keys: Vec<&str> = keys.iter().map(String::as_str).collect();
    let (received, part) = super::pico::run_sound(43, typed.end_s, &keys);
    assert_passes(&typed, &received);
    assert_eq!(part.violations(), []);
}
