//! What an effect is hidden in: the noise of a channel, the part's filter, and the recording's other effects.

use super::limit::spectrum::{self, Record};
use adis16405_driver::GyroRange;
use std::f64::consts::PI;
use virtual_sensor::{ChannelNoise, Environment, InjectedEffect, NoiseModel, OutputRegister};

/// A filter's null lets nothing through to tell of, and no less than this.
const LEAST_GAIN: f64 = 1e-3;

/// A recording to hide effects in.
pub(super) struct Scene<'a> {
    pub(super) noise: &'a NoiseModel,
    pub(super) surroundings: Environment,
    pub(super) record: Record,
    pub(super) seed: u64,
}

/// A channel of it, with the effects that are there already, whose every parameter a test with the truth knows.
pub(super) struct Place<'a> {
    pub(super) channel: OutputRegister,
    pub(super) noise: &'a ChannelNoise,
    pub(super) record: Record,
    others: &'a [InjectedEffect],
}

impl<'a> Place<'a> {
    pub(super) fn of(scene: &Scene<'a>, channel: OutputRegister, others: &'a [InjectedEffect]) -> Self {
        Self { channel, noise: scene.noise.channel(channel), record: scene.record, others }
    }

    pub(super) fn resolution(&self) -> f64 {
        simulation::channel(self.channel).lsb(GyroRange::Dps300)
    }

    fn others(&self) -> impl Iterator<Item = &InjectedEffect> {
        self.others.iter().filter(|effect| effect.channels().contains(&self.channel))
    }

    /// Power that the part's filter lets through.
    pub(super) fn gain(&self, frequency: f64) -> f64 {
        let filter = |effect: &InjectedEffect| match *effect {
            InjectedEffect::FilterBandwidth { taps_log2 } => {
                spectrum::filter(taps_log2, self.record.period_s, frequency)
            }
            _ => 1.0,
        };
        self.others.iter().map(filter).product()
    }

    /// Correlation time and variance of the slow processes among the others.
    pub(super) fn processes(&self) -> impl Iterator<Item = (f64, f64)> {
        self.others().filter_map(|effect| match *effect {
            InjectedEffect::Markov { time_constant_s, deviation, .. }
            | InjectedEffect::CommonMode { time_constant_s, deviation, .. } => {
                Some((time_constant_s, deviation * deviation))
            }
            InjectedEffect::Telegraph { time_constant_s, amplitude, .. } => {
                Some((time_constant_s, 0.25 * amplitude * amplitude))
            }
            _ => None,
        })
    }

    /// Density of the spikes among the others.
    fn spikes(&self) -> f64 {
        let period_s = self.record.period_s;
        let spikes = |effect: &InjectedEffect| match *effect {
            InjectedEffect::Spikes { rate_per_hour, size, .. } => {
                size * size * rate_per_hour * period_s / 3600.0 * period_s
            }
            _ => 0.0,
        };
        self.others().map(spikes).sum()
    }

    /// Density of what is white before the filter.
    pub(super) fn white(&self) -> f64 {
        self.noise.angle_random_walk.powi(2) + self.spikes()
    }

    /// Density of what the others add before the filter.
    fn added(&self, frequency: f64) -> f64 {
        let period_s = self.record.period_s;
        let slow: f64 =
            self.processes().map(|(time_s, variance)| variance * spectrum::markov(time_s, period_s, frequency)).sum();
        let resonances = self.others().map(|effect| match *effect {
            InjectedEffect::Resonance { frequency_hz, bandwidth_hz, deviation, .. } => {
                deviation * deviation * spectrum::resonance(frequency_hz, bandwidth_hz, period_s, frequency)
            }
            _ => 0.0,
        });
        slow + resonances.sum::<f64>() + self.spikes()
    }

    /// Density of what comes on top behind the filter: the rounding to counts, and to coarser steps of an angle.
    pub(super) fn rounding(&self, frequency: f64) -> f64 {
        let period_s = self.record.period_s;
        let angle = |effect: &InjectedEffect| match *effect {
            InjectedEffect::Quantization { coefficient, .. } => {
                coefficient * coefficient * spectrum::quantization(period_s, frequency)
            }
            _ => 0.0,
        };
        self.resolution().powi(2) / 12.0 * period_s + self.others().map(angle).sum::<f64>()
    }

    /// What is known of the output besides the declared noise.
    pub(super) fn known(&self, frequency: f64) -> f64 {
        self.gain(frequency) * self.added(frequency) + self.rounding(frequency)
    }

    /// Density of the output.
    pub(super) fn density(&self, frequency: f64) -> f64 {
        let declared = spectrum::declared(self.noise, self.record.period_s, frequency);
        self.gain(frequency) * declared + self.known(frequency)
    }

    /// The same, as if it had been there before the filter, where effects come in.
    pub(super) fn sensed(&self, frequency: f64) -> f64 {
        self.density(frequency) / self.gain(frequency).max(LEAST_GAIN)
    }

    /// Probability that a sample rounds to what the one before did: `q/(√(2π)·σ)` for differences of deviation σ ≫ q.
    pub(super) fn equal_by_chance(&self) -> f64 {
        let period_s = self.record.period_s;
        let rounding = self.resolution().powi(2) / 12.0 * period_s;
        let of_difference = |frequency: f64| {
            (self.density(frequency) - rounding) / period_s * 4.0 * (PI * frequency * period_s).sin().powi(2)
        };
        (self.resolution() / (2.0 * PI * self.record.mean(of_difference)).sqrt()).min(1.0)
    }
}
