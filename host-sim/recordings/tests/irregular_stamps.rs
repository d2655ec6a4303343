//! The rate and the losses of stamps that no steady clock with a fine tick writes. The truth is known: the generator takes the samples.

use adis16405_driver::{Burst, Channel, Counts, GyroRange};
use measurement::Measurement;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use recordings::recording::{Recorder, Recording, TimeStamp};
use recordings::time_base::{EstimatedTimeBase, time_base};

fn recording(times: &[f64], seed: u64) -> Recording {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut recorder = Recorder::new(Channel::ALL.to_vec(), GyroRange::Dps300);
    for time in times {
        let mut counts: [i16; 12] = std::array::from_fn(|_| random.random_range(-4000..4000));
        counts[Channel::Supply as usize] = 2068;
        counts[Channel::AuxAdc as usize] = 0;
        recorder.push(TimeStamp::from_time(*time), &Burst::from_counts(&Counts::new(counts)));
    }
    recorder.finish()
}

fn examine(times: &[f64], seed: u64) -> (Measurement, EstimatedTimeBase) {
    let base = time_base(&recording(times, seed), None).unwrap_or_else(|error| panic!("{seed}: {error}"));
    (base.measurement.clone(), base)
}

fn lost(measured: &Measurement) -> u64 {
    measured.dropped.get("gap").copied().unwrap_or(0)
}

#[test]
fn a_loop_loses_what_its_long_intervals_hold_and_no_more() {
    for seed in 0..16 {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let period = [0.1, 0.02, 0.01][seed as usize % 3];
        let (enters, leaves) = (random.random_range(0.002..0.02), random.random_range(0.01..0.1));
        let slower = random.random_range(0.02..0.12) * period;
        let tick = period / [10.0, 1000.0][seed as usize % 2];
        let outages = [0_u64, 3][usize::from(seed >= 8)];
        let (mut time, mut is_slow, mut times, mut truth) = (1459.0, false, Vec::new(), 0);
        for row in 0..20_000_u64 {
            is_slow = if is_slow { !random.random_bool(leaves) } else { random.random_bool(enters) };
            time += period + if is_slow { slower } else { 0.0 } - 0.003 * period * random.random::<f64>().ln();
            if outages > 0 && row % 5000 == 2500 {
                let missing = random.random_range(5..40_u64);
                time += missing as f64 * period;
                truth += missing;
            }
            times.push((time / tick).floor() * tick);
        }
        let (measured, base) = examine(&times, seed);
        let found = lost(&measured);
        // The loop itself does not know how many samples of a long outage it would have taken.
        assert!(found.abs_diff(truth) <= truth / 8, "{seed}: {found} of {truth} lost");
        let span = times[times.len() - 1] - times[0];
        let hz = (times.len() as u64 - 1 + truth) as f64 / span;
        assert!((measured.sample_rate_hz / hz - 1.0).abs() < 5e-3, "{seed}: {} Hz, true {hz}", measured.sample_rate_hz);
        assert!(outages > 0 || (measured.sample_rate_hz / hz - 1.0).abs() < 1e-6, "{seed}: {:?}", base.stamps);
    }
}

#[test]
fn stamps_in_few_digits_lose_nothing_when_their_tick_grows() {
    let digits =
        |digits: i32| move |time: f64| -> f64 { format!("{time:.*e}", digits as usize - 1).parse().expect("a number") };
    for (name, hz, seconds, round) in [
        ("5 digits", 90.4, 180.0, Box::new(digits(5)) as Box<dyn Fn(f64) -> f64>),
        ("5 digits", 100.0, 250.0, Box::new(digits(5))),
        ("5 digits", 204.8, 150.0, Box::new(digits(5))),
        ("6 digits", 90.4, 1300.0, Box::new(digits(6))),
        ("6 digits", 819.2, 130.0, Box::new(digits(6))),
        ("4 digits", 23.7, 180.0, Box::new(digits(4))),
        ("single precision", 200.0, 300.0, Box::new(|time: f64| f64::from((time + 40_000.0) as f32))),
        ("single precision", 819.2, 200.0, Box::new(|time: f64| f64::from((time + 32_700.0) as f32))),
    ] {
        let times: Vec<f64> = (0..(seconds * hz) as u32).map(|row| round(f64::from(row) / hz)).collect();
        let (measured, base) = examine(&times, 1);
        assert_eq!(lost(&measured), 0, "{name} at {hz}: {:?}", base.stamps);
        assert!((measured.sample_rate_hz / hz - 1.0).abs() < 1e-4, "{name} at {hz}: {}", measured.sample_rate_hz);
        assert!(!base.stamps.expect("stamps").is_rate_changing, "{name} at {hz}");
    }
}

#[test]
fn ticks_of_many_samples_show_the_rate_and_what_is_missing_from_one() {
    for seed in 0..12 {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let tick = [1.0, 30.0, 128.0, 7.0][seed as usize % 4];
        let hz = random.random_range(60.0..120.0_f64);
        let phase = random.random_range(0.0..tick);
        let samples = (hz * tick * random.random_range(8.0..14.0)) as u64;
        let hole = if seed < 6 { 0..0 } else { samples / 2..samples / 2 + 10 + (hz * tick / 20.0) as u64 };
        let kept = (0..samples).filter(|sample| !hole.contains(sample));
        let times: Vec<f64> = kept.map(|sample| ((sample as f64 / hz + phase) / tick).floor() * tick).collect();
        let (measured, base) = examine(&times, seed);
        let (found, truth) = (lost(&measured), hole.end - hole.start);
        assert!((measured.sample_rate_hz / hz - 1.0).abs() < 2e-3, "{seed}: {} Hz, true {hz}", measured.sample_rate_hz);
        assert!(found.abs_diff(truth) <= 6, "{seed}: {found} of {truth} lost: {:?}", base.stamps);
    }
}
