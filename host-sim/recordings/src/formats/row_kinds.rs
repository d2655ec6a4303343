//! Rows of several kinds in one text, such as `ACC,…` and `GYR,…` in turn: a field says which kind a row is.

use crate::formats::calendar;
use crate::input::input_error::Reason;

/// Most kinds; names of frames or states may be many.
const MOST_KINDS: usize = 8;
/// How often each kind has to be among the first rows.
const LEAST_ROWS: usize = 2;
/// Names of columns whose numbers tell devices from each other.
const NUMBERED: [&str; 12] = [
    "id",
    "device",
    "device_id",
    "deviceid",
    "sensor",
    "sensor_id",
    "sensorid",
    "node",
    "node_id",
    "imu",
    "imu_id",
    "instance",
];
/// Fewest numbers in a row of a sensor.
const LEAST_NUMBERS: usize = 2;

/// The kinds of rows.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct RowKinds {
    /// Position of the field that says the kind.
    at: usize,
    /// The kinds whose rows have numbers, in the order in which they come.
    names: Vec<String>,
}

impl RowKinds {
    /// Of the first rows of a file; `None` where all are of one kind.
    pub(crate) fn find(rows: &[Vec<&str>]) -> Option<Self> {
        let width = rows.iter().map(Vec::len).min()?;
        (0..width).find_map(|at| Self::at(rows, at))
    }

    /// Of the first rows of a file below a heading, in which a column of whole numbers is called as one that tells devices from each other.
    pub(crate) fn find_by_number(rows: &[Vec<&str>], heading: &[&str]) -> Option<Self> {
        let is_named = |name: &&str| NUMBERED.contains(&name.to_lowercase().trim_start_matches(['#', '%', ' ']));
        let at = heading.iter().position(is_named).filter(|at| rows.iter().all(|row| row.len() > *at))?;
        Self::of_labels(rows, at, |field| field.parse::<u32>().is_ok())
    }

    fn at(rows: &[Vec<&str>], at: usize) -> Option<Self> {
        Self::of_labels(rows, at, is_label)
    }

    fn of_labels(rows: &[Vec<&str>], at: usize, is_label: impl Fn(&str) -> bool) -> Option<Self> {
        let mut counts: Vec<(&str, usize)> = Vec::new();
        for field in rows.iter().map(|row| row[at]) {
            if !is_label(field) {
                return None;
            }
            match counts.iter_mut().find(|(name, _)| *name == field) {
                Some((_, count)) => *count += 1,
                None => counts.push((field, 1)),
            }
        }
        let is_several = (2..=MOST_KINDS).contains(&counts.len());
        let has_numbers = |name: &str| {
            let row = rows.iter().find(|row| row[at] == name);
            row.is_some_and(|row| row.iter().filter(|field| field.parse::<f64>().is_ok()).count() >= LEAST_NUMBERS)
        };
        let names = counts.iter().filter(|(name, count)| *count >= LEAST_ROWS && has_numbers(name));
        let names: Vec<String> = names.map(|(name, _)| (*name).to_owned()).collect();
        (is_several && !names.is_empty()).then_some(Self { at, names })
    }

    /// The position of the field, and the kind that is read: that which is named, or the only one.
    pub(crate) fn choose(&self, wanted: Option<&str>) -> Result<(usize, String), Reason> {
        let all = || self.names.join(", ");
        let name = match (wanted, self.names.as_slice()) {
            (Some(wanted), names) => names.iter().find(|name| *name == wanted),
            (None, [name]) => Some(name),
            (None, _) => return Err(Reason::SeveralTopics(all())),
        };
        let unknown = || Reason::UnknownTopic(Box::new((wanted.unwrap_or_default().to_owned(), all())));
        Ok((self.at, name.ok_or_else(unknown)?.clone()))
    }
}

/// Whether a field is a name, and no number, time or missing value.
fn is_label(field: &str) -> bool {
    let starts = field.chars().next().is_some_and(char::is_alphabetic);
    let is_time = || calendar::date_time(field).or_else(|| calendar::date(field)).is_some();
    starts && field.replace(',', ".").parse::<f64>().is_err() && !is_time() && calendar::time_of_day(field).is_none()
}

#[cfg(test)]
mod tests {
    use super::RowKinds;

    fn kinds(rows: &[&str]) -> Option<Vec<String>> {
        let rows: Vec<Vec<&str>> = rows.iter().map(|row| row.split(',').collect()).collect();
        RowKinds::find(&rows).map(|kinds| kinds.names)
    }

    #[test]
    fn kinds_are_told_from_other_texts() {
        let two = kinds(&["ACC,1,2,3", "GYR,1,2,3", "ACC,1,2,3", "GPS,lost,0", "GYR,1,2,3", "GPS,lost,0"]);
        assert_eq!(two, Some(vec!["ACC".to_owned(), "GYR".to_owned()]));
        // One name for all rows is that of a frame; names that come once are anything.
        assert_eq!(kinds(&["0,1,imu_link", "1,2,imu_link", "2,3,imu_link"]), None);
        assert_eq!(kinds(&["a,1,2", "b,2,3", "c,3,4"]), None);
        assert_eq!(kinds(&["nan,1,2", "nan,2,3", "2.5,3,4"]), None);
    }

    #[test]
    fn a_number_that_is_called_an_id_tells_devices() {
        let rows: Vec<Vec<&str>> =
            ["1,0,5", "2,3,6", "1,10,7", "2,13,8"].iter().map(|row| row.split(',').collect()).collect();
        let found = |heading: &[&str]| RowKinds::find_by_number(&rows, heading).map(|kinds| kinds.names);
        assert_eq!(found(&["id", "t_ms", "gx"]), Some(vec!["1".to_owned(), "2".to_owned()]));
        assert_eq!(found(&["accuracy", "t_ms", "gx"]), None);
    }
}
