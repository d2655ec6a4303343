//! Coefficients in the units that people ask for, each named as of the continuous process or of its samples.
//!
//! A continuous coefficient belongs to the process, whatever the rate; a discrete one is a standard deviation of samples
//! at the rate of the record, and is another number at another rate. To take one for the other is the commonest mistake
//! with noise coefficients.

/// Standard gravity, m/s².
pub const GRAVITY: f64 = 9.806_65;

/// A unit and what a coefficient in the channel's own unit is multiplied with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Conversion {
    /// Such as `deg/sqrt(h)`.
    pub unit: &'static str,
    /// From the coefficient of a channel in deg/s, g or gauss, with seconds.
    pub factor: f64,
    /// Whether the number is one of samples at a rate.
    pub discrete: bool,
}

const fn continuous(unit: &'static str, factor: f64) -> Conversion {
    Conversion { unit, factor, discrete: false }
}

const fn discrete(unit: &'static str, factor: f64) -> Conversion {
    Conversion { unit, factor, discrete: true }
}

/// The units of the coefficient `kind` (a name of the JSON schema) of a channel in `unit`, sampled at `rate_hz`.
///
/// None for a kind or a channel of which nobody asks. The discrete form of a random walk is its step from one sample to
/// the next.
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
    fn published_pairs_agree() {
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
            // A tenth of a second between samples would give the number itself; at 100 Hz white noise is ten times its N.
            ("angle_random_walk", "deg/s", "deg/s", 0.0368, 0.368),
        ] {
            let found = convert(kind, channel, to, value).expect(to);
            assert!((found / expected - 1.0).abs() < 1e-3, "{value} {to}: {found} for {expected}");
        }
        assert!(conversions("angle_random_walk", "degC", 100.0).is_empty());
    }
}
