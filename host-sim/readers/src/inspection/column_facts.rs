//! Facts of a column's numbers.

use crate::columns::{AvailableColumn, Unit};
use crate::rows::{WholeColumn, difference_noise, step, usual_unit};

const MOST_BACKWARDS: f64 = 0.01;
/// Ratio of the halves' rates: gaps.
const MOST_UNEVEN: f64 = 8.0;

const BLOCK: usize = 128;
const LEAST_BLOCKS: usize = 8;
const COUNTS_BY_ONE: f64 = 0.9;

pub(crate) struct ColumnFacts<'a> {
    pub(crate) column: &'a AvailableColumn,
    pub(crate) values: &'a [f64],
    pub(crate) mean: f64,
    pub(crate) blocks: Vec<f64>,
    /// By neighbours' differences.
    pub(crate) noise: f64,
    pub(crate) step: Option<f64>,
}

pub(crate) struct RowTimes {
    pub(crate) seconds: Vec<f64>,
    pub(crate) backwards: usize,
}

fn mean(values: &[f64]) -> f64 {
    let finite = || values.iter().filter(|value| value.is_finite());
    finite().sum::<f64>() / finite().count() as f64
}

impl<'a> ColumnFacts<'a> {
    pub(crate) fn new(of: &'a WholeColumn) -> Self {
        let WholeColumn { column, values } = of;
        Self {
            column,
            values,
            mean: mean(values),
            blocks: values.chunks((values.len() / LEAST_BLOCKS).clamp(1, BLOCK)).map(mean).collect(),
            noise: difference_noise(values),
            step: step(values).map(|(step, _)| step),
        }
    }

    pub(crate) fn is_whole(&self) -> bool {
        self.noise > 0.0 && self.values.iter().all(|value| value.is_nan() || value.fract() == 0.0)
    }

    /// Whole, mostly growing by one.
    pub(crate) fn is_counter(&self) -> bool {
        let by_one = self.values.windows(2).filter(|pair| pair[1] - pair[0] == 1.0).count();
        let is_most = by_one as f64 >= COUNTS_BY_ONE * (self.values.len().max(1) - 1) as f64;
        let is_growing = self.values.windows(2).all(|pair| pair[1] > pair[0]);
        self.values.len() > 2 && is_most && is_growing && self.values.iter().all(|value| value.fract() == 0.0)
    }

    pub(crate) fn is_clock(&self) -> bool {
        let rows = self.values.len();
        let back = self.values.windows(2).filter(|pair| pair[1] < pair[0] || pair[1].is_nan()).count();
        if rows < 8 || back as f64 > MOST_BACKWARDS * rows as f64 {
            return false;
        }
        let [first, middle, last] = [0, rows / 2, rows - 1].map(|at| self.values[at]);
        let (one, other) = (middle - first, last - middle);
        one > 0.0 && other > 0.0 && one.max(other) < MOST_UNEVEN * one.min(other)
    }

    /// `None` without a unit, or fewer than two.
    pub(crate) fn times_s(&self) -> Option<RowTimes> {
        let own = self.column.unit.filter(Unit::is_time).map(|unit| unit.factor);
        let factor = own.or_else(|| time_unit(self.values).map(|(unit, _)| unit.factor))?;
        let origin = self.values.iter().copied().find(|value| value.is_finite())?;
        let mut times = RowTimes { seconds: Vec::with_capacity(self.values.len()), backwards: 0 };
        for value in self.values.iter().filter(|value| value.is_finite()) {
            let time = (value - origin) * factor;
            if times.seconds.last().is_some_and(|last| time < *last) {
                times.backwards += 1;
            } else {
                times.seconds.push(time);
            }
        }
        (times.seconds.len() > 1).then_some(times)
    }

    /// `None` unless increasing.
    pub(crate) fn indices(&self) -> Option<Vec<u64>> {
        let is_index = |value: &f64| value.fract() == 0.0 && (0.0..9e15).contains(value);
        let is_increasing = self.values.windows(2).all(|pair| pair[0] < pair[1]);
        let all = is_increasing && self.values.iter().all(is_index);
        all.then(|| self.values.iter().map(|value| *value as u64).collect())
    }
}

/// Rates that tell the unit of times; the likeliest first, Hz.
const LIKELY_HZ: [std::ops::RangeInclusive<f64>; 2] = [10.0..=10_000.0, 0.2..=40_000.0];

pub(crate) fn time_unit(times: &[f64]) -> Option<(Unit, String)> {
    let finite: Vec<f64> = times.iter().copied().filter(|time| time.is_finite()).collect();
    let (origin, last) = (*finite.first()?, *finite.last()?);
    let since: Vec<f64> = finite.iter().map(|time| time - origin).collect();
    if let Some(unit) = usual_unit(&since, origin) {
        return Some((unit, String::new()));
    }
    let interval = (last - origin) / (finite.len().max(2) - 1) as f64;
    let units = ["ms", "us", "ns"].into_iter().filter_map(Unit::parse);
    let unit_of = |rates: &std::ops::RangeInclusive<f64>| {
        units.clone().find(|unit| rates.contains(&(interval * unit.factor).recip()))
    };
    let unit = LIKELY_HZ.iter().find_map(unit_of)?;
    let hz = (interval * unit.factor).recip();
    Some((unit, format!("a step of {interval:.4} in {} is {hz:.2} Hz", unit.name)))
}
