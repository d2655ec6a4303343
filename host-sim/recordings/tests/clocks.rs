//! The rate and the losses found on records whose truth is known: clocks that jump, wander or change, and bursts.

use adis16405_driver::{Burst, Channel, Counts, GyroRange};
use measurement::SensorProfile;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use recordings::ColumnSelection;
use recordings::ReadOptions;
use recordings::file_format::RecordedInput;
use recordings::recording::{Recorder, TimeStamp};
use recordings::sample_stream::{KeptInMemory, Reading, SampleStream};
use recordings::time_base::{EstimatedTimeBase, TimeBaseError, time_base};

fn base(times: impl IntoIterator<Item = f64>) -> Result<EstimatedTimeBase, TimeBaseError> {
    let mut recorder = Recorder::new(vec![Channel::GyroX], GyroRange::Dps300);
    for (at, time) in times.into_iter().enumerate() {
        let mut counts = [(at % 100) as i16; 12];
        counts[Channel::Supply as usize] = 2068;
        recorder.push(TimeStamp::from_time(time), &Burst::from_counts(&Counts::new(counts)));
    }
    time_base(&recorder.finish(), None)
}

/// Rate, samples that are missing, and those of them that are uncertain.
fn found(times: impl IntoIterator<Item = f64>) -> (f64, u64, u64) {
    let EstimatedTimeBase { measurement, stamps } = base(times).expect("a time base");
    (measurement.sample_rate_hz, measurement.dropped["gap"], stamps.expect("stamps").uncertain)
}

/// `index` at 100 Hz, written with two decimals.
fn at(index: u64) -> f64 {
    format!("{:.2}", index as f64 / 100.0).parse().expect("a number")
}

#[test]
fn a_clock_that_was_set_far_ahead_is_no_lower_rate() {
    const YEAR_S: f64 = 31_536_000.0;
    for (name, rows, first, jump_s) in [
        ("a year after the first row", 3000, 1, YEAR_S),
        ("a day", 3000, 1500, 86_400.0),
        ("ten days", 20_000, 10_000, 864_000.0),
    ] {
        let times = (0..rows).map(|row| at(row) + if row >= first { jump_s } else { 0.0 });
        let error = base(times).expect_err(name);
        assert!(matches!(error, TimeBaseError::TooSparse { .. }), "{name}: {error}");
    }
    // Ten minutes are an outage.
    let (rate_hz, missing, _) = found((0..60_000).map(|row| at(row) + if row >= 30_000 { 600.0 } else { 0.0 }));
    assert_eq!(missing, 60_000);
    assert!((rate_hz / 100.0 - 1.0).abs() < 1e-9, "{rate_hz}");
}

#[test]
fn stamps_of_whole_periods_show_every_random_loss() {
    for loss in [0.03, 0.1, 0.15, 0.22, 0.25, 0.4, 0.5, 0.7, 0.9] {
        for seed in 0..3 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let rows: Vec<u64> = (0..30_000).filter(|_| rng.random::<f64>() >= loss).collect();
            let lost = rows[rows.len() - 1] - rows[0] + 1 - rows.len() as u64;
            let (rate_hz, missing, _) = found(rows.iter().map(|&row| at(row)));
            assert!((rate_hz / 100.0 - 1.0).abs() < 1e-6, "{loss}, seed {seed}: {rate_hz} Hz");
            assert_eq!(missing, lost, "{loss}, seed {seed}");
        }
    }
}

#[test]
fn a_clock_that_wanders_loses_nothing() {
    for part in [0.003, 0.01, 0.03, 0.05] {
        for period_s in [20.0, 60.0, 200.0] {
            let mut time = 0.0f64;
            let times: Vec<f64> = (0..40_000)
                .map(|row| {
                    let now = (time * 1e6).round() / 1e6;
                    time += 0.01 * (1.0 + part * (std::f64::consts::TAU * f64::from(row) / 100.0 / period_s).sin());
                    now
                })
                .collect();
            let span = times[times.len() - 1];
            let EstimatedTimeBase { measurement, stamps } = base(times).expect("a time base");
            let stamps = stamps.expect("stamps");
            let name = format!("{part} in {period_s} s");
            assert_eq!((measurement.dropped["gap"], stamps.late), (0, 0), "{name}");
            assert_eq!(stamps.tick_s, None, "{name}");
            assert!((measurement.sample_rate_hz * span / 39_999.0 - 1.0).abs() < 1e-5, "{name}");
            if part > 0.02 {
                assert!(
                    stamps.notes().iter().any(|note| note.contains("changes from")),
                    "{name}: {:?}",
                    stamps.notes()
                );
            }
        }
    }
}

#[test]
fn a_rate_that_changes_is_no_loss() {
    for part in [0.02, 0.05, 0.1, -0.05, -0.1] {
        let mut time = 0.0f64;
        let times: Vec<f64> = (0..72_720)
            .map(|row| {
                let now = (time * 1e6).round() / 1e6;
                time += 0.01 * if row < 36_360 { 1.0 } else { 1.0 + part };
                now
            })
            .collect();
        let EstimatedTimeBase { measurement, stamps } = base(times).expect("a time base");
        assert_eq!(measurement.dropped["gap"], 0, "{part}");
        let stamps = stamps.expect("stamps");
        let rate = stamps.rate.expect("a rate");
        let mut ends = [100.0, 100.0 / (1.0 + part)];
        ends.sort_by(f64::total_cmp);
        assert!((rate.low_hz / ends[0] - 1.0).abs() < 1e-3 && (rate.high_hz / ends[1] - 1.0).abs() < 1e-3, "{rate:?}");
        assert!(stamps.notes().iter().any(|note| note.contains("changes from")), "{part}: {:?}", stamps.notes());
    }
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let kept: Vec<u32> = (0..60_000).filter(|row| row % 59_999 == 0 || rng.random_range(0..1000) > 0).collect();
    let time = |&row: &u32| {
        let row = f64::from(row);
        if row < 30_000.0 { row / 100.0 } else { 300.0 + (row - 30_000.0) / 95.0 }
    };
    assert_eq!(found(kept.iter().map(time)).1, 60_000 - kept.len() as u64);
}

fn streamed(times: &[f64]) -> (f64, u64, Vec<String>) {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("counts.csv");
    let rows = times.iter().enumerate().map(|(at, time)| format!("{time:.6},{}\n", at % 100));
    std::fs::write(&file, format!("time_s,gyro_x_counts\n{}", rows.collect::<String>())).expect("a table");
    let kept = KeptInMemory { rows: 1 << 14, rows_with_losses: 1 << 14, most_lost: 1.0 };
    let input = RecordedInput::open(&file).expect("a table");
    let reading = Reading::new(None, kept);
    let stream = SampleStream::counts(input, GyroRange::Dps300, reading).expect("a time base");
    assert!(!stream.is_in_memory(), "{:?}", stream.notes());
    let description = stream.description();
    (description.sample_rate_hz, description.dropped["gap"], stream.notes().iter().map(ToString::to_string).collect())
}

/// Stamps in whole µs of samples that are read up to 0.2 ms late; `period_s` says how long after each row the next one is taken.
fn late_stamps(rows: u32, period_s: impl Fn(u32) -> f64) -> Vec<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut time = 0.0f64;
    let mut stamp = |row| {
        let now = ((time + rng.random_range(0.0..2e-4)) * 1e6).round() / 1e6;
        time += period_s(row);
        now
    };
    (0..rows).map(&mut stamp).collect()
}

#[test]
fn a_rate_that_changes_is_followed_in_blocks() {
    for (first, part) in [(36_360, 0.05), (36_360, -0.1), (50_001, 0.1), (8_000, 0.05)] {
        let times = late_stamps(72_720, |row| 0.01 * if row < first { 1.0 } else { 1.0 + part });
        let (rate_hz, missing, notes) = streamed(&times);
        assert_eq!(missing, 0, "{part} from row {first}");
        assert!((rate_hz * times[72_719] / 72_719.0 - 1.0).abs() < 1e-5, "{part} from row {first}: {rate_hz} Hz");
        assert!(notes.iter().any(|note| note.contains("changes from")), "{part} from row {first}: {notes:?}");
        let kept: Vec<f64> = times.iter().enumerate().filter(|(row, _)| row % 1000 != 500).map(|(_, t)| *t).collect();
        assert_eq!(streamed(&kept).1, 73, "{part} from row {first}");
    }
    let wandering = |row| 0.01 * (1.0 + 0.05 * (std::f64::consts::TAU * f64::from(row) / 6000.0).sin());
    assert_eq!(streamed(&late_stamps(60_000, wandering)).1, 0);
    let (rate_hz, missing, notes) = streamed(&late_stamps(60_000, |_| 0.01));
    assert_eq!((missing, notes.len()), (0, 0), "{notes:?}");
    // The slope of 60,000 stamps with a standard deviation of 0.2 ms/sqrt(12): 3.5e-10 of the period.
    assert!((rate_hz / 100.0 - 1.0).abs() < 3e-9, "{rate_hz}");
}

/// A host that empties a queue at irregular times, now and then late by tenths of a second: the stamps are those of the reading.
fn bursts(seed: u64, lost: impl Fn(u32) -> bool) -> Vec<f64> {
    const RATE_HZ: f64 = 99.3;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (mut poll, mut now) = (0.0f64, 0.0f64);
    let mut times = Vec::new();
    let mut lag = 0.0f64;
    for sample in 0..65_000 {
        let taken = f64::from(sample) / RATE_HZ;
        while poll < taken {
            poll += match rng.random_range(0..20) {
                0..12 => rng.random_range(0.035..0.05),
                12..19 => rng.random_range(0.07..0.085),
                _ => rng.random_range(0.1..0.3),
            };
            lag = (lag * 0.995 + rng.random_range(-0.012..0.012)).clamp(-0.08, 0.08);
        }
        now = (now + rng.random_range(0.0012..0.0024)).max(poll + 0.08 + lag);
        if !lost(sample) {
            times.push(now);
        }
    }
    times
}

#[test]
fn samples_in_bursts_are_late_and_not_lost() {
    for seed in 0..4 {
        let (rate_hz, missing, _) = found(bursts(seed, |_| false));
        assert!((rate_hz / 99.3 - 1.0).abs() < 1e-3, "seed {seed}: {rate_hz} Hz");
        assert_eq!(missing, 0, "seed {seed}, {rate_hz}");
        let (rate_hz, missing, _) = found(bursts(seed, |sample| (30_000..30_300).contains(&sample)));
        assert!((rate_hz / 99.3 - 1.0).abs() < 1e-3, "seed {seed}: {rate_hz} Hz");
        assert!(missing.abs_diff(300) <= 8, "seed {seed}: {missing}");
    }
}

/// 400 Hz by its source, stamped in whole ms, with 45 % of the stamps equal to the one before: 11,999 periods in 30.004 s are 399.91 Hz.
#[test]
fn measured_bursts_show_the_rate() {
    let test = "measured_bursts_show_the_rate";
    let Some(file) = system_tests::recording(test, "others/stampfly_fft_20260114T115628.csv") else { return };
    let selection = ColumnSelection::parse(&[], &["rad/s", "m/s^2"].map(str::to_owned)).expect("units");
    let options = ReadOptions { sensor: SensorProfile::generic(), selection, topic: None };
    let input = RecordedInput::open(&file).expect("a table");
    let reading = Reading::new(None, KeptInMemory::ALL);
    let samples = SampleStream::any_sensor(input, options, reading).expect("a time base").into_beginning();
    let rate_hz = samples.sample_rate_hz;
    assert!((rate_hz / 399.91 - 1.0).abs() < 1e-3, "{rate_hz} Hz");
    assert_eq!(samples.dropped["gap"], 0);
}

/// Rows at 100 Hz whose stamps `change` makes wrong, in the unit of the column: samples, rate, missing samples, and notes.
fn read_stamps(heading: &str, stamps: &[String]) -> (usize, f64, u64, Vec<String>) {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("stamps.csv");
    let row = |(at, stamp): (usize, &String)| format!("{stamp},{}\n", at * 7919 % 101);
    let rows: String = stamps.iter().enumerate().map(row).collect();
    std::fs::write(&file, format!("{heading},gx [deg/s]\n{rows}")).expect("room");
    let selection = ColumnSelection::parse(&[], &[]).expect("nothing");
    let options = ReadOptions { sensor: SensorProfile::generic(), selection, topic: None };
    let reading = Reading::new(None, KeptInMemory::ALL);
    let stream = SampleStream::any_sensor(RecordedInput::open(&file).expect("a table"), options, reading);
    let stream = stream.unwrap_or_else(|error| panic!("{heading}: {error}"));
    let notes = stream.notes().iter().map(ToString::to_string).collect();
    let samples = stream.into_beginning();
    (samples.len(), samples.sample_rate_hz, samples.dropped["gap"], notes)
}

#[test]
fn counters_that_begin_anew_go_on() {
    const ROWS: u64 = 30_000;
    for (heading, modulus, step) in [
        ("t_us", 1u64 << 32, 10_000u64),
        ("t_ms", 1 << 16, 10),
        ("t_ms", 1 << 15, 10),
        ("t_ms", 604_800_000, 10),
        ("t_us", 86_400_000_000, 10_000),
    ] {
        let stamps: Vec<String> =
            (0..ROWS).map(|row| ((modulus - step * ROWS / 3 % modulus + row * step) % modulus).to_string()).collect();
        let (samples, rate_hz, missing, notes) = read_stamps(heading, &stamps);
        assert_eq!((samples as u64, missing), (ROWS, 0), "{heading} of {modulus}: {notes:?}");
        assert!((rate_hz / 100.0 - 1.0).abs() < 1e-6, "{heading} of {modulus}: {rate_hz}");
        assert!(notes.iter().any(|note| note.contains(&format!("begin anew at {modulus}"))), "{notes:?}");
    }
}

#[test]
fn one_wrong_stamp_costs_one_row() {
    const ROWS: usize = 20_000;
    for (name, at, wrong) in [
        ("forward", 10_000, 93_877.3),
        ("the first in the future", 0, 93_877.3),
        ("the first is zero", 0, 0.0),
        ("backward", 10_000, 13.0),
        ("the last in the future", ROWS - 2, 93_877.3),
    ] {
        let time = |row: usize| if row == at { wrong } else { 1000.0 + row as f64 / 100.0 };
        let stamps: Vec<String> = (0..ROWS).map(|row| format!("{:.3}", time(row))).collect();
        let (samples, rate_hz, missing, notes) = read_stamps("t_s", &stamps);
        assert_eq!(samples, ROWS - 1, "{name}: {notes:?}");
        assert!(missing <= 1 && !notes.is_empty(), "{name}: {missing} missing, {notes:?}");
        assert!((rate_hz / 100.0 - 1.0).abs() < 1e-6, "{name}: {rate_hz}");
    }
}

#[test]
fn a_clock_that_was_set_back_goes_on() {
    const ROWS: usize = 12_000;
    for (name, time) in [
        (
            "a second",
            (|row: usize| 1000.0 + row as f64 / 100.0 - if row >= 6000 { 1.0 } else { 0.0 }) as fn(usize) -> f64,
        ),
        ("half a minute", |row| 1000.0 + row as f64 / 100.0 - if row >= 6000 { 30.0 } else { 0.0 }),
        ("to the start", |row| (row % 4000) as f64 / 100.0),
    ] {
        let stamps: Vec<String> = (0..ROWS).map(|row| format!("{:.3}", time(row))).collect();
        let (samples, rate_hz, missing, notes) = read_stamps("t_s", &stamps);
        assert_eq!((samples, missing), (ROWS, 0), "{name}: {notes:?}");
        assert!((rate_hz / 100.0 - 1.0).abs() < 1e-6, "{name}: {rate_hz}");
        assert!(notes.iter().any(|note| note.contains("the clock was set back")), "{name}: {notes:?}");
    }
}
