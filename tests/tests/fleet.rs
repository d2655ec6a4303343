//! The statements of docs/fleet.md, run by DuckDB on a folder of reports, against what the reports themselves say.

use noise_analysis::analysis::analyze;
use noise_analysis::report::Report;
use reports::json::ReportJson;
use serde_json::Value;
use simulation::Simulation;
use std::path::{Path, PathBuf};
use std::process::Command;
use system_tests::note_skipped;
use virtual_sensor::{InjectedEffect, OutputRegister};

/// Seconds of each simulated record: long enough for a rate random walk of 0.05 °/s/√s, not for those of the others.
const SECONDS: f64 = 240.0;
/// Angle random walks of the fleet over that of the first part; the last part is noisier than all others.
const PARTS: [(&str, f64); 5] = [("a", 1.0), ("b", 1.02), ("c", 0.98), ("d", 1.01), ("e", 2.0)];
/// The part whose gyro y drifts, the part that vibrates, and the frequency of the vibration, Hz.
const DRIFTS: &str = "c";
const VIBRATES: &str = "d";
const VIBRATION_HZ: f64 = 20.3;

/// Runs every SQL block of the page in the folder that holds `reports`, and prints the rows of the last ones as JSON.
const SCRIPT: &str = r"
import json, os, re, sys
import duckdb
page, folder = sys.argv[1:]
statements = re.findall(r'```sql\n(.*?)```', open(page).read(), re.S)
os.chdir(folder)
connection = duckdb.connect()
print(json.dumps([connection.execute(statement).fetchall() for statement in statements]))
";

fn simulated(part: &str, factor: f64, seed: u64) -> Report {
    let mut simulation = Simulation::paper(SECONDS, seed);
    for gyro in [OutputRegister::GyroX, OutputRegister::GyroY, OutputRegister::GyroZ] {
        simulation.noise.channel_mut(gyro).angle_random_walk *= factor;
    }
    if part == DRIFTS {
        simulation.noise.channel_mut(OutputRegister::GyroY).rate_random_walk = 0.05;
    }
    if part == VIBRATES {
        simulation.scenario.effects = vec![InjectedEffect::Sinusoid {
            channel: OutputRegister::GyroX,
            frequency_hz: VIBRATION_HZ,
            amplitude: 0.5,
            phase_rad: 0.0,
        }];
    }
    let recording = simulation.run(|_| ()).expect("a simulation");
    analyze(&recordings::time_base::measurement(&recording, None).expect("a time base"))
}

/// The rows of each statement of the page.
fn answers(python: &Path, folder: &Path) -> Vec<Vec<Vec<Value>>> {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/fleet.md");
    let output = Command::new(python).args(["-c", SCRIPT]).arg(page).arg(folder).output().expect("Python runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("JSON")
}

#[test]
fn the_statements_of_the_page_answer_as_the_reports_do() {
    let test = "the_statements_of_the_page_answer_as_the_reports_do";
    let Some(python) = std::env::var_os("ADIS_PYTHON").map(PathBuf::from) else {
        return note_skipped(test, "ADIS_PYTHON names no Python with DuckDB");
    };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let reports = folder.path().join("reports");
    std::fs::create_dir(&reports).expect("a folder");
    let mut rows = 0;
    for (seed, (part, factor)) in PARTS.into_iter().enumerate() {
        let report = simulated(part, factor, seed as u64);
        rows += report.channels.iter().map(|channel| channel.assessment.coefficients.len()).sum::<usize>();
        let json = serde_json::to_vec(&ReportJson::from(&report)).expect("JSON");
        std::fs::write(reports.join(format!("{part}.json")), json).expect("room");
    }
    let answers = answers(&python, folder.path());
    let [loaded, coefficients, drift, lines, noisy, kinds] = answers.as_slice() else {
        panic!("{} statements on the page", answers.len());
    };
    assert_eq!(loaded[0][0], PARTS.len());
    assert_eq!(coefficients[0][0], rows);
    assert_eq!((&drift[0][0], &drift[0][1]), (&DRIFTS.into(), &"gyro_y".into()), "{drift:?}");
    let vibrating: Vec<&Vec<Value>> = lines.iter().filter(|row| row[0] == VIBRATES).collect();
    let hz = vibrating[0][3].as_f64().expect("a frequency");
    // A sinusoid of this size is located much better than a thousandth of the record's resolution of 1/240 Hz; the host's
    // clock, the bound here, is good to 100 ppm.
    assert!((hz / VIBRATION_HZ - 1.0).abs() < 2e-4, "{hz} Hz");
    assert_eq!(vibrating[0][1][0], "gyro_x");
    for gyro in ["gyro_x", "gyro_y", "gyro_z"] {
        assert!(noisy.iter().any(|row| row[0] == "e" && row[1] == gyro), "{gyro}: {noisy:?}");
    }
    assert!(noisy.iter().all(|row| row[0] == "e" || row[1].as_str().is_some_and(|name| !name.starts_with("gyro"))));
    let sinusoids = kinds.iter().find(|row| row[0] == "sinusoid").expect("the vibration");
    assert_eq!(sinusoids[1], 1, "{kinds:?}");
}
