//! The detection limit of effects outside the vocabulary, for a test that knows the signal.

use super::block_covariance::BLOCKS;
use super::channel_under_test::{ChannelUnderTest, resonance_density};
use super::detection_limit::{
    HOST_CLOCK_TOLERANCE, TIMES, required_ratio, smallest_deviation, solve_size, waveform_test,
};
use super::environment::EnvironmentCourse;
use super::outside::{OutsideEffect, OutsideKind, relative};

/// The effect at `strength` times the limit, and the strength obtained; missing codes have no size.
pub(super) fn with_strength(
    unit: OutsideEffect,
    strength: f64,
    environment: &EnvironmentCourse,
    place: &ChannelUnderTest<'_>,
) -> (OutsideEffect, f64) {
    let limit = smallest_outside_size(&unit, environment, place);
    match unit.kind() {
        OutsideKind::MissingCodes => {
            let expected = place.record.seconds / place.record.period_s * unit.frequencies_hz[0];
            (unit, (expected / required_ratio(1.0)).sqrt())
        }
        OutsideKind::HeldValue | OutsideKind::ClockStep | OutsideKind::Knock => {
            (OutsideEffect { size: strength * strength * limit, ..unit }, strength)
        }
        _ => (OutsideEffect { size: strength * limit, ..unit }, strength),
    }
}

fn smallest_outside_size(effect: &OutsideEffect, environment: &EnvironmentCourse, place: &ChannelUnderTest<'_>) -> f64 {
    let period_s = place.record.period_s;
    let samples = (place.record.seconds / period_s).round();
    let density = |frequency: f64| place.density_before_filter(frequency);
    let of_signal = |places: f64| {
        let unit = OutsideEffect { size: 1.0, ..effect.clone() };
        let unit = unit.signal(environment, samples as usize, period_s);
        (required_ratio(places) / ratio_of_signal(&unit, period_s, density)).sqrt()
    };
    // Each equal sample of a row is as improbable as two equal neighbours.
    let equal = |places: f64| required_ratio(places) / -place.equal_probability().ln();
    match effect.kind() {
        OutsideKind::Chirp | OutsideKind::Sawtooth | OutsideKind::ModulatedLine | OutsideKind::SwitchedLine => {
            of_signal(0.5 * samples)
        }
        OutsideKind::SupplyDroop => of_signal(0.5 * samples * TIMES),
        OutsideKind::Decays => of_signal(40.0 * 12.0),
        OutsideKind::AlternatingConverters => of_signal(1.0),
        OutsideKind::Knock => of_signal(samples),
        OutsideKind::LevelByTemperature => {
            let white = place.white_density() / period_s;
            let levels: Vec<f64> = relative(&environment.temperature_c).collect();
            white.sqrt()
                * solve_size(required_ratio(1.0), |size| {
                    ratio_of_levels(levels.iter().map(|level| (size * level).powi(2)))
                })
        }
        OutsideKind::HeldValue => equal(samples) * period_s,
        OutsideKind::DeadTime => equal(samples) * period_s,
        OutsideKind::ClockStep => HOST_CLOCK_TOLERANCE,
        OutsideKind::SelfHeating => {
            let block_s = place.record.seconds / BLOCKS as f64;
            // The values are means of the approach per block.
            let (length, test) = (block_s / effect.times_s[1], waveform_test(place));
            let mean = |block: usize| 1.0 - (-length * block as f64).exp() * -(-length).exp_m1() / length;
            let values: Vec<f64> = (0..BLOCKS).map(mean).collect();
            let places = 12.0;
            solve_size(required_ratio(places), |size| {
                test.ratio(&values.iter().map(|value| size * value).collect::<Vec<f64>>())
            })
        }
        OutsideKind::WanderingBand => {
            let [centre_hz, width_hz] = effect.frequencies_hz;
            let unit = |frequency: f64| resonance_density(centre_hz, width_hz, period_s, frequency);
            smallest_deviation(place, 0.5 / period_s / width_hz, Some((centre_hz, width_hz)), unit)
        }
        OutsideKind::MissingCodes => 1.0,
    }
}

/// Ratio of a matched filter: energy of the spectrum over the two-sided noise density, without the mean.
fn ratio_of_signal(signal: &[f64], period_s: f64, density: impl Fn(f64) -> f64) -> f64 {
    let transform = fourier::forward(signal.len());
    let (mut input, mut output) = (signal.to_vec(), transform.make_output_vec());
    if transform.process(&mut input, &mut output).is_err() {
        return 0.0;
    }
    let seconds = signal.len() as f64 * period_s;
    // An ordinate counts twice, except at half the sample rate.
    let is_single = |k: usize| 2 * k == signal.len();
    let energy = |(k, bin): (usize, &fourier::Complex<f64>)| {
        let part = if is_single(k) { 0.5 } else { 1.0 };
        part * period_s * period_s * bin.norm_sqr() / seconds / density(k as f64 / seconds)
    };
    output.iter().enumerate().skip(1).map(energy).sum()
}

/// Log likelihood ratio of varying variances against the best constant variance, from the added variance per sample.
fn ratio_of_levels(added: impl Iterator<Item = f64>) -> f64 {
    let (sum, logs, count) =
        added.fold((0.0, 0.0, 0.0), |(sum, logs, count), added: f64| (sum + added, logs + added.ln_1p(), count + 1.0));
    0.5 * (count * f64::ln_1p(sum / count) - logs)
}

#[cfg(test)]
mod tests {
    use super::{ratio_of_levels, ratio_of_signal};
    use std::f64::consts::TAU;

    /// The ratio is `A²T/(4S)` (D. Rife and R. Boorstyn 1974).
    #[test]
    fn the_ratio_of_a_sinusoid_has_its_closed_form() {
        let signal: Vec<f64> = (0..1000).map(|at| 0.3 * (TAU * 0.07 * f64::from(at)).sin()).collect();
        let expected = 0.09 * 1000.0 * 0.01 / (4.0 * 0.2);
        assert!((ratio_of_signal(&signal, 0.01, |_| 0.2) / expected - 1.0).abs() < 1e-6);
    }

    /// The ratio is `½·Σs²/σ²` in white noise.
    #[test]
    fn the_ratio_of_an_alternating_offset_is_half_its_energy() {
        let signal: Vec<f64> = (0..1000).map(|at| if at % 2 == 0 { 0.3 } else { -0.3 }).collect();
        let expected = 0.5 * 1000.0 * 0.09 / (0.2 / 0.01);
        assert!((ratio_of_signal(&signal, 0.01, |_| 0.2) / expected - 1.0).abs() < 1e-6);
    }

    /// Half of the samples have variance 1, half 3: the ratio is ½·n·(ln 2 − ½ ln 3).
    #[test]
    fn the_ratio_of_two_levels_has_its_closed_form() {
        let added = (0..1000).map(|at| if at < 500 { 0.0 } else { 2.0 });
        let expected = 500.0 * (2f64.ln() - 0.5 * 3f64.ln());
        assert!((ratio_of_levels(added) - expected).abs() < 1e-9);
    }
}
