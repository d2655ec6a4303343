//! The generator of the recordings. It shares no code with the analysis or the virtual sensor.

use super::environment::{EnvironmentCourse, gauss_markov, two_levels};
use super::outside::OutsideEffect;
use crate::spectral_noise::{baseline, moving_average};
use adis16405_driver::{Burst, Channel, Counts, GyroRange};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Exp1};
use recordings::recording::{Recorder, Recording, TimeStamp};
use simulation::SAMPLE_RATE_HZ;
use std::f64::consts::{PI, TAU};
use virtual_sensor::{InjectedEffect, NoiseModel, OutputRegister, SensorScenario};

/// Largest count of 14 bits.
const LARGEST_COUNT: i32 = 8191;
/// Supply voltage, V, and specific force along z, g.
const SUPPLY_V: f64 = 5.0;
const GRAVITY_G: f64 = 1.0;
/// Mean delay of a host's time stamps, s.
const LATENCY_S: f64 = 50e-6;

/// Random streams: channel `n` has the stream `n`, effect `n` the stream `EFFECTS + n`.
const ENVIRONMENT: u64 = 32;
const REPEATED: u64 = 33;
const HOST: u64 = 34;
const EFFECTS: u64 = 64;

/// Rate, resolution, range and filters of the outputs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sampling {
    /// Nominal sample rate, Hz.
    pub rate_hz: f64,
    /// Size of one count of each channel in its unit, in the order of the burst.
    pub resolutions: [f64; 12],
    pub full_scales: [f64; 12],
    /// Half-power corners of first-order filters of the noise, Hz, used for measured noise; infinite without a filter.
    pub corners_hz: [f64; 12],
}

impl Sampling {
    pub fn adis16405() -> Self {
        let resolutions = Channel::ALL.map(|channel| channel.lsb(GyroRange::Dps300));
        let full_scales = resolutions.map(|lsb| f64::from(LARGEST_COUNT + 1) * lsb);
        Self { rate_hz: SAMPLE_RATE_HZ, resolutions, full_scales, corners_hz: [f64::INFINITY; 12] }
    }

    pub(super) fn period_s(&self) -> f64 {
        1.0 / self.rate_hz
    }
}

#[derive(Debug, Clone, PartialEq)]
pub struct TrueRecording {
    pub sampling: Sampling,
    /// Length at the nominal rate, s.
    pub seconds: f64,
    pub seed: u64,
    pub noise: NoiseModel,
    pub scenario: SensorScenario,
    /// Hidden effects outside the vocabulary of the analysis.
    pub outside: Vec<OutsideEffect>,
    /// Host seconds per true second.
    pub host_clock_ratio: f64,
}

impl TrueRecording {
    fn random(&self, stream: u64) -> ChaCha8Rng {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(stream);
        random
    }

    pub(super) fn samples(&self) -> usize {
        (self.seconds * self.sampling.rate_hz).round() as usize
    }

    pub(super) fn environment(&self, samples: usize) -> EnvironmentCourse {
        let mut random = self.random(ENVIRONMENT);
        EnvironmentCourse::new(&self.scenario.environment, samples, self.sampling.period_s(), &mut random)
    }

    pub fn record(&self) -> Recording {
        let samples = self.samples();
        let counts = self.counts(samples);
        let (mut repeated, mut dropped, mut clock) = (0.0, 0.0, 1.0);
        for effect in &self.scenario.effects {
            match effect {
                InjectedEffect::RepeatedSamples { fraction } => repeated = *fraction,
                InjectedEffect::DroppedSamples { fraction } => dropped = *fraction,
                InjectedEffect::SampleClock { ratio } => clock = *ratio,
                _ => {}
            }
        }
        let period_s = 1.0 / (self.sampling.rate_hz * clock);
        let (mut repeats, mut host) = (self.random(REPEATED), self.random(HOST));
        let mut recorder = Recorder::new(Channel::ALL.to_vec(), GyroRange::Dps300);
        let (mut shown, mut latest_s) = (0, 0.0_f64);
        for at in 0..samples {
            if at == 0 || !repeats.random_bool(repeated) {
                shown = at;
            }
            let is_missed = host.random_bool(dropped);
            let latency: f64 = Exp1.sample(&mut host);
            if is_missed {
                continue;
            }
            // Samples queue, so time stamps do not decrease.
            let sampled_s = self.outside.iter().fold(at as f64 * period_s, |time_s, effect| effect.sampled_at(time_s));
            latest_s = latest_s.max((sampled_s + LATENCY_S * latency) * self.host_clock_ratio);
            let word = |channel: usize| counts[channel][shown].clamp(-LARGEST_COUNT, LARGEST_COUNT) as i16;
            let words = Counts::new(std::array::from_fn(word));
            recorder.push(TimeStamp::from_time(latest_s), &Burst::from_counts(&words));
        }
        recorder.finish()
    }

    fn counts(&self, samples: usize) -> Vec<Vec<i32>> {
        let period_s = self.sampling.period_s();
        let taps = self.scenario.effects.iter().find_map(|effect| match effect {
            InjectedEffect::FilterBandwidth { taps_log2 } => Some(1_usize << taps_log2),
            _ => None,
        });
        // The filter has run in a constant environment before the first sample.
        let lead = taps.map_or(0, |taps| 2 * (taps - 1));
        let length = samples + lead;
        let environment = self.environment(samples);
        let channel = |output: &OutputRegister| {
            let output = *output;
            let channel = simulation::channel(output);
            let mut random = self.random(output as u64);
            let mut values = baseline(self.noise.channel(output), self.sampling.rate_hz, length, &mut random);
            let level = match channel {
                Channel::Supply => SUPPLY_V,
                Channel::AcclZ => GRAVITY_G,
                _ => 0.0,
            };
            let own = match channel {
                Channel::Temp => Some(&environment.temperature_c),
                Channel::Supply => Some(&environment.supply_v),
                Channel::AcclX => Some(&environment.force_g[0]),
                Channel::AcclY => Some(&environment.force_g[1]),
                Channel::AcclZ => Some(&environment.force_g[2]),
                _ => None,
            };
            let of = |course: &[f64], at: usize| course[at.saturating_sub(lead)];
            for (at, value) in values.iter_mut().enumerate() {
                *value += level + own.map_or(0.0, |own| of(own, at));
            }
            for (number, effect) in self.scenario.effects.iter().enumerate() {
                if effect.channels().contains(&output) {
                    let mut random = self.random(EFFECTS + number as u64);
                    add_sensed(effect, &mut values, (lead, period_s), &environment, &mut random);
                }
            }
            let outside = || {
                let share =
                    |effect: &'_ OutsideEffect| effect.shares.iter().find(|(of, _)| *of == output).map(|of| of.1);
                self.outside.iter().filter_map(move |effect| Some((effect, share(effect)?)))
            };
            for (effect, share) in outside() {
                let signal = effect.signal(&environment, samples, period_s);
                values[lead..].iter_mut().zip(signal).for_each(|(value, added)| *value += share * added);
            }
            if let Some(taps) = taps.filter(|_| Channel::INERTIAL.contains(&channel)) {
                values = moving_average(&moving_average(&values, taps), taps);
            } else {
                values.drain(..lead);
            }
            for effect in &self.scenario.effects {
                if let InjectedEffect::Quantization { channel, coefficient } = effect
                    && *channel == output
                {
                    values = quantized_angle(&values, 12f64.sqrt() * coefficient, period_s);
                }
            }
            let lsb = self.sampling.resolutions[channel as usize];
            let mut counts: Vec<i32> = values.into_iter().map(|value| (value / lsb).round() as i32).collect();
            outside().for_each(|(effect, _)| effect.change_counts(&mut counts, period_s));
            counts
        };
        Channel::ALL.map(simulation::output_register).iter().map(channel).collect()
    }
}

/// Adds an effect before the filter; `lead` values precede the first sample.
pub(super) fn add_sensed(
    effect: &InjectedEffect,
    values: &mut [f64],
    (lead, period_s): (usize, f64),
    environment: &EnvironmentCourse,
    random: &mut ChaCha8Rng,
) {
    let length = values.len();
    let time_s = |at: usize| (at as f64 - lead as f64) * period_s;
    let mut add = |signal: &mut dyn FnMut(usize) -> f64| {
        values.iter_mut().enumerate().for_each(|(at, value)| *value += signal(at));
    };
    let scaled = |size: f64, course: &[f64], at: usize| size * course[at.saturating_sub(lead)];
    match *effect {
        InjectedEffect::Sinusoid { frequency_hz, amplitude, phase_rad, .. } => {
            add(&mut |at| amplitude * (TAU * frequency_hz * time_s(at) + phase_rad).sin());
        }
        InjectedEffect::Resonance { frequency_hz, bandwidth_hz, deviation, .. } => {
            // A resonance is two quadratures around the centre frequency.
            let time_constant_s = 1.0 / (PI * bandwidth_hz);
            let [cosine, sine] = [(); 2].map(|()| gauss_markov(time_constant_s, length, period_s, random));
            add(&mut |at| {
                let phase = TAU * frequency_hz * time_s(at);
                deviation * (cosine[at] * phase.cos() + sine[at] * phase.sin())
            });
        }
        InjectedEffect::Markov { time_constant_s, deviation, .. }
        | InjectedEffect::CommonMode { time_constant_s, deviation, .. } => {
            let unit = gauss_markov(time_constant_s, length, period_s, random);
            add(&mut |at| deviation * unit[at]);
        }
        InjectedEffect::Telegraph { time_constant_s, amplitude, .. } => {
            let levels = two_levels(time_constant_s, length, period_s, random);
            add(&mut |at| if levels[at] { 0.5 * amplitude } else { -0.5 * amplitude });
        }
        InjectedEffect::RateRamp { slope, .. } => add(&mut |at| slope * time_s(at)),
        InjectedEffect::BiasStep { time_s: step_s, size, .. } => {
            add(&mut |at| if time_s(at) >= step_s { size } else { 0.0 });
        }
        InjectedEffect::Temperature { sensitivity, .. } => {
            add(&mut |at| scaled(sensitivity, &environment.temperature_c, at));
        }
        InjectedEffect::Supply { sensitivity, .. } => add(&mut |at| scaled(sensitivity, &environment.supply_v, at)),
        InjectedEffect::Acceleration { sensitivity, .. } => {
            add(&mut |at| {
                let axes = sensitivity.iter().zip(&environment.force_g);
                axes.map(|(sensitivity, force)| scaled(*sensitivity, force, at)).sum()
            });
        }
        InjectedEffect::Spikes { rate_per_hour, size, .. } => {
            let mean_s = 3600.0 / rate_per_hour;
            let wait = |random: &mut ChaCha8Rng| mean_s * <Exp1 as Distribution<f64>>::sample(&Exp1, random);
            let mut next_s = time_s(0) + wait(random);
            add(&mut |at| {
                let mut sum = 0.0;
                while next_s <= time_s(at) {
                    sum += if random.random_bool(0.5) { size } else { -size };
                    next_s += wait(random);
                }
                sum
            });
        }
        // These effects arise behind the filter, in the clock, or in the host.
        InjectedEffect::Quantization { .. }
        | InjectedEffect::FilterBandwidth { .. }
        | InjectedEffect::DroppedSamples { .. }
        | InjectedEffect::RepeatedSamples { .. }
        | InjectedEffect::SampleClock { .. } => {}
    }
}

/// The rates that are differences of an angle in steps of `quantum`.
pub(super) fn quantized_angle(rates: &[f64], quantum: f64, period_s: f64) -> Vec<f64> {
    let (mut angle, mut shown) = (0.0, 0.0);
    let rate = |rate: &f64| {
        angle += rate * period_s;
        let rounded = (angle / quantum).round() * quantum;
        (rounded - std::mem::replace(&mut shown, rounded)) / period_s
    };
    rates.iter().map(rate).collect()
}
