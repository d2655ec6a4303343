//! White noise or quantization after the filter of a sensor: with few taps the spectrum tells the two apart, and the curve does not.

use super::channel_fit::MAX_DEVIANCE_RISE;
use super::sample_coefficients::{SamplesOfCurve, gain_by_samples};
use super::traced_model::{PlannedTerm, Shapes, TracedModel, residual};
use crate::OCTAVES;
use allan_core::{Curve, NoiseTerm};

/// `traced`, fitted to `curve`, with quantization in place of the white noise that entered after its filter, where the `samples` show that to be
/// likelier by more than [`MAX_DEVIANCE_RISE`], and the curve does not contradict it by as much. `None` where it has no such noise.
pub(crate) fn quantized_after_filter(
    curve: &Curve<OCTAVES>,
    traced: &TracedModel,
    samples: SamplesOfCurve,
) -> Option<TracedModel> {
    if !traced.has_filter() || traced.terms().any(|(kind, _)| kind == NoiseTerm::Quantization) {
        return None;
    }
    let white = traced.terms().position(|(kind, _)| kind == NoiseTerm::AngleRandomWalk)?;
    let mut terms: Vec<PlannedTerm> = traced.terms().collect();
    terms[white] = (NoiseTerm::Quantization, None);
    let quantized = TracedModel::fit(curve, &terms, Shapes::Kept);
    let gain = gain_by_samples(curve, [quantized.model(), traced.model()], samples)?;
    let rise = quantized.goodness.deviance - traced.goodness.deviance;
    if gain <= MAX_DEVIANCE_RISE || rise > MAX_DEVIANCE_RISE {
        return None;
    }
    let without = traced.removed(curve, white);
    terms[white].1 = Some(without.next_addition(gain, residual(without.model(), curve.points().first()?)));
    Some(traced.replaced(curve, &terms, Shapes::Kept))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::OVERLAP;
    use crate::samples::uniform_series::UniformSeries;
    use allan_core::Cascade;
    use allan_core::term::MovingAverageFilter;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    const PERIOD_S: f64 = 0.01;
    const SAMPLES: usize = 1 << 15;
    const TERMS: [NoiseTerm; 4] = [
        NoiseTerm::Filtered(MovingAverageFilter::bartlett(2)),
        NoiseTerm::BiasInstability,
        NoiseTerm::RateRandomWalk,
        NoiseTerm::AngleRandomWalk,
    ];

    /// The model that is adopted for white noise of the deviation 100 before a filter of two averages over two values, and `added` after it.
    fn taken(seed: u64, mut added: impl FnMut(&mut ChaCha8Rng) -> f64) -> Option<TracedModel> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut last = [0.0; 2];
        let mut next = || {
            let white = 100.0 * random.sample::<f64, _>(StandardNormal);
            let filtered = 0.25 * white + 0.5 * last[0] + 0.25 * last[1];
            last = [white, last[0]];
            (filtered + added(&mut random)).round() as i32
        };
        let counts: Vec<i32> = (0..SAMPLES).map(|_| next()).collect();
        let mut cascade = Cascade::<OCTAVES, OVERLAP>::new();
        counts.iter().for_each(|count| cascade.push(*count));
        let curve = cascade.curve(PERIOD_S);
        let traced = TracedModel::fit(&curve, &TERMS.map(|kind| (kind, None)), Shapes::Kept);
        let rest = UniformSeries::new(PERIOD_S, counts.into_iter().map(f64::from).collect());
        quantized_after_filter(&curve, &traced, SamplesOfCurve { rest: &rest, spectrum: None })
    }

    /// Differences of errors of the angle of 40 counts times the sample period, Q; and white noise of the same deviation, `40·√2` counts.
    #[test]
    fn the_samples_tell_quantization_from_white_noise_after_the_filter() {
        for seed in 0..10 {
            let mut before = 0.0;
            let found = taken(seed, |random| {
                let error = 40.0 * random.sample::<f64, _>(StandardNormal);
                error - std::mem::replace(&mut before, error)
            });
            let found = found.expect("quantization");
            let quantization = found.model().terms().iter().find(|term| term.kind == NoiseTerm::Quantization);
            let value = quantization.expect("one of its terms").value / PERIOD_S;
            // Q² of 32,768 samples is known to √(2/n), 0.8 %, were it alone: three times as much beside the noise of the same density.
            assert!((value / 40.0 - 1.0).abs() < 0.05, "{value}");
            let white = taken(seed, |random| 40.0 * 2_f64.sqrt() * random.sample::<f64, _>(StandardNormal));
            assert!(white.is_none(), "{:?}", white.map(|of| of.model().clone()));
        }
    }
}
