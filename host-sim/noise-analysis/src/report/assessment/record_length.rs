//! The length to record: the standard error of a coefficient by the length of the record.

use allan_core::confidence::NORMAL_975;
use allan_core::model::FittedTerm;
use allan_core::{Model, NoiseTerm};
use nalgebra::{DMatrix, DVector};

/// Relative half-width of the 95 % bounds that is required.
pub const REQUIRED_HALF_WIDTH: f64 = 0.2;
/// Longest record that is recommended, s: 30 days.
const LONGEST_S: f64 = 30.0 * 86_400.0;

/// Record length, s, at least `duration`, at which the coefficient at position `term` has bounds within ±[`REQUIRED_HALF_WIDTH`].
///
/// By [`relative_error`], times the factor by which the bounds that the fit gave for `duration` s are wider, if they are.
/// The bounds of a sinusoid or a ramp, which have no density, narrow at least with the square root of the length.
/// `None` for a term that the data does not show, or where more than 30 days are required.
#[must_use]
pub fn required_length(model: &Model, term: usize, duration: f64) -> Option<f64> {
    let present = model.terms().get(term).filter(|term| term.value > 0.0 && term.low > 0.0)?;
    let today = (present.high - present.low) / 2.0 / present.value;
    if !has_density(&present) {
        let length = duration * (today / REQUIRED_HALF_WIDTH).powi(2).max(1.0);
        return (length <= LONGEST_S).then_some(length);
    }
    let inefficiency = (today / (NORMAL_975 * relative_error(model, term, duration)?)).max(1.0);
    let width = |length: f64| relative_error(model, term, length).map(|error| NORMAL_975 * inefficiency * error);
    let mut length = duration;
    while width(length)? > REQUIRED_HALF_WIDTH {
        length *= 1.05;
        if length > LONGEST_S {
            return None;
        }
    }
    Some(length)
}

/// Smallest relative standard deviation of the coefficient at position `term` of `model` that is estimated together with the
/// others from `duration` s of samples, by Whittle's information; `None` for a term of 0 or without a density.
///
/// Sinusoids and ramps take a few ordinates of the spectrum from the others, which is neglected.
#[must_use]
pub fn relative_error(model: &Model, term: usize, duration: f64) -> Option<f64> {
    let present: Vec<&FittedTerm> = model.terms().iter().filter(|term| term.value > 0.0).filter(has_density).collect();
    let position = present.iter().position(|of| std::ptr::eq(*of, &model.terms()[term]))?;
    let period = model.sample_period();
    let mut information = DMatrix::zeros(present.len(), present.len());
    // One ordinate of a single degree of freedom in every half resolution, summed over bands of growing width.
    let ordinates = (duration / period) as usize;
    let mut first = 1;
    while first < ordinates {
        let count = (first / 16).clamp(1, ordinates - first);
        let frequency = (first as f64 + (count - 1) as f64 / 2.0) / (2.0 * duration);
        let density = |term: &&FittedTerm| model.part_of_density(term, frequency);
        let densities = DVector::from_iterator(present.len(), present.iter().map(density));
        let total = densities.sum();
        if total > 0.0 {
            let shares = densities / total;
            information += count as f64 / 2.0 * &shares * shares.transpose();
        }
        first += count;
    }
    // The information is that of the squared coefficient, whose relative error is twice that of the coefficient.
    Some(information.cholesky()?.inverse()[(position, position)].sqrt() / 2.0)
}

/// True if a term is noise, with a density: not a sinusoid or a ramp.
fn has_density(term: &&FittedTerm) -> bool {
    !matches!(term.kind, NoiseTerm::Sinusoid(_) | NoiseTerm::RateRamp)
}

#[cfg(test)]
mod tests {
    use super::*;
    use allan_core::term::Sinusoid;

    fn model(n: f64, k: f64) -> Model {
        let terms = [FittedTerm::exact(NoiseTerm::AngleRandomWalk, n), FittedTerm::exact(NoiseTerm::RateRandomWalk, k)];
        Model::new(0.01, terms.map(|term| term.with_bounds(0.9 * term.value, 1.1 * term.value)))
    }

    #[test]
    fn errors_of_white_noise_and_of_a_random_walk_are_the_known_ones() {
        // N alone: 1/√(2M) of M samples.
        let error = relative_error(&model(2e-3, 0.0), 0, 1e4).expect("an error");
        assert!((error / (1.0 / 2e6f64.sqrt()) - 1.0).abs() < 1e-3, "{error}");
        // N and K: the walk passes the white noise at K/(2πN), 27.6 resolutions; ½·Σ 1/(1 + (j/55.1)²)² over half
        // resolutions is 55.1·π/8 − ¼ = 21.4, of K², and N costs little.
        let error = relative_error(&model(2e-3, 3.464e-5), 1, 1e4).expect("an error");
        assert!((error / (0.5 / 21.4f64.sqrt()) - 1.0).abs() < 0.02, "{error}");
    }

    /// A line takes nothing from what the record says of N and K. Its own bounds of ±30 % are ±20 % after 1.5² times as long.
    #[test]
    fn a_model_with_a_sinusoid_has_lengths_as_well() {
        let noise = model(2e-3, 3.464e-5);
        let sinusoid = NoiseTerm::Sinusoid(Sinusoid { frequency: 20.0 });
        let line = FittedTerm::exact(sinusoid, 1e-3).with_bounds(0.7e-3, 1.3e-3);
        let with_line = Model::new(0.01, noise.terms().iter().copied().chain([line]));
        for term in 0..2 {
            assert_eq!(required_length(&with_line, term, 1e4), required_length(&noise, term, 1e4));
        }
        let length = required_length(&with_line, 2, 1e4).expect("a length");
        assert!((length / 2.25e4 - 1.0).abs() < 1e-9, "{length}");
    }

    #[test]
    fn the_required_length_follows_from_the_error_of_today() {
        let model = model(2e-3, 3.464e-5);
        // 1.96·10.8 % at 1e4 s is 21.2 %: 12.5 % longer is enough.
        let length = required_length(&model, 1, 1e4).expect("a length");
        assert!((1.0e4..1.25e4).contains(&length), "{length}");
        // The white noise is known well enough; a walk of 0, or of far less than the white noise, cannot be.
        assert_eq!(required_length(&model, 0, 1e4), Some(1e4));
        assert_eq!(required_length(&self::model(2e-3, 0.0), 1, 1e4), None);
        assert_eq!(required_length(&self::model(2e-3, 1e-9), 1, 1e4), None);
    }
}
