//! Missing samples, late deliveries and samples that were read twice are told apart.

use adis16405_driver::{Burst, Channel, Counts, Faults, GyroRange};
use measurement::Measurement;
use recordings::count_table;
use recordings::recording::{Recorder, Recording, TimeStamp};
use recordings::time_base::{TimeBaseError, measurement};

const PERIOD: f64 = 0.01;

/// A sample at each time stamp; the sample at position `i` has the count `counts(i)` in every channel but supply and ADC.
fn recording(time_stamps: &[TimeStamp], counts: impl Fn(usize) -> i16) -> Recording {
    let mut recorder = Recorder::new(Channel::ALL.to_vec(), GyroRange::Dps300);
    for (at, time_stamp) in time_stamps.iter().enumerate() {
        let mut values = [counts(at); 12];
        values[Channel::Supply as usize] = 2068;
        values[Channel::AuxAdc as usize] = 0;
        recorder.push(*time_stamp, &Burst::from_counts(&Counts::new(values)));
    }
    recorder.finish()
}

fn timed(times: &[f64]) -> Recording {
    recording(&times.iter().map(|t| TimeStamp::from_time(*t)).collect::<Vec<_>>(), |at| (at % 1000) as i16)
}

/// Times of samples taken in the given periods.
fn at_periods(periods: &[u32]) -> Vec<f64> {
    periods.iter().map(|p| f64::from(*p) * PERIOD).collect()
}

/// For each gap the position of the sample before it, and how many periods are missing.
fn gaps(measured: &Measurement) -> Vec<(usize, u32)> {
    let missing = (1..measured.len()).map(|at| (at - 1, measured.missing_before(at)));
    missing.filter(|(_, missing)| *missing > 0).collect()
}

/// The counts of gyro X, which tell which samples are used.
fn gyro_x(measured: &Measurement) -> &[i32] {
    &measured.channels.iter().find(|channel| channel.profile.name == "gyro_x").expect("gyro X").counts
}

#[test]
fn regular_time_stamps_give_their_rate_and_no_gap() {
    let measured = measurement(&timed(&at_periods(&(0..1000).collect::<Vec<_>>())), None).expect("a time base");
    // Times of 10 s in f64 are good to 2e-15 s, the least-squares slope is better than 1e-12.
    assert!((measured.sample_rate_hz - 100.0).abs() < 1e-9, "{}", measured.sample_rate_hz);
    assert_eq!(measured.slots, (0..1000).collect::<Vec<_>>());
    assert_eq!(gyro_x(&measured), (0..1000).collect::<Vec<_>>());
    assert_eq!(measured.dropped, [("gap", 0)].into());
}

#[test]
fn missing_samples_are_gaps() {
    let mut periods: Vec<u32> = (0..1000).collect();
    periods.drain(700..715);
    periods.remove(300);
    let measured = measurement(&timed(&at_periods(&periods)), None).expect("a time base");
    assert_eq!(gaps(&measured), [(299, 1), (698, 15)]);
    assert_eq!(measured.dropped, [("gap", 16)].into());
    assert!((measured.sample_rate_hz - 100.0).abs() < 1e-9, "{}", measured.sample_rate_hz);
}

#[test]
fn samples_read_together_after_a_stall_are_no_gap() {
    let mut times = at_periods(&(0..1000).collect::<Vec<_>>());
    // The samples of periods 500 to 503 wait for the host until period 503.3; that of 504 is on time.
    for (queued, time) in times[500..504].iter_mut().enumerate() {
        *time = (503.3 + 0.04 * queued as f64) * PERIOD;
    }
    let measured = measurement(&timed(&times), None).expect("a time base");
    assert_eq!(gaps(&measured), []);
    assert!((measured.sample_rate_hz - 100.0).abs() < 0.01, "{}", measured.sample_rate_hz);
}

#[test]
fn a_loss_during_a_stall_is_a_gap() {
    let mut times = at_periods(&(0..1000).collect::<Vec<_>>());
    for (queued, time) in times[500..504].iter_mut().enumerate() {
        *time = (503.3 + 0.04 * queued as f64) * PERIOD;
    }
    times.drain(501..503);
    let measured = measurement(&timed(&times), None).expect("a time base");
    assert_eq!(gaps(&measured), [(499, 2)]);
    assert_eq!(measured.dropped["gap"], 2);
}

#[test]
fn jitter_under_half_a_period_is_no_gap() {
    // Late by up to 0.45 periods: bits 16 to 23 of a multiplicative hash.
    let jitter = |i: u32| f64::from(i.wrapping_mul(2_654_435_761) >> 16 & 0xFF) / 255.0;
    let times: Vec<f64> = (0..1000).map(|i| (f64::from(i) + 0.45 * jitter(i)) * PERIOD).collect();
    let measured = measurement(&timed(&times), None).expect("a time base");
    assert_eq!(gaps(&measured), []);
}

#[test]
fn coarse_time_stamps_are_no_losses_where_the_rate_is_given() {
    // 819.2 samples per second, read by a host whose clock ticks once a millisecond: intervals of 1 and 2 ms.
    let times: Vec<f64> = (0..5000).map(|i| (f64::from(i) / 819.2 * 1000.0).floor() / 1000.0).collect();
    let measured = measurement(&timed(&times), Some(819.2)).expect("a time base");
    // A late sample among the last 64 cannot be told from a loss.
    assert!(gaps(&measured).iter().all(|(after, _)| *after > 5000 - 64), "{:?}", gaps(&measured));
}

#[test]
fn extreme_times_do_not_panic() {
    for times in [
        [0.0, 1e-300, 2e-300, 3e-300, 1e300, 1e300],
        [-1e308, -1e308, 0.0, 1.0, 1e308, 1e308],
        [0.0, 5e-324, 1e-323, 1.5e-323, 2e-323, f64::MAX],
        [0.0, 0.0, 0.0, 1.0, 2.0, 3.0],
    ] {
        for rate in [None, Some(1e-300), Some(100.0), Some(1e300)] {
            if let Ok(measured) = measurement(&timed(&times), rate) {
                assert!(measured.sample_rate_hz.is_finite() && measured.sample_rate_hz > 0.0);
                assert_eq!(measured.len(), 6);
            }
        }
    }
}

#[test]
fn an_equal_sample_a_period_later_is_used_and_flagged() {
    let time_stamps: Vec<TimeStamp> =
        at_periods(&(0..100).collect::<Vec<_>>()).into_iter().map(TimeStamp::from_time).collect();
    let recording = recording(&time_stamps, |at| if at == 50 { 49 } else { at as i16 });
    assert_eq!(recording.samples[50].faults, Faults::REPEATED);
    let measured = measurement(&recording, None).expect("a time base");
    assert_eq!(measured.dropped, [("gap", 0)].into());
    assert_eq!(measured.flagged, [("repeated", 1)].into());
    assert_eq!(gaps(&measured), []);
}

#[test]
fn a_sample_read_twice_is_dropped_and_takes_no_period() {
    let mut times = at_periods(&(0..100).collect::<Vec<_>>());
    times.insert(51, 50.4 * PERIOD);
    let time_stamps: Vec<TimeStamp> = times.into_iter().map(TimeStamp::from_time).collect();
    let recording = recording(&time_stamps, |at| if at > 50 { at as i16 - 1 } else { at as i16 });
    let measured = measurement(&recording, None).expect("a time base");
    assert_eq!(measured.dropped, [("gap", 0), ("repeated", 1)].into());
    assert_eq!(gaps(&measured), []);
}

#[test]
fn without_time_stamps_nothing_is_missing_and_equal_samples_are_used() {
    let recording = recording(&[TimeStamp::default(); 10], |_| 7);
    let measured = measurement(&recording, Some(100.0)).expect("a time base");
    assert_eq!(measured.slots, (0..10).collect::<Vec<_>>());
    assert_eq!(measured.dropped, [("gap", 0)].into());
    assert_eq!(measured.sample_rate_hz, 100.0);
    assert_eq!(measurement(&recording, None), Err(TimeBaseError::NoRate));
}

#[test]
fn gaps_of_the_index_are_found_and_the_rate_must_be_given() {
    let time_stamps = [3, 4, 5, 9, 10].map(|i| TimeStamp { index: Some(i), time_s: None });
    let recording = recording(&time_stamps, |at| at as i16);
    let measured = measurement(&recording, Some(100.0)).expect("a time base");
    assert_eq!(gaps(&measured), [(2, 3)]);
    assert_eq!(measured.dropped["gap"], 3);
    assert_eq!(measurement(&recording, None), Err(TimeBaseError::NoRate));
}

#[test]
fn a_given_rate_overrides_the_measured_one() {
    let measured = measurement(&timed(&at_periods(&(0..100).collect::<Vec<_>>())), Some(99.0)).expect("a time base");
    assert_eq!(measured.sample_rate_hz, 99.0);
    assert_eq!(measured.dropped["gap"], 0);
}

#[test]
fn invalid_bursts_are_dropped_by_cause_and_those_with_warnings_are_used() {
    let mut recorder = Recorder::new(Channel::ALL.to_vec(), GyroRange::Dps300);
    for at in 0..10 {
        let mut bytes = [0u8; 26];
        for (word, pair) in bytes[2..].chunks_exact_mut(2).enumerate() {
            // New data; supply 2068 = 0x814, the others a running count; the error bit in sample 7.
            let value = if word == 0 { 0x814 } else { at } | 0x8000 | if at == 7 { 0x4000 } else { 0 };
            pair.copy_from_slice(&(value as u16).to_be_bytes());
        }
        match at {
            3 => bytes = [0; 26],
            4 => bytes = [0xFF; 26],
            5 => bytes[2..].iter_mut().step_by(2).for_each(|upper| *upper &= 0x7F),
            _ => {}
        }
        recorder.push(TimeStamp::from_time(f64::from(at) * PERIOD), &Burst::from_bytes(&bytes));
    }
    let measured = measurement(&recorder.finish(), None).expect("a time base");
    assert_eq!(measured.dropped, [("gap", 0), ("no_new_data", 1), ("stuck_high", 1), ("stuck_low", 1)].into());
    assert_eq!(measured.flagged, [("error_alarm", 1)].into());
    assert_eq!(gaps(&measured), [(2, 3)]);
}

/// As on the device: one old word refuses its channel, a burst of old words every channel.
#[test]
fn old_data_in_one_word_is_missing_in_that_channel_alone() {
    let mut recorder = Recorder::new(Channel::ALL.to_vec(), GyroRange::Dps300);
    for at in 0..100_i16 {
        let mut counts = [at; 12];
        counts[Channel::Supply as usize] = 2068;
        let mut burst = Burst::from_counts(&Counts::new(counts));
        match at {
            20 | 60 => burst.words[Channel::AcclZ as usize].0 &= 0x7FFF,
            40 => burst.words.iter_mut().for_each(|word| word.0 &= 0x7FFF),
            _ => {}
        }
        recorder.push(TimeStamp::from_time(f64::from(at) * PERIOD), &burst);
    }
    let measured = measurement(&recorder.finish(), None).expect("a time base");
    assert_eq!(measured.dropped, [("gap", 0), ("no_new_data", 1)].into());
    assert_eq!(gaps(&measured), [(39, 1)]);
    for channel in &measured.channels {
        // Position 59: the sample of row 40 is dropped.
        let expected = if channel.profile.name == "accl_z" { vec![20, 59] } else { Vec::new() };
        let refused = channel.refused.get("no_new_data").cloned().unwrap_or_default();
        assert_eq!(refused, expected, "{}", channel.profile.name);
    }
}

#[test]
fn the_measured_burst_recording_lost_15_samples_in_one_gap() {
    let test = "the_measured_burst_recording_lost_15_samples_in_one_gap";
    let Some(file) = system_tests::recording(test, "adis16405-burst/launch10.csv.gz") else { return };
    let recording = count_table::read(&file, GyroRange::Dps300).expect("a recording");
    assert_eq!(recording.samples.len(), 49_425);
    assert_eq!(recording.channels, Channel::ALL);
    let measured = measurement(&recording, None).expect("a time base");
    // Counted by another program: 45 equal rows a period apart, and one interval of 16 periods without faster rows.
    assert_eq!(measured.dropped, [("gap", 15)].into());
    assert_eq!(measured.flagged["repeated"], 45);
    // 49,425 rows and 15 lost samples in the time between the first and the last row; the ends jitter by under 1 ms.
    let seconds = recording.samples.last().and_then(|s| s.time_stamp.time_s).expect("a time");
    let rate = (49_424.0 + 15.0) / seconds;
    assert!((measured.sample_rate_hz / rate - 1.0).abs() < 1e-3 / seconds * 2.0, "{} {rate}", measured.sample_rate_hz);
}

#[test]
fn the_measured_long_recording_is_complete() {
    let test = "the_measured_long_recording_is_complete";
    let Some(file) = system_tests::recording(test, "adis16405-static/run1.csv.gz") else { return };
    let recording = count_table::read(&file, GyroRange::Dps300).expect("a recording");
    assert_eq!(recording.samples.len(), 1_000_000);
    assert_eq!(recording.channels, Channel::INERTIAL);
    let measured = measurement(&recording, Some(100.0)).expect("a time base");
    assert_eq!(measured.dropped, [("gap", 0)].into());
    assert_eq!(measured.len(), 1_000_000);
    assert_eq!(measured.gaps(), 0);
}

#[test]
fn many_refused_samples_hide_neither_the_rate_nor_the_losses() {
    let mut recorder = Recorder::new(Channel::ALL.to_vec(), GyroRange::Dps300);
    let taken = (0..3000_u32).filter(|at| *at != 1000);
    for at in taken {
        let mut bytes = [0xFF; 26];
        // Bits 16 to 17 of a multiplicative hash: three of four samples are stuck high.
        if at.wrapping_mul(2_654_435_761) >> 16 & 3 == 0 {
            for (word, pair) in bytes[2..].chunks_exact_mut(2).enumerate() {
                let value = if word == 0 { 0x814 } else { (at % 1000) as u16 };
                pair.copy_from_slice(&(value | 0x8000).to_be_bytes());
            }
        }
        recorder.push(TimeStamp::from_time(f64::from(at) * PERIOD), &Burst::from_bytes(&bytes));
    }
    let recording = recorder.finish();
    for stated in [None, Some(98.0)] {
        let base = recordings::time_base::time_base(&recording, stated).expect("a time base");
        let rate = base.stamps.and_then(|stamps| stamps.rate).expect("a rate").hz;
        assert!((rate - 100.0).abs() < 1e-6, "{stated:?}: {rate}");
        assert_eq!(base.measurement.dropped["gap"], 1);
        assert!((700..800).contains(&base.measurement.len()), "{}", base.measurement.len());
    }
}

#[test]
fn an_impossible_rate_is_missing_in_its_gyro_alone() {
    let mut recorder = Recorder::new(Channel::ALL.to_vec(), GyroRange::Dps300);
    for at in 0..1000_i16 {
        let mut values = [at % 50; 12];
        values[Channel::Supply as usize] = 2068;
        if at == 400 || at == 700 {
            values[Channel::GyroY as usize] = -7001;
        }
        recorder.push(TimeStamp::from_time(f64::from(at) * PERIOD), &Burst::from_counts(&Counts::new(values)));
    }
    let measured = measurement(&recorder.finish(), None).expect("a time base");
    assert_eq!((measured.len(), &measured.dropped), (1000, &[("gap", 0)].into()));
    assert!(measured.flagged.is_empty(), "{:?}", measured.flagged);
    for channel in &measured.channels {
        let expected = if channel.profile.name == "gyro_y" { vec![400, 700] } else { Vec::new() };
        assert_eq!(
            channel.refused.get("impossible_rate").cloned().unwrap_or_default(),
            expected,
            "{}",
            channel.profile.name
        );
    }
}
