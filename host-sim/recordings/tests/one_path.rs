//! Whatever the size of its batches, its format, and whether it is held in memory: the same rows are the same samples, notes and counts.

use adis16405_driver::GyroRange;
use measurement::{Measurement, RecordingDescription, SampleBlock, SensorProfile};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use recordings::ColumnSelection;
use recordings::ReadOptions;
use recordings::file_format::{RecordedFormat, RecordedInput};
use recordings::sample_stream::{KeptInMemory, Reading, SampleStream};
use recordings::time_base::TimeRange;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Nothing is one measurement in memory.
const STREAMED: KeptInMemory = KeptInMemory { rows: 0, rows_with_losses: 0, most_lost: 1.0 };

#[derive(Debug, PartialEq)]
struct Result {
    description: RecordingDescription,
    slots: Vec<u64>,
    channels: Vec<Channel>,
    notes: Vec<String>,
}

#[derive(Debug, Clone, PartialEq, Default)]
struct Channel {
    counts: Vec<i32>,
    refused: Vec<(usize, &'static str)>,
}

fn open(file: &Path, units: &[&str], reading: Reading) -> SampleStream {
    let input = RecordedInput::open(file).expect("a file");
    if input.format() == RecordedFormat::CountTable {
        return SampleStream::counts(input, GyroRange::Dps300, reading).expect("a time base");
    }
    let units: Vec<String> = units.iter().map(|unit| (*unit).to_owned()).collect();
    let selection = ColumnSelection::parse(&[], &units).expect("units");
    let options = ReadOptions { sensor: SensorProfile::generic(), selection, topic: None };
    SampleStream::any_sensor(input, options, reading).expect("a time base")
}

fn read(file: &Path, units: &[&str], reading: Reading) -> Result {
    let mut stream = open(file, units, reading);
    let mut blocks: Vec<SampleBlock> = Vec::new();
    while !stream.read(|block| blocks.push(block)).expect("samples") {
        blocks.clear();
    }
    let (mut slots, mut channels) = (Vec::new(), Vec::new());
    for block in blocks {
        channels.resize(block.channels.len().max(channels.len()), Channel::default());
        for (of_block, channel) in block.channels.iter().zip(&mut channels) {
            let positions = of_block.refused.iter().flat_map(|(cause, at)| at.iter().map(move |at| (*at, *cause)));
            channel.refused.extend(positions.map(|(at, cause)| (at + slots.len(), cause)));
            channel.counts.extend(&of_block.counts);
        }
        slots.extend(block.slots);
    }
    channels.iter_mut().for_each(|channel| channel.refused.sort_unstable());
    Result {
        description: stream.description().clone(),
        slots,
        channels,
        notes: stream.notes().iter().map(ToString::to_string).collect(),
    }
}

fn held(measurement: &Measurement, notes: &[String]) -> Result {
    let channel = |of: &measurement::MeasuredChannel| {
        let refused = of.refused.iter().flat_map(|(cause, at)| at.iter().map(move |at| (*at, *cause)));
        let mut refused: Vec<(usize, &'static str)> = refused.collect();
        refused.sort_unstable();
        Channel { counts: of.counts.clone(), refused }
    };
    Result {
        description: RecordingDescription::from(measurement),
        slots: measurement.slots.clone(),
        channels: measurement.channels.iter().map(channel).collect(),
        notes: notes.to_vec(),
    }
}

/// Noise of three channels in the size of a count, on stamps that jitter, with faults that are drawn.
#[derive(Debug, Clone, Copy)]
struct Table {
    rows: u64,
    seed: u64,
    /// Standard deviation of the noise, counts.
    noise: f64,
    /// Largest delay of a stamp, in sample periods.
    jitter: f64,
    /// Probabilities of a loss, of a row that is read twice, of a missing value, and of full scale.
    loss: f64,
    again: f64,
    missing: f64,
    full_scale: f64,
    /// Rows whose stamp goes back, one in so many; 0 for none.
    back_every: u64,
}

const TABLE: Table = Table {
    rows: 3000,
    seed: 0,
    noise: 5.0,
    jitter: 0.1,
    loss: 0.0,
    again: 0.0,
    missing: 0.0,
    full_scale: 0.0,
    back_every: 0,
};

const RATE_HZ: f64 = 200.0;

impl Table {
    /// Stamps in us, and the numbers of a row; `None` where one is missing.
    fn rows(self) -> Vec<(u64, [Option<i32>; 3])> {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        let mut normal = {
            let mut rng = ChaCha8Rng::seed_from_u64(self.seed + 1);
            move || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
        };
        let mut rows = Vec::new();
        for row in 0..self.rows {
            let late = self.jitter * rng.random::<f64>();
            let mut stamp = ((row as f64 + late) / RATE_HZ * 1e6) as u64 + 1_700_000_000_000_000;
            let mut values = [(); 3].map(|()| Some((self.noise * normal()).round() as i32));
            let [lost, again, missing, full] = [(); 4].map(|()| rng.random::<f64>());
            if missing < self.missing {
                values[(row % 3) as usize] = None;
            }
            if full < self.full_scale {
                values[0] = Some(32_767);
            }
            stamp = stamp.max(rows.last().map_or(0, |(before, _)| *before));
            if self.back_every > 0 && row % self.back_every == self.back_every / 2 {
                stamp -= 40_000;
            }
            if lost < self.loss {
                continue;
            }
            rows.push((stamp, values));
            if again < self.again {
                rows.push((stamp + 1200, values));
            }
        }
        rows
    }

    fn csv(self, folder: &TempDir) -> PathBuf {
        let number = |value: Option<i32>| value.map_or(String::new(), |value| value.to_string());
        let row = |(stamp, values): (u64, [Option<i32>; 3])| format!("{stamp},{}\n", values.map(number).join(","));
        let text: String = self.rows().into_iter().map(row).collect();
        let file = folder.path().join("table.csv");
        std::fs::write(&file, format!("timestamp,gx [deg/s],gy [deg/s],gz [deg/s]\n{text}")).expect("room");
        file
    }
}

fn tables() -> Vec<Table> {
    vec![
        TABLE,
        Table { noise: 0.5, jitter: 0.36, ..TABLE },
        Table { noise: 0.5, jitter: 0.02, again: 0.02, seed: 3, ..TABLE },
        Table { loss: 0.03, missing: 0.02, full_scale: 0.01, back_every: 700, seed: 4, ..TABLE },
        // Coarser than the sample period: the delays are several of it.
        Table { jitter: 3.0, seed: 5, ..TABLE },
    ]
}

#[test]
fn any_size_of_batches_gives_the_same_samples_notes_and_counts() {
    let folder = tempfile::tempdir().expect("a folder");
    for table in tables() {
        let file = table.csv(&folder);
        let reading = Reading::new(None, STREAMED);
        let whole = read(&file, &[], Reading { batch_rows: usize::MAX, ..reading });
        assert!(!whole.slots.is_empty(), "{table:?}");
        for batch_rows in [1, 2, 3, 127, 128, 1000, 2999, 3000] {
            let parts = read(&file, &[], Reading { batch_rows, ..reading });
            assert_eq!(parts, whole, "{table:?} in batches of {batch_rows}");
        }
        let stream = open(&file, &[], Reading::new(None, KeptInMemory::ALL));
        assert!(stream.is_in_memory());
        let notes = stream.notes().iter().map(ToString::to_string).collect::<Vec<_>>();
        assert_eq!(held(&stream.into_beginning(), &notes), whole, "{table:?}");
    }
}

#[test]
fn a_table_is_the_same_wherever_it_is_split() {
    let folder = tempfile::tempdir().expect("a folder");
    for seed in 0..4 {
        let mut rng = ChaCha8Rng::seed_from_u64(100 + seed);
        let mut draw = |most: f64| most * rng.random::<f64>();
        let table = Table {
            rows: 250 + draw(150.0) as u64,
            seed,
            noise: 1.0 + draw(9.0),
            jitter: draw(0.4),
            loss: draw(0.05),
            again: draw(0.02),
            missing: draw(0.05),
            full_scale: draw(0.02),
            back_every: 60 + draw(100.0) as u64,
        };
        let file = table.csv(&folder);
        let reading = Reading::new(None, STREAMED);
        let whole = read(&file, &[], Reading { batch_rows: usize::MAX, ..reading });
        for batch_rows in 1..=table.rows as usize {
            let parts = read(&file, &[], Reading { batch_rows, ..reading });
            assert_eq!(parts, whole, "{table:?} in batches of {batch_rows}");
        }
    }
}

#[test]
fn a_table_in_another_form_has_the_same_samples() {
    let folder = tempfile::tempdir().expect("a folder");
    for seed in 20..24 {
        let rows = Table { loss: 0.02, missing: 0.02, seed, ..TABLE }.rows();
        let write = |name: &str, bytes: &[u8]| {
            let file = folder.path().join(name);
            std::fs::write(&file, bytes).expect("room");
            file
        };
        let text = |heading: &str, row: &dyn Fn(u64, [Option<f64>; 3]) -> String| {
            let rows = rows.iter().map(|(stamp, values)| row(*stamp, values.map(|value| value.map(f64::from))) + "\n");
            (heading.to_owned() + "\n" + &rows.collect::<String>()).into_bytes()
        };
        let cell = |value: Option<f64>| value.map_or(String::new(), |value| value.to_string());
        let plain = text("timestamp,gx [deg/s],gy [deg/s],gz [deg/s]", &|stamp, [x, y, z]| {
            format!("{stamp},{},{},{}", cell(x), cell(y), cell(z))
        });
        let shuffled = text("gz [deg/s];gx [deg/s];time_us;gy [deg/s]", &|stamp, [x, y, z]| {
            format!("{};{};{stamp};{}", cell(z), cell(x), cell(y))
        });
        let in_radians = text("time_ns\tgx [rad/s]\tgy [rad/s]\tgz [rad/s]", &|stamp, values| {
            let [x, y, z] = values.map(|value| cell(value.map(f64::to_radians)));
            format!("{stamp}000\t{x}\t{y}\t{z}")
        });
        let quoted = text("\"time_us\",\"gx [deg/s]\",\"gy [deg/s]\",\"gz [deg/s]\"", &|stamp, [x, y, z]| {
            format!("\"{stamp}\",\"{}\",\"{}\",\"{}\"", cell(x), cell(y), cell(z))
        });
        let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        std::io::Write::write_all(&mut gzip, &plain).expect("memory");
        let forms = [
            (write("plain.csv", &plain), &[][..]),
            (write("shuffled.txt", &shuffled), &[]),
            (write("radians.tsv", &in_radians), &[]),
            (write("quoted.csv", &quoted), &[]),
            (write("plain.csv.gz", &gzip.finish().expect("memory")), &[]),
            (write("rows.npy", &array(&rows)), &["us", "deg/s"]),
        ];
        let whole = samples(&forms[0].0, forms[0].1);
        assert!(whole.slots.len() > 2500, "{seed}");
        for (file, units) in &forms[1..] {
            let read = samples(file, units);
            assert_eq!((&read.slots, &read.dropped), (&whole.slots, &whole.dropped), "{seed}: {}", file.display());
            assert!((read.rate_hz / whole.rate_hz - 1.0).abs() < 1e-9, "{seed}: {}", file.display());
            for (channel, values) in &whole.channels {
                for (one, other) in values.iter().zip(&read.channels[channel]) {
                    // A count of the other form may be another size.
                    let is_same = one.is_nan() && other.is_nan() || (one - other).abs() < 1e-3;
                    assert!(is_same, "{seed}: {}: {channel}: {one} {other}", file.display());
                }
            }
        }
    }
}

#[test]
fn a_reversed_recording_has_as_many_losses_and_the_same_rate() {
    let folder = tempfile::tempdir().expect("a folder");
    for seed in 30..36 {
        let rows = Table { loss: 0.01, seed, ..TABLE }.rows();
        let end = 2 * rows.last().expect("rows").0;
        let text = |rows: &mut dyn Iterator<Item = (u64, [Option<i32>; 3])>| {
            let row = |(stamp, [x, y, z]): (u64, [Option<i32>; 3])| {
                format!("{stamp},{},{},{}\n", x.expect("a number"), y.expect("a number"), z.expect("a number"))
            };
            "time_us,gx [deg/s],gy [deg/s],gz [deg/s]\n".to_owned() + &rows.map(row).collect::<String>()
        };
        let read = |name: &str, text: String| {
            let file = folder.path().join(name);
            std::fs::write(&file, text).expect("room");
            samples(&file, &[])
        };
        let forwards = read("forwards.csv", text(&mut rows.iter().copied()));
        let mut reversed = rows.iter().rev().map(|(stamp, values)| (end - stamp, *values));
        let backwards = read("backwards.csv", text(&mut reversed));
        assert_eq!((backwards.slots.len(), &backwards.dropped), (forwards.slots.len(), &forwards.dropped), "{seed}");
        // A delay of a tenth of a period at either end, over 3000 of them.
        assert!((backwards.rate_hz / forwards.rate_hz - 1.0).abs() < 0.2 / 3000.0, "{seed}");
        let values = |of: &Samples| of.channels["gyro_y"].clone();
        assert!(values(&forwards).iter().eq(values(&backwards).iter().rev()), "{seed}");
    }
}

struct Samples {
    slots: Vec<u64>,
    rate_hz: f64,
    dropped: std::collections::BTreeMap<&'static str, u64>,
    channels: std::collections::BTreeMap<&'static str, Vec<f64>>,
}

fn samples(file: &Path, units: &[&str]) -> Samples {
    let Result { description, slots, channels, .. } = read(file, units, Reading::new(None, STREAMED));
    let values = |of: &Channel, lsb: f64| {
        let mut values: Vec<f64> = of.counts.iter().map(|count| f64::from(*count) * lsb).collect();
        of.refused.iter().for_each(|(at, _)| values[*at] = f64::NAN);
        values
    };
    let profiles = description.channels.iter().zip(&channels);
    let channels = profiles.map(|(profile, of)| (profile.name, values(of, profile.lsb))).collect();
    Samples { slots, rate_hz: description.sample_rate_hz, dropped: description.dropped, channels }
}

fn array(rows: &[(u64, [Option<i32>; 3])]) -> Vec<u8> {
    let mut header =
        "{'descr': [('time', '<u8'), ('gx', '<f8'), ('gy', '<f8'), ('gz', '<f8')], 'fortran_order': False, \
                      'shape': (ROWS,), }"
            .replace("ROWS", &rows.len().to_string());
    while !(10 + header.len() + 1).is_multiple_of(64) {
        header.push(' ');
    }
    header.push('\n');
    let mut bytes = [b"\x93NUMPY\x01\x00", &(header.len() as u16).to_le_bytes()[..], header.as_bytes()].concat();
    for (stamp, values) in rows {
        bytes.extend(stamp.to_le_bytes());
        values.iter().for_each(|value| bytes.extend(value.map_or(f64::NAN, f64::from).to_le_bytes()));
    }
    bytes
}

#[test]
fn a_longer_recording_is_read_as_a_shorter_one() {
    let folder = tempfile::tempdir().expect("a folder");
    for (noise, jitter, again) in [(0.5, 0.36, 0.0), (5.0, 0.1, 0.01)] {
        let mut found = Vec::new();
        for rows in [100_000, 300_000] {
            let table = Table { rows, noise, jitter, again, full_scale: 0.001, seed: 7, ..TABLE };
            let is_again = table.rows().len() as u64 - rows;
            let result = read(&table.csv(&folder), &[], Reading::new(None, STREAMED));
            let of = |counts: &std::collections::BTreeMap<&'static str, u64>, cause| counts.get(cause).copied();
            let RecordingDescription { samples, dropped, flagged, .. } = &result.description;
            assert_eq!((*samples, of(dropped, "gap")), (rows, Some(0)), "{rows} rows, noise {noise}");
            assert_eq!(of(dropped, "repeated").unwrap_or(0), is_again, "{rows} rows, noise {noise}");
            let saturated = table.rows().iter().filter(|(_, values)| values[0] == Some(32_767)).count() as u64;
            assert_eq!(of(flagged, "saturated"), Some(saturated), "{rows} rows, noise {noise}");
            assert!((result.description.sample_rate_hz / RATE_HZ - 1.0).abs() < 1e-6);
            let words =
                |notes: &[String]| notes.iter().map(|note| note.replace(char::is_numeric, "")).collect::<Vec<_>>();
            found.push(words(&result.notes));
        }
        assert_eq!(found[0], found[1], "noise {noise}");
    }
}

#[test]
fn counts_with_an_index_are_the_same_in_batches_of_any_size() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let mut text = "sample,time_s,gyro_x_counts,gyro_y_counts,accl_z_counts,supply_counts\n".to_owned();
    for row in (0..4000u32).filter(|row| row % 500 != 77) {
        let time = f64::from(row) / 100.0 + if row >= 2000 { 300.0 } else { 0.0 };
        let [x, y, z] = [(); 3].map(|()| rng.random_range(-30..30));
        // A rate that no sensor of this range has is refused in its channel; a supply of 0 V is that of no part.
        let x = if row % 900 == 400 { 7500 } else { x };
        text += &format!("{row},{time:.4},{x},{y},{},{}\n", z + 300, if row % 1000 == 3 { 0 } else { 2068 });
    }
    let file = folder.path().join("counts.csv");
    std::fs::write(&file, text).expect("room");
    let reading = Reading::new(None, STREAMED);
    let whole = read(&file, &[], Reading { batch_rows: usize::MAX, ..reading });
    assert_eq!((whole.description.samples, whole.description.dropped["gap"]), (3988, 8));
    assert_eq!(whole.description.flagged["clock_step"], 1);
    assert_eq!(whole.channels[1].refused.iter().filter(|(_, cause)| *cause == "impossible_rate").count(), 4);
    for batch_rows in [1, 7, 500, 3999] {
        assert_eq!(read(&file, &[], Reading { batch_rows, ..reading }), whole, "batches of {batch_rows}");
    }
}

#[test]
fn a_part_is_the_same_in_batches_of_any_size() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = Table { loss: 0.01, back_every: 300, ..TABLE }.csv(&folder);
    let part = Some(TimeRange { from_s: 3.0, to_s: 11.5 });
    let reading = Reading::new(None, STREAMED).of_part(part);
    let whole = read(&file, &[], Reading { batch_rows: usize::MAX, ..reading });
    assert_eq!(whole.description.periods, 1700);
    for batch_rows in [1, 13, 600, 1699] {
        assert_eq!(read(&file, &[], Reading { batch_rows, ..reading }), whole, "batches of {batch_rows}");
    }
}
