//! Detection limit of effects outside the vocabulary: the smallest size at which a test that is told their signal detects them in
//! half of the recordings.

use super::channel_under_test::ChannelUnderTest;
use super::detection_limit::{required_ratio, solve_size};
use super::environment::EnvironmentCourse;
use super::outside::{OutsideEffect, OutsideKind, relative};
use realfft::RealFftPlanner;

/// Size at the detection limit of `effect`, beside the noise of its channel `place`.
pub(super) fn smallest_outside_size(
    effect: &OutsideEffect,
    environment: &EnvironmentCourse,
    place: &ChannelUnderTest<'_>,
) -> f64 {
    let period_s = place.record.period_s;
    let samples = environment.temperature_c.len();
    // Independent frequencies; times with lengths; both.
    let places = match effect.kind() {
        OutsideKind::Chirp | OutsideKind::Sawtooth | OutsideKind::ModulatedLine => 0.5 * samples as f64,
        OutsideKind::Decays => 40.0 * 12.0,
        OutsideKind::LevelByTemperature => 1.0,
    };
    let required = required_ratio(places);
    if effect.kind() == OutsideKind::LevelByTemperature {
        let white = place.white_density() / period_s;
        let levels: Vec<f64> = relative(&environment.temperature_c).collect();
        return white.sqrt()
            * solve_size(required, |size| ratio_of_levels(levels.iter().map(|level| (size * level).powi(2))));
    }
    let unit = OutsideEffect { size: 1.0, ..*effect }.signal(environment, samples, period_s);
    let density = |frequency: f64| place.density_before_filter(frequency);
    (required / ratio_of_signal(&unit, period_s, density)).sqrt()
}

/// Expected log likelihood ratio of a known signal in noise of the two-sided `density`: the energy of its spectrum over that
/// of the noise (matched filter). The mean is not known.
fn ratio_of_signal(signal: &[f64], period_s: f64, density: impl Fn(f64) -> f64) -> f64 {
    let transform = RealFftPlanner::<f64>::new().plan_fft_forward(signal.len());
    let (mut input, mut output) = (signal.to_vec(), transform.make_output_vec());
    if transform.process(&mut input, &mut output).is_err() {
        return 0.0;
    }
    let seconds = signal.len() as f64 * period_s;
    let energy = |(k, bin): (usize, &realfft::num_complex::Complex<f64>)| {
        period_s * period_s * bin.norm_sqr() / seconds / density(k as f64 / seconds)
    };
    output.iter().enumerate().skip(1).map(energy).sum()
}

/// Expected log likelihood ratio of white noise whose variance is 1 plus `added`, sample by sample, against the best constant
/// variance.
fn ratio_of_levels(added: impl Iterator<Item = f64>) -> f64 {
    let (sum, logs, count) =
        added.fold((0.0, 0.0, 0.0), |(sum, logs, count), added: f64| (sum + added, logs + added.ln_1p(), count + 1.0));
    0.5 * (count * f64::ln_1p(sum / count) - logs)
}

#[cfg(test)]
mod tests {
    use super::{ratio_of_levels, ratio_of_signal};
    use std::f64::consts::TAU;

    /// `A²T/(4S)` for a sinusoid of `T` s (D. Rife and R. Boorstyn 1974, with the two-sided density S).
    #[test]
    fn the_ratio_of_a_sinusoid_has_its_closed_form() {
        let signal: Vec<f64> = (0..1000).map(|at| 0.3 * (TAU * 0.07 * f64::from(at)).sin()).collect();
        let expected = 0.09 * 1000.0 * 0.01 / (4.0 * 0.2);
        assert!((ratio_of_signal(&signal, 0.01, |_| 0.2) / expected - 1.0).abs() < 1e-6);
    }

    /// Half of the samples of variance 1, half of 3: ½·n·(ln 2 − ½ ln 3).
    #[test]
    fn the_ratio_of_two_levels_has_its_closed_form() {
        let added = (0..1000).map(|at| if at < 500 { 0.0 } else { 2.0 });
        let expected = 500.0 * (2f64.ln() - 0.5 * 3f64.ln());
        assert!((ratio_of_levels(added) - expected).abs() < 1e-9);
    }
}
