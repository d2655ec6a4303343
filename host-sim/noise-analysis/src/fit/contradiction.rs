//! The place at which a curve contradicts a model, also at averaging times with few degrees of freedom.
//!
//! A deviation in standard deviations hides a model that is several times the measurement at the longest averaging times: a variance with
//! four degrees of freedom cannot be more than 3.5 cube-root standard deviations below any model. The exact tail of χ² has no such limit.

use allan_core::confidence::octave_correlation;
use allan_core::{AllanPoint, Curve, Model};
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Probability that some averaging time contradicts a true model, as the 95 % bounds of the reports allow.
pub const CHANCE: f64 = 0.05;
/// Degrees of freedom above which χ² is replaced by the normal distribution: the tails then differ by less than `1e-3` of their logarithm.
const MANY_DEGREES: f64 = 1e6;

/// The averaging time at which a measured variance is least probable under a model, where that is less probable than [`CHANCE`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Contradiction {
    pub tau_s: f64,
    /// Modelled over measured Allan deviation.
    pub ratio: f64,
    /// Probability that a true model is contradicted as much at any averaging time of the curve.
    pub probability: f64,
}

impl Contradiction {
    /// Compares `model` with all points of `curve`; `None` where chance explains their differences.
    ///
    /// The tail of a point is that of `v·edf/m` for a measured variance `v` and a modelled `m`, on its own side. The
    /// probability is twice the smallest tail, for the two sides, times the number of independent points, as Bonferroni's bound has it.
    #[must_use]
    pub fn find<const POINTS: usize>(model: &Model, curve: &Curve<POINTS>) -> Option<Self> {
        Self::find_by(model, curve, |point| (model.avar(point.n), model.edf(point)))
    }

    /// The same with additions: `predicted` has the Allan variance of all at a point, and the degrees of freedom of one that measures it.
    pub(crate) fn find_by<const POINTS: usize>(
        model: &Model,
        curve: &Curve<POINTS>,
        predicted: impl Fn(&AllanPoint) -> (f64, f64),
    ) -> Option<Self> {
        let compared: Vec<&AllanPoint> =
            curve.points().iter().filter(|point| point.avar > 0.0 && model.avar(point.n) > 0.0).collect();
        let tests = 2.0 * independent_points(model, &compared);
        let of = |point: &&AllanPoint| {
            let (modelled, edf) = predicted(point);
            let ratio = point.avar / modelled;
            let probability = (tests * tail(ratio, edf)?).min(1.0);
            Some(Self { tau_s: point.tau, ratio: 1.0 / ratio.sqrt(), probability })
        };
        let least = compared.iter().filter_map(of).min_by(|a, b| a.probability.total_cmp(&b.probability))?;
        (least.probability < CHANCE).then_some(least)
    }

    /// One sentence for the reader; `data` is what the model was compared with, such as "the unseen half".
    #[must_use]
    pub fn sentence(&self, data: &str) -> String {
        let times = |factor: f64| match factor {
            factor if factor < 1.1 => format!("{:.1} % above", 100.0 * (factor - 1.0)),
            factor if factor < 10.0 => format!("{factor:.1} times"),
            factor => format!("{factor:.0} times"),
        };
        let tau = self.tau_s;
        let tau = if tau < 1.0 { format!("{tau:.3} s") } else { format!("{tau:.0} s") };
        let compared = if self.ratio > 1.0 {
            format!("at τ = {tau} the model is {} what is measured in {data}", times(self.ratio))
        } else {
            format!("at τ = {tau} what is measured in {data} is {} the model", times(1.0 / self.ratio))
        };
        let odds = match 1.0 / self.probability {
            odds if odds < 1e6 => format!("in one of {odds:.0} records"),
            _ => "in less than one of a million records".to_owned(),
        };
        format!("{compared}, which a true model shows anywhere on its curve {odds}")
    }
}

/// Number of independent points that scatter as `points` do: `(tr R)²/tr R²` for the correlation matrix `R` of their errors.
fn independent_points(model: &Model, points: &[&AllanPoint]) -> f64 {
    let count = points.len() as f64;
    let fractions: Vec<_> = points.iter().map(|point| model.variance_fractions(point.n)).collect();
    let correlation = |a: usize, b: usize| {
        let octaves = points[a].n.ilog2().abs_diff(points[b].n.ilog2()) as usize;
        octave_correlation(octaves, fractions[a], fractions[b])
    };
    let pairs = (0..points.len()).flat_map(|a| (0..points.len()).map(move |b| (a, b)));
    let squares: f64 = pairs.map(|(a, b)| correlation(a, b).powi(2)).sum();
    if squares > 0.0 { count * count / squares } else { 0.0 }
}

/// Probability that a χ² variable over its `edf` degrees of freedom is farther from 1 than `ratio`, on the side of `ratio`.
fn tail(ratio: f64, edf: f64) -> Option<f64> {
    if edf > MANY_DEGREES {
        return Some(crate::distributions::upper_tail((ratio - 1.0).abs() * (edf / 2.0).sqrt()));
    }
    let distribution = ChiSquared::new(edf).ok()?;
    Some(if ratio < 1.0 { distribution.cdf(ratio * edf) } else { distribution.sf(ratio * edf) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use allan_core::model::FittedTerm;
    use allan_core::{Cascade, NoiseTerm};
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    const PERIOD_S: f64 = 0.01;
    const COUNTS: f64 = 100.0;

    fn white_curve(seed: u64) -> Curve<24> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut cascade = Cascade::<24, 8>::new();
        (0..1 << 14).for_each(|_| cascade.push((COUNTS * random.sample::<f64, _>(StandardNormal)).round() as i32));
        cascade.curve(PERIOD_S)
    }

    /// N of white noise with a standard deviation of [`COUNTS`], and a random walk.
    fn model(walk: f64) -> Model {
        let white = FittedTerm::exact(NoiseTerm::AngleRandomWalk, COUNTS * PERIOD_S.sqrt());
        Model::new(PERIOD_S, [white, FittedTerm::exact(NoiseTerm::RateRandomWalk, walk)])
    }

    /// Bonferroni's bound holds for correlated points as well; with the number of independent points in place of the number of
    /// points it is not exact. Of 300 true models 5 %, 15 ± 3.8, may be contradicted; three standard deviations more are 26,
    /// and twice that would be a wrong number of points.
    #[test]
    fn a_true_model_is_contradicted_as_often_as_it_says() {
        let contradicted = (0..300).filter(|&seed| Contradiction::find(&model(0.0), &white_curve(seed)).is_some());
        let contradicted = contradicted.count();
        assert!((3..=26).contains(&contradicted), "{contradicted} of 300");
    }

    /// 164 s of white noise: with a random walk of 3 counts/√s the model is 2 to 4 times the measurement at 10 s to 40 s, where
    /// a variance has 22 to 4 degrees of freedom, and nearly right at 2 s and less, where it has many.
    #[test]
    fn a_model_far_above_few_degrees_of_freedom_is_contradicted() {
        let curve = white_curve(1);
        let found = Contradiction::find(&model(3.0), &curve).expect("a contradiction");
        assert!(found.tau_s > 4.0 && found.ratio > 1.3, "{found:?}");
        assert!(found.sentence("the unseen half").contains("the model is"), "{}", found.sentence("the unseen half"));
    }

    /// Tails from tables of χ²: with four degrees of freedom 0.297 and 11.14 are the 1 % and the 97.5 % quantiles.
    #[test]
    fn tails_are_those_of_the_tables() {
        let low = tail(0.297_11 / 4.0, 4.0).expect("a tail");
        let high = tail(11.143_29 / 4.0, 4.0).expect("a tail");
        assert!((low - 0.01).abs() < 1e-5 && (high - 0.025).abs() < 1e-5, "{low}, {high}");
    }
}
