//! Lines that name their numbers: `gx: 0.01, gy: 0.02`, `t=5 gx=0.01`, or JSON objects.

use serde_json::Value;

/// Names with their texts.
pub(crate) type Record = Vec<(String, String)>;

const SEPARATORS: [char; 4] = [',', ';', '\t', '|'];

pub(crate) fn parse(line: &str) -> Option<Record> {
    let line = line.trim();
    if line.starts_with('{') {
        let Ok(object @ Value::Object(_)) = serde_json::from_str(line) else { return None };
        let mut found = Vec::new();
        add(&object, "", &mut found);
        return (!found.is_empty()).then_some(found);
    }
    // `IMU {t : 5, gx : 0.1}` behind a log's time.
    let inner = line.strip_suffix('}').and_then(|line| line.split_once('{')).map_or(line, |(_, inner)| inner);
    pairs(inner).filter(|found| found.len() > 1)
}

/// The pairs of a line of text, perhaps none; `None` for another line.
pub(crate) fn pairs(line: &str) -> Option<Record> {
    let mut found: Record = Vec::new();
    let (mut rest, mut group) = (line, "");
    while let Some((label, after)) = rest.split_once([':', '=']) {
        let label = label.rsplit(SEPARATORS).next().unwrap_or(label).trim_matches([' ', '>', '"']);
        let after = after.trim_start();
        let end = after.find(|sign: char| SEPARATORS.contains(&sign) || sign.is_ascii_whitespace());
        let (value, next) = after.split_at(end.unwrap_or(after.len()));
        if !label.starts_with(char::is_alphabetic) {
            return None;
        }
        rest = next;
        if value.contains('=') {
            // A log's own words, before the first name.
            rest = after;
        } else if label.len() == 1 && !group.is_empty() {
            found.push((format!("{group} {label}"), value.to_owned()));
        } else {
            // `Gyro X=0.5 Y=0.1`.
            group = label.strip_suffix(" X").or_else(|| label.strip_suffix(" x")).unwrap_or_default();
            found.push((label.to_owned(), value.to_owned()));
        }
    }
    Some(found)
}

/// JSON by path: `gyro.x`, `gyro.0`.
fn add(value: &Value, path: &str, found: &mut Record) {
    let inner = |name: &str| if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") };
    match value {
        Value::Object(fields) => fields.iter().for_each(|(name, value)| add(value, &inner(name), found)),
        Value::Array(values) => {
            values.iter().enumerate().for_each(|(number, value)| add(value, &inner(&number.to_string()), found));
        }
        Value::Null => found.push((path.to_owned(), String::new())),
        Value::Bool(value) => found.push((path.to_owned(), u8::from(*value).to_string())),
        Value::Number(number) => found.push((path.to_owned(), number.to_string())),
        Value::String(text) => found.push((path.to_owned(), text.clone())),
    }
}

#[cfg(test)]
mod tests {
    use super::parse;

    #[test]
    fn numbers_are_found_with_their_names() {
        for (line, expected) in [
            ("gx: 0.01, gy: -0.02", "gx=0.01 gy=-0.02"),
            ("t=12 Gyro X=0.5 Y=1e-3", "t=12 Gyro X=0.5 Gyro Y=1e-3"),
            ("I (90) imu: ax=0.1 ay=-1", "ax=0.1 ay=-1"),
            ("10:00:13.5: IMU {TimeUS : 5, GyrX : -0.1}", "TimeUS=5 GyrX=-0.1"),
            (">gx:1,gy:2", "gx=1 gy=2"),
            ("time: 10:00:13.5\tax: 1 g\tay: 2 g", "time=10:00:13.5 ax=1 ay=2"),
            (r#"{"t": 5, "gyro": [0.1, 2], "imu": {"ax": null}}"#, "gyro.0=0.1 gyro.1=2 imu.ax= t=5"),
        ] {
            let found = parse(line).unwrap_or_else(|| panic!("{line}"));
            let found: Vec<String> = found.into_iter().map(|(name, value)| format!("{name}={value}")).collect();
            assert_eq!(found.join(" "), expected);
        }
        for line in ["0.1, 0.2", "Start Time: Unknown", "12:00:01 0.5", "[1, 2]", "{\"a\"", "# gx, gy", ""] {
            assert_eq!(parse(line), None, "{line}");
        }
    }
}
