//! Whether the two quarters of the fitted half have the same noise.

use super::SIGNIFICANCE;
use allan_core::{AllanPoint, Curve, Model};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

/// The octave at which two stretches of a channel differ most.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stationarity {
    /// Averaging factor, samples.
    pub n: u64,
    /// Allan variance of the later stretch over that of the earlier one.
    pub ratio: f64,
    /// Chance that stretches of the same noise differ as clearly at any octave.
    pub p_value: f64,
}

impl Stationarity {
    /// Whether the noise moves, by all that can be told.
    #[must_use]
    pub fn moves(&self) -> bool {
        self.p_value < SIGNIFICANCE
    }
}

/// Compares two stretches octave by octave, up to an eighth of the shorter one.
///
/// The ratio of two variances of the same noise has Fisher's law with their degrees of freedom, which `model` tells: one
/// that describes both stretches together. The chance is that of the clearest octave times their number (Bonferroni),
/// which is right whatever the correlation of the octaves. `None` where no octave can be compared.
#[must_use]
pub fn stationarity<const POINTS: usize>(
    earlier: &Curve<POINTS>,
    later: &Curve<POINTS>,
    model: &Model,
) -> Option<Stationarity> {
    let longest = earlier.samples().min(later.samples()) / 8;
    let compare = |(before, after): (&AllanPoint, &AllanPoint)| {
        let ratio = after.avar / before.avar;
        let law = FisherSnedecor::new(model.edf(after), model.edf(before)).ok()?;
        let p_value = (2.0 * law.cdf(ratio).min(law.sf(ratio))).min(1.0);
        ratio.is_finite().then_some(Stationarity { n: before.n, ratio, p_value })
    };
    let pairs = earlier.points().iter().zip(later.points()).filter(|(point, _)| point.n <= longest);
    let octaves: Vec<Stationarity> = pairs.filter_map(compare).collect();
    let clearest = octaves.iter().min_by(|a, b| a.p_value.total_cmp(&b.p_value))?;
    Some(Stationarity { p_value: (clearest.p_value * octaves.len() as f64).min(1.0), ..*clearest })
}

/// What of the fitted half foretells best what comes after it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// All of it.
    FittedHalf,
    /// Its later half: the noise moves, and what is nearer in time is likelier to last.
    LatestQuarter,
}

/// Which part a model should be fitted to that is to foretell the unseen half. Looks at the fitted half alone.
#[must_use]
pub fn predictive_part(stationarity: Option<Stationarity>) -> Part {
    match stationarity {
        Some(found) if found.moves() => Part::LatestQuarter,
        _ => Part::FittedHalf,
    }
}
