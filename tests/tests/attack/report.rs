//! Checks that figures which a report states twice are consistent.

use serde_json::Value;

/// The first contradiction in a report.
pub(crate) fn contradiction(report: &Value) -> Option<String> {
    let rate_hz = report["sample_rate_hz"].as_f64()?;
    let samples = report["samples"].as_u64()?;
    for channel in report["channels"].as_array()? {
        let name = &channel["name"];
        if channel["samples"].as_u64().is_none_or(|own| own > samples) {
            return Some(format!("{name}: more samples than the record has"));
        }
        let mut before = 0;
        for point in channel["curve"].as_array().into_iter().flatten() {
            let (Some(n), Some(tau_s)) = (point["n"].as_u64(), point["tau_s"].as_f64()) else {
                return Some(format!("{name}: a point without a time"));
            };
            if n <= before || (tau_s * rate_hz / n as f64 - 1.0).abs() > 1e-9 {
                return Some(format!("{name}: {tau_s} s for {n} samples at {rate_hz} Hz"));
            }
            before = n;
        }
    }
    outside_of_its_bounds(report, "report")
}

/// The first estimate outside of its own bounds, or with exchanged bounds.
fn outside_of_its_bounds(value: &Value, path: &str) -> Option<String> {
    match value {
        Value::Array(values) => {
            values.iter().enumerate().find_map(|(at, value)| outside_of_its_bounds(value, &format!("{path}[{at}]")))
        }
        Value::Object(fields) => {
            let number = |name: &str| fields.get(name).and_then(Value::as_f64);
            if let (Some(low), Some(high)) = (number("low"), number("high")) {
                let estimate = number("value").or(number("adev"));
                if low > high || estimate.is_some_and(|estimate| !(low..=high).contains(&estimate)) {
                    return Some(format!("{path}: {estimate:?} within {low} and {high}"));
                }
            }
            fields.iter().find_map(|(name, value)| outside_of_its_bounds(value, &format!("{path}.{name}")))
        }
        _ => None,
    }
}

/// Value and bounds of a term of the baseline model.
pub(crate) fn baseline_term(channel: &Value, kind: &str) -> Option<[f64; 3]> {
    let terms = channel["before"]["terms"].as_array()?;
    let term = &terms.iter().find(|term| term["kind"] == kind)?["parameters"]["value"];
    Some([term["value"].as_f64()?, term["low"].as_f64()?, term["high"].as_f64()?])
}
