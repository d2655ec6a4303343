//! Sensor profiles in TOML: included ones and files of the user.

use crate::adis16405;
use crate::profile::{ChannelProfile, DataSheetNoise, DataSheetSensitivities, Quantity, SensorProfile};
use serde::Deserialize;
use std::collections::BTreeSet;
use std::sync::{Mutex, PoisonError};

/// Name and text of each included profile.
const INCLUDED: [(&str, &str); 3] = [
    ("adis16470", include_str!("../profiles/adis16470.toml")),
    ("bmi088", include_str!("../profiles/bmi088.toml")),
    ("mpu6050", include_str!("../profiles/mpu6050.toml")),
];

/// Name of the sensor whose register counts need no profile, and the name for a sensor without a data sheet.
const ADIS16405: &str = "adis16405";
const GENERIC: &str = "generic";

/// The reason for which a profile cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ProfileError {
    #[error("{0}")]
    Syntax(String),
    #[error("channel {channel}: {field} is {value}; it must be positive and finite")]
    NotPositive {
        /// Name of the channel; empty for the sensor.
        channel: String,
        field: &'static str,
        value: f64,
    },
    #[error("channel {channel}: the unit is {unit:?}; that of its quantity is {expected}")]
    Unit {
        /// Name of the channel.
        channel: String,
        unit: String,
        expected: &'static str,
    },
    #[error("two channels are named {0}")]
    DuplicateChannel(String),
    #[error("no channel")]
    NoChannel,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ProfileFile {
    name: String,
    /// A note for readers of the file.
    #[serde(rename = "source")]
    _source: String,
    internal_rate_hz: Option<f64>,
    #[serde(default)]
    native_rates_hz: Vec<f64>,
    #[serde(default)]
    channels: Vec<ChannelGroup>,
}

/// Channels that differ only in their names.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ChannelGroup {
    names: Vec<String>,
    quantity: String,
    unit: String,
    lsb: f64,
    range: Option<f64>,
    initial_bias_error: Option<f64>,
    angle_random_walk: Option<f64>,
    in_run_bias_stability: Option<f64>,
    rate_random_walk: Option<f64>,
    temperature_sensitivity: Option<f64>,
    supply_sensitivity: Option<f64>,
    specific_force_sensitivity: Option<f64>,
}

/// Names by which a user selects a sensor.
pub fn sensor_names() -> impl Iterator<Item = &'static str> {
    [ADIS16405].into_iter().chain(INCLUDED.iter().map(|(name, _)| *name)).chain([GENERIC])
}

/// The profile of the sensor `name`, in upper or lower case. Counts of an ADIS16405's gyros are `gyro_lsb` deg/s. `None` for other names.
#[must_use]
pub fn by_name(name: &str, gyro_lsb: f64) -> Option<SensorProfile> {
    match name.to_lowercase().as_str() {
        ADIS16405 => Some(adis16405::profile(gyro_lsb)),
        GENERIC => Some(SensorProfile::generic()),
        name => included(name),
    }
}

/// The included profile `name`; `None` for other names.
#[must_use]
pub fn included(name: &str) -> Option<SensorProfile> {
    let (_, text) = INCLUDED.iter().find(|(included, _)| included.eq_ignore_ascii_case(name))?;
    parse(text).ok()
}

/// Reads a profile; names are kept until the program ends.
///
/// # Errors
/// The text is not TOML, a field is missing or unknown, or a value is invalid.
pub fn parse(text: &str) -> Result<SensorProfile, ProfileError> {
    let file: ProfileFile = toml::from_str(text).map_err(|error| {
        let before = error.span().and_then(|span| text.get(..span.start)).unwrap_or_default();
        let line = before.matches('\n').count() + 1;
        ProfileError::Syntax(format!("line {line}: {}", error.message()))
    })?;
    let rates = file.native_rates_hz.iter().copied().map(|rate| ("native_rates_hz", rate));
    for (field, value) in rates.chain(file.internal_rate_hz.map(|rate| ("internal_rate_hz", rate))) {
        positive("", field, value)?;
    }
    let mut channels: Vec<ChannelProfile> = Vec::new();
    for group in &file.channels {
        for name in &group.names {
            if channels.iter().any(|channel| channel.name == name) {
                return Err(ProfileError::DuplicateChannel(name.clone()));
            }
            channels.push(channel(group, name)?);
        }
    }
    if channels.is_empty() {
        return Err(ProfileError::NoChannel);
    }
    let fastest = file.native_rates_hz.iter().copied().fold(0.0, f64::max);
    Ok(SensorProfile {
        name: intern(&file.name),
        channels,
        internal_rate_hz: file.internal_rate_hz.unwrap_or(fastest),
        native_rates_hz: file.native_rates_hz,
        ..SensorProfile::generic()
    })
}

fn channel(group: &ChannelGroup, name: &str) -> Result<ChannelProfile, ProfileError> {
    let quantities = Quantity::ALL.into_iter();
    let quantity = quantities.clone().find(|quantity| quantity.name() == group.quantity).ok_or_else(|| {
        let known: Vec<&str> = quantities.map(Quantity::name).collect();
        ProfileError::Syntax(format!("quantity {:?}; known are {}", group.quantity, known.join(", ")))
    })?;
    if group.unit != quantity.unit() {
        let (channel, unit) = (name.to_owned(), group.unit.clone());
        return Err(ProfileError::Unit { channel, unit, expected: quantity.unit() });
    }
    let values = [
        ("lsb", Some(group.lsb)),
        ("range", group.range),
        ("initial_bias_error", group.initial_bias_error),
        ("angle_random_walk", group.angle_random_walk),
        ("in_run_bias_stability", group.in_run_bias_stability),
        ("rate_random_walk", group.rate_random_walk),
        ("temperature_sensitivity", group.temperature_sensitivity),
        ("supply_sensitivity", group.supply_sensitivity),
        ("specific_force_sensitivity", group.specific_force_sensitivity),
    ];
    for (field, value) in values {
        value.map_or(Ok(()), |value| positive(name, field, value))?;
    }
    Ok(ChannelProfile {
        lsb: group.lsb,
        initial_bias_error: group.initial_bias_error,
        range: group.range,
        data_sheet: DataSheetNoise {
            angle_random_walk: group.angle_random_walk,
            in_run_bias_stability: group.in_run_bias_stability,
            rate_random_walk: group.rate_random_walk,
            curve: &[],
        },
        sensitivities: DataSheetSensitivities {
            temperature: group.temperature_sensitivity,
            supply: group.supply_sensitivity,
            specific_force: group.specific_force_sensitivity,
        },
        ..ChannelProfile::generic(intern(name), quantity)
    })
}

fn positive(channel: &str, field: &'static str, value: f64) -> Result<(), ProfileError> {
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    Err(ProfileError::NotPositive { channel: channel.to_owned(), field, value })
}

/// Leaks each distinct text once, since profiles are `Copy`.
fn intern(text: &str) -> &'static str {
    static KNOWN: Mutex<BTreeSet<&'static str>> = Mutex::new(BTreeSet::new());
    let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(interned) = known.get(text) {
        return interned;
    }
    let interned: &'static str = Box::leak(text.to_owned().into_boxed_str());
    known.insert(interned);
    interned
}

#[cfg(test)]
mod tests {
    use super::{by_name, included, parse, sensor_names};

    /// The data sheets state: ADIS16470 0.34 °/√h, 8 °/h, 100 µg/√Hz; BMI088 0.014 °/s/√Hz, 160 and 190 µg/√Hz;
    /// MPU-6050 0.005 °/s/√Hz, 400 µg/√Hz. N is 1/√2 of a one-sided density.
    #[test]
    fn the_included_profiles_state_the_data_sheets() {
        let one_sided = std::f64::consts::FRAC_1_SQRT_2;
        for (name, channel, noise) in [
            ("adis16470", "gyro_x", 0.34 / 60.0),
            ("adis16470", "accl_z", 100e-6 * one_sided),
            ("bmi088", "gyro_z", 0.014 * one_sided),
            ("bmi088", "accl_x", 160e-6 * one_sided),
            ("bmi088", "accl_z", 190e-6 * one_sided),
            ("mpu6050", "gyro_y", 0.005 * one_sided),
            ("mpu6050", "accl_z", 400e-6 * one_sided),
        ] {
            let profile = included(name).expect(name).channel(channel).expect(channel);
            let stated = profile.data_sheet.angle_random_walk.expect("stated");
            assert!((stated / noise - 1.0).abs() < 4e-4, "{name} {channel}: {stated} for {noise}");
        }
        // Full scale has 16 bits; the counts of the ADIS16470 go beyond.
        for (name, channel, counts) in
            [("bmi088", "accl_x", 32_768.0), ("bmi088", "gyro_x", 32_768.0), ("mpu6050", "accl_x", 32_768.0)]
        {
            let profile = included(name).expect(name).channel(channel).expect(channel);
            assert_eq!(profile.range.map(|range| range / profile.lsb), Some(counts), "{name} {channel}");
        }
        let gyro = included("ADIS16470").expect("a name in capitals").channel("gyro_x").expect("gyro");
        assert!((gyro.data_sheet.in_run_bias_stability.expect("stated") * 3600.0 - 8.0).abs() < 0.01);
        assert!(sensor_names().all(|name| by_name(name, 0.05).is_some()));
        assert_eq!(sensor_names().filter(|name| included(name).is_some()).count(), 3);
        assert!(included("adis16405").is_none());
    }

    #[test]
    fn the_names_of_equal_profiles_share_their_memory() {
        let text = "name = \"A1\"\nsource = \"none\"\n[[channels]]\nnames = [\"gyro_x\"]\nquantity = \"angular_rate\"\n\
                    unit = \"deg/s\"\nlsb = 0.1\n";
        let [one, other] = [parse(text), parse(text)].map(|profile| profile.expect("a profile").name.as_ptr());
        assert_eq!(one, other);
    }

    #[test]
    fn an_error_of_a_profile_names_its_cause() {
        let sensor = "name = \"A1\"\nsource = \"none\"\n";
        let channel = |unit: &str, lsb: &str, rest: &str| {
            format!(
                "{sensor}[[channels]]\nnames = [\"gyro_x\"]\nquantity = \"angular_rate\"\nunit = \"{unit}\"\nlsb = {lsb}\n{rest}"
            )
        };
        for (text, expected) in [
            (sensor.to_owned(), "no channel"),
            ("name = 3".to_owned(), "line 1"),
            (channel("rad/s", "0.1", ""), "the unit is \"rad/s\"; that of its quantity is deg/s"),
            (channel("deg/s", "-1.0", ""), "lsb is -1"),
            (channel("deg/s", "nan", ""), "lsb is NaN"),
            (channel("deg/s", "0.1", "noise = 3.0\n"), "unknown field `noise`"),
            (channel("deg/s", "0.1", "range = inf\n"), "range is inf"),
        ] {
            let error = parse(&text).expect_err(expected).to_string();
            assert!(error.contains(expected), "{error}");
        }
    }
}
