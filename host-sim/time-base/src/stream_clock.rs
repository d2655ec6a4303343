//! Sample periods of rows read in blocks, in bounded memory, by the rule of [`lateness_track`](crate::lateness_track).

use crate::clock_rate::SteadyStream;
use crate::indexed_clock::{ClockStep, STEP_PERIODS, STEP_S};
use crate::lateness_track::{CERTAIN, COARSE, LOSS, MEMORY, MinimumBehind, RateEstimate, least_growth, minimum_ahead};
use crate::stamp_alignment::MAX_QUEUE;
use crate::stamp_quality::StampQuality;
use crate::time_base_error::TimeBaseError;
use std::collections::VecDeque;

#[derive(Debug, Clone, Copy, PartialEq)]
enum Source {
    Rows,
    /// Perhaps beside stamps with this period, s.
    Index(Option<f64>),
    /// With the first rows' period, s.
    Stamps(f64),
}

/// Arrival of a row, as far as recorded.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Stamp {
    pub(crate) time_s: Option<f64>,
    pub(crate) index: Option<u64>,
}

/// The sample period of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Placed {
    pub period: u64,
    pub missing: u64,
}

pub(crate) struct StreamClock {
    source: Source,
    placed: u64,
    missing: u64,
    /// s.
    origin_s: Option<f64>,
    last: Stamp,
    /// For unplaced rows: lateness, and times in s.
    ahead: Vec<f64>,
    times_s: Vec<f64>,
    least_growth: f64,
    recent: VecDeque<f64>,
    /// `None` if the stamps do not place.
    steady: Option<SteadyStream>,
    level: MinimumBehind,
    line: Line,
    /// Period from the first row, and time in s.
    end: (u64, f64),
    late: u64,
    uncertain: u64,
    least_step: u64,
    /// Leaps of time against the index, and their sum, s.
    clock_steps: Vec<ClockStep>,
    leapt_s: f64,
}

impl StreamClock {
    /// `head` has the stamps of the first rows; an error if they are coarser than the sample period, or show none.
    pub(crate) fn new(has_index: bool, head: Option<&StampQuality>) -> Result<Self, TimeBaseError> {
        let period_s = head.and_then(|head| head.rate).map(|rate| rate.hz.recip());
        let source = match (has_index, head) {
            (true, _) => Source::Index(period_s),
            (false, None) => Source::Rows,
            (false, Some(head)) if head.width >= COARSE || !head.resolved => {
                let reason = format!("they are {:.1} sample periods wide", head.width);
                return Err(TimeBaseError::Irregular(reason));
            }
            (false, Some(head)) if head.is_of_loop => {
                return Err(TimeBaseError::Irregular("a loop asks for the samples when it has time".to_owned()));
            }
            (false, Some(head)) if head.least_loss > 1 => {
                return Err(TimeBaseError::Irregular("they come in bursts".to_owned()));
            }
            (false, Some(_)) => Source::Stamps(period_s.ok_or(TimeBaseError::NoPeriod)?),
        };
        Ok(Self {
            source,
            placed: 0,
            missing: 0,
            origin_s: None,
            last: Stamp::default(),
            ahead: Vec::new(),
            times_s: Vec::new(),
            least_growth: least_growth(
                head.and_then(|head| head.tick_s).zip(period_s).map(|(tick, period)| tick / period),
            ),
            recent: VecDeque::new(),
            steady: if let Source::Stamps(period_s) = source { Some(SteadyStream::new(period_s)) } else { None },
            end: (0, 0.0),
            level: MinimumBehind::new(MEMORY),
            line: Line::default(),
            late: 0,
            uncertain: 0,
            least_step: u64::MAX,
            clock_steps: Vec::new(),
            leapt_s: 0.0,
        })
    }

    /// All with `is_last`.
    pub(crate) fn place(&mut self, rows: impl Iterator<Item = Stamp>, is_last: bool) -> Vec<Placed> {
        match self.source {
            Source::Rows => {
                let place = |_| {
                    self.placed += 1;
                    Placed { period: self.placed - 1, missing: 0 }
                };
                rows.map(place).collect()
            }
            Source::Index(period_s) => rows.map(|row| self.by_index(row, period_s)).collect(),
            Source::Stamps(period_s) => {
                let mut origin_s = self.origin_s;
                let times = rows.map(|row| {
                    let time_s = row.time_s.unwrap_or_default();
                    time_s - *origin_s.get_or_insert(time_s)
                });
                let steady = self.steady.as_mut().map(|steady| steady.steady(times, is_last)).unwrap_or_default();
                self.origin_s = origin_s;
                for (time_s, steady_s) in steady {
                    let number = self.placed + self.ahead.len() as u64;
                    self.ahead.push(steady_s / period_s - number as f64);
                    self.times_s.push(time_s);
                }
                self.by_stamps(is_last)
            }
        }
    }

    fn by_index(&mut self, row: Stamp, period_s: Option<f64>) -> Placed {
        let index = row.index.unwrap_or_default();
        if let Some(before) = self.last.index {
            let step = index - before;
            self.least_step = self.least_step.min(step);
            self.missing = self.missing.saturating_add(step - 1);
            if let (Some(period_s), Some(before), Some(now)) = (period_s, self.last.time_s, row.time_s) {
                let excess = (now - before) / period_s - step as f64;
                if excess.abs() >= STEP_PERIODS.max(STEP_S / period_s) {
                    let seconds = excess * period_s;
                    self.leapt_s += seconds;
                    self.clock_steps.push(ClockStep { before: self.placed as usize, seconds });
                }
            }
        }
        if let Some(time_s) = row.time_s {
            let origin_s = *self.origin_s.get_or_insert(time_s);
            self.line.add(index as f64, time_s - origin_s - self.leapt_s);
        }
        self.last = row;
        self.placed += 1;
        Placed { period: index, missing: self.missing }
    }

    fn by_stamps(&mut self, is_last: bool) -> Vec<Placed> {
        let ready = if is_last { self.ahead.len() } else { (self.ahead.len() + 1).saturating_sub(MAX_QUEUE) };
        let envelope = minimum_ahead(&self.ahead, MAX_QUEUE);
        let mut placed = Vec::with_capacity(ready);
        for ((&late, &least), &time_s) in self.ahead.iter().zip(&envelope).zip(&self.times_s).take(ready) {
            let excess = self.level.minimum().map_or(0.0, |level| least - self.missing as f64 - level);
            self.recent.push_back(late);
            if self.recent.len() > MEMORY + 1 {
                self.recent.pop_front();
            }
            if excess >= LOSS && self.has_long_interval() {
                // Saturates.
                self.missing = self.missing.saturating_add((excess.round() as u64).max(1));
                self.uncertain += u64::from((excess - excess.round()).abs() >= CERTAIN);
            }
            self.level.push(least - self.missing as f64);
            let period = self.missing.saturating_add(self.placed);
            self.placed += 1;
            if late - self.missing as f64 - self.level.minimum().unwrap_or(0.0) < 1.0 {
                self.line.add(period as f64, time_s);
            } else {
                self.late += 1;
            }
            placed.push(Placed { period, missing: self.missing });
            self.end = (period, time_s);
        }
        self.ahead.drain(..ready);
        self.times_s.drain(..ready);
        placed
    }

    fn has_long_interval(&self) -> bool {
        self.recent.iter().zip(self.recent.iter().skip(1)).any(|(one, next)| next - one >= self.least_growth)
    }

    /// By the stamps, Hz.
    fn rate_hz(&self) -> Option<f64> {
        let changing = self.changing_rate().map(|rate| rate.hz);
        changing.or(self.line.slope().map(f64::recip)).filter(|hz| hz.is_finite() && *hz > 0.0)
    }

    fn changing_rate(&self) -> Option<RateEstimate> {
        let [shortest_s, longest_s] = self.steady.as_ref()?.periods_s()?;
        let (period, time_s) = self.end;
        Some(RateEstimate { hz: period as f64 / time_s, low_hz: longest_s.recip(), high_hz: shortest_s.recip() })
    }

    /// `first_rows` has the stamps of the first ones.
    pub(crate) fn quality(&self, first_rows: &StampQuality) -> StampQuality {
        let changing = self.changing_rate();
        let by_line = || {
            let hz = self.rate_hz()?;
            // Valid for all.
            let of_first = first_rows.rate?;
            let (low_hz, high_hz) = (hz * of_first.low_hz / of_first.hz, hz * of_first.high_hz / of_first.hz);
            Some(RateEstimate { hz, low_hz, high_hz })
        };
        StampQuality {
            rate: changing.or_else(by_line),
            is_rate_changing: changing.is_some(),
            late: self.late,
            uncertain: self.uncertain,
            losses: Vec::new(),
            clock_steps: self.clock_steps.clone(),
            ..first_rows.clone()
        }
    }

    /// `None` without an index, or one row.
    pub(crate) fn least_step(&self) -> Option<u64> {
        let has_step = matches!(self.source, Source::Index(_)) && self.placed > 1;
        has_step.then_some(self.least_step)
    }
}

/// Least-squares line by running moments.
#[derive(Debug, Clone, Copy, Default)]
struct Line {
    count: f64,
    mean: (f64, f64),
    xx: f64,
    xy: f64,
}

impl Line {
    fn add(&mut self, x: f64, y: f64) {
        self.count += 1.0;
        let (from_x, from_y) = (x - self.mean.0, y - self.mean.1);
        self.mean.0 += from_x / self.count;
        self.mean.1 += from_y / self.count;
        self.xx += from_x * (x - self.mean.0);
        self.xy += from_x * (y - self.mean.1);
    }

    fn slope(&self) -> Option<f64> {
        let slope = self.xy / self.xx;
        (slope.is_finite() && slope > 0.0).then_some(slope)
    }
}
