//! Content of a file without an analysis: columns, rates, gaps, guesses, options.

mod column_facts;
mod sensor_guess;
mod steady_part;
mod unit_guess;

use crate::columns::{ColumnSelection, ReadingNote, SensorChannels};
use crate::inspection::column_facts::ColumnFacts;
use crate::inspection::sensor_guess::SensorGuess;
use crate::rows::{BATCH, Batch, PaddingFinder, WholeTable};
use std::collections::BTreeMap;
use std::ops::Range;
use time_base::{Clock, Place, RowStamp};
use time_base::{RateEstimate, StampQuality, TimeBaseError, TimeRange};

pub use crate::inspection::sensor_guess::{ColumnGuess, Proposal};
pub use crate::inspection::steady_part::SteadyPart;

#[derive(Debug, Clone, PartialEq)]
pub struct InspectedColumn {
    pub name: String,
    pub unit: Option<&'static str>,
    pub first: Vec<f64>,
    /// Mean of the finite values; NaN where there is none.
    pub mean: f64,
    /// By neighbours' differences.
    pub noise: f64,
    pub step: Option<f64>,
    pub guess: Option<ColumnGuess>,
}

/// Largest part at rest of a moved sensor.
const MOVED: f64 = 0.9;
const SHOWN: usize = 3;

impl InspectedColumn {
    fn new(facts: &ColumnFacts, guess: Option<ColumnGuess>) -> Self {
        Self {
            name: facts.column.name.clone(),
            unit: facts.column.unit.map(|unit| unit.name),
            first: facts.values.iter().copied().take(SHOWN).collect(),
            mean: facts.mean,
            noise: facts.noise,
            step: facts.step,
            guess,
        }
    }
}

/// Rows of a file or topic.
#[derive(Debug, Clone, PartialEq)]
pub struct InspectedTable {
    /// May be empty.
    pub topic: String,
    /// May be empty.
    pub kind: String,
    pub rows: usize,
    /// More rows were not examined.
    pub is_cut: bool,
    /// The file ends early or cannot be read further; a note says why.
    pub is_damaged: bool,
    pub columns: Vec<InspectedColumn>,
    pub rate: Option<RateEstimate>,
    pub stated_rate_hz: Option<f64>,
    /// By time stamps, s.
    pub duration_s: Option<f64>,
    pub missing: u64,
    /// See [`missing`](Self::missing).
    pub gaps: usize,
    /// Longest steady part; `None` without inertial columns.
    pub steady: Option<SteadyPart>,
    /// If times, index or rate tell it.
    pub steady_s: Option<TimeRange>,
    pub proposals: Vec<Proposal>,
    pub notes: Vec<ReadingNote>,
}

impl InspectedTable {
    /// `sensor` gives counts, `selection` the user's choice.
    pub(crate) fn new(table: WholeTable, sensor: &SensorChannels, selection: &ColumnSelection) -> Self {
        let (table, before) = without_padding(table);
        let facts: Vec<ColumnFacts> = table.columns.iter().map(ColumnFacts::new).collect();
        let sensors = SensorGuess::all(&table, &facts, sensor, selection);
        let place = |channel: &str| sensors.iter().find_map(|sensor| sensor.position(channel));
        let times = place("time").and_then(|at| facts[at].times_s());
        let indices = place("sample").and_then(|at| facts[at].indices());
        let mut inspected = Self {
            topic: table.name.clone(),
            kind: table.kind.clone(),
            rows: table.rows(),
            is_cut: table.is_cut,
            is_damaged: table.is_damaged,
            columns: Vec::new(),
            rate: None,
            stated_rate_hz: table.rate_hz,
            duration_s: times.as_ref().and_then(|times| times.seconds.last().copied()),
            missing: 0,
            gaps: 0,
            steady: SteadyPart::find(&facts, &sensors),
            steady_s: None,
            proposals: Vec::new(),
            notes: table.notes.clone(),
        };
        if let Some(back) = times.as_ref().map(|times| times.backwards).filter(|back| *back > 0) {
            inspected.notes.push(format!("{back} rows whose time goes back").into());
        }
        let times_s = times.as_ref().map(|times| times.seconds.as_slice());
        // An index has to fit the times.
        let indices = indices.filter(|indices| times_s.is_none_or(|times| times.len() == indices.len()));
        let rows = times_s.map_or(inspected.rows, <[f64]>::len);
        // Without times the period does not matter.
        let stated_hz = table.rate_hz.or(Some(1.0).filter(|_| times_s.is_none()));
        if let Ok(placed) = PlacedTable::new(rows, times_s, indices.as_deref(), stated_hz) {
            inspected.rate = placed.stamps.as_ref().and_then(|stamps| stamps.rate);
            inspected.missing = placed.missing;
            inspected.gaps = placed.gaps;
            inspected.notes.extend(placed.stamps.iter().flat_map(StampQuality::notes).map(ReadingNote::from));
        }
        if let Some(SteadyPart { rows, .. }) = &mut inspected.steady {
            let rate_hz = inspected.rate.map(|rate| rate.hz).or(table.rate_hz);
            let part = time_of(rows, inspected.rows, times_s, indices.as_deref(), rate_hz);
            inspected.steady_s = part.map(|TimeRange { from_s, to_s }| {
                let before_s = rate_hz.map_or(0.0, |hz| before as f64 / hz);
                TimeRange { from_s: from_s + before_s, to_s: to_s + before_s }
            });
            *rows = rows.start + before..rows.end + before;
        }
        let has_rate = inspected.rate.is_some() || table.rate_hz.is_some();
        inspected.proposals = sensors.iter().map(|sensor| sensor.proposal(&table, &facts, has_rate)).collect();
        let part = inspected.part_at_rest().filter(|_| inspected.is_moved());
        inspected.proposals.iter_mut().for_each(|proposal| proposal.part = part);
        let guess = |at: usize| sensors.iter().find_map(|sensor| sensor.guess(at));
        inspected.columns =
            facts.iter().enumerate().map(|(at, facts)| InspectedColumn::new(facts, guess(at))).collect();
        inspected
    }

    /// If the whole table was examined.
    #[must_use]
    pub fn part_at_rest(&self) -> Option<TimeRange> {
        let SteadyPart { rows, is_rest } = self.steady.as_ref()?;
        let is_part = *is_rest && !self.is_cut && !rows.is_empty() && rows.len() < self.rows;
        self.steady_s.filter(|_| is_part)
    }

    fn is_moved(&self) -> bool {
        self.steady.as_ref().is_some_and(|steady| (steady.rows.len() as f64) < MOVED * self.rows as f64)
    }

    /// Guessed as channel, `time` or `sample`.
    #[must_use]
    pub fn has(&self, channel: &str) -> bool {
        self.columns.iter().any(|column| column.guess.as_ref().is_some_and(|guess| guess.channel == channel))
    }
}

/// And the padding rows in front.
fn without_padding(mut table: WholeTable) -> (WholeTable, usize) {
    // Times may go on.
    let is_value = |values: &&[f64]| values.windows(2).any(|pair| pair[1] < pair[0]);
    let values: Vec<&[f64]> = table.columns.iter().map(|column| column.values.as_slice()).filter(is_value).collect();
    let mut finder = PaddingFinder::default();
    let rows = if values.is_empty() { 0 } else { table.rows() };
    for start in (0..rows).step_by(BATCH) {
        let part = start..(start + BATCH).min(rows);
        let values = values.iter().map(|column| column[part.clone()].to_vec()).collect();
        finder.add::<()>(&Batch { rows: part.len(), values, ..Batch::default() });
    }
    let Some(unpadded) = finder.finish() else { return (table, 0) };
    let before = unpadded.first as usize;
    for column in &mut table.columns {
        column.values.truncate(unpadded.end as usize);
        column.values.drain(..before);
    }
    table.notes.push(unpadded.note(finder.rows()).into());
    (table, before)
}

struct PlacedTable {
    stamps: Option<StampQuality>,
    missing: u64,
    gaps: usize,
}

impl PlacedTable {
    fn new(
        rows: usize,
        times_s: Option<&[f64]>,
        indices: Option<&[u64]>,
        stated_hz: Option<f64>,
    ) -> Result<Self, TimeBaseError> {
        let mut clock = Clock::new(stated_hz)?;
        let stamp = |row: usize| RowStamp {
            time_s: times_s.and_then(|times| times.get(row)).copied(),
            index: indices.and_then(|indices| indices.get(row)).copied(),
            is_equal: false,
        };
        let places = clock.place((0..rows).map(stamp).collect(), true)?;
        let periods: Vec<u64> = places
            .iter()
            .filter_map(|place| match place {
                Place::At(placed) => Some(placed.period),
                Place::Repeated => None,
            })
            .collect();
        let span = periods.first().zip(periods.last()).map_or(0, |(first, last)| (last - first).saturating_add(1));
        clock.rate_hz(rows as u64, span, &BTreeMap::new())?;
        Ok(Self {
            stamps: clock.stamps(),
            missing: span - periods.len() as u64,
            gaps: periods.windows(2).filter(|pair| pair[1] - pair[0] > 1).count(),
        })
    }
}

/// For `rows` from the first of `all`, by times, or index and rate; `None` if unknown.
fn time_of(
    rows: &Range<usize>,
    all: usize,
    times_s: Option<&[f64]>,
    indices: Option<&[u64]>,
    rate_hz: Option<f64>,
) -> Option<TimeRange> {
    let period_s = rate_hz.map(f64::recip);
    // Times that go back have no place.
    let times_s = times_s.filter(|times| times.len() == all);
    let indices = indices.filter(|indices| indices.len() == all);
    let at = |row: usize| match (times_s, indices) {
        (Some(times), _) => Some(times.get(row)? - times.first()?),
        (None, Some(indices)) => Some((indices.get(row)? - indices.first()?) as f64 * period_s?),
        (None, None) => Some(row as f64 * period_s?),
    };
    // The last row lasts a period.
    let to_s = if rows.end < all { at(rows.end)? } else { at(all.checked_sub(1)?)? + period_s? };
    Some(TimeRange { from_s: at(rows.start)?, to_s })
}
