//! Bags of ROS 1 (`.bag`, format 2.0): the definition of each type of message is in the connection of its topic.

use crate::formats::message_layout::{Encoding, MessageLayout};
use crate::formats::ros_definition::{self, RosVersion};
use crate::formats::ros_message::{self, RosRows};
use crate::formats::topics::{EachRow, Ending, Source, Topic};
use crate::input::budget::Budget;
use crate::input::input_error::{InputError, Reason};
use rosbag::{ChunkRecord, IndexRecord, MessageRecord, RosBag};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::Read;
use std::path::Path;

const FORMAT: &str = "ROS 1 bag";

/// Where the bag header of ROS 1 states the position of the index, in the first bytes of the file.
const BAG_HEADER: u64 = 4096 + 64;
const INDEX_POSITION: &[u8] = b"index_pos=";

/// An open bag.
pub(crate) struct RosBagSource<'a> {
    file: &'a Path,
    bag: RosBag,
    topics: Vec<Topic>,
    /// Of each topic.
    layouts: Vec<MessageLayout>,
    connections: Vec<BTreeSet<u32>>,
    budget: Budget,
}

impl<'a> RosBagSource<'a> {
    pub(crate) fn open(file: &'a Path, budget: Budget) -> Result<Self, InputError> {
        let fail = |reason| InputError::file(file, reason);
        check_index(file).map_err(fail)?;
        let bag = RosBag::new(file).map_err(|error| fail(Reason::Io(error)))?;
        let mut found: BTreeMap<String, (String, String, BTreeSet<u32>)> = BTreeMap::new();
        let mut counts: BTreeMap<u32, u64> = BTreeMap::new();
        for record in bag.index_records() {
            match record.map_err(|error| fail(damaged(error)))? {
                IndexRecord::Connection(connection) => {
                    let new = || (connection.tp.to_owned(), connection.message_definition.to_owned(), BTreeSet::new());
                    let (kind, _, ids) = found.entry(connection.storage_topic.to_owned()).or_insert_with(new);
                    // A topic has one type; of another only the first is read.
                    if kind == connection.tp {
                        ids.insert(connection.id);
                    }
                }
                IndexRecord::ChunkInfo(chunk) => {
                    for entry in chunk.entries() {
                        *counts.entry(entry.conn_id).or_insert(0) += u64::from(entry.count);
                    }
                }
                IndexRecord::IndexData(_) => {}
            }
        }
        let (mut topics, mut layouts, mut connections) = (Vec::new(), Vec::new(), Vec::new());
        for (name, (kind, definition, ids)) in found {
            // A definition that cannot be understood leaves its topic out.
            let Ok(layout) = ros_definition::layout(&kind, &definition, RosVersion::Ros1) else { continue };
            let rows = ids.iter().filter_map(|id| counts.get(id)).sum();
            topics.push(ros_message::topic(&name, &kind, &layout, Some(rows)));
            layouts.push(layout);
            connections.push(ids);
        }
        Ok(Self { file, bag, topics, layouts, connections, budget })
    }
}

fn damaged(error: rosbag::Error) -> Reason {
    Reason::Format { format: FORMAT, error: error.to_string().into() }
}

impl Source for RosBagSource<'_> {
    fn format(&self) -> &'static str {
        FORMAT
    }

    fn topics(&self) -> &[Topic] {
        &self.topics
    }

    fn read(&mut self, topic: usize, columns: &[usize], each: &mut EachRow) -> Result<Ending, InputError> {
        let mut rows = RosRows::new(&self.layouts[topic], Encoding::Packed, columns);
        let mut meter = self.budget.meter();
        let mut damage = None;
        'chunks: for chunk in self.bag.chunk_records() {
            let chunk = match chunk {
                Ok(ChunkRecord::Chunk(chunk)) => chunk,
                Ok(ChunkRecord::IndexData(_)) => continue,
                Err(error) => {
                    damage = Some(damaged(error));
                    break;
                }
            };
            for message in chunk.messages() {
                match message {
                    Ok(MessageRecord::MessageData(message)) => {
                        let add = meter.add_bytes(message.data.len() as u64);
                        add.map_err(|reason| InputError::file(self.file, reason))?;
                        if self.connections[topic].contains(&message.conn_id) {
                            each(rows.row(message.data, i64::try_from(message.time).ok()))?;
                        }
                    }
                    Ok(_) => {}
                    Err(error) => {
                        damage = Some(damaged(error));
                        break 'chunks;
                    }
                }
            }
        }
        Ok(Ending { damage, notes: rows.notes() })
    }
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
