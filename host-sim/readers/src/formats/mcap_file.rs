//! Records of MCAP in the memory of one chunk. The crate `mcap` unpacks chunks by libraries in C.

use crate::formats::topics::Stop;
use crate::input::{Budget, FileBytes, InputError, Meter, Metered, Reason, ZstdFrames};
use flate2::Crc;
use lz4_flex::frame::FrameDecoder;
use std::io::{self, BufReader, Read, Seek, SeekFrom};

pub(crate) const FORMAT: &str = "MCAP";

const MAX_RECORD: usize = 1 << 28;
/// Has the index of each chunk.
const MAX_SUMMARY: u64 = 1 << 26;
/// First and last bytes.
const MAGIC: &[u8] = b"\x89MCAP0\r\n";
const HEADER_BYTES: usize = 1 + 8;
const END_BYTES: usize = HEADER_BYTES + 8 + 8 + 4 + MAGIC.len();
/// Offset of the counts, and size of an entry.
const COUNTS_AT: usize = 8 + 2 + 4 * 4 + 2 * 8;
const COUNT_BYTES: usize = 2 + 8;
/// Behind times and uncompressed size.
const CRC_AT: usize = 8 + 8 + 8;

mod op {
    pub(super) const FOOTER: u8 = 2;
    pub(super) const SCHEMA: u8 = 3;
    pub(super) const CHANNEL: u8 = 4;
    pub(super) const MESSAGE: u8 = 5;
    pub(super) const CHUNK: u8 = 6;
    pub(super) const STATISTICS: u8 = 11;
}

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
    /// `log_ns` is the time of recording.
    Message {
        channel: u16,
        log_ns: u64,
        data: &'a [u8],
    },
    Counts(MessageCounts<'a>),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct MessageCounts<'a>(&'a [u8]);

impl MessageCounts<'_> {
    pub(crate) fn iter(&self) -> impl Iterator<Item = (u16, u64)> {
        self.0.chunks_exact(COUNT_BYTES).filter_map(|entry| {
            let (channel, count) = entry.split_first_chunk()?;
            Some((u16::from_le_bytes(*channel), u64::from_le_bytes(*count.first_chunk()?)))
        })
    }
}

impl<'a> McapRecord<'a> {
    /// `None` for other types; an error if cut off.
    fn decode(opcode: u8, bytes: &'a [u8]) -> Result<Option<Self>, Reason> {
        let mut fields = Fields(bytes);
        let mut record = || {
            Some(Some(match opcode {
                op::SCHEMA => Self::Schema {
                    id: fields.number()?,
                    name: fields.text()?,
                    encoding: fields.text()?,
                    definition: fields.bytes()?,
                },
                op::CHANNEL => Self::Channel {
                    id: fields.number()?,
                    schema: fields.number()?,
                    topic: fields.text()?,
                    encoding: fields.text()?,
                },
                op::MESSAGE => {
                    let (channel, _sequence, log_ns) = (fields.number()?, fields.take(4)?, fields.take(8)?);
                    let (log_ns, _published) = (u64::from_le_bytes(*log_ns.first_chunk()?), fields.take(8)?);
                    Self::Message { channel, log_ns, data: fields.0 }
                }
                op::STATISTICS => {
                    fields.take(COUNTS_AT)?;
                    Self::Counts(MessageCounts(fields.bytes()?))
                }
                _ => return Some(None),
            }))
        };
        record().ok_or_else(|| damaged("a record is cut off"))
    }
}

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

    fn bytes(&mut self) -> Option<&'a [u8]> {
        let length = u32::from_le_bytes(*self.take(4)?.first_chunk()?);
        self.take(length as usize)
    }

    fn text(&mut self) -> Option<&'a str> {
        std::str::from_utf8(self.bytes()?).ok()
    }
}

fn damaged(error: &str) -> Reason {
    Reason::damaged(FORMAT, error)
}

fn cut_off() -> Reason {
    damaged("a chunk is cut off")
}

fn type_and_length(header: [u8; HEADER_BYTES]) -> Result<(u8, usize), Reason> {
    let [opcode, length @ ..] = header;
    let length = usize::try_from(u64::from_le_bytes(length)).ok().filter(|length| *length <= MAX_RECORD);
    Ok((opcode, length.ok_or_else(|| damaged("a record is longer than 268435456 bytes"))?))
}

type EachRecord<'a> = dyn FnMut(McapRecord) -> Result<(), InputError> + 'a;

/// With the reason of an early end.
pub(crate) fn for_each_record(
    file: &FileBytes,
    budget: Budget,
    mut each: impl FnMut(McapRecord) -> Result<(), InputError>,
) -> Result<Option<Reason>, InputError> {
    Stop::damage(read(file, &mut budget.meter(), &mut each))
}

/// Records of the final summary; false without one, as after an interruption.
pub(crate) fn for_each_of_summary(file: &FileBytes, mut each: impl FnMut(McapRecord)) -> bool {
    let summary = || -> io::Result<Vec<u8>> {
        let mut input = file.open()?;
        let end = input.seek(SeekFrom::End(-(END_BYTES as i64)))?;
        let mut footer = [0; END_BYTES];
        input.read_exact(&mut footer)?;
        let start = footer[HEADER_BYTES..].first_chunk().map_or(0, |start| u64::from_le_bytes(*start));
        let is_whole = footer[0] == op::FOOTER && footer.ends_with(MAGIC) && (1..end).contains(&start);
        let mut summary = Vec::new();
        if is_whole && end - start <= MAX_SUMMARY {
            input.seek(SeekFrom::Start(start))?;
            input.take(end - start).read_to_end(&mut summary)?;
        }
        Ok(summary)
    };
    let mut has_counts = false;
    let read = summary().map(|summary| {
        records(&summary, &mut |record| {
            has_counts |= matches!(record, McapRecord::Counts(_));
            each(record);
            Ok(())
        })
    });
    has_counts && matches!(read, Ok(Ok(())))
}

fn read(file: &FileBytes, meter: &mut Meter, each: &mut EachRecord) -> Result<(), Stop> {
    let fail = |error| Stop::Refusal(file.error(Reason::Io(error)));
    let mut input = BufReader::new(file.open().map_err(fail)?);
    let (mut data, mut unpacked) = (Vec::new(), Vec::new());
    let mut next = |bytes: u64, data: &mut Vec<u8>| {
        data.clear();
        input.by_ref().take(bytes).read_to_end(data).map_err(fail)
    };
    next(MAGIC.len() as u64, &mut data)?;
    loop {
        next(HEADER_BYTES as u64, &mut data)?;
        let Some(&header) = data.first_chunk() else {
            return Err(Reason::Truncated { format: FORMAT }.into());
        };
        let (opcode, length) = type_and_length(header)?;
        next(length as u64, &mut data)?;
        let is_whole = data.len() == length;
        match opcode {
            op::CHUNK => chunk(&data, &mut unpacked, meter, each)?,
            op::FOOTER => return Ok(()),
            _ if is_whole => give(opcode, &data, each)?,
            _ => {}
        }
        if !is_whole {
            return Err(Reason::Truncated { format: FORMAT }.into());
        }
    }
}

fn give(opcode: u8, data: &[u8], each: &mut EachRecord) -> Result<(), Stop> {
    Ok(McapRecord::decode(opcode, data)?.map_or(Ok(()), each)?)
}

fn chunk(data: &[u8], unpacked: &mut Vec<u8>, meter: &mut Meter, each: &mut EachRecord) -> Result<(), Stop> {
    let mut fields = Fields(data.get(CRC_AT..).ok_or_else(cut_off)?);
    let crc = fields.take(4).and_then(|bytes| bytes.first_chunk().copied()).map(u32::from_le_bytes);
    let (crc, compression) = crc.zip(fields.text()).ok_or_else(cut_off)?;
    // Length of the records.
    fields.take(8).ok_or_else(cut_off)?;
    let packed = fields.0;
    let decoder: Box<dyn Read + '_> = match compression {
        "" => Box::new(io::empty()),
        "lz4" => Box::new(FrameDecoder::new(packed)),
        "zstd" => Box::new(ZstdFrames::new(packed)),
        other => return Err(damaged(&format!("a chunk is compressed by {other}, which is not known")).into()),
    };
    unpacked.clear();
    let failure = Metered::new(decoder, meter).take(MAX_RECORD as u64).read_to_end(unpacked).err();
    let content = if compression.is_empty() { packed } else { unpacked.as_slice() };
    // Usable before the damage.
    let read = records(content, each);
    if let Some(error) = failure {
        return Err(match Reason::from_io(error) {
            Reason::Io(error) => damaged(&format!("a chunk is damaged: {error}")).into(),
            limit => limit.into(),
        });
    }
    read?;
    let mut sum = Crc::new();
    sum.update(content);
    if crc == 0 || crc == sum.sum() { Ok(()) } else { Err(damaged("the checksum of a chunk is wrong").into()) }
}

fn records(mut bytes: &[u8], each: &mut EachRecord) -> Result<(), Stop> {
    while let Some((header, rest)) = bytes.split_first_chunk() {
        let (opcode, length) = type_and_length(*header)?;
        let (record, rest) = rest.split_at_checked(length).ok_or_else(cut_off)?;
        give(opcode, record, each)?;
        bytes = rest;
    }
    if bytes.is_empty() { Ok(()) } else { Err(cut_off().into()) }
}

#[cfg(test)]
mod tests {
    use super::{McapRecord, for_each_record};
    use crate::input::{Budget, FileBytes};
    use std::path::Path;

    fn record(opcode: u8, parts: &[&[u8]]) -> Vec<u8> {
        let body = parts.concat();
        [&[opcode][..], &(body.len() as u64).to_le_bytes(), &body].concat()
    }

    fn text(text: &str) -> Vec<u8> {
        [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat()
    }

    fn read(records: &[Vec<u8>]) -> (Vec<String>, Option<String>) {
        let file = FileBytes::in_memory(Path::new("x.mcap"), [b"\x89MCAP0\r\n".to_vec(), records.concat()].concat());
        let mut found = Vec::new();
        let damage = for_each_record(&file, Budget::new(0), |record: McapRecord| {
            found.push(format!("{record:?}"));
            Ok(())
        });
        (found, damage.expect("a file that can be read").map(|reason| reason.to_string()))
    }

    /// For a text (4 GiB), of a record (beyond chunk or file, 16 EiB).
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
        // A cut chunk has records up to there.
        let two = chunk(&[message.clone(), message.clone()].concat());
        let (found, damage) = read(&[schema, two[..two.len() - 3].to_vec()]);
        assert_eq!((found.as_slice(), damage.is_some()), (whole.map(str::to_owned).as_slice(), true));
    }
}
