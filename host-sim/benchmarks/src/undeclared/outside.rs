//! Effects outside the vocabulary of the report: no kind that it has a name for describes them, so that a wrong name is the only
//! name that it can give, and `unexplained` the right answer.

use super::environment::{EnvironmentCourse, log_uniform};
use crate::spectral_noise::normal;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Exp1};
use serde::Serialize;
use std::f64::consts::TAU;
use virtual_sensor::OutputRegister;

/// Kinds of effects that no kind of the report describes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum OutsideKind {
    /// A sinusoid whose frequency rises linearly over the record.
    Chirp,
    /// Disturbances at random times, each a jump that decays exponentially.
    Decays,
    /// A rise and a sudden fall, again and again: a thermostat.
    Sawtooth,
    /// A line whose amplitude swells and fades by half.
    ModulatedLine,
    /// White noise whose standard deviation grows with the temperature.
    LevelByTemperature,
}

impl OutsideKind {
    /// Every kind, in the order of the tables.
    pub const ALL: [Self; 5] =
        [Self::Chirp, Self::Decays, Self::Sawtooth, Self::ModulatedLine, Self::LevelByTemperature];

    /// Its name in the tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Chirp => "chirp",
            Self::Decays => "decays",
            Self::Sawtooth => "sawtooth",
            Self::ModulatedLine => "modulated line",
            Self::LevelByTemperature => "level by temp.",
        }
    }
}

/// An effect outside the vocabulary, in one channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OutsideEffect {
    pub(super) kind: OutsideKind,
    pub(super) channel: OutputRegister,
    /// In the unit of the channel: the amplitude, the height of a jump, or the standard deviation at the highest temperature.
    pub(super) size: f64,
    /// Of the sweep its first and its last frequency, of the others the frequency at which they repeat and that of the
    /// modulation, Hz; of decays one over the mean time between them and one over their time constant.
    pub(super) frequencies_hz: [f64; 2],
    /// Of the random numbers that the effect itself has.
    pub(super) seed: u64,
}

impl OutsideEffect {
    /// Its kind.
    pub(super) fn kind(&self) -> OutsideKind {
        self.kind
    }

    /// The output that it is in.
    pub(super) fn channel(&self) -> OutputRegister {
        self.channel
    }

    /// With random parameters, of size 1.
    pub(super) fn draw_unit(kind: OutsideKind, channel: OutputRegister, seconds: f64, random: &mut ChaCha8Rng) -> Self {
        let frequencies_hz = match kind {
            OutsideKind::Chirp => {
                let first = log_uniform(random, 1.0, 10.0);
                [first, first * log_uniform(random, 2.0, 5.0)]
            }
            // Ten to forty in a record, each of a fiftieth to a fifth of the time between them.
            OutsideKind::Decays => {
                let rate = log_uniform(random, 10.0, 40.0) / seconds;
                [rate, rate * log_uniform(random, 5.0, 50.0)]
            }
            OutsideKind::Sawtooth => [log_uniform(random, 4.0, 20.0) / seconds, 0.0],
            OutsideKind::ModulatedLine => [log_uniform(random, 2.0, 40.0), log_uniform(random, 3.0, 30.0) / seconds],
            OutsideKind::LevelByTemperature => [0.0; 2],
        };
        Self { kind, channel, size: 1.0, frequencies_hz, seed: random.random() }
    }

    /// What it adds to each sample of its channel.
    pub(super) fn signal(&self, environment: &EnvironmentCourse, samples: usize, period_s: f64) -> Vec<f64> {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        let (size, [first, second]) = (self.size, self.frequencies_hz);
        let seconds = samples as f64 * period_s;
        let signal = |value: &mut dyn FnMut(f64) -> f64| {
            (0..samples).map(|at| size * value(at as f64 * period_s)).collect::<Vec<f64>>()
        };
        match self.kind {
            OutsideKind::Chirp => {
                signal(&mut |time_s| (TAU * (first + 0.5 * (second - first) * time_s / seconds) * time_s).sin())
            }
            OutsideKind::Decays => {
                let mut wait = || <Exp1 as Distribution<f64>>::sample(&Exp1, &mut random) / first;
                let (mut next_s, mut height) = (wait(), 0.0);
                let kept = (-period_s * second).exp();
                signal(&mut |time_s| {
                    height *= kept;
                    while next_s <= time_s {
                        height += 1.0;
                        next_s += wait();
                    }
                    height
                })
            }
            OutsideKind::Sawtooth => signal(&mut |time_s| (first * time_s).fract() - 0.5),
            OutsideKind::ModulatedLine => {
                signal(&mut |time_s| (TAU * first * time_s).sin() * (1.0 + 0.5 * (TAU * second * time_s).sin()))
            }
            OutsideKind::LevelByTemperature => {
                let levels = relative(&environment.temperature_c);
                levels.take(samples).map(|level| size * level * normal(&mut random)).collect()
            }
        }
    }
}

/// A course over time from 0 at its lowest to 1 at its highest.
pub(super) fn relative(course: &[f64]) -> impl Iterator<Item = f64> + '_ {
    let lowest = course.iter().copied().fold(f64::INFINITY, f64::min);
    let highest = course.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    course.iter().map(move |value| (value - lowest) / (highest - lowest).max(f64::MIN_POSITIVE))
}
