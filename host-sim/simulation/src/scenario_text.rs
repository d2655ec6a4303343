//! Text descriptions of effects, environment, faults and coefficients of a simulation: `KIND[:CHANNEL]:KEY=VALUE,…`, such as
//! `sinusoid:gyro_z:frequency=20.5,amplitude=0.2`.
//!
//! Kinds, channels and keys are named as in the report.

use crate::burst_order::output_register;
use crate::fault_injector::FrameFault;
use crate::simulation::{Simulation, TimedFault};
use adis16405_driver::Channel;
use std::collections::{BTreeMap, BTreeSet};
use virtual_sensor::{InjectedEffect, OutputRegister};

/// Kinds of effects.
const EFFECTS: &[&str] = &[
    "sinusoid",
    "resonance",
    "markov",
    "telegraph",
    "quantization",
    "rate_ramp",
    "temperature",
    "supply",
    "acceleration",
    "common_mode",
    "spikes",
    "bias_step",
    "dropped_samples",
    "repeated_samples",
    "sample_clock",
];
/// Parts of the environment.
const ENVIRONMENT: &[&str] = &["temperature", "supply", "motion"];
/// Kinds of faults.
const FAULTS: &[&str] = &["impossible_rate", "shifted", "stuck_low", "stuck_high", "frozen", "stale", "low_supply"];

/// An error in such a text.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ScenarioTextError {
    /// The kind is unknown.
    #[error("`{0}` is none of {1}")]
    Kind(String, String),
    /// The channel does not exist, or the kind needs one.
    #[error("`{0}` is no channel: it needs one such as gyro_x or accl_z, or several with + between them")]
    Channel(String),
    /// A text between commas is not `KEY=VALUE`.
    #[error("`{0}` is not of the form KEY=VALUE")]
    Pair(String),
    /// A key is missing.
    #[error("{kind} needs {key}")]
    Missing {
        /// The kind.
        kind: String,
        /// The key.
        key: &'static str,
        /// Keys that are given but unknown or not yet read.
        given: Vec<String>,
    },
    /// A key or a channel is named twice.
    #[error("{kind} names {name} twice")]
    Twice {
        /// The kind.
        kind: String,
        /// The key or the channel.
        name: String,
    },
    /// The kind has no such key.
    #[error("{kind} has no {key}")]
    Unknown {
        /// The kind.
        kind: String,
        /// The key.
        key: String,
        /// The keys of the kind.
        known: Vec<&'static str>,
    },
    /// A value is out of range.
    #[error("{key}: `{value}` is not {expected}")]
    Value {
        /// The key.
        key: String,
        /// Its text.
        value: String,
        /// The range.
        expected: &'static str,
    },
}

type Result<T> = std::result::Result<T, ScenarioTextError>;

impl Simulation {
    /// Adds an effect, such as `temperature:gyro_x:sensitivity=0.05` or `dropped_samples:fraction=0.01`.
    ///
    /// # Errors
    /// The text does not describe an effect.
    pub fn add_effect(&mut self, text: &str) -> Result<()> {
        let mut fields = Fields::new(text, EFFECTS)?;
        let effect = effect(&mut fields)?;
        fields.finish()?;
        self.scenario.effects.push(effect);
        Ok(())
    }

    /// Changes a part of the environment, such as `temperature:rise=8,time_constant=900`, in °C and s.
    ///
    /// # Errors
    /// The text does not describe a part of the environment.
    pub fn set_environment(&mut self, text: &str) -> Result<()> {
        let mut fields = Fields::new(text, ENVIRONMENT)?;
        let environment = &mut self.scenario.environment;
        match fields.kind {
            "temperature" => {
                let profile = &mut environment.temperature;
                fields.set("rise", &mut profile.rise_c)?;
                fields.set("cycle", &mut profile.cycle_c)?;
                fields.set_positive("time_constant", &mut profile.time_constant_s)?;
                fields.set_positive("period", &mut profile.period_s)?;
            }
            "supply" => {
                let profile = &mut environment.supply;
                fields.set("load", &mut profile.load_v)?;
                fields.set("cycle", &mut profile.cycle_v)?;
                fields.set_positive("load_time", &mut profile.load_time_s)?;
                fields.set_positive("period", &mut profile.period_s)?;
            }
            _ => {
                fields.set("deviation", &mut environment.motion.deviation_g)?;
                fields.set_positive("time_constant", &mut environment.motion.time_constant_s)?;
            }
        }
        fields.finish()
    }

    /// Adds a fault of the bus, such as `stuck_low:from=10,bursts=5`: five bursts from 10 s on.
    ///
    /// # Errors
    /// The text does not describe a fault.
    pub fn add_fault(&mut self, text: &str) -> Result<()> {
        let mut fields = Fields::new(text, FAULTS)?;
        let fault = match fields.kind {
            "impossible_rate" => FrameFault::ImpossibleRate,
            "shifted" => FrameFault::Shifted,
            "stuck_low" => FrameFault::Stuck { high: false },
            "stuck_high" => FrameFault::Stuck { high: true },
            "frozen" => FrameFault::Frozen,
            "stale" => FrameFault::Stale,
            _ => FrameFault::LowSupply,
        };
        let from_s = fields.within("from", 0.0, f64::MAX, "a time of at least 0 s")?;
        let bursts = fields.within("bursts", 1.0, f64::from(u32::MAX), "a number of bursts from 1")? as u32;
        fields.finish()?;
        self.faults.push(TimedFault { from_s, fault, bursts });
        self.faults.sort_by(|a, b| a.from_s.total_cmp(&b.from_s));
        Ok(())
    }

    /// Sets the number of values that each of the filter's two stages averages: 1 (no filter), 2, 4, 8, 16, 32 or 64.
    ///
    /// # Errors
    /// The number is another one.
    pub fn set_taps(&mut self, taps: u32) -> Result<()> {
        if !taps.is_power_of_two() || taps > 64 {
            let (key, value) = ("taps".to_owned(), taps.to_string());
            return Err(ScenarioTextError::Value { key, value, expected: "1, 2, 4, 8, 16, 32 or 64" });
        }
        let effects = &mut self.scenario.effects;
        effects.retain(|effect| !matches!(effect, InjectedEffect::FilterBandwidth { .. }));
        if taps > 1 {
            effects.push(InjectedEffect::FilterBandwidth { taps_log2: taps.ilog2() as u8 });
        }
        Ok(())
    }

    /// Sets N, B and K of channels whose names begin with `prefix`, such as `gyro_` or `accl_x`, from `N,B,K`.
    ///
    /// # Errors
    /// The text is not three numbers of at least 0.
    pub fn set_coefficients(&mut self, prefix: &str, text: &str) -> Result<()> {
        let number = |field: &str| field.trim().parse::<f64>().ok().filter(|value| (0.0..=1e6).contains(value));
        let values: Option<Vec<f64>> = text.split(',').map(number).collect();
        let Some([white, flicker, walk]) = values.as_deref() else {
            let (key, value) = (prefix.trim_end_matches('_').to_owned(), text.to_owned());
            return Err(ScenarioTextError::Value { key, value, expected: "N,B,K: three numbers of at least 0" });
        };
        for channel in Channel::ALL.into_iter().filter(|channel| channel.name().starts_with(prefix)) {
            let noise = self.noise.channel_mut(output_register(channel));
            (noise.angle_random_walk, noise.bias_instability, noise.rate_random_walk) = (*white, *flicker, *walk);
        }
        Ok(())
    }
}

fn effect(fields: &mut Fields<'_>) -> Result<InjectedEffect> {
    Ok(match fields.kind {
        "sinusoid" => InjectedEffect::Sinusoid {
            channel: fields.channel()?,
            frequency_hz: fields.positive("frequency")?,
            amplitude: fields.number("amplitude")?,
            phase_rad: fields.number_or("phase", 0.0)?,
        },
        "resonance" => InjectedEffect::Resonance {
            channel: fields.channel()?,
            frequency_hz: fields.positive("frequency")?,
            bandwidth_hz: fields.positive("bandwidth")?,
            deviation: fields.number("deviation")?,
        },
        "markov" => InjectedEffect::Markov {
            channel: fields.channel()?,
            time_constant_s: fields.positive("time_constant")?,
            deviation: fields.number("deviation")?,
        },
        "telegraph" => InjectedEffect::Telegraph {
            channel: fields.channel()?,
            time_constant_s: fields.positive("time_constant")?,
            amplitude: fields.number("amplitude")?,
        },
        "quantization" => {
            InjectedEffect::Quantization { channel: fields.channel()?, coefficient: fields.positive("value")? }
        }
        "rate_ramp" => InjectedEffect::RateRamp { channel: fields.channel()?, slope: fields.number("slope")? },
        "temperature" => {
            InjectedEffect::Temperature { channel: fields.channel()?, sensitivity: fields.number("sensitivity")? }
        }
        "supply" => InjectedEffect::Supply { channel: fields.channel()?, sensitivity: fields.number("sensitivity")? },
        "acceleration" => InjectedEffect::Acceleration {
            channel: fields.channel()?,
            sensitivity: [
                fields.number_or("sensitivity_x", 0.0)?,
                fields.number_or("sensitivity_y", 0.0)?,
                fields.number_or("sensitivity_z", 0.0)?,
            ],
        },
        "common_mode" => InjectedEffect::CommonMode {
            channels: fields.channels()?,
            time_constant_s: fields.positive("time_constant")?,
            deviation: fields.number("deviation")?,
        },
        "spikes" => InjectedEffect::Spikes {
            channel: fields.channel()?,
            rate_per_hour: fields.positive("rate")?,
            size: fields.number("size")?,
        },
        "bias_step" => InjectedEffect::BiasStep {
            channel: fields.channel()?,
            time_s: fields.number("time")?,
            size: fields.number("size")?,
        },
        "dropped_samples" => InjectedEffect::DroppedSamples { fraction: fields.fraction()? },
        "repeated_samples" => InjectedEffect::RepeatedSamples { fraction: fields.fraction()? },
        _ => InjectedEffect::SampleClock { ratio: fields.within("ratio", 0.5, 2.0, "a ratio from 0.5 to 2")? },
    })
}

/// The parts of a text.
struct Fields<'a> {
    kind: &'a str,
    channel: Option<&'a str>,
    values: BTreeMap<&'a str, &'a str>,
    /// Keys of the kind.
    known: Vec<&'static str>,
}

impl<'a> Fields<'a> {
    fn new(text: &'a str, kinds: &[&str]) -> Result<Self> {
        let (kind, rest) = text.split_once(':').unwrap_or((text, ""));
        if !kinds.contains(&kind) {
            return Err(ScenarioTextError::Kind(kind.to_owned(), kinds.join(", ")));
        }
        let (channel, pairs) = match rest.split_once(':') {
            Some((channel, pairs)) => (Some(channel), pairs),
            None if rest.contains('=') || rest.is_empty() => (None, rest),
            None => (Some(rest), ""),
        };
        let pair = |text: &'a str| text.split_once('=').ok_or_else(|| ScenarioTextError::Pair(text.to_owned()));
        let mut values = BTreeMap::new();
        for text in pairs.split(',').filter(|text| !text.is_empty()) {
            let (key, value) = pair(text)?;
            if values.insert(key, value).is_some() {
                return Err(ScenarioTextError::Twice { kind: kind.to_owned(), name: key.to_owned() });
            }
        }
        Ok(Self { kind, channel, values, known: Vec::new() })
    }

    fn channels(&mut self) -> Result<Vec<OutputRegister>> {
        let names = self.channel.take().unwrap_or_default();
        let channel = |name: &str| {
            let found = Channel::ALL.into_iter().find(|channel| channel.name() == name);
            found.map(output_register).ok_or_else(|| ScenarioTextError::Channel(name.to_owned()))
        };
        let mut seen = BTreeSet::new();
        if let Some(name) = names.split('+').find(|name| !seen.insert(*name)) {
            return Err(ScenarioTextError::Twice { kind: self.kind.to_owned(), name: name.to_owned() });
        }
        names.split('+').map(channel).collect()
    }

    fn channel(&mut self) -> Result<OutputRegister> {
        let names = self.channel.unwrap_or_default().to_owned();
        match self.channels()?[..] {
            [channel] => Ok(channel),
            _ => Err(ScenarioTextError::Channel(names)),
        }
    }

    fn optional(&mut self, key: &'static str, allowed: (f64, f64), expected: &'static str) -> Result<Option<f64>> {
        self.known.push(key);
        let Some(text) = self.values.remove(key) else { return Ok(None) };
        let (low, high) = allowed;
        let value = text.parse::<f64>().ok().filter(|value| (low..=high).contains(value));
        let fault = || ScenarioTextError::Value { key: key.to_owned(), value: text.to_owned(), expected };
        value.map(Some).ok_or_else(fault)
    }

    fn within(&mut self, key: &'static str, low: f64, high: f64, expected: &'static str) -> Result<f64> {
        self.optional(key, (low, high), expected)?.ok_or_else(|| {
            let given = self.values.keys().map(|&key| key.to_owned()).collect();
            ScenarioTextError::Missing { kind: self.kind.to_owned(), key, given }
        })
    }

    fn number(&mut self, key: &'static str) -> Result<f64> {
        self.within(key, f64::MIN, f64::MAX, "a finite number")
    }

    fn positive(&mut self, key: &'static str) -> Result<f64> {
        self.within(key, f64::MIN_POSITIVE, f64::MAX, "a positive number")
    }

    fn fraction(&mut self) -> Result<f64> {
        self.within("fraction", 0.0, 1.0, "a fraction from 0 to 1")
    }

    fn number_or(&mut self, key: &'static str, default: f64) -> Result<f64> {
        Ok(self.optional(key, (f64::MIN, f64::MAX), "a finite number")?.unwrap_or(default))
    }

    fn set(&mut self, key: &'static str, value: &mut f64) -> Result<()> {
        *value = self.number_or(key, *value)?;
        Ok(())
    }

    fn set_positive(&mut self, key: &'static str, value: &mut f64) -> Result<()> {
        let allowed = (f64::MIN_POSITIVE, f64::MAX);
        *value = self.optional(key, allowed, "a positive number")?.unwrap_or(*value);
        Ok(())
    }

    /// Returns an error for keys and channels that the kind does not have.
    fn finish(self) -> Result<()> {
        let Some(&key) = self.values.keys().next().or(self.channel.as_ref()) else { return Ok(()) };
        Err(ScenarioTextError::Unknown { kind: self.kind.to_owned(), key: key.to_owned(), known: self.known })
    }
}

#[cfg(test)]
mod tests {
    use super::{Simulation, TimedFault};
    use crate::FrameFault;
    use virtual_sensor::{InjectedEffect, OutputRegister};

    fn plain() -> Simulation {
        Simulation::paper(1.0, 1)
    }

    #[test]
    fn effects_environment_faults_and_coefficients_are_read() {
        let mut simulation = plain();
        simulation.add_effect("sinusoid:gyro_z:frequency=20.5,amplitude=0.2").expect("an effect");
        simulation.add_effect("common_mode:gyro_x+gyro_y:time_constant=30,deviation=0.01").expect("an effect");
        simulation.add_effect("dropped_samples:fraction=0.02").expect("an effect");
        let line = InjectedEffect::Sinusoid {
            channel: OutputRegister::GyroZ,
            frequency_hz: 20.5,
            amplitude: 0.2,
            phase_rad: 0.0,
        };
        assert_eq!(simulation.scenario.effects[0], line);
        assert_eq!(simulation.scenario.effects[1].channels(), [OutputRegister::GyroX, OutputRegister::GyroY]);
        assert_eq!(simulation.scenario.missed_fraction(), 0.02);
        simulation.set_environment("temperature:rise=8,time_constant=900").expect("an environment");
        assert_eq!(simulation.scenario.environment.temperature.rise_c, 8.0);
        simulation.add_fault("stuck_high:from=2,bursts=3").expect("a fault");
        simulation.add_fault("stale:from=1,bursts=1").expect("a fault");
        let first = TimedFault { from_s: 1.0, fault: FrameFault::Stale, bursts: 1 };
        assert_eq!(simulation.faults.first(), Some(&first), "in the order of their times");
        simulation.set_coefficients("gyro_", "0.04,0.01,0.002").expect("coefficients");
        simulation.set_coefficients("gyro_y", "0.08, 0, 0").expect("coefficients");
        let noise = |channel| simulation.noise.channel(channel).angle_random_walk;
        assert_eq!([noise(OutputRegister::GyroX), noise(OutputRegister::GyroY)], [0.04, 0.08]);
    }

    #[test]
    fn every_error_names_what_is_wrong() {
        for (text, expected) in [
            ("hum:gyro_x:frequency=50", "`hum` is none of sinusoid, "),
            ("sinusoid:gyro_q:frequency=1,amplitude=1", "`gyro_q` is no channel"),
            ("sinusoid:frequency=1,amplitude=1", "`` is no channel"),
            ("sinusoid:gyro_x+gyro_y:frequency=1,amplitude=1", "`gyro_x+gyro_y` is no channel"),
            ("sinusoid:gyro_x:frequency=1", "sinusoid needs amplitude"),
            ("sinusoid:gyro_x:frequency=-1,amplitude=1", "frequency: `-1` is not a positive number"),
            ("sinusoid:gyro_x:frequency=1,amplitude=nan", "amplitude: `nan` is not a finite number"),
            ("sinusoid:gyro_x:frequency=1,amplitude=1,size=2", "sinusoid has no size"),
            ("spikes:gyro_x:rate", "`rate` is not of the form KEY=VALUE"),
            ("dropped_samples:gyro_x:fraction=0.1", "dropped_samples has no gyro_x"),
            ("dropped_samples:fraction=2", "fraction: `2` is not a fraction"),
            ("sinusoid:gyro_x:frequency=1,frequency=2,amplitude=1", "sinusoid names frequency twice"),
            ("common_mode:gyro_x+gyro_x:time_constant=30,deviation=0.01", "common_mode names gyro_x twice"),
            ("", "`` is none of"),
        ] {
            let error = plain().add_effect(text).expect_err(text).to_string();
            assert!(error.starts_with(expected), "{text}: {error}");
        }
        for text in ["0.1", "0.1,0.1", "1,2,3,4", "a,b,c", "-1,0,0", "nan,0,0"] {
            assert!(plain().set_coefficients("gyro_", text).is_err(), "{text}");
        }
        assert!(plain().add_fault("stale:from=1,bursts=0").is_err());
        assert!(plain().add_fault("stale:from=-1,bursts=1").is_err());
        assert!(plain().set_environment("motion:time_constant=0").is_err());
    }
}
