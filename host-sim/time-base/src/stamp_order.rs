//! Stamps that go back: wrapping counters, single wrong stamps, clocks that are set, told by the rows around.

use crate::lateness_track::quantile;
use std::collections::VecDeque;

const USUAL: usize = 32;
/// Longest step over a wrap or wrong stamp, usual intervals.
const LONGEST_STEP: f64 = 64.0;
/// Least distance of a wrong stamp, usual intervals.
const WRONG: f64 = 16.0;
const FIRST_WRONG: f64 = 1e4;
/// Rows that confirm a set clock, or doubt the first row; most wrong stamps in a row.
pub const ROWS_OF_SET_CLOCK: usize = 32;
pub const ROWS_OF_FIRST: usize = 8;
/// Rows before which a clock may be set forward.
const ROWS_BEFORE_SET: u64 = 256;

/// 10 to 32 bits; second, minute, hour, day and week in s, ms, us and ns.
fn moduli() -> impl Iterator<Item = f64> {
    let counters = (10..=32).map(|bits| (1u64 << bits) as f64);
    let periods = [1.0, 60.0, 3600.0, 86_400.0, 604_800.0];
    let clocks = [1.0, 1e3, 1e6, 1e9].into_iter().flat_map(move |unit| periods.map(|period| period * unit));
    counters.chain(clocks.filter(|period| *period > 50.0))
}

/// Verdict on a stamp.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Order {
    Next(f64),
    /// Follows an earlier one; so many last ones are wrong.
    AfterWrong(f64, usize),
    /// Follows, with the clock set forward by the second number.
    AfterSet(f64, f64),
    Back(f64),
}

/// In the file's unit.
#[derive(Debug, Default)]
pub struct StampOrder {
    offset: f64,
    /// The last times that were accepted.
    last: VecDeque<f64>,
    intervals: VecDeque<f64>,
    accepted: u64,
    wraps: u64,
    modulus: f64,
    sets: u64,
    first_set: u64,
    sets_forward: u64,
    first_set_forward: u64,
    wrong: u64,
}

impl StampOrder {
    fn usual(&self) -> Option<f64> {
        let mut intervals: Vec<f64> = self.intervals.iter().copied().collect();
        (intervals.len() >= 4).then(|| quantile(&mut intervals, 1, 2))
    }

    pub fn judge(&mut self, stamp: f64) -> Order {
        let time = stamp + self.offset;
        let Some(last) = self.last.back().copied().filter(|last| time < *last) else {
            return match self.set_forward(time) {
                Some(by) => Order::AfterSet(time - by, by),
                None => Order::Next(time),
            };
        };
        let Some(usual) = self.usual() else { return Order::Back(time) };
        let last_stamp = last - self.offset;
        let is_passed = |modulus: &f64| {
            last_stamp < *modulus && stamp >= 0.0 && stamp + modulus - last_stamp <= LONGEST_STEP * usual
        };
        if let Some(modulus) = moduli().find(is_passed) {
            if self.wraps == 0 {
                self.modulus = modulus;
            }
            self.wraps += 1;
            self.offset += modulus;
            return Order::Next(time + modulus);
        }
        let times: Vec<f64> = self.last.iter().rev().copied().collect();
        let follows = |wrong: &usize| {
            let (first, before) = (times[wrong - 1], times[*wrong]);
            time >= before && time - before <= LONGEST_STEP * usual && first - before > WRONG * usual
        };
        let Some(wrong) = (1..times.len()).find(follows) else { return Order::Back(time) };
        self.wrong += wrong as u64;
        Order::AfterWrong(time, wrong)
    }

    /// Amount of a forward setting with the last row, near the start only.
    fn set_forward(&mut self, time: f64) -> Option<f64> {
        if self.accepted > ROWS_BEFORE_SET {
            return None;
        }
        let mut times = self.last.iter().rev();
        let (last, before, usual) = (*times.next()?, *times.next()?, self.usual()?);
        if last - before <= FIRST_WRONG * usual || time - last > LONGEST_STEP * usual {
            return None;
        }
        let by = last - before - usual;
        if self.sets_forward == 0 {
            self.first_set_forward = self.accepted;
        }
        self.sets_forward += 1;
        self.offset -= by;
        *self.last.back_mut()? -= by;
        Some(by)
    }

    /// Takes the time of a row that is used.
    pub fn accept(&mut self, time: f64) {
        if let Some(interval) = self.last.back().map(|last| time - last).filter(|interval| *interval > 0.0) {
            if self.intervals.len() == USUAL {
                self.intervals.pop_front();
            }
            self.intervals.push_back(interval);
        }
        if self.last.len() > ROWS_OF_FIRST {
            self.last.pop_front();
        }
        self.last.push_back(time);
        self.accepted += 1;
    }

    /// The last row is not used.
    pub fn forget_last(&mut self) {
        self.last.pop_back();
        self.intervals.pop_back();
        self.accepted = self.accepted.saturating_sub(1);
    }

    /// True if `times` of later rows contradict the first.
    pub fn is_first_wrong(&mut self, times: &[f64]) -> bool {
        let [first, second, ..] = times else { return false };
        let mut intervals: Vec<f64> = times[1..].windows(2).map(|pair| pair[1] - pair[0]).collect();
        let usual = quantile(&mut intervals, 1, 2);
        let is_wrong = times.len() == ROWS_OF_FIRST && usual > 0.0 && (second - first).abs() > FIRST_WRONG * usual;
        self.wrong += u64::from(is_wrong);
        is_wrong
    }

    /// True if only the first was used, behind all others.
    pub fn has_first_alone(&self) -> bool {
        self.accepted <= 1
    }

    /// Begins with the next row, as if there had been none.
    pub fn begin_anew(&mut self) {
        self.wrong += 1;
        *self = Self { wrong: self.wrong, ..Self::default() };
    }

    /// A clock set back to `time` before this row: no sample is missing there.
    pub fn set_clock(&mut self, time: f64, row: u64) {
        let (Some(last), Some(usual)) = (self.last.back(), self.usual()) else { return };
        if self.sets == 0 {
            self.first_set = row;
        }
        self.sets += 1;
        self.offset += last + usual - time;
    }

    /// By [`judge`](Self::judge), after a setting.
    pub fn shift(&self, time: f64, offset_before: f64) -> f64 {
        time - offset_before + self.offset
    }

    /// Added to a stamp.
    pub fn offset(&self) -> f64 {
        self.offset
    }

    /// Remarks for readers of the analysis, one sentence each.
    pub fn notes(&self) -> Vec<String> {
        let Self { wraps, modulus, sets, first_set, sets_forward, first_set_forward, wrong, .. } = self;
        let sentences = [
            (*wraps, format!("the time stamps begin anew at {modulus} and go on ({wraps} times)")),
            (
                *sets,
                format!(
                    "the clock was set back {sets} times, first before row {first_set}; how long that took is not known, and no sample is taken to be missing there"
                ),
            ),
            (
                *sets_forward,
                format!(
                    "the clock was set forward before row {first_set_forward}, and no sample is taken to be missing there"
                ),
            ),
            (*wrong, format!("{wrong} rows whose time is far from that of the rows around them are left out")),
        ];
        sentences.into_iter().filter(|(count, _)| *count > 0).map(|(_, sentence)| sentence).collect()
    }
}
