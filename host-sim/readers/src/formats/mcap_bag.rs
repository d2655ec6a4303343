//! MCAP of ROS 2 and Foxglove: the definition of each type of message is in the schema of its channel.

use crate::formats::mcap_file::{self, McapRecord};
use crate::formats::message_layout::{Encoding, MessageLayout};
use crate::formats::ros_definition::{self, RosVersion};
use crate::formats::ros_message::{self, RosRows};
use crate::formats::topics::{EachRow, Ending, Source, Topic};
use crate::input::budget::Budget;
use crate::input::file_bytes::FileBytes;
use crate::input::input_error::InputError;
use std::collections::{BTreeMap, BTreeSet};

/// An MCAP file.
pub(crate) struct McapSource<'a> {
    file: &'a FileBytes,
    topics: Vec<Topic>,
    /// Of each topic; `None` where its messages cannot be decoded.
    layouts: Vec<Option<(MessageLayout, Encoding)>>,
    channels: Vec<BTreeSet<u16>>,
    budget: Budget,
}

/// A channel as its record says it.
struct Channel {
    topic: String,
    schema: u16,
    encoding: String,
    messages: u64,
}

/// A schema: name, encoding, definition.
type Schema = (String, String, Vec<u8>);

impl<'a> McapSource<'a> {
    pub(crate) fn open(file: &'a FileBytes, budget: Budget) -> Result<Self, InputError> {
        let mut schemas: BTreeMap<u16, Schema> = BTreeMap::new();
        let mut channels: BTreeMap<u16, Channel> = BTreeMap::new();
        // Channels may be declared anywhere: the topics are known after a first pass.
        let damage = mcap_file::for_each_record(file, budget, |record| {
            match record {
                McapRecord::Schema { id, name, encoding, definition } => {
                    let schema = || (name.to_owned(), encoding.to_owned(), definition.to_vec());
                    schemas.entry(id).or_insert_with(schema);
                }
                McapRecord::Channel { id, schema, topic, encoding } => {
                    let (topic, encoding) = (topic.to_owned(), encoding.to_owned());
                    channels.entry(id).or_insert(Channel { topic, schema, encoding, messages: 0 });
                }
                McapRecord::Message { channel, .. } => {
                    if let Some(channel) = channels.get_mut(&channel) {
                        channel.messages += 1;
                    }
                }
            }
            Ok(())
        })?;
        let mut source = Self { file, topics: Vec::new(), layouts: Vec::new(), channels: Vec::new(), budget };
        for (id, Channel { topic: name, schema, encoding, messages }) in channels {
            let (kind, language, definition) = schemas.get(&schema).cloned().unwrap_or_default();
            let known = source.topics.iter().position(|topic| topic.name == name && topic.kind == kind);
            if let Some(known) = known {
                source.channels[known].insert(id);
                source.topics[known].rows = source.topics[known].rows.map(|rows| rows + messages);
                continue;
            }
            let layout = layout(&kind, &language, &definition, &encoding);
            let rows = Some(messages);
            source.topics.push(match &layout {
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
            Some(damage) if source.topics.is_empty() => Err(file.error(damage)),
            _ => Ok(source),
        }
    }
}

/// The layout of messages in `encoding`, by a definition in `language`; that of ROS itself where there is no definition.
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
    fn format(&self) -> &'static str {
        mcap_file::FORMAT
    }

    fn topics(&self) -> &[Topic] {
        &self.topics
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
