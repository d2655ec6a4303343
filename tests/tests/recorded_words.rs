//! Decoding of output words and bursts recorded from real ADIS16405s at rest (psas/stm32, `adis16405_log.txt-example`;
//! psas/Launch-10).

use std::fs::File;
use std::io::{BufRead, BufReader};

use adis16405_driver::{Burst, BurstValidator, Channel, Faults, GyroRange, OutputWord};
use flate2::read::GzDecoder;
use system_tests::recording;

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

#[test]
fn recorded_words_are_those_of_a_sensor_at_rest() {
    let test = "recorded_words_are_those_of_a_sensor_at_rest";
    let Some(path) = recording(test, "adis16405-words/stm32.csv") else { return };
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
        // A noise density of 0.05 deg/s/sqrt(Hz) up to 409.6 Hz, through two averages of four (sum of squared weights
        // 44/256), is 0.42 deg/s. Of the rows 1.7 % may deviate by more than 1 deg/s, and none by more than five times
        // 0.42.
        let outliers = rates.iter().filter(|rate| (*rate - median).abs() >= 1.0).count();
        assert!(outliers * 1000 <= rates.len() * 17, "{:?}: {outliers} rows deviate from {median}", COLUMNS[gyro]);
        let farthest = (median - rates[0]).max(rates[rates.len() - 1] - median);
        assert!(farthest < 2.1, "{:?} deviates by {farthest} deg/s from {median}", COLUMNS[gyro]);
    }
}

/// The recorded counts are encoded into words by plain arithmetic, from which the driver must decode the same counts.
#[test]
fn recorded_bursts_are_decoded_and_their_repetitions_are_usable() {
    let test = "recorded_bursts_are_decoded_and_their_repetitions_are_usable";
    let Some(path) = recording(test, "adis16405-burst/launch10.csv.gz") else { return };
    let mut lines = BufReader::new(GzDecoder::new(File::open(path).unwrap())).lines().map(Result::unwrap);
    assert!(lines.next().unwrap().starts_with("time_s,supply_counts,gyro_x_counts,"));

    let mut validator = BurstValidator::default();
    let mut previous = Burst::default();
    let (mut bursts, mut other_words) = (0, 0);
    for line in lines {
        let counts: Vec<i32> = line.split(',').skip(1).map(|field| field.parse().unwrap()).collect();
        assert_eq!(counts.len(), 12);
        let mut bytes = vec![0xA5, 0x5A];
        for (index, count) in counts.iter().enumerate() {
            // Supply, temperature and auxiliary input have 12 bits, the others 14; bit 15 is new data.
            let modulus = if matches!(index, 0 | 10 | 11) { 1 << 12 } else { 1 << 14 };
            bytes.extend(((count.rem_euclid(modulus) | 0x8000) as u16).to_be_bytes());
        }
        let burst = Burst::from_bytes(&bytes.try_into().unwrap());
        assert!(burst.counts().as_array().iter().map(|count| i32::from(*count)).eq(counts));

        let validity = validator.validate(&burst);
        assert!(
            validity.is_usable() && (validity.faults - Faults::REPEATED).is_empty(),
            "{line}: {:?}",
            validity.faults
        );
        if validity.faults.contains(Faults::REPEATED) {
            other_words += u32::from(burst != previous);
        }
        previous = burst;
        bursts += 1;
    }
    // 37 of the 45 repetitions of the inertial words differ in other words, so they are new samples that are equal by
    // chance.
    assert_eq!((bursts, validator.counters().get(Faults::REPEATED), other_words), (49_425, 45, 37));
}
