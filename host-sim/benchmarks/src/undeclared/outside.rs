//! Effects outside the vocabulary. The right names are `unexplained` and those of [`OutsideKind::right_names`].

use super::environment::{EnvironmentCourse, frequency_factor, gauss_markov, log_uniform};
use crate::spectral_noise::normal;
use clap::ValueEnum;
use noise_analysis::report::Effect;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Exp1};
use serde::Serialize;
use std::f64::consts::{PI, TAU};
use virtual_sensor::OutputRegister;

/// Standard deviation of the level's logarithm: a factor of 2.
const LEVEL_DEVIATION: f64 = std::f64::consts::LN_2;
/// Decay time of a knock, s; below a hundredth after half a second.
const KNOCK_DECAY_S: f64 = 0.1;
const FEWEST_DROOPS: f64 = 6.0;

/// Kinds of effects outside the vocabulary of the analysis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, ValueEnum, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum OutsideKind {
    /// A sinusoid whose frequency is linear in time over the record.
    Chirp,
    /// Random jumps that decay exponentially (shot noise).
    Decays,
    /// A repeated rise and sudden fall.
    Sawtooth,
    /// A line whose amplitude rises and falls by half.
    ModulatedLine,
    /// White noise that grows with the temperature.
    LevelByTemperature,
    /// One channel that is stuck for a while (E. Balaban et al., IEEE Sensors J. 9, 2009).
    HeldValue,
    /// An offset of every second sample (N. Kurosawa et al., IEEE Trans. Circuits Syst. I 48, 2001).
    AlternatingConverters,
    /// One change of the sample clock.
    ClockStep,
    /// An exponential approach after the start that the thermometer does not show.
    SelfHeating,
    /// Constant outputs after an overload, repeatedly (IEEE Std 1241).
    DeadTime,
    /// Regular short drops of the supply that its output does not show.
    SupplyDroop,
    SwitchedLine,
    /// Missing codes at carries (IEEE Std 1241).
    MissingCodes,
    /// A vibration with a varying level.
    WanderingBand,
    /// A damped oscillation of half a second in all six channels.
    Knock,
}

impl OutsideKind {
    pub const fn right_names(self) -> &'static [&'static str] {
        match self {
            Self::Chirp => &["chirp"],
            Self::Decays => &["shot_noise"],
            Self::Sawtooth | Self::SupplyDroop => &["periodic"],
            Self::ModulatedLine | Self::SwitchedLine => &["modulated_line"],
            Self::LevelByTemperature => &["level_change", "wandering_level"],
            Self::HeldValue | Self::DeadTime => &["stuck"],
            // It is a line at half the sample rate.
            Self::AlternatingConverters => &["sinusoid", "periodic"],
            Self::ClockStep => &["sample_clock"],
            Self::MissingCodes => &["missing_codes"],
            Self::SelfHeating => &["turn_on_transient"],
            Self::WanderingBand => &["resonance"],
            Self::Knock => &["knock", "motion"],
        }
    }
}

#[derive(Debug, Clone, PartialEq)]
pub struct OutsideEffect {
    pub(super) kind: OutsideKind,
    /// The outputs with their factors on the size; empty for the sample clock.
    pub(super) shares: Vec<(OutputRegister, f64)>,
    /// Size in the channel's unit; in s for a held value and a dead time; relative for a clock step.
    pub(super) size: f64,
    /// Frequencies, Hz: first and last of a sweep; or repetition and modulation; or 1/interval and 1/time constant of
    /// random events; or centre and width of a band. For missing codes 1/modulus.
    pub(super) frequencies_hz: [f64; 2],
    /// Onset, s from the first sample, and time constant or length, s.
    pub(super) times_s: [f64; 2],
    pub(super) seed: u64,
}

impl OutsideEffect {
    pub(super) fn kind(&self) -> OutsideKind {
        self.kind
    }

    pub(super) fn channels(&self) -> impl Iterator<Item = OutputRegister> + '_ {
        self.shares.iter().map(|(channel, _)| *channel)
    }

    /// True if the finding is a part of the effect, such as the carrier of a changing line.
    pub(super) fn has_part(&self, found: &Effect) -> bool {
        let [carrier_hz, change_hz] = self.frequencies_hz;
        let changes = matches!(self.kind, OutsideKind::ModulatedLine | OutsideKind::SwitchedLine);
        matches!(found, Effect::SinusoidalLine(line)
            if changes && (line.frequency_hz.value - carrier_hz).abs() < 0.5 * change_hz)
    }

    pub(super) fn shows_in(&self, channel: OutputRegister) -> bool {
        self.shares.is_empty() || self.channels().any(|of| of == channel)
    }

    /// An effect of size 1 with random parameters, for a record of `seconds` s.
    pub(super) fn draw_unit(
        kind: OutsideKind,
        channel: OutputRegister,
        (seconds, period_s): (f64, f64),
        random: &mut ChaCha8Rng,
    ) -> Self {
        let factor = frequency_factor(seconds, period_s);
        let mut times_s = [0.0; 2];
        let frequencies_hz = match kind {
            OutsideKind::Chirp => {
                let first = factor * log_uniform(random, 1.0, 10.0);
                [first, first * log_uniform(random, 2.0, 5.0)]
            }
            // There are ten to forty jumps; they decay within a fiftieth to a fifth of the interval.
            OutsideKind::Decays => {
                let rate = log_uniform(random, 10.0, 40.0) / seconds;
                [rate, rate * log_uniform(random, 5.0, 50.0)]
            }
            OutsideKind::Sawtooth => [log_uniform(random, 4.0, 20.0) / seconds, 0.0],
            OutsideKind::ModulatedLine => {
                [factor * log_uniform(random, 2.0, 40.0), log_uniform(random, 3.0, 30.0) / seconds]
            }
            OutsideKind::HeldValue | OutsideKind::ClockStep | OutsideKind::Knock => {
                times_s = [seconds * random.random_range(0.15..0.85), KNOCK_DECAY_S / factor];
                [factor * log_uniform(random, 5.0, 40.0), 0.0]
            }
            OutsideKind::SelfHeating => {
                times_s[1] = seconds * log_uniform(random, 0.02, 0.2);
                [0.0; 2]
            }
            OutsideKind::DeadTime => [log_uniform(random, 10.0, 40.0) / seconds, 0.0],
            // The droops last a twentieth to a fifth of the period.
            OutsideKind::SupplyDroop => {
                let lowest = (0.05 * factor).max(FEWEST_DROOPS / seconds);
                let frequency = log_uniform(random, lowest, 10.0 * lowest);
                times_s[1] = random.random_range(0.05..0.2) / frequency;
                [frequency, 0.0]
            }
            OutsideKind::SwitchedLine => {
                [factor * log_uniform(random, 2.0, 40.0), log_uniform(random, 5.0, 50.0) / seconds]
            }
            OutsideKind::MissingCodes => [0.5f64.powi(random.random_range(2..=4)), 0.0],
            OutsideKind::WanderingBand => {
                times_s[1] = seconds * log_uniform(random, 0.01, 0.05);
                let centre = factor * log_uniform(random, 5.0, 40.0);
                [centre, centre * log_uniform(random, 0.1, 0.4)]
            }
            OutsideKind::LevelByTemperature | OutsideKind::AlternatingConverters => [0.0; 2],
        };
        let shares = if kind == OutsideKind::ClockStep { Vec::new() } else { vec![(channel, 1.0)] };
        Self { kind, shares, size: 1.0, frequencies_hz, times_s, seed: random.random() }
    }

    /// The signal of a channel with factor 1; empty for effects of counts and clock.
    pub(super) fn signal(&self, environment: &EnvironmentCourse, samples: usize, period_s: f64) -> Vec<f64> {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        let (size, [first, second], [begin_s, part_s]) = (self.size, self.frequencies_hz, self.times_s);
        let seconds = samples as f64 * period_s;
        let signal = |value: &mut dyn FnMut(f64) -> f64| {
            (0..samples).map(|at| size * value(at as f64 * period_s)).collect::<Vec<f64>>()
        };
        match self.kind {
            OutsideKind::Chirp => {
                signal(&mut |time_s| (TAU * (first + 0.5 * (second - first) * time_s / seconds) * time_s).sin())
            }
            OutsideKind::Decays => {
                let mut events = RandomTimes::new(first, &mut random);
                let mut height = 0.0;
                let kept = (-period_s * second).exp();
                signal(&mut |time_s| {
                    height = height * kept + events.until(time_s) as f64;
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
            OutsideKind::AlternatingConverters => {
                (0..samples).map(|at| if at % 2 == 0 { 0.5 * size } else { -0.5 * size }).collect()
            }
            OutsideKind::SelfHeating => signal(&mut |time_s| 1.0 - (-time_s / part_s).exp()),
            OutsideKind::SupplyDroop => {
                signal(&mut |time_s| if (first * time_s).fract() < first * part_s { -1.0 } else { 0.0 })
            }
            OutsideKind::SwitchedLine => {
                signal(&mut |time_s| if (second * time_s).fract() < 0.5 { (TAU * first * time_s).sin() } else { 0.0 })
            }
            OutsideKind::WanderingBand => {
                let [cosine, sine] =
                    [(); 2].map(|()| gauss_markov(1.0 / (PI * second), samples, period_s, &mut random));
                let level = gauss_markov(part_s, samples, period_s, &mut random);
                let value = |at: usize| {
                    let phase = TAU * first * at as f64 * period_s;
                    // The level has a mean square of 1.
                    let level = (LEVEL_DEVIATION * level[at] - LEVEL_DEVIATION.powi(2)).exp();
                    size * level * (cosine[at] * phase.cos() + sine[at] * phase.sin())
                };
                (0..samples).map(value).collect()
            }
            OutsideKind::Knock => signal(&mut |time_s| {
                let since_s = time_s - begin_s;
                if since_s < 0.0 { 0.0 } else { (-since_s / part_s).exp() * (TAU * first * since_s).sin() }
            }),
            OutsideKind::HeldValue | OutsideKind::ClockStep | OutsideKind::DeadTime | OutsideKind::MissingCodes => {
                vec![0.0; samples]
            }
        }
    }

    pub(super) fn change_counts(&self, counts: &mut [i32], period_s: f64) {
        let at = |time_s: f64| (time_s / period_s).round() as usize;
        match self.kind {
            OutsideKind::HeldValue => {
                let first = at(self.times_s[0]).min(counts.len().saturating_sub(1));
                let end = (first + at(self.size) + 1).min(counts.len());
                let held = counts[first];
                counts[first..end].fill(held);
            }
            OutsideKind::DeadTime => {
                let mut random = ChaCha8Rng::seed_from_u64(self.seed);
                let mut events = RandomTimes::new(self.frequencies_hz[0], &mut random);
                let mean = counts.iter().map(|&count| f64::from(count)).sum::<f64>() / counts.len().max(1) as f64;
                let (level, mut until) = (mean.round() as i32, 0);
                for (sample, count) in counts.iter_mut().enumerate() {
                    if events.until(sample as f64 * period_s) > 0 {
                        until = sample + at(self.size);
                    }
                    if sample < until {
                        *count = level;
                    }
                }
            }
            OutsideKind::MissingCodes => {
                counts.iter_mut().filter(|count| self.is_missing(**count)).for_each(|count| *count += 1);
            }
            _ => {}
        }
    }

    /// True if the converter never returns `code`.
    pub(super) fn is_missing(&self, code: i32) -> bool {
        let modulus = (1.0 / self.frequencies_hz[0]).round() as i32;
        code.rem_euclid(modulus) == modulus - 1
    }

    /// True time of a sample that is nominally at `time_s`, s.
    pub(super) fn sampled_at(&self, time_s: f64) -> f64 {
        match self.kind {
            OutsideKind::ClockStep => time_s + self.size * (time_s - self.times_s[0]).max(0.0),
            _ => time_s,
        }
    }
}

struct RandomTimes<'a> {
    rate_hz: f64,
    next_s: f64,
    random: &'a mut ChaCha8Rng,
}

impl<'a> RandomTimes<'a> {
    fn new(rate_hz: f64, random: &'a mut ChaCha8Rng) -> Self {
        let first: f64 = Exp1.sample(random);
        Self { rate_hz, next_s: first / rate_hz, random }
    }

    fn until(&mut self, time_s: f64) -> u32 {
        let mut events = 0;
        while self.next_s <= time_s {
            let wait: f64 = Exp1.sample(self.random);
            self.next_s += wait / self.rate_hz;
            events += 1;
        }
        events
    }
}

pub(super) fn relative(course: &[f64]) -> impl Iterator<Item = f64> + '_ {
    let lowest = course.iter().copied().fold(f64::INFINITY, f64::min);
    let highest = course.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    course.iter().map(move |value| (value - lowest) / (highest - lowest).max(f64::MIN_POSITIVE))
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_S: f64 = 0.005;
    const SAMPLES: usize = 100_000;

    fn effect(kind: OutsideKind) -> OutsideEffect {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        OutsideEffect::draw_unit(kind, OutputRegister::GyroX, (SAMPLES as f64 * PERIOD_S, PERIOD_S), &mut random)
    }

    fn environment() -> EnvironmentCourse {
        EnvironmentCourse {
            temperature_c: vec![0.0; SAMPLES],
            supply_v: Vec::new(),
            force_g: [const { Vec::new() }; 3],
        }
    }

    fn counts() -> Vec<i32> {
        (0..SAMPLES).map(|at| (at % 101) as i32 - 50).collect()
    }

    fn standing(counts: &[i32]) -> usize {
        counts.windows(2).filter(|pair| pair[0] == pair[1]).count()
    }

    #[test]
    fn a_held_value_stands_for_its_length_and_dead_times_at_the_mean() {
        let mut held = counts();
        let length_s = 3.0;
        OutsideEffect { size: length_s, ..effect(OutsideKind::HeldValue) }.change_counts(&mut held, PERIOD_S);
        assert_eq!(standing(&held), 600);

        let dead = OutsideEffect { size: 0.1, ..effect(OutsideKind::DeadTime) };
        let mut changed = counts();
        dead.change_counts(&mut changed, PERIOD_S);
        // There are 10 to 40 events of 20 samples; the tolerance is 3.5 σ.
        let events = standing(&changed) as f64 / 19.0;
        let expected = dead.frequencies_hz[0] * SAMPLES as f64 * PERIOD_S;
        assert!((events - expected).abs() < 3.5 * expected.sqrt(), "{events}, {expected}");
    }

    /// The highest frequency is 2.5 Hz.
    #[test]
    fn no_frequency_is_above_half_of_a_low_sample_rate() {
        for (kind, seed) in OutsideKind::value_variants().iter().flat_map(|&kind| (0..20).map(move |seed| (kind, seed)))
        {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let drawn = OutsideEffect::draw_unit(kind, OutputRegister::GyroX, (2400.0, 0.2), &mut random);
            assert!(drawn.frequencies_hz.iter().all(|frequency| *frequency <= 2.5), "{drawn:?}");
            let signal = drawn.signal(&environment(), 12_000, 0.2);
            let is_of_codes = matches!(
                kind,
                OutsideKind::HeldValue | OutsideKind::DeadTime | OutsideKind::ClockStep | OutsideKind::MissingCodes
            );
            // The level changes only with the temperature.
            let changes = signal.iter().filter(|value| value.abs() > 0.1).count();
            assert!(is_of_codes || kind == OutsideKind::LevelByTemperature || changes > 5, "{kind:?}: {changes}");
        }
    }

    #[test]
    fn missing_codes_are_never_given_and_no_other_changes() {
        let missing = effect(OutsideKind::MissingCodes);
        let modulus = (1.0 / missing.frequencies_hz[0]) as i32;
        let mut changed = counts();
        missing.change_counts(&mut changed, PERIOD_S);
        assert!(changed.iter().all(|count| count.rem_euclid(modulus) != modulus - 1));
        let differing = counts().iter().zip(&changed).filter(|(before, after)| before != after).count();
        let hit = counts().iter().filter(|count| count.rem_euclid(modulus) == modulus - 1).count();
        assert_eq!(differing, hit);
    }

    #[test]
    fn two_converters_differ_by_the_size_and_a_clock_loses_its_step() {
        let signal = effect(OutsideKind::AlternatingConverters).signal(&environment(), SAMPLES, PERIOD_S);
        assert!(signal.windows(2).all(|pair| (pair[1] - pair[0]).abs() == 1.0));
        let clock = OutsideEffect { size: 0.01, times_s: [100.0, 0.0], ..effect(OutsideKind::ClockStep) };
        assert_eq!([50.0, 100.0, 300.0].map(|time_s| clock.sampled_at(time_s)), [50.0, 100.0, 302.0]);
    }

    /// The mean squares are ½·½ for a switched line, `p` for droops, and about 1 for a wandering band.
    #[test]
    fn signals_have_the_power_of_their_definition() {
        let power = |kind: OutsideKind| {
            let signal = effect(kind).signal(&environment(), SAMPLES, PERIOD_S);
            signal.iter().map(|value| value * value).sum::<f64>() / SAMPLES as f64
        };
        assert!((power(OutsideKind::SwitchedLine) - 0.25).abs() < 0.02, "{}", power(OutsideKind::SwitchedLine));
        let droop = effect(OutsideKind::SupplyDroop);
        let part = droop.frequencies_hz[0] * droop.times_s[1];
        assert!((power(OutsideKind::SupplyDroop) - part).abs() < 0.02, "{}, {part}", power(OutsideKind::SupplyDroop));
        let band = power(OutsideKind::WanderingBand);
        assert!((0.3..3.0).contains(&band), "{band}");
    }

    #[test]
    fn self_heating_approaches_its_size() {
        let heating = effect(OutsideKind::SelfHeating);
        let signal = heating.signal(&environment(), SAMPLES, PERIOD_S);
        let at = |time_constants: f64| signal[(time_constants * heating.times_s[1] / PERIOD_S) as usize];
        assert!(signal[0].abs() < 1e-9 && (at(1.0) - 0.632).abs() < 1e-3 && (at(3.0) - 0.950).abs() < 1e-3);
    }
}
