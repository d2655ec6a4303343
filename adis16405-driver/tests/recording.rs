//! Output words of a real, still ADIS16405 (psas/stm32, `adis16405_log.txt-example`), decoded.

use std::io::Write;
use std::path::PathBuf;

use adis16405_driver::{Channel, GyroRange, OutputWord};

/// Columns of the recording after the time stamp.
const COLUMNS: [Channel; 9] = [
    Channel::AcclX,
    Channel::AcclY,
    Channel::AcclZ,
    Channel::GyroX,
    Channel::GyroY,
    Channel::GyroZ,
    Channel::MagnX,
    Channel::MagnY,
    Channel::MagnZ,
];

fn recording() -> PathBuf {
    let recordings = match std::env::var_os("ADIS_RECORDINGS") {
        Some(folder) => PathBuf::from(folder),
        None => PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared/data"),
    };
    recordings.join("adis16405-words/stm32.csv")
}

#[test]
fn recorded_words_are_those_of_a_still_sensor() {
    let path = recording();
    if !path.exists() {
        // Not by a macro, which the test harness would hide.
        let mut console = std::io::stderr();
        writeln!(console, "skipped recorded_words_are_those_of_a_still_sensor: {} is absent", path.display()).unwrap();
        return;
    }
    let text = std::fs::read_to_string(&path).unwrap();
    let mut lines = text.lines();
    assert_eq!(
        lines.next(),
        Some("timestamp_s,accl_x,accl_y,accl_z,gyro_x,gyro_y,gyro_z,magn_x,magn_y,magn_z,temp_degc_by_logger")
    );

    let mut values: Vec<[f64; 9]> = Vec::new();
    let mut negative = 0;
    for line in lines {
        let words: Vec<u16> = line.split(',').skip(1).take(9).map(|word| word.parse().unwrap()).collect();
        let mut row = [0.0; 9];
        for ((value, &word), channel) in row.iter_mut().zip(&words).zip(COLUMNS) {
            let counts = OutputWord(word).counts(channel);
            let expected = if word >= 8192 { i32::from(word) - 16384 } else { i32::from(word) };
            assert_eq!(i32::from(counts), expected);
            negative += usize::from(counts < 0);
            *value = f64::from(counts) * channel.lsb(GyroRange::Dps300);
        }
        values.push(row);
    }
    assert_eq!(values.len(), 3413);
    assert!(negative > 3413, "the recording holds many negative words, {negative} were seen");

    for row in &values {
        let force = row[..3].iter().map(|g| g * g).sum::<f64>().sqrt();
        assert!((force - 1.0).abs() < 0.03, "specific force {force} g");
    }
    for gyro in 3..6 {
        let mut rates: Vec<f64> = values.iter().map(|row| row[gyro]).collect();
        rates.sort_by(f64::total_cmp);
        let median = rates[rates.len() / 2];
        assert!(median.abs() < 3.0, "initial bias error is ±3 deg/s, {:?} shows {median}", COLUMNS[gyro]);
        // Noise density 0.05 deg/s/sqrt(Hz) up to 409.6 Hz, through two averages of four (sum of squared weights 44/256),
        // is 0.42 deg/s: 1.7 % of the rows may stray by more than 1 deg/s, none by more than five times 0.42.
        let strays = rates.iter().filter(|rate| (*rate - median).abs() >= 1.0).count();
        assert!(strays * 1000 <= rates.len() * 17, "{:?}: {strays} rows stray from {median}", COLUMNS[gyro]);
        let farthest = (median - rates[0]).max(rates[rates.len() - 1] - median);
        assert!(farthest < 2.1, "{:?} strays {farthest} deg/s from {median}", COLUMNS[gyro]);
    }
}
