//! Files of several sources (topics, groups of arrays, sensors), and the choice of a table for all formats.

use crate::columns::{
    AvailableColumn, ChosenColumn, ColumnSelection, ReadingNote, RowOptions, SensorChannels, Unit, as_they_are,
};
use crate::input::{Budget, InputError, Reason};
use crate::rows::{self, Ending, Number, Refusal, RowSource, TopicSensor, WholeTable};
use std::path::Path;

#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Topic {
    /// For `--topic`.
    pub(crate) name: String,
    /// Empty without one.
    pub(crate) kind: String,
    pub(crate) encoding: Option<String>,
    pub(crate) rows: Option<u64>,
    pub(crate) columns: Vec<AvailableColumn>,
    pub(crate) sensors: Vec<TopicSensor>,
}

/// A source of rows: topic, group or array.
#[derive(Debug, Clone, PartialEq)]
pub struct TopicDescription {
    /// For [`RowOptions::topic`]; empty for all arrays.
    pub name: String,
    /// Such as `sensor_msgs/Imu`; may be empty.
    pub kind: String,
    pub rows: Option<u64>,
    /// With units, if stated; empty if not decodable.
    pub columns: Vec<(String, Option<&'static str>)>,
    /// Read without options, for [`RowOptions::topic`].
    pub sensors: Vec<String>,
}

impl From<&Topic> for TopicDescription {
    fn from(topic: &Topic) -> Self {
        let column = |column: &AvailableColumn| (column.name.clone(), column.unit.map(|unit| unit.name));
        Self {
            name: topic.name.clone(),
            kind: topic.kind.clone(),
            rows: topic.rows,
            columns: topic.columns.iter().map(column).collect(),
            sensors: topic.sensors.iter().map(|sensor| sensor_name(topic, sensor)).collect(),
        }
    }
}

#[derive(Debug, Default)]
pub(crate) struct Offer {
    pub(crate) format: &'static str,
    pub(crate) topics: Vec<Topic>,
    /// Default sensor; `None` if the user has to say.
    pub(crate) preferred: Option<String>,
    pub(crate) whole: Option<usize>,
}

impl Offer {
    pub(crate) fn new(format: &'static str, topics: Vec<Topic>) -> Self {
        Self { format, topics, ..Self::default() }
    }
}

pub(crate) type EachRow<'a> = dyn FnMut(&[Number]) -> Result<(), InputError> + 'a;

/// Why a reading ends early.
pub(crate) enum Stop {
    Damage(Reason),
    /// By the one who gets what is read.
    Refusal(InputError),
}

impl From<Reason> for Stop {
    fn from(reason: Reason) -> Self {
        Self::Damage(reason)
    }
}

impl From<InputError> for Stop {
    fn from(error: InputError) -> Self {
        Self::Refusal(error)
    }
}

impl Stop {
    /// The damage of what was `read`; a refusal is an error.
    pub(crate) fn damage(read: Result<(), Self>) -> Result<Option<Reason>, InputError> {
        match read {
            Ok(()) => Ok(None),
            Err(Self::Damage(reason)) => Ok(Some(reason)),
            Err(Self::Refusal(error)) => Err(error),
        }
    }
}

pub(crate) trait Source: Send {
    fn offer(&self) -> &Offer;

    fn topics(&self) -> &[Topic] {
        &self.offer().topics
    }

    /// Stated, Hz.
    fn rate_hz(&self, _topic: usize, _columns: &[usize]) -> Option<f64> {
        None
    }

    /// Columns whose rows belong together.
    fn tables(&self, topic: usize) -> Vec<Vec<usize>> {
        vec![(0..self.topics()[topic].columns.len()).collect()]
    }

    fn read(&mut self, topic: usize, columns: &[usize], each: &mut EachRow) -> Result<Ending, InputError>;
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Choice {
    topic: usize,
    sensor: Option<usize>,
}

/// For `--topic`.
fn sensor_name(topic: &Topic, sensor: &TopicSensor) -> String {
    match (topic.name.as_str(), sensor.name.as_str()) {
        (name, "") | ("", name) => name.to_owned(),
        (name, own) => format!("{name}:{own}"),
    }
}

fn sensors(topics: &[Topic]) -> Vec<(String, Choice)> {
    let of_topic = |(number, topic)| {
        let topic: &Topic = topic;
        (topic.sensors.iter().enumerate())
            .map(move |(at, sensor)| (sensor_name(topic, sensor), Choice { topic: number, sensor: Some(at) }))
    };
    topics.iter().enumerate().flat_map(of_topic).collect()
}

/// Sensors of the default's kind, for `--topic`; none if there is one or none known.
pub(crate) fn names_of_several(source: &dyn Source) -> Vec<String> {
    let topics = source.topics();
    let all = sensors(topics);
    let kind = |choice: &Choice| (topics[choice.topic].kind.as_str(), shape(&topics[choice.topic], choice.sensor));
    let first =
        all.iter().find(|(name, _)| source.offer().preferred.as_deref().is_none_or(|preferred| preferred == name));
    let Some(first) = first.map(|(_, choice)| kind(choice)) else { return Vec::new() };
    // All without a default, else its kind.
    let is_offered = |choice: &Choice| source.offer().preferred.as_deref().is_none() || kind(choice) == first;
    let names: Vec<String> = all.into_iter().filter(|(_, choice)| is_offered(choice)).map(|(name, _)| name).collect();
    if names.len() > 1 { names } else { Vec::new() }
}

fn shape(topic: &Topic, sensor: Option<usize>) -> Vec<&'static str> {
    sensor.map_or_else(Vec::new, |at| topic.sensors[at].columns.iter().map(|(channel, ..)| *channel).collect())
}

fn choose(source: &dyn Source, options: &RowOptions) -> Result<Choice, Reason> {
    let Offer { format, topics, preferred, whole } = source.offer();
    let format = *format;
    let known = sensors(topics);
    let preferred = known.iter().find(|(name, _)| Some(name) == preferred.as_ref()).map(|(_, choice)| *choice);
    let names = |of: &[(String, Choice)]| of.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", ");
    if topics.is_empty() {
        return Err(Reason::NoTopic { format });
    }
    if let Some(wanted) = &options.topic {
        let sensor = known.iter().find(|(name, _)| name == wanted).map(|(_, choice)| *choice);
        let topic = || topics.iter().position(|topic| topic.name == *wanted);
        let unknown = || {
            let all = if known.is_empty() { describe(topics) } else { names(&known) };
            Reason::UnknownTopic(Box::new((wanted.clone(), all)))
        };
        return sensor.or_else(|| topic().map(|topic| Choice { topic, sensor: None })).ok_or_else(unknown);
    }
    if options.selection.has_columns() {
        if let Some(topic) = *whole {
            return Ok(Choice { topic, sensor: None });
        }
        // With the named columns.
        let has = |topic: &Topic| options.selection.is_covered(&topic.columns);
        let able: Vec<usize> = (0..topics.len()).filter(|&at| has(&topics[at])).collect();
        return match (able.as_slice(), preferred) {
            ([topic], _) => Ok(Choice { topic: *topic, sensor: None }),
            ([], _) if topics.len() == 1 => Ok(Choice { topic: 0, sensor: None }),
            // The only sensor has the user's columns.
            ([], None) if known.len() == 1 => Ok(Choice { sensor: None, ..known[0].1 }),
            (able, Some(choice)) if able.contains(&choice.topic) => Ok(Choice { sensor: None, ..choice }),
            ([], _) => Err(Reason::NoSensor { format, topics: describe(topics) }),
            (able, _) => {
                let able: Vec<&str> = able.iter().map(|&at| topics[at].name.as_str()).collect();
                Err(Reason::SeveralTopics(able.join(", ")))
            }
        };
    }
    if let Some(choice) = preferred {
        return Ok(choice);
    }
    match (known.as_slice(), topics.as_slice()) {
        ([(_, choice)], _) => Ok(*choice),
        ([], [_]) => Ok(Choice { topic: 0, sensor: None }),
        ([], _) if whole.is_some() => Ok(Choice { topic: whole.unwrap_or(0), sensor: None }),
        ([], _) => Err(Reason::NoSensor { format, topics: describe(topics) }),
        (several, _) => Err(Reason::SeveralTopics(names(several))),
    }
}

fn describe(topics: &[Topic]) -> String {
    const SHOWN: usize = 24;
    let one = |topic: &Topic| match (topic.kind.as_str(), topic.columns.is_empty()) {
        ("", _) => topic.name.clone(),
        (kind, false) => format!("{} ({kind})", topic.name),
        (kind, true) => format!("{} ({kind}, without a definition)", topic.name),
    };
    let shown: Vec<String> = topics.iter().take(SHOWN).map(one).collect();
    let more = if topics.len() > SHOWN { ", …" } else { "" };
    format!("{}{more}", shown.join(", "))
}

fn choose_columns(
    topic: &Topic,
    sensor: Option<&TopicSensor>,
    options: &RowOptions,
) -> Result<Vec<ChosenColumn>, Reason> {
    let refused = |error| Reason::Selection(Box::new(error));
    let Some(sensor) = sensor.filter(|_| !options.selection.has_columns()) else {
        return options.choose(&topic.columns).map_err(refused);
    };
    let known = |&(name, at, unit): &(&'static str, usize, Option<Unit>)| AvailableColumn {
        name: name.to_owned(),
        unit: unit.or(topic.columns[at].unit),
    };
    let available: Vec<AvailableColumn> = sensor.columns.iter().map(known).collect();
    let mut chosen = options.choose(&available).map_err(refused)?;
    for column in &mut chosen {
        column.position = sensor.columns[column.position].1;
        column.label.clone_from(&topic.columns[column.position].name);
    }
    Ok(chosen)
}

pub(crate) struct TopicRows<'a> {
    file: &'a Path,
    source: Box<dyn Source + 'a>,
    topic: usize,
    chosen: Vec<ChosenColumn>,
    notes: Vec<ReadingNote>,
    limits: FileLimits,
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct FileLimits {
    pub(crate) budget: Budget,
    /// Compression whose data end early.
    pub(crate) cut: Option<&'static str>,
}

impl<'a> TopicRows<'a> {
    pub(crate) fn open(
        file: &'a Path,
        source: Box<dyn Source + 'a>,
        options: &RowOptions,
        limits: FileLimits,
    ) -> Result<Self, InputError> {
        let fail = |reason| InputError::file(file, reason);
        let choice = choose(source.as_ref(), options).map_err(fail)?;
        let topic = &source.topics()[choice.topic];
        if topic.columns.is_empty() {
            return Err(fail(match &topic.encoding {
                _ if source.offer().whole.is_some() => Reason::NoTopic { format: source.offer().format },
                Some(encoding) => Reason::other(format!(
                    "the messages of {} are encoded in {encoding}; those of ROS 1 and ROS 2 (ros1, cdr) are decoded; in Python, \
                         mcap.reader gives the messages, of which a table is made by csv.writer",
                    topic.name
                )),
                None => Reason::other(format!(
                    "the messages of {} cannot be decoded: the file has no definition of {}; where that package is installed, \
                         `ros2 bag convert` to MCAP writes it along",
                    topic.name, topic.kind
                )),
            }));
        }
        let sensor = choice.sensor.map(|at| &topic.sensors[at]);
        let chosen = choose_columns(topic, sensor, options).map_err(fail)?;
        let mut notes: Vec<ReadingNote> = Vec::new();
        let states_units = |selection: &ColumnSelection| selection.has_units();
        notes.extend(
            sensor
                .and_then(|sensor| sensor.note.clone())
                .filter(|_| !states_units(&options.selection))
                .map(ReadingNote::from),
        );
        notes.extend(options.selection.notes(&topic.columns, &chosen, &options.sensor));
        let name = sensor.map_or_else(|| topic.name.clone(), |sensor| sensor_name(topic, sensor));
        if options.topic.is_none() && source.offer().preferred.as_deref() == Some(name.as_str()) {
            let all = sensors(source.topics());
            let others: Vec<&str> = all.iter().map(|(name, _)| name.as_str()).filter(|other| *other != name).collect();
            if !others.is_empty() {
                notes.push(format!("{name} is read; --topic reads one of the others: {}", others.join(", ")).into());
            }
        }
        Ok(Self { file, source, topic: choice.topic, chosen, notes, limits })
    }
}

impl RowSource for TopicRows<'_> {
    fn chosen(&self) -> &[ChosenColumn] {
        &self.chosen
    }

    fn rate_hz(&self) -> Option<f64> {
        let columns: Vec<usize> = self.chosen.iter().map(|column| column.position).collect();
        self.source.rate_hz(self.topic, &columns)
    }

    fn budget(&self) -> Option<Budget> {
        Some(self.limits.budget)
    }

    fn read(&mut self, each: &mut rows::EachRow) -> Result<Ending, InputError> {
        let Self { file, source, topic, chosen, notes, limits } = self;
        let columns: Vec<usize> = chosen.iter().map(|column| column.position).collect();
        let (mut rows, mut is_enough) = (0u64, false);
        let ending = source.read(*topic, &columns, &mut |row| {
            rows += 1;
            each(row).map_err(|refusal| match refusal {
                Refusal::Fault(fault) => {
                    let label = fault.column.map_or("", |at| chosen[at].label.as_str());
                    InputError::row(file, rows, label, fault.reason)
                }
                Refusal::Enough => {
                    is_enough = true;
                    InputError::file(file, Reason::NoData)
                }
            })
        });
        let mut ending = match ending {
            Err(_) if is_enough => Ending::default(),
            ending => {
                let ending = ending?;
                let cut = limits.cut.map(|format| Reason::Truncated { format });
                Ending { damage: ending.damage.or(cut), ..ending }
            }
        };
        ending.notes.extend(notes.iter().cloned());
        Ok(ending)
    }
}

/// Topics read without a known sensor.
const MOST_TOPICS: usize = 8;

/// Named topic, else known sensors, else the first ones.
pub(crate) fn read_whole<'a>(
    file: &'a Path,
    mut source: Box<dyn Source + 'a>,
    topic: Option<&str>,
    limits: FileLimits,
) -> Result<Vec<WholeTable>, InputError> {
    let known = sensors(source.topics());
    let topics: Vec<usize> = match (topic, source.offer().whole) {
        (Some(wanted), _) => {
            let selection = ColumnSelection::default();
            let options = RowOptions { sensor: SensorChannels::generic(), selection, topic: Some(wanted.to_owned()) };
            vec![choose(source.as_ref(), &options).map_err(|reason| InputError::file(file, reason))?.topic]
        }
        (None, Some(whole)) => vec![whole],
        (None, None) if known.is_empty() => {
            let has_columns = |at: &usize| !source.topics()[*at].columns.is_empty();
            (0..source.topics().len()).filter(has_columns).take(MOST_TOPICS).collect()
        }
        (None, None) => {
            let mut topics: Vec<usize> = known.iter().map(|(_, choice)| choice.topic).collect();
            topics.dedup();
            topics
        }
    };
    let (mut tables, mut refused) = (Vec::new(), None);
    for at in topics {
        for columns in source.tables(at) {
            let all = &source.topics()[at].columns;
            let available: Vec<AvailableColumn> = columns.iter().map(|&at| all[at].clone()).collect();
            let whole = described(source.as_ref(), at, &available);
            let mut chosen = as_they_are(&available);
            chosen.iter_mut().for_each(|column| column.position = columns[column.position]);
            let mut rows = TopicRows { file, source, topic: at, chosen, notes: Vec::new(), limits };
            match whole.read(file, &mut rows) {
                Ok(table) => tables.push(table),
                Err(error) => refused = refused.or(Some(error)),
            }
            source = rows.source;
        }
    }
    if let Some(error) = refused.filter(|error| tables.is_empty() || error.reason.is_limit()) {
        return Err(error);
    }
    // One of several sensors.
    for table in &mut tables {
        if table.sensors.iter().any(|sensor| Some(sensor.name.as_str()) == topic) {
            table.sensors.retain(|sensor| Some(sensor.name.as_str()) == topic);
        }
    }
    Ok(tables)
}

fn described(source: &dyn Source, topic: usize, chosen: &[AvailableColumn]) -> WholeTable {
    let Topic { name, kind, .. } = &source.topics()[topic];
    let is_of_arrays = source.offer().whole.is_some();
    let mut whole = WholeTable { name: name.clone(), kind: kind.clone(), is_of_arrays, ..WholeTable::default() };
    // Columns may be in several topics.
    let position = |name: &str| chosen.iter().position(|column| column.name == name);
    for of in source.topics().iter().filter(|of| is_of_arrays || of.name == *name) {
        for sensor in &of.sensors {
            let column = |&(channel, at, unit): &(&'static str, usize, Option<Unit>)| {
                Some((channel, position(&of.columns[at].name)?, unit))
            };
            if let Some(columns) = sensor.columns.iter().map(column).collect() {
                whole.sensors.push(TopicSensor { name: sensor_name(of, sensor), columns, note: None });
            }
        }
    }
    whole
}
