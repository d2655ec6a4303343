//! Sentences with a checksum of what is between their first sign and `*`: those of NMEA 0183, `$NAME,field,…*68`, by exclusive or,
//! and NovAtel's ASCII logs, `#NAME,header…;field,…*1234abcd` or with `%`, by a CRC (OEM7 Commands and Logs Reference Manual, 1.1 and
//! 1.10).

use crate::columns::AvailableColumn;

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Sentence<'a> {
    pub(crate) name: &'a str,
    pub(crate) fields: Vec<&'a str>,
    /// True for a right or absent checksum.
    pub(crate) is_intact: bool,
}

impl<'a> Sentence<'a> {
    pub(crate) fn parse(line: &'a str) -> Option<Self> {
        if let Some(content) = line.strip_prefix(['#', '%']) {
            let (content, digits) = content.split_once('*')?;
            let stated = u32::from_str_radix(digits.trim_end(), 16).ok().filter(|_| digits.trim_end().len() == 8)?;
            let (header, fields) = content.split_once(';')?;
            let name = header.split(',').next().filter(|name| is_name(name))?;
            let is_intact = stated == crc(content.as_bytes());
            return Some(Self { name, fields: fields.split(',').map(str::trim).collect(), is_intact });
        }
        let content = line.strip_prefix(['$', '!'])?;
        let (content, is_intact) = match content.rsplit_once('*') {
            Some((content, digits)) => {
                let stated = u8::from_str_radix(digits.trim_end(), 16).ok().filter(|_| digits.trim_end().len() == 2);
                (content, stated == Some(content.bytes().fold(0, |sum, byte| sum ^ byte)))
            }
            None => (content, true),
        };
        let (name, fields) = content.split_once(',')?;
        is_name(name).then(|| Self { name, fields: fields.split(',').map(str::trim).collect(), is_intact })
    }
}

fn is_name(name: &str) -> bool {
    !name.is_empty() && name.bytes().all(|byte| byte.is_ascii_alphanumeric())
}

/// The polynomial of CRC-32, from 0 and without a final inversion.
fn crc(bytes: &[u8]) -> u32 {
    let shift = |crc: u32, _| crc >> 1 ^ if crc & 1 == 1 { 0xEDB8_8320 } else { 0 };
    bytes.iter().fold(0, |crc, byte| (0..8).fold(crc ^ u32::from(*byte), shift))
}

/// Names by the manual, else numbers from 1.
pub(crate) fn columns(name: &str, width: usize) -> Vec<AvailableColumn> {
    const ATTITUDE: &[(&str, &str)] = &[("yaw", ""), ("pitch", ""), ("roll", "")];
    const QUATERNION: &[(&str, &str)] = &[("q0", ""), ("q1", ""), ("q2", ""), ("q3", "")];
    const MAGNETIC: &[(&str, &str)] = &[("magn_x", "gauss"), ("magn_y", "gauss"), ("magn_z", "gauss")];
    const ACCELERATION: &[(&str, &str)] = &[("accl_x", "m/s^2"), ("accl_y", "m/s^2"), ("accl_z", "m/s^2")];
    const RATE: &[(&str, &str)] = &[("gyro_x", "rad/s"), ("gyro_y", "rad/s"), ("gyro_z", "rad/s")];
    // Seconds of a GPS week; increments of a sample, in counts or in rad and m/s.
    const GPS: &[(&str, &str)] = &[("week", ""), ("time", "s")];
    const COUNTS: &[(&str, &str)] =
        &[("accl_z", ""), ("-accl_y", ""), ("accl_x", ""), ("gyro_z", ""), ("-gyro_y", ""), ("gyro_x", "")];
    const INCREMENTS: &[(&str, &str)] =
        &[("gyro_x", ""), ("gyro_y", ""), ("gyro_z", ""), ("accl_x", ""), ("accl_y", ""), ("accl_z", "")];
    const STATUS: &[(&str, &str)] = &[("status", "")];
    const TYPE: &[(&str, &str)] = &[("imu info", ""), ("imu type", "")];
    // VectorNav VN-100 (UM001), ASCII measurement messages; NovAtel (SPAN on OEM6 Firmware Reference Manual).
    let parts: &[&[(&str, &str)]] = match name {
        "VNYMR" => &[ATTITUDE, MAGNETIC, ACCELERATION, RATE],
        "VNQMR" => &[QUATERNION, MAGNETIC, ACCELERATION, RATE],
        "VNIMU" => &[MAGNETIC, ACCELERATION, RATE, &[("temp", "degC"), ("pressure", "")]],
        "VNMAR" => &[MAGNETIC, ACCELERATION, RATE],
        "VNACC" => &[ACCELERATION],
        "VNGYR" => &[RATE],
        "VNMAG" => &[MAGNETIC],
        "RAWIMUA" | "RAWIMUSA" => &[GPS, STATUS, COUNTS],
        "RAWIMUXA" | "RAWIMUSXA" => &[TYPE, GPS, STATUS, COUNTS],
        "CORRIMUDATAA" | "CORRIMUDATASA" | "IMURATECORRIMUSA" => &[GPS, INCREMENTS],
        _ => &[],
    };
    let known: Vec<AvailableColumn> =
        parts.concat().iter().map(|(name, unit)| AvailableColumn::known(name, unit)).collect();
    if known.len() == width {
        return known;
    }
    (1..=width).map(|number| AvailableColumn { name: number.to_string(), unit: None }).collect()
}

#[cfg(test)]
mod tests {
    use super::{Sentence, columns};

    /// `$GPGLL` with 1D is a well-known example.
    #[test]
    fn a_sentence_has_a_name_fields_and_a_checksum() {
        let content = "VNYMR,+006.380,+000.023,-001.953,+1.0640,-0.2531,+3.0614,+00.005,+00.344,-09.758,-0.001222,-0.000450,-0.001218";
        let checksum = content.bytes().fold(0u8, |sum, byte| sum ^ byte);
        let line = format!("${content}*{checksum:02X}");
        let sentence = Sentence::parse(&line).expect("a sentence");
        assert_eq!((sentence.name, sentence.fields.len(), sentence.is_intact), ("VNYMR", 12, true));
        assert_eq!(sentence.fields[11], "-0.001218");
        let damaged = line.replace("+006", "+007");
        assert!(!Sentence::parse(&damaged).expect("a sentence").is_intact);
        assert!(Sentence::parse("$GPGLL,4916.45,N,12311.12,W,225444,A,*1D").expect("a sentence").is_intact);
        // By the unit tests of NovAtel's own decoder.
        let log = "%RAWIMUSXA,1692,484620.664;00,11,1692,484620.664389000,00801503,43110635,-817242,-202184,-215194,-41188,-9895*a5db8c7b";
        let sentence = Sentence::parse(log).expect("a log");
        assert_eq!((sentence.name, sentence.fields.len(), sentence.is_intact), ("RAWIMUSXA", 11, true));
        assert!(!Sentence::parse(&log.replace("-9895", "-9896")).expect("a log").is_intact);
        let column = &columns("RAWIMUSXA", 11)[9];
        assert_eq!((column.name.as_str(), column.prefix_and_channel()), ("-gyro_y", Some(("-", "gyro_y"))));
        for line in ["#t,x;y", "#A,1;2*1234567", "%A 1;2*12345678", "", "$", "$VNYMR", "VNYMR,1*00", "$a b,1", "12,13"]
        {
            assert_eq!(Sentence::parse(line), None, "{line}");
        }
        let known = columns("VNYMR", 12);
        assert_eq!((known[9].name.as_str(), known[9].unit.map(|unit| unit.name)), ("gyro_x", Some("rad/s")));
        assert_eq!(columns("PIMU", 2)[1].name, "2");
    }
}
