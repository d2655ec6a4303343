//! A Markov process in a spectrum: the likeliest time constant and variance beside white, flicker and random-walk noise, by
//! Whittle's likelihood.

use super::whittle::{Sign, SpectralBand, fit_mixture, mixture_density};
use crate::bounds::BoundedEstimate;
use crate::distributions::NORMAL_975;

/// White, flicker and random-walk noise, a Markov process of each channel's own, a shared one, and shared white noise.
pub(super) const TERMS: usize = 6;
pub(super) const OWN: usize = 3;
pub(super) const SHARED: usize = 4;
/// Factor from one time constant that is tried to the next.
const FACTOR: f64 = 1.25;
/// Least Fisher information on the logarithm of the variance; keeps its standard deviation at 10 or below.
const LEAST_INFORMATION: f64 = 1e-2;

/// A Markov process by a spectrum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct MarkovEstimate {
    /// Standard deviation, in the unit of the channels.
    pub deviation: BoundedEstimate,
    /// Correlation time, s.
    pub time_constant: BoundedEstimate,
    /// Gain in ln likelihood over the same noise without it.
    pub gain: f64,
}

/// Time constants that are tried, from the shortest to the longest, in their unit.
pub(super) fn time_constants(shortest: f64, longest: f64) -> impl Iterator<Item = f64> {
    std::iter::successors(Some(shortest), |time| Some(time * FACTOR)).take_while(move |&time| time < longest)
}

/// The likeliest process of `fits` of several time constants, with bounds, and its gain over the objective `without` it.
pub(super) fn most_likely(fits: &[MarkovFit], without: f64) -> Option<MarkovEstimate> {
    let likeliest = fits.iter().min_by(|a, b| a.objective.total_cmp(&b.objective)).filter(|of| of.variance > 0.0)?;
    // Mean and standard deviation over all time constants, weighted by their likelihood: in a record of few correlation
    // times, time constant and variance are uncertain together. Those without a variance have no process.
    let with_process = fits.iter().filter(|fit| fit.variance > 0.0);
    let weighted = |value: &dyn Fn(&MarkovFit) -> f64| {
        let mean = |of: &dyn Fn(f64) -> f64| {
            let (sum, total) = with_process.clone().fold((0.0, 0.0), |(sum, total), fit| {
                let weight = (likeliest.objective - fit.objective).exp();
                (sum + weight * of(value(fit)), total + weight)
            });
            sum / total
        };
        let middle = mean(&|value| value);
        (middle, mean(&|value| (value - middle).powi(2)).sqrt())
    };
    let (time, of_time) = weighted(&|fit| fit.time.ln());
    let (deviation, of_deviation) = weighted(&|fit| 0.5 * fit.variance.ln());
    let (alone, _) = weighted(&|fit| 0.5 * fit.error);
    Some(MarkovEstimate {
        deviation: bounded(likeliest.variance.sqrt(), (deviation, of_deviation.hypot(alone))),
        // Between two of the time constants that were tried all are equally likely: factor/√12.
        time_constant: bounded(likeliest.time, (time, of_time.hypot(FACTOR.ln() / 12f64.sqrt()))),
        gain: without - likeliest.objective,
    })
}

/// `value` with bounds by mean and standard deviation of its logarithm.
fn bounded(value: f64, (mean, deviation): (f64, f64)) -> BoundedEstimate {
    let half = NORMAL_975 * deviation;
    BoundedEstimate { value, low: (mean - half).exp().min(value), high: (mean + half).exp().max(value) }
}

/// The likeliest noise and processes for one time constant.
pub(super) struct MarkovFit {
    pub time: f64,
    variance: f64,
    /// Relative standard deviation of the variance, all else being known.
    error: f64,
    pub objective: f64,
}

impl MarkovFit {
    /// Fits the densities of the terms to the bands in which they have the values `bases`; `process` is the index of the Markov
    /// process with the time constant `time`.
    pub(super) fn new(bands: &[SpectralBand], bases: &[[f64; TERMS]], time: f64, process: usize) -> Self {
        let mut densities = [0.0; TERMS];
        let objective = fit_mixture(bands, bases, Sign::NonNegative, &mut densities);
        let variance = densities[process];
        let fractions = bases.iter().map(|basis| basis[process] * variance / mixture_density(basis, &densities));
        let information: f64 = fractions.zip(bands).map(|(fraction, band)| band.ordinates * fraction * fraction).sum();
        Self { time, variance, error: information.max(LEAST_INFORMATION).sqrt().recip(), objective }
    }
}

#[cfg(test)]
mod tests {
    use super::{MarkovFit, most_likely};

    /// Those of ten time constants from 8 s on leave no variance for the process, and are e⁻⁹ times as likely: they say nothing of its size.
    #[test]
    fn time_constants_without_a_process_do_not_widen_its_bounds() {
        let fit = |at: i32| MarkovFit {
            time: f64::from(1 << at),
            variance: if at < 3 { 4.0 } else { 0.0 },
            error: 0.1,
            objective: if at < 3 { 0.0 } else { 9.0 },
        };
        let found = most_likely(&(0..10).map(fit).collect::<Vec<_>>(), 9.0).expect("a gain of 9");
        // The variance is known to 10 % at each time constant, and so the deviation to 5 %.
        let [low, high] = [found.deviation.low, found.deviation.high].map(|bound| (bound / 2.0).ln() / 1.96);
        assert!((low + 0.05).abs() < 1e-3 && (high - 0.05).abs() < 1e-3, "{found:?}");
        assert_eq!(most_likely(&[fit(5)], 9.0), None);
    }
}
