//! Bags of ROS 1 (`.bag`, format 2.0) and of ROS 2 (MCAP and SQLite), with `sensor_msgs/Imu`.

use crate::formats::imu_message::{FIELDS, TIME_UNIT, TYPES, decode_cdr, decode_ros1};
use crate::formats::mcap_file::{self, McapRecord};
use crate::formats::message_table::{MessageTable, choose_topic};
use crate::input::input_error::{InputError, Reason};
use crate::tables::any_sensor::ReadOptions;
use crate::tables::sensor_table::{Number, SensorTable};
use rosbag::{ChunkRecord, IndexRecord, MessageRecord, RosBag};
use rusqlite::{Connection, OpenFlags};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::Read;
use std::path::Path;

const ROS1: &str = "ROS 1 bag";
const SQLITE: &str = "ROS 2 SQLite bag";

/// Where the bag header of ROS 1 states the position of the index, in the first bytes of the file.
const BAG_HEADER: u64 = 4096 + 64;
const INDEX_POSITION: &[u8] = b"index_pos=";

/// Reads a bag of ROS 1.
pub(crate) fn read_ros1(file: &Path, options: &ReadOptions) -> Result<SensorTable, InputError> {
    let fail = |reason| InputError::file(file, reason);
    let damaged = |error: rosbag::Error| Reason::Format { format: ROS1, error: error.to_string().into() };
    check_index(file).map_err(fail)?;
    let bag = RosBag::new(file).map_err(|error| fail(Reason::Io(error)))?;
    let mut topics: BTreeMap<String, BTreeSet<u32>> = BTreeMap::new();
    for record in bag.index_records() {
        if let IndexRecord::Connection(connection) = record.map_err(|error| fail(damaged(error)))?
            && TYPES.contains(&connection.tp)
        {
            topics.entry(connection.storage_topic.to_owned()).or_default().insert(connection.id);
        }
    }
    let topics: Vec<(String, BTreeSet<u32>)> = topics.into_iter().collect();
    let (_, connections) = choose_topic(ROS1, &topics, options.topic.as_deref()).map_err(fail)?;
    let mut table = MessageTable::new(file, TIME_UNIT, &FIELDS, options)?;
    for chunk in bag.chunk_records() {
        let chunk = match chunk {
            Ok(ChunkRecord::Chunk(chunk)) => chunk,
            Ok(ChunkRecord::IndexData(_)) => continue,
            Err(error) => return table.finish(Some(damaged(error))),
        };
        for message in chunk.messages() {
            match message {
                Ok(MessageRecord::MessageData(message)) if connections.contains(&message.conn_id) => {
                    table.push(&decoded(decode_ros1(message.data)))?;
                }
                Ok(_) => {}
                Err(error) => return table.finish(Some(damaged(error))),
            }
        }
    }
    table.finish(None)
}

/// Refuses a bag without an index, which the reader of bags does not survive: that of a recording that was interrupted.
fn check_index(file: &Path) -> Result<(), Reason> {
    let mut head = Vec::new();
    let input = File::open(file).map_err(Reason::Io)?;
    let length = input.metadata().map_err(Reason::Io)?.len();
    input.take(BAG_HEADER).read_to_end(&mut head).map_err(Reason::Io)?;
    let at = head.windows(INDEX_POSITION.len()).position(|window| window == INDEX_POSITION);
    let bytes = at.and_then(|at| head.get(at + INDEX_POSITION.len()..)?.first_chunk::<8>());
    let position = bytes.map_or(0, |bytes| u64::from_le_bytes(*bytes));
    if (BAG_HEADER - 64..=length).contains(&position) { Ok(()) } else { Err(Reason::NoIndex) }
}

/// Reads MCAP, record by record.
pub(crate) fn read_mcap(file: &Path, options: &ReadOptions) -> Result<SensorTable, InputError> {
    let fail = |reason| InputError::file(file, reason);
    let mut topics: BTreeMap<String, BTreeSet<u16>> = BTreeMap::new();
    let mut schemas: BTreeSet<u16> = BTreeSet::new();
    let mut ros1: BTreeSet<u16> = BTreeSet::new();
    // Channels may be declared anywhere: the topics are known after a first pass.
    let early = mcap_file::for_each_record(file, |record| {
        match record {
            McapRecord::Schema { id, name } if TYPES.contains(&name) => {
                schemas.insert(id);
            }
            McapRecord::Channel { id, schema, topic, encoding } if schemas.contains(&schema) => {
                topics.entry(topic.to_owned()).or_default().insert(id);
                if encoding == "ros1" {
                    ros1.insert(id);
                }
            }
            _ => {}
        }
        Ok(())
    })?;
    let topics: Vec<(String, BTreeSet<u16>)> = topics.into_iter().collect();
    let (_, channels) = match (topics.as_slice(), early) {
        ([], Some(damage)) => return Err(fail(damage)),
        (topics, _) => choose_topic(mcap_file::FORMAT, topics, options.topic.as_deref()).map_err(fail)?,
    };
    let mut table = MessageTable::new(file, TIME_UNIT, &FIELDS, options)?;
    let damage = mcap_file::for_each_record(file, |record| match record {
        McapRecord::Message { channel, data } if channels.contains(&channel) => {
            table.push(&decoded(if ros1.contains(&channel) { decode_ros1(data) } else { decode_cdr(data) }))
        }
        _ => Ok(()),
    })?;
    table.finish(damage)
}

/// Reads a bag of ROS 2 in SQLite.
pub(crate) fn read_sqlite(file: &Path, options: &ReadOptions) -> Result<SensorTable, InputError> {
    let fail = |reason| InputError::file(file, reason);
    let damaged = |error: rusqlite::Error| Reason::Format { format: SQLITE, error: error.to_string().into() };
    let failed = |error| fail(damaged(error));
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let database = Connection::open_with_flags(file, flags).map_err(failed)?;
    let mut query = database.prepare("SELECT name, id, type FROM topics ORDER BY id").map_err(failed)?;
    let rows = query.query_map((), |row| Ok((row.get(0)?, row.get(1)?, row.get(2)?))).map_err(failed)?;
    let topics: Vec<(String, i64, String)> = rows.collect::<Result<_, _>>().map_err(failed)?;
    let is_imu = |(name, id, kind): (String, i64, String)| TYPES.contains(&kind.as_str()).then_some((name, id));
    let topics: Vec<(String, i64)> = topics.into_iter().filter_map(is_imu).collect();
    let (_, topic) = choose_topic(SQLITE, &topics, options.topic.as_deref()).map_err(fail)?;
    let mut table = MessageTable::new(file, TIME_UNIT, &FIELDS, options)?;
    let mut query = database.prepare("SELECT data FROM messages WHERE topic_id = ? ORDER BY id").map_err(failed)?;
    let mut rows = query.query((topic,)).map_err(failed)?;
    loop {
        match rows.next() {
            Ok(Some(row)) => {
                let data = row.get_ref(0).map_err(failed)?;
                table.push(&decoded(data.as_blob().ok().and_then(decode_cdr)))?;
            }
            Ok(None) => return table.finish(None),
            Err(error) => return table.finish(Some(damaged(error))),
        }
    }
}

/// The numbers of a message. One that cannot be decoded has no time, which ends the reading with an error that names it.
fn decoded(message: Option<[Number; 7]>) -> [Number; 7] {
    message.unwrap_or([Number::Real(f64::NAN); 7])
}
