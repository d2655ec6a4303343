//! A model whose white level and one of whose lines may differ from epoch to epoch.

use super::{SIGNIFICANCE, chi_square_tail};
use allan_core::confidence::octave_correlation;
use allan_core::model::FittedTerm;
use allan_core::term::{Resonance, Sinusoid};
use allan_core::{AllanPoint, Curve, Model, NoiseTerm};

/// What can move.
pub const STATES: usize = 2;
/// Farthest that a line is looked for from where it is on average, in ln f.
const FARTHEST: f64 = 0.3;
/// Farthest that a level is looked for, in ln s²: a factor of about 20.
pub const FARTHEST_LEVEL: f64 = 3.0;
/// Widest line, as a part of its frequency; what is wider is a colour of the noise.
const WIDEST: f64 = 0.25;
/// Largest standard deviation of ln f in an epoch of a line that can be followed.
const LEAST_CERTAIN: f64 = 0.02;
/// Distance of the first guesses.
const GUESSES: f64 = 0.02;

/// What an epoch differs by from the model, or by how much that is uncertain: ln of the variance of the white level, and
/// ln of the line's frequency.
pub type State = [f64; STATES];

/// A model with what may move in it.
#[derive(Debug, Clone, PartialEq)]
pub struct Moving {
    model: Model,
    line: Option<usize>,
}

/// An epoch's state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Where the epoch's curve is likeliest.
    pub state: State,
    /// Standard deviations.
    pub error: State,
    /// `Σ edf·(ln(m/v) + v/m − 1)` there.
    pub deviance: f64,
    /// What chance lowers the deviance by on average with the last thing that was set free.
    scatter: f64,
}

/// What is set free.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Free {
    /// Nothing.
    Nothing,
    /// The level of the white noise.
    Level,
    /// The level and the frequency of the line.
    LevelAndLine,
}

/// Whether something moves among the epochs of the fitted half.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Evidence {
    /// How much the deviance falls for each epoch, in units of what chance would do.
    pub gain: f64,
    /// Chance of as much if nothing moves.
    pub p_value: f64,
}

impl Moving {
    /// A model none of whose lines moves.
    #[must_use]
    pub fn still(model: Model) -> Self {
        Self { model, line: None }
    }

    /// `model` with the one of its lines that moves most clearly among `epochs`, if one does, and the evidence.
    #[must_use]
    pub fn of<const POINTS: usize>(model: Model, epochs: &[Curve<POINTS>]) -> (Self, Option<Evidence>) {
        let is_line = |term: &FittedTerm| match term.kind {
            NoiseTerm::Sinusoid(_) => term.value > 0.0,
            NoiseTerm::Resonance(line) => term.value > 0.0 && line.bandwidth < WIDEST * line.frequency,
            _ => false,
        };
        let lines: Vec<usize> = (0..model.terms().len()).filter(|&at| is_line(&model.terms()[at])).collect();
        let followable = |line: &usize| {
            let moving = Self { model: model.clone(), line: Some(*line) };
            let mut errors: Vec<f64> =
                epochs.iter().map(|epoch| moving.estimate(epoch, Free::LevelAndLine).error[1]).collect();
            errors.sort_by(f64::total_cmp);
            errors.get(errors.len() / 2).is_some_and(|&median| median < LEAST_CERTAIN)
        };
        let tried = lines.iter().copied().filter(followable).map(|line| {
            let moving = Self { model: model.clone(), line: Some(line) };
            let evidence = moving.evidence(epochs, Free::Level, Free::LevelAndLine);
            (moving, Evidence { p_value: (evidence.p_value * lines.len() as f64).min(1.0), ..evidence })
        });
        let clearest = tried.min_by(|a, b| a.1.p_value.total_cmp(&b.1.p_value).then(b.1.gain.total_cmp(&a.1.gain)));
        match clearest {
            Some((moving, evidence)) if evidence.p_value < SIGNIFICANCE => (moving, Some(evidence)),
            clearest => (Self::still(model), clearest.map(|(_, evidence)| evidence)),
        }
    }

    /// The model that does not move.
    #[must_use]
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Frequency of the line that moves, Hz.
    #[must_use]
    pub fn line_frequency(&self) -> Option<f64> {
        self.line.map(|line| self.model.terms()[line].kind.shape()[0].1)
    }

    /// What moves at most.
    #[must_use]
    pub fn free(&self) -> Free {
        if self.line.is_some() { Free::LevelAndLine } else { Free::Level }
    }

    /// The model in a state.
    #[must_use]
    pub fn at(&self, [level, line]: State) -> Model {
        let moved = |(at, term): (usize, &FittedTerm)| {
            let mut term = *term;
            if matches!(term.kind, NoiseTerm::AngleRandomWalk | NoiseTerm::Filtered(_)) {
                term.value *= (level / 2.0).exp();
            }
            if self.line == Some(at) {
                term.kind = shifted(term.kind, line.exp());
            }
            term
        };
        Model::new(self.model.sample_period(), self.model.terms().iter().enumerate().map(moved))
    }

    /// The model in a state, with a line of another width and amplitude, whose logarithms change by so much.
    pub fn along(&self, level: f64, line: f64, width: f64, amplitude: f64) -> Model {
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

    /// Whether `more` describes the epochs better than `fewer` by more than chance.
    ///
    /// Without a movement each epoch's deviance falls by χ² of one degree of freedom times its scatter.
    #[must_use]
    pub fn evidence<const POINTS: usize>(&self, epochs: &[Curve<POINTS>], fewer: Free, more: Free) -> Evidence {
        let fall = |epoch: &Curve<POINTS>| {
            let free = self.estimate(epoch, more);
            (self.estimate(epoch, fewer).deviance - free.deviance) / free.scatter
        };
        let sum: f64 = epochs.iter().map(fall).sum();
        let count = epochs.len() as f64;
        Evidence { gain: sum / count, p_value: chi_square_tail(sum, count) }
    }

    /// The state of an epoch.
    #[must_use]
    pub fn estimate<const POINTS: usize>(&self, epoch: &Curve<POINTS>, free: Free) -> Estimate {
        let points: Vec<(&AllanPoint, f64)> = epoch
            .points()
            .iter()
            .filter(|point| point.n <= epoch.samples() / 8 && point.avar > 0.0)
            .map(|point| (point, self.model.edf(point)))
            .collect();
        // The level scales what the white noise adds to the rest.
        let avars = |state: State| -> Vec<f64> {
            let model = self.at(state);
            points.iter().map(|(point, _)| model.avar(point.n)).collect()
        };
        let white: Vec<f64> =
            avars([2f64.ln(), 0.0]).iter().zip(avars([0.0; 2])).map(|(twice, once)| twice - once).collect();
        let deviance = |level: f64, avars: &[f64]| {
            let more = level.exp() - 1.0;
            let modelled = avars.iter().zip(&white).map(|(all, white)| all + more * white);
            let of = |((point, edf), modelled): (&(&AllanPoint, f64), f64)| {
                let ratio = point.avar / modelled;
                edf * (ratio - 1.0 - ratio.ln())
            };
            points.iter().zip(modelled).map(of).sum::<f64>()
        };
        let best_level = |avars: &[f64]| least(|level| deviance(level, avars), 0.0, 0.05, FARTHEST_LEVEL);
        let at_line = |line: f64| {
            let avars = avars([0.0, line]);
            let level = best_level(&avars);
            (level, deviance(level, &avars))
        };
        let state = match free {
            Free::Nothing => [0.0, 0.0],
            Free::Level => [at_line(0.0).0, 0.0],
            Free::LevelAndLine => {
                let most = (FARTHEST / GUESSES) as i32;
                let guesses = (-most..=most).map(|k| f64::from(k) * GUESSES).map(|line| (line, at_line(line).1));
                let guess = guesses.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0.0, |(line, _)| line);
                let line = least(|line| at_line(line).1, guess, GUESSES / 2.0, FARTHEST);
                [at_line(line).0, line]
            }
        };
        let (error, scatter) = self.uncertainty(&points, state, free);
        Estimate { state, error, deviance: deviance(state[0], &avars([0.0, state[1]])), scatter }
    }

    /// Standard deviations by the sandwich `H⁻¹·S·H⁻¹`, and how much likelier chance moves the points along the last
    /// state than if they were independent.
    fn uncertainty(&self, points: &[(&AllanPoint, f64)], state: State, free: Free) -> (State, f64) {
        const STEP: f64 = 1e-3;
        let slope = |index: usize, point: &AllanPoint| {
            let at = |step: f64| {
                let mut moved = state;
                moved[index] += step;
                self.at(moved).avar(point.n).ln()
            };
            (at(STEP) - at(-STEP)) / (2.0 * STEP)
        };
        // In standard deviations of each point.
        let tangent = |index: usize| -> Vec<f64> {
            points.iter().map(|(point, edf)| (edf / 2.0).sqrt() * slope(index, point)).collect()
        };
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let spread = |along: &[f64]| -> f64 {
            let mut sum = 0.0;
            for (i, (a, _)) in points.iter().enumerate() {
                for (j, (b, _)) in points.iter().enumerate() {
                    let (a, b) = (self.model.variance_fractions(a.n), self.model.variance_fractions(b.n));
                    sum += along[i] * along[j] * octave_correlation(i.abs_diff(j), a, b);
                }
            }
            sum
        };
        let without = |vector: Vec<f64>, other: &[f64]| -> Vec<f64> {
            let along = dot(&vector, other) / dot(other, other);
            vector.iter().zip(other).map(|(entry, other)| entry - along * other).collect()
        };
        let error = |rest: &[f64]| spread(rest).sqrt() / dot(rest, rest);
        match free {
            Free::Nothing => ([0.0, 0.0], 1.0),
            Free::Level => {
                let level = tangent(0);
                ([error(&level), 0.0], (spread(&level) / dot(&level, &level)).max(1.0))
            }
            Free::LevelAndLine => {
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

/// Where `of` is least near `start`, at most `farthest` from 0: downhill in growing steps, then by the golden section.
pub fn least(of: impl Fn(f64) -> f64, start: f64, step: f64, farthest: f64) -> f64 {
    const GOLDEN: f64 = 0.618_033_988_749_895;
    let mut step = if of(start + step) < of(start - step) { step } else { -step };
    let (mut behind, mut here, mut value) = (start - step, start, of(start));
    for _ in 0..40 {
        let next = of(here + step);
        if next >= value || (here + step).abs() > farthest {
            break;
        }
        (behind, here, value) = (here, here + step, next);
        step *= 1.5;
    }
    let (mut low, mut high) = if step > 0.0 { (behind, here + step) } else { (here + step, behind) };
    while high - low > 1e-5 {
        let (a, b) = (high - GOLDEN * (high - low), low + GOLDEN * (high - low));
        if of(a) < of(b) { high = b } else { low = a }
    }
    (low + high) / 2.0
}
