//! Records of an MCAP file, those in chunks included, in the memory of one record.
//!
//! The crate `mcap` is not used: its decompression needs a compiler of C.

use crate::input::budget::Budget;
use crate::input::file_bytes::FileBytes;
use crate::input::input_error::{InputError, Reason};
use crate::input::zstd_frames::ZstdFrames;
use flate2::Crc;
use lz4_flex::frame::FrameDecoder;
use std::io::{self, BufReader, Read};

pub(crate) const FORMAT: &str = "MCAP";

/// Largest record or chunk, compressed or not, bytes: images are larger than a message of an IMU, but not so large.
const MAX_RECORD: usize = 1 << 28;
/// First bytes of a file.
const MAGIC_BYTES: u64 = 8;
/// Type and length before each record.
const HEADER_BYTES: usize = 1 + 8;
/// Position of the CRC of a chunk, and after it the name of its compression: after its times and its uncompressed size.
const CRC_AT: usize = 8 + 8 + 8;

/// Types of records.
mod op {
    pub(super) const FOOTER: u8 = 2;
    pub(super) const SCHEMA: u8 = 3;
    pub(super) const CHANNEL: u8 = 4;
    pub(super) const MESSAGE: u8 = 5;
    pub(super) const CHUNK: u8 = 6;
}

/// The records that tell what messages there are, and the messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum McapRecord<'a> {
    Schema {
        id: u16,
        name: &'a str,
        encoding: &'a str,
        definition: &'a [u8],
    },
    Channel {
        id: u16,
        schema: u16,
        topic: &'a str,
        encoding: &'a str,
    },
    /// `log_ns` is when it was recorded.
    Message {
        channel: u16,
        log_ns: u64,
        data: &'a [u8],
    },
}

impl<'a> McapRecord<'a> {
    /// From the bytes of a record; `None` for other types. An error if it is cut off.
    fn decode(opcode: u8, bytes: &'a [u8]) -> Result<Option<Self>, Reason> {
        let mut fields = Fields(bytes);
        let record = match opcode {
            op::SCHEMA => fields.schema(),
            op::CHANNEL => {
                let numbers = fields.number().zip(fields.number());
                let texts = fields.text().zip(fields.text());
                numbers.zip(texts).map(|((id, schema), (topic, encoding))| Self::Channel {
                    id,
                    schema,
                    topic,
                    encoding,
                })
            }
            op::MESSAGE => fields.message(),
            _ => return Ok(None),
        };
        record.map(Some).ok_or_else(|| damaged("a record is cut off"))
    }
}

/// Fields of a record, one after the other.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn take(&mut self, bytes: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(bytes)?;
        self.0 = rest;
        Some(taken)
    }

    fn number(&mut self) -> Option<u16> {
        Some(u16::from_le_bytes(*self.take(2)?.first_chunk()?))
    }

    fn schema(&mut self) -> Option<McapRecord<'a>> {
        let (id, name, encoding) = (self.number()?, self.text()?, self.text()?);
        let length = u32::from_le_bytes(*self.take(4)?.first_chunk()?);
        Some(McapRecord::Schema { id, name, encoding, definition: self.take(length as usize)? })
    }

    fn message(&mut self) -> Option<McapRecord<'a>> {
        let (channel, _sequence) = (self.number()?, self.take(4)?);
        let log_ns = u64::from_le_bytes(*self.take(8)?.first_chunk()?);
        let _published = self.take(8)?;
        Some(McapRecord::Message { channel, log_ns, data: self.0 })
    }

    fn text(&mut self) -> Option<&'a str> {
        let length = u32::from_le_bytes(*self.take(4)?.first_chunk()?);
        std::str::from_utf8(self.take(length as usize)?).ok()
    }
}

fn damaged(error: &str) -> Reason {
    Reason::Format { format: FORMAT, error: error.to_owned().into() }
}

/// Type and length of the record that begins with `header`.
fn type_and_length(header: [u8; HEADER_BYTES]) -> Result<(u8, usize), Reason> {
    let [opcode, length @ ..] = header;
    let length = usize::try_from(u64::from_le_bytes(length)).ok().filter(|length| *length <= MAX_RECORD);
    Ok((opcode, length.ok_or_else(|| damaged("a record is longer than 268435456 bytes"))?))
}

/// Why reading ends: the file is damaged here, or `each` refused a record.
enum Stop {
    Damage(Reason),
    Refusal(InputError),
}

impl From<Reason> for Stop {
    fn from(reason: Reason) -> Self {
        Self::Damage(reason)
    }
}

/// Gives every record to `each`; and why there are no more where the file is damaged or ends early.
pub(crate) fn for_each_record(
    file: &FileBytes,
    budget: Budget,
    mut each: impl FnMut(McapRecord) -> Result<(), InputError>,
) -> Result<Option<Reason>, InputError> {
    let mut meter = budget.meter();
    let mut each = |opcode: u8, bytes: &[u8]| match meter
        .add_bytes(bytes.len() as u64)
        .and_then(|()| McapRecord::decode(opcode, bytes))
    {
        Ok(record) => record.map_or(Ok(()), |record| each(record).map_err(Stop::Refusal)),
        Err(reason) => Err(Stop::Damage(reason)),
    };
    match read(file, &mut each) {
        Ok(()) => Ok(None),
        Err(Stop::Damage(reason)) => Ok(Some(reason)),
        Err(Stop::Refusal(error)) => Err(error),
    }
}

/// Bytes of a chunk that are decompressed at once.
const PIECE_BYTES: usize = 1 << 16;

/// Takes the operation code and the content of a record.
type EachRecord<'a> = dyn FnMut(u8, &[u8]) -> Result<(), Stop> + 'a;

fn read(file: &FileBytes, each: &mut EachRecord) -> Result<(), Stop> {
    let fail = |error| Stop::Refusal(file.error(Reason::Io(error)));
    let mut input = BufReader::new(file.open().map_err(fail)?);
    let mut data = Vec::new();
    let mut next = |bytes: u64, data: &mut Vec<u8>| {
        data.clear();
        input.by_ref().take(bytes).read_to_end(data).map_err(fail)
    };
    next(MAGIC_BYTES, &mut data)?;
    loop {
        next(HEADER_BYTES as u64, &mut data)?;
        let Some(&header) = data.first_chunk() else {
            return Err(Reason::Truncated { format: FORMAT }.into());
        };
        let (opcode, length) = type_and_length(header)?;
        next(length as u64, &mut data)?;
        let is_whole = data.len() == length;
        match opcode {
            op::CHUNK => chunk(&data, each)?,
            op::FOOTER => return Ok(()),
            _ if is_whole => each(opcode, &data)?,
            _ => {}
        }
        if !is_whole {
            return Err(Reason::Truncated { format: FORMAT }.into());
        }
    }
}

/// The records of a chunk, which may be cut off.
fn chunk(data: &[u8], each: &mut EachRecord) -> Result<(), Stop> {
    let cut_off = || damaged("a chunk is cut off");
    let mut fields = Fields(data.get(CRC_AT..).ok_or_else(cut_off)?);
    let crc = fields.take(4).and_then(|bytes| bytes.first_chunk().copied()).map(u32::from_le_bytes);
    let (crc, compression) = crc.zip(fields.text()).ok_or_else(cut_off)?;
    // The length of the records, which follow.
    fields.take(8).ok_or_else(cut_off)?;
    let packed = fields.0;
    let unpacked: Box<dyn Read + '_> = match compression {
        "" => Box::new(packed),
        "lz4" => Box::new(FrameDecoder::new(packed)),
        "zstd" => Box::new(ZstdFrames::new(packed)),
        other => return Err(damaged(&format!("a chunk is compressed by {other}, which is not known")).into()),
    };
    // The checksum and the decoders are slow in pieces of a record.
    let mut input = BufReader::with_capacity(PIECE_BYTES, Summed { input: unpacked, crc: Crc::new() });
    let failed = |error: io::Error| Stop::Damage(damaged(&format!("a chunk is damaged: {error}")));
    let mut record = Vec::new();
    loop {
        record.clear();
        input.by_ref().take(HEADER_BYTES as u64).read_to_end(&mut record).map_err(failed)?;
        let Some(&header) = record.first_chunk() else { break };
        let (opcode, length) = type_and_length(header)?;
        record.clear();
        input.by_ref().take(length as u64).read_to_end(&mut record).map_err(failed)?;
        if record.len() < length {
            return Err(cut_off().into());
        }
        each(opcode, &record)?;
    }
    // Less than a header may be left of a chunk that is cut off.
    let is_right = record.is_empty() && (crc == 0 || crc == input.get_ref().crc.sum());
    if is_right { Ok(()) } else { Err(damaged("the checksum of a chunk is wrong").into()) }
}

/// An input, and the checksum of what was read of it.
struct Summed<'a> {
    input: Box<dyn Read + 'a>,
    crc: Crc,
}

impl Read for Summed<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = self.input.read(buffer)?;
        self.crc.update(&buffer[..read]);
        Ok(read)
    }
}

#[cfg(test)]
mod tests {
    use super::{McapRecord, for_each_record};
    use crate::input::budget::Budget;
    use crate::input::file_bytes::FileBytes;
    use std::path::Path;

    fn record(opcode: u8, parts: &[&[u8]]) -> Vec<u8> {
        let body = parts.concat();
        [&[opcode][..], &(body.len() as u64).to_le_bytes(), &body].concat()
    }

    fn text(text: &str) -> Vec<u8> {
        [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat()
    }

    /// What is read of a file of these records, and whether it is called damaged.
    fn read(records: &[Vec<u8>]) -> (Vec<String>, Option<String>) {
        let file = FileBytes::in_memory(Path::new("x.mcap"), [b"\x89MCAP0\r\n".to_vec(), records.concat()].concat());
        let mut found = Vec::new();
        let damage = for_each_record(&file, Budget::new(0), |record: McapRecord| {
            found.push(format!("{record:?}"));
            Ok(())
        });
        (found, damage.expect("a file that can be read").map(|reason| reason.to_string()))
    }

    /// Lengths that lie: of a text (4 GiB), of a record (beyond its chunk, beyond the file, 16 EiB).
    #[test]
    fn lengths_that_lie_are_damage_after_what_came_before() {
        let schema = record(3, &[&1u16.to_le_bytes(), &text("a/msg/B"), &text("ros2msg"), &text("bool x")]);
        let message = record(5, &[&7u16.to_le_bytes(), &[0; 20], b"data"]);
        let chunk = |records: &[u8]| record(6, &[&[0; 28], &text(""), &(records.len() as u64).to_le_bytes(), records]);
        let footer = record(2, &[&[0; 20]]);
        let whole = [
            "Schema { id: 1, name: \"a/msg/B\", encoding: \"ros2msg\", definition: [98, 111, 111, 108, 32, 120] }",
            "Message { channel: 7, log_ns: 0, data: [100, 97, 116, 97] }",
        ];
        let (found, damage) = read(&[schema.clone(), chunk(&message), footer.clone()]);
        assert_eq!((found.as_slice(), damage), (whole.map(str::to_owned).as_slice(), None));
        let long_text = record(3, &[&2u16.to_le_bytes(), &u32::MAX.to_le_bytes(), b"short"]);
        let mut beyond_chunk = message.clone();
        beyond_chunk[1..9].copy_from_slice(&1000u64.to_le_bytes());
        let mut endless = message.clone();
        endless[1..9].copy_from_slice(&u64::MAX.to_le_bytes());
        for (name, last) in [
            ("text", long_text.clone()),
            ("text in a chunk", chunk(&long_text)),
            ("record in a chunk", chunk(&beyond_chunk)),
            ("record", endless.clone()),
            ("record of a chunk", chunk(&endless)),
            ("end of the file", message[..20].to_vec()),
            ("no footer", Vec::new()),
        ] {
            let mut records = vec![schema.clone(), chunk(&message), last];
            if name == "text" {
                records.push(footer.clone());
            }
            let (found, damage) = read(&records);
            assert_eq!(found, whole, "{name}");
            assert!(damage.is_some(), "{name}");
        }
        // A chunk that is cut off has its records up to there.
        let two = chunk(&[message.clone(), message.clone()].concat());
        let (found, damage) = read(&[schema, two[..two.len() - 3].to_vec()]);
        assert_eq!((found.as_slice(), damage.is_some()), (whole.map(str::to_owned).as_slice(), true));
    }
}
