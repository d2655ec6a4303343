//! Adds an effect to measured samples.

use crate::undeclared::effect::EffectKind;
use crate::undeclared::environment::EnvironmentCourse;
use crate::undeclared::generator::{add_sensed, quantized_angle};
use crate::undeclared::outside::OutsideEffect;
use crate::undeclared::sample_loss::lose_samples;
use adis16405_driver::Channel;
use measurement::{MeasuredChannel, Measurement, Quantity};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use virtual_sensor::{InjectedEffect, OutputRegister};

/// Random streams: of the effect, of repeated samples, and `DITHER + n` of channel `n`.
const EFFECT: u64 = 1 << 32;
const REPEATED: u64 = EFFECT + 1;
const DITHER: u64 = EFFECT + 2;

pub(super) enum HiddenEffect {
    Known(EffectKind, InjectedEffect),
    Outside(OutsideEffect),
}

impl HiddenEffect {
    /// True if the effect is in the channel; an effect without channels is in all.
    pub(super) fn shows_in(&self, channel: OutputRegister) -> bool {
        match self {
            Self::Known(_, effect) => effect.channels().is_empty() || effect.channels().contains(&channel),
            Self::Outside(effect) => effect.shows_in(channel),
        }
    }
}

/// Distance in samples at which samples are equal only by chance.
const BY_CHANCE: usize = 64;

/// `stretch` with an effect. It is dithered and rounded again, so that size 0 changes no count. Repeated samples stay
/// repeated.
pub(super) fn hide(stretch: &Measurement, effect: &HiddenEffect, seed: u64) -> Measurement {
    let mut changed = stretch.clone();
    match effect {
        HiddenEffect::Known(_, InjectedEffect::DroppedSamples { fraction }) => {
            lose_samples(&mut changed, *fraction, seed);
            return changed;
        }
        HiddenEffect::Known(_, InjectedEffect::RepeatedSamples { fraction }) => {
            repeat_samples(&mut changed, *fraction, seed);
            return changed;
        }
        _ => {}
    }
    for channel in Channel::INERTIAL {
        let output = simulation::output_register(channel);
        let own = changed.channels.iter_mut().find(|of| of.profile.name == channel.name());
        if let Some(own) = own.filter(|_| effect.shows_in(output)) {
            let read_again = read_again(stretch, own.profile.quantity);
            change_channel(own, &stretch.slots, stretch.period_s(), effect, output, seed);
            for at in (1..own.counts.len()).filter(|&at| read_again[at]) {
                own.counts[at] = own.counts[at - 1];
            }
        }
    }
    changed
}

/// The repeated samples, which equal the previous sample in all channels of `quantity`. There are none unless such
/// samples are twice as frequent as at the distance [`BY_CHANCE`].
fn read_again(stretch: &Measurement, quantity: Quantity) -> Vec<bool> {
    let of_quantity = || stretch.channels.iter().filter(|channel| channel.profile.quantity == quantity);
    let is_equal = |at: usize, distance: usize| {
        at >= distance && of_quantity().all(|channel| channel.counts[at] == channel.counts[at - distance])
    };
    let equal: Vec<bool> = (0..stretch.len()).map(|at| is_equal(at, 1)).collect();
    let by_chance = (0..stretch.len()).filter(|&at| is_equal(at, BY_CHANCE)).count();
    let are_read_again = equal.iter().filter(|is_equal| **is_equal).count() > 2 * by_chance;
    if are_read_again { equal } else { vec![false; equal.len()] }
}

pub(super) fn has_samples_read_again(stretch: &Measurement) -> bool {
    [Quantity::AngularRate, Quantity::SpecificForce].into_iter().any(|of| read_again(stretch, of).contains(&true))
}

fn random(seed: u64, stream: u64) -> ChaCha8Rng {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(stream);
    random
}

/// Adds the effect to a channel with the sample periods `slots`.
fn change_channel(
    channel: &mut MeasuredChannel,
    slots: &[u64],
    period_s: f64,
    effect: &HiddenEffect,
    output: OutputRegister,
    seed: u64,
) {
    let lsb = channel.profile.lsb;
    let mut dither = random(seed, DITHER + output as u64);
    let continuous = |count: i32, dither: &mut ChaCha8Rng| lsb * (f64::from(count) + dither.random_range(-0.5..0.5));
    // A gap keeps the last value.
    let mut values: Vec<f64> = Vec::new();
    for (&slot, &count) in slots.iter().zip(&channel.counts) {
        let value = continuous(count, &mut dither);
        let last = values.last().copied().unwrap_or(value);
        values.resize(slot as usize, last);
        values.push(value);
    }
    let rounded = |values: &[f64]| -> Vec<i32> { values.iter().map(|value| (value / lsb).round() as i32).collect() };
    let counts = match effect {
        HiddenEffect::Known(_, InjectedEffect::Quantization { coefficient, .. }) => {
            rounded(&quantized_angle(&values, 12f64.sqrt() * coefficient, period_s))
        }
        HiddenEffect::Known(_, effect) => {
            add_sensed(effect, &mut values, (0, period_s), &no_environment(), &mut random(seed, EFFECT));
            rounded(&values)
        }
        HiddenEffect::Outside(effect) => {
            let share = effect.shares.iter().find(|(of, _)| *of == output).map_or(0.0, |(_, share)| *share);
            let signal = effect.signal(&no_environment(), values.len(), period_s);
            values.iter_mut().zip(signal).for_each(|(value, added)| *value += share * added);
            let mut counts = rounded(&values);
            effect.change_counts(&mut counts, period_s);
            counts
        }
    };
    channel.counts = slots.iter().map(|&slot| counts[slot as usize]).collect();
}

/// Repeats samples in every channel with the probability `share`.
fn repeat_samples(measurement: &mut Measurement, share: f64, seed: u64) {
    let mut random = random(seed, REPEATED);
    for at in 1..measurement.len() {
        if random.random_bool(share.clamp(0.0, 1.0)) {
            measurement.channels.iter_mut().for_each(|channel| channel.counts[at] = channel.counts[at - 1]);
        }
    }
}

/// An environment without changes, since a recording of noise does not have one.
pub(super) fn no_environment() -> EnvironmentCourse {
    EnvironmentCourse { temperature_c: Vec::new(), supply_v: Vec::new(), force_g: [const { Vec::new() }; 3] }
}
