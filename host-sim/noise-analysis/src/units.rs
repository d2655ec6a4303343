//! Units of coefficients: the unit that a coefficient has by the channel's unit, and its conversion to other usual units.
//!
//! A continuous coefficient belongs to the process at any sample rate. A discrete one is a standard deviation of samples at
//! the rate of the record, and changes with the rate. Each conversion says which of the two it gives.

use allan_core::NoiseTerm;
use allan_core::term::CoefficientUnit;

/// Standard gravity, m/s².
pub(crate) const GRAVITY: f64 = 9.806_65;

/// A unit and the factor to it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Conversion {
    /// Such as `deg/sqrt(h)`.
    pub unit: &'static str,
    /// Factor of the coefficient of a channel in deg/s, g or gauss, with times in s.
    pub factor: f64,
    /// True if the coefficient is a standard deviation of samples at the record's rate.
    pub discrete: bool,
}

const fn continuous(unit: &'static str, factor: f64) -> Conversion {
    Conversion { unit, factor, discrete: false }
}

const fn discrete(unit: &'static str, factor: f64) -> Conversion {
    Conversion { unit, factor, discrete: true }
}

/// The unit of the coefficient of a term of `kind` in a channel in `unit`, such as `deg/sqrt(s)` of a channel in `deg/s`.
#[must_use]
pub(crate) fn coefficient_unit(kind: &NoiseTerm, unit: &str) -> String {
    match (kind.unit(), unit.strip_suffix("/s")) {
        (CoefficientUnit::TimesSecond, Some(angle)) => angle.to_owned(),
        (CoefficientUnit::TimesSecond, None) => format!("{unit}*s"),
        (CoefficientUnit::TimesRootSecond, Some(angle)) => format!("{angle}/sqrt(s)"),
        (CoefficientUnit::TimesRootSecond, None) => format!("{unit}/sqrt(Hz)"),
        (CoefficientUnit::Itself, _) => unit.to_owned(),
        (CoefficientUnit::PerRootSecond, _) => format!("{unit}/sqrt(s)"),
        (CoefficientUnit::PerSecond, Some(angle)) => format!("{angle}/s^2"),
        (CoefficientUnit::PerSecond, None) => format!("{unit}/s"),
    }
}

/// The usual units of the coefficient `kind` (a name of the JSON schema) of a channel in `unit`, sampled at `rate_hz`.
///
/// Empty for other kinds and channels than N, B and K of a gyroscope, an accelerometer or a magnetometer. The discrete form
/// of a random walk is its step from one sample to the next.
#[must_use]
pub fn conversions(kind: &str, unit: &str, rate_hz: f64) -> Vec<Conversion> {
    const RAD: f64 = std::f64::consts::PI / 180.0;
    let root_rate = rate_hz.sqrt();
    match (unit, kind) {
        ("deg/s", "angle_random_walk") => vec![
            continuous("deg/sqrt(s)", 1.0),
            continuous("deg/sqrt(h)", 60.0),
            continuous("rad/s/sqrt(Hz)", RAD),
            discrete("deg/s", root_rate),
            discrete("rad/s", RAD * root_rate),
        ],
        ("deg/s", "bias_instability") => {
            vec![continuous("deg/s", 1.0), continuous("deg/h", 3600.0), continuous("rad/s", RAD)]
        }
        ("deg/s", "rate_random_walk") => vec![
            continuous("deg/s/sqrt(s)", 1.0),
            continuous("deg/h/sqrt(h)", 3600.0 * 60.0),
            continuous("rad/s^2/sqrt(Hz)", RAD),
            discrete("rad/s", RAD / root_rate),
        ],
        ("g", "angle_random_walk") => vec![
            continuous("ug/sqrt(Hz)", 1e6),
            continuous("m/s/sqrt(h)", GRAVITY * 60.0),
            continuous("m/s^2/sqrt(Hz)", GRAVITY),
            discrete("m/s^2", GRAVITY * root_rate),
        ],
        ("g", "bias_instability") => vec![continuous("ug", 1e6), continuous("m/s^2", GRAVITY)],
        ("g", "rate_random_walk") => vec![
            continuous("ug/sqrt(s)", 1e6),
            continuous("ug/sqrt(h)", 1e6 * 60.0),
            continuous("m/s^3/sqrt(Hz)", GRAVITY),
            discrete("m/s^2", GRAVITY / root_rate),
        ],
        ("gauss", "angle_random_walk") => {
            vec![continuous("mgauss/sqrt(Hz)", 1e3), discrete("mgauss", 1e3 * root_rate)]
        }
        ("gauss", "bias_instability") => vec![continuous("mgauss", 1e3)],
        _ => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::conversions;

    #[test]
    fn conversions_agree_with_published_pairs() {
        let convert = |kind, channel, to: &str, value: f64| {
            let conversions = conversions(kind, channel, 100.0);
            conversions.iter().find(|conversion| conversion.unit == to).map(|conversion| value * conversion.factor)
        };
        // ADIS16405 data sheet: 2.0 deg/√h and 0.2 m/s/√h; 0.007 deg/s = 25.2 deg/h; the paper: 0.0368 deg/√s = 2.208 deg/√h.
        for (kind, channel, to, value, expected) in [
            ("angle_random_walk", "deg/s", "deg/sqrt(h)", 0.0368, 2.208),
            ("bias_instability", "deg/s", "deg/h", 0.007, 25.2),
            // Kalibr's example for an ADIS16448: 0.0002 rad/s/√Hz is 0.6875 deg/√h.
            ("angle_random_walk", "deg/s", "rad/s/sqrt(Hz)", 0.6875 / 60.0, 0.0002),
            // 1 deg/h/√h is 1/3600/60 deg/s/√s.
            ("rate_random_walk", "deg/s", "deg/h/sqrt(h)", 1.0 / 216_000.0, 1.0),
            ("angle_random_walk", "g", "m/s/sqrt(h)", 340e-6, 0.2),
            // At 100 Hz the standard deviation of a sample of white noise is √100 times its N.
            ("angle_random_walk", "deg/s", "deg/s", 0.0368, 0.368),
        ] {
            let found = convert(kind, channel, to, value).expect(to);
            assert!((found / expected - 1.0).abs() < 1e-3, "{value} {to}: {found} for {expected}");
        }
        assert!(conversions("angle_random_walk", "degC", 100.0).is_empty());
    }
}
