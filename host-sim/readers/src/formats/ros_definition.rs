//! Definitions of ROS 1 (bags) and ROS 2 (MCAP) as text.

use crate::formats::message_layout::{Definitions, Field, FieldType, MessageLayout, Repeat, Scalar};
use crate::input::Reason;

/// With different headers, times, and types of one byte.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum RosVersion {
    Ros1,
    Ros2,
}

/// Layout of `kind`, such as `sensor_msgs/Imu`, by its definition and those behind lines of `=` and `MSG: TYPE`.
pub(crate) fn layout(kind: &str, definition: &str, version: RosVersion) -> Result<MessageLayout, Reason> {
    let root = short(kind);
    let mut definitions = known(version);
    let mut name = root.clone();
    let mut fields = Vec::new();
    for line in definition.lines() {
        let line = line.trim();
        if line.len() > 2 && line.bytes().all(|byte| byte == b'=') {
            definitions.insert(std::mem::take(&mut name), std::mem::take(&mut fields));
        } else if let Some(kind) = line.strip_prefix("MSG:").filter(|_| fields.is_empty()) {
            name = short(kind.trim());
        } else if let Some(field) = field(line, &name, version) {
            fields.push(field);
        }
    }
    definitions.insert(name, fields);
    MessageLayout::new(&root, &definitions)
}

/// Types of ROS itself; `None` for others.
pub(crate) fn known_layout(kind: &str, version: RosVersion) -> Option<MessageLayout> {
    let definitions = known(version);
    let root = short(kind);
    definitions.contains_key(&root).then(|| MessageLayout::new(&root, &definitions).ok())?
}

/// `package/Type` of `package/msg/Type`.
fn short(kind: &str) -> String {
    kind.replace("/msg/", "/")
}

fn known(version: RosVersion) -> Definitions {
    let header = match version {
        RosVersion::Ros1 => "uint32 seq\ntime stamp\nstring frame_id",
        RosVersion::Ros2 => "builtin_interfaces/Time stamp\nstring frame_id",
    };
    let imu = "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n\
        geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n\
        geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance";
    let types = [
        ("std_msgs/Header", header),
        ("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z"),
        ("geometry_msgs/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w"),
        ("sensor_msgs/Imu", imu),
    ];
    let fields = |name: &str, text: &str| text.lines().filter_map(|line| field(line, name, version)).collect();
    types.into_iter().map(|(name, text)| (name.to_owned(), fields(name, text))).collect()
}

/// `None` for comments and constants.
fn field(line: &str, owner: &str, version: RosVersion) -> Option<Field> {
    let line = line.split('#').next()?.trim();
    let (kind, rest) = line.split_once(char::is_whitespace)?;
    let rest = rest.trim_start();
    let end = rest.find(|letter: char| !(letter.is_alphanumeric() || letter == '_')).unwrap_or(rest.len());
    let (name, rest) = rest.split_at(end);
    if name.is_empty() || rest.trim_start().starts_with('=') {
        return None;
    }
    let (kind, repeat) = match kind.split_once('[') {
        None => (kind, Repeat::Once),
        Some((kind, count)) => match count.trim_end_matches(']').parse() {
            Ok(count) => (kind, Repeat::Times(count)),
            // `[]`, `[<=3]`.
            Err(_) => (kind, Repeat::Any),
        },
    };
    Some(Field { name: name.to_owned(), kind: field_type(kind, owner, version), repeat })
}

fn field_type(kind: &str, owner: &str, version: RosVersion) -> FieldType {
    // `string<=8`.
    let plain = kind.split("<=").next().unwrap_or(kind);
    let scalar = match (plain, version) {
        ("bool" | "uint8" | "char", _) | ("byte", RosVersion::Ros2) => Scalar::Unsigned(1),
        ("int8" | "byte", _) => Scalar::Signed(1),
        ("int16", _) => Scalar::Signed(2),
        ("uint16", _) => Scalar::Unsigned(2),
        ("int32", _) => Scalar::Signed(4),
        ("uint32", _) => Scalar::Unsigned(4),
        ("int64", _) => Scalar::Signed(8),
        ("uint64", _) => Scalar::Unsigned(8),
        ("float32", _) => Scalar::Float(4),
        ("float64", _) => Scalar::Float(8),
        ("time" | "duration", RosVersion::Ros1) => return FieldType::Time,
        ("string", _) => return FieldType::Text,
        // Letter size depends on the writer.
        ("wstring" | "wchar", _) => return FieldType::Unknown(plain.to_owned()),
        (other, _) => {
            let other = short(other);
            return match (other.as_str(), version) {
                ("builtin_interfaces/Time" | "builtin_interfaces/Duration", RosVersion::Ros2) => FieldType::Time,
                ("Header", _) => FieldType::Nested("std_msgs/Header".to_owned()),
                (name, _) if name.contains('/') => FieldType::Nested(other),
                (name, _) => {
                    let package = owner.split_once('/').map_or("", |(package, _)| package);
                    match (package, name, version) {
                        ("builtin_interfaces", "Time" | "Duration", RosVersion::Ros2) => FieldType::Time,
                        _ => FieldType::Nested(format!("{package}/{name}")),
                    }
                }
            };
        }
    };
    FieldType::Scalar(scalar)
}

#[cfg(test)]
mod tests {
    use super::{RosVersion, known_layout, layout};
    use crate::formats::message_layout::{Encoding, MessageLayout};
    use crate::rows::Number;

    /// Orientation, rate, force, each with covariance.
    fn doubles(big: bool) -> Vec<u8> {
        let mut values = vec![0.0f64; 13];
        values.extend([0.25, -0.5, 0.75]);
        values.extend([0.0; 9]);
        values.extend([9.0, 8.0, 7.0]);
        values.extend([0.0; 9]);
        values.iter().flat_map(|value| if big { value.to_be_bytes() } else { value.to_le_bytes() }).collect()
    }

    fn measured(layout: &MessageLayout, message: &[u8], encoding: Encoding) -> Option<Vec<Number>> {
        let mut row = Vec::new();
        layout.decode(message, encoding, &mut row)?;
        let at = |name: &str| layout.columns().iter().position(|column| column.name == name).expect("a column");
        let axes = ["angular_velocity", "linear_acceleration"].into_iter();
        let axes = axes.flat_map(|vector| ["x", "y", "z"].map(|axis| format!("{vector}.{axis}")));
        Some(std::iter::once("header.stamp".to_owned()).chain(axes).map(|name| row[at(&name)]).collect())
    }

    #[test]
    fn both_byte_orders_and_every_length_of_the_frame_name_are_read() {
        let expected: Vec<Number> = std::iter::once(Number::Integer(7_250_000_000))
            .chain([0.25, -0.5, 0.75, 9.0, 8.0, 7.0].map(Number::Real))
            .collect();
        let ros2 = known_layout("sensor_msgs/msg/Imu", RosVersion::Ros2).expect("known");
        let ros1 = known_layout("sensor_msgs/Imu", RosVersion::Ros1).expect("known");
        for length in 0..9u32 {
            for big in [false, true] {
                let word = |value: u32| if big { value.to_be_bytes() } else { value.to_le_bytes() };
                let mut cdr = vec![0, u8::from(!big), 0, 0];
                for value in [7, 250_000_000, length] {
                    cdr.extend(word(value));
                }
                cdr.extend(vec![b'a'; length as usize]);
                cdr.resize(4 + (cdr.len() - 4).next_multiple_of(8), 0);
                cdr.extend(doubles(big));
                assert_eq!(measured(&ros2, &cdr, Encoding::Cdr).expect("complete"), expected);
                assert!((0..cdr.len()).all(|end| measured(&ros2, &cdr[..end], Encoding::Cdr).is_none()));
            }
            let mut message: Vec<u8> =
                [3, 7, 250_000_000, length].iter().flat_map(|word: &u32| word.to_le_bytes()).collect();
            message.extend(vec![b'a'; length as usize]);
            message.extend(doubles(false));
            assert_eq!(measured(&ros1, &message, Encoding::Packed).expect("complete"), expected);
        }
        let endless_name = [0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 255, 255, 255, 255];
        assert_eq!(measured(&ros2, &endless_name, Encoding::Cdr), None);
    }

    #[test]
    fn constants_comments_defaults_and_bounds_are_no_fields() {
        let text = "# a comment\nuint8 MOST=3\nstring NAME=a # b\nint32 count 5\nstring<=4 name \"x\"\nfloat32[<=3] some\nfloat32[2] two\n";
        let layout = layout("a/msg/B", text, RosVersion::Ros2).expect("a layout");
        let names: Vec<&str> = layout.columns().iter().map(|column| column.name.as_str()).collect();
        let some = (0..16).map(|at| format!("some[{at}]"));
        let expected: Vec<String> =
            ["count".to_owned()].into_iter().chain(some).chain(["two[0]", "two[1]"].map(str::to_owned)).collect();
        assert_eq!(names, expected);
        // Each aligned to 4 bytes.
        let words = [7u32, 2, u32::from_le_bytes(*b"x\0\0\0"), 1, 1.5f32.to_bits(), 2.5f32.to_bits(), 3.5f32.to_bits()];
        let message: Vec<u8> = [0, 1, 0, 0].into_iter().chain(words.into_iter().flat_map(u32::to_le_bytes)).collect();
        let mut row = Vec::new();
        layout.decode(&message, Encoding::Cdr, &mut row).expect("complete");
        let is_there = |number: &Number| !number.value().is_nan();
        let found: Vec<(usize, f64)> = row
            .iter()
            .enumerate()
            .filter(|(_, number)| is_there(number))
            .map(|(at, number)| (at, number.value()))
            .collect();
        assert_eq!(found, [(0, 7.0), (1, 1.5), (17, 2.5), (18, 3.5)]);
    }

    #[test]
    fn definitions_that_are_missing_or_contain_themselves_are_refused() {
        for text in ["pkg/Other x", "a/B x"] {
            assert!(layout("a/B", text, RosVersion::Ros1).is_err(), "{text}");
        }
    }
}
