//! Sample periods of rows by stamps or index, and repeated rows; fine stamps are placed at once, coarse ones at the end.

use crate::irregular_stamps::of_few_digits;
use crate::lateness_track::COARSE;
use crate::stamp_alignment::uncertain;
use crate::stamp_quality::{AlignedStamps, StampQuality};
use crate::stream_clock::{Placed, Stamp, StreamClock};
use crate::time_base_error::{MIN_SAMPLES, TimeBaseError};
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

pub(crate) const FIRST_ROWS: usize = 1 << 17;
/// 600 MB.
const MOST_COARSE_ROWS: usize = 1 << 25;

/// Longest interval, sample periods, of a repeated sample; farther equal ones are chance.
const MAX_REPEATED_READ_INTERVAL: f64 = 0.75;
/// Window whose median duration gives the period.
const REPEATED_READ_WINDOW: usize = 32;
/// Least part of early equal rows beyond chance for all to be dropped.
const LEAST_READ_AGAIN: f64 = 0.5;
/// Search distance before a loss, in widths of the lateness.
const SEARCHED_WIDTHS: f64 = 4.0;

/// Largest relative difference of stated and measured rate.
const MAX_RATE_CONTRADICTION: f64 = 0.1;
/// Share of neighbours below which a stated rate is doubted.
const MIN_NEIGHBOURS: f64 = 0.75;

/// Most sample periods per sample.
const MAX_PERIODS_PER_SAMPLE: u64 = 64;
const MAX_PERIODS: u64 = 1 << 22;

/// Arrival of a row, and equality with the row before.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RowStamp {
    pub time_s: Option<f64>,
    pub index: Option<u64>,
    pub is_equal: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    At(Placed),
    Repeated,
}

/// Places the rows of a recording in their order.
pub struct Clock {
    stated_hz: Option<f64>,
    state: State,
    ignored: Option<String>,
}

enum State {
    FirstRows(Vec<RowStamp>),
    Stream(Box<Stream>),
    Coarse(Coarse),
    Known(Known),
}

struct Stream {
    clock: StreamClock,
    repeats: RepeatRule,
    before_s: Option<f64>,
    waiting: VecDeque<bool>,
    has_index: bool,
    first_rows: Option<StampQuality>,
    all_rows: Option<StampQuality>,
}

/// Times, s, and early repeats.
struct Coarse {
    repeats: RepeatRule,
    times_s: Vec<f64>,
    repeated: Vec<usize>,
}

struct Known {
    places: Arc<KnownPlaces>,
    next_row: usize,
    next_arrived: usize,
}

struct KnownPlaces {
    periods: Vec<u64>,
    /// Ascending row numbers of repeats.
    repeated: Vec<usize>,
    stamps: StampQuality,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct RepeatRule {
    /// Largest interval, s; 0 for none.
    shortest_s: f64,
}

impl RepeatRule {
    /// By the first rows; if distant rows are equal as often, close ones are samples too.
    fn new(rows: &[RowStamp], stated_hz: Option<f64>) -> Self {
        let none = Self { shortest_s: 0.0 };
        let Some(times) = times_of(rows) else { return none };
        let period_s = stated_hz.map(f64::recip).or_else(|| usual_interval(&times));
        let Some(shortest_s) = period_s.map(|period_s| MAX_REPEATED_READ_INTERVAL * period_s) else { return none };
        let (mut close, mut far) = (EqualPairs::default(), EqualPairs::default());
        for (at, pair) in times.windows(2).enumerate() {
            let pairs = if pair[1] - pair[0] < shortest_s { &mut close } else { &mut far };
            pairs.all += 1.0;
            pairs.equal += f64::from(u8::from(rows[at + 1].is_equal));
        }
        let by_chance = close.all * far.equal / far.all.max(1.0);
        if close.equal > 0.0 && by_chance >= LEAST_READ_AGAIN * close.equal { none } else { Self { shortest_s } }
    }

    fn is_repeat(self, row: &RowStamp, before_s: Option<f64>) -> bool {
        row.is_equal && matches!((before_s, row.time_s), (Some(before), Some(now)) if now - before < self.shortest_s)
    }
}

#[derive(Debug, Clone, Copy, Default)]
struct EqualPairs {
    all: f64,
    equal: f64,
}

impl Clock {
    /// A stated rate overrides the stamps.
    ///
    /// # Errors
    /// The rate is not positive and finite.
    pub fn new(stated_hz: Option<f64>) -> Result<Self, TimeBaseError> {
        if let Some(rate) = stated_hz.filter(|rate| !(rate.is_finite() && *rate > 0.0)) {
            return Err(TimeBaseError::InvalidRate(rate));
        }
        Ok(Self { stated_hz, state: State::FirstRows(Vec::new()), ignored: None })
    }

    /// For another reading.
    pub fn again(&self) -> Result<Self, TimeBaseError> {
        let state = match &self.state {
            State::Stream(stream) => {
                let Stream { repeats, has_index, first_rows, all_rows, .. } = stream.as_ref();
                State::Stream(Box::new(Stream::new(*repeats, *has_index, first_rows.clone(), all_rows.clone())?))
            }
            State::Known(Known { places, .. }) => State::Known(Known::new(Arc::clone(places))),
            State::FirstRows(_) | State::Coarse(_) => State::FirstRows(Vec::new()),
        };
        Ok(Self { stated_hz: self.stated_hz, state, ignored: self.ignored.clone() })
    }

    /// Takes rows; returns the places of the oldest unplaced ones that are decided, all with `is_last`.
    ///
    /// # Errors
    /// The stamps show no sample period, or another one than the stated rate.
    pub fn place(&mut self, rows: Vec<RowStamp>, is_last: bool) -> Result<Vec<Place>, TimeBaseError> {
        match &mut self.state {
            State::FirstRows(first) => {
                first.extend(rows);
                if first.len() < FIRST_ROWS && !is_last {
                    return Ok(Vec::new());
                }
                // As many first rows whatever the batch.
                let mut first = std::mem::take(first);
                let later = first.split_off(first.len().min(FIRST_ROWS));
                let is_all = is_last && later.is_empty();
                self.state = begin(&first, self.stated_hz, is_all).or_else(|error| {
                    self.ignored = Some(ignore_stamps(error, self.stated_hz)?);
                    let none = RepeatRule { shortest_s: 0.0 };
                    Ok(State::Stream(Box::new(Stream::new(none, false, None, None)?)))
                })?;
                let mut places = self.place(first, is_all)?;
                if !is_all {
                    places.extend(self.place(later, is_last)?);
                }
                Ok(places)
            }
            State::Stream(stream) => Ok(stream.place(&rows, is_last)),
            State::Coarse(coarse) => {
                coarse.push(&rows)?;
                if !is_last {
                    return Ok(Vec::new());
                }
                let Coarse { times_s, repeated, .. } = coarse;
                let rows = times_s.len();
                let places = align(times_s, std::mem::take(repeated), self.stated_hz).or_else(|error| {
                    self.ignored = Some(ignore_stamps(error, self.stated_hz)?);
                    let periods = (0..rows as u64).collect();
                    Ok(KnownPlaces { periods, repeated: Vec::new(), stamps: StampQuality::default() })
                })?;
                let count = places.periods.len() + places.repeated.len();
                let mut known = Known::new(Arc::new(places));
                let placed = known.next(count);
                self.state = State::Known(known);
                Ok(placed)
            }
            State::Known(known) => Ok(known.next(rows.len())),
        }
    }

    /// Reason to ignore the stamps.
    pub fn note(&self) -> Option<&str> {
        self.ignored.as_deref()
    }

    /// `None` without stamps.
    pub fn stamps(&self) -> Option<StampQuality> {
        match &self.state {
            State::Stream(stream) => {
                stream.all_rows.clone().or_else(|| Some(stream.clock.quality(stream.first_rows.as_ref()?)))
            }
            State::Known(Known { places, .. }) => Some(places.stamps.clone()),
            State::FirstRows(_) | State::Coarse(_) => None,
        }
    }

    /// Sample rate, Hz, of `samples` usable samples over `periods`.
    ///
    /// # Errors
    /// It has fewer than 4 samples, no two neighbours, gaps more than 64 times as long as the samples, or no rate.
    pub fn rate_hz(
        &self,
        samples: u64,
        periods: u64,
        dropped: &BTreeMap<&'static str, u64>,
    ) -> Result<f64, TimeBaseError> {
        if samples < MIN_SAMPLES {
            return Err(TimeBaseError::TooShort { used: samples, dropped: dropped.clone() });
        }
        if let State::Stream(stream) = &self.state
            && let Some(least_step) = stream.clock.least_step().filter(|least_step| *least_step > 1)
        {
            return Err(TimeBaseError::NoNeighbours(least_step));
        }
        if periods < samples || is_too_sparse(samples, periods - 1) {
            return Err(TimeBaseError::TooSparse { samples, periods });
        }
        let measured_hz = || self.stamps()?.rate.map(|rate| rate.hz);
        self.stated_hz.or_else(measured_hz).ok_or(TimeBaseError::NoRate)
    }
}

/// A note on stamps that a stated rate makes needless; another error stays.
fn ignore_stamps(error: TimeBaseError, stated_hz: Option<f64>) -> Result<String, TimeBaseError> {
    let is_of_stamps = matches!(
        error,
        TimeBaseError::RateContradictsStamps { .. } | TimeBaseError::NoPeriod | TimeBaseError::TooSparse { .. }
    );
    if is_of_stamps && stated_hz.is_some() { Ok(format!("the time stamps are ignored: {error}")) } else { Err(error) }
}

/// By the first rows; `is_all` if there are no others.
fn begin(rows: &[RowStamp], stated_hz: Option<f64>, is_all: bool) -> Result<State, TimeBaseError> {
    let repeats = RepeatRule::new(rows, stated_hz);
    let has_index = rows.first().is_some_and(|row| row.index.is_some());
    let is_short = (rows.len() as u64) < MIN_SAMPLES;
    let stream = |first_rows: Option<StampQuality>, all_rows: Option<StampQuality>| {
        Stream::new(repeats, has_index, first_rows, all_rows).map(|stream| State::Stream(Box::new(stream)))
    };
    let Some(times) = times_of(rows).filter(|_| !is_short) else {
        return stream(None, None);
    };
    let mut repeated = Vec::new();
    let mut before_s = None;
    for (at, row) in rows.iter().enumerate() {
        if repeats.is_repeat(row, before_s) {
            repeated.push(at);
        }
        before_s = row.time_s;
    }
    if has_index {
        let is_repeat = |at: &usize| repeated.binary_search(at).is_ok();
        let arrived: Vec<usize> = (0..rows.len()).filter(|at| !is_repeat(at)).collect();
        let indices: Vec<u64> = arrived.iter().filter_map(|&at| rows[at].index).collect();
        let times: Vec<f64> = arrived.iter().map(|&at| times[at]).collect();
        let quality = StampQuality::of_index(&indices, &times);
        return stream(Some(quality.clone()), Some(quality).filter(|_| is_all));
    }
    let coarse = State::Coarse(Coarse { repeats, times_s: Vec::new(), repeated: Vec::new() });
    let places = match align(&times, repeated, stated_hz) {
        // More rows may tell.
        Err(TimeBaseError::NoPeriod) if !is_all => return Ok(coarse),
        places => places?,
    };
    if is_all {
        return Ok(State::Known(Known::new(Arc::new(places))));
    }
    match stream(Some(places.stamps), None) {
        Ok(stream) => Ok(stream),
        _ if of_few_digits(&times).is_some() => Ok(coarse),
        Err(TimeBaseError::Irregular(_)) => Ok(coarse),
        Err(error) => Err(error),
    }
}

impl Stream {
    fn new(
        repeats: RepeatRule,
        has_index: bool,
        first_rows: Option<StampQuality>,
        all_rows: Option<StampQuality>,
    ) -> Result<Self, TimeBaseError> {
        let clock = StreamClock::new(has_index, first_rows.as_ref())?;
        Ok(Self { clock, repeats, before_s: None, waiting: VecDeque::new(), has_index, first_rows, all_rows })
    }

    fn place(&mut self, rows: &[RowStamp], is_last: bool) -> Vec<Place> {
        if self.waiting.is_empty() && rows.iter().all(|row| row.time_s.is_none()) {
            // Without times nothing repeats.
            let stamps = rows.iter().map(|row| Stamp { time_s: None, index: row.index });
            return self.clock.place(stamps, is_last).into_iter().map(Place::At).collect();
        }
        let mut arrived = Vec::with_capacity(rows.len());
        for row in rows {
            let is_repeat = self.repeats.is_repeat(row, self.before_s);
            self.before_s = row.time_s;
            self.waiting.push_back(is_repeat);
            if !is_repeat {
                arrived.push(Stamp { time_s: row.time_s, index: row.index });
            }
        }
        let mut placed = self.clock.place(arrived.into_iter(), is_last).into_iter();
        let mut places = Vec::with_capacity(rows.len());
        while let Some(is_repeat) = self.waiting.front() {
            let place = if *is_repeat { Some(Place::Repeated) } else { placed.next().map(Place::At) };
            let Some(place) = place else { break };
            places.push(place);
            self.waiting.pop_front();
        }
        places
    }
}

impl Coarse {
    fn push(&mut self, rows: &[RowStamp]) -> Result<(), TimeBaseError> {
        for row in rows {
            if self.repeats.is_repeat(row, self.times_s.last().copied()) {
                self.repeated.push(self.times_s.len());
            }
            self.times_s.push(row.time_s.unwrap_or_default());
        }
        if self.times_s.len() > MOST_COARSE_ROWS {
            let reason = format!("more than {MOST_COARSE_ROWS} rows whose stamps are coarser than the sample period");
            return Err(TimeBaseError::Irregular(reason));
        }
        Ok(())
    }
}

impl Known {
    fn new(places: Arc<KnownPlaces>) -> Self {
        Self { places, next_row: 0, next_arrived: 0 }
    }

    fn next(&mut self, rows: usize) -> Vec<Place> {
        let KnownPlaces { periods, repeated, .. } = self.places.as_ref();
        let place = |row: usize| {
            if repeated.binary_search(&row).is_ok() {
                return Some(Place::Repeated);
            }
            let period = *periods.get(self.next_arrived)?;
            let missing = period - self.next_arrived as u64;
            self.next_arrived += 1;
            Some(Place::At(Placed { period, missing }))
        };
        let places = (self.next_row..self.next_row + rows).map_while(place).collect();
        self.next_row += rows;
        places
    }
}

fn times_of(rows: &[RowStamp]) -> Option<Vec<f64>> {
    rows.iter().map(|row| row.time_s).collect()
}

/// `times` in s; rows `repeated` equal the row before.
fn align(times: &[f64], mut repeated: Vec<usize>, stated_hz: Option<f64>) -> Result<KnownPlaces, TimeBaseError> {
    let arrived = |repeated: &[usize]| -> Vec<usize> {
        (0..times.len()).filter(|at| repeated.binary_search(at).is_err()).collect()
    };
    let times_at = |positions: &[usize]| -> Vec<f64> { positions.iter().map(|&at| times[at]).collect() };
    let mut positions = arrived(&repeated);
    let mut arrived_s = times_at(&positions);
    let mut alignment = AlignedStamps::new(&arrived_s, stated_hz).ok_or(TimeBaseError::NoPeriod)?;
    // Coarse stamps: the number of samples tells repeats.
    if alignment.quality.width >= COARSE && take_back(&mut repeated, &positions, &alignment.quality) {
        positions = arrived(&repeated);
        arrived_s = times_at(&positions);
        alignment = AlignedStamps::new(&arrived_s, stated_hz).ok_or(TimeBaseError::NoPeriod)?;
    }
    match stated_hz {
        Some(stated_hz) => contradiction(&arrived_s, &alignment.quality, stated_hz)?,
        None if alignment.quality.rate.is_none() => return Err(TimeBaseError::NoPeriod),
        None => {}
    }
    let AlignedStamps { periods, quality: mut stamps } = alignment;
    stamps.losses.iter_mut().for_each(|loss| loss.before = positions[loss.before]);
    stamps.uncertain = uncertain(&stamps.losses, stamps.resolved);
    // Saturated periods.
    if !periods.is_sorted_by(|one, next| one < next) {
        let periods = periods.last().map_or(0, |last| last.saturating_add(1));
        return Err(TimeBaseError::TooSparse { samples: arrived_s.len() as u64, periods });
    }
    Ok(KnownPlaces { periods, repeated, stamps })
}

/// Takes chance repeats back, if the coarse stamps at `arrived` lack as many samples; true if any.
fn take_back(repeated: &mut Vec<usize>, arrived: &[usize], quality: &StampQuality) -> bool {
    let reach = (SEARCHED_WIDTHS * quality.width).ceil() as usize;
    let mut taken = Vec::new();
    let mut candidates = repeated.iter().copied().peekable();
    for loss in &quality.losses {
        let first = arrived[loss.before.saturating_sub(reach)];
        let last = arrived[(loss.before + reach / 4).min(arrived.len() - 1)];
        let mut missing = loss.missing;
        while let Some(position) = candidates.next_if(|&position| position < last) {
            if position > first && missing > 0 {
                taken.push(position);
                missing -= 1;
            }
        }
    }
    repeated.retain(|position| taken.binary_search(position).is_err());
    !taken.is_empty()
}

/// Mean of the median window, s.
fn usual_interval(times: &[f64]) -> Option<f64> {
    let window = if times.len() > 4 * REPEATED_READ_WINDOW { REPEATED_READ_WINDOW } else { 1 };
    let mut durations: Vec<f64> = times.windows(window + 1).map(|row| row[window] - row[0]).collect();
    let middle = durations.len() / 2;
    let duration = (!durations.is_empty()).then(|| *durations.select_nth_unstable_by(middle, f64::total_cmp).1)?;
    (duration > 0.0 && duration.is_finite()).then_some(duration / window as f64)
}

fn contradiction(times: &[f64], quality: &StampQuality, stated_hz: f64) -> Result<(), TimeBaseError> {
    let differs = |measured_hz: f64| (measured_hz / stated_hz - 1.0).abs() > MAX_RATE_CONTRADICTION;
    let few_neighbours = (quality.losses.len() as f64) > (1.0 - MIN_NEIGHBOURS) * times.len() as f64;
    if !few_neighbours && !quality.rate.is_some_and(|rate| differs(rate.hz)) {
        return Ok(());
    }
    match AlignedStamps::new(times, None).map(|alignment| alignment.quality) {
        Some(StampQuality { rate: Some(rate), losses, .. }) if differs(rate.hz) && losses.len() <= times.len() / 4 => {
            Err(TimeBaseError::RateContradictsStamps { stated_hz, measured_hz: rate.hz })
        }
        _ => Ok(()),
    }
}

fn is_too_sparse(samples: u64, span: u64) -> bool {
    span / MAX_PERIODS_PER_SAMPLE > samples && span > MAX_PERIODS
}
