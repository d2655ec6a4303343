//! Spectra of simulated noise: known densities are measured, added lines are found, and pure noise yields none.

mod noise;
mod sample_likelihood;
mod simulated_noise;

use noise::{Output, PAPER, RATE_HZ, gain, resonance, sine};
use noise_analysis::samples::uniform_series::UniformSeries;
use noise_analysis::spectra::{SpectralLine, Welch, allan_deviations_by_spectrum, find_lines};
use std::f64::consts::PI;

/// About eleven minutes.
const SAMPLES: usize = 1 << 17;

#[test]
fn pure_noise_shows_no_line() {
    let [n, b, k] = PAPER.noise;
    let mixtures =
        [[n, b, k], [n, 0.0, 0.0], [n, 0.0, 20.0 * k], [0.0, 5.0 * b, 0.0], [0.1 * n, b, k], [0.0, 0.0, 5.0 * k]];
    let mut alarms = Vec::new();
    let mut records = 0;
    for (case, noise) in mixtures.into_iter().enumerate() {
        for taps_log2 in [0, 2, 4, 6] {
            for seed in 0..20 {
                let series = Output { noise, taps_log2, added: &[] }.samples(1 << 14, 100 * case as u64 + seed);
                records += 1;
                alarms.extend(find_lines(&series));
            }
        }
    }
    // One record in five hundred is expected.
    assert!(alarms.len() <= records / 100, "{} of {records}: {alarms:?}", alarms.len());
}

fn nearest(lines: &[SpectralLine], frequency: f64) -> Option<&SpectralLine> {
    lines.iter().min_by(|a, b| {
        let distance = |line: &SpectralLine| (line.frequency.value - frequency).abs();
        distance(a).total_cmp(&distance(b))
    })
}

/// Amplitude of a sinusoid with this −2 ln Λ, which is A²·T/S in noise of the density S.
fn amplitude_of(statistic: f64, frequency: f64) -> f64 {
    let [n, b, k] = PAPER.noise;
    let density = 2.0 * n * n + b * b / (PI * frequency) + k * k / (2.0 * PI * PI * frequency * frequency);
    (statistic * density * RATE_HZ / SAMPLES as f64).sqrt()
}

#[test]
fn sinusoids_are_found_down_to_the_limit_of_their_likelihood() {
    // With 65,536 frequencies and one false alarm in a thousand records, −2 ln Λ must exceed about 39. It is noncentral χ²
    // with two degrees of freedom, so an expected 60 exceeds that by 1.3 and 100 by 3 standard deviations.
    for (statistic, least) in [(60.0, 13), (100.0, 19)] {
        let mut found = 0;
        for seed in 0..20 {
            let frequency = 0.05 * 1.35f64.powi(seed as i32);
            let amplitude = amplitude_of(statistic, frequency);
            let added = sine(amplitude, frequency, SAMPLES);
            let lines = find_lines(&Output { added: &added, ..PAPER }.samples(SAMPLES, 50 + seed));
            let Some(line) = nearest(&lines, frequency).filter(|line| line.width.is_none()) else { continue };
            if (line.frequency.value - frequency).abs() > 5.0 * line.frequency.error {
                continue;
            }
            found += 1;
            let error = line.amplitude().value / gain(frequency, 2) - amplitude;
            assert!(error.abs() < 5.0 * line.amplitude().error / gain(frequency, 2), "{frequency} Hz: {line:?}");
            assert_eq!(lines.len(), 1, "{lines:?}");
        }
        assert!(found >= least, "{found} of 20 at {statistic}");
    }
}

#[test]
fn a_strong_sinusoid_is_measured_within_its_errors() {
    let (mut frequency_pulls, mut amplitude_pulls) = (Vec::new(), Vec::new());
    for seed in 0..12 {
        let frequency = 0.2 * 1.6f64.powi(seed as i32);
        let amplitude = amplitude_of(2000.0, frequency);
        let added = sine(amplitude, frequency, SAMPLES);
        let lines = find_lines(&Output { added: &added, ..PAPER }.samples(SAMPLES, 50 + seed));
        let [line] = lines[..] else { panic!("{lines:?}") };
        assert!(line.width.is_none() && line.p_value < 1e-9);
        assert!((line.frequency.value / frequency - 1.0).abs() < 2e-4);
        assert!((line.amplitude().value / (amplitude * gain(frequency, 2)) - 1.0).abs() < 0.1);
        frequency_pulls.push((line.frequency.value - frequency) / line.frequency.error);
        amplitude_pulls.push((line.amplitude().value - amplitude * gain(frequency, 2)) / line.amplitude().error);
    }
    for pulls in [frequency_pulls, amplitude_pulls] {
        // 99.9 % of χ² with 12 degrees of freedom are between 2.2 and 32.9.
        let square: f64 = pulls.iter().map(|pull| pull * pull).sum();
        assert!((2.2..32.9).contains(&square), "{pulls:?}");
    }
}

#[test]
fn neighbouring_lines_are_separated_with_and_without_gaps() {
    let mut added = sine(0.04, 10.0, SAMPLES);
    for (frequency, amplitude) in [(10.2, 0.03), (33.3, 0.05)] {
        added.iter_mut().zip(sine(amplitude, frequency, SAMPLES)).for_each(|(sum, value)| *sum += value);
    }
    let whole = Output { added: &added, ..PAPER }.samples(SAMPLES, 4);
    let missing = |at: usize| at % 97 == 13 || (40_000..41_000).contains(&at);
    let holed = whole.values().iter().enumerate().map(|(at, &value)| if missing(at) { f64::NAN } else { value });
    let holed = UniformSeries::new(whole.sample_period(), holed.collect());
    for series in [whole, holed] {
        let mut lines = find_lines(&series);
        lines.sort_by(|a, b| a.frequency.value.total_cmp(&b.frequency.value));
        assert_eq!(lines.len(), 3, "{lines:?}");
        for (line, (frequency, amplitude)) in lines.iter().zip([(10.0, 0.04), (10.2, 0.03), (33.3, 0.05)]) {
            assert!((line.frequency.value / frequency - 1.0).abs() < 2e-4, "{line:?}");
            assert!((line.amplitude().value / gain(frequency, 2) / amplitude - 1.0).abs() < 0.2, "{line:?}");
            assert!(line.width.is_none());
        }
    }
}

#[test]
fn frequency_width_and_deviation_of_a_resonance_are_measured() {
    // Standard deviation of a sample of the white noise; the resonances are given in units of it.
    let white = PAPER.noise[0] * RATE_HZ.sqrt();
    for (frequency, width, strength) in
        [(20.0, 0.05, 0.2), (20.0, 0.5, 0.5), (7.0, 1.0, 0.5), (30.0, 3.0, 0.5), (1.0, 0.1, 0.2)]
    {
        let mut pulls = [0.0; 3];
        for seed in 0..6 {
            let deviation = strength * white;
            let added = resonance(deviation, frequency, width, SAMPLES, 1000 + seed);
            let lines = find_lines(&Output { added: &added, ..PAPER }.samples(SAMPLES, 50 + seed));
            let [line] = lines[..] else { panic!("{frequency} Hz, {width} Hz wide: {lines:?}") };
            let found = line.width.expect("a width");
            let errors = [
                (line.frequency.value - frequency) / line.frequency.error,
                (found.value / width).ln() / (found.error / found.value),
                (line.deviation.value / (deviation * gain(frequency, 2))).ln()
                    / (line.deviation.error / line.deviation.value),
            ];
            pulls.iter_mut().zip(errors).for_each(|(sum, pull)| *sum += pull * pull);
        }
        for pull in pulls {
            // χ² with six degrees of freedom exceeds 22.5 once in a thousand; the filter's slope over a wide resonance and
            // the line at the negative frequency add to it.
            assert!(pull < 30.0, "{frequency} Hz, {width} Hz wide: {pulls:?}");
        }
    }
}

#[test]
fn short_constant_and_missing_records_have_no_lines() {
    for values in [vec![], vec![1.0], vec![0.0; 5000], vec![f64::NAN; 300], (0..40).map(f64::from).collect()] {
        assert_eq!(find_lines(&UniformSeries::new(0.01, values.clone())), []);
        assert!(Welch::estimate(&UniformSeries::new(0.01, values), 1 << 13).is_none());
    }
}

#[test]
fn welch_measures_the_density_and_its_variance() {
    // Unfiltered white noise of density 2N², with a tenth of the samples missing.
    let n = 0.5;
    let series = Output { noise: [n, 0.0, 0.0], taps_log2: 0, added: &[] }.samples(1 << 18, 3);
    let holed = series.values().iter().enumerate().map(|(at, &value)| if at % 10 == 7 { f64::NAN } else { value });
    for series in [UniformSeries::new(series.sample_period(), holed.collect()), series] {
        let welch = Welch::estimate(&series, 1 << 10).expect("many segments");
        assert_eq!(welch.segments(), 511);
        let inner: Vec<f64> = welch.points().skip(2).take(500).map(|(_, density)| density / (2.0 * n * n)).collect();
        let mean = inner.iter().sum::<f64>() / 500.0;
        let variance = inner.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / 499.0;
        // 2¹⁸ samples: the standard deviation of the mean is 1/√2¹⁷.
        assert!((mean - 1.0).abs() < 5.0 / 2f64.powf(8.5), "{mean}");
        // Neighbouring points are correlated, about 260 of 500 are independent: the variance is known to a tenth.
        assert!((variance * welch.ordinates() - 1.0).abs() < 0.4, "{variance}");
    }
}

#[test]
fn welch_measures_the_angle_random_walk() {
    let n = PAPER.noise[0];
    let mut pulls = Vec::new();
    for seed in 0..10 {
        let welch = Welch::estimate(&PAPER.samples(1 << 18, seed), 1 << 13).expect("many segments");
        let (shape, bands) = welch.shape(|_| false);
        assert_eq!(shape.taps, 4);
        let error = shape.angle_random_walk_error(&bands).expect("white noise");
        assert!(error < 0.01);
        pulls.push((shape.angle_random_walk() / n - 1.0) / error);
    }
    // χ² with ten degrees of freedom exceeds 29.6 once in a thousand.
    assert!(pulls.iter().map(|pull| pull * pull).sum::<f64>() < 29.6, "{pulls:?}");
}

/// Allan deviation of non-overlapping means of `n` samples, and the number of differences.
fn allan_deviation(values: &[f64], n: usize) -> (f64, usize) {
    let means: Vec<f64> = values.chunks_exact(n).map(|chunk| chunk.iter().sum::<f64>() / n as f64).collect();
    let squares: f64 = means.windows(2).map(|pair| (pair[1] - pair[0]).powi(2)).sum();
    ((0.5 * squares / (means.len() - 1) as f64).sqrt(), means.len() - 1)
}

#[test]
fn equation_5_of_the_measured_spectrum_is_the_measured_allan_deviation() {
    let [n, ..] = PAPER.noise;
    for (taps_log2, seed) in [(0, 1), (2, 2), (4, 3)] {
        let series = Output { noise: [n, 0.0, 0.0], taps_log2, added: &[] }.samples(SAMPLES, seed);
        let factors: Vec<u64> = (0..17).map(|octave| 1 << octave).collect();
        let by_spectrum = allan_deviations_by_spectrum(&series, &factors);
        for (&factor, by_spectrum) in factors.iter().zip(by_spectrum) {
            let Some(by_spectrum) = by_spectrum else {
                assert!(16 * factor > SAMPLES as u64, "{factor} is within a sixteenth of the record");
                continue;
            };
            let (measured, differences) = allan_deviation(series.values(), factor as usize);
            // Relative standard deviations of the two estimates from the same record: 1/√(2·edf) of a deviation, with 2/3 of
            // the differences of white noise for edf (NIST SP 1065), and at the shortest ones, where the filter
            // correlates them, the 2L samples of its length for one.
            let correlated = f64::from(2 << taps_log2) / factor as f64;
            let edf = differences as f64 * 2.0 / 3.0 / correlated.max(1.0);
            let scatter = 2f64.sqrt() / (2.0 * edf).sqrt();
            assert!(
                (by_spectrum / measured - 1.0).abs() < 4.0 * scatter,
                "{factor}, {taps_log2}: {by_spectrum}, {measured}"
            );
            // N/√τ of white noise, once the filter is much shorter than the averaging time.
            if factor >= 256 {
                let expected = n / (factor as f64 / RATE_HZ).sqrt();
                assert!(
                    (by_spectrum / expected - 1.0).abs() < 4.0 * scatter + 0.01,
                    "{factor}: {by_spectrum}, {expected}"
                );
            }
        }
    }
    let short = UniformSeries::new(0.01, vec![1.0; 500]);
    assert_eq!(allan_deviations_by_spectrum(&short, &[1, 2]), [None, None]);
    // A constant record has no deviation.
    let constant = UniformSeries::new(0.01, vec![1.0; 5000]);
    let [Some(deviation), None] = allan_deviations_by_spectrum(&constant, &[1, 1024])[..] else { panic!() };
    assert!(deviation < 1e-12, "{deviation}");
}
