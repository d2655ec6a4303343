//! Bags of ROS 2 in SQLite (`.db3`) by `message_definitions`; bags before Iron have ROS's own types only.

use crate::formats::message_layout::{Encoding, MessageLayout};
use crate::formats::ros_definition::{self, RosVersion};
use crate::formats::ros_message::{self, RosRows};
use crate::formats::topics::{EachRow, Offer, Source, Topic};
use crate::input::{Budget, FileBytes, InputError, Metered, Reason, ZSTD_MAGIC, ZstdFrames};
use crate::rows::Ending;
use rusqlite::{Connection, OpenFlags};
use std::collections::HashMap;
use std::io::{self, Read};

const FORMAT: &str = "ROS 2 SQLite bag";

/// Between two checks of the clock.
const INSTRUCTIONS: i32 = 100_000;

pub(crate) struct SqliteSource<'a> {
    file: &'a FileBytes,
    /// For bytes in memory.
    _copy: Option<FileBytes>,
    database: Connection,
    offer: Offer,
    /// Number in the database, and layout if known.
    layouts: Vec<(i64, Option<MessageLayout>)>,
    budget: Budget,
}

impl<'a> SqliteSource<'a> {
    pub(crate) fn open(file: &'a FileBytes, budget: Budget) -> Result<Self, InputError> {
        let fail = |error| file.error(damaged(error, budget));
        let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
        let copy = match file.file() {
            Some(_) => None,
            None => Some(file.open().and_then(|input| FileBytes::copied(file.name(), input, ""))),
        };
        let copy = copy.transpose().map_err(|error| file.error(Reason::Io(error)))?;
        let path = copy.as_ref().and_then(FileBytes::file).or(file.file()).unwrap_or(file.name());
        let mut database = Connection::open_with_flags(path, flags).map_err(fail)?;
        // Queries over the file's tables may never end.
        database.progress_handler(INSTRUCTIONS, Some(move || budget.check_time().is_err())).map_err(fail)?;
        if !has_table(&database, "topics").map_err(fail)? || !has_table(&database, "messages").map_err(fail)? {
            let topics = tables(&database).map_err(fail)?;
            return Err(file.error(Reason::NoSensor { format: "SQLite database", topics }));
        }
        let mut query = database.prepare("SELECT id, name, type FROM topics ORDER BY id").map_err(fail)?;
        let rows = query.query_map((), |row| Ok((row.get(0)?, row.get(1)?, row.get(2)?))).map_err(fail)?;
        let listed: Vec<(i64, String, String)> = rows.collect::<Result<_, _>>().map_err(fail)?;
        drop(query);
        let definitions = definitions(&database).map_err(fail)?;
        let (mut topics, mut layouts) = (Vec::new(), Vec::new());
        for (id, name, kind) in listed {
            let defined =
                definitions.get(&kind).and_then(|text| ros_definition::layout(&kind, text, RosVersion::Ros2).ok());
            let layout = defined.or_else(|| ros_definition::known_layout(&kind, RosVersion::Ros2));
            topics.push(match &layout {
                Some(layout) => ros_message::topic(&name, &kind, layout, None),
                None => Topic { name, kind, ..Topic::default() },
            });
            layouts.push((id, layout));
        }
        Ok(Self { file, _copy: copy, database, offer: Offer::new(FORMAT, topics), layouts, budget })
    }
}

/// Not a view or computed columns, which could have any size.
fn has_table(database: &Connection, name: &str) -> rusqlite::Result<bool> {
    let computed = "SELECT 1 FROM pragma_table_xinfo(sqlite_master.name) WHERE hidden <> 0";
    let text = format!("SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = ? AND NOT EXISTS ({computed})");
    database.prepare(&text)?.exists((name,))
}

fn tables(database: &Connection) -> rusqlite::Result<String> {
    let mut query = database.prepare("SELECT name FROM sqlite_master WHERE type IN ('table', 'view') LIMIT 24")?;
    let names: Vec<String> = query.query_map((), |row| row.get(0))?.collect::<Result<_, _>>()?;
    Ok(if names.is_empty() { "no table".to_owned() } else { format!("the tables {}", names.join(", ")) })
}

fn definitions(database: &Connection) -> rusqlite::Result<HashMap<String, String>> {
    if !has_table(database, "message_definitions")? {
        return Ok(HashMap::new());
    }
    let columns = "topic_type, encoded_message_definition FROM message_definitions WHERE encoding = 'ros2msg'";
    let mut query = database.prepare(&format!("SELECT {columns}"))?;
    query.query_map((), |row| Ok((row.get(0)?, row.get(1)?)))?.collect()
}

fn damaged(error: rusqlite::Error, budget: Budget) -> Reason {
    match budget.check_time() {
        Err(too_slow) => too_slow,
        Ok(()) => Reason::damaged(FORMAT, error.to_string()),
    }
}

fn damaged_message(error: io::Error) -> Reason {
    match Reason::from_io(error) {
        Reason::Io(error) => Reason::damaged(FORMAT, format!("a compressed message: {error}")),
        refused => refused,
    }
}

impl Source for SqliteSource<'_> {
    fn offer(&self) -> &Offer {
        &self.offer
    }

    fn read(&mut self, topic: usize, columns: &[usize], each: &mut EachRow) -> Result<Ending, InputError> {
        let Self { file, database, layouts, budget, .. } = self;
        let fail = |error| file.error(damaged(error, *budget));
        let (id, Some(layout)) = &layouts[topic] else { return Ok(Ending::default()) };
        let mut rows = RosRows::new(layout, Encoding::Cdr, columns);
        let mut meter = budget.meter();
        let text = "SELECT data, timestamp FROM messages WHERE topic_id = ? ORDER BY id";
        let mut query = database.prepare(text).map_err(fail)?;
        let mut messages = query.query((id,)).map_err(fail)?;
        let damage = loop {
            match messages.next() {
                Ok(Some(message)) => {
                    let data = message.get_ref(0).map_err(fail)?.as_blob().unwrap_or_default();
                    let recorded_ns = message.get(1).ok();
                    if !data.starts_with(&ZSTD_MAGIC) {
                        each(rows.row(data, recorded_ns))?;
                        continue;
                    }
                    let mut expanded = Vec::new();
                    let read = Metered::new(ZstdFrames::new(data), &mut meter).read_to_end(&mut expanded);
                    match read {
                        Ok(_) => each(rows.row(&expanded, recorded_ns))?,
                        Err(error) => break Some(damaged_message(error)),
                    }
                }
                Ok(None) => break None,
                Err(error) => break Some(damaged(error, *budget)),
            }
        };
        Ok(Ending { damage, notes: rows.notes() })
    }
}

#[cfg(test)]
mod tests {
    use super::SqliteSource;
    use crate::formats::topics::Source;
    use crate::input::{Budget, FileBytes, InputError, Reason};
    use rusqlite::Connection;
    use tempfile::{TempDir, tempdir};

    const TOPICS: &str = "CREATE TABLE topics(id INTEGER, name TEXT, type TEXT);";
    const MESSAGES: &str = "CREATE TABLE messages(id INTEGER, topic_id INTEGER, timestamp INTEGER, data BLOB);";

    fn database(statements: &[&str]) -> (TempDir, FileBytes) {
        let dir = tempdir().expect("a folder");
        let file = dir.path().join("bag.db3");
        Connection::open(&file).expect("a database").execute_batch(&statements.concat()).expect("written");
        (dir, FileBytes::from(&file))
    }

    fn reason(opened: Result<SqliteSource, InputError>) -> Option<Reason> {
        opened.err().map(|error| error.reason)
    }

    #[test]
    fn a_query_that_takes_longer_than_the_budget_is_stopped() {
        let rows = "WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c LIMIT 20000)
            INSERT INTO topics SELECT x, 'a', 'b' FROM c;";
        let (_dir, file) = database(&[TOPICS, MESSAGES, rows]);
        let opened = SqliteSource::open(&file, Budget::new(0)).expect("a bag");
        assert_eq!(opened.topics().len(), 20_000);
        let stopped = reason(SqliteSource::open(&file, Budget::spent()));
        assert!(matches!(stopped, Some(Reason::Limit(_))), "{stopped:?}");
    }

    #[test]
    fn a_table_whose_columns_are_computed_is_none() {
        let computed =
            "CREATE TABLE messages(id INTEGER, topic_id INTEGER, timestamp INTEGER, data AS (zeroblob(900000000)));";
        for statements in
            [[TOPICS, computed], ["CREATE TABLE topics(id INTEGER, name AS (hex(zeroblob(id))), type TEXT);", MESSAGES]]
        {
            let (_dir, file) = database(&statements);
            let refused = reason(SqliteSource::open(&file, Budget::new(0)));
            assert!(matches!(refused, Some(Reason::NoSensor { .. })), "{refused:?}");
        }
    }
}
