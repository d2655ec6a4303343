//! The share of spikes and knocks in the Allan variance of a channel, by the part of a recording that shows them.
//!
//! Spikes and knocks are independent of the noise beneath them, so that their variances add: a part's curve with them exceeds the
//! curve without them by their share. Of single samples of size `A` that come at the rate `λ` it is `λA²/τ`, that of white noise; a
//! knock has a form of its own, by its length and its spectrum, and the octaves show it. Another part of the same length has the
//! same share but for chance: it holds another number of events, of other sizes.

use crate::OCTAVES;
use crate::bounds::Parameter;
use crate::distributions::poisson_bounds;
use crate::samples::interpolation::REACH;
use crate::samples::series::Series;
use allan_core::{AllanPoint, Curve};
use serde::Serialize;

/// Blocks of a part over which the energy of its events is compared first: fewer events than these are hardly ever two in a block.
const BLOCKS: u64 = 256;
/// Fewest blocks whose scatter is known, to a half.
const FEWEST_BLOCKS: usize = 8;

/// The Allan variance that the spikes and knocks of a part of a recording add to a channel.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct EventShare {
    /// Averaging factor and share in the variance, in the unit of the channel squared.
    points: Vec<(u64, f64)>,
    count: u64,
    hours: f64,
    /// Variance of the share of one such part, over its square.
    relative_variance: f64,
}

/// The spikes and knocks that a model foretells, by those of the first half of the recording.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EventsReport {
    /// Events in the first half. Samples that are left out are one event where no more than six lie between them.
    pub count: u64,
    pub rate_per_hour: Parameter,
    /// Standard deviation of the difference of their share in the variance from one half to the next, over the share, %: by how the
    /// energy of the events is spread over the first half.
    pub scatter_percent: f64,
    /// Root of their share in the Allan variance at each point of the curve, in the channel's unit. It is contained in `adev` of the model.
    pub adev: Vec<f64>,
}

impl EventShare {
    /// The share in the first half of a recording, whose curves of a channel are `with` and `without` its events: the samples of the
    /// sample periods `excluded` of `series`, and the samples `screened` that were left out before the means of `series` were taken,
    /// each with its distance from its neighbours.
    pub(crate) fn of_first_half(
        (series, excluded): (&Series, &[u64]),
        screened: &[(u64, f64)],
        (with, without): (&Curve<OCTAVES>, &Curve<OCTAVES>),
    ) -> Self {
        let slots: Vec<u64> = screened.iter().map(|(slot, _)| *slot).collect();
        let count = events(&slots) + events(excluded);
        if count == 0 {
            return Self::default();
        }
        let relative_variance =
            relative_variance(block_energies(series, excluded)).max(relative_variance(energies_of_samples(screened)));
        let hours = (series.span.end - series.span.start) as f64 * series.period_s / 3600.0;
        Self { points: difference(with, without), count, hours, relative_variance }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Their share in the Allan variance at an averaging factor. Beyond the longest one that is known it falls as that of white noise does.
    pub(crate) fn avar(&self, n: u64) -> f64 {
        let known = self.points.iter().rev().find(|(known, _)| *known <= n);
        known.map_or(0.0, |&(known, avar)| avar * known as f64 / n as f64)
    }

    /// The Allan variance at an averaging factor, and the degrees of freedom of a point that measures it, of the same `without` events
    /// and these: the scatter of the noise and that of the events, in this part and in the one that is foretold, add.
    pub(crate) fn added_to(&self, without: (f64, f64), n: u64) -> (f64, f64) {
        let ((without, edf), share) = (without, self.avar(n));
        (without + share, self.degrees_of_freedom(edf, share / (without + share)))
    }

    /// Degrees of freedom of a variance with those of its noise, `edf`, of which the events have the `fraction`.
    pub(crate) fn degrees_of_freedom(&self, edf: f64, fraction: f64) -> f64 {
        // A variance with edf degrees of freedom has the relative variance 2/edf.
        1.0 / (1.0 / edf + self.relative_variance * fraction * fraction)
    }

    /// Their report at the averaging factors `n`; `None` without events.
    pub(crate) fn report(&self, n: impl Iterator<Item = u64>) -> Option<EventsReport> {
        let rate = |count: f64| count / self.hours;
        let (fewest, most) = poisson_bounds(self.count as f64);
        (!self.is_empty()).then(|| EventsReport {
            count: self.count,
            rate_per_hour: Parameter::new(rate(self.count as f64), rate(fewest), rate(most), "1/h"),
            scatter_percent: 100.0 * (2.0 * self.relative_variance).sqrt(),
            adev: n.map(|n| self.avar(n).sqrt()).collect(),
        })
    }
}

/// The variance that the events add to a curve, where that is positive.
fn difference(with: &Curve<OCTAVES>, without: &Curve<OCTAVES>) -> Vec<(u64, f64)> {
    let share = |point: &AllanPoint| {
        let other = without.points().iter().find(|of| of.n == point.n)?;
        Some((point.n, (point.avar - other.avar).max(0.0)))
    };
    with.points().iter().filter_map(share).collect()
}

/// Number of events in `excluded`, in ascending order: the samples of one event lie no farther apart than an interpolation reaches.
fn events(excluded: &[u64]) -> u64 {
    let apart = excluded.windows(2).filter(|pair| pair[1] - pair[0] > REACH as u64).count();
    apart as u64 + u64::from(!excluded.is_empty())
}

/// Squares of the distances of samples from their neighbours, in [`BLOCKS`] of the sample periods up to the last of them.
fn energies_of_samples(samples: &[(u64, f64)]) -> Vec<f64> {
    let length = samples.last().map_or(1, |(last, _)| last / BLOCKS + 1);
    let mut energies = vec![0.0; BLOCKS as usize];
    for (slot, distance) in samples {
        energies[(slot / length) as usize] += distance * distance;
    }
    energies
}

/// Squares of the excluded samples, less the straight line between their present neighbours, summed in [`BLOCKS`] of the part.
fn block_energies(series: &Series, excluded: &[u64]) -> Vec<f64> {
    let length = (series.span.end - series.span.start).div_ceil(BLOCKS).max(1);
    let mut energies = vec![0.0; BLOCKS as usize];
    let kept: Vec<usize> =
        (0..series.slots.len()).filter(|&at| excluded.binary_search(&series.slots[at]).is_err()).collect();
    for (at, slot) in series.slots.iter().enumerate() {
        if excluded.binary_search(slot).is_err() {
            continue;
        }
        let next = kept.partition_point(|&of| of < at);
        let before = next.checked_sub(1).and_then(|last| kept.get(last));
        let line = match (before, kept.get(next)) {
            (Some(&before), Some(&after)) => {
                let part = (at - before) as f64 / (after - before) as f64;
                series.values[before] + part * (series.values[after] - series.values[before])
            }
            (Some(&only), None) | (None, Some(&only)) => series.values[only],
            (None, None) => continue,
        };
        let block = ((slot - series.span.start) / length) as usize;
        energies[block.min(BLOCKS as usize - 1)] += (series.values[at] - line).powi(2);
    }
    energies
}

/// Variance of the sum of some blocks over its square, by how they differ among themselves: the largest that blocks of any length
/// show, because events that come in groups scatter more than single ones.
fn relative_variance(mut blocks: Vec<f64>) -> f64 {
    let mut largest = 0.0_f64;
    while blocks.len() >= FEWEST_BLOCKS {
        let (count, sum) = (blocks.len() as f64, blocks.iter().sum::<f64>());
        if sum <= 0.0 {
            return largest;
        }
        let squares: f64 = blocks.iter().map(|block| (block - sum / count).powi(2)).sum();
        largest = largest.max(count * squares / (count - 1.0) / (sum * sum));
        blocks = blocks.chunks(2).map(|pair| pair.iter().sum()).collect();
    }
    largest
}

#[cfg(test)]
mod tests {
    use super::{BLOCKS, EventShare, block_energies, events, relative_variance};
    use crate::samples::series::Series;

    /// Energies of events of size 1 in these blocks.
    fn blocks(of_events: &[usize]) -> Vec<f64> {
        let mut blocks = vec![0.0; BLOCKS as usize];
        of_events.iter().for_each(|&block| blocks[block] += 1.0);
        blocks
    }

    /// The relative variance of a Poisson number is the reciprocal of its expectation. So it is of groups, if these come by themselves.
    #[test]
    fn few_events_or_groups_of_them_tell_their_share_to_the_root_of_their_number() {
        assert_eq!(relative_variance(blocks(&[17])), 1.0);
        let ten: Vec<usize> = (0..10).map(|event| 5 + 24 * event).collect();
        let of_ten = relative_variance(blocks(&ten));
        assert!((0.09..0.1).contains(&of_ten), "{of_ten}");
        let groups = relative_variance(blocks(&[40, 41, 42, 43, 44, 200, 201, 202, 203, 204]));
        assert!((0.4..0.6).contains(&groups), "{groups}");
        assert_eq!(relative_variance(blocks(&[])), 0.0);
    }

    /// Two samples of a straight line of 1 a second stand out by 5 and by −3.
    #[test]
    fn the_energy_of_an_event_is_that_over_the_line_between_its_neighbours() {
        let slots = 0..BLOCKS;
        let value = |slot: u64| {
            slot as f64 + [(100, 5.0), (101, -3.0)].iter().filter(|of| of.0 == slot).map(|of| of.1).sum::<f64>()
        };
        let series = Series {
            values: slots.clone().map(value).collect(),
            span: slots.clone(),
            slots: slots.collect(),
            period_s: 1.0,
            resolution: 1e-6,
            unit: "g",
        };
        let energies = block_energies(&series, &[100, 101]);
        assert!((energies[100] - 25.0).abs() < 1e-9 && (energies[101] - 9.0).abs() < 1e-9, "{energies:?}");
        assert!((energies.iter().sum::<f64>() - 34.0).abs() < 1e-9);
        assert_eq!(events(&[100, 101, 107, 114]), 2, "seven sample periods are farther than an interpolation reaches");
    }

    /// Of a variance of ten thousand degrees of freedom four events make half: they have 2/(2/4) = 4 in their half, 16 in the whole.
    #[test]
    fn the_degrees_of_freedom_are_those_of_the_noise_and_of_the_events() {
        let share = EventShare { points: vec![(1, 8.0), (4, 2.0)], count: 4, hours: 1.0, relative_variance: 0.25 };
        let edf = share.degrees_of_freedom(1e4, 0.5);
        assert!((1.0 / edf - (1.0 / 16.0 + 1e-4)).abs() < 1e-12, "{edf}");
        assert_eq!([1, 2, 4, 16].map(|n| share.avar(n)), [8.0, 4.0, 2.0, 0.5]);
    }
}
