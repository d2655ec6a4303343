//! MCAP (ROS 2, Foxglove) with definitions in its schemas.

use crate::formats::mcap_file::{self, McapRecord};
use crate::formats::message_layout::{Encoding, MessageLayout};
use crate::formats::ros_definition::{self, RosVersion};
use crate::formats::ros_message::{self, RosRows};
use crate::formats::topics::{EachRow, Offer, Source, Topic};
use crate::input::{Budget, FileBytes, InputError};
use crate::rows::Ending;
use std::collections::{BTreeMap, BTreeSet};

pub(crate) struct McapSource<'a> {
    file: &'a FileBytes,
    offer: Offer,
    /// `None` if not decodable.
    layouts: Vec<Option<(MessageLayout, Encoding)>>,
    channels: Vec<BTreeSet<u16>>,
    budget: Budget,
}

struct Channel {
    topic: String,
    schema: u16,
    encoding: String,
    messages: u64,
}

/// Name, encoding, definition.
type Schema = (String, String, Vec<u8>);

#[derive(Default)]
struct Contents {
    schemas: BTreeMap<u16, Schema>,
    channels: BTreeMap<u16, Channel>,
}

impl Contents {
    fn add(&mut self, record: McapRecord) {
        match record {
            McapRecord::Schema { id, name, encoding, definition } => {
                let schema = || (name.to_owned(), encoding.to_owned(), definition.to_vec());
                self.schemas.entry(id).or_insert_with(schema);
            }
            McapRecord::Channel { id, schema, topic, encoding } => {
                let (topic, encoding) = (topic.to_owned(), encoding.to_owned());
                self.channels.entry(id).or_insert(Channel { topic, schema, encoding, messages: 0 });
            }
            McapRecord::Message { channel, .. } => {
                if let Some(channel) = self.channels.get_mut(&channel) {
                    channel.messages += 1;
                }
            }
            McapRecord::Counts(_) => {}
        }
    }

    /// `None` if the summary is incomplete.
    fn of_summary(file: &FileBytes) -> Option<Self> {
        let (mut contents, mut has_all) = (Self::default(), true);
        let has_summary = mcap_file::for_each_of_summary(file, |record| match record {
            McapRecord::Counts(counts) => {
                for (id, count) in counts.iter() {
                    let channel = contents.channels.get_mut(&id);
                    has_all &= channel.is_some();
                    channel.into_iter().for_each(|channel| channel.messages = count);
                }
            }
            record => contents.add(record),
        });
        has_all &= contents.channels.values().all(|of| of.schema == 0 || contents.schemas.contains_key(&of.schema));
        Some(contents).filter(|_| has_summary && has_all)
    }
}

impl<'a> McapSource<'a> {
    pub(crate) fn open(file: &'a FileBytes, budget: Budget) -> Result<Self, InputError> {
        let mut damage = None;
        let contents = match Contents::of_summary(file) {
            Some(contents) => contents,
            None => {
                // Topics need a first pass.
                let mut contents = Contents::default();
                damage = mcap_file::for_each_record(file, budget, |record| {
                    contents.add(record);
                    Ok(())
                })?;
                contents
            }
        };
        let Contents { schemas, channels } = contents;
        let mut source = Self {
            file,
            offer: Offer::new(mcap_file::FORMAT, Vec::new()),
            layouts: Vec::new(),
            channels: Vec::new(),
            budget,
        };
        for (id, Channel { topic: name, schema, encoding, messages }) in channels {
            let (kind, language, definition) = schemas.get(&schema).cloned().unwrap_or_default();
            let known = source.offer.topics.iter().position(|topic| topic.name == name && topic.kind == kind);
            if let Some(known) = known {
                source.channels[known].insert(id);
                source.offer.topics[known].rows = source.offer.topics[known].rows.map(|rows| rows + messages);
                continue;
            }
            let layout = layout(&kind, &language, &definition, &encoding);
            let rows = Some(messages);
            source.offer.topics.push(match &layout {
                Some((layout, _)) => ros_message::topic(&name, &kind, layout, rows),
                None => {
                    let encoding = Some(encoding).filter(|encoding| !matches!(encoding.as_str(), "ros1" | "cdr"));
                    Topic { name, kind, rows, encoding, ..Topic::default() }
                }
            });
            source.layouts.push(layout);
            source.channels.push(BTreeSet::from([id]));
        }
        match damage {
            Some(damage) if source.offer.topics.is_empty() => Err(file.error(damage)),
            _ => Ok(source),
        }
    }
}

/// By a definition in `language`, else ROS's own.
fn layout(kind: &str, language: &str, definition: &[u8], encoding: &str) -> Option<(MessageLayout, Encoding)> {
    let (version, encoding) = match encoding {
        "ros1" => (RosVersion::Ros1, Encoding::Packed),
        "cdr" => (RosVersion::Ros2, Encoding::Cdr),
        _ => return None,
    };
    let text = std::str::from_utf8(definition).ok().filter(|text| !text.trim().is_empty());
    let defined = match (language, text) {
        ("ros1msg" | "ros2msg", Some(text)) => ros_definition::layout(kind, text, version).ok(),
        _ => None,
    };
    Some((defined.or_else(|| ros_definition::known_layout(kind, version))?, encoding))
}

impl Source for McapSource<'_> {
    fn offer(&self) -> &Offer {
        &self.offer
    }

    fn read(&mut self, topic: usize, columns: &[usize], each: &mut EachRow) -> Result<Ending, InputError> {
        let Some((layout, encoding)) = &self.layouts[topic] else { return Ok(Ending::default()) };
        let mut rows = RosRows::new(layout, *encoding, columns);
        let channels = &self.channels[topic];
        let damage = mcap_file::for_each_record(self.file, self.budget, |record| match record {
            McapRecord::Message { channel, log_ns, data } if channels.contains(&channel) => {
                each(rows.row(data, i64::try_from(log_ns).ok()))
            }
            _ => Ok(()),
        })?;
        Ok(Ending { damage, notes: rows.notes() })
    }
}

#[cfg(test)]
mod tests {
    use super::{Contents, McapSource};
    use crate::formats::topics::Source;
    use crate::input::{Budget, FileBytes};
    use std::path::Path;

    const MAGIC: &[u8] = b"\x89MCAP0\r\n";

    fn record(opcode: u8, parts: &[&[u8]]) -> Vec<u8> {
        let body = parts.concat();
        [&[opcode][..], &(body.len() as u64).to_le_bytes(), &body].concat()
    }

    fn text(text: &str) -> Vec<u8> {
        [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat()
    }

    /// Three messages; the summary states `count` for channel `counted`, and begins `late` bytes late.
    fn file(counted: u16, count: u64, late: u64) -> FileBytes {
        let schema = record(3, &[&1u16.to_le_bytes(), &text("test/Rate"), &text("ros2msg"), &text("float64 x\n")]);
        let channel =
            record(4, &[&7u16.to_le_bytes(), &1u16.to_le_bytes(), &text("/rate"), &text("cdr"), &0u32.to_le_bytes()]);
        let described = [schema, channel].concat();
        let message = record(5, &[&7u16.to_le_bytes(), &[0; 20], &[0, 1, 0, 0], &1.5f64.to_le_bytes()]);
        let data = [MAGIC, &described, &message.repeat(3), &record(15, &[&[0; 4]])].concat();
        let counts = [&counted.to_le_bytes()[..], &count.to_le_bytes()].concat();
        let statistics = record(11, &[&[0; 42], &(counts.len() as u32).to_le_bytes(), &counts]);
        let start = data.len() as u64 + late;
        let footer = record(2, &[&start.to_le_bytes(), &[0; 12]]);
        FileBytes::in_memory(Path::new("x.mcap"), [&data[..], &described, &statistics, &footer, MAGIC].concat())
    }

    #[test]
    fn a_summary_stands_for_a_first_reading_where_it_tells_all_channels() {
        for (counted, count, late, listed) in
            [(7, 3, 0, 3), (7, 8, 0, 8), (9, 3, 0, 3), (7, 3, 1, 3), (7, 3, 1 << 40, 3)]
        {
            let file = file(counted, count, late);
            assert_eq!(Contents::of_summary(&file).is_some(), (counted, late) == (7, 0), "{counted} {late}");
            let mut source = McapSource::open(&file, Budget::new(0)).expect("a file");
            assert_eq!(source.topics()[0].rows, Some(listed), "{counted} {count} {late}");
            let mut rows = Vec::new();
            let ending = source.read(0, &[0], &mut |row| {
                rows.push(row[0].value());
                Ok(())
            });
            assert!(ending.expect("rows").damage.is_none());
            assert_eq!(rows, [1.5; 3], "{counted} {count} {late}");
        }
    }
}
