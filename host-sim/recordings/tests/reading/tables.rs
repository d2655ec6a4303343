//! Tables in text as loggers and programs write them.

use super::harness::{Reading, gzip, normal, read};
use rand::seq::IndexedRandom;
use rand::seq::index::sample;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

const ROWS: u32 = 6000;
/// Standard deviation of the noise in the tables, rad/s.
const NOISE: f64 = 0.02;

struct Case {
    name: &'static str,
    heading: &'static str,
    /// A row by its number, with a value in rad/s.
    row: fn(u32, f64) -> String,
    options: &'static [&'static str],
    rate_hz: f64,
    /// Relative tolerance of the rate: a stamp is known to its last digit, over the length of the record.
    tolerance: f64,
}

/// Time of a row in s with two decimals.
fn seconds(row: u32) -> String {
    format!("{:.2}", f64::from(row) / 100.0)
}

/// Date and time of day of a row at so many Hz; the first is a minute before midnight.
fn stamp(row: u32, hz: f64, decimals: usize) -> (u32, String) {
    let time = 86_400.0 - 60.0 + f64::from(row) / hz;
    let time = (time * 10f64.powi(decimals as i32)).floor() / 10f64.powi(decimals as i32);
    let (day, second) = ((time / 86_400.0).floor(), time.rem_euclid(86_400.0));
    let (hour, minute) = ((second / 3600.0) as u32, (second / 60.0) as u32 % 60);
    let width = if decimals == 0 { 2 } else { decimals + 3 };
    (25 + day as u32, format!("{hour:02}:{minute:02}:{:0width$.decimals$}", second.rem_euclid(60.0)))
}

const TABLES: &[Case] = &[
    Case {
        name: "date and time in two columns of blanks, whole seconds",
        heading: "",
        row: |row, value| {
            let (day, time) = stamp(row, 5.0, 0);
            format!("2018-04-{day}   {time} {value:.5}\n")
        },
        options: &["--columns", "gyro_x=2", "--units", "rad/s"],
        rate_hz: 5.0,
        tolerance: 1e-3,
    },
    Case {
        name: "date and time in two columns of commas",
        heading: "date,time,gyro_x [rad/s]\n",
        row: |row, value| {
            let (day, time) = stamp(row, 50.0, 3);
            format!("{day}.04.2018,{time},{value:.5}\n")
        },
        options: &[],
        rate_hz: 50.0,
        tolerance: 1e-5,
    },
    Case {
        name: "one name for date and time",
        heading: "stamp gyro_x_rad_s\n",
        row: |row, value| {
            let (day, time) = stamp(row, 50.0, 3);
            format!("2018-04-{day}   {time} {value:.5}\n")
        },
        options: &[],
        rate_hz: 50.0,
        tolerance: 1e-5,
    },
    Case {
        name: "date and time in one column",
        heading: "timestamp,gyro_x [rad/s]\n",
        row: |row, value| {
            let (day, time) = stamp(row, 50.0, 6);
            format!("2018-04-{day}T{time}Z,{value:.5}\n")
        },
        options: &[],
        rate_hz: 50.0,
        tolerance: 1e-6,
    },
    Case {
        name: "month before day",
        heading: "timestamp;gyro_x [rad/s]\n",
        row: |row, value| {
            let (day, time) = stamp(row, 50.0, 3);
            format!("04/{day}/2018 {time};{value:.5}\n")
        },
        options: &[],
        rate_hz: 50.0,
        tolerance: 1e-5,
    },
    Case {
        name: "time of day past midnight",
        heading: "time,gyro_x [rad/s]\n",
        row: |row, value| format!("{},{value:.5}\n", stamp(row, 50.0, 3).1),
        options: &[],
        rate_hz: 50.0,
        tolerance: 1e-5,
    },
    Case {
        name: "decimal commas, BOM and CR LF",
        heading: "\u{feff}t [s];gyro_x [rad/s]\r\n",
        row: |row, value| format!("{};{value:.6}\r\n", seconds(row)).replace('.', ","),
        options: &[],
        rate_hz: 100.0,
        tolerance: 1e-6,
    },
    Case {
        name: "a row of units",
        heading: "time;Gyro X;Gyro Y\ns;rad/s;rad/s\n",
        row: |row, value| format!("{};{value:.6};0\n", seconds(row)),
        options: &[],
        rate_hz: 100.0,
        tolerance: 1e-6,
    },
    Case {
        name: "degrees in Latin-1",
        heading: "t [s],gx [\u{b0}/s]\n",
        row: |row, value| format!("{},{:.5}\n", seconds(row), value.to_degrees()),
        options: &[],
        rate_hz: 100.0,
        tolerance: 1e-6,
    },
    Case {
        name: "degrees in UTF-16",
        heading: "\u{feff}t [s],gx [\u{b0}/s]\r\n",
        row: |row, value| format!("{},{:.5}\r\n", seconds(row), value.to_degrees()),
        options: &[],
        rate_hz: 100.0,
        tolerance: 1e-6,
    },
    Case {
        name: "UTF-16, big end first",
        heading: "\u{feff}t [s]\tgx [\u{b0}/s]\n",
        row: |row, value| format!("{}\t{:.5}\n", seconds(row), value.to_degrees()),
        options: &[],
        rate_hz: 100.0,
        tolerance: 1e-6,
    },
    Case {
        name: "quotation marks",
        heading: "\"Time (s)\",\"Gyroscope x (rad/s)\"\n",
        row: |row, value| format!("\"{}\",\"{value:.6E}\"\n", seconds(row)),
        options: &[],
        rate_hz: 100.0,
        tolerance: 1e-6,
    },
    Case {
        name: "milliseconds by the name",
        heading: "millis\tgyro_x_rad_s\n",
        row: |row, value| format!("{}\t{value:.6}\n", 10 * row + 1234),
        options: &[],
        rate_hz: 100.0,
        tolerance: 1e-6,
    },
    Case {
        name: "a serial monitor",
        heading: "12:00:00.000 -> gx [rad/s],gy [rad/s]\n",
        row: |row, value| format!("12:{:02}:{:02}.{:03} -> {value:.6},0\n", row / 6000, row / 100 % 60, row % 100 * 10),
        options: &[],
        rate_hz: 100.0,
        tolerance: 1e-6,
    },
    Case {
        name: "a rate in a comment",
        heading: "// Update Rate: 100.0Hz\nGyr_X_rad_s\n",
        row: |_, value| format!("{value:.6}\n"),
        options: &[],
        rate_hz: 100.0,
        tolerance: 1e-12,
    },
    Case {
        name: "a magnetometer without a unit",
        heading: "time_s,gyro_x_rad_s,mag_x\n",
        row: |row, value| format!("{},{value:.6},0.3\n", seconds(row)),
        options: &[],
        rate_hz: 100.0,
        tolerance: 1e-6,
    },
    Case {
        name: "sentences of another sender",
        heading: "",
        row: |_, value| sentence(&format!("PIMU,12,{value:+.6},0,0")),
        options: &["--columns", "gyro_x=2", "--units", "rad/s", "--rate", "40"],
        rate_hz: 40.0,
        tolerance: 1e-12,
    },
    Case {
        name: "columns of one name by their numbers",
        heading: "time_s,x,x\n",
        row: |row, value| format!("{},0,{value:.6}\n", seconds(row)),
        options: &["--columns", "gyro_x=2", "--units", "rad/s"],
        rate_hz: 100.0,
        tolerance: 1e-6,
    },
];

fn sentence(content: &str) -> String {
    format!("${content}*{:02X}\r\n", content.bytes().fold(0u8, |sum, byte| sum ^ byte))
}

fn reading(name: &str, text: &str, options: &[&str]) -> Reading {
    read("table.txt", text.as_bytes(), options).unwrap_or_else(|error| panic!("{name}: {error}"))
}

#[test]
fn a_table_of_any_country_and_program_has_its_rate_and_every_row() {
    for Case { name, heading, row, options, rate_hz, tolerance } in TABLES {
        let mut normal = normal(21);
        let text = (*heading).to_owned() + &(0..ROWS).map(|at| row(at, NOISE * normal())).collect::<String>();
        let bytes = match name {
            name if name.ends_with("Latin-1") => text.chars().map(|c| c as u8).collect(),
            name if name.ends_with("UTF-16") => text.encode_utf16().flat_map(u16::to_le_bytes).collect(),
            name if name.ends_with("big end first") => text.encode_utf16().flat_map(u16::to_be_bytes).collect(),
            _ => text.into_bytes(),
        };
        let read = read("table.txt", &bytes, options).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!((read.samples.len() as u32, read.missing()), (ROWS, 0), "{name}");
        let rate = read.rate_hz() / rate_hz;
        assert!((rate - 1.0).abs() < *tolerance, "{name}: {rate} of the rate");
        // The relative error of the deviation of 6000 differences is √(3/(4·6000)), 1.1 %.
        let deviation = read.neighbours("gyro_x") / NOISE.to_degrees();
        assert!((deviation - 1.0).abs() < 5.0 * 0.011, "{name}: {deviation} of the noise");
    }
}

/// Neighbouring rows are equal in 0.28³ of the cases; the stamps are whole seconds, or a fifth is written again.
#[test]
fn rows_that_are_equal_by_chance_are_samples() {
    let columns = ["--columns", "time=0,gyro_x=1,gyro_y=2,gyro_z=3", "--units", "rad/s"];
    for (decimals, repeats) in [(0, false), (2, false), (2, true)] {
        let (mut normal, mut rng) = (normal(11), ChaCha8Rng::seed_from_u64(12));
        let (mut text, mut again) = (String::new(), 0_u64);
        for row in 0..ROWS {
            let (whole, cents) = (row / 5, 20 * (row % 5));
            let stamp = |cents: u32| if decimals == 0 { format!("{whole}") } else { format!("{whole}.{cents:02}") };
            let values = [(); 3].map(|()| format!("{:.3}", normal().round() / 1000.0)).join(" ");
            text.push_str(&format!("{} {values}\n", stamp(cents)));
            if repeats && rng.random_bool(0.2) {
                text.push_str(&format!("{} {values}\n", stamp(cents + 5)));
                again += 1;
            }
        }
        let read = reading("equal rows", &text, &columns);
        assert_eq!((read.samples.len() as u32, read.dropped("repeated")), (ROWS, again), "{decimals} {repeats}");
    }
}

#[test]
fn sentences_of_vectornav_are_known_by_name_and_damaged_ones_are_missing() {
    let mut normal = normal(8);
    let mut sentences: Vec<String> = (0..ROWS)
        .map(|_| {
            let [x, y, z] = std::array::from_fn(|_| NOISE * normal());
            let attitude = "+006.380,+000.023,-001.953,+1.0640,-0.2531,+3.0614";
            sentence(&format!("VNYMR,{attitude},+00.005,+00.344,-09.758,{x:+.6},{y:+.6},{z:+.6}"))
        })
        .collect();
    let read = reading("complete", &sentences.concat(), &["--rate", "40"]);
    assert_eq!(read.samples.len() as u32, ROWS);
    let deviation = read.neighbours("gyro_x") / NOISE.to_degrees();
    assert!((deviation - 1.0).abs() < 5.0 * 0.011, "{deviation}");
    for at in [100, 2000, 2001, 5999] {
        sentences[at] = sentences[at].replace("-09.758", "-09.753");
    }
    sentences.insert(500, sentence("GPGLL,4916.45,N,12311.12,W,225444,A,"));
    let read = reading("damaged", &sentences.concat(), &["--rate", "40"]);
    assert!(read.notes_contain("4 sentences whose checksum is wrong"), "{:?}", read.notes);
    assert!(read.notes_contain("1 lines that are no"), "{:?}", read.notes);
    assert_eq!(read.refused("gyro_y", "missing"), 4);
}

#[test]
fn rows_without_a_number_are_missing_samples() {
    for missing in [3, 100] {
        let mut normal = normal(9);
        let rows: String = (0..ROWS).map(|_| format!("{:.5}\n", NOISE * normal())).collect();
        let options = ["--columns", "gyro_x=0", "--units", "rad/s", "--rate", "100"];
        let read = reading("nan", &format!("{}{rows}", "nan\n".repeat(missing)), &options);
        assert_eq!(read.refused("gyro_x", "missing"), missing);
    }
}

#[test]
fn rows_of_several_kinds_are_several_sensors() {
    let mut normal = normal(22);
    let mut text = String::new();
    for row in 0..ROWS {
        let [x, y, z] = [0, 1, 2].map(|_| NOISE * normal());
        text += &format!("left,{},{x:.6},{y:.6},{z:.6}\nright,{},{y:.6},{x:.6},{z:.6}\n", 10 * row, 10 * row + 3);
        if row % 50 == 0 {
            text += &format!("state,{},idle,0\n", 10 * row);
        }
    }
    let columns = ["--columns", "time=1,gyro_x=2,gyro_y=3,gyro_z=4", "--units", "ms,rad/s", "--topic", "right"];
    let right = reading("right", &text, &columns);
    assert_eq!((right.samples.len() as u32, right.missing()), (ROWS, 0));
    let refusal = |options: &[&str]| read("kinds.txt", text.as_bytes(), options).err().expect("refused").to_string();
    assert!(refusal(&[]).contains("choose one with --topic: left, right"), "{}", refusal(&[]));
    assert!(refusal(&["--topic", "up"]).contains("it has left, right"));
}

#[test]
fn rows_of_different_origin_are_no_series() {
    let mut normal = normal(33);
    let mut two = "id,t_ms,gx_dps,gy_dps,gz_dps\n".to_owned();
    let mut merged: Vec<(u32, String)> = Vec::new();
    for row in 0..ROWS {
        let [x, y, z] = [(); 3].map(|()| NOISE * normal());
        two += &format!("1,{},{x:.5},{y:.5},{z:.5}\n2,{},{:.5},{y:.5},{z:.5}\n", 10 * row, 10 * row + 3, x + 9.0);
        merged.push((10 * row, format!("{},{x:.5},{y:.5},{z:.5},,,\n", 10 * row)));
        if row < ROWS / 2 {
            merged.push((20 * row + 7, format!("{},,,,{x:.5},{y:.5},{z:.5}\n", 20 * row + 7)));
        }
    }
    merged.sort();
    let merged = "t_ms,gx_rad_s,gy_rad_s,gz_rad_s,ax_g,ay_g,az_g\n".to_owned()
        + &merged.into_iter().map(|(_, row)| row).collect::<String>();
    let refusal = |text: &str| read("t.csv", text.as_bytes(), &[""; 0]).err().expect("refused").to_string();
    assert!(refusal(&two).contains("choose one with --topic: 1, 2"), "{}", refusal(&two));
    assert!(refusal(&merged).contains("choose one with --topic: gyro, accl"), "{}", refusal(&merged));
    let one = reading("one device", &two, &["--topic", "2"]);
    assert_eq!((one.samples.len() as u32, one.missing()), (ROWS, 0));
    assert!((one.rate_hz() / 100.0 - 1.0).abs() < 1e-6, "{}", one.rate_hz());
    for (columns, units, rate_hz, rows) in [
        ("time=t,gyro_x=gx,gyro_y=gy,gyro_z=gz", "rad/s", 100.0, ROWS),
        ("time=t,accl_x=ax,accl_y=ay,accl_z=az", "g", 50.0, ROWS / 2),
    ] {
        let one = reading(columns, &merged, &["--columns", columns, "--units", units]);
        assert_eq!((one.samples.len() as u32, one.missing()), (rows, 0), "{columns}");
        assert!((one.rate_hz() / rate_hz - 1.0).abs() < 1e-6, "{columns}: {}", one.rate_hz());
    }
}

#[test]
fn padding_is_named_and_left_out() {
    let mut normal = normal(34);
    let rows: Vec<[String; 3]> = (0..ROWS).map(|_| [(); 3].map(|()| format!("{:.5}", NOISE * normal()))).collect();
    let line = |row: &[String; 3]| row.join(",") + "\n";
    let noise: String = rows.iter().map(line).collect();
    let held = line(&rows[rows.len() - 1]);
    for (name, before, after, samples) in [
        ("zeros at the end", String::new(), "0,0,0\n".repeat(240), ROWS),
        ("zeros at the start", "0,0,0\n".repeat(1500), String::new(), ROWS),
        ("both", "65535,65535,65535\n".repeat(100), "0,0,0\n".repeat(100), ROWS),
        // The held row is one of them.
        ("a held value", String::new(), held.repeat(500), ROWS - 1),
    ] {
        let text = format!("gx_rad_s,gy_rad_s,gz_rad_s\n{before}{noise}{after}");
        let read = reading(name, &text, &["--rate", "100"]);
        assert_eq!((read.samples.len() as u32, read.missing()), (samples, 0), "{name}");
        assert!(read.notes_contain("are padding and left out"), "{name}: {:?}", read.notes);
    }
}

#[test]
fn samples_at_full_scale_are_counted_and_told() {
    let count = |row: u64| if (1000..1050).contains(&row) { 32_767 } else { (row * 7919 % 1009) as i64 - 504 };
    let rows: String = (0..5000u64).map(|row| format!("{},{}\n", row as f64 / 100.0, count(row))).collect();
    let read = reading("full scale", &format!("t [s],wx [deg/s]\n{rows}"), &[]);
    assert_eq!(read.flagged("saturated"), 50);
    let note = "gyro_x: 50 samples at full scale, the first of them row 1001";
    assert!(read.notes_contain(note), "{:?}", read.notes);
}

/// Data sheet: 0.05 deg/s a count in the range of 300 deg/s, 0.0125 in that of 75.
#[test]
fn counts_of_other_names_have_the_stated_range() {
    let rows: String = (0..64).map(|i| format!("{},{}\n", 4883 * i, i * i % 7)).collect();
    for (range, lsb) in [("300", 0.05), ("75", 0.0125)] {
        let columns = ["--sensor", "adis16405", "--columns", "gyro_x=wx,time=t_us", "--units", "counts,us"];
        let read = reading(range, &format!("t_us,wx\n{rows}"), &[&columns[..], &["--range", range]].concat());
        assert_eq!(read.channel("gyro_x").profile.lsb, lsb);
        assert_eq!(read.channel("gyro_x").counts[..5], [0, 1, 4, 2, 2]);
    }
}

/// A table of counts with a stamp of each row; the noise has 20 counts.
pub(crate) fn counts(header: &str, rows: usize, stamp: impl Fn(usize) -> String) -> Vec<u8> {
    let mut normal = normal(1);
    let rows = (0..rows).map(|row| format!("{}{}\n", stamp(row), (20.0 * normal()).round()));
    format!("{header}\n{}", rows.collect::<String>()).into_bytes()
}

#[test]
fn an_index_and_times_that_contradict_each_other_give_the_rate_of_both_sides_and_a_note() {
    let stamp = |i: usize| format!("{i},{},", i as f64 / 100.0 + if i >= 30_000 { 600.0 } else { 0.0 });
    let table = counts("sample,time_s,gyro_x_counts", 60_000, stamp);
    let read = read("clock.csv", &table, &[""; 0]).expect("a time base");
    assert!((read.rate_hz() / 100.0 - 1.0).abs() < 1e-6, "{}", read.rate_hz());
    assert_eq!(read.flagged("clock_step"), 1);
    for words in ["contradict", "sample 30000", "+600.000 s"] {
        assert!(read.notes_contain(words), "{words}: {:?}", read.notes);
    }
}

#[test]
fn stamps_that_are_coarser_than_the_period_are_told() {
    let stamp = |i: usize| format!("{:.3},", (i as f64 / 819.2 * 1000.0).floor() / 1000.0);
    let read = read("coarse.csv", &counts("time_s,gyro_x_counts", 20_000, stamp), &[""; 0]).expect("a time base");
    assert!(read.notes_contain("coarser than the sample period"), "{:?}", read.notes);
}

#[test]
fn a_nominal_rate_that_is_a_little_wrong_is_taken() {
    let table = counts("time_s,gyro_x_counts", 20_000, |i| format!("{},", i as f64 / 100.0));
    let read = read("timed.csv", &table, &["--rate", "102.4"]).expect("a time base");
    assert_eq!((read.rate_hz(), read.missing()), (102.4, 0));
}

#[test]
fn a_stated_rate_beats_any_time_stamps() {
    for (rate, hz) in [("30", 30.0), ("300", 300.0), ("819.2", 819.2), ("1000", 1000.0)] {
        let table = counts("time_s,gyro_x_counts", 20_000, |i| format!("{},", i as f64 / 100.0));
        let read = read("timed.csv", &table, &["--rate", rate]).expect("a time base");
        assert_eq!((read.rate_hz(), read.samples.len(), read.missing()), (hz, 20_000, 0));
        for words in ["ignored", "100.0000 Hz"] {
            assert!(read.notes_contain(words), "{rate}: {:?}", read.notes);
        }
    }
    // Stamps that show nothing.
    let table = counts("time_s,gyro_x_counts", 2000, |_| "7,".to_owned());
    let read = read("frozen.csv", &table, &["--rate", "100"]).expect("a time base");
    assert_eq!((read.rate_hz(), read.samples.len(), read.missing()), (100.0, 2000, 0));
}

#[test]
fn compression_padding_line_ends_and_quotation_marks_change_nothing() {
    let rows = counts("time_s,gyro_x_counts", 2000, |i| format!("{},", i as f64 / 100.0));
    let plain = read("rows.csv", &rows, &[""; 0]).expect("rows").samples;
    let (start, end) = rows.split_at(rows.len() / 2);
    let text = String::from_utf8(rows.clone()).expect("UTF-8");
    for (case, bytes) in [
        ("gzip", gzip(&rows)),
        ("gzip and a line end", [gzip(&rows), b"\n".to_vec()].concat()),
        ("gzip and zeros", [gzip(&rows), vec![0; 512]].concat()),
        ("two gzip members", [gzip(start), gzip(end)].concat()),
        ("plain text in a name of gzip", rows.clone()),
        (
            "quotation marks and CR LF",
            text.replacen("gyro_x_counts", "\"gyro_x_counts\"", 1).replace('\n', "\r\n").into(),
        ),
        ("BOM", format!("\u{feff}{text}").into()),
        ("blank lines", format!("\r\n \n{text}").into()),
    ] {
        let read = read("rows.csv.gz", &bytes, &[""; 0]).unwrap_or_else(|error| panic!("{case}: {error}"));
        assert!(read.samples == plain, "{case}");
    }
}

#[test]
fn a_damaged_place_costs_its_rows_and_is_told() {
    let mut normal = normal(31);
    let intact: Vec<String> = (0..ROWS)
        .map(|row| {
            let [x, y, z] = [(); 3].map(|()| format!("{:.5}", NOISE * normal()));
            format!("{},{x},{y},{z}", seconds(row))
        })
        .collect();
    let table = |change: &dyn Fn(&mut Vec<String>)| {
        let mut rows = intact.clone();
        change(&mut rows);
        format!("t_s,gx_rad_s,gy_rad_s,gz_rad_s\n{}\n", rows.join("\n"))
    };
    let replaced = |row: usize, text: &str| {
        let text = text.to_owned();
        table(&move |rows| rows[row].clone_from(&text))
    };
    let zeros = |row: usize, count: usize| table(&move |rows| rows[row].insert_str(0, &"\0".repeat(count)));
    for (name, text, lost, note) in [
        (
            "a message",
            replaced(3000, "WARNING: FIFO overflow"),
            1,
            "1 damaged rows are left out, the first of them line 3002",
        ),
        ("a cut row", replaced(40, "0.40,0.1"), 1, "1 damaged rows"),
        ("glued rows", replaced(3000, "30.00,0.1,0.230.01,0.1,0.1,0.1"), 1, "1 damaged rows"),
        (
            "a heading",
            table(&|rows| rows.insert(2000, "t_s,gx_rad_s,gy_rad_s,gz_rad_s".to_owned())),
            0,
            "1 damaged rows",
        ),
        ("zeros", zeros(3000, 4096), 0, "4096 bytes that are zero are left out"),
        ("many zeros", zeros(3000, 200_000), 0, "200000 bytes that are zero are left out"),
    ] {
        let read = reading(name, &text, &[]);
        assert_eq!(
            (read.samples.len() as u32, read.missing()),
            (ROWS - lost, u64::from(lost)),
            "{name}: {:?}",
            read.notes
        );
        assert!(read.notes_contain(note), "{name}: {:?}", read.notes);
    }
    let text = table(&|rows| rows.iter_mut().step_by(8).for_each(|row| row.push_str(",x")));
    let error = read("damaged.csv", text.as_bytes(), &[""; 0]).err().expect("refused").to_string();
    assert!(error.contains("line 10") && error.contains("5 fields"), "{error}");
}

/// The channels are told with how many of their values are missing.
#[test]
fn values_that_are_missing_are_told_by_channel() {
    const WORDS: [&str; 9] = ["-", "#N/A", "1.#QNAN", "ovf", "NaN", "", "null", "---", "n/a"];
    for seed in 0..12 {
        let (mut random, mut normal) = (ChaCha8Rng::seed_from_u64(seed), normal(40 + seed));
        let word = *WORDS.choose(&mut random).expect("words");
        let mut cells: Vec<[String; 3]> =
            (0..ROWS).map(|_| [(); 3].map(|()| format!("{:.5}", NOISE * normal()))).collect();
        let [x, y] = [(); 2].map(|()| random.random_range(1..400_usize));
        for (row, axes) in [(x, &[0, 1][..]), (y, &[2])]
            .into_iter()
            .flat_map(|(count, axes)| sample(&mut random, ROWS as usize, count).into_iter().map(move |row| (row, axes)))
        {
            axes.iter().for_each(|axis| word.clone_into(&mut cells[row][*axis]));
        }
        let rows = (0..ROWS).zip(&cells).map(|(row, cells)| format!("{},{}\n", seconds(row), cells.join(",")));
        let text = format!("t_s,gx_rad_s,gy_rad_s,gz_rad_s\n{}", rows.collect::<String>());
        let read = reading(word, &text, &[]);
        assert_eq!(read.samples.len() as u32, ROWS, "{seed}: {word}");
        for (channels, count) in [(&["gyro_x", "gyro_y"][..], x), (&["gyro_z"], y)] {
            for channel in channels {
                assert_eq!(read.refused(channel, "missing"), count, "{seed}: {word}");
            }
            let channels = if x == y { "gyro_x, gyro_y, gyro_z".to_owned() } else { channels.join(", ") };
            let are = if count == 1 { "is" } else { "are" };
            let note = format!("{count} of {ROWS} values of {channels} {are} missing");
            assert!(read.notes_contain(&note), "{seed}: {note:?} is not in {:?}", read.notes);
        }
    }
}

#[test]
fn a_table_is_found_in_what_is_around_it() {
    let mut normal = normal(32);
    let rows: Vec<[String; 4]> = (0..ROWS)
        .map(|row| {
            let [x, y, z] = [(); 3].map(|()| format!("{:.5}", NOISE * normal()));
            [seconds(row), x, y, z]
        })
        .collect();
    let body = |row: &dyn Fn(&[String; 4]) -> String| rows.iter().map(row).collect::<String>();
    let plain = body(&|row| row.join(",") + "\n");
    for (name, text, options) in [
        (
            "a comma after every row",
            "t_s,gx_rad_s,gy_rad_s,gz_rad_s\n".to_owned() + &body(&|row| row.join(",") + ",\n"),
            &[][..],
        ),
        ("a comma after the heading", format!("t_s,gx_rad_s,gy_rad_s,gz_rad_s,\n{plain}"), &[]),
        (
            "empty cells before tabs are cut",
            "t_s\tgx_rad_s\tgy_rad_s\tgz_rad_s\tmx_uT\n".to_owned()
                + &body(&|row| row.join("\t") + if row[0].ends_with('0') { "\t20.1\n" } else { "\t\n" }),
            &[],
        ),
        (
            "a text with a comma",
            "t_s,note,gx_rad_s,gy_rad_s,gz_rad_s\n".to_owned()
                + &body(&|[t, x, y, z]| format!("{t},\"bench, left\",{x},{y},{z}\n")),
            &[],
        ),
        (
            "units behind commas",
            format!("\"Time, s\",\"Gyro X, rad/s\",\"Gyro Y, rad/s\",\"Gyro Z, rad/s\"\n{plain}"),
            &[],
        ),
        ("a heading in two lines", format!("Time (s),Gyroscope,,\n,X,Y,Z\n{plain}"), &["--units", "rad/s"]),
        ("keys and values", format!("rate,100\nrange,250\nn,6000\nt_s,gx_rad_s,gy_rad_s,gz_rad_s\n{plain}"), &[]),
        (
            "texts",
            format!("bus opened\nDevice found\n{plain}"),
            &["--columns", "time=0,gyro_x=1,gyro_y=2,gyro_z=3", "--units", "s,rad/s"],
        ),
    ] {
        let read = reading(name, &text, options);
        assert_eq!((read.samples.len() as u32, read.missing()), (ROWS, 0), "{name}: {:?}", read.notes);
        assert!((read.rate_hz() / 100.0 - 1.0).abs() < 1e-6, "{name}: {}", read.rate_hz());
        let deviation = read.neighbours("gyro_y") / NOISE.to_degrees();
        assert!((deviation - 1.0).abs() < 5.0 * 0.011, "{name}: {deviation} of the noise");
    }
}
