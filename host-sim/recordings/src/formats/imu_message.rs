//! `sensor_msgs/Imu` of ROS 1 and ROS 2, as it is laid out in bags.

use crate::formats::message_table::{ACCELEROMETER, Fields, GYROSCOPE};
use crate::tables::sensor_table::Number;

/// Names of the message in bags.
pub(crate) const TYPES: [&str; 2] = ["sensor_msgs/Imu", "sensor_msgs/msg/Imu"];

/// What is read after the time, which is that of the header: when the sample was taken, not when the message was written.
pub(crate) const FIELDS: [Fields; 2] = [GYROSCOPE, ACCELEROMETER];
/// Unit of the time.
pub(crate) const TIME_UNIT: &str = "ns";

/// Doubles of the orientation and its covariance, before the angular velocity.
const ORIENTATION: usize = 4 + 9;
/// Doubles of a covariance. A first element of -1 says that the quantity before it is not measured.
const COVARIANCE: usize = 9;

/// Decodes a message of ROS 1: little endian, without padding. `None` for bytes that are too few.
pub(crate) fn decode_ros1(bytes: &[u8]) -> Option<[Number; 7]> {
    let mut fields = Cursor { bytes, at: 0, origin: 0, big: false };
    let _sequence = fields.word()?;
    let (seconds, nanoseconds) = (i64::from(fields.word()?), i64::from(fields.word()?));
    let name = fields.word()? as usize;
    fields.at = fields.at.checked_add(name)?;
    measured(fields, seconds, nanoseconds)
}

/// Decodes a message of ROS 2: CDR of either byte order, whose doubles are aligned to 8 bytes from the end of its own header.
pub(crate) fn decode_cdr(bytes: &[u8]) -> Option<[Number; 7]> {
    const ENCAPSULATION: usize = 4;
    let big = match bytes.get(..2)? {
        [0, 0] => true,
        [0, 1] => false,
        _ => return None,
    };
    let mut fields = Cursor { bytes, at: ENCAPSULATION, origin: ENCAPSULATION, big };
    let seconds = i64::from(fields.word()?.cast_signed());
    let nanoseconds = i64::from(fields.word()?);
    let name = fields.word()? as usize;
    fields.at = fields.at.checked_add(name)?;
    fields.align(8);
    measured(fields, seconds, nanoseconds)
}

fn measured(mut fields: Cursor, seconds: i64, nanoseconds: i64) -> Option<[Number; 7]> {
    for _ in 0..ORIENTATION {
        fields.double()?;
    }
    let mut vector = || -> Option<[f64; 3]> {
        let vector = [fields.double()?, fields.double()?, fields.double()?];
        let first = fields.double()?;
        for _ in 1..COVARIANCE {
            fields.double()?;
        }
        Some(if first == -1.0 { [f64::NAN; 3] } else { vector })
    };
    let (rate, force) = (vector()?, vector()?);
    let time = Number::Integer(seconds.checked_mul(1_000_000_000)?.checked_add(nanoseconds)?);
    let [wx, wy, wz, ax, ay, az] =
        [rate, force].as_flattened().try_into().map(|v: [f64; 6]| v.map(Number::Real)).ok()?;
    Some([time, wx, wy, wz, ax, ay, az])
}

/// Reads fields one after the other.
struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
    /// Where alignment counts from.
    origin: usize,
    big: bool,
}

impl Cursor<'_> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let end = self.at.checked_add(N)?;
        let mut bytes: [u8; N] = self.bytes.get(self.at..end)?.try_into().ok()?;
        self.at = end;
        if self.big {
            bytes.reverse();
        }
        Some(bytes)
    }

    fn word(&mut self) -> Option<u32> {
        self.take().map(u32::from_le_bytes)
    }

    fn double(&mut self) -> Option<f64> {
        self.take().map(f64::from_le_bytes)
    }

    fn align(&mut self, size: usize) {
        self.at = self.origin + (self.at - self.origin).next_multiple_of(size);
    }
}

#[cfg(test)]
mod tests {
    use super::{decode_cdr, decode_ros1};
    use crate::tables::sensor_table::Number;

    /// The doubles of a message: orientation and its covariance, rate and its covariance, force and its covariance.
    fn doubles(big: bool, force_unknown: bool) -> Vec<u8> {
        let mut values = vec![0.0f64; 13];
        values.extend([0.25, -0.5, 0.75]);
        values.extend([0.0; 9]);
        values.extend([9.0, 8.0, 7.0]);
        values.extend([0.0; 9]);
        if force_unknown {
            values[28] = -1.0;
        }
        values.iter().flat_map(|value| if big { value.to_be_bytes() } else { value.to_le_bytes() }).collect()
    }

    #[test]
    fn both_byte_orders_and_every_length_of_the_frame_name_are_read() {
        for length in 0..9u32 {
            for big in [false, true] {
                let word = |value: u32| if big { value.to_be_bytes() } else { value.to_le_bytes() };
                let mut cdr = vec![0, u8::from(!big), 0, 0];
                for value in [7, 250_000_000, length] {
                    cdr.extend(word(value));
                }
                cdr.extend(vec![b'a'; length as usize]);
                cdr.resize(4 + (cdr.len() - 4).next_multiple_of(8), 0);
                cdr.extend(doubles(big, false));
                let decoded = decode_cdr(&cdr).expect("complete");
                assert_eq!(decoded[0], Number::Integer(7_250_000_000));
                assert_eq!(
                    decoded[1..].iter().map(|n| n.value()).collect::<Vec<_>>(),
                    [0.25, -0.5, 0.75, 9.0, 8.0, 7.0]
                );
                assert!((0..cdr.len()).all(|end| decode_cdr(&cdr[..end]).is_none()));
            }
            let mut ros1: Vec<u8> =
                [3, 7, 250_000_000, length].iter().flat_map(|word: &u32| word.to_le_bytes()).collect();
            ros1.extend(vec![b'a'; length as usize]);
            ros1.extend(doubles(false, true));
            let decoded = decode_ros1(&ros1).expect("complete");
            assert_eq!((decoded[0], decoded[3]), (Number::Integer(7_250_000_000), Number::Real(0.75)));
            assert!(decoded[4].value().is_nan(), "a force that is not measured");
            assert!((0..ros1.len()).all(|end| decode_ros1(&ros1[..end]).is_none()));
        }
        let endless_name = [0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 255, 255, 255, 255];
        assert_eq!(decode_cdr(&endless_name), None);
    }
}
