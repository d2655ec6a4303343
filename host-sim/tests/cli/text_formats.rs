//! Texts as people's loggers write them: calendar times, sentences, rows without a number, and characters that a terminal obeys.

use crate::program::{host_sim, json_of, write};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;
use system_tests::recording;
use tempfile::{TempDir, tempdir};

const ROWS: u32 = 6000;

/// The report of a text, and what is said of its reading.
fn analysed(dir: &TempDir, text: &str, arguments: &[&str]) -> Value {
    let file = write(dir, "recording.txt", text.as_bytes());
    let arguments = [&["analyze", file.to_str().expect("UTF-8")], arguments].concat();
    serde_json::from_slice(&json_of(dir, &arguments)).expect("JSON")
}

fn refusal(text: &[u8], arguments: &[&str]) -> String {
    let dir = tempdir().expect("a folder");
    let file = write(&dir, "recording.csv", text);
    let output = host_sim(&[&["analyze", file.to_str().expect("UTF-8"), "--quiet"], arguments].concat());
    assert!(!output.status.success());
    String::from_utf8(output.stderr).expect("UTF-8")
}

/// White noise of 0.02 rad/s at `row`.
fn noise(rng: &mut ChaCha8Rng) -> f64 {
    ((0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0) * 0.02
}

/// Date and time of day of a row at so many Hz after 10:00:13, which may go past midnight.
fn stamp(row: u32, hz: f64, start_s: f64, decimals: usize) -> (u32, String) {
    let time = start_s + f64::from(row) / hz;
    let time = (time * 10f64.powi(decimals as i32)).floor() / 10f64.powi(decimals as i32);
    let (day, second) = ((time / 86_400.0).floor(), time.rem_euclid(86_400.0));
    let (hour, minute) = ((second / 3600.0) as u32, (second / 60.0) as u32 % 60);
    let width = if decimals == 0 { 2 } else { decimals + 3 };
    (25 + day as u32, format!("{hour:02}:{minute:02}:{:0width$.decimals$}", second.rem_euclid(60.0)))
}

#[test]
fn calendar_times_in_one_or_two_columns_show_the_rate() {
    let dir = tempdir().expect("a folder");
    let columns = ["--columns", "gyro_x=2", "--units", "rad/s"];
    // Across midnight; whole seconds at 5 Hz; each with its separator and heading.
    for (name, hz, decimals, heading, arguments) in [
        ("two columns of blanks", 5.0, 0, "", &columns[..]),
        ("two columns of commas", 50.0, 3, "date,time,gyro_x [rad/s]\n", &[]),
        ("one name for two columns", 50.0, 3, "stamp gyro_x_rad_s\n", &[]),
        ("one column", 50.0, 6, "timestamp,gyro_x [rad/s]\n", &[]),
        ("month and day", 50.0, 3, "timestamp;gyro_x [rad/s]\n", &[]),
        ("time of day", 50.0, 3, "time,gyro_x [rad/s]\n", &[]),
    ] {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let rows: String = (0..ROWS)
            .map(|row| {
                let (day, time) = stamp(row, hz, 86_400.0 - 60.0, decimals);
                let value = noise(&mut rng);
                match name {
                    "two columns of blanks" | "one name for two columns" => {
                        format!("2018-04-{day}   {time} {value:.5}\n")
                    }
                    "two columns of commas" => format!("{day}.04.2018,{time},{value:.5}\n"),
                    "one column" => format!("2018-04-{day}T{time}Z,{value:.5}\n"),
                    "month and day" => format!("04/{day}/2018 {time};{value:.5}\n"),
                    _ => format!("{time},{value:.5}\n"),
                }
            })
            .collect();
        let report = analysed(&dir, &format!("{heading}{rows}"), arguments);
        assert_eq!(report["samples"], ROWS, "{name}");
        assert_eq!(report["dropped"]["gap"], 0, "{name}");
        let rate = report["sample_rate_hz"].as_f64().expect("a rate") / hz;
        // A stamp is known to its last digit, over the length of the record.
        let tolerance = 1e-6 + 10f64.powi(-(decimals as i32)) * hz / f64::from(ROWS);
        assert!((rate - 1.0).abs() < tolerance, "{name}: {rate}");
    }
}

#[test]
fn a_phone_with_whole_seconds_at_5_hz_is_read() {
    let test = "a_phone_with_whole_seconds_at_5_hz_is_read";
    let Some(file) = recording(test, "others/phone_gyro4.txt") else { return };
    let dir = tempdir().expect("a folder");
    let columns = ["--columns", "gyro_x=2,gyro_y=3,gyro_z=4", "--units", "rad/s"];
    let arguments = [&["analyze", file.to_str().expect("UTF-8")], &columns[..]].concat();
    let report: Value = serde_json::from_slice(&json_of(&dir, &arguments)).expect("JSON");
    let rate = report["sample_rate_hz"].as_f64().expect("a rate");
    assert!((rate / 5.0 - 1.0).abs() < 0.01, "{rate}");
}

/// Three channels at 5 Hz of noise whose deviation is one count, 0.001: two neighbouring rows are equal in 0.28³ of the cases, 2 %. Where
/// the stamps are whole seconds, all of a second are at one time. With finer stamps a fifth of the rows is written again 50 ms later.
#[test]
fn rows_that_are_equal_by_chance_are_samples() {
    let dir = tempdir().expect("a folder");
    let columns = ["--columns", "time=0,gyro_x=1,gyro_y=2,gyro_z=3", "--units", "rad/s"];
    for (decimals, repeats) in [(0, false), (2, false), (2, true)] {
        let mut rng = ChaCha8Rng::seed_from_u64(11);
        let (mut text, mut again) = (String::new(), 0_u64);
        for row in 0..ROWS {
            let (whole, cents) = (row / 5, 20 * (row % 5));
            let stamp = |cents: u32| if decimals == 0 { format!("{whole}") } else { format!("{whole}.{cents:02}") };
            let values = [(); 3].map(|()| format!("{:.3}", (50.0 * noise(&mut rng)).round() / 1000.0)).join(" ");
            text.push_str(&format!("{} {values}\n", stamp(cents)));
            if repeats && rng.random_bool(0.2) {
                text.push_str(&format!("{} {values}\n", stamp(cents + 5)));
                again += 1;
            }
        }
        let report = analysed(&dir, &text, &columns);
        let (samples, repeated) =
            (report["samples"].as_u64(), report["dropped"].get("repeated").and_then(Value::as_u64));
        assert_eq!((samples, repeated.unwrap_or(0)), (Some(u64::from(ROWS)), again), "{decimals} {repeats}");
    }
}

fn sentence(content: &str) -> String {
    format!("${content}*{:02X}\r\n", content.bytes().fold(0u8, |sum, byte| sum ^ byte))
}

#[test]
fn sentences_are_checked_and_those_of_vectornav_known_by_name() {
    let dir = tempdir().expect("a folder");
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let mut text = String::new();
    let (mut known, mut other) = (Vec::new(), Vec::new());
    for _ in 0..ROWS {
        let [x, y, z] = std::array::from_fn(|_| noise(&mut rng));
        let fields = format!(
            "+006.380,+000.023,-001.953,+1.0640,-0.2531,+3.0614,+00.005,+00.344,-09.758,{x:+.6},{y:+.6},{z:+.6}"
        );
        known.push(sentence(&format!("VNYMR,{fields}")));
        other.push(sentence(&format!("PIMU,12,{x:+.6},{y:+.6},{z:+.6}")));
    }
    text.extend(known.iter().map(String::as_str));
    let complete = analysed(&dir, &text, &["--rate", "40"]);
    assert_eq!(complete["samples"], ROWS);
    let channel = |report: &Value, name: &str| -> Value {
        let channels = report["channels"].as_array().expect("a list");
        channels.iter().find(|of| of["name"] == name).expect(name).clone()
    };
    // 0.02 rad/s at 40 Hz in deg/s: the deviation of neighbours is that of a sample.
    let deviation = channel(&complete, "gyro_x")["curve"][0]["adev"].as_f64().expect("a number");
    assert!((deviation / 0.02f64.to_degrees() - 1.0).abs() < 5.0 / f64::from(ROWS).sqrt(), "{deviation}");
    // Damaged sentences, and others between them.
    let mut damaged = known.clone();
    for at in [100, 2000, 2001, 5999] {
        damaged[at] = damaged[at].replace("-09.758", "-09.753");
    }
    damaged.insert(500, sentence("GPGLL,4916.45,N,12311.12,W,225444,A,"));
    let file = write(&dir, "damaged.txt", damaged.concat().as_bytes());
    let output = host_sim(&["analyze", file.to_str().expect("UTF-8"), "--rate", "40", "--json", "-"]);
    let notes = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(notes.contains("4 sentences whose checksum is wrong") && notes.contains("1 lines that are no"), "{notes}");
    let report: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(channel(&report, "gyro_y")["refused"]["missing"], 4, "{notes}");
    // Of another sender by the numbers of the fields.
    let columns = ["--columns", "gyro_x=2,gyro_y=3,gyro_z=4", "--units", "rad/s", "--rate", "40"];
    let report = analysed(&dir, &other.concat(), &columns);
    assert_eq!(channel(&report, "gyro_x")["curve"], channel(&complete, "gyro_x")["curve"]);
}

#[test]
fn rows_without_a_number_are_missing_samples() {
    let dir = tempdir().expect("a folder");
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    for missing in [3, 100] {
        let rows: String = (0..ROWS).map(|_| format!("{:.5}\n", noise(&mut rng))).collect();
        let report = analysed(
            &dir,
            &format!("{}{rows}", "nan\n".repeat(missing)),
            &["--columns", "gyro_x=0", "--units", "rad/s", "--rate", "100"],
        );
        assert_eq!(report["channels"][0]["refused"]["missing"], missing);
    }
}

#[test]
fn errors_are_short_and_hide_nothing() {
    // A right-to-left override in the name of a column.
    let error = refusal("a\u{202e}b,c\n1,2\n".as_bytes(), &[]);
    assert!(!error.contains('\u{202e}') && error.contains("202e"), "{error}");
    let error = refusal(b"time_s,gyro_x_deg_s\n0,1\n1,2\n", &["--topic", "imu"]);
    assert!(error.contains("--topic imu") && error.contains("no topics"), "{error}");
    let error = refusal(b"time_s,gyro_x_counts\n0,1\n1,2\n", &["--topic", "imu"]);
    assert!(error.contains("--topic imu") && error.contains("no topics"), "{error}");
    // Values that no sensor measures.
    let rows: String = (0..3000).map(|row| format!("{}.5e160\n", row * 7919 % 41 - 20)).collect();
    let error = refusal(format!("gyro_x_deg_s\n{rows}").as_bytes(), &["--rate", "100"]);
    assert!(error.contains("out_of_range"), "{error}");
    // A text of 100 kB where the report has a number.
    let dir = tempdir().expect("a folder");
    let text = format!("{{\"schema\": \"{}\"}}", "x".repeat(100_000));
    let file = write(&dir, "report.json", text.as_bytes());
    let output = host_sim(&["compare", file.to_str().expect("UTF-8"), "--data-sheet"]);
    assert!(!output.status.success() && output.stderr.len() < 4000, "{} bytes", output.stderr.len());
}

/// Tables as programs of other countries and systems write them: each has 6000 samples at 100 Hz of a white noise of 0.02 rad/s, N =
/// 0.02·(180/π)/√100 = 0.1146 deg/√s; what is in it is read without options.
#[test]
fn tables_of_any_country_and_program_are_read_without_options() {
    let dir = tempdir().expect("a folder");
    let time = |row: u32| format!("{:.2}", f64::from(row) / 100.0);
    let comma = |value: f64| format!("{value:.6}").replace('.', ",");
    type Row<'a> = Box<dyn Fn(u32, f64) -> String + 'a>;
    let cases: [(&str, &str, Row); 8] = [
        (
            "decimal commas, BOM and CR LF",
            "\u{feff}t [s];gyro_x [rad/s]\r\n",
            Box::new(|row, value| format!("{};{}\r\n", time(row).replace('.', ","), comma(value))),
        ),
        (
            "a row of units",
            "time;Gyro X;Gyro Y\ns;rad/s;rad/s\n",
            Box::new(|row, value| format!("{};{value:.6};0\n", time(row))),
        ),
        (
            "degrees in Latin-1",
            "t [s],gx [\u{b0}/s]\n",
            Box::new(|row, value| format!("{},{:.5}\n", time(row), value.to_degrees())),
        ),
        (
            "quotation marks",
            "\"Time (s)\",\"Gyroscope x (rad/s)\"\n",
            Box::new(|row, value| format!("\"{}\",\"{value:.6E}\"\n", time(row))),
        ),
        (
            "milliseconds by the name",
            "millis\tgyro_x_rad_s\n",
            Box::new(|row, value| format!("{}\t{value:.6}\n", 10 * row + 1234)),
        ),
        (
            "a serial monitor",
            "12:00:00.000 -> gx [rad/s],gy [rad/s]\n",
            Box::new(|row, value| {
                format!("12:{:02}:{:02}.{:03} -> {value:.6},0\n", row / 6000, row / 100 % 60, row % 100 * 10)
            }),
        ),
        ("a rate in a comment", "// Update Rate: 100.0Hz\nGyr_X_rad_s\n", Box::new(|_, value| format!("{value:.6}\n"))),
        (
            "a magnetometer without a unit",
            "time_s,gyro_x_rad_s,mag_x\n",
            Box::new(|row, value| format!("{},{value:.6},0.3\n", time(row))),
        ),
    ];
    for (name, heading, row) in cases {
        let mut rng = ChaCha8Rng::seed_from_u64(21);
        let text = heading.to_owned() + &(0..ROWS).map(|at| row(at, noise(&mut rng))).collect::<String>();
        let bytes = if name.ends_with("Latin-1") { text.chars().map(|c| c as u8).collect() } else { text.into_bytes() };
        let file = write(&dir, "recording.txt", &bytes);
        let report: Value =
            serde_json::from_slice(&json_of(&dir, &["analyze", file.to_str().expect("UTF-8")])).expect("JSON");
        assert_eq!((&report["samples"], &report["dropped"]["gap"]), (&Value::from(ROWS), &Value::from(0)), "{name}");
        let rate = report["sample_rate_hz"].as_f64().expect("a rate");
        assert!((rate / 100.0 - 1.0).abs() < 1e-4, "{name}: {rate}");
        let adev = report["channels"][0]["curve"][0]["adev"].as_f64().expect("a number");
        // σ(τ₀) = 0.02 rad/s; the relative error of 6000 differences is √(3/(4·6000)), 1.1 %.
        assert!((adev / 0.02f64.to_degrees() - 1.0).abs() < 5.0 * 0.011, "{name}: {adev}");
    }
}

/// Rows of several sensors in turn, with a label each, of different widths.
#[test]
fn rows_of_several_kinds_are_several_sensors() {
    let dir = tempdir().expect("a folder");
    let mut rng = ChaCha8Rng::seed_from_u64(22);
    let mut text = String::new();
    for row in 0..ROWS {
        let [x, y, z] = [0, 1, 2].map(|_| noise(&mut rng));
        text += &format!("left,{},{x:.6},{y:.6},{z:.6}\nright,{},{y:.6},{x:.6},{z:.6}\n", 10 * row, 10 * row + 3);
        if row % 50 == 0 {
            text += &format!("state,{},idle,0\n", 10 * row);
        }
    }
    let error = refusal(text.as_bytes(), &[]);
    assert!(error.contains("choose one with --topic: left, right"), "{error}");
    assert!(error.contains("--topic left") && error.contains("--topic right"), "{error}");
    let columns = ["--columns", "time=1,gyro_x=2,gyro_y=3,gyro_z=4", "--units", "ms,rad/s"];
    let report = analysed(&dir, &text, &[&["--topic", "right"], &columns[..]].concat());
    assert_eq!((&report["samples"], &report["dropped"]["gap"]), (&Value::from(ROWS), &Value::from(0)));
    assert!(refusal(text.as_bytes(), &["--topic", "up"]).contains("it has left, right"));
    let file = write(&dir, "kinds.txt", text.as_bytes());
    let both = [&["analyze", file.to_str().expect("UTF-8"), "--each-sensor"], &columns[..]].concat();
    let several: Value = serde_json::from_slice(&json_of(&dir, &both)).expect("JSON");
    assert_eq!(several["agreement"]["samples"], Value::from(vec![ROWS, ROWS]));
}

/// Of columns with one name each is known by its number: none is taken in silence.
#[test]
fn columns_of_one_name_are_known_by_their_numbers() {
    let dir = tempdir().expect("a folder");
    let mut rng = ChaCha8Rng::seed_from_u64(23);
    let rows: String = (0..1000).map(|row| format!("{row},{:.6},{:.6}\n", noise(&mut rng), noise(&mut rng))).collect();
    let text = format!("time_s,x,x\n{rows}");
    let error = refusal(text.as_bytes(), &["--columns", "gyro_x=x", "--units", "rad/s"]);
    assert!(error.contains("no column x; the file has time, 1, 2"), "{error}");
    let report = analysed(&dir, &text, &["--columns", "gyro_x=2", "--units", "rad/s"]);
    assert_eq!(report["samples"], 1000);
}
