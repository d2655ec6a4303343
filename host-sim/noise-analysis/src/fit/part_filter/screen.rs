//! Whether a filter may be in sight at all: whether the sum of the channels' deviances can fall as far as one requires.
//!
//! Most records of white noise show none. There, the deviances at few decimations of each filter spare the search for the best one and
//! the dispersion of each channel, which needs that search too.

use super::channel_deviance::{ChannelDeviance, FilteredChannel, VariancesBehind};
use super::decimation::decimations;
use crate::OCTAVES;
use crate::parallel::in_parallel;
use allan_core::Curve;
use allan_core::term::MovingAverageFilter;

/// By how much the sum of the deviances may fall from the least of three neighbouring decimations to its least value between them, in
/// their second difference: four times as much as a parabola, which falls by an eighth.
const BETWEEN_STEPS: f64 = 0.5;

/// The deviances of one channel, not divided by its dispersion.
struct TriedFilters {
    unfiltered: f64,
    /// The largest number that they may be divided by.
    most_dispersion: f64,
    /// With each filter, every value of which is recorded.
    own_rate: Vec<f64>,
    /// With each filter at each of the [`decimations`].
    slow: Vec<Vec<f64>>,
}

/// A filter at its own rate, and at each of the [`decimations`].
struct Tried {
    own_rate: VariancesBehind,
    slow: Vec<VariancesBehind>,
}

/// The most by which the sum of the deviances of channels, each with its curve, falls with one of `filters`, whatever their
/// dispersions are.
pub(super) fn largest_fall(channels: &[(&FilteredChannel, &Curve<OCTAVES>)], filters: &[MovingAverageFilter]) -> f64 {
    let Some((_, first)) = channels.first() else { return f64::NEG_INFINITY };
    let octaves = channels.iter().map(|(_, curve)| curve.points().len()).max().unwrap_or(0) as u32;
    let behind = in_parallel(filters, |&filter| {
        let of = |filter| VariancesBehind::new(filter, octaves, first.sample_period());
        let slow = decimations(filter).map(|decimation| of(MovingAverageFilter { decimation, ..filter }));
        Tried { own_rate: of(filter), slow: slow.collect() }
    });
    let of_channel = |(channel, curve): &(&FilteredChannel, &Curve<OCTAVES>)| {
        TriedFilters::new(&mut ChannelDeviance::new(channel, curve), &behind)
    };
    let tried = in_parallel(channels, of_channel);
    let fall =
        |of: &dyn Fn(&TriedFilters) -> f64| tried.iter().map(|tried| tried.largest_fall_to(of(tried))).sum::<f64>();
    let of_filter = |(number, &filter): (usize, &MovingAverageFilter)| {
        let steps = decimations(filter).count();
        let falls: Vec<f64> = (0..steps).map(|at| fall(&|tried| tried.slow[number][at])).collect();
        let slow = (0..steps).map(|at| falls[at] + between_steps(&falls, at)).max_by(f64::total_cmp);
        [Some(fall(&|tried| tried.own_rate[number])), slow]
    };
    let largest = filters.iter().enumerate().flat_map(of_filter).flatten().max_by(f64::total_cmp);
    largest.unwrap_or(f64::NEG_INFINITY)
}

/// What the largest of three neighbouring `falls` may be exceeded by; 0 of another one.
fn between_steps(falls: &[f64], at: usize) -> f64 {
    // Read as slowly as it is long, a filter leaves no correlation.
    let after = falls.get(at + 1).copied().unwrap_or(0.0);
    let before = at.checked_sub(1).map_or(after, |before| falls[before]);
    if falls[at] < before.max(after) { 0.0 } else { BETWEEN_STEPS * (2.0 * falls[at] - before - after) }
}

impl TriedFilters {
    fn new(channel: &mut ChannelDeviance, filters: &[Tried]) -> Self {
        let unfiltered = channel.unfiltered();
        let own_rate: Vec<f64> = filters.iter().map(|of| channel.deviance_behind(&of.own_rate)).collect();
        let mut slowly = |of: &Tried| of.slow.iter().map(|behind| channel.deviance_behind(behind)).collect();
        let slow = filters.iter().map(&mut slowly).collect();
        let least = own_rate.iter().copied().fold(unfiltered, f64::min);
        Self { unfiltered, most_dispersion: channel.dispersion_by(least), own_rate, slow }
    }

    /// The most by which the deviance falls from that without a filter.
    fn largest_fall_to(&self, deviance: f64) -> f64 {
        let fall = self.unfiltered - deviance;
        if fall < 0.0 { fall / self.most_dispersion } else { fall }
    }
}
