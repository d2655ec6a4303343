//! Files that the program writes: none is a file that it reads, under whatever name; each is complete or as it was, and none that exists is
//! overwritten unasked.

use crate::program::{counts as table, error_line, imunoise, signal, wait_until, with_default_signals, write};
use std::fs::{self, File};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use tempfile::tempdir;

const PROGRAM: &str = env!("CARGO_BIN_EXE_imunoise");

fn name(file: &Path) -> &str {
    file.to_str().expect("UTF-8")
}

fn is_refused(output: &Output) {
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success() && error.contains("is an input"), "{error}");
}

#[test]
fn the_profile_of_the_sensor_is_an_input() {
    let dir = tempdir().expect("a folder");
    let rows = table(&dir);
    let profile = write(&dir, "p.toml", b"name = \"x\"\n");
    is_refused(&imunoise(&[
        "analyze",
        name(&rows),
        "--sensor",
        name(&profile),
        "-o",
        &format!("json={}", name(&profile)),
    ]));
    assert_eq!(fs::read(&profile).expect("the profile"), b"name = \"x\"\n");
}

#[test]
fn another_name_of_an_input_is_the_input() {
    let dir = tempdir().expect("a folder");
    let rows = table(&dir);
    let content = fs::read(&rows).expect("rows");
    let hard = dir.path().join("hard.csv");
    fs::hard_link(&rows, &hard).expect("a link");
    is_refused(&imunoise(&["analyze", name(&rows), "-o", name(&hard)]));
    assert!(fs::read(&rows).expect("the input") == content);
}

#[test]
fn a_figure_that_leads_to_an_input_is_the_input() {
    let dir = tempdir().expect("a folder");
    let rows = table(&dir);
    let content = fs::read(&rows).expect("rows");
    std::os::unix::fs::symlink(&rows, dir.path().join("run1-gyro_x-allan.svg")).expect("a link");
    let figures = dir.path().join("run1.svg");
    is_refused(&imunoise(&["analyze", name(&rows), "--force", "-o", name(&figures)]));
    assert!(fs::read(&rows).expect("the input") == content);
}

#[test]
fn the_file_on_standard_input_is_an_input() {
    let dir = tempdir().expect("a folder");
    let rows = table(&dir);
    let content = fs::read(&rows).expect("rows");
    let output = Command::new(PROGRAM)
        .args(["analyze", "-", "-o", name(&rows)])
        .stdin(File::open(&rows).expect("rows"))
        .output()
        .expect("the program starts");
    is_refused(&output);
    assert!(fs::read(&rows).expect("the input") == content);
}

/// The program in a shell where no file may grow beyond 4 KiB, as on a full disk.
fn on_a_full_disk(arguments: &[&str]) -> Output {
    let script = "trap '' XFSZ; ulimit -f 8; exec \"$@\"";
    let shell = [&["-c", script, "sh", PROGRAM], arguments].concat();
    Command::new("sh").args(shell).output().expect("a shell")
}

#[test]
fn a_file_that_cannot_be_written_whole_stays_as_it_was() {
    let dir = tempdir().expect("a folder");
    let rows = table(&dir);
    for (command, old) in [
        (&["convert", "--force"][..], "old.csv"),
        (&["analyze", "-f", "-q", "-o"], "old.json"),
        (&["analyze", "-f", "-q", "-o"], "old.html"),
    ] {
        let old = write(&dir, old, b"an old report\n");
        let arguments = [&command[..1], &[name(&rows)], &command[1..], &[name(&old)]].concat();
        let output = on_a_full_disk(&arguments);
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success() && error.contains("too large"), "{command:?}: {error}");
        assert_eq!(fs::read(&old).expect("the old file"), b"an old report\n", "{command:?}");
        fs::remove_file(&old).expect("removed");
    }
    assert_eq!(names(dir.path()), ["rows.csv"], "nothing is left beside");
}

#[test]
fn a_quiet_command_prints_nothing() {
    let dir = tempdir().expect("a folder");
    let rows = table(&dir);
    let page = dir.path().join("page.html");
    let output = imunoise(&["analyze", name(&rows), "-q", "-o", name(&page)]);
    assert!(output.status.success() && page.is_file());
    assert_eq!((output.stdout, output.stderr), (Vec::new(), Vec::new()));
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).expect("the folder");
    let mut names: Vec<String> =
        entries.map(|entry| entry.expect("a file").file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

#[test]
fn a_signal_leaves_the_old_file_and_nothing_beside_it() {
    for name_of_signal in ["TERM", "HUP", "INT"] {
        let dir = tempdir().expect("a folder");
        let log = write(&dir, "log.csv", b"an old log\n");
        let mut program = with_default_signals()
            .args(["simulate", name(&log), "--force", "--format", "frames", "--seconds", "80000"])
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("the program starts");
        wait_until("a file beside the old one", || names(dir.path()).len() == 2);
        signal(&program, name_of_signal);
        let status = program.wait().expect("an end");
        assert!(!status.success(), "{name_of_signal}");
        assert_eq!(fs::read(&log).expect("the old log"), b"an old log\n", "{name_of_signal}");
        assert_eq!(names(dir.path()), ["log.csv"], "{name_of_signal}");
    }
}

/// The signals of a process that are ignored or caught, where bit 0 is a hang-up.
fn signals(program: &Child, kind: &str) -> u64 {
    let status = fs::read_to_string(format!("/proc/{}/status", program.id())).expect("a process");
    let mask = status.lines().find_map(|line| line.strip_prefix(kind)).expect(kind);
    u64::from_str_radix(mask.trim_start_matches(':').trim(), 16).expect("a mask")
}

#[test]
fn a_hang_up_that_is_ignored_ends_nothing() {
    let dir = tempdir().expect("a folder");
    let log = dir.path().join("log.csv");
    let script = "trap '' HUP; exec \"$@\"";
    let mut program = Command::new("sh")
        .args(["-c", script, "sh", PROGRAM, "simulate", name(&log), "--format", "frames", "--seconds", "80000"])
        .stderr(Stdio::null())
        .spawn()
        .expect("a shell");
    // The log is in a folder beside its place until it is complete.
    let written = || {
        let files = |folder: &Path| fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok);
        let logs = files(dir.path()).flat_map(|folder| files(&folder.path()));
        logs.filter_map(|log| log.metadata().ok()).map(|log| log.len()).sum::<u64>()
    };
    wait_until("a log is begun", || written() > 0);
    assert_eq!((signals(&program, "SigIgn") & 1, signals(&program, "SigCgt") & 1), (1, 0), "still ignored");
    signal(&program, "HUP");
    let before = written();
    wait_until("the log grows", || written() > before);
    assert!(program.try_wait().expect("a status").is_none(), "it goes on");
    program.kill().expect("an end");
    program.wait().expect("an end");
}

#[test]
fn a_full_disk_is_named() {
    for arguments in [
        &["simulate", "/dev/full", "--seconds", "5"][..],
        &["simulate", "/dev/full", "--seconds", "5", "--format", "frames"],
    ] {
        let line = error_line(&imunoise(arguments));
        assert!(line.contains("/dev/full") && line.contains("No space left"), "{arguments:?}: {line}");
    }
    // The report is printed all the same.
    let dir = tempdir().expect("a folder");
    let output = imunoise(&["analyze", name(&table(&dir)), "-o", "csv=/dev/full"]);
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(1) && error.contains("No space left"), "{error}");
    assert!(String::from_utf8_lossy(&output.stdout).contains("°/√h"));
}

#[test]
fn outputs_are_checked_before_the_work_and_never_overwrite_the_input() {
    let dir = tempdir().expect("a folder");
    let file = table(&dir);
    let rows = fs::read(&file).expect("rows");
    let [link, blocked] = ["link.csv", "blocked"].map(|name| dir.path().join(name));
    std::os::unix::fs::symlink(&file, &link).expect("a link");
    let nowhere = dir.path().join("missing").join("out");
    // A folder is in the way of a file, and of the first figure.
    fs::create_dir_all(blocked.join("index.html")).expect("a folder");
    fs::create_dir(blocked.join("run1-overview-gyros.svg")).expect("a folder");
    for format in ["json", "kalibr", "html"] {
        let value = |file: &Path| format!("{format}={}", name(file));
        for same in [&file, &link] {
            is_refused(&imunoise(&["analyze", name(&file), "-o", &value(same)]));
        }
        let line = error_line(&imunoise(&["analyze", name(&file), "-o", &value(&nowhere)]));
        assert!(line.contains("No such file"), "{line}");
    }
    for output in ["index.html", "run1.svg"].map(|name| blocked.join(name)) {
        let line = error_line(&imunoise(&["analyze", name(&file), "-o", name(&output)]));
        assert!(line.contains(name(&blocked)), "{line}");
    }
    let twice = ["json", "csv"].map(|format| format!("{format}={}", name(&dir.path().join("twice"))));
    for [one, other] in [[twice[0].as_str(), &twice[1]], ["-", "kalibr=-"]] {
        let line = error_line(&imunoise(&["analyze", name(&file), "-o", one, "-o", other]));
        assert!(line.contains("named twice"), "{line}");
    }
    let [as_json, as_csv] = ["json", "csv"].map(|format| format!("{format}={}", name(&file)));
    for command in [
        &["compare", name(&file), "--data-sheet", "-o", &as_json][..],
        &["compare", name(&file), name(&file), "-o", &as_json],
        &["convert", name(&file), name(&link)],
        &["export", name(&file), "-o", &as_csv],
    ] {
        is_refused(&imunoise(command));
    }
    assert!(fs::read(&file).expect("the input") == rows);
}

#[test]
fn links_and_permissions_of_an_output_stay() {
    use std::os::unix::fs::PermissionsExt;
    let dir = tempdir().expect("a folder");
    let rows = table(&dir);
    let real = write(&dir, "real.csv", b"old");
    fs::set_permissions(&real, fs::Permissions::from_mode(0o640)).expect("permissions");
    let link = dir.path().join("link.csv");
    std::os::unix::fs::symlink(&real, &link).expect("a link");
    let output = imunoise(&["convert", name(&rows), name(&link), "--force"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(fs::symlink_metadata(&link).expect("the link").is_symlink());
    assert!(fs::read(&real).expect("a table").starts_with(b"time_s,gyro_x_counts\n"));
    assert_eq!(fs::metadata(&real).expect("a table").permissions().mode() & 0o777, 0o640);
}

/// Every command that writes files, and each of its options that names one.
#[test]
fn a_file_that_exists_is_overwritten_with_force_alone() {
    let dir = tempdir().expect("a folder");
    let rows = table(&dir);
    let report = dir.path().join("report.json");
    assert!(imunoise(&["analyze", name(&rows), "--quiet", "-o", name(&report)]).status.success());
    let [rows, report] = [name(&rows), name(&report)];
    let [old, page, figures, figure] =
        ["old", "page.html", "run1.svg", "run1-overview-gyros.svg"].map(|file| dir.path().join(file));
    let reports = dir.path().join("reports");
    let one_report = reports.join("rows.json");
    let [json, csv] = ["json", "csv"].map(|format| format!("{format}={}", name(&old)));
    for (command, file) in [
        (&["analyze", rows, "--quiet", "-o", &json][..], &old),
        (&["analyze", rows, "--quiet", "-o", &csv], &old),
        (&["analyze", rows, "--quiet", "-o", name(&page)], &page),
        (&["analyze", rows, "--quiet", "-o", name(&figures)], &figure),
        (&["batch", rows, "--quiet", "-o", name(&reports)], &one_report),
        (&["replay", rows, "--quiet", "-o", &json], &old),
        (&["demo", "--seconds", "60", "--quiet", "-o", name(&page)], &page),
        (&["compare", report, report, "-o", &json], &old),
        (&["export", report, "-o", &csv], &old),
        (&["convert", rows, name(&old)], &old),
        (&["simulate", name(&old), "--seconds", "5"], &old),
    ] {
        fs::create_dir_all(file.parent().expect("a folder")).expect("a folder");
        fs::write(file, "what was there").expect("written");
        let line = error_line(&imunoise(command));
        assert!(line.contains(name(file)) && line.contains("exists already; -f overwrites it"), "{command:?}: {line}");
        assert_eq!(fs::read(file).expect("the file"), b"what was there", "{command:?}");
        let output = imunoise(&[command, &["-f"]].concat());
        assert!(output.status.success(), "{command:?}: {}", String::from_utf8_lossy(&output.stderr));
        assert_ne!(fs::read(file).expect("the file"), b"what was there", "{command:?}");
        // Nor is what the program wrote in the call before.
        assert!(error_line(&imunoise(command)).contains("exists already"), "{command:?}");
    }
}

/// A recording of hours would be gone.
#[test]
fn a_recording_of_a_device_is_not_overwritten() {
    let dir = tempdir().expect("a folder");
    let log = write(&dir, "night.csv", b"a night\n");
    let line = error_line(&imunoise(&["record", name(&log), "--port", "/dev/null"]));
    assert!(line.contains("night.csv") && line.contains("exists already"), "{line}");
    let again = dir.path().join("again.csv");
    let line = error_line(&imunoise(&[
        "record",
        name(&again),
        "--port",
        "/dev/null",
        "-o",
        &format!("json={}", name(&again)),
    ]));
    assert!(line.contains("is an input"), "{line}");
    assert_eq!(names(dir.path()), ["night.csv"]);
}

/// Gyros and accelerometers in two files, as a phone writes them, or in one of two rates: one file for a filter has both.
#[test]
fn the_parts_of_a_sensor_are_exported_as_one() {
    let dir = tempdir().expect("a folder");
    let noise = |row: u32, axis: u32| f64::from((row * 7919 + axis * 104_729) % 2003) / 2003.0 - 0.5;
    let part = |file: &str, heading: &str, hz: f64, size: f64| {
        let rows = (0..4000).map(|row| {
            let [x, y, z] = [0, 1, 2].map(|axis| format!("{:.6}", size * noise(row, axis)));
            format!("{:.6},{x},{y},{z}\n", f64::from(row) / hz)
        });
        write(&dir, file, format!("{heading}\n{}", rows.collect::<String>()).as_bytes())
    };
    let gyro = part("gyro.csv", "t_s,gx_dps,gy_dps,gz_dps", 100.0, 0.2);
    let accl = part("accl.csv", "t_s,ax_g,ay_g,az_g", 62.5, 0.01);
    let [gyro_json, accl_json, yaml] = ["gyro.json", "accl.json", "imu.yaml"].map(|file| dir.path().join(file));
    for (file, json) in [(&gyro, &gyro_json), (&accl, &accl_json)] {
        assert!(imunoise(&["analyze", name(file), "--quick", "--quiet", "-o", name(json)]).status.success());
    }
    let has_both = |file: &Path| {
        let text = fs::read_to_string(file).expect("a file");
        ["gyroscope_noise_density: ", "accelerometer_noise_density: "].iter().all(|key| text.contains(key))
    };
    let exported = imunoise(&["export", name(&gyro_json), name(&accl_json), "-o", name(&yaml)]);
    assert!(exported.status.success() && has_both(&yaml), "{}", String::from_utf8_lossy(&exported.stderr));
    // So are recordings, and a recording beside a report.
    for gyros in [&gyro, &gyro_json] {
        let exported = imunoise(&["export", name(gyros), name(&accl), "-f", "-o", name(&yaml)]);
        assert!(exported.status.success() && has_both(&yaml), "{}", String::from_utf8_lossy(&exported.stderr));
    }
    // A format of samples has one rate.
    let vins = format!("vins={}", name(&yaml));
    let vins = ["export", "--force", name(&gyro_json), name(&accl_json), "-o", &vins];
    let line = error_line(&imunoise(&vins));
    assert!(line.contains("parts at 100"), "{line}");
    // The same in one table with blanks.
    let mut rows: Vec<(u32, String)> = Vec::new();
    for row in 0..4000 {
        let [x, y, z] = [0, 1, 2].map(|axis| noise(row, axis));
        rows.push((10 * row, format!("{},{:.5},{:.5},{:.5},,,\n", 10 * row, 0.2 * x, 0.2 * y, 0.2 * z)));
        rows.push((
            16 * row + 3,
            format!("{},,,,{:.5},{:.5},{:.5}\n", 16 * row + 3, 0.01 * x, 0.01 * y, 1.0 + 0.01 * z),
        ));
    }
    rows.sort();
    let rows: String = rows.into_iter().map(|(_, row)| row).collect();
    let merged = write(&dir, "merged.csv", format!("t_ms,gx_dps,gy_dps,gz_dps,ax_g,ay_g,az_g\n{rows}").as_bytes());
    let both = dir.path().join("both.yaml");
    let output = imunoise(&["analyze", name(&merged), "--each-sensor", "--quiet", "-o", name(&both)]);
    assert!(output.status.success() && has_both(&both), "{}", String::from_utf8_lossy(&output.stderr));
}
