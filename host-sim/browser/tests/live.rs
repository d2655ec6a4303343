//! The page with a device. The port plays the output of the firmware's image in the emulator.

use crate::harness::{IMAGE, drive};
use crate::same_report::{TOLERANCE_OF_SIMULATION, differences_from_command};
use emulation::{Outcome, Scenario, Sensor};
use link::{Decoder, Message, Received};
use observatory::bench::{BenchPlan, BenchRun, checks, write_table};
use serde_json::json;
use system_tests::stm32f4::{Typed, h405_image, run};

/// One message of each kind, including the terms and regressors of a channel.
const KEPT: &[u8] = include_bytes!("../../../firmware/link/tests/kept_stream/version-4-mixed-alarm.bin");
/// Time for a report, s.
const REPORT_S: f64 = 3.0;
/// The emulated board does less than the page requests. A repeated step gets its answer again, and the pauses of the page take no time of
/// the board.
const SHORT: BenchPlan = BenchPlan { reads: 10_000, noise_s: 1.5, bursts_s: 2.0 };

/// The answers of the emulated Olimex STM32-H405 to two requests for a report, to the start and the end of a recording, and to the steps of
/// [`SHORT`], each with its command.
fn answers() -> Vec<(String, Vec<u8>)> {
    // The first report follows after four seconds of samples, the second after seven; the recording lasts six.
    let before =
        Typed::nothing().then("i 0", 4.0).then("r", REPORT_S).then("r", REPORT_S).then("w 1", 6.0).then("w 0", 0.2);
    let typed = before.then_steps(SHORT.steps().into_iter().map(|step| (step.command, step.seconds)), REPORT_S);
    let keys = typed.keys().map(|(at_s, text)| (at_s, text.into_bytes())).collect();
    let (sensor, seconds) = (Some(Sensor::Published(41)), typed.end_s);
    let Outcome { received, sensor, .. } = run(h405_image(), Scenario { sensor, keys, seconds, ..Scenario::default() });
    assert_eq!(sensor.expect("a sensor").violations, [""; 0]);
    let answers = typed.answers(&received).into_iter().map(|(command, bytes)| (command.to_owned(), bytes));
    // The page does not turn off the reports that the device sends by itself.
    answers.skip(1).collect()
}

/// `live.js` defines what is checked. Every check of the bench passes, and the table of the bench and the report of a recording equal those
/// of the command.
#[test]
fn a_device_is_shown_recorded_and_checked() {
    const TEST: &str = "live::a_device_is_shown_recorded_and_checked";
    let mut answers = answers();
    let mut short_bench = answers.split_off(4).into_iter().peekable();
    // The page repeats its request when the stream ends.
    answers.insert(3, ("w 1".to_owned(), Vec::new()));
    let (mut decoder, plan) = (Decoder::new(), BenchPlan::default());
    // Points of the curves of gyros and accelerometers in each report.
    let mut points = Vec::new();
    for (_, bytes) in &answers {
        let mut octaves = 0;
        for received in bytes.iter().filter_map(|byte| decoder.push(*byte)) {
            if let Received::Message { message: Message::Channel(report), .. } = received {
                octaves += if report.channel < 6 { report.octaves.len() } else { 0 };
            }
        }
        points.push(octaves);
    }
    assert!(0 < points[0] && points[0] < points[1], "{points:?}");
    let mut bench = BenchRun::new(&plan, decoder.counters());
    let mut answered = (String::new(), Vec::new());
    while let Some((_, step)) = bench.begin_step() {
        answered = short_bench.next_if(|(command, _)| *command == step.command).unwrap_or(answered);
        assert_eq!(answered.0, step.command);
        for received in answered.1.iter().filter_map(|byte| decoder.push(*byte)) {
            bench.take(received);
        }
        answers.push(answered.clone());
    }
    assert_eq!(short_bench.next(), None, "every step has its answer");
    let checks = checks(&bench.finish(decoder.counters()));
    for check in &checks {
        // There is one port, so the check of a second port is not run.
        assert!(check.cause.is_none() && (!check.measured.is_empty() || check.name == "second port"), "{check:?}");
    }
    assert!(checks.len() >= 20, "{}", checks.len());
    let mut table = Vec::new();
    write_table(&checks, &mut table).expect("memory");
    let table = String::from_utf8(table).expect("text");
    let answers: Vec<_> =
        answers.into_iter().map(|(command, bytes)| json!({ "command": command, "bytes": bytes })).collect();
    let input = json!({ "answers": answers, "points": points[0], "table": table, "finding": KEPT, "image": IMAGE });
    let folder = tempfile::tempdir().expect("a folder");
    if !drive(TEST, "live.js", "observatory.html", folder.path(), &input.to_string()) {
        return;
    }
    // The page has saved the recording under this name.
    let recording = folder.path().join("device.bin");
    std::fs::rename(folder.path().join("recorded.bin"), &recording).expect("recorded");
    let report = folder.path().join("recorded.json");
    let arguments = ["analyze".to_owned(), recording.display().to_string()];
    let found = differences_from_command(&arguments, &report, TOLERANCE_OF_SIMULATION);
    assert!(found.is_empty(), "{}", found.join("\n"));
}
