//! Planted gaps, late deliveries and re-reads are found, each for what it is.

mod common;

use adis16405_driver::{Burst, Channel, Counts, Faults, GyroRange};
use recordings::csv;
use recordings::recording::{Clock, Recorder, Recording};
use recordings::timeline::{Step, Timeline, TimelineError};

const PERIOD: f64 = 0.01;

/// A sample at each clock; all samples differ unless `counts` says otherwise.
fn recording(clocks: &[Clock], counts: impl Fn(usize) -> i16) -> Recording {
    let mut recorder = Recorder::new(Channel::ALL.to_vec(), GyroRange::Dps300);
    for (at, clock) in clocks.iter().enumerate() {
        let mut values = [counts(at); 12];
        values[Channel::Supply as usize] = 2068;
        values[Channel::AuxAdc as usize] = 0;
        recorder.push(*clock, &Burst::from_counts(&Counts::new(values)));
    }
    recorder.finish()
}

fn timed(times: &[f64]) -> Recording {
    recording(&times.iter().map(|t| Clock::at(*t)).collect::<Vec<_>>(), |at| (at % 1000) as i16)
}

/// Times of samples taken in the given periods.
fn at_periods(periods: &[u32]) -> Vec<f64> {
    periods.iter().map(|p| f64::from(*p) * PERIOD).collect()
}

fn gaps(timeline: &Timeline) -> Vec<(usize, u32)> {
    let mut before = 0;
    let mut gaps = Vec::new();
    for step in &timeline.steps {
        match step {
            Step::Sample(at) => before = *at,
            Step::Gap(missing) => gaps.push((before, *missing)),
        }
    }
    gaps
}

#[test]
fn a_regular_clock_gives_its_rate_and_no_gap() {
    let timeline = Timeline::of(&timed(&at_periods(&(0..1000).collect::<Vec<_>>())), None).expect("a timeline");
    // Times of 10 s in f64 are good to 2e-15 s, the least-squares slope is better than 1e-12.
    assert!((timeline.sample_rate_hz - 100.0).abs() < 1e-9, "{}", timeline.sample_rate_hz);
    assert_eq!(timeline.steps, (0..1000).map(Step::Sample).collect::<Vec<_>>());
    assert_eq!(timeline.dropped, [("gap", 0)].into());
}

#[test]
fn missing_samples_are_gaps() {
    let mut periods: Vec<u32> = (0..1000).collect();
    periods.drain(700..715);
    periods.remove(300);
    let timeline = Timeline::of(&timed(&at_periods(&periods)), None).expect("a timeline");
    assert_eq!(gaps(&timeline), [(299, 1), (698, 15)]);
    assert_eq!(timeline.dropped, [("gap", 16)].into());
    assert!((timeline.sample_rate_hz - 100.0).abs() < 1e-9, "{}", timeline.sample_rate_hz);
}

#[test]
fn a_flush_after_a_stall_is_no_gap() {
    let mut times = at_periods(&(0..1000).collect::<Vec<_>>());
    // The samples of periods 500 to 503 wait for the host until period 503.3; that of 504 is on time.
    for (queued, time) in times[500..504].iter_mut().enumerate() {
        *time = (503.3 + 0.04 * queued as f64) * PERIOD;
    }
    let timeline = Timeline::of(&timed(&times), None).expect("a timeline");
    assert_eq!(gaps(&timeline), []);
    assert!((timeline.sample_rate_hz - 100.0).abs() < 0.01, "{}", timeline.sample_rate_hz);
}

#[test]
fn what_a_flush_does_not_make_up_for_is_a_gap() {
    let mut times = at_periods(&(0..1000).collect::<Vec<_>>());
    for (queued, time) in times[500..504].iter_mut().enumerate() {
        *time = (503.3 + 0.04 * queued as f64) * PERIOD;
    }
    times.drain(501..503);
    let timeline = Timeline::of(&timed(&times), None).expect("a timeline");
    assert_eq!(gaps(&timeline), [(499, 2)]);
    assert_eq!(timeline.dropped["gap"], 2);
}

#[test]
fn jitter_under_half_a_period_is_no_gap() {
    // Late by up to 0.45 periods, without a pattern (the middle bits of a multiplication).
    let jitter = |i: u32| f64::from(i.wrapping_mul(2_654_435_761) >> 16 & 0xFF) / 255.0;
    let times: Vec<f64> = (0..1000).map(|i| (f64::from(i) + 0.45 * jitter(i)) * PERIOD).collect();
    let timeline = Timeline::of(&timed(&times), None).expect("a timeline");
    assert_eq!(gaps(&timeline), []);
}

#[test]
fn a_given_rate_tells_coarse_time_stamps_from_losses() {
    // 819.2 samples per second, read by a host whose clock ticks once a millisecond: intervals of 1 and 2 ms.
    let times: Vec<f64> = (0..5000).map(|i| (f64::from(i) / 819.2 * 1000.0).floor() / 1000.0).collect();
    let timeline = Timeline::of(&timed(&times), Some(819.2)).expect("a timeline");
    // Behind the last samples there is nothing to tell late from lost.
    assert!(gaps(&timeline).iter().all(|(after, _)| *after > 5000 - 64), "{:?}", gaps(&timeline));
}

#[test]
fn absurd_times_do_not_panic() {
    for times in [
        [0.0, 1e-300, 2e-300, 3e-300, 1e300, 1e300],
        [-1e308, -1e308, 0.0, 1.0, 1e308, 1e308],
        [0.0, 5e-324, 1e-323, 1.5e-323, 2e-323, f64::MAX],
        [0.0, 0.0, 0.0, 1.0, 2.0, 3.0],
    ] {
        for rate in [None, Some(1e-300), Some(100.0), Some(1e300)] {
            if let Ok(timeline) = Timeline::of(&timed(&times), rate) {
                assert!(timeline.sample_rate_hz.is_finite() && timeline.sample_rate_hz > 0.0);
                assert_eq!(timeline.steps.iter().filter(|s| matches!(s, Step::Sample(_))).count(), 6);
            }
        }
    }
}

#[test]
fn an_equal_sample_in_a_period_of_its_own_is_chance() {
    let clocks: Vec<Clock> = at_periods(&(0..100).collect::<Vec<_>>()).into_iter().map(Clock::at).collect();
    let recording = recording(&clocks, |at| if at == 50 { 49 } else { at as i16 });
    assert_eq!(recording.samples[50].faults, Faults::REPEATED);
    let timeline = Timeline::of(&recording, None).expect("a timeline");
    assert_eq!(timeline.dropped, [("gap", 0)].into());
    assert_eq!(timeline.flagged, [("repeated", 1)].into());
    assert_eq!(gaps(&timeline), []);
}

#[test]
fn a_re_read_between_two_samples_takes_no_period() {
    let mut times = at_periods(&(0..100).collect::<Vec<_>>());
    times.insert(51, 50.4 * PERIOD);
    let clocks: Vec<Clock> = times.into_iter().map(Clock::at).collect();
    let recording = recording(&clocks, |at| if at > 50 { at as i16 - 1 } else { at as i16 });
    let timeline = Timeline::of(&recording, None).expect("a timeline");
    assert_eq!(timeline.dropped, [("gap", 0), ("repeated", 1)].into());
    assert_eq!(gaps(&timeline), []);
}

#[test]
fn without_a_clock_nothing_is_missing_and_equal_neighbours_are_chance() {
    let recording = recording(&[Clock::default(); 10], |_| 7);
    let timeline = Timeline::of(&recording, Some(100.0)).expect("a timeline");
    assert_eq!(timeline.steps, (0..10).map(Step::Sample).collect::<Vec<_>>());
    assert_eq!(timeline.dropped, [("gap", 0)].into());
    assert_eq!(timeline.sample_rate_hz, 100.0);
    assert_eq!(Timeline::of(&recording, None), Err(TimelineError::NoRate));
}

#[test]
fn an_index_shows_gaps_and_needs_a_rate() {
    let clocks = [3, 4, 5, 9, 10].map(|i| Clock { index: Some(i), time_s: None });
    let recording = recording(&clocks, |at| at as i16);
    let timeline = Timeline::of(&recording, Some(100.0)).expect("a timeline");
    assert_eq!(gaps(&timeline), [(2, 3)]);
    assert_eq!(timeline.dropped["gap"], 3);
    assert_eq!(Timeline::of(&recording, None), Err(TimelineError::NoRate));
}

#[test]
fn a_given_rate_overrides_the_measured_one() {
    let timeline = Timeline::of(&timed(&at_periods(&(0..100).collect::<Vec<_>>())), Some(99.0)).expect("a timeline");
    assert_eq!(timeline.sample_rate_hz, 99.0);
    assert_eq!(timeline.dropped["gap"], 0);
}

#[test]
fn dead_bursts_are_dropped_by_cause_and_warnings_are_used() {
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
            5 => bytes[4] &= 0x7F,
            _ => {}
        }
        recorder.push(Clock::at(f64::from(at) * PERIOD), &Burst::from_bytes(&bytes));
    }
    let timeline = Timeline::of(&recorder.finish(), None).expect("a timeline");
    assert_eq!(timeline.dropped, [("gap", 0), ("no_new_data", 1), ("stuck_high", 1), ("stuck_low", 1)].into());
    assert_eq!(timeline.flagged, [("error_alarm", 1)].into());
    assert_eq!(gaps(&timeline), [(2, 3)]);
}

#[test]
fn the_real_burst_recording() {
    let name = "adis16405-burst/launch10.csv.gz";
    let Some(file) = common::recording("the_real_burst_recording", name) else {
        return;
    };
    let recording = csv::read(&file, GyroRange::Dps300).expect("a recording");
    assert_eq!(recording.samples.len(), 49_425);
    assert_eq!(recording.channels, Channel::ALL);
    let timeline = Timeline::of(&recording, None).expect("a timeline");
    // Counted outside this code: 45 rows whose six inertial counts equal those of the row above, each a period apart
    // (the equality rates of the single channels foretell about as many coincidences); one interval of 16
    // periods without a flush. The other long intervals (3 to 7 periods) are each followed by a flush of as many rows.
    assert_eq!(timeline.dropped, [("gap", 15)].into());
    assert_eq!(timeline.flagged["repeated"], 45);
    // 49,425 rows and 15 lost samples in the time between the first and the last row; the ends jitter by under 1 ms.
    let seconds = recording.samples.last().and_then(|s| s.clock.time_s).expect("a time");
    let rate = (49_424.0 + 15.0) / seconds;
    assert!((timeline.sample_rate_hz / rate - 1.0).abs() < 1e-3 / seconds * 2.0, "{} {rate}", timeline.sample_rate_hz);
}

#[test]
fn the_real_long_recording() {
    let Some(file) = common::recording("the_real_long_recording", "adis16405-static/run1.csv.gz") else {
        return;
    };
    let recording = csv::read(&file, GyroRange::Dps300).expect("a recording");
    assert_eq!(recording.samples.len(), 1_000_000);
    assert_eq!(recording.channels, Channel::INERTIAL);
    let timeline = Timeline::of(&recording, Some(100.0)).expect("a timeline");
    assert_eq!(timeline.dropped, [("gap", 0)].into());
    assert_eq!(timeline.steps.len(), 1_000_000);
}
