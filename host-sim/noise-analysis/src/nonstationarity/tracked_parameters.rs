//! A model whose white noise, and one of whose lines, may change between epochs.

use super::epochs::{ComparedCurve, SIGNIFICANCE};
use crate::OCTAVES;
use crate::distributions::chi_squared_tail;
use crate::fit::noise_terms::is_white;
use crate::minimum::downhill;
use allan_core::confidence::octave_correlation;
use allan_core::model::FittedTerm;
use allan_core::term::{Resonance, Shape, Sinusoid};
use allan_core::{AllanPoint, Curve, Model, NoiseTerm};
use serde::Serialize;

pub(crate) const PARAMETERS: usize = 2;
/// Accuracy of ln of a parameter.
const ACCURACY: f64 = 1e-5;
/// Largest change of a line's frequency, in ln f.
const MAX_LINE: f64 = 0.3;
/// Largest change of the level, in ln of the variance.
pub(crate) const MAX_LEVEL: f64 = 3.0;
/// Largest relative bandwidth of a tracked line.
const MAX_BANDWIDTH: f64 = 0.25;
/// Largest median over the epochs of the standard deviation of ln f of a tracked line.
const MAX_LINE_ERROR: f64 = 0.02;
/// Spacing in ln f of the starting points of the search.
const GUESS_STEP: f64 = 0.02;

/// Differences of an epoch from the model, or their errors: ln of the white variance, ln of the line's frequency.
pub(crate) type ParameterVector = [f64; PARAMETERS];

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct TrackedModel {
    model: Model,
    line: Option<usize>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct EpochEstimate {
    pub parameters: ParameterVector,
    pub error: ParameterVector,
    /// `Σ edf·(ln(m/v) + v/m − 1)` there.
    pub deviance: f64,
    /// Mean decrease of the deviance by chance with the last free parameter.
    scatter: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TrackedSet {
    Nothing,
    Level,
    LevelAndLine,
}

/// Test of a change of a parameter among the epochs of the first half.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct MovementTest {
    /// Mean decrease of an epoch's deviance over that by chance.
    pub gain: f64,
    /// Probability of as much without a change.
    pub p_value: f64,
}

impl TrackedModel {
    pub(crate) fn without_line(model: Model) -> Self {
        Self { model, line: None }
    }

    /// `model` with the one of its lines that moves most clearly among `epochs`, if one does, and the test of that line.
    pub(crate) fn select_line(model: Model, epochs: &[Curve<OCTAVES>]) -> (Self, Option<MovementTest>) {
        let is_line = |term: &FittedTerm| match term.kind {
            NoiseTerm::Sinusoid(_) => term.value > 0.0,
            NoiseTerm::Resonance(line) => term.value > 0.0 && line.bandwidth < MAX_BANDWIDTH * line.frequency,
            _ => false,
        };
        let lines: Vec<usize> = (0..model.terms().len()).filter(|&at| is_line(&model.terms()[at])).collect();
        let is_trackable = |line: &usize| {
            let tracked = Self { model: model.clone(), line: Some(*line) };
            let mut errors: Vec<f64> =
                epochs.iter().map(|epoch| tracked.estimate(epoch, TrackedSet::LevelAndLine).error[1]).collect();
            errors.sort_by(f64::total_cmp);
            errors.get(errors.len() / 2).is_some_and(|&median| median < MAX_LINE_ERROR)
        };
        let tried = lines.iter().copied().filter(is_trackable).map(|line| {
            let tracked = Self { model: model.clone(), line: Some(line) };
            let test = tracked.test_movement(epochs, TrackedSet::Level, TrackedSet::LevelAndLine);
            (tracked, MovementTest { p_value: (test.p_value * lines.len() as f64).min(1.0), ..test })
        });
        let clearest = tried.min_by(|a, b| a.1.p_value.total_cmp(&b.1.p_value).then(b.1.gain.total_cmp(&a.1.gain)));
        match clearest {
            Some((tracked, test)) if test.p_value < SIGNIFICANCE => (tracked, Some(test)),
            clearest => (Self::without_line(model), clearest.map(|(_, test)| test)),
        }
    }

    /// The model with all parameters at their means.
    pub(crate) fn model(&self) -> &Model {
        &self.model
    }

    /// Mean frequency of the line that is tracked, Hz.
    pub(crate) fn line_frequency(&self) -> Option<f64> {
        match self.model.terms()[self.line?].kind.shape() {
            Shape::Resonance { frequency, .. } | Shape::Sinusoid { frequency } => Some(frequency),
            _ => None,
        }
    }

    pub(crate) fn largest_set(&self) -> TrackedSet {
        if self.line.is_some() { TrackedSet::LevelAndLine } else { TrackedSet::Level }
    }

    /// The model with the parameters of an epoch.
    pub(crate) fn at(&self, [level, line]: ParameterVector) -> Model {
        let moved = |(at, term): (usize, &FittedTerm)| {
            let mut term = *term;
            if is_white(&term.kind) {
                term.value *= (level / 2.0).exp();
            }
            if self.line == Some(at) {
                term.kind = shifted(term.kind, line.exp());
            }
            term
        };
        Model::new(self.model.sample_period(), self.model.terms().iter().enumerate().map(moved))
    }

    /// The model with an epoch's parameters, and changes of ln width and ln amplitude of the line.
    pub(crate) fn with_line_shape(&self, level: f64, line: f64, width: f64, amplitude: f64) -> Model {
        let moved = self.at([level, line]);
        let changed = |(at, term): (usize, &FittedTerm)| {
            let mut term = *term;
            if self.line == Some(at) {
                term.value *= amplitude.exp();
                if let NoiseTerm::Resonance(line) = term.kind {
                    term.kind = NoiseTerm::Resonance(Resonance { bandwidth: line.bandwidth * width.exp(), ..line });
                }
            }
            term
        };
        Model::new(moved.sample_period(), moved.terms().iter().enumerate().map(changed))
    }

    /// Tests whether the epochs need the parameters `more`, which are one more than `fewer`.
    ///
    /// If that parameter does not move, each epoch's deviance decreases by χ² of one degree of freedom times its scatter.
    pub(crate) fn test_movement(&self, epochs: &[Curve<OCTAVES>], fewer: TrackedSet, more: TrackedSet) -> MovementTest {
        let decrease = |epoch: &Curve<OCTAVES>| {
            let estimate = self.estimate(epoch, more);
            (self.estimate(epoch, fewer).deviance - estimate.deviance) / estimate.scatter
        };
        let sum: f64 = epochs.iter().map(decrease).sum();
        let count = epochs.len() as f64;
        MovementTest { gain: sum / count, p_value: chi_squared_tail(sum, count) }
    }

    /// The parameters of an epoch; those that are not in `tracked` are 0.
    pub(crate) fn estimate(&self, epoch: &Curve<OCTAVES>, tracked: TrackedSet) -> EpochEstimate {
        let epoch = ComparedCurve::new(epoch, &self.model);
        let avars = |parameters: ParameterVector| -> Vec<f64> {
            let model = self.at(parameters);
            epoch.points().iter().map(|(point, _)| model.avar(point.n)).collect()
        };
        // White Allan variance: the difference by doubling it.
        let white: Vec<f64> =
            avars([2f64.ln(), 0.0]).iter().zip(avars([0.0; 2])).map(|(twice, once)| twice - once).collect();
        let deviance = |level: f64, avars: &[f64]| {
            let added = level.exp() - 1.0;
            epoch.deviance(avars.iter().zip(&white).map(|(all, white)| all + added * white))
        };
        let best_level = |avars: &[f64]| minimum(|level| deviance(level, avars), 0.0, 0.05, MAX_LEVEL);
        let at_line = |line: f64| {
            let avars = avars([0.0, line]);
            let level = best_level(&avars);
            (level, deviance(level, &avars))
        };
        let parameters = match tracked {
            TrackedSet::Nothing => [0.0, 0.0],
            TrackedSet::Level => [at_line(0.0).0, 0.0],
            TrackedSet::LevelAndLine => {
                let most = (MAX_LINE / GUESS_STEP) as i32;
                let guesses = (-most..=most).map(|k| f64::from(k) * GUESS_STEP).map(|line| (line, at_line(line).1));
                let guess = guesses.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0.0, |(line, _)| line);
                let line = minimum(|line| at_line(line).1, guess, GUESS_STEP / 2.0, MAX_LINE);
                [at_line(line).0, line]
            }
        };
        let (error, scatter) = self.uncertainty(epoch.points(), parameters, tracked);
        let deviance = deviance(parameters[0], &avars([0.0, parameters[1]]));
        EpochEstimate { parameters, error, deviance, scatter }
    }

    /// Sandwich estimator `H⁻¹·S·H⁻¹`: standard deviations, and the factor by correlated points on the last variance.
    fn uncertainty(
        &self,
        points: &[(AllanPoint, f64)],
        parameters: ParameterVector,
        tracked: TrackedSet,
    ) -> (ParameterVector, f64) {
        const STEP: f64 = 1e-3;
        let slope = |index: usize, point: &AllanPoint| {
            let at = |step: f64| {
                let mut moved = parameters;
                moved[index] += step;
                self.at(moved).avar(point.n).ln()
            };
            (at(STEP) - at(-STEP)) / (2.0 * STEP)
        };
        let tangent = |index: usize| -> Vec<f64> {
            points.iter().map(|(point, edf)| (edf / 2.0).sqrt() * slope(index, point)).collect()
        };
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let fractions: Vec<_> = points.iter().map(|(point, _)| self.model.variance_fractions(point.n)).collect();
        let spread = |along: &[f64]| -> f64 {
            let mut sum = 0.0;
            for (i, a) in fractions.iter().enumerate() {
                for (j, b) in fractions.iter().enumerate() {
                    sum += along[i] * along[j] * octave_correlation(i.abs_diff(j), *a, *b);
                }
            }
            sum
        };
        let without = |vector: Vec<f64>, other: &[f64]| -> Vec<f64> {
            let along = dot(&vector, other) / dot(other, other);
            vector.iter().zip(other).map(|(entry, other)| entry - along * other).collect()
        };
        let error = |rest: &[f64]| spread(rest).sqrt() / dot(rest, rest);
        match tracked {
            TrackedSet::Nothing => ([0.0, 0.0], 1.0),
            TrackedSet::Level => {
                let level = tangent(0);
                ([error(&level), 0.0], (spread(&level) / dot(&level, &level)).max(1.0))
            }
            TrackedSet::LevelAndLine => {
                let (level, line) = (tangent(0), tangent(1));
                let (level_rest, line_rest) = (without(level.clone(), &line), without(line, &level));
                let scatter = spread(&line_rest) / dot(&line_rest, &line_rest);
                ([error(&level_rest), error(&line_rest)], scatter.max(1.0))
            }
        }
    }
}

fn shifted(kind: NoiseTerm, factor: f64) -> NoiseTerm {
    match kind {
        NoiseTerm::Sinusoid(line) => NoiseTerm::Sinusoid(Sinusoid { frequency: line.frequency * factor }),
        NoiseTerm::Resonance(line) => NoiseTerm::Resonance(Resonance { frequency: line.frequency * factor, ..line }),
        other => other,
    }
}

/// Argument within ±`farthest` at which `of` is least near `start`.
pub(crate) fn minimum(of: impl Fn(f64) -> f64, start: f64, step: f64, farthest: f64) -> f64 {
    downhill(of, (start, step), farthest, ACCURACY)
}
