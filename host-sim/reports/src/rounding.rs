//! Estimates rounded to their intervals, in units with SI prefixes.

use noise_analysis::report::Parameter;

/// Stands for an absent number or one that is not finite.
pub const NONE: &str = "–";

/// Widest relative half-width of an interval written `± half`.
const SYMMETRIC: f64 = 0.25;
/// Largest ratio of both sides of such an interval.
const SKEW: f64 = 1.3;

/// The least and the largest; infinite without any.
pub(crate) fn extremes(values: impl IntoIterator<Item = f64>) -> (f64, f64) {
    values.into_iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), of| (of.min(low), of.max(high)))
}

/// The printed unit: `deg/sqrt(s)` becomes `°/√s`.
pub fn unit(name: &str) -> String {
    let symbols = [("degC", "°C"), ("deg", "°"), ("sqrt(Hz)", "√Hz"), ("sqrt(s)", "√s"), ("sqrt(h)", "√h")];
    let powers = [("^2", "²"), ("^3", "³")];
    let spelled = symbols.iter().chain(&powers).fold(name.to_owned(), |name, (plain, sign)| name.replace(plain, sign));
    if spelled.starts_with("ug") { spelled.replacen("ug", "µg", 1) } else { spelled }
}

fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let (sign, digits) = text.strip_prefix('-').map_or(("", text.as_str()), |digits| ("−", digits));
    let (whole, fraction) = digits.split_once('.').map_or((digits, None), |(whole, fraction)| (whole, Some(fraction)));
    if whole.bytes().chain(fraction.into_iter().flat_map(str::bytes)).all(|digit| digit == b'0') {
        return fraction.map_or_else(|| "0".to_owned(), |fraction| format!("0.{fraction}"));
    }
    let whole = grouped(whole);
    fraction.map_or_else(|| format!("{sign}{whole}"), |fraction| format!("{sign}{whole}.{fraction}"))
}

pub(crate) fn grouped(digits: &str) -> String {
    let is_start = |at: usize| at > 0 && (digits.len() - at).is_multiple_of(3);
    digits.char_indices().flat_map(|(at, digit)| is_start(at).then_some(',').into_iter().chain([digit])).collect()
}

/// Decimals for an uncertainty: two digits if it begins with 1 or 2, else one.
fn decimals(half_width: f64) -> usize {
    if !half_width.is_finite() || half_width <= 0.0 {
        return 3;
    }
    place(half_width).clamp(0, 9) as usize
}

fn place(half_width: f64) -> i32 {
    let exponent = half_width.log10().floor();
    let leading = half_width / 10f64.powf(exponent);
    let digits = if leading < 2.95 { 1.0 } else { 0.0 };
    (digits - exponent) as i32
}

/// `value` rounded to the place that `half_width` supports.
fn at_place(value: f64, half_width: f64) -> f64 {
    if half_width >= 29.5 && half_width.is_finite() {
        let unit = 10f64.powi(-place(half_width));
        return (value / unit).round() * unit;
    }
    value
}

/// An estimate with 95 % bounds: `2.43 ± 0.01`, `24.3 (21 … 27)`, `< 190` for an upper bound, `–` without an estimate.
pub fn estimate(value: f64, low: f64, high: f64) -> String {
    if !value.is_finite() {
        return NONE.to_owned();
    }
    if !(low.is_finite() && high.is_finite()) || high <= low {
        return plain(value, 3);
    }
    if is_upper_bound(value, low) {
        return format!("< {}", significant(high, 2));
    }
    let (below, above) = (value - low, high - value);
    let half = (high - low) / 2.0;
    let is_symmetric = below.max(above) <= SKEW * below.min(above) && half <= SYMMETRIC * value.abs();
    if is_symmetric {
        let decimals = decimals(half);
        return format!("{} ± {}", fixed(at_place(value, half), decimals), fixed(at_place(half, half), decimals));
    }
    // Digits that keep the three apart, six at most.
    let written = |digits| [value, low, high].map(|of| significant(of, digits));
    let apart = (2..6).map(written).find(|[value, low, high]| value != low && value != high);
    let [value, low, high] = apart.unwrap_or_else(|| written(2));
    if low == high { value } else { format!("{value} ({low} … {high})") }
}

/// Only the upper bound is known.
pub(crate) fn is_upper_bound(value: f64, low: f64) -> bool {
    low <= 0.0 && value >= 0.0
}

/// A number with `digits` significant digits and no exponent.
pub fn significant(value: f64, digits: i32) -> String {
    if !value.is_finite() {
        return NONE.to_owned();
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    // Rounded first: 9.96 has the exponent of 10.0.
    let scaled = format!("{value:.*e}", usize::try_from(digits - 1).unwrap_or(0));
    let Some((value, exponent)) =
        scaled.parse::<f64>().ok().zip(scaled.split_once('e').and_then(|(_, exponent)| exponent.parse::<i32>().ok()))
    else {
        return scaled;
    };
    fixed(value, usize::try_from(digits - 1 - exponent).unwrap_or(0))
}

/// A number with its sign: `+2.1`, `−3.6`.
pub fn signed(value: f64, digits: i32) -> String {
    format!("{}{}", if value < 0.0 { "−" } else { "+" }, significant(value.abs(), digits))
}

/// A number without trailing zeros: `100`, `8`, `91.4`.
pub fn plain(value: f64, digits: i32) -> String {
    let text = significant(value, digits);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// A number of a column of any magnitude: `100`, `−0.0413`, `−3.92e−4`. An integer has all of its digits.
pub fn compact(value: f64, digits: i32) -> String {
    let is_usual = !value.is_finite() || (1e-3..1e7).contains(&value.abs());
    if value.fract() != 0.0 && is_usual {
        return plain(value, digits);
    }
    if value.fract() == 0.0 && value.abs() < 1e20 {
        return format!("{value:.0}").replace('-', "−");
    }
    let scaled = format!("{value:.*e}", usize::try_from(digits - 1).unwrap_or(0)).replace('-', "−");
    let (mantissa, exponent) = scaled.split_once('e').unwrap_or((&scaled, "0"));
    format!("{}e{exponent}", mantissa.trim_end_matches('0').trim_end_matches('.'))
}

/// Two digits; `< 0.001` below.
pub fn probability(p: f64) -> String {
    match p {
        p if !p.is_finite() => NONE.to_owned(),
        p if p < 9.95e-4 => "< 0.001".to_owned(),
        p => significant(p, 2),
    }
}

/// A probability in a sentence: `p = 0.21`, `p < 0.001`.
pub fn p_value(p: f64) -> String {
    let text = probability(p);
    if text.starts_with('<') { format!("p {text}") } else { format!("p = {text}") }
}

const PREFIXES: [(&str, f64); 7] =
    [("M", 1e6), ("k", 1e3), ("", 1.0), ("m", 1e-3), ("µ", 1e-6), ("n", 1e-9), ("p", 1e-12)];

/// Prefix that brings `magnitude` to 1 … 1,000, and its factor. None above 1 unless `enlarging`: k°/h is unusual.
fn prefix(magnitude: f64, enlarging: bool) -> (&'static str, f64) {
    let mut usable = PREFIXES.iter().filter(|(_, factor)| enlarging || *factor <= 1.0);
    let fitting = usable.clone().find(|(_, factor)| magnitude >= 0.995 * factor);
    fitting.or(usable.next_back()).copied().filter(|_| magnitude > 0.0 && magnitude.is_finite()).unwrap_or(("", 1.0))
}

/// A unit with a prefix for `magnitude`, and the divisor of its values. A prefix is replaced: `ug` is `g` times 10⁻⁶.
fn prefixed(magnitude: f64, name: &str) -> (String, f64) {
    let spelled = unit(name);
    // A tenth of a degree is 0.1 °.
    let takes_no_prefix = spelled.starts_with(|first: char| first.is_ascii_digit())
        || matches!(spelled.as_str(), "" | "%" | "°C" | "min" | "h");
    let (bare, of_name) = match spelled.strip_prefix('µ') {
        Some(bare) => (bare, 1e-6),
        None if spelled.starts_with("mgauss") => (&spelled["m".len()..], 1e-3),
        None => (spelled.as_str(), 1.0),
    };
    let magnitude = of_name * magnitude;
    if takes_no_prefix || (0.0995..1000.0).contains(&magnitude) {
        return (bare.to_owned(), 1.0 / of_name);
    }
    let (prefix, factor) = prefix(magnitude, bare == "Hz");
    (format!("{prefix}{bare}"), factor / of_name)
}

/// Two digits and a prefix: `0.012 °/s` is `12 m°/s`.
pub fn quantity(value: f64, name: &str) -> String {
    quantity_digits(value, name, 2)
}

pub fn quantity_digits(value: f64, name: &str, digits: i32) -> String {
    if !value.is_finite() {
        return NONE.to_owned();
    }
    let (unit, factor) = prefixed(value.abs(), name);
    format!("{} {unit}", significant(value / factor, digits)).trim_end().to_owned()
}

/// Significant digits, two to four, that the interval supports.
pub fn supported_digits(value: f64, low: f64, high: f64) -> i32 {
    let half_width = (high - low) / 2.0;
    if half_width > 0.0 && half_width.is_finite() && value != 0.0 && value.is_finite() {
        (value.abs().log10().floor() as i32 + 1 + place(half_width)).clamp(2, 4)
    } else {
        2
    }
}

pub fn rounded_quantity(parameter: &Parameter) -> String {
    let &Parameter { value, low, high, ref unit } = parameter;
    quantity_digits(value, unit, supported_digits(value, low, high))
}

/// A parameter with its interval: `20.70 ± 0.10 Hz`.
pub fn bounded_quantity(parameter: &Parameter) -> String {
    let scale = Scale::new([parameter_magnitude(parameter)], &parameter.unit);
    format!("{} {}", scale.estimate(parameter), scale.unit).trim_end().to_owned()
}

/// The printed value or upper bound.
pub fn parameter_magnitude(parameter: &Parameter) -> f64 {
    let &Parameter { value, low, high, .. } = parameter;
    if is_upper_bound(value, low) { high } else { value }
}

/// One unit with a prefix for a row or a column.
#[derive(Debug, Clone, PartialEq)]
pub struct Scale {
    pub unit: String,
    factor: f64,
}

impl Scale {
    /// Fits the largest of `values`, in the unit `name`.
    pub fn new(values: impl IntoIterator<Item = f64>, name: &str) -> Self {
        let finite = values.into_iter().map(f64::abs).filter(|value| value.is_finite());
        let (unit, factor) = prefixed(finite.fold(0.0, f64::max), name);
        Self { unit, factor }
    }

    pub fn number(&self, value: f64, digits: i32) -> String {
        significant(value / self.factor, digits)
    }

    pub fn estimate(&self, &Parameter { value, low, high, .. }: &Parameter) -> String {
        let scaled = |of: f64| of / self.factor;
        if value < 0.0 {
            let sign = if high < 0.0 { "−" } else { "" };
            format!("{sign}{}", estimate(scaled(-value), scaled(-high), scaled(-low)))
        } else {
            estimate(scaled(value), scaled(low), scaled(high))
        }
    }
}

/// Prefix and factor for the largest of a column's `values`; none from 0.1 on.
pub fn column_prefix(values: impl Iterator<Item = f64>) -> (&'static str, f64) {
    let largest = values.filter(|value| value.is_finite()).fold(0.0, f64::max);
    if largest >= 0.1 || largest == 0.0 { ("", 1.0) } else { prefix(largest, false) }
}

/// A duration in one or two units: `20 ms`, `3 h 02 min`, `9 h`.
pub fn span(seconds: f64) -> String {
    if !seconds.is_finite() {
        return NONE.to_owned();
    }
    if seconds < 99.5 {
        return quantity(seconds, "s");
    }
    let minutes = (seconds / 60.0).round();
    if minutes < 60.0 {
        return format!("{minutes} min");
    }
    let (hours, rest) = ((minutes / 60.0).floor(), minutes % 60.0);
    if hours >= 48.0 {
        return format!("{} d {} h", (hours / 24.0).floor(), hours % 24.0);
    }
    if rest == 0.0 { format!("{hours} h") } else { format!("{hours} h {rest:02} min") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_estimate_has_the_digits_that_its_interval_supports() {
        for (value, low, high, text) in [
            (2.4312, 2.4212, 2.4412, "2.431 ± 0.010"),
            (2.4312, 2.39, 2.47, "2.43 ± 0.04"),
            (24.3, 20.9, 27.4, "24 ± 3"),
            (24.3, 14.0, 37.0, "24 (14 … 37)"),
            (240.0, 60.0, 420.0, "240 (60 … 420)"),
            (0.0, 0.0, 187.0, "< 190"),
            (863.2, 820.0, 906.0, "860 ± 40"),
            (12.0, 0.0, 31.0, "< 31"),
            (232.0, 231.0, 238.0, "232 (231 … 238)"),
            (12.02, 12.01, 12.4, "12.02 (12.01 … 12.40)"),
            (4.4, 3.6, 4.4, "4.4 (3.6 … 4.4)"),
            (12.0, 12.0, 12.000_1, "12"),
            (f64::NAN, 0.0, 1.0, NONE),
        ] {
            assert_eq!(estimate(value, low, high), text, "{value} ({low} … {high})");
        }
    }

    #[test]
    fn quantities_have_prefixes_in_their_units() {
        for (value, name, text) in [
            (0.27, "deg/s", "0.27 °/s"),
            (0.012, "deg/s", "12 m°/s"),
            (22e-6, "g", "22 µg"),
            (9.96e-4, "g", "1.0 mg"),
            (20.7, "Hz", "21 Hz"),
            (0.02, "s", "20 ms"),
            (-0.0043, "deg/s/degC", "−4.3 m°/s/°C"),
            (0.0, "g", "0 g"),
        ] {
            assert_eq!(quantity(value, name), text, "{value} {name}");
        }
    }

    #[test]
    fn a_quantity_without_its_interval_has_the_digits_that_the_interval_supports() {
        for (value, half_width, name, text) in [
            (816.427, 0.036, "Hz", "816.4 Hz"),
            (20.5, 0.002, "Hz", "20.50 Hz"),
            (20.7, 1.2, "Hz", "20.7 Hz"),
            (0.2003, 0.0018, "deg/s", "0.2003 °/s"),
            (0.00179, 0.0003, "deg/s", "1.8 m°/s"),
            (240.0, 180.0, "Hz", "240 Hz"),
            (-0.0043, 0.0004, "deg/s/degC", "−4.3 m°/s/°C"),
            (8.0, 0.0, "Hz", "8.0 Hz"),
        ] {
            let parameter = Parameter::new(value, value - half_width, value + half_width, name);
            assert_eq!(rounded_quantity(&parameter), text, "{value} ± {half_width}");
        }
    }

    #[test]
    fn units_become_readable() {
        assert_eq!(unit("deg/sqrt(s)"), "°/√s");
        assert_eq!(unit("deg/s/sqrt(s)"), "°/s/√s");
        assert_eq!(unit("degC"), "°C");
        assert_eq!(unit("gauss"), "gauss");
        assert_eq!(unit("ug/sqrt(Hz)"), "µg/√Hz");
        assert_eq!(unit("deg/h/sqrt(h)"), "°/h/√h");
        assert_eq!(unit("m/s^3/sqrt(Hz)"), "m/s³/√Hz");
    }

    #[test]
    fn the_numbers_of_a_row_share_a_prefix_that_their_unit_takes() {
        for (values, name, spelled, text) in [
            (vec![37.14e-6, 36.8e-6], "g/sqrt(Hz)", "µg/√Hz", "36.8"),
            (vec![36.8], "ug/sqrt(Hz)", "µg/√Hz", "36.8"),
            (vec![0.0368], "ug", "ng", "36.8"),
            (vec![36_800.0], "ug", "mg", "36.8"),
            (vec![0.0368], "mgauss", "µgauss", "36.8"),
            (vec![f64::NAN, 0.5, 36.8e-3], "deg/s", "°/s", "0.0368"),
            (vec![0.0368], "%", "%", "0.0368"),
            (vec![0.0368], "1/h", "1/h", "0.0368"),
        ] {
            let scale = Scale::new(values.iter().copied(), name);
            assert_eq!(
                (scale.unit.as_str(), scale.number(values[values.len() - 1], 3).as_str()),
                (spelled, text),
                "{name}"
            );
        }
        // Only the upper bound is known: its prefix.
        assert_eq!(bounded_quantity(&Parameter::new(0.0, 0.0, 19e-6, "g")), "< 19 µg");
    }

    #[test]
    fn a_number_of_any_magnitude_has_one_minus_sign_and_no_zeros_at_its_end() {
        for (value, text) in [
            (0.0, "0"),
            (-300.0, "−300"),
            (1_784_000_000_123_456.0, "1784000000123456"),
            (-0.041_3, "−0.0413"),
            (-3.916_65e-4, "−3.91665e−4"),
            (1e-4, "1e−4"),
            (12_345_678.5, "1.23457e7"),
            (f64::NAN, NONE),
        ] {
            assert_eq!(compact(value, 6), text, "{value:e}");
        }
    }

    #[test]
    fn probabilities_have_two_digits_and_no_exponent() {
        for (p, text) in [
            (1.0, "1.0"),
            (0.633, "0.63"),
            (0.028_3, "0.028"),
            (0.001, "0.0010"),
            (1.63e-7, "< 0.001"),
            (0.0, "< 0.001"),
            (f64::NAN, NONE),
        ] {
            assert_eq!(probability(p), text, "{p:e}");
        }
        assert_eq!([0.21, 1e-9].map(p_value), ["p = 0.21", "p < 0.001"]);
    }

    #[test]
    fn durations_are_short() {
        for (seconds, text) in
            [(0.02, "20 ms"), (80.0, "80 s"), (600.0, "10 min"), (10_940.0, "3 h 02 min"), (32_400.0, "9 h")]
        {
            assert_eq!(span(seconds), text);
        }
    }
}
