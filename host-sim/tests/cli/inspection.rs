//! `inspect`, and the command that `analyze` proposes where a file does not say enough. `recordings` tests the content of files.

use crate::program::{imunoise, json_of, write};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;
use std::path::Path;
use std::process::Output;
use tempfile::tempdir;

const PROGRAM: &str = env!("CARGO_BIN_EXE_imunoise");
const ROWS: u32 = 6000;

fn name(file: &Path) -> &str {
    file.to_str().expect("UTF-8")
}

/// Nearly normal noise with a standard deviation of 1.
fn normal(rng: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
}

/// Standard error of a command that fails; it prints nothing else. The error comes first.
fn refusal(output: &Output) -> String {
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.code() == Some(1) && output.stdout.is_empty() && text.starts_with("error: "), "{text}");
    text
}

fn inspected(file: &Path) -> String {
    let output = imunoise(&["inspect", name(file)]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// The arguments of the first command that is proposed.
fn command(text: &str) -> Vec<&str> {
    let line = text.lines().find_map(|line| line.trim().strip_prefix("imunoise ")).unwrap_or_else(|| panic!("{text}"));
    line.split_whitespace().map(|word| word.trim_matches('\'')).collect()
}

/// Rows `t x y z x y z` without a heading at 100 Hz: an accelerometer at rest in m/s^2, and a gyroscope of 131 LSB per deg/s in rad/s.
#[test]
fn columns_without_names_are_shown_with_the_command_that_reads_them() {
    const MPU_RAD_S: f64 = 1.0 / 131.0 * std::f64::consts::PI / 180.0;
    let dir = tempdir().expect("a folder");
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let row = |row: u32| {
        let force = [0.1, -0.2, 0.97].map(|part| 9.81 * (part + 0.002 * normal(&mut rng)));
        let rate = [3.0, -2.0, 1.0].map(|bias: f64| MPU_RAD_S * (bias + 9.0 * normal(&mut rng)).round());
        let [force, rate] = [force, rate].map(|axes| axes.map(|value| format!("{value:.9}")).join(" "));
        format!("{:.2} {force} {rate}\n", f64::from(row) / 100.0)
    };
    let file = write(&dir, "rows.txt", (0..ROWS).map(row).collect::<String>().as_bytes());
    let text = refusal(&imunoise(&["analyze", name(&file)]));
    let columns = "time=0,gyro_x=4,gyro_y=5,gyro_z=6,accl_x=1,accl_y=2,accl_z=3";
    let expected = ["analyze", name(&file), "--columns", columns, "--units", "rad/s,m/s^2"];
    assert_eq!(command(&text), expected, "{text}");
    assert!(text.contains("first values") && text.contains("131.0 LSB per deg/s"), "{text}");
    // The command opens the file, and `--accept-guess` takes it and says so.
    let by_command = json_of(&dir, &command(&text));
    assert_eq!(by_command, json_of(&dir, &["analyze", name(&file), "--accept-guess"]));
    let report: Value = serde_json::from_slice(&by_command).expect("JSON");
    assert_eq!((&report["samples"], &report["dropped"]["gap"]), (&Value::from(ROWS), &Value::from(0)));
    let taken = imunoise(&["analyze", name(&file), "--accept-guess", "--quiet"]);
    assert!(String::from_utf8_lossy(&taken.stderr).contains("guessed: imunoise analyze"), "a guess is told");
    // The same without an error.
    let shown = inspected(&file);
    for words in ["6000 rows at 100.0000 Hz", "no sample missing", "at rest all the time"] {
        assert!(shown.contains(words), "{words}: {shown}");
    }
    assert_eq!(command(&shown), expected, "{shown}");
}

/// Without evidence nothing is taken, and a rate never is.
#[test]
fn a_guess_in_doubt_is_shown_and_not_taken() {
    let dir = tempdir().expect("a folder");
    let mut rng = ChaCha8Rng::seed_from_u64(12);
    let mut table = |heading: &str, noise: f64| {
        let rows: String = (0..1000).map(|row| format!("{row},{:.6}\n", noise * normal(&mut rng))).collect();
        write(&dir, "rows.csv", format!("{heading}\n{rows}").as_bytes())
    };
    for (heading, noise, words) in [
        ("p,q", 1.0, &["gyro_x=COLUMN"][..]),
        // Noise of 0.002 may be that of a rate in rad/s or of a good one in deg/s.
        ("t,gyro_x", 0.002, &["--units rad/s", "in doubt", "takes no guess"]),
        ("n,gyro_x_deg_s", 1.0, &["--rate HZ"]),
    ] {
        let file = table(heading, noise);
        let text = refusal(&imunoise(&["analyze", name(&file), "--accept-guess"]));
        assert!(words.iter().all(|word| text.contains(word)), "{heading}: {text}");
    }
}

/// A sensor that is turned for 8 s at the beginning, of which the 5 s from 20 to 25 s are missing: `inspect` and `analyze` offer one part,
/// in the time of the stamps.
#[test]
fn the_part_at_rest_is_the_same_in_inspect_and_analyze() {
    let dir = tempdir().expect("a folder");
    let mut rng = ChaCha8Rng::seed_from_u64(16);
    let mut row = |row: u32| {
        let moved = if row < 800 { 20.0 } else { 0.0 };
        let rate = [0, 1, 2].map(|_| format!("{:.5}", moved + 0.05 * normal(&mut rng)));
        format!("{:.3},{}\n", f64::from(row) * 0.01, rate.join(","))
    };
    let rows: String = (0..10_000).filter(|row| !(2000..2500).contains(row)).map(&mut row).collect();
    let file = write(&dir, "turned.csv", format!("time_s,gx [dps],gy [dps],gz [dps]\n{rows}").as_bytes());
    // A quarter of the seventh block of 128 rows is moved, which its median does not show: it is left out as the one beside the movement.
    let offered = "--from 9 --to 100";
    let shown = inspected(&file);
    assert!(shown.contains(&format!("longest part at rest: {offered}, in s")), "{shown}");
    for part in [&[][..], &["--from", "1"]] {
        let output = imunoise(&[&["analyze", name(&file)], part].concat());
        let text = String::from_utf8(output.stdout).expect("UTF-8");
        let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(text.contains(&format!("for the longest part at rest, add {offered}.")), "{part:?}: {text}");
    }
}

/// Tables of the kinds that need options: each command that `inspect` prints runs as it is, once the rate is filled in.
#[test]
fn every_printed_command_runs() {
    let mut rng = ChaCha8Rng::seed_from_u64(17);
    let mut three = |deviation: f64, of: [f64; 3], separator: &str| {
        of.map(|value| format!("{:.5}", value + deviation * normal(&mut rng))).join(separator)
    };
    let gravity = [0.0, 0.0, 9.80665];
    let mut files: Vec<(&str, String)> = Vec::new();
    let rows = |heading: &str, row: &mut dyn FnMut(u32) -> String| {
        heading.to_owned() + &(0..ROWS).map(|at| row(at) + "\n").collect::<String>()
    };
    files.push((
        "numbers.txt",
        rows("", &mut |at| {
            format!("{:.2} {} {}", f64::from(at) / 100.0, three(0.01, gravity, " "), three(0.002, [0.0; 3], " "))
        }),
    ));
    files.push(("no time.csv", rows("gx,gy,gz\n", &mut |_| three(0.2, [0.0; 3], ","))));
    files.push((
        "merged.csv",
        rows("t_ms,gx_dps,gy_dps,gz_dps,ax_g,ay_g,az_g\n", &mut |at| {
            let (time, is_rate) = (10 * at, at % 3 != 0);
            if is_rate {
                format!("{time},{},,,", three(0.1, [0.0; 3], ","))
            } else {
                format!("{time},,,,{}", three(0.001, [0.0, 0.0, 1.0], ","))
            }
        }),
    ));
    files.push((
        "labels.txt",
        rows("", &mut |at| {
            let time = 10 * (at / 2);
            if at % 2 == 0 {
                format!("acc {time} {}", three(0.001, [0.0, 0.0, 1.0], " "))
            } else {
                format!("gyro {time} {}", three(0.1, [0.0; 3], " "))
            }
        }),
    ));
    // Rows of two kinds, of which the first one alone has a heading: the unit of the others is in doubt.
    files.push((
        "one heading.txt",
        rows("% 'ACCE;time (ms);Acc_X(m/s^2);Acc_Y(m/s^2);Acc_Z(m/s^2)'\n", &mut |at| {
            let time = 10 * (at / 2);
            if at % 2 == 0 {
                format!("ACCE;{time};{}", three(0.01, gravity, ";"))
            } else {
                format!("GYRO;{time};{}", three(0.002, [0.0; 3], ";"))
            }
        }),
    ));
    files.push((
        "devices.csv",
        rows("id,t_ms,gx_dps,gy_dps,gz_dps\n", &mut |at| {
            format!("{},{},{}", at % 2, 5 * at, three(0.1, [0.0; 3], ","))
        }),
    ));
    files.push((
        "packets.csv",
        rows("Packet number,Gyroscope X (deg/s),Gyroscope Y (deg/s),Gyroscope Z (deg/s)\n", &mut |at| {
            format!("{at},{}", three(0.1, [0.0; 3], ","))
        }),
    ));
    files.push((
        "warm.csv",
        rows("t_s,wx,wy,wz,temp\n", &mut |at| {
            format!("{:.2},{},31.{}", f64::from(at) / 100.0, three(0.2, [0.0; 3], ","), at % 10)
        }),
    ));
    files.push((
        "moved.csv",
        rows("t_s,gx_dps,gy_dps,gz_dps\n", &mut |at| {
            let turned = if at < 2000 { 30.0 } else { 0.0 };
            format!("{:.2},{}", f64::from(at) / 100.0, three(0.05, [turned; 3], ","))
        }),
    ));
    let dir = tempdir().expect("a folder");
    let mut run = 0;
    for (file, content) in files {
        let file = write(&dir, file, content.as_bytes());
        let shown = inspected(&file);
        let commands: Vec<&str> = shown.lines().filter_map(|line| line.trim().strip_prefix("imunoise ")).collect();
        assert!(!commands.is_empty(), "{shown}");
        for command in commands {
            let words = format!("{PROGRAM} {} --quiet", command.replace("--rate HZ", "--rate 100"));
            let output = std::process::Command::new("sh").args(["-c", &words]).output().expect("a shell");
            assert!(output.status.success(), "{words}: {}\n{shown}", String::from_utf8_lossy(&output.stderr));
            run += 1;
        }
        if file.ends_with("warm.csv") {
            assert!(shown.contains("degC"), "{shown}");
        }
        if file.ends_with("moved.csv") {
            assert!(
                shown.contains("analyze")
                    && shown.lines().any(|line| line.contains("imunoise") && line.contains("--from 2")),
                "{shown}"
            );
        }
    }
    assert!(run >= 12, "{run} commands");
}
