//! Samples that are not counts: quantizer, phase data, time stamps, and what a coarse LSB costs.

use allan_core::{Cascade, PhaseCounts, Quantizer, SampleError, TimeStampError, TimeStamps, integer_count};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use statrs::distribution::{ContinuousCDF, Normal};

const DOCUMENTATION: &str = include_str!("../src/quantizer.rs");

/// Error of N in percent if white noise with a standard deviation of 1 around `mean` is rounded to multiples of `lsb`: that
/// of the standard deviation of the rounded values, which are independent.
fn error_percent(lsb: f64, mean: f64) -> f64 {
    let normal = Normal::new(mean, 1.0).unwrap();
    let (mut first, mut second) = (0.0, 0.0);
    for count in -200..=200 {
        let value = f64::from(count) * lsb;
        let probability = normal.cdf(value + lsb / 2.0) - normal.cdf(value - lsb / 2.0);
        first += probability * value;
        second += probability * value * value;
    }
    100.0 * ((second - first * first).sqrt() - 1.0)
}

#[test]
fn a_coarse_lsb_costs_what_the_table_of_the_quantizer_says() {
    for (lsb, name) in [(0.25, "σ/4"), (0.5, "σ/2"), (1.0, "σ"), (2.0, "2σ"), (3.0, "3σ"), (4.0, "4σ")] {
        let errors = [error_percent(lsb, 0.0), error_percent(lsb, lsb / 2.0)];
        let [at, between] = errors.map(|error| format!("{error:+.1} %").replace('-', "−"));
        let row = format!("/// | {name} | {at} | {between} |");
        assert!(DOCUMENTATION.contains(&row), "the table lacks: {row}");

        let mut random = ChaCha8Rng::seed_from_u64(7);
        for (mean, expected) in [(0.0, errors[0]), (lsb / 2.0, errors[1])] {
            let quantizer = Quantizer::new(0.0, lsb).unwrap();
            let mut cascade = Cascade::<12, 8>::new();
            for _ in 0..1 << 18 {
                let value: f64 = StandardNormal.sample(&mut random);
                cascade.push(quantizer.count(mean + value).unwrap());
            }
            let point = cascade.curve(1.0).scaled(lsb).points()[0];
            let measured = 100.0 * (point.avar.sqrt() - 1.0);
            // The relative standard deviation of the variance is √((κ + 2 + 1)/M) for the excess kurtosis κ of a sample, at
            // most 20 here (counts of −1, 0, 1 with probabilities of 2, 95, 2 %): 0.9 %. Half of it, times 4.
            let deviation = 100.0 / 2.0 * (23.0_f64 / f64::from(1 << 18)).sqrt();
            assert!((measured - expected).abs() < 4.0 * deviation, "LSB {name}: {measured} %, not {expected} %");
        }
    }
}

#[test]
fn a_value_has_the_nearest_count_or_an_error() {
    let quantizer = Quantizer::new(1.0, 0.25).unwrap();
    // (value − 1)/0.25, rounded to nearest, ties up.
    for (value, count) in [(1.0, 0), (1.25, 1), (1.124, 0), (1.125, 1), (0.875, 0), (0.874, -1), (-1.0, -8)] {
        assert_eq!(quantizer.count(value), Ok(count), "{value}");
        assert_eq!(quantizer.count(value as f32), Ok(count), "{value} in single precision");
    }
    // The largest double below a half, to which a half added is rounded to 1.
    assert_eq!(Quantizer::new(0.0, 1.0).unwrap().count(0.5_f64.next_down()), Ok(0));
    assert_eq!(quantizer.count(3_u32), Ok(8));
    assert_eq!(quantizer.count(f64::NAN), Err(SampleError::NotANumber));
    assert_eq!(quantizer.count(f32::NAN), Err(SampleError::NotANumber));
    assert_eq!(quantizer.count(f64::NEG_INFINITY), Err(SampleError::Infinite));
    let largest = 1.0 + f64::from(i32::MAX) * 0.25;
    assert_eq!(quantizer.count(largest), Ok(i32::MAX));
    for value in [largest + 0.25, f64::MAX, -f64::MAX] {
        assert_eq!(quantizer.count(value), Err(SampleError::OutOfRange), "{value}");
    }
    for (origin, lsb) in [(0.0, 0.0), (0.0, -1.0), (0.0, f64::NAN), (f64::NAN, 1.0), (f64::INFINITY, 1.0)] {
        assert_eq!(Quantizer::new(origin, lsb), None, "{origin}, {lsb}");
    }
}

/// Random values near and beyond the limits, ties, and what is no number: with a power of two as LSB, a decimal one, and one whose
/// reciprocal is no normal number.
#[test]
fn counts_of_many_values_are_those_of_each() {
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let special = [f64::NAN, f64::INFINITY, -f64::INFINITY, 1e300, 2_147_483_646.5, 2_147_483_647.5, -2_147_483_648.5];
    for (origin, lsb) in [(0.0, 1.0), (0.75, 0.25), (-3.1, 0.05), (1e3, 3e-7), (0.0, 2.0_f64.powi(-1074))] {
        let quantizer = Quantizer::new(origin, lsb).unwrap();
        let values: Vec<f64> = (0..20_000)
            .map(|at| match at % 7 {
                0 => origin + lsb * (f64::from(rng.random_range(-1_000..1_000)) + 0.5),
                1 if at % 49 == 1 => origin + lsb * special[rng.random_range(0..special.len())],
                2 => origin + lsb * rng.random_range(-2.2e9..2.2e9),
                _ => origin + lsb * rng.random_range(-40.0..40.0),
            })
            .collect();
        let (mut start, mut counts) = (0, vec![0; values.len()]);
        while start < values.len() {
            let put = quantizer.counts(&values[start..], &mut counts[start..]);
            for at in start..start + put {
                assert_eq!(quantizer.count(values[at]), Ok(counts[at]), "{} / {lsb}", values[at]);
            }
            start += put;
            if start < values.len() {
                assert!(quantizer.count(values[start]).is_err(), "{} / {lsb}", values[start]);
            }
            start += 1;
        }
    }
}

#[test]
fn a_quantizer_for_samples_is_fine_against_their_white_noise() {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    for deviation in [1.5e-4, 3.0, 7e12] {
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        let mut samples: Vec<f64> = (0..10_000).map(|_| 1e3 * deviation + deviation * normal()).collect();
        samples[0] = f64::NEG_INFINITY;
        samples[5_000] = f64::NAN;
        let quantizer = Quantizer::for_samples(samples.iter().copied()).unwrap();
        assert_eq!(quantizer.origin(), samples[1]);
        // With 10,000 samples the deviation is known within √(3/(4·10,000)), 0.9 %, and none of these is at a power of two.
        let lsb = (deviation / 65_536.0).log2().floor().exp2();
        assert_eq!(quantizer.lsb(), lsb, "a standard deviation of {deviation}");
    }
    for samples in [&[][..], &[1.0], &[1.0, 1.0, 1.0], &[1.0, f64::NAN, 2.0], &[f64::INFINITY, 1.0], &[0.0, 1e-320]] {
        assert_eq!(Quantizer::for_samples(samples.iter().copied()), None, "{samples:?}");
    }
}

#[test]
fn wide_integers_are_counted_from_an_origin() {
    assert_eq!(integer_count(u32::MAX, u32::MAX - 7), Ok(7));
    assert_eq!(integer_count(i64::MIN, i64::MIN + 7), Ok(-7));
    assert_eq!(integer_count(u64::MAX, 0_u64), Err(SampleError::OutOfRange));
    assert_eq!(integer_count(i64::from(i32::MIN), 0_i64), Ok(i32::MIN));
    assert_eq!(integer_count(i64::from(i32::MIN) - 1, 0_i64), Err(SampleError::OutOfRange));
}

/// The Allan variance of phases is `⟨(x(t + 2τ) − 2x(t + τ) + x(t))²⟩/(2τ²)`, here summed directly.
#[test]
fn phase_data_have_the_allan_variance_of_their_second_differences() {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let (mut phase, mut phases) = (0.0, Vec::new());
    for _ in 0..5_000 {
        let step: f64 = StandardNormal.sample(&mut random);
        phase += 1e-9 * step;
        phases.push(phase);
    }
    let lsb = 1e-12;
    let mut counts = PhaseCounts::new(Quantizer::new(0.0, lsb).unwrap());
    let mut cascade = Cascade::<10, 8>::new();
    let frequencies = phases.iter().filter_map(|&phase| counts.count(phase).unwrap());
    frequencies.for_each(|count| cascade.push(count));
    assert_eq!(cascade.len(), 4_999);
    let curve = cascade.curve(1.0).scaled(lsb);
    for point in &curve.points()[..4] {
        // Up to n = 8 the estimator is fully overlapping.
        let n = point.n as usize;
        let squares: Vec<f64> = phases
            .windows(2 * n + 1)
            .map(|x| (x[2 * n] - 2.0 * x[n] + x[0]).powi(2) / (2.0 * (n * n) as f64))
            .collect();
        let direct = squares.iter().sum::<f64>() / squares.len() as f64;
        // A phase is rounded by up to half an LSB, 1/2000 of the standard deviation of a step.
        assert!((point.avar / direct - 1.0).abs() < 1e-3, "n = {n}: {} and {direct}", point.avar);
    }
    assert_eq!(counts.count(f64::NAN), Err(SampleError::NotANumber));
    assert_eq!(counts.count(phase + 1.0), Err(SampleError::OutOfRange));
    counts.restart();
    assert_eq!(counts.count(phase), Ok(None));
}

#[test]
fn time_stamps_find_the_missing_samples_through_jitter_and_a_wrong_clock() {
    let mut random = ChaCha8Rng::seed_from_u64(11);
    for period_error in [0.99, 1.0, 1.01] {
        let mut stamps = TimeStamps::new(1_000).unwrap();
        let (mut lost, mut found) = (0, 0);
        let mut since = 0;
        for sample in 0..20_000_u64 {
            // Jitter of ±100 ticks; every tenth sample is lost, in runs of up to a few.
            if sample > 0 && random.random_range(0..10) == 0 {
                since += 1;
                continue;
            }
            let jitter: i64 = random.random_range(-100..=100);
            let time = (sample as f64 * 1_000.0 * period_error) as u64;
            found += stamps.missing(1_000_u64.wrapping_add_signed(jitter) + time).unwrap();
            lost += std::mem::take(&mut since);
        }
        assert_eq!(found, lost, "period off by a factor of {period_error}");
    }
}

#[test]
fn a_time_stamp_that_is_not_later_is_refused_and_leaves_the_estimator_alone() {
    let mut stamps = TimeStamps::new(1_000).unwrap();
    let mut cascade = Cascade::<10, 8>::new();
    assert_eq!(stamps.push(&mut cascade, u64::MAX - 1_499, 1), Ok(0));
    assert_eq!(stamps.push(&mut cascade, u64::MAX - 499, 2), Ok(0));
    assert_eq!(stamps.push(&mut cascade, u64::MAX, 3), Err(TimeStampError::NotLater));
    assert_eq!(stamps.push(&mut cascade, 2_500, 4), Ok(2), "the counter wraps");
    assert_eq!((cascade.len(), cascade.missing()), (3, 2));
    assert_eq!(stamps.missing(1_001 << 32), Err(TimeStampError::TooLate));
    assert_eq!(stamps.missing(u64::MAX / 2 + 10_000), Err(TimeStampError::NotLater));
    assert_eq!([TimeStamps::new(0), TimeStamps::new(u64::MAX)], [None, None]);
    let mut half = TimeStamps::new(10).unwrap();
    assert_eq!([100, 104, 105].map(|time| half.missing(time)), [Ok(0), Err(TimeStampError::NotLater), Ok(0)]);
    stamps.restart();
    assert_eq!(stamps.last(), None);
    assert_eq!(stamps.missing(0), Ok(0));
    assert_eq!(stamps.missing(1_160), Ok(0));
    // A sixteenth of the deviation of 160 ticks.
    assert_eq!(stamps.last(), Some(1_010));
}
