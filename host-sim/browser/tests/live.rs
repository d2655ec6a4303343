//! The page with a device, whose port plays what the firmware sends on the virtual sensor.

use crate::harness::{IMAGE, drive};
use crate::same_report::{TOLERANCE_OF_SIMULATION, differences_from_command};
use link::Decoder;
use observatory::bench::{BenchPlan, BenchRun, checks, write_table};
use serde_json::{Value, json};
use simulation::Device;
use virtual_sensor::{NoiseModel, VirtualAdis16405};

/// Time of the device between two looks at what it has sent, µs.
const STEP_US: u64 = 20_000;
/// One message of each kind, the terms and regressors of a channel among them.
const KEPT: &[u8] = include_bytes!("../../../firmware/link/tests/kept_stream/version-4-mixed-alarm.bin");

/// A device in its own time, and its answers to commands, one after the other.
struct Player {
    device: Device,
    now_us: u64,
    /// Each with the command and the bytes that the device sent after it.
    answers: Vec<Value>,
}

impl Player {
    /// A device that has probed its sensor.
    fn new() -> Self {
        let part = VirtualAdis16405::new(NoiseModel::paper(), 5);
        let mut device = Device::new(part, Device::blank_memory()).with_restarts();
        device.run_until(500_000);
        Self { device, now_us: 500_000, answers: Vec::new() }
    }

    /// Sends a command, and keeps what comes until `is_answered` says so of some bytes, or for a time.
    fn ask(&mut self, command: &str, seconds: f64, mut is_answered: impl FnMut(&[u8]) -> bool) {
        self.device.press(format!("{command}\r").as_bytes());
        let (end_us, mut answer) = (self.now_us + (1e6 * seconds) as u64, Vec::new());
        while self.now_us < end_us {
            self.now_us += STEP_US;
            let sent = self.device.run_until(self.now_us);
            let is_whole = is_answered(&sent);
            answer.extend(sent);
            if is_whole {
                break;
            }
        }
        self.answers.push(json!({ "command": command, "bytes": answer }));
    }
}

/// `live.js` says what is looked at. The table of the bench and the report of a recording are those of the command.
#[test]
fn a_device_is_shown_recorded_and_checked() {
    const TEST: &str = "live::a_device_is_shown_recorded_and_checked";
    let mut player = Player::new();
    player.ask("r", 30.0, |_| false);
    player.ask("r", 60.0, |_| false);
    player.ask("w 1", 20.0, |_| false);
    // The page asks again when the stream ends.
    player.answers.push(json!({ "command": "w 1", "bytes": [] }));
    player.ask("w 0", 1.0, |_| false);
    let (mut decoder, plan) = (Decoder::new(), BenchPlan::default());
    let mut bench = BenchRun::new(&plan, decoder.counters());
    while let Some((_, step)) = bench.begin_step() {
        player.ask(&step.command, step.seconds, |bytes| {
            // All of them belong to this step, also those behind its end.
            let mut is_whole = false;
            for received in bytes.iter().filter_map(|byte| decoder.push(*byte)) {
                is_whole |= bench.take(received);
            }
            is_whole
        });
    }
    let mut table = Vec::new();
    write_table(&checks(&bench.finish(decoder.counters())), &mut table).expect("memory");
    let table = String::from_utf8(table).expect("text");
    assert!(!table.contains("FAIL"), "{table}");
    let input = json!({ "answers": player.answers, "table": table, "finding": KEPT, "image": IMAGE });
    let folder = tempfile::tempdir().expect("a folder");
    if !drive(TEST, "live.js", "observatory.html", folder.path(), &input.to_string()) {
        return;
    }
    // The page has saved it by this name.
    let recording = folder.path().join("device.bin");
    std::fs::rename(folder.path().join("recorded.bin"), &recording).expect("recorded");
    let report = folder.path().join("recorded.json");
    let arguments = ["analyze".to_owned(), recording.display().to_string()];
    let found = differences_from_command(&arguments, &report, TOLERANCE_OF_SIMULATION);
    assert!(found.is_empty(), "{}", found.join("\n"));
}
