//! Bags of ROS 1 (`.bag`, 2.0) with definitions in their connections; messages lie in chunks. Interrupted recordings
//! lack the index and are read from the start.

use crate::formats::message_layout::{Encoding, MessageLayout};
use crate::formats::ros_definition::{self, RosVersion};
use crate::formats::ros_message::{self, RosRows};
use crate::formats::topics::{EachRow, Offer, Source, Stop};
use crate::input::{Budget, FileBytes, InputError, Meter, Metered, OpenBytes, Reason};
use crate::rows::Ending;
use bzip2::read::BzDecoder;
use lz4_flex::frame::FrameDecoder;
use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, BufRead, BufReader, ErrorKind, Read, Seek, SeekFrom};

const FORMAT: &str = "ROS 1 bag";
const MAGIC: &[u8] = b"#ROSBAG V2.0\n";
/// Without message definitions.
const MOST_HEADER_BYTES: u32 = 1 << 20;
const MOST_DATA_BYTES: u32 = 1 << 28;

const BUFFER_BYTES: usize = 1 << 16;

const MESSAGE: u8 = 2;
const BAG_HEADER: u8 = 3;
const CHUNK: u8 = 5;
const CHUNK_INFO: u8 = 6;
const CONNECTION: u8 = 7;

enum Record<'a> {
    Connection {
        id: u32,
        topic: String,
        kind: String,
        definition: String,
    },
    /// Messages of each connection in a chunk.
    ChunkInfo(&'a [u8]),
    Message {
        connection: u32,
        recorded_ns: i64,
        data: &'a [u8],
    },
}

type EachRecord<'a> = dyn FnMut(Record) -> Result<(), InputError> + 'a;

pub(crate) struct RosBagSource<'a> {
    file: &'a FileBytes,
    offer: Offer,
    layouts: Vec<MessageLayout>,
    connections: Vec<BTreeSet<u32>>,
    budget: Budget,
}

struct FoundTopic {
    kind: String,
    definition: String,
    connections: BTreeSet<u32>,
}

impl<'a> RosBagSource<'a> {
    pub(crate) fn open(file: &'a FileBytes, budget: Budget) -> Result<Self, InputError> {
        let fail = |reason| file.error(reason);
        let mut found: BTreeMap<String, FoundTopic> = BTreeMap::new();
        let mut counts: BTreeMap<u32, u64> = BTreeMap::new();
        let failed = |error| fail(Reason::Io(error));
        let mut input = open(file).map_err(failed)?;
        let has_index = seek_index(&mut input).map_err(failed)?;
        let damage = for_each_record(file, &mut input, budget, &mut |record| {
            match record {
                Record::Connection { id, topic, kind, definition } => {
                    let new = || FoundTopic { kind: kind.clone(), definition, connections: BTreeSet::new() };
                    let known = found.entry(topic).or_insert_with(new);
                    // Only the first type of a topic is read.
                    if known.kind == kind {
                        known.connections.insert(id);
                    }
                }
                Record::ChunkInfo(data) => {
                    for entry in data.chunks_exact(8) {
                        let [id, count] = [0, 4].map(|at| number(entry.get(at..at + 4).unwrap_or_default()));
                        *counts.entry(id as u32).or_insert(0) += count;
                    }
                }
                Record::Message { connection, .. } if !has_index => *counts.entry(connection).or_insert(0) += 1,
                Record::Message { .. } => {}
            }
            Ok(())
        })?;
        if let Some(damage) = damage.filter(|damage| found.is_empty() || damage.is_limit()) {
            return Err(fail(damage));
        }
        let (mut topics, mut layouts, mut connections) = (Vec::new(), Vec::new(), Vec::new());
        for (name, FoundTopic { kind, definition, connections: ids }) in found {
            // Unintelligible definitions are left out.
            let Ok(layout) = ros_definition::layout(&kind, &definition, RosVersion::Ros1) else { continue };
            let rows = ids.iter().filter_map(|id| counts.get(id)).sum();
            topics.push(ros_message::topic(&name, &kind, &layout, Some(rows)));
            layouts.push(layout);
            connections.push(ids);
        }
        Ok(Self { file, offer: Offer::new(FORMAT, topics), layouts, connections, budget })
    }
}

impl Source for RosBagSource<'_> {
    fn offer(&self) -> &Offer {
        &self.offer
    }

    fn read(&mut self, topic: usize, columns: &[usize], each: &mut EachRow) -> Result<Ending, InputError> {
        let mut rows = RosRows::new(&self.layouts[topic], Encoding::Packed, columns);
        let connections = &self.connections[topic];
        let mut input = open(self.file).map_err(|error| self.file.error(Reason::Io(error)))?;
        let damage = for_each_record(self.file, &mut input, self.budget, &mut |record| match record {
            Record::Message { connection, recorded_ns, data } if connections.contains(&connection) => {
                each(rows.row(data, Some(recorded_ns)))
            }
            _ => Ok(()),
        })?;
        Ok(Ending { damage, notes: rows.notes() })
    }
}

type BagBytes = BufReader<OpenBytes>;

/// Behind the first bytes.
fn open(file: &FileBytes) -> io::Result<BagBytes> {
    let mut input = BufReader::with_capacity(BUFFER_BYTES, file.open()?);
    input.seek(SeekFrom::Start(MAGIC.len() as u64))?;
    Ok(input)
}

/// False without an index.
fn seek_index(input: &mut BagBytes) -> io::Result<bool> {
    let start = MAGIC.len() as u64;
    let length = input.seek(SeekFrom::End(0))?;
    input.seek(SeekFrom::Start(start))?;
    let (mut header, mut data) = (Vec::new(), Vec::new());
    let is_read = next_record(input, &mut header).is_ok_and(|is_one| is_one) && read_data(input, &mut data).is_ok();
    let index = field(&header, b"index_pos").map_or(0, number);
    let has_index = is_read && kind(&header) == Some(BAG_HEADER) && (start + 1..length).contains(&index);
    input.seek(SeekFrom::Start(if has_index { index } else { start }))?;
    Ok(has_index)
}

/// From here on, with the reason of an early end.
fn for_each_record(
    file: &FileBytes,
    input: &mut BagBytes,
    budget: Budget,
    each: &mut EachRecord,
) -> Result<Option<Reason>, InputError> {
    let mut meter = budget.meter();
    match Stop::damage(read_records(input, &mut meter, true, each))? {
        Some(Reason::Io(error)) => Err(file.error(Reason::Io(error))),
        damage => Ok(damage),
    }
}

fn read_records(
    input: &mut dyn BufRead,
    meter: &mut Meter,
    has_chunks: bool,
    each: &mut EachRecord,
) -> Result<(), Stop> {
    let (mut header, mut data) = (Vec::new(), Vec::new());
    loop {
        // Mostly within the buffer.
        if let Some((header, data)) = whole_record(input.fill_buf().map_err(refused)?)
            && (kind(header) != Some(CHUNK) || !has_chunks)
        {
            give(header, data, each)?;
            let length = 4 + header.len() + 4 + data.len();
            input.consume(length);
            continue;
        }
        if !next_record(input, &mut header)? {
            return Ok(());
        }
        if kind(&header) == Some(CHUNK) && has_chunks {
            let mut length = [0; 4];
            fill(input, &mut length)?;
            read_chunk(&mut Read::take(&mut *input, number(&length)), &header, meter, each)?;
            continue;
        }
        read_data(input, &mut data)?;
        give(&header, &data, each)?;
    }
}

fn whole_record(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let part = |bytes| -> Option<(&[u8], &[u8])> {
        let (length, rest) = <[u8]>::split_first_chunk::<4>(bytes)?;
        rest.split_at_checked(u32::from_le_bytes(*length) as usize)
    };
    let (header, rest) = part(bytes)?;
    Some((header, part(rest)?.0))
}

fn give(header: &[u8], data: &[u8], each: &mut EachRecord) -> Result<(), Stop> {
    let id = field(header, b"conn").map(|value| number(value) as u32);
    let record = match (kind(header), id) {
        (Some(MESSAGE), Some(connection)) => {
            let time = field(header, b"time").unwrap_or_default();
            let [seconds, nanos] = [0, 4].map(|at| number(time.get(at..at + 4).unwrap_or_default()) as i64);
            Record::Message { connection, recorded_ns: seconds * 1_000_000_000 + nanos, data }
        }
        (Some(CONNECTION), Some(id)) => {
            let text =
                |of: &[u8], name: &[u8]| String::from_utf8_lossy(field(of, name).unwrap_or_default()).into_owned();
            let [kind, definition] = [&b"type"[..], b"message_definition"].map(|name| text(data, name));
            Record::Connection { id, topic: text(header, b"topic"), kind, definition }
        }
        (Some(CHUNK_INFO), _) => Record::ChunkInfo(data),
        _ => return Ok(()),
    };
    Ok(each(record)?)
}

fn read_chunk(input: &mut dyn BufRead, header: &[u8], meter: &mut Meter, each: &mut EachRecord) -> Result<(), Stop> {
    let read = match field(header, b"compression") {
        Some(b"none") => read_records(input, meter, false, each),
        Some(b"lz4") => {
            let expanded = Metered::new(FrameDecoder::new(&mut *input), &mut *meter);
            read_expanded(expanded, each)
        }
        Some(b"bz2") => {
            let expanded = Metered::new(BzDecoder::new(&mut *input), &mut *meter);
            read_expanded(expanded, each)
        }
        other => {
            let name = String::from_utf8_lossy(other.unwrap_or_default()).into_owned();
            Err(damaged(format!("a chunk is compressed by {name:?}")).into())
        }
    };
    read?;
    // Padding.
    io::copy(input, &mut io::sink()).map_err(Reason::Io)?;
    Ok(())
}

/// Counts bytes as they come.
fn read_expanded(expanded: impl Read, each: &mut EachRecord) -> Result<(), Stop> {
    let mut none = Budget::new(0).meter();
    read_records(&mut BufReader::with_capacity(BUFFER_BYTES, expanded), &mut none, false, each)
}

fn next_record(input: &mut dyn BufRead, header: &mut Vec<u8>) -> Result<bool, Reason> {
    let mut length = [0; 4];
    let read = Read::take(&mut *input, 1).read(&mut length).map_err(refused)?;
    if read == 0 {
        return Ok(false);
    }
    fill(input, &mut length[1..])?;
    let length = u32::from_le_bytes(length);
    if length > MOST_HEADER_BYTES {
        return Err(damaged(format!("the header of a record has {length} bytes")));
    }
    read_exactly(input, length, header)?;
    Ok(true)
}

fn read_data(input: &mut dyn BufRead, data: &mut Vec<u8>) -> Result<(), Reason> {
    let mut length = [0; 4];
    fill(input, &mut length)?;
    let length = u32::from_le_bytes(length);
    if length > MOST_DATA_BYTES {
        return Err(damaged(format!("the data of a record have {length} bytes")));
    }
    read_exactly(input, length, data)
}

/// Allocates as bytes come.
fn read_exactly(input: &mut dyn BufRead, count: u32, bytes: &mut Vec<u8>) -> Result<(), Reason> {
    bytes.clear();
    let read = Read::take(&mut *input, u64::from(count)).read_to_end(bytes).map_err(refused)?;
    if read as u64 == u64::from(count) { Ok(()) } else { Err(Reason::Truncated { format: FORMAT }) }
}

fn fill(input: &mut dyn BufRead, bytes: &mut [u8]) -> Result<(), Reason> {
    input.read_exact(bytes).map_err(refused)
}

fn refused(error: io::Error) -> Reason {
    match error.kind() {
        ErrorKind::InvalidData | ErrorKind::InvalidInput => damaged(format!("a compressed chunk: {error}")),
        _ => match Reason::ended(FORMAT, error) {
            Reason::Io(error) if error.raw_os_error().is_none() => damaged(format!("a compressed chunk: {error}")),
            reason => reason,
        },
    }
}

fn damaged(error: String) -> Reason {
    Reason::damaged(FORMAT, error)
}

/// Length, name, `=`, value.
fn field<'a>(mut header: &'a [u8], name: &[u8]) -> Option<&'a [u8]> {
    while let Some((length, rest)) = header.split_first_chunk::<4>() {
        let (own, rest) = rest.split_at_checked(u32::from_le_bytes(*length) as usize)?;
        if let Some(value) = own.strip_prefix(name).and_then(|own| own.strip_prefix(b"=")) {
            return Some(value);
        }
        header = rest;
    }
    None
}

fn kind(header: &[u8]) -> Option<u8> {
    field(header, b"op").and_then(|op| op.first()).copied()
}

fn number(bytes: &[u8]) -> u64 {
    bytes.iter().take(8).rev().fold(0, |number, byte| number << 8 | u64::from(*byte))
}

#[cfg(test)]
mod tests {
    use super::{CHUNK, CONNECTION, MAGIC, MESSAGE, RosBagSource};
    use crate::formats::topics::Source;
    use crate::input::{Budget, FileBytes, Reason};
    use bzip2::Compression;
    use bzip2::write::BzEncoder;
    use lz4_flex::frame::FrameEncoder;
    use std::io::Write;
    use std::path::Path;

    fn fields(fields: &[(&str, &[u8])]) -> Vec<u8> {
        let one = |(name, value): &(&str, &[u8])| {
            let text = [name.as_bytes(), b"=", value].concat();
            [&(text.len() as u32).to_le_bytes()[..], &text].concat()
        };
        fields.iter().flat_map(one).collect()
    }

    fn record(header: &[(&str, &[u8])], data: &[u8]) -> Vec<u8> {
        let header = fields(header);
        let [of_header, of_data] = [header.len(), data.len()].map(|length| (length as u32).to_le_bytes());
        [&of_header[..], &header, &of_data, data].concat()
    }

    fn chunk(compression: &str, data: &[u8]) -> Vec<u8> {
        let size = (data.len() as u32).to_le_bytes();
        record(&[("op", &[CHUNK]), ("compression", compression.as_bytes()), ("size", &size)], data)
    }

    fn records(rows: u32) -> Vec<u8> {
        let definition = fields(&[("type", b"test/Rate"), ("message_definition", b"float64 x\n")]);
        let id = 0u32.to_le_bytes();
        let mut bytes = record(&[("op", &[CONNECTION]), ("conn", &id), ("topic", b"/rate")], &definition);
        for row in 0..rows {
            let time = [row.to_le_bytes(), [0; 4]].concat();
            let data = f64::from(row).to_le_bytes();
            bytes.extend(record(&[("op", &[MESSAGE]), ("conn", &id), ("time", &time)], &data));
        }
        bytes
    }

    fn bag(chunks: &[Vec<u8>]) -> FileBytes {
        FileBytes::in_memory(Path::new("x.bag"), [MAGIC.to_vec(), chunks.concat()].concat())
    }

    fn compressed(compression: &str, data: &[u8]) -> Vec<u8> {
        match compression {
            "lz4" => {
                let mut encoder = FrameEncoder::new(Vec::new());
                encoder.write_all(data).expect("memory");
                encoder.finish().expect("memory")
            }
            "bz2" => {
                let mut encoder = BzEncoder::new(Vec::new(), Compression::default());
                encoder.write_all(data).expect("memory");
                encoder.finish().expect("memory")
            }
            _ => data.to_vec(),
        }
    }

    fn read(source: &mut RosBagSource) -> (Vec<f64>, Option<String>) {
        let column = source.topics()[0].columns.iter().position(|column| column.name == "x").expect("a column");
        let mut rows = Vec::new();
        let ending = source.read(0, &[column], &mut |row| {
            rows.push(row[0].value());
            Ok(())
        });
        (rows, ending.expect("rows").damage.map(|damage| damage.to_string()))
    }

    /// Interrupted; every compression.
    #[test]
    fn a_bag_without_an_index_is_read_as_far_as_it_goes() {
        let expected: Vec<f64> = (0..50).map(f64::from).collect();
        for compression in ["none", "lz4", "bz2"] {
            let whole = chunk(compression, &compressed(compression, &records(50)));
            let file = bag(std::slice::from_ref(&whole));
            let mut source = RosBagSource::open(&file, Budget::new(10_000)).expect("a bag");
            assert_eq!(source.topics()[0].rows, Some(50), "{compression}");
            assert_eq!(read(&mut source), (expected.clone(), None), "{compression}");
            // The second chunk has no end.
            let file = bag(&[whole.clone(), whole[..whole.len() / 2].to_vec()]);
            let mut source = RosBagSource::open(&file, Budget::new(10_000)).expect("a bag");
            let (rows, damage) = read(&mut source);
            assert_eq!(rows[..50], expected, "{compression}");
            assert!(damage.is_some_and(|damage| damage.contains(super::FORMAT)), "{compression}");
        }
    }

    #[test]
    fn a_chunk_that_expands_without_end_is_refused() {
        let zeros = vec![0; 100 << 20];
        for compression in ["lz4", "bz2"] {
            let bytes = chunk(compression, &compressed(compression, &[records(1), zeros.clone()].concat()));
            let file = bag(&[bytes]);
            let refused = RosBagSource::open(&file, Budget::new(0)).err().expect("refused").reason;
            assert!(matches!(refused, Reason::Limit(_)), "{compression}: {refused}");
        }
        let file = bag(&[[&8u32.to_le_bytes()[..], &fields(&[("op", &[2])]), &[0xFF; 4]].concat()]);
        assert!(RosBagSource::open(&file, Budget::new(0)).is_err());
    }
}
