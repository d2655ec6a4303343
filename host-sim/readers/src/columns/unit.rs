//! Units of columns and their factors to the units of the analysis.

/// Standard gravity, m/s².
const GRAVITY: f64 = 9.806_65;
/// deg/s per rad/s.
const DEGREES: f64 = 180.0 / std::f64::consts::PI;

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Unit {
    pub(crate) name: &'static str,
    /// Unit of the analysis; `s` for times, `count` for register counts.
    pub(crate) base: &'static str,
    /// Size of this unit, in `base`.
    pub(crate) factor: f64,
}

pub(crate) const SECOND: &str = "s";
pub(crate) const COUNT: &str = "count";

/// The name, and other spellings, [normalized](normalized).
const UNITS: &[(&[&str], &str, f64)] = &[
    (&["deg/s", "degs", "degs-1", "deg/sec", "dps", "degps"], "deg/s", 1.0),
    (&["rpm", "r/min", "rev/min"], "deg/s", 6.0),
    (&["mdeg/s", "mdegs", "mdps"], "deg/s", 1e-3),
    (&["deg/h", "degh", "deg/hr", "dph"], "deg/s", 1.0 / 3600.0),
    (&["rad/s", "rads", "rads-1", "rad/sec", "radps"], "deg/s", DEGREES),
    (&["mrad/s", "mrads", "mrads-1"], "deg/s", 1e-3 * DEGREES),
    (&["g"], "g", 1.0),
    (&["mg"], "g", 1e-3),
    (&["ug"], "g", 1e-6),
    (&["m/s^2", "m/s2", "ms2", "ms-2", "m/s/s", "mps2", "m/ss"], "g", 1.0 / GRAVITY),
    (&["cm/s^2", "cm/s2", "cms2", "cms-2"], "g", 1e-2 / GRAVITY),
    (&["mm/s^2", "mm/s2", "mms2", "mms-2"], "g", 1e-3 / GRAVITY),
    (&["mGal", "mgal"], "g", 1e-5 / GRAVITY),
    (&["gauss", "gs"], "gauss", 1.0),
    (&["mgauss"], "gauss", 1e-3),
    (&["T", "tesla"], "gauss", 1e4),
    (&["mT", "mt"], "gauss", 10.0),
    (&["uT", "ut"], "gauss", 1e-2),
    (&["nT", "nt"], "gauss", 1e-5),
    // The origin does not matter to noise.
    (&["degC", "degc", "celsius", "c"], "degC", 1.0),
    (&["K", "kelvin", "k"], "degC", 1.0),
    (&["V", "v", "volt"], "V", 1.0),
    (&["mV", "mv"], "V", 1e-3),
    (&["s", "sec", "secs", "seconds"], SECOND, 1.0),
    (&["ms", "msec", "millis", "milliseconds"], SECOND, 1e-3),
    (&["us", "usec", "micros", "microseconds"], SECOND, 1e-6),
    (&["ns", "nsec", "nanos", "nanoseconds"], SECOND, 1e-9),
    (&["min", "minutes"], SECOND, 60.0),
    (&["h", "hr", "hours"], SECOND, 3600.0),
    (&["days"], SECOND, 86_400.0),
    (&["counts", "count", "lsb", "raw"], COUNT, 1.0),
];

impl Unit {
    /// Such as `rad/s`, `m s^-2`, `°/s` or `mg`, also with a factor: `0.07*deg/s`, `deg/s/131`; `None` for other texts.
    #[must_use]
    pub(crate) fn parse(text: &str) -> Option<Self> {
        let number = |text: &str| text.trim().parse::<f64>().ok().filter(|number| number.is_normal() && *number > 0.0);
        Self::named(text).or_else(|| {
            let multiple = text.split_once('*').and_then(|(factor, unit)| Some((unit, number(factor)?)));
            let part = || text.rsplit_once('/').and_then(|(unit, divisor)| Some((unit, number(divisor)?.recip())));
            let (unit, factor) = multiple.or_else(part)?;
            let unit = Self::named(unit)?;
            Some(Self { factor: factor * unit.factor, ..unit })
        })
    }

    fn named(text: &str) -> Option<Self> {
        let spelling = normalized(text);
        UNITS.iter().find_map(|(spellings, base, factor)| {
            let known = spellings.iter().any(|known| *known == text.trim() || *known == spelling);
            known.then_some(Self { name: spellings[0], base, factor: *factor })
        })
    }

    pub(crate) fn names() -> impl Iterator<Item = &'static str> {
        UNITS.iter().map(|(spellings, ..)| spellings[0])
    }

    #[must_use]
    pub(crate) fn is_time(&self) -> bool {
        self.base == SECOND
    }
}

/// Small letters; `deg` for °, `u` for µ, `/` for "per"; no blanks, underscores, powers, multiplication signs.
fn normalized(text: &str) -> String {
    let mut plain = String::with_capacity(text.len());
    for letter in text.to_lowercase().chars() {
        match letter {
            '°' => plain.push_str("deg"),
            'µ' | 'μ' => plain.push('u'),
            '²' => plain.push('2'),
            ' ' | '_' | '^' | '*' | '·' | '(' | ')' => {}
            other => plain.push(other),
        }
    }
    plain.replace("per", "/")
}

#[cfg(test)]
mod tests {
    use super::Unit;

    #[test]
    fn units_are_understood_as_people_write_them() {
        // 1 rad/s is 57.29578 deg/s; 1 m/s² is 0.1019716 g; 1 µT is 0.01 gauss.
        for (texts, base, factor) in [
            (&["deg/s", "°/s", "dps", "deg_s", "deg_per_s", "deg s^-1"][..], "deg/s", 1.0),
            (&["rad/s", "rad s^-1", "rad_s", "rad_per_sec", "Rad/S", "radps"], "deg/s", 57.295_78),
            (&["m/s^2", "m s^-2", "m/s²", "m_s2", "m/s**2", "m_per_s2", "mps2"], "g", 0.101_971_6),
            (&["cm/s^2", "cm/s²"], "g", 1.019_716e-3),
            (&["mm/s^2", "mm_s2"], "g", 1.019_716e-4),
            (&["mGal"], "g", 1.019_716e-6),
            (&["rpm"], "deg/s", 6.0),
            (&["mT"], "gauss", 10.0),
            (&["mg"], "g", 1e-3),
            (&["µT", "uT"], "gauss", 0.01),
            (&["°C", "degC", "C"], "degC", 1.0),
            (&["us", "µs"], "s", 1e-6),
            (&["min"], "s", 60.0),
            (&["counts", "LSB"], "count", 1.0),
            (&["deg/s/131", "deg/s / 131"], "deg/s", 1.0 / 131.0),
            (&["0.07*deg/s", "70*mdps", "0.07 * dps"], "deg/s", 0.07),
            (&["g/16384"], "g", 6.103_515_6e-5),
        ] {
            for text in texts {
                let unit = Unit::parse(text).unwrap_or_else(|| panic!("{text}"));
                assert_eq!(unit.base, base, "{text}");
                assert!((unit.factor / factor - 1.0).abs() < 1e-6, "{text}: {}", unit.factor);
            }
        }
        for text in ["", "x", "m/s", "furlong", "s^2", "deg/s/0", "-1*g", "g/", "nan*g", "2", "1/2"] {
            assert_eq!(Unit::parse(text), None, "{text}");
        }
    }
}
