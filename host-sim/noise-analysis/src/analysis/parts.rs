//! The estimators of a recording: over the whole as it was measured, and over its two halves, repaired, with what every
//! pair of channels has in common.

use super::{Estimator, repairs::Repairs};
use crate::OCTAVES;
use allan_core::regression::CovarianceCurve;
use allan_core::{Cascade, Coupling, Curve};
use measurement::{ChannelProfile, Measurement};

/// Parts of a count: a repair need not be a whole number of them.
const PARTS_OF_COUNT: f64 = 16.0;

/// Estimators of some channels that take their samples in step.
#[derive(Clone)]
pub(super) struct Part {
    pub channels: Vec<ChannelProfile>,
    /// Physical unit of a number that was pushed, by channel.
    lsb: Vec<f64>,
    /// Physical unit of one step of the values, by channel.
    steps: Vec<f64>,
    period_s: f64,
    cascades: Vec<Estimator>,
    /// ChannelProfile `i` with `j < i` at `i·(i−1)/2 + j`.
    couplings: Vec<Coupling<OCTAVES>>,
}

/// The whole recording as measured, by channel, and its halves.
pub(super) struct Parts {
    pub measured: Vec<Curve<OCTAVES>>,
    pub first: Part,
    pub second: Part,
    /// Both halves, with a gap between them.
    pub both: Part,
}

impl Parts {
    pub(super) fn of(measurement: &Measurement, coupled: &[ChannelProfile], repairs: &Repairs) -> Self {
        let period_s = measurement.period_s();
        let mut measured: Vec<Estimator> = measurement.channels.iter().map(|_| Cascade::new()).collect();
        let others = measurement.profiles().filter(|channel| !coupled.contains(channel));
        let channels: Vec<ChannelProfile> = coupled.iter().copied().chain(others).collect();
        let counts: Vec<&[i32]> =
            channels.iter().filter_map(|channel| Some(measurement.channel(channel)?.counts.as_slice())).collect();
        let steps = channels.iter().map(|channel| f64::from(repairs.step(*channel)) * channel.lsb).collect();
        let part = Part::new(channels.clone(), coupled.len(), period_s, steps);
        let mut halves = [part.clone(), part];
        for position in 0..measurement.len() {
            let half = &mut halves[usize::from(position >= measurement.len() / 2)];
            let missing = measurement.missing_before(position);
            if missing > 0 {
                measured.iter_mut().for_each(|estimator| estimator.gap(missing));
                half.gap(missing);
            }
            for (estimator, channel) in measured.iter_mut().zip(&measurement.channels) {
                estimator.push(channel.counts[position]);
            }
            if repairs.leaves_out(position) {
                half.gap(1);
            } else {
                half.push(|place| {
                    let (channel, count) = (channels[place], counts[place][position]);
                    let parts = f64::from(count) * PARTS_OF_COUNT;
                    (parts - PARTS_OF_COUNT * repairs.level(channel, position) / channel.lsb).round() as i32
                });
            }
        }
        let curves = measured.iter().zip(&measurement.channels);
        let measured =
            curves.map(|(estimator, channel)| estimator.curve(period_s).scaled(channel.profile.lsb)).collect();
        let [first, second] = halves;
        let both = first.clone().followed_by(&second);
        Self { measured, first, second, both }
    }
}

impl Part {
    fn new(channels: Vec<ChannelProfile>, coupled: usize, period_s: f64, steps: Vec<f64>) -> Self {
        Self {
            steps,
            lsb: channels.iter().map(|channel| channel.lsb / PARTS_OF_COUNT).collect(),
            cascades: channels.iter().map(|_| Cascade::new()).collect(),
            couplings: vec![Coupling::new(); coupled * coupled.saturating_sub(1) / 2],
            period_s,
            channels,
        }
    }

    fn push(&mut self, value: impl Fn(usize) -> i32) {
        for (place, cascade) in self.cascades.iter_mut().enumerate() {
            cascade.push(value(place));
        }
        for (pair, coupling) in self.couplings.iter_mut().enumerate() {
            let (high, low) = members(pair);
            coupling.observe(&self.cascades[high], &self.cascades[low]);
        }
    }

    fn gap(&mut self, missing: u32) {
        self.cascades.iter_mut().for_each(|cascade| cascade.gap(missing));
    }

    fn followed_by(mut self, later: &Self) -> Self {
        self.cascades.iter_mut().zip(&later.cascades).for_each(|(cascade, later)| cascade.merge(later));
        self.couplings.iter_mut().zip(&later.couplings).for_each(|(coupling, later)| coupling.merge(later));
        self
    }

    /// Where a channel stands in the part.
    pub(super) fn position(&self, channel: ChannelProfile) -> Option<usize> {
        self.channels.iter().position(|of| *of == channel)
    }

    pub(super) fn curve(&self, channel: usize) -> Curve<OCTAVES> {
        self.cascades[channel].curve(self.period_s).scaled(self.lsb[channel])
    }

    /// One step of a channel's values in its unit: a count, or several.
    pub(super) fn step(&self, channel: usize) -> f64 {
        self.steps[channel]
    }

    /// The same by the channel's name; 0 of one that the part does not hold.
    pub(super) fn step_of(&self, channel: ChannelProfile) -> f64 {
        self.position(channel).map_or(0.0, |position| self.step(position))
    }

    /// What two channels have in common, in the product of their units.
    pub(super) fn shared(&self, a: usize, b: usize) -> CovarianceCurve<OCTAVES> {
        let (high, low) = (a.max(b), a.min(b));
        let mut points = self.couplings[high * (high - 1) / 2 + low].points();
        points.iter_mut().for_each(|point| point.covariance *= self.lsb[a] * self.lsb[b]);
        points
    }
}

/// The channels of a pair: the inverse of `i·(i−1)/2 + j`.
fn members(pair: usize) -> (usize, usize) {
    let high = (1..).find(|high| high * (high + 1) / 2 > pair).unwrap_or(1);
    (high, pair - high * (high - 1) / 2)
}
