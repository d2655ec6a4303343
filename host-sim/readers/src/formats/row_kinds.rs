//! Rows of several kinds, such as `ACC,…` and `GYR,…`, told by a field or by blanks.

use crate::columns::AvailableColumn;
use crate::formats::calendar;
use crate::formats::fields::number;
use crate::input::Reason;

const MOST_KINDS: usize = 8;
const LEAST_ROWS: usize = 2;
/// Columns that number devices, between blanks.
const NUMBERED: &str = "id i device device_id deviceid sensor sensor_id sensorid node node_id imu imu_id instance \
    sensor_type sensortype type";
const LEAST_NUMBERS: usize = 2;
/// Columns whose words are states of one sensor, between blanks.
const STATES: &str = "state status mode valid validity is_valid quality fix flag flags event activity phase";

#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum RowKind {
    /// Name in the field `at`.
    Labelled { at: usize, name: String },
    /// Numbers in these fields, which the other kinds lack.
    Filled { own: Vec<usize>, others: Vec<usize>, name: String },
}

impl RowKind {
    fn name(&self) -> &str {
        match self {
            Self::Labelled { name, .. } | Self::Filled { name, .. } => name,
        }
    }

    pub(crate) fn has(&self, row: &[&str]) -> bool {
        match self {
            Self::Labelled { at, name } => row.get(*at) == Some(&name.as_str()),
            Self::Filled { own, .. } => own.iter().any(|at| row.get(*at).is_some_and(|field| !field.is_empty())),
        }
    }
}

/// Fields with numbers, and rows.
struct Part {
    fields: Vec<usize>,
    rows: usize,
}

struct Label<'a> {
    name: &'a str,
    rows: usize,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct RowKinds(
    /// With numbers, in their order.
    Vec<RowKind>,
);

impl RowKinds {
    /// By a column of labels; `None` for one kind.
    pub(crate) fn find(rows: &[Vec<&str>], heading: &[&str]) -> Option<Self> {
        let width = rows.iter().map(Vec::len).min()?;
        let is_state = |at: &usize| heading.get(*at).is_some_and(|name| is_one_of(name, STATES));
        (0..width).filter(|at| !is_state(at)).find_map(|at| Self::of_labels(rows, at, is_label))
    }

    /// By a column that numbers devices.
    pub(crate) fn find_by_number(rows: &[Vec<&str>], heading: &[&str]) -> Option<Self> {
        let at = heading
            .iter()
            .position(|name| is_one_of(name, NUMBERED))
            .filter(|at| rows.iter().all(|row| row.len() > *at))?;
        Self::of_labels(rows, at, |field| field.parse::<u32>().is_ok())
    }

    /// Merged tables: blanks for the others.
    pub(crate) fn find_by_blanks(rows: &[Vec<&str>], columns: &[AvailableColumn]) -> Option<Self> {
        let has_number = |row: &[&str], at: usize| {
            row.get(at).is_some_and(|field| !field.is_empty() && number(field).is_some_and(|it| !it.value().is_nan()))
        };
        let is_common = |at: &usize| rows.iter().all(|row| has_number(row, *at));
        let parted: Vec<usize> = (0..columns.len()).filter(|at| !is_common(at)).collect();
        let mut parts: Vec<Part> = Vec::new();
        for row in rows {
            let fields: Vec<usize> = parted.iter().copied().filter(|at| has_number(row, *at)).collect();
            match parts.iter_mut().find(|part| part.fields == fields) {
                Some(part) => part.rows += 1,
                // No kind.
                None if fields.is_empty() => {}
                None => parts.push(Part { fields, rows: 1 }),
            }
        }
        let are_apart = |one: &Part, other: &Part| !one.fields.iter().any(|at| other.fields.contains(at));
        let all_apart = (0..parts.len()).all(|one| parts[..one].iter().all(|other| are_apart(&parts[one], other)));
        let is_often = parts.iter().all(|part| part.rows >= LEAST_ROWS);
        if !(2..=MOST_KINDS).contains(&parts.len()) || !all_apart || !is_often {
            return None;
        }
        let group = |part: &Part| {
            let (_, channel) = columns[*part.fields.first()?].prefix_and_channel()?;
            Some(channel.split('_').next().unwrap_or(channel).to_owned())
        };
        let groups: Vec<Option<String>> = parts.iter().map(group).collect();
        let is_unique =
            |name: &Option<String>| name.is_some() && groups.iter().filter(|other| *other == name).count() == 1;
        let are_unique = groups.iter().all(is_unique);
        let mut kinds = Vec::new();
        for (Part { fields: own, .. }, group) in parts.into_iter().zip(&groups) {
            let others = parted.iter().copied().filter(|at| !own.contains(at)).collect();
            let name = group.clone().filter(|_| are_unique).unwrap_or_else(|| columns[own[0]].name.clone());
            kinds.push(RowKind::Filled { own, others, name });
        }
        Some(Self(kinds))
    }

    fn of_labels(rows: &[Vec<&str>], at: usize, is_label: impl Fn(&str) -> bool) -> Option<Self> {
        let mut labels: Vec<Label> = Vec::new();
        for name in rows.iter().map(|row| row[at]) {
            if !is_label(name) {
                return None;
            }
            match labels.iter_mut().find(|label| label.name == name) {
                Some(label) => label.rows += 1,
                None => labels.push(Label { name, rows: 1 }),
            }
        }
        let has_numbers = |name: &str| {
            let row = rows.iter().find(|row| row[at] == name);
            row.is_some_and(|row| row.iter().filter(|field| field.parse::<f64>().is_ok()).count() >= LEAST_NUMBERS)
        };
        let is_several = (2..=MOST_KINDS).contains(&labels.len());
        let known = labels.iter().filter(|label| label.rows >= LEAST_ROWS && has_numbers(label.name));
        let kinds: Vec<RowKind> = known.map(|label| RowKind::Labelled { at, name: label.name.to_owned() }).collect();
        (is_several && !kinds.is_empty()).then_some(Self(kinds))
    }

    /// With numbers in all of these fields.
    pub(crate) fn filled_at(&self, positions: &[usize]) -> Option<&RowKind> {
        self.0.iter().find(|kind| match kind {
            RowKind::Filled { own, .. } => !positions.is_empty() && positions.iter().all(|at| own.contains(at)),
            RowKind::Labelled { .. } => false,
        })
    }

    /// The named one, or the only one.
    pub(crate) fn choose(&self, wanted: Option<&str>) -> Result<RowKind, Reason> {
        let all = || self.0.iter().map(RowKind::name).collect::<Vec<_>>().join(", ");
        let kind = match (wanted, self.0.as_slice()) {
            (Some(wanted), kinds) => kinds.iter().find(|kind| kind.name() == wanted),
            (None, [kind]) => Some(kind),
            (None, _) => return Err(Reason::SeveralTopics(all())),
        };
        let unknown = || Reason::UnknownTopic(Box::new((wanted.unwrap_or_default().to_owned(), all())));
        kind.cloned().ok_or_else(unknown)
    }
}

/// True for a heading among `known` names, which stand between blanks.
fn is_one_of(heading: &str, known: &str) -> bool {
    let plain = heading.to_lowercase();
    known.split(' ').any(|name| name == plain.trim_matches(['#', '%', ' ']))
}

/// No number, time or missing value; an address in hexadecimal digits may begin with a digit.
fn is_label(field: &str) -> bool {
    let is_address = || {
        field.split([':', '-']).count() > 3
            && field.bytes().all(|byte| b":-".contains(&byte) || byte.is_ascii_hexdigit())
    };
    let starts = field.chars().next().is_some_and(char::is_alphabetic) || is_address();
    let is_time = || calendar::date_time(field).or_else(|| calendar::date(field)).is_some();
    starts && field.replace(',', ".").parse::<f64>().is_err() && !is_time() && calendar::time_of_day(field).is_none()
}

#[cfg(test)]
mod tests {
    use super::RowKinds;

    fn names(kinds: RowKinds) -> Vec<String> {
        kinds.0.iter().map(|kind| kind.name().to_owned()).collect()
    }

    fn kinds(rows: &[&str]) -> Option<Vec<String>> {
        let rows: Vec<Vec<&str>> = rows.iter().map(|row| row.split(',').collect()).collect();
        RowKinds::find(&rows, &[]).map(names)
    }

    #[test]
    fn the_states_of_a_sensor_are_no_sensors() {
        let rows: Vec<Vec<&str>> =
            ["0,5,A", "1,6,V", "2,7,A", "3,8,V"].iter().map(|row| row.split(',').collect()).collect();
        for (heading, expected) in [("Status", None), ("source", Some(vec!["A".to_owned(), "V".to_owned()]))] {
            assert_eq!(RowKinds::find(&rows, &["t", "gx", heading]).map(names), expected, "{heading}");
        }
    }

    #[test]
    fn kinds_are_told_from_other_texts() {
        let two = kinds(&["ACC,1,2,3", "GYR,1,2,3", "ACC,1,2,3", "GPS,lost,0", "GYR,1,2,3", "GPS,lost,0"]);
        assert_eq!(two, Some(vec!["ACC".to_owned(), "GYR".to_owned()]));
        // A name in all rows is a frame's.
        assert_eq!(kinds(&["0,1,imu_link", "1,2,imu_link", "2,3,imu_link"]), None);
        assert_eq!(kinds(&["a,1,2", "b,2,3", "c,3,4"]), None);
        assert_eq!(kinds(&["nan,1,2", "nan,2,3", "2.5,3,4"]), None);
    }

    #[test]
    fn a_number_that_is_called_an_id_tells_devices() {
        let rows: Vec<Vec<&str>> =
            ["1,0,5", "2,3,6", "1,10,7", "2,13,8"].iter().map(|row| row.split(',').collect()).collect();
        let found = |heading: &[&str]| RowKinds::find_by_number(&rows, heading).map(names);
        assert_eq!(found(&["id", "t_ms", "gx"]), Some(vec!["1".to_owned(), "2".to_owned()]));
        assert_eq!(found(&["accuracy", "t_ms", "gx"]), None);
    }
}
