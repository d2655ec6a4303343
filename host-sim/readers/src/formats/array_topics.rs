//! Named arrays of NumPy, MATLAB and HDF5, and the tables that they form.

use crate::columns::{ACCELEROMETER, AvailableColumn, GYROSCOPE, ReadingNote, Unit, known_by_name};
use crate::formats::message_layout::Scalar;
use crate::formats::topics::{EachRow, Offer, Source, Stop, Topic};
use crate::input::{Budget, InputError, Reason};
use crate::rows::{Ending, MAX_SAMPLES, Number, TopicSensor};
use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::path::Path;

/// Vectors without a stated unit, as in NaveGo and textbooks.
const UNITS_BY_NAME: [(&str, &str); 2] = [("wb", "rad/s"), ("fb", "m/s^2")];

/// Names of a sample rate, Hz, between blanks: attributes, or arrays of one number.
const RATES: &str = "sampling_rate sample_rate samplingrate samplerate sampling_frequency sample_frequency samplefrequency \
    samplingfrequency fs freq rate_hz fs_hz sample_rate_hz";
/// Names of a sample period, s.
const PERIODS: &str = "dt ts sample_time sample_period sampling_period";

/// The sample rate, Hz, that a number with this name states.
pub(crate) fn stated_rate(name: &str, number: f64) -> Option<f64> {
    let name = name.to_lowercase();
    let is_one_of = |known: &str| known.split(' ').any(|known| known == name);
    let rate = if is_one_of(PERIODS) { number.recip() } else { number };
    ((is_one_of(RATES) || is_one_of(PERIODS)) && rate.is_finite() && rate > 0.0).then_some(rate)
}

/// A vector, or a matrix whose longer side is time.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct NamedArray {
    /// Path with its final sign, `imu1.` or `/run/`; empty at the top.
    pub(crate) group: String,
    /// Empty for the only array.
    pub(crate) name: String,
    pub(crate) rows: usize,
    /// Or numbers, from 0.
    pub(crate) columns: Vec<String>,
    pub(crate) unit: Option<Unit>,
    /// Hz, and its source, if the file says it.
    pub(crate) rate: Option<(f64, String)>,
}

impl NamedArray {
    pub(crate) fn matrix(group: &str, name: &str, rows: usize, columns: usize) -> Self {
        let columns = (0..columns).map(|number| number.to_string()).collect();
        Self { group: group.to_owned(), name: name.to_owned(), rows, columns, ..Self::default() }
    }

    fn has_named_columns(&self) -> bool {
        self.columns.first().is_some_and(|name| name.parse::<usize>().is_err())
    }

    fn path(&self) -> String {
        format!("{}{}", self.group, self.name)
    }

    /// `gyro.0` of a matrix; the name of a vector; the number without a name.
    fn column_name(&self, path: &str, column: usize) -> String {
        match (path, self.columns.len()) {
            ("", _) => self.columns[column].clone(),
            (path, 1) => path.to_owned(),
            (path, _) => format!("{path}.{}", self.columns[column]),
        }
    }

    fn available(&self, path: &str, column: usize) -> AvailableColumn {
        let name = self.column_name(path, column);
        let heading = AvailableColumn::from_heading(&name);
        AvailableColumn {
            unit: self.unit.or(heading.unit),
            name: if heading.unit.is_some() { heading.name } else { name },
        }
    }
}

/// Numbers of a column in rows of bytes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Encoded {
    pub(crate) offset: usize,
    pub(crate) scalar: Scalar,
    pub(crate) is_big_endian: bool,
}

impl Encoded {
    /// NaN beyond the end of `row`.
    pub(crate) fn number(self, row: &[u8]) -> Number {
        self.scalar.read(row.get(self.offset..).unwrap_or_default(), self.is_big_endian)
    }
}

/// Columns that are read: array and number, of arrays of `rows` rows.
pub(crate) struct WantedColumns<'a> {
    pub(crate) places: &'a [(usize, usize)],
    rows: usize,
    budget: Budget,
}

impl WantedColumns<'_> {
    /// For a format whose columns have to be held, an array at a time.
    pub(crate) fn held(
        &self,
        each: &mut EachRow,
        mut read: impl FnMut(usize, &[usize]) -> Result<Vec<Vec<Number>>, Reason>,
    ) -> Result<(), Stop> {
        if self.rows as u64 > MAX_SAMPLES {
            return Err(Reason::TooManySamples.into());
        }
        self.budget.meter().add_values((self.rows * self.places.len()) as u64)?;
        let mut columns: Vec<Vec<Number>> = vec![Vec::new(); self.places.len()];
        let arrays: BTreeSet<usize> = self.places.iter().map(|(array, _)| *array).collect();
        for array in arrays {
            let own: Vec<usize> = (0..columns.len()).filter(|&at| self.places[at].0 == array).collect();
            let numbers: Vec<usize> = own.iter().map(|&at| self.places[at].1).collect();
            for (at, column) in own.into_iter().zip(read(array, &numbers)?) {
                columns[at] = column;
            }
        }
        let rows = columns.iter().map(Vec::len).min().unwrap_or(0);
        let mut row = Vec::with_capacity(columns.len());
        for at in 0..rows {
            row.clear();
            row.extend(columns.iter().map(|column| column[at]));
            each(&row)?;
        }
        Ok(())
    }
}

pub(crate) trait ArrayReader: Send {
    const FORMAT: &'static str;

    fn rows(&mut self, wanted: &WantedColumns, each: &mut EachRow) -> Result<(), Stop>;
}

pub(crate) struct ArraySource<'a, R> {
    file: &'a Path,
    reader: R,
    arrays: Vec<NamedArray>,
    offer: Offer,
    /// Array and column of each column, overall and per topic.
    places: Vec<(usize, usize)>,
    members: Vec<Vec<usize>>,
    budget: Budget,
}

impl<'a, R: ArrayReader> ArraySource<'a, R> {
    /// The first topic has all arrays; groups and arrays follow.
    pub(crate) fn new(file: &'a Path, mut reader: R, mut arrays: Vec<NamedArray>, budget: Budget) -> Self {
        set_stated_rates(&mut reader, &mut arrays, budget);
        let places: Vec<(usize, usize)> = arrays
            .iter()
            .enumerate()
            .flat_map(|(number, array)| (0..array.columns.len()).map(move |column| (number, column)))
            .collect();
        let offer = Offer { whole: Some(0), ..Offer::new(R::FORMAT, Vec::new()) };
        let mut source = Self { file, reader, arrays, offer, places, members: Vec::new(), budget };
        let paths: Vec<String> = source.arrays.iter().map(NamedArray::path).collect();
        let groups_of: Vec<String> = source.arrays.iter().map(|array| array.group.clone()).collect();
        source.add_topic(String::new(), |_| true);
        let mut known = HashSet::new();
        for group in groups_of.iter().filter(|group| known.insert(group.as_str())) {
            let name = group.trim_end_matches(['.', '/']).to_owned();
            let topic = if name.is_empty() { 0 } else { source.add_topic(name, |at| groups_of[at].starts_with(group)) };
            source.offer.topics[topic].sensors = source.sensor(group, topic).into_iter().collect();
        }
        for path in paths.iter().filter(|path| !path.is_empty()) {
            source.add_topic(path.clone(), |at| paths[at] == *path);
        }
        source
    }

    /// Members are numbers of arrays.
    fn add_topic(&mut self, name: String, is_member: impl Fn(usize) -> bool) -> usize {
        let members: Vec<usize> = (0..self.places.len()).filter(|&at| is_member(self.places[at].0)).collect();
        let available = |&at: &usize| {
            let (number, column) = self.places[at];
            self.arrays[number].available(&self.arrays[number].path(), column)
        };
        let columns = members.iter().map(available).collect();
        let rows = members.first().map(|&at| self.arrays[self.places[at].0].rows as u64);
        self.offer.topics.push(Topic { name, rows, columns, ..Topic::default() });
        self.members.push(members);
        self.offer.topics.len() - 1
    }

    /// The stated rate of columns, Hz, with its source.
    fn stated_rate(&self, topic: usize, columns: &[usize]) -> Option<&(f64, String)> {
        let mut arrays: Vec<usize> = columns.iter().map(|&column| self.places[self.members[topic][column]].0).collect();
        arrays.sort_unstable();
        arrays.into_iter().find_map(|array| self.arrays[array].rate.as_ref())
    }

    /// The sensor by names of the arrays in `group`.
    fn sensor(&self, group: &str, topic: usize) -> Option<TopicSensor> {
        let own: Vec<usize> = (0..self.members[topic].len())
            .filter(|&at| self.arrays[self.places[self.members[topic][at]].0].group == group)
            .collect();
        let place = |at: usize| self.places[self.members[topic][at]];
        let available: Vec<AvailableColumn> = own
            .iter()
            .map(|&at| {
                let (array, column) = place(at);
                let array = &self.arrays[array];
                // A record's numbers have names.
                let path = if array.has_named_columns() { "" } else { array.name.as_str() };
                array.available(path, column)
            })
            .collect();
        let known = known_by_name(&available)?;
        let has = |axes: [&str; 3]| axes.iter().all(|axis| known.iter().any(|(name, _)| name == axis));
        if !has(GYROSCOPE) && !has(ACCELEROMETER) {
            return None;
        }
        let mut sensor = TopicSensor::default();
        let mut by_convention: Vec<String> = Vec::new();
        for (channel, at) in known {
            let is_needed = channel == "time"
                || channel == "sample"
                || GYROSCOPE.contains(&channel)
                || ACCELEROMETER.contains(&channel);
            if !is_needed && available[at].unit.is_none() {
                // A magnetometer or thermometer is no reason to ask.
                continue;
            }
            let position = own[at];
            let array = &self.arrays[place(position).0];
            let usual = UNITS_BY_NAME.iter().find(|(name, _)| array.name.eq_ignore_ascii_case(name));
            let usual = usual.filter(|_| available[at].unit.is_none());
            if let Some((_, unit)) = usual {
                let told = format!("{} in {unit}", array.path());
                if !by_convention.contains(&told) {
                    by_convention.push(told);
                }
            }
            sensor.columns.push((channel, position, usual.and_then(|(_, unit)| Unit::parse(unit))));
        }
        if !by_convention.is_empty() {
            let taken = by_convention.join(" and ");
            sensor.note = Some(format!("{taken}, as is usual for arrays of these names; --units says otherwise"));
        }
        Some(sensor)
    }
}

fn set_stated_rates(reader: &mut impl ArrayReader, arrays: &mut [NamedArray], budget: Budget) {
    for at in 0..arrays.len() {
        let NamedArray { group, name, rows: 1, columns, .. } = &arrays[at] else { continue };
        // 1 stands for any.
        if columns.len() != 1 || stated_rate(name, 1.0).is_none() {
            continue;
        }
        let mut number = f64::NAN;
        let wanted = WantedColumns { places: &[(at, 0)], rows: 1, budget };
        let mut take = |row: &[Number]| {
            number = row[0].value();
            Ok(())
        };
        if reader.rows(&wanted, &mut take).is_err() {
            continue;
        }
        let Some(rate) = stated_rate(name, number) else { continue };
        let (group, path) = (group.clone(), arrays[at].path());
        for array in arrays.iter_mut().filter(|array| array.rows > 1 && array.group.starts_with(&group)) {
            array.rate.get_or_insert((rate, path.clone()));
        }
    }
}

impl<R: ArrayReader> Source for ArraySource<'_, R> {
    fn offer(&self) -> &Offer {
        &self.offer
    }

    /// Arrays of one length: all if they name one sensor, else by group.
    fn tables(&self, topic: usize) -> Vec<Vec<usize>> {
        let mut by_rows: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (at, member) in self.members[topic].iter().enumerate() {
            by_rows.entry(self.arrays[self.places[*member].0].rows).or_default().push(at);
        }
        let columns = &self.offer.topics[topic].columns;
        let mut tables = Vec::new();
        for all in by_rows.into_values().rev() {
            let available: Vec<AvailableColumn> = all.iter().map(|&at| columns[at].clone()).collect();
            if known_by_name(&available).is_some_and(|known| !known.is_empty()) {
                tables.push(all);
                continue;
            }
            let mut groups: Vec<(&str, Vec<usize>)> = Vec::new();
            for at in all {
                let own = self.arrays[self.places[self.members[topic][at]].0].group.as_str();
                match groups.iter_mut().find(|(group, _)| own.starts_with(*group)) {
                    Some((_, table)) => table.push(at),
                    None => groups.push((own, vec![at])),
                }
            }
            tables.extend(groups.into_iter().map(|(_, columns)| columns));
        }
        tables
    }

    fn rate_hz(&self, topic: usize, columns: &[usize]) -> Option<f64> {
        self.stated_rate(topic, columns).map(|(hz, _)| *hz)
    }

    fn read(&mut self, topic: usize, columns: &[usize], each: &mut EachRow) -> Result<Ending, InputError> {
        let file = self.file;
        let fail = |reason| InputError::file(file, reason);
        let places: Vec<(usize, usize)> =
            columns.iter().map(|&column| self.places[self.members[topic][column]]).collect();
        let first = places.first().map_or(0, |(array, _)| *array);
        let note = |(hz, by): &(f64, String)| format!("the file states a rate of {hz} Hz ({by})");
        let notes = self.stated_rate(topic, columns).map(note).map(ReadingNote::from).into_iter().collect();
        if let Some(array) =
            places.iter().map(|(array, _)| &self.arrays[*array]).find(|of| of.rows != self.arrays[first].rows)
        {
            let [one, other] =
                [&self.arrays[first], array].map(|array| format!("array {:?} has {} rows", array.path(), array.rows));
            return Err(fail(Reason::UnequalRows(format!("{one}, {other}"))));
        }
        let wanted = WantedColumns { places: &places, rows: self.arrays[first].rows, budget: self.budget };
        Ok(Ending { damage: Stop::damage(self.reader.rows(&wanted, each))?, notes })
    }
}
