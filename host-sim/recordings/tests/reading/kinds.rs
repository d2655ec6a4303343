//! Kinds of files that people have, drawn anew.

use super::harness::{Reading, inspect, normal, read, read_file};
use rand::seq::SliceRandom;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use recordings::Printable;
use recordings::inspection::{InspectedTable, Proposal};
use ruzstd::encoding::{CompressionLevel, compress_to_vec};
use std::path::Path;

const ROWS: u32 = 3000;
/// Deviation of the rates, deg/s, of the forces, g, and their ratio to what is read.
const RATE: f64 = 0.1;
const FORCE: f64 = 0.001;
const TOLERANCE: f64 = 0.06;

fn options(proposal: &Proposal) -> Vec<String> {
    let [columns, units] = [&proposal.columns, &proposal.units].map(|list| list.join(","));
    let topic = proposal.topic.clone().unwrap_or_default();
    let options = [("--topic", topic), ("--columns", columns), ("--units", units)];
    let options = options.into_iter().filter(|(_, value)| !value.is_empty());
    // As they are printed.
    options.flat_map(|(name, value)| [name.to_owned(), Printable(&value).to_string()]).collect()
}

fn text(name: &str, content: &str, options: &[&str]) -> Reading {
    read(name, content.as_bytes(), options)
        .unwrap_or_else(|error| panic!("{error}\n{}", &content[..content.len().min(600)]))
}

fn as_proposed(content: &[u8], more: &[&str]) -> (Vec<InspectedTable>, Vec<(Proposal, Reading)>) {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("rows.csv");
    std::fs::write(&file, content).expect("written");
    let tables = inspect(&file);
    let proposals: Vec<Proposal> = tables.iter().flat_map(|table| table.proposals.clone()).collect();
    let read = |proposal: Proposal| {
        let all: Vec<String> = options(&proposal).into_iter().chain(more.iter().map(|of| (*of).to_owned())).collect();
        let read = read_file(Path::new(&file), &all).unwrap_or_else(|error| panic!("{all:?}: {error}"));
        (proposal, read)
    };
    (tables, proposals.into_iter().map(read).collect())
}

fn is_near(read: &Reading, channel: &str, deviation: f64) -> bool {
    (read.neighbours(channel) / deviation - 1.0).abs() < TOLERANCE
}

fn preamble(random: &mut ChaCha8Rng) -> String {
    let mut lines = vec![
        "GPIO initialized.".to_owned(),
        format!("rate,{}", random.random_range(1..500)),
        "range,250".to_owned(),
        "version,1.3".to_owned(),
        "Device: bench sensor".to_owned(),
        "sep=,".to_owned(),
        "________________________".to_owned(),
        "DeviceTag:,A1".to_owned(),
        String::new(),
        "Channels,3,,,".to_owned(),
        "StartTime:,2021-06-01_10-00-00".to_owned(),
        "Samples,1,1,1,".to_owned(),
        "% formats:".to_owned(),
    ];
    lines.shuffle(random);
    lines.truncate(random.random_range(1..=lines.len()));
    lines.into_iter().map(|line| line + "\n").collect()
}

#[test]
fn a_table_is_found_behind_whatever_lines_are_before_it() {
    for seed in 0..40 {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = normal(seed);
        let mut content = preamble(&mut random) + "t,gx_dps,gy_dps,gz_dps\n";
        let damaged = random.random_range(3..ROWS - 3);
        for row in 0..ROWS {
            let [x, y, z] = [(); 3].map(|()| RATE * normal());
            if row == damaged {
                content += ["WARNING: FIFO overflow\n", "12.00,0.1\n"][random.random_range(0..2)];
            } else {
                content += &format!("{:.2},{x:.4},{y:.4},{z:.4}\n", f64::from(row) / 100.0);
            }
        }
        let read = text("log.csv", &content, &[]);
        assert_eq!((read.samples.len() as u32, read.missing()), (ROWS - 1, 1), "{seed}");
        assert!((read.rate_hz() / 100.0 - 1.0).abs() < 1e-6 && is_near(&read, "gyro_y", RATE), "{seed}");
        assert!(read.notes_contain("1 damaged rows are left out"), "{seed}: {:?}", read.notes);
    }
}

/// The scales of a log for video stabilisation, the units of a measurement file, and names for some of the columns.
#[test]
fn what_the_lines_before_a_table_say_is_read() {
    for (seed, scale) in [(1, 1e-4), (2, 5e-4), (3, 2e-5)] {
        let mut normal = normal(seed);
        let head = format!(
            "GYROFLOW IMU LOG\nversion,1.3\ntscale,0.001\ngscale,{scale}\nascale,{scale}\nt,gx,gy,gz,ax,ay,az\n"
        );
        let row = |row: u32| {
            let rate = [(); 3].map(|()| (RATE.to_radians() * normal() / scale).round());
            let force = [0.0, 0.0, 1.0].map(|of: f64| ((of + FORCE * normal()) / scale).round());
            format!("{},{},{},{},{},{},{}\n", row * 10, rate[0], rate[1], rate[2], force[0], force[1], force[2])
        };
        let read = text("motion.gcsv", &(head + &(0..ROWS).map(row).collect::<String>()), &[]);
        assert!((read.rate_hz() / 100.0 - 1.0).abs() < 1e-6);
        assert!(is_near(&read, "gyro_x", RATE) && is_near(&read, "accl_z", FORCE), "{scale}");
    }
    let mut normal = normal(4);
    let head = "Writer_Version\t2\nX_Columns\tOne\n***End_of_Header***\t\nChannels\t3\t\t\t\nSamples\t1\t1\t1\t\n\
                Y_Unit_Label\tdeg/s\tdeg/s\tdeg/s\t\nDelta_X\t0,010000\t0,010000\t0,010000\t\n***End_of_Header***\t\t\t\t\n\
                X_Value\tgyro_x\tgyro_y\tgyro_z\tComment\n";
    let row = |row: u32| {
        let [x, y, z] = [(); 3].map(|()| RATE * normal());
        format!("{:.6}\t{x:.6}\t{y:.6}\t{z:.6}\n", f64::from(row) / 100.0).replace('.', ",")
    };
    let read = text("measurement.lvm", &(head.to_owned() + &(0..ROWS).map(row).collect::<String>()), &[]);
    assert_eq!(read.samples.len() as u32, ROWS);
    assert!((read.rate_hz() / 100.0 - 1.0).abs() < 1e-6 && is_near(&read, "gyro_z", RATE));
    // Names for the first columns alone.
    let row = |row: u32| {
        format!(
            "{:.2},{:.5},{:.5},{:.5},0.1,0.2\n",
            f64::from(row) / 50.0,
            RATE * normal(),
            RATE * normal(),
            RATE * normal()
        )
    };
    let content = "time_s,gx [deg/s],gy [deg/s],gz [deg/s]\n".to_owned() + &(0..ROWS).map(row).collect::<String>();
    let read = text("wide.csv", &content, &[]);
    assert!((read.rate_hz() / 50.0 - 1.0).abs() < 1e-6 && is_near(&read, "gyro_x", RATE));
}

#[test]
fn rows_of_different_origin_are_several_sensors() {
    for seed in 0..12 {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = normal(seed);
        let hz = [random.random_range(80.0..220.0_f64).round(), random.random_range(20.0..75.0_f64).round()];
        let mut events: Vec<(u64, usize)> = Vec::new();
        for (sensor, hz) in hz.iter().enumerate() {
            events.extend((0..ROWS).map(|row| ((f64::from(row) / hz * 1e6) as u64 + 137 * sensor as u64, sensor)));
        }
        events.sort_unstable();
        for way in 0..3 {
            let mut content = match way {
                0 => "t_us,gx_rad_s,gy_rad_s,gz_rad_s,ax_m_s2,ay_m_s2,az_m_s2\n".to_owned(),
                1 => "% written by an app\n% forces: \t'ACCE;time (us);Acc_X(m/s^2);Acc_Y(m/s^2);Acc_Z(m/s^2)'\n\
                      % rates: \t'GYRO;time (us);Gyr_X(rad/s);Gyr_Y(rad/s);Gyr_Z(rad/s)'\n"
                    .to_owned(),
                _ => String::new(),
            };
            for &(time, sensor) in &events {
                let rate = [(); 3].map(|()| RATE.to_radians() * normal());
                let force = [0.0, 0.0, 9.80665].map(|of: f64| of + 9.80665 * FORCE * normal());
                let [x, y, z] = if sensor == 0 { rate } else { force };
                content += &match (way, sensor) {
                    (0, 0) => format!("{time},{x:.6},{y:.6},{z:.6},,,\n"),
                    (0, _) => format!("{time},,,,{x:.6},{y:.6},{z:.6}\n"),
                    (1, 0) => format!("GYRO;{time};{x:.6};{y:.6};{z:.6}\n"),
                    (1, _) => format!("ACCE;{time};{x:.6};{y:.6};{z:.6}\n"),
                    (_, 0) => {
                        format!("gyro {time} {:.6} {:.6} {:.6}\n", x.to_degrees(), y.to_degrees(), z.to_degrees())
                    }
                    (_, _) => format!("acc {time} {:.6} {:.6} {:.6}\n", x / 9.80665, y / 9.80665, z / 9.80665),
                };
            }
            let (tables, found) = as_proposed(content.as_bytes(), &[]);
            assert_eq!(
                found.len(),
                2,
                "{seed} {way}: {:?}",
                found.iter().map(|(proposal, _)| proposal).collect::<Vec<_>>()
            );
            for table in tables {
                let found_hz = table.rate.map_or(f64::NAN, |rate| rate.hz);
                let is_near = |hz: f64| (found_hz / hz - 1.0).abs() < 1e-3;
                assert!(table.rows as u32 == ROWS && hz.into_iter().any(is_near), "{seed} {way}: {found_hz} Hz");
            }
            for (proposal, read) in &found {
                let is_rate = read.samples.channels.iter().any(|of| of.profile.name == "gyro_x");
                let (hz, channel, deviation) = if is_rate { (hz[0], "gyro_z", RATE) } else { (hz[1], "accl_y", FORCE) };
                assert_eq!(read.samples.channels.len(), 3, "{seed} {way}: {proposal:?}");
                assert!((read.rate_hz() / hz - 1.0).abs() < 1e-3, "{seed} {way}: {} {hz}", read.rate_hz());
                assert!(is_near(read, channel, deviation), "{seed} {way}: {} {proposal:?}", read.neighbours(channel));
                assert!(!read.notes_contain("another quantity"), "{seed} {way}: {:?}", read.notes);
            }
        }
    }
}

/// Writes the time, s, and the rates of a row, deg/s.
type WriteRow = fn(f64, [f64; 3]) -> String;

/// Text before the rows, the rows, and text behind them.
const ROWS_OF_PROGRAMS: [(&str, WriteRow, &str); 33] = [
    (
        "time_s,gx,gy,gz,note\n",
        |t, [x, y, z]| format!("{t:.2},{x:.4},{y:.4},{z:.4},{:.3}\n", x - 1.5).replace('-', "\u{2212}"),
        "",
    ),
    (
        "Clock:Tick#,Clock:offsetTime,IMU(0):gyroX,IMU(0):gyroY,IMU(0):gyroZ\n",
        |t, [x, y, z]| format!("{:.0},{t:.3},{x:.4},{y:.4},{z:.4}\n", 4.5e6 * t),
        "",
    ),
    (
        "Time (min),gx (deg/s),gy (deg/s),gz (deg/s),gx_min\n",
        |t, [x, y, z]| format!("{:.8},{x:.4},{y:.4},{z:.4},0\n", t / 60.0),
        "",
    ),
    (
        "",
        |t, [x, y, z]| {
            format!("2024-05-13 10:00: IMU {{TimeUS : {:.0}, GyrX : {x:.4}, GyrY : {y:.4}, GyrZ : {z:.4}}}\n", 1e6 * t)
        },
        "",
    ),
    ("time,gyro_x,gyro_y,gyro_z\n", |t, [x, y, z]| format!("{t:.2} s,{x:.4} deg/s,{y:.4}°/s,{z:.4} deg/s\n"), ""),
    (
        "time_s,gyro_x,gyro_y,gyro_z\n",
        |t, [x, y, z]| format!("{t:.2},{:.1} mdeg/s,{y:.5} deg/s,{z:.5} deg/s\n", 1e3 * x),
        "",
    ),
    ("'time_s','gx','gy','gz'\n", |t, [x, y, z]| format!("'{t:.2}','{x:.4}','{y:.4}','{z:.4}'\n"), ""),
    ("% a log\nx = [ ...\n", |t, [x, y, z]| format!("{t:.2} {x:.4} {y:.4} {z:.4};\n"), "];\n"),
    ("x = [\n", |t, [x, y, z]| format!("{t:.2}, {x:.4}, {y:.4}, {z:.4};\n"), "];\n"),
    ("const float rows[][4] = {\n", |t, [x, y, z]| format!("  {{ {t:.2}f, {x:.4}f, {y:.4}f, {z:.4}f }},\n"), "};\n"),
    (
        "time,channel,value\n",
        |t, [x, y, z]| format!("{t:.2},gyro_x,{x:.4}\n{t:.2},gyro_y,{y:.4}\n{t:.2},gyro_z,{z:.4}\n"),
        "",
    ),
    (
        "t [s];sensor;value;unit\n",
        |t, [x, y, z]| format!("{t:.2};gx;{x:.4};deg/s\n{t:.2};gy;{y:.4};deg/s\n{t:.2};gz;{z:.4};deg/s\n"),
        "",
    ),
    (
        "",
        |t, [x, y, z]| {
            let ms = (t * 1e3).round();
            format!(
                "stamp:\n  secs: {}\n  nsecs: {}\nangular_velocity:\n  x: {x:.4}\n  y: {y:.4}\n  z: {z:.4}\n---\n",
                (ms / 1e3).floor(),
                1e6 * (ms % 1e3)
            )
        },
        "",
    ),
    (
        "Sensor found!\n",
        |t, [x, y, z]| format!("Time: {t:.2} s\nRotation X: {x:.4}, Y: {y:.4}, Z: {z:.4} deg/s\nSupply: 3.30 V\n\n"),
        "",
    ),
    ("", |t, [x, y, z]| format!("I ({t:.0}) imu: t={t:.2} gx={x:.4} gy={y:.4} gz={z:.4}\n"), ""),
    ("      t_s     gx     gy     gz\n", |t, [x, y, z]| format!("{:.0} {t:.2} {x:.4} {y:.4} {z:.4}\n", 100.0 * t), ""),
    (
        "0,1,0,250\n1,0,0,250\n0,0,1,250\n2,2,2,250\ntime_s,gx,gy,gz\n",
        |t, [x, y, z]| format!("{t:.2},{x:.4},{y:.4},{z:.4}\n"),
        "",
    ),
    (
        "Sample Count,t_s,XGYRO_OUT,YGYRO_OUT,ZGYRO_OUT\n",
        |t, [x, y, z]| format!("{:.0},{t:.2},{x:.4},{y:.4},{z:.4}\n", 100.0 * t),
        "",
    ),
    (
        "time_s,gyro_x [mdps],gyro_y [mdps],gyro_z [mdps]\n",
        |t, rates| {
            let cells = rates.map(|rate| {
                let tenths = (1e4 * rate).round() as u64;
                format!("\"{},{:03}.{}\"", tenths / 10_000, tenths / 10 % 1000, tenths % 10)
            });
            format!("{t:.2},{}\n", cells.join(","))
        },
        "",
    ),
    // Units behind blanks.
    (
        "time gyro_x gyro_y gyro_z\n",
        |t, [x, y, z]| format!("{t:.2} s {:.1} mdeg/s {y:.4} deg/s {z:.4} deg/s\n", 1e3 * x),
        "",
    ),
    (
        "t_s gx gy gz state\n",
        |t, [x, y, z]| format!("{t:.2}\t{x:.4} °/s {y:.4} °/s  {z:.4} °/s OK\n").replace('\t', " "),
        "",
    ),
    // A state that is a unit's letter.
    ("t_s gx gy gz state\n", |t, [x, y, z]| format!("{t:.2} {x:.4} {y:.4} {z:.4} V\n"), ""),
    // Words of a log before the values.
    ("", |t, [x, y, z]| format!("[{:.3}] gyro {x:.4} {y:.4} {z:.4}\n", 1.7e9 + t), ""),
    ("", |t, [x, y, z]| format!("INFO imu: {t:.2}, {x:.4}, {y:.4}, {z:.4}\n"), ""),
    ("", |t, [x, y, z]| format!("[INFO] [{:.3}] [imu]: {x:.4}, {y:.4}, {z:.4}\n", 1.7e9 + t), ""),
    ("", |t, [x, y, z]| format!("[{:12.6}] imu: {x:.4},{y:.4},{z:.4}\n", 90.0 + t), ""),
    ("", |t, [x, y, z]| format!("[2024-05-13 10:00:{:06.3}] gyro {x:.4} {y:.4} {z:.4}\n", t), ""),
    (
        "",
        |t, [x, y, z]| format!("2024-05-13 10:00:{:06.3} INFO imu - {x:.4} {y:.4} {z:.4}\n", t).replacen('.', ",", 1),
        "",
    ),
    ("", |t, [x, y, z]| format!("10:00:{:06.3} -> gyro: {x:.4},{y:.4},{z:.4}\n", t), ""),
    // A separator, and another one in its cells.
    ("t_s;gx,gy,gz;state\n", |t, [x, y, z]| format!("{t:.2};{x:.4},{y:.4},{z:.4};ok\n"), ""),
    ("t_s|gyro|state\n", |t, [x, y, z]| format!("{t:.2}|{x:.4},{y:.4},{z:.4}|ok\n"), ""),
    ("t_s,gx,gy,gz,state\n", |t, [x, y, z]| format!("{t:.2},{x:.4},{y:.4},{z:.4},ready;armed\n"), ""),
    ("t_s gx gy gz\n", |t, [x, y, z]| format!("{t:.2} {x:.4} {y:.4} {z:.4}\n").replace('.', ","), ""),
];

#[test]
fn rows_are_read_as_programs_write_them() {
    for (kind, (before, row, after)) in ROWS_OF_PROGRAMS.into_iter().enumerate() {
        let mut normal = normal(kind as u64);
        let rates = |_: u32| [(); 3].map(|()| 1.5 + RATE * normal());
        let rates: Vec<[f64; 3]> = (0..ROWS).map(rates).collect();
        let rows = rates.iter().zip(0..).map(|(rates, at)| row(f64::from(at) / 100.0, *rates)).collect::<String>();
        let (_, found) = as_proposed(format!("{before}{rows}{after}").as_bytes(), &[]);
        let [(proposal, read)] = found.as_slice() else { panic!("{kind}: {} sensors", found.len()) };
        let (samples, hz) = (read.samples.len() as u32, read.rate_hz());
        assert_eq!((samples, read.missing()), (ROWS, 0), "{kind}: {proposal:?} {:?}", read.notes);
        assert!((hz / 100.0 - 1.0).abs() < 1e-6, "{kind}: {hz} Hz");
        for channel in ["gyro_x", "gyro_y", "gyro_z"] {
            assert!(is_near(read, channel, RATE), "{kind}: {} {proposal:?}", read.neighbours(channel));
        }
    }
}

/// Raw increments between other logs, with sums by the method of the manual; a wrong sum is a missing sample.
#[test]
fn ascii_logs_of_novatel_are_read() {
    let sum = |content: &str| {
        content.bytes().fold(0_u32, |sum, byte| {
            (0..8).fold(sum ^ u32::from(byte), |sum, _| if sum & 1 == 1 { sum >> 1 ^ 0xEDB8_8320 } else { sum >> 1 })
        })
    };
    for (seed, name, begin) in
        [(1, "#RAWIMUSXA,COM1,0,81.5,FINESTEERING", "00,11,1692,"), (2, "%RAWIMUSA,1692,484620.664", "1692,")]
    {
        let mut normal = normal(seed);
        let (mut content, mut wrong) = (String::new(), 0);
        for row in 0..ROWS {
            let [x, y, z] = [(); 3].map(|()| (1000.0 * RATE * normal()).round());
            let time = 484_620.0 + f64::from(row) / 100.0 + 2e-5 * normal();
            let log = format!("{};{begin}{time:.9},00801503,98066,3,-2,{z},{y},{x}", &name[1..]);
            let is_wrong = row % 500 == 7;
            wrong += usize::from(is_wrong);
            content += &format!("{}{log}*{:08x}\r\n", &name[..1], sum(&log) ^ u32::from(is_wrong));
            let position =
                "BESTPOSA,COM1,0,83.5,FINESTEERING,1692,336148.000,00000040,6145,2724;SOL_COMPUTED,51.1,-114.0";
            content += &format!("#{position}*{:08x}\r\n<OK\r\n", sum(position));
        }
        let options = ["--units", "0.001*deg/s,0.00001*g", "--rate", "100"];
        let read = text("span.ascii", &content, &options);
        assert_eq!(read.samples.len() as u32 + read.missing() as u32, ROWS, "{name}: {:?}", read.notes);
        assert!((read.rate_hz() / 100.0 - 1.0).abs() < 1e-6 && is_near(&read, "gyro_y", RATE), "{name}");
        assert!(read.notes_contain(&format!("{wrong} sentences whose checksum is wrong")), "{:?}", read.notes);
        // Without the size of a count.
        let error =
            super::harness::read("span.ascii", content.as_bytes(), &[""; 0]).err().expect("no unit").to_string();
        assert!(error.contains("no unit of ") && error.contains("--units"), "{error}");
        let (_, found) = as_proposed(content.as_bytes(), &[]);
        let [(proposal, read)] = found.as_slice() else { panic!("{} sensors", found.len()) };
        assert!(proposal.doubts.iter().any(|doubt| doubt.contains("counts of an unknown size")), "{proposal:?}");
        assert!((read.rate_hz() / 100.0 - 1.0).abs() < 1e-6);
    }
}

/// Words of 16 bits in hexadecimal digits, and names in an encoding that is not told.
#[test]
fn words_in_hexadecimal_digits_and_names_of_another_encoding_are_read() {
    let mut normal = normal(7);
    let row = |row: u32| {
        let words = [(); 3].map(|()| format!("0x{:04X}", (131.0 * RATE * normal()).round() as i16));
        format!("{},{}\n", 10 * row, words.join(","))
    };
    let rows = (0..ROWS).map(row).collect::<String>();
    // In Shift-JIS: angular rates, of which one byte is a control character by Latin-1.
    let name = |axis: u8| [b"\x8a\x70\x91\xac\x93\x78".as_slice(), &[axis]].concat();
    let heading = [b"t_ms".to_vec(), name(b'X'), name(b'Y'), name(b'Z')].join(&b',');
    let (_, found) = as_proposed(&[&heading, b"\n".as_slice(), rows.as_bytes()].concat(), &[]);
    let [(proposal, read)] = found.as_slice() else { panic!("{} sensors", found.len()) };
    assert!(proposal.doubts.iter().any(|doubt| doubt.contains("counts of an unknown size")), "{proposal:?}");
    assert_eq!((read.samples.len() as u32, read.missing()), (ROWS, 0));
    assert!(is_near(read, "gyro_y", 131.0 * RATE) && (read.rate_hz() / 100.0 - 1.0).abs() < 1e-6);
}

#[test]
fn a_list_in_a_cell_is_as_many_columns() {
    let mut normal = normal(5);
    for (heading, open, close, separator) in
        [("t_s,gyro_dps,note", "\"[", "]\",x", ","), ("t_s;gyro_dps;note", "[", "];\"a; b\"", ";")]
    {
        let row = |row: u32| {
            let list = [(); 3].map(|()| format!("{:.4}", RATE * normal())).join(", ");
            format!("{:.2}{separator}{open}{list}{close}\n", f64::from(row) / 100.0)
        };
        let content = format!("{heading}\n") + &(0..ROWS).map(row).collect::<String>();
        let columns = ["--columns", "gyro_x=gyro.0,gyro_y=gyro.1,gyro_z=gyro.2", "--units", "deg/s"];
        for options in [&columns[..], &["--units", "deg/s"]] {
            let read = text("lists.csv", &content, options);
            assert!(is_near(&read, "gyro_z", RATE) && (read.rate_hz() / 100.0 - 1.0).abs() < 1e-6, "{heading}");
        }
    }
}

#[test]
fn the_parts_of_a_time_are_one_time() {
    type Row = fn(u64) -> String;
    let cases: [(&str, Row); 5] = [
        ("secs,nsecs", |ns| format!("{},{}", ns / 1_000_000_000, ns % 1_000_000_000)),
        ("header.stamp.sec,header.stamp.nanosec", |ns| format!("{},{}", ns / 1_000_000_000, ns % 1_000_000_000)),
        ("sec,usec", |ns| format!("{},{}", ns / 1_000_000_000, ns % 1_000_000_000 / 1000)),
        ("hour,minute,second,ms", |ns| {
            let s = ns / 1_000_000_000;
            format!("{},{},{},{}", s / 3600 % 24, s / 60 % 60, s % 60, ns / 1_000_000 % 1000)
        }),
        ("second,ms", |ns| format!("{},{}", ns / 1_000_000_000 % 60, ns / 1_000_000 % 1000)),
    ];
    for (names, stamp) in cases {
        for hz in [100.0, 40.0, 250.0] {
            let mut normal = normal(6);
            let row = |row: u32| {
                let ns = 1_700_006_390_000_000_000 + (f64::from(row) / hz * 1e9) as u64;
                let [x, y, z] = [(); 3].map(|()| RATE * normal());
                format!("{},{x:.4},{y:.4},{z:.4}\n", stamp(ns))
            };
            let content = format!("{names},gx_dps,gy_dps,gz_dps\n") + &(0..2 * ROWS).map(row).collect::<String>();
            let read = text("parts.csv", &content, &[]);
            assert!((read.rate_hz() / hz - 1.0).abs() < 1e-6, "{names} at {hz}: {}", read.rate_hz());
            assert_eq!((read.samples.len() as u32, read.missing()), (2 * ROWS, 0), "{names} at {hz}");
        }
    }
}

#[test]
fn the_accelerometer_is_found_by_gravity_and_the_likeness_of_its_axes() {
    for seed in 0..30 {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = normal(seed);
        let turns = random.random_range(0..6);
        let (noise, rate_noise) = (random.random_range(0.005..0.03), random.random_range(0.0008..0.004));
        let tilt: f64 = random.random_range(-0.02..0.02);
        let before = random.random_range(0..2_usize);
        let is_rate_first = random.random_bool(0.3);
        let row = |row: u32| {
            let turn = f64::from(row) / f64::from(ROWS) * f64::from(turns);
            let (whole, part) = (turn.floor(), turn.fract());
            let angle: f64 = 0.9 * (whole + ((part - 0.75).max(0.0) * 4.0)) + tilt;
            let turning =
                if part > 0.75 && turns > 0 { 0.9 * 4.0 * f64::from(turns) / f64::from(ROWS) * 100.0 } else { 0.0 };
            let force = [angle.sin(), 0.002, angle.cos()].map(|of| 9.80665 * of + noise * normal());
            let rate = [0.0, turning, 0.0].map(|of| of + 0.003 + rate_noise * normal());
            let [one, other] = if is_rate_first { [rate, force] } else { [force, rate] };
            let more = ["", "7 "][before];
            let written = |of: [f64; 3]| of.map(|value| format!("{value:.6}")).join(" ");
            format!("{:.2} {more}{} {}\n", f64::from(row) / 100.0, written(one), written(other))
        };
        let content: String = (0..ROWS).map(row).collect();
        let (tables, found) = as_proposed(content.as_bytes(), &[]);
        assert_eq!(found.len(), 1, "{seed}");
        let (first, second) = (1 + before, 4 + before);
        let [force, rate] = if is_rate_first { [second, first] } else { [first, second] };
        let expected = |name: &str, at: usize| {
            ["x", "y", "z"].into_iter().zip(at..).map(|(axis, at)| format!("{name}_{axis}={at}")).collect::<Vec<_>>()
        };
        let columns = &found[0].0.columns;
        for wanted in expected("accl", force).iter().chain(&expected("gyro", rate)) {
            assert!(columns.contains(wanted), "{seed}, {turns} turns: {columns:?} without {wanted}");
        }
        assert!(found[0].0.units.contains(&"m/s^2".to_owned()), "{seed}: {:?} {:?}", found[0].0.units, tables[0].notes);
    }
}

#[test]
fn padding_is_no_rest_and_no_row_to_whoever_looks() {
    for seed in 0..12 {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = normal(seed);
        let (before, after) =
            (random.random_range(0..2) * random.random_range(300..900_u32), random.random_range(600..4000_u32));
        let held = [0.0, -0.00763, 65_535.0][random.random_range(0..3)];
        let is_time_held = random.random_bool(0.5);
        let row = |row: u32| {
            let is_padding = row < before || row >= before + ROWS;
            let time = if is_padding && is_time_held && row > before { 4_294_967.295 } else { f64::from(row) / 20.0 };
            let force = [0.0, 0.0, 9.8].map(|of: f64| if is_padding { held } else { of + 0.02 * normal() });
            let rate = [0.0; 3].map(|of: f64| if is_padding { held } else { of + 0.1 * normal() });
            let values = force.iter().chain(&rate).map(|value| format!("{value:.6}")).collect::<Vec<_>>().join("\t");
            format!("{time:.6}\t{values}\n")
        };
        let content: String = (0..before + ROWS + after).map(row).collect();
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("flash.txt");
        std::fs::write(&file, &content).expect("written");
        let tables = inspect(&file);
        assert_eq!(tables[0].rows as u32, ROWS, "{seed}: {:?}", tables[0].notes);
        assert!((tables[0].rate.expect("a rate").hz / 20.0 - 1.0).abs() < 1e-3, "{seed}");
        let steady = tables[0].steady.as_ref().expect("a sensor");
        let own = before as usize..(before + ROWS) as usize;
        assert!(own.start <= steady.rows.start && steady.rows.end <= own.end, "{seed}: {steady:?}");
        assert!(tables[0].notes.iter().any(|note| note.to_string().contains("are padding and left out")), "{seed}");
    }
}

#[test]
fn a_packet_number_is_no_time() {
    for (seed, name) in ["Packet number", "PacketCounter", "sample_number", ""].into_iter().enumerate() {
        let mut random = ChaCha8Rng::seed_from_u64(seed as u64);
        let mut normal = normal(seed as u64);
        let (mut number, mut lost) = (1, 0);
        let row = |_: u32| {
            let skipped = u32::from(random.random_bool(0.01));
            (number, lost) = (number + 1 + skipped, lost + skipped);
            let [x, y, z] = [(); 3].map(|()| RATE * normal());
            format!("{number},{x:.4},{y:.4},{z:.4},0.02,0.01,-0.32\n")
        };
        let rows: String = (0..ROWS).map(row).collect();
        let heading = if name.is_empty() {
            String::new()
        } else {
            format!(
                "{name},Gyroscope X (deg/s),Gyroscope Y (deg/s),Gyroscope Z (deg/s),Magnetometer X (G),Magnetometer Y (G),Magnetometer Z (G)\n"
            )
        };
        let (_, found) = as_proposed((heading + &rows).as_bytes(), &["--rate", "256"]);
        let [(proposal, read)] = &found[..] else { panic!("{name}: {}", found.len()) };
        assert!(proposal.lacks_rate, "{name}: {proposal:?}");
        assert_eq!((read.samples.len() as u32, read.missing() as u32), (ROWS, lost), "{name}: {proposal:?}");
        assert_eq!(name.is_empty(), !read.samples.channels.iter().any(|of| of.profile.name == "magn_z"), "{name}");
    }
}

#[test]
fn a_vector_that_is_never_filled_is_left_out_with_a_note() {
    let mut normal = normal(8);
    let mut table = |zeros: usize| {
        let row = |row: u32| {
            let [x, y, z] = [(); 3].map(|()| RATE * normal());
            let force =
                [0, 1, 2].map(|axis| if axis < zeros { 0.0 } else { FORCE * normal() }).map(|of| of.to_string());
            format!("{:.2},{x:.4},{y:.4},{z:.4},{}\n", f64::from(row) / 100.0, force.join(","))
        };
        let content = "t_s,gx_dps,gy_dps,gz_dps,ax_g,ay_g,az_g\n".to_owned() + &(0..ROWS).map(row).collect::<String>();
        text("imu.csv", &content, &[])
    };
    let unfilled = table(3);
    assert_eq!(unfilled.samples.channels.len(), 3);
    assert!(unfilled.notes_contain("accl_z (az) is never filled"), "{:?}", unfilled.notes);
    assert_eq!(table(1).samples.channels.len(), 6);
}

/// Messages of a sensor as a recorder of ROS 2 writes them to a file: `sensor_msgs/msg/Imu` in CDR.
fn mcap(messages: &[(u64, [f64; 3])]) -> Vec<u8> {
    let record = |opcode: u8, body: &[u8]| [&[opcode][..], &(body.len() as u64).to_le_bytes(), body].concat();
    let text = |text: &str| [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat();
    let schema = [&1u16.to_le_bytes()[..], &text("sensor_msgs/msg/Imu"), &text("ros2msg"), &text("")].concat();
    let channel = [&7u16.to_le_bytes()[..], &1u16.to_le_bytes(), &text("/imu"), &text("cdr"), &[0; 4]].concat();
    let mut file = [b"\x89MCAP0\r\n".to_vec(), record(3, &schema), record(4, &channel)].concat();
    for (ns, rate) in messages {
        let stamp = [ns / 1_000_000_000, ns % 1_000_000_000].map(|part| (part as u32).to_le_bytes());
        // An empty name of the frame, and what aligns the numbers behind it.
        let head = [&[0, 1, 0, 0][..], &stamp.concat(), &1u32.to_le_bytes(), &[0; 4]].concat();
        let orientation = [0.0, 0.0, 0.0, 1.0].into_iter().chain([0.0; 9]);
        let numbers = orientation.chain(*rate).chain([0.0; 9]).chain([0.0, 0.0, 9.8]).chain([0.0; 9]);
        let data: Vec<u8> = head.into_iter().chain(numbers.flat_map(f64::to_le_bytes)).collect();
        let header = [&7u16.to_le_bytes()[..], &[0; 4], &ns.to_le_bytes(), &ns.to_le_bytes()].concat();
        file.extend(record(5, &[header, data].concat()));
    }
    file.extend(record(2, &[0; 20]));
    file
}

#[test]
fn a_bag_in_a_folder_is_one_recording() {
    for seed in 0..8 {
        let (mut random, mut normal) = (ChaCha8Rng::seed_from_u64(seed), normal(seed));
        let messages: Vec<(u64, [f64; 3])> = (0..u64::from(ROWS))
            .map(|row| (1_700_000_000_000_000_000 + row * 5_000_000, [(); 3].map(|()| RATE.to_radians() * normal())))
            .collect();
        let folder = tempfile::tempdir().expect("a folder");
        let bag = folder.path().join("run");
        std::fs::create_dir(&bag).expect("a folder");
        let files = random.random_range(1..5);
        let first = random.random_range(7..10);
        for (number, part) in (first..).zip(messages.chunks(messages.len().div_ceil(files))) {
            let (name, content) = (bag.join(format!("run_{number}.mcap")), mcap(part));
            if random.random() {
                std::fs::write(name, content).expect("written");
            } else {
                let compressed = compress_to_vec(content.as_slice(), CompressionLevel::Fastest);
                std::fs::write(name.with_extension("mcap.zstd"), compressed).expect("written");
            }
        }
        if random.random() {
            std::fs::write(bag.join("metadata.yaml"), "rosbag2_bagfile_information:\n").expect("written");
        }
        let read_bag = || read_file(&bag, &[""; 0]);
        let found = read_bag().unwrap_or_else(|error| panic!("{seed}: {error}"));
        let whole = read("whole.mcap", &mcap(&messages), &[""; 0]).expect("one file");
        assert_eq!((found.samples, found.notes), (whole.samples, whole.notes), "{seed}: {files} files");
        std::fs::write(bag.join("other_0.mcap"), mcap(&messages)).expect("written");
        let refused = read_bag().err().expect("two bags").to_string();
        assert!(refused.contains("is a directory"), "{seed}: {refused}");
    }
}

#[test]
fn a_device_that_is_turned_between_rests_is_at_rest_in_each() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("turned.csv");
    for seed in 0..12 {
        let (mut random, mut normal) = (ChaCha8Rng::seed_from_u64(seed), normal(seed));
        // The length of each rest and of the turn behind it, and the angle of that turn about y.
        let parts: Vec<[usize; 2]> =
            (0..6).map(|_| [random.random_range(500..1500), random.random_range(100..400)]).collect();
        let mut content = "t_s,gx_dps,gy_dps,gz_dps,ax_g,ay_g,az_g\n".to_owned();
        let (mut angle, mut row, mut rests) = (0.0_f64, 0, Vec::new());
        for [rest, turn] in parts {
            rests.push(row..row + rest);
            let step = random.random_range(0.4..1.5) / turn as f64;
            for at in 0..rest + turn {
                let turning = if at < rest { 0.0 } else { step };
                angle += turning;
                let rate = [0.0, turning.to_degrees() * 100.0, 0.0].map(|of| of + RATE * normal());
                let force = [angle.sin(), 0.0, angle.cos()].map(|of| of + FORCE * normal());
                let values = rate.iter().chain(&force).map(|value| format!("{value:.5}")).collect::<Vec<_>>().join(",");
                content += &format!("{:.2},{values}\n", row as f64 / 100.0);
                row += 1;
            }
        }
        std::fs::write(&file, content).expect("written");
        let steady = inspect(&file).remove(0).steady.expect("a sensor");
        // Whole blocks of 128 or 256 rows; those that a turn touches and one at either end are left out.
        let is_inside =
            rests.iter().any(|rest| rest.start <= steady.rows.start + 128 && steady.rows.end <= rest.end + 128);
        let longest = rests.iter().map(ExactSizeIterator::len).max().unwrap_or(0);
        assert!(steady.is_rest && is_inside, "{seed}: {steady:?} of {rests:?}");
        assert!(steady.rows.len() + 4 * 256 > longest, "{seed}: {steady:?} of {rests:?}");
    }
}

/// A word for a value costs the value, in whichever row it is; the stamp keeps its place.
#[test]
fn a_word_for_a_value_costs_the_value() {
    for (seed, word) in [(1, "ERROR"), (2, "timeout"), (3, "over range"), (4, "<none>"), (5, "-nan(ind)")] {
        let mut normal = normal(seed);
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let (mut content, mut words) = ("t_s,gx_dps,gy_dps,gz_dps\n".to_owned(), 0);
        for row in 0..ROWS {
            let has_word = row % 50 == 0 || random.random_range(0..10) == 0;
            words += usize::from(has_word);
            let mut values = [(); 3].map(|()| format!("{:.4}", RATE * normal()));
            if has_word {
                values[1..].fill(word.to_owned());
            }
            content += &format!("{:.2},{}\n", f64::from(row) / 100.0, values.join(","));
        }
        let read = text("rows.csv", &content, &[]);
        assert_eq!((read.samples.len() as u32, read.missing()), (ROWS, 0), "{word}");
        assert_eq!((read.refused("gyro_x", "missing"), read.refused("gyro_z", "missing")), (0, words), "{word}");
        assert!((read.rate_hz() / 100.0 - 1.0).abs() < 1e-6 && is_near(&read, "gyro_y", RATE), "{word}");
        let note = format!("{words} rows have words for values, which are missing, the first of them line 2");
        assert!(read.notes_contain(&note), "{word}: {:?}", read.notes);
    }
    // A column of words is none of a channel.
    let content = "t_s,gx_dps\n".to_owned() + &(0..ROWS).map(|row| format!("{row},idle\n")).collect::<String>();
    let error = read("rows.csv", content.as_bytes(), &[""; 0]).err().expect("no values").to_string();
    assert!(error.contains("line 2: column gx: \"idle\" is not a number"), "{error}");
}

/// Nines in all axes of a sensor are no values; in one they may be.
#[test]
fn nines_in_all_axes_are_missing_values() {
    for (seed, nines) in [(1, "-9999"), (2, "999.9"), (3, "99999.00"), (4, "-999")] {
        let mut normal = normal(seed);
        let mut content = "t_s,gx_dps,gy_dps,gz_dps\n".to_owned();
        for row in 0..ROWS {
            let values = [(); 3].map(|()| format!("{:.4}", RATE * normal()));
            let values = if row % 50 == 7 { [nines, nines, nines].join(",") } else { values.join(",") };
            content += &format!("{:.2},{values}\n", f64::from(row) / 100.0);
        }
        let read = text("rows.csv", &content, &[]);
        assert_eq!((read.samples.len() as u32, read.refused("gyro_y", "missing")), (ROWS, 60), "{nines}");
        assert!(is_near(&read, "gyro_z", RATE), "{nines}");
        let value: f64 = nines.parse().expect("a number");
        assert!(read.notes_contain(&format!("60 times {value} stands in all axes of a sensor")), "{:?}", read.notes);
    }
}

/// Line ends, delimiters, brackets, exponents and encodings of other programs.
#[test]
fn whatever_a_program_writes_between_numbers_they_are_read() {
    let table = |begin: &str, separator: &str, end: &str, exponent: &str| {
        let mut normal = normal(7);
        let mut content = ["t_s", "gx_dps", "gy_dps", "gz_dps"].join(separator) + end;
        for row in 0..ROWS {
            let values = [(); 3].map(|()| format!("{:.4}{exponent}", RATE * normal())).join(separator);
            content += &format!("{begin}{:.2}{separator}{values}{end}", f64::from(row) / 100.0);
        }
        content
    };
    let utf16 = |to_bytes: fn(u16) -> [u8; 2]| table("", ",", "\n", "").encode_utf16().flat_map(to_bytes).collect();
    // Shift-JIS for a measurement.
    let japanese = [b"\x8c\x76\x91\xaa\n", table("", ",", "\n", "").as_bytes()].concat();
    for (what, content) in [
        ("carriage returns", table("", ",", "\r", "").into_bytes()),
        ("bars", table("", "|", "\n", "").into_bytes()),
        ("brackets", table("[", ", ", "]\n", "").replacen(']', "", 1).into_bytes()),
        ("parentheses", table("(", ", ", ")\r\n", "").replacen(')', "", 1).into_bytes()),
        ("exponents of Fortran", table("", " ", "\n", "D+00").into_bytes()),
        ("UTF-16, low byte first", utf16(u16::to_le_bytes)),
        ("UTF-16, high byte first", utf16(u16::to_be_bytes)),
        ("another encoding", japanese),
    ] {
        let read = read("rows.csv", &content, &[""; 0]).unwrap_or_else(|error| panic!("{what}: {error}"));
        assert_eq!((read.samples.len() as u32, read.missing()), (ROWS, 0), "{what}");
        assert!((read.rate_hz() / 100.0 - 1.0).abs() < 1e-6 && is_near(&read, "gyro_z", RATE), "{what}");
    }
}

/// The rate of the user needs no column of times, whatever is in it.
#[test]
fn a_stated_rate_beats_a_column_that_is_no_time() {
    type TimeOfRow = fn(u32) -> String;
    let times: [(&str, TimeOfRow); 5] = [
        ("words", |row| format!("tick {row}")),
        ("reversed", |row| format!("{:.2}", f64::from(ROWS - row) / 100.0)),
        ("in groups", |row| format!("\"1,{:03},000\"", row % 1000)),
        ("far apart", |row| if row < 1500 { row.to_string() } else { (u64::from(row) * 10_000_000).to_string() }),
        ("constant", |_| "5".to_owned()),
    ];
    for (what, time) in times {
        let mut normal = normal(8);
        let mut content = "time,gx_dps,gy_dps,gz_dps\n".to_owned();
        for row in 0..ROWS {
            let [x, y, z] = [(); 3].map(|()| RATE * normal());
            content += &format!("{},{x:.4},{y:.4},{z:.4}\n", time(row));
        }
        let read = text("rows.csv", &content, &["--rate", "100"]);
        assert_eq!((read.samples.len() as u32, read.missing()), (ROWS, 0), "{what}");
        assert!((read.rate_hz() / 100.0 - 1.0).abs() < 1e-9 && is_near(&read, "gyro_x", RATE), "{what}");
        assert!(read.notes_contain("the time stamps are ignored: "), "{what}: {:?}", read.notes);
    }
}

/// Up to eight rows of a set clock that is set back.
#[test]
fn wrong_stamps_in_a_row_are_left_out() {
    for seed in 0..12 {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let (first, wrong) = (random.random_range(40..ROWS - 40), random.random_range(1..=8_u32));
        let by: f64 = random.random_range(5.0..1e6);
        let mut normal = normal(seed);
        let mut content = "t_s,gx_dps,gy_dps,gz_dps\n".to_owned();
        for row in 0..ROWS {
            let [x, y, z] = [(); 3].map(|()| RATE * normal());
            let time = f64::from(row) / 100.0 + if (first..first + wrong).contains(&row) { by } else { 0.0 };
            content += &format!("{time:.2},{x:.4},{y:.4},{z:.4}\n");
        }
        let read = text("rows.csv", &content, &[]);
        let found = (read.samples.len() as u32, read.dropped("time_backwards") as u32, read.missing());
        assert_eq!(found, (ROWS - wrong, wrong, 0), "{seed}: {wrong} by {by}: {:?}", read.notes);
        assert!((read.rate_hz() / 100.0 - 1.0).abs() < 1e-4, "{seed}: {}", read.rate_hz());
    }
}

/// Addresses of devices, and numbers of kinds of sensors.
#[test]
fn rows_of_several_devices_are_told_by_any_label() {
    for (heading, labels) in [
        ("address", ["00:07:80:0F:0A:11", "00:07:80:0F:0A:12"]),
        ("address", ["00-07-80-12-10-11", "10-07-80-12-10-12"]),
        ("sensor_type", ["4", "11"]),
        ("device", ["left", "right"]),
    ] {
        let mut normal = normal(9);
        let mut content = format!("{heading},t_s,gx_dps,gy_dps,gz_dps\n");
        for row in 0..ROWS {
            for (label, more) in labels.into_iter().zip([0.0, 0.003]) {
                let [x, y, z] = [(); 3].map(|()| RATE * normal());
                content += &format!("{label},{:.3},{x:.4},{y:.4},{z:.4}\n", f64::from(row) / 100.0 + more);
            }
        }
        let (_, found) = as_proposed(content.as_bytes(), &[]);
        let topics: Vec<_> = found.iter().filter_map(|(proposal, _)| proposal.topic.as_deref()).collect();
        assert_eq!(topics, labels);
        assert!(found.iter().all(|(_, read)| (read.rate_hz() / 100.0 - 1.0).abs() < 1e-6));
    }
}

/// Until then its columns hold a value, which is not the quietest part.
#[test]
fn a_sensor_that_begins_late_is_not_at_rest_before() {
    for held in [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]] {
        let mut normal = normal(10);
        let mut content = "t_s,gx_dps,gy_dps,gz_dps,ax_g,ay_g,az_g\n".to_owned();
        for row in 0..4 * ROWS {
            let rate = [(); 3].map(|()| RATE * normal());
            let force = [0.0, 0.0, 1.0].map(|of: f64| of + FORCE * normal());
            let [ax, ay, az] = if row < 1500 { held } else { force };
            let [x, y, z] = rate;
            content += &format!("{:.2},{x:.4},{y:.4},{z:.4},{ax:.6},{ay:.6},{az:.6}\n", f64::from(row) / 100.0);
        }
        let (tables, _) = as_proposed(content.as_bytes(), &[]);
        let part = tables[0].proposals[0].part.expect("a part at rest");
        assert!((15.0..18.0).contains(&part.from_s) && part.to_s > 118.0, "{held:?}: {part:?}");
    }
}
