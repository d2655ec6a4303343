//! Effects in operation: one call a sample on either side of the filter.

use super::angle::AngleQuantizer;
use super::process::{Markov, Resonance, Telegraph};
use super::surroundings::{Course, Moment};
use super::{Effect, Hidden, probability};
use crate::output::OutputRegister;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::PI;

/// Random streams below this one belong to the noise of the channels.
const FIRST_STREAM: u64 = 64;

/// Limits of [`Effect::SampleClock`]; the part's virtual time must go on.
const SLOWEST: f64 = 0.5;
const FASTEST: f64 = 2.0;

/// The hidden part of a virtual sensor.
#[derive(Clone, Debug)]
pub struct EffectSource {
    course: Course,
    active: Vec<Active>,
    clock_ratio: f64,
}

#[derive(Clone, Debug)]
struct Active {
    effect: Effect,
    state: State,
    random: ChaCha8Rng,
}

#[derive(Clone, Debug)]
enum State {
    None,
    Resonance(Resonance),
    Markov(Markov),
    Telegraph(Telegraph),
    Angle(AngleQuantizer),
}

impl EffectSource {
    pub fn new(hidden: &Hidden, seed: u64) -> Self {
        let stream = |number: usize| {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            random.set_stream(FIRST_STREAM + number as u64);
            random
        };
        let active = |(number, effect): (usize, &Effect)| Active {
            state: State::of(effect),
            effect: effect.clone(),
            random: stream(1 + number),
        };
        let ratio = hidden.clock_ratio();
        Self {
            course: Course::new(hidden.surroundings, stream(0)),
            active: hidden.effects.iter().enumerate().map(active).collect(),
            clock_ratio: if ratio.is_nan() { 1.0 } else { ratio.clamp(SLOWEST, FASTEST) },
        }
    }

    /// True over nominal sample rate.
    pub fn clock_ratio(&self) -> f64 {
        self.clock_ratio
    }

    /// Adds what is sensed at `time_s` to the value of every channel.
    pub fn disturb(&mut self, values: &mut [f64; 12], time_s: f64, period_s: f64) {
        let moment = self.course.next(time_s, period_s);
        values[OutputRegister::Temp as usize] += moment.temperature_c;
        values[OutputRegister::Supply as usize] += moment.supply_v;
        for (channel, force_g) in
            [OutputRegister::AcclX, OutputRegister::AcclY, OutputRegister::AcclZ].into_iter().zip(moment.force_g)
        {
            values[channel as usize] += force_g;
        }
        for active in &mut self.active {
            let sensed = active.sensed(time_s, period_s, &moment);
            for channel in active.effect.channels() {
                values[*channel as usize] += sensed;
            }
        }
    }

    /// What the part makes of a filtered value before it rounds it to counts.
    pub fn digitize(&mut self, channel: OutputRegister, value: f64, period_s: f64) -> f64 {
        self.active.iter_mut().fold(value, |value, active| match &mut active.state {
            State::Angle(quantizer) if active.effect.channels() == [channel] => quantizer.quantize(value, period_s),
            _ => value,
        })
    }

    /// Whether the outputs keep the sample before, this time.
    pub fn stale(&mut self) -> bool {
        let stale = |active: &mut Active| match active.effect {
            Effect::RepeatedSamples { fraction } => active.random.random_bool(probability(fraction)),
            _ => false,
        };
        // Every effect draws at every sample, whatever the others say.
        self.active.iter_mut().fold(false, |any, active| stale(active) | any)
    }
}

impl State {
    fn of(effect: &Effect) -> Self {
        match *effect {
            Effect::Resonance { frequency_hz, bandwidth_hz, .. } => {
                Self::Resonance(Resonance::new(frequency_hz, bandwidth_hz))
            }
            Effect::Markov { time_constant_s, .. } | Effect::CommonMode { time_constant_s, .. } => {
                Self::Markov(Markov::new(time_constant_s))
            }
            Effect::Telegraph { time_constant_s, .. } => Self::Telegraph(Telegraph::new(time_constant_s)),
            Effect::Quantization { coefficient, .. } => Self::Angle(AngleQuantizer::new(coefficient)),
            _ => Self::None,
        }
    }
}

impl Active {
    /// What the effect adds to each of its channels before the filter.
    fn sensed(&mut self, time_s: f64, period_s: f64, moment: &Moment) -> f64 {
        let random = &mut self.random;
        match (&self.effect, &mut self.state) {
            (&Effect::Sinusoid { frequency_hz, amplitude, phase_rad, .. }, _) => {
                amplitude * (2.0 * PI * (frequency_hz * time_s).fract() + phase_rad).sin()
            }
            (Effect::Resonance { deviation, .. }, State::Resonance(process)) => {
                deviation * process.next(time_s, period_s, random)
            }
            (Effect::Markov { deviation, .. } | Effect::CommonMode { deviation, .. }, State::Markov(process)) => {
                deviation * process.next(period_s, random)
            }
            (Effect::Telegraph { amplitude, .. }, State::Telegraph(process)) => {
                amplitude * process.next(period_s, random)
            }
            (Effect::RateRamp { slope, .. }, _) => slope * time_s,
            (Effect::Temperature { sensitivity, .. }, _) => sensitivity * moment.temperature_c,
            (Effect::Supply { sensitivity, .. }, _) => sensitivity * moment.supply_v,
            (Effect::Acceleration { sensitivity, .. }, _) => {
                sensitivity.iter().zip(moment.force_g).map(|(per_g, force_g)| per_g * force_g).sum()
            }
            (&Effect::Spikes { rate_per_hour, size, .. }, _) => {
                let struck = random.random_bool(probability(-(-rate_per_hour * period_s / 3600.0).exp_m1()));
                let sign = if random.random_bool(0.5) { 1.0 } else { -1.0 };
                if struck { sign * size } else { 0.0 }
            }
            (&Effect::BiasStep { time_s: step_s, size, .. }, _) if time_s >= step_s => size,
            _ => 0.0,
        }
    }
}
