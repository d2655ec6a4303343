//! Foreign binary files, and how to convert them.

use crate::input::Reason;
use std::fmt::Write;

const FOREIGN: &[(&[u8], &str, &str)] = &[
    (b"RDX2\n", R_WORKSPACE, IN_R),
    (b"RDX3\n", R_WORKSPACE, IN_R),
    (b"RDA2\n", R_WORKSPACE, IN_R),
    (b"RDA3\n", R_WORKSPACE, IN_R),
    (b"X\n\0\0\0", "an R object", "in R: x <- readRDS(\"FILE\"); write.csv(x, \"FILE.csv\", row.names = FALSE)"),
    (b"PAR1", "a Parquet table", "in Python: pandas.read_parquet(\"FILE\").to_csv(\"FILE.csv\", index=False)"),
    (b"ARROW1", "an Arrow table", "in Python: pandas.read_feather(\"FILE\").to_csv(\"FILE.csv\", index=False)"),
    (b"FEA1", "a Feather table", "in Python: pandas.read_feather(\"FILE\").to_csv(\"FILE.csv\", index=False)"),
    (b"TDSm", "a TDMS file of LabVIEW", "in Python: nptdms.TdmsFile(\"FILE\").as_dataframe().to_csv(\"FILE.csv\")"),
    (b"MDF     ", "a measurement file of ASAM MDF", "in Python: asammdf.MDF(\"FILE\").export(\"csv\", \"FILE.csv\")"),
    (b"\xD0\xCF\x11\xE0\xA1\xB1\x1A\xE1", "a file of an old Microsoft Office", "save the sheet as CSV"),
    (b"\xFD7zXZ\0", "compressed by xz", "unxz FILE, and give the result"),
    (b"BZh", "compressed by bzip2", "bunzip2 FILE, and give the result; if it is an R workspace, write.csv in R"),
    (b"7z\xBC\xAF\x27\x1C", "a 7-Zip archive", "unpack it, and give the recording in it"),
    (b"Rar!\x1A\x07", "a RAR archive", "unpack it, and give the recording in it"),
    (b"\x80\x04\x95", PICKLE, IN_PANDAS),
    (b"\x80\x05\x95", PICKLE, IN_PANDAS),
    (
        b"\xAA\x44\x12",
        "a binary log of a NovAtel receiver",
        "convert its RAWIMU messages to CSV with NovAtel's program",
    ),
    (b"\xB5\x62", "a binary log of a u-blox receiver (UBX)", "convert its ESF-MEAS messages to CSV"),
    (
        b"H Product:Blackbox flight data recorder",
        "a blackbox log of Betaflight or INAV",
        "its rates are filtered and rounded by the controller, so that they have no Allan variance of the sensor; record the sensor itself",
    ),
    (b"%PDF-", "a PDF document", "give the recording itself"),
    (b"\x89PNG", "a picture", "give the recording itself"),
    (b"\x7FELF", "a program", "give the recording itself"),
];
const PICKLE: &str = "a Python pickle";
const IN_PANDAS: &str =
    "in Python: pandas.read_pickle(\"FILE\").to_csv(\"FILE.csv\"), or numpy.save(\"FILE.npy\", array) of an array";
const R_WORKSPACE: &str = "an R workspace";
const IN_R: &str = "in R: load(\"FILE\"); ls(); write.csv(NAME, \"NAME.csv\", row.names = FALSE)";

/// Text has fewer than one control character in 64.
const MOST_CONTROLS: usize = 64;
const SHOWN: usize = 16;

pub(crate) fn is_binary(head: &[u8]) -> bool {
    let is_foreign = FOREIGN.iter().any(|(magic, ..)| head.starts_with(magic));
    let is_control = |byte: &&u8| byte.is_ascii_control() && !byte.is_ascii_whitespace() && **byte != 0x1B;
    let controls = head.iter().filter(is_control).count();
    is_foreign || head.contains(&0) || controls * MOST_CONTROLS > head.len()
}

pub(crate) const JSON_DOCUMENT: Reason = Reason::Foreign {
    what: "a JSON document",
    how: "objects are read that stand one in each line; in Python, of a list of them: \
          pandas.read_json(\"FILE\").to_json(\"FILE.jsonl\", orient=\"records\", lines=True)",
};

pub(crate) const REPORT: Reason = Reason::Foreign {
    what: "a report of this program",
    how: "`compare` and `export` take it; `analyze` takes the recording that it was made of",
};

pub(crate) fn is_report(head: &[u8]) -> bool {
    let mut signs = head.iter().filter(|byte| !byte.is_ascii_whitespace());
    br#"{"schema":"#.iter().all(|sign| signs.next() == Some(sign))
}

/// A JSON object over several lines or longer than `head`, or a list of objects or lists.
pub(crate) fn is_json_document(head: &[u8]) -> bool {
    let text = head.trim_ascii_start();
    let mut signs = text.iter().filter(|byte| !byte.is_ascii_whitespace());
    let line = text.split(|byte| *byte == b'\n').next().unwrap_or_default().trim_ascii_end();
    match (signs.next(), signs.next()) {
        (Some(b'['), Some(b'{' | b'[')) => true,
        (Some(b'{'), Some(b'"')) => !line.ends_with(b"}") && !text.starts_with(br#"{"traceEvents""#),
        _ => false,
    }
}

pub(crate) fn refusal(head: &[u8]) -> Reason {
    match FOREIGN.iter().find(|(magic, ..)| head.starts_with(magic)) {
        Some((_, what, how)) => Reason::Foreign { what, how },
        None if is_mavlink(head) => Reason::Foreign {
            what: "a telemetry log of MAVLink",
            how: "with pymavlink: mavlogdump.py --types RAW_IMU --format csv FILE > FILE.csv (or HIGHRES_IMU, SCALED_IMU)",
        },
        None => {
            let known = "known are tables in text, NumPy, MATLAB, HDF5, bags of ROS, MCAP, ULog and DataFlash logs";
            let how = "write its numbers as text or, in Python, with numpy.save(\"FILE.npy\", array)";
            Reason::other(format!("of no known format: it begins with {}; {known}; {how}", shown(head)))
        }
    }
}

/// Two messages of version 1 or 2, each behind 8 bytes of µs since 1970.
fn is_mavlink(head: &[u8]) -> bool {
    const TIME: usize = 8;
    let length = |at: usize| {
        let header = head.get(at + TIME..at + TIME + 3)?;
        // Header, checksum, signature.
        match header[0] {
            0xFE => Some(TIME + 8 + usize::from(header[1])),
            0xFD => Some(TIME + 12 + usize::from(header[1]) + if header[2] & 1 == 1 { 13 } else { 0 }),
            _ => None,
        }
    };
    length(0).is_some_and(|first| length(first).is_some())
}

fn shown(head: &[u8]) -> String {
    let head = &head[..head.len().min(SHOWN)];
    let mut text = String::new();
    for byte in head {
        let _ = write!(text, "{byte:02X} ");
    }
    let letter = |byte: &u8| if byte.is_ascii_graphic() { char::from(*byte) } else { '.' };
    format!("{text}({})", head.iter().map(letter).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::{is_binary, refusal};

    #[test]
    fn text_is_told_from_binary_and_binary_by_its_first_bytes() {
        for text in
            [&b"t,gx\n0,1\n"[..], "t;°/s\n".as_bytes(), b"t\tx\r\n1\t2\r\n", b"gx [\xB0/s]\n1\n", b"\x1b[0mt x\n0 1\n"]
        {
            assert!(!is_binary(text), "{text:?}");
        }
        for (head, words) in [
            (&b"RDX3\nX\n\0\0\0\x03"[..], ["R workspace", "write.csv"]),
            (b"PAR1\x15\x04", ["Parquet", "read_parquet"]),
            (b"\x80\x05\x95\xAA\0\0", ["pickle", "read_pickle"]),
            (
                b"\0\x06\x0A\x24\x18\x1E\x40\0\xFE\0\0\x01\x01\x69\0\0\0\x06\x0A\x24\x18\x1E\x40\0\xFE\0\0",
                ["MAVLink", "csv"],
            ),
            (b"\x01\x02\x03\x04sensor\0\0", ["01 02 03 04 73", "(....sensor..)"]),
        ] {
            assert!(is_binary(head));
            let text = refusal(head).to_string();
            assert!(words.iter().all(|word| text.contains(word)), "{text}");
        }
    }
}
