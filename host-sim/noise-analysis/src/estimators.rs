//! Estimators of several channels of a recording: Allan variances of the whole as it was measured, and Allan variances and
//! covariances of its two halves after preprocessing.

use crate::preprocessing::Preprocessing;
use crate::{OCTAVES, OVERLAP};
use allan_core::regression::CovarianceCurve;
use allan_core::{Cascade, Coupling, Curve};
use measurement::{ChannelProfile, Measurement};
use nalgebra::DMatrix;

/// The estimators take integers: a count is divided into so many steps, because a bias step that preprocessing subtracts is
/// not a whole number of counts.
const STEPS_PER_COUNT: f64 = 16.0;

/// Cascades of channels that are sampled at the same times, and the Allan covariance of every pair of the first of them.
#[derive(Clone)]
pub(crate) struct CoupledEstimators {
    cascades: Vec<Cascade<OCTAVES, OVERLAP>>,
    /// Of channel `i` with channel `j < i`, at index `i·(i−1)/2 + j`.
    couplings: Vec<Coupling<OCTAVES>>,
}

impl CoupledEstimators {
    /// Estimators of so many channels, of which the first `coupled` have a covariance with each other.
    pub(crate) fn new(channels: usize, coupled: usize) -> Self {
        Self {
            cascades: vec![Cascade::new(); channels],
            couplings: vec![Coupling::new(); coupled * coupled.saturating_sub(1) / 2],
        }
    }

    /// Takes one sample of every channel.
    pub(crate) fn push(&mut self, values: impl Iterator<Item = i32>) {
        self.cascades.iter_mut().zip(values).for_each(|(cascade, value)| cascade.push(value));
        let mut couplings = self.couplings.iter_mut();
        for (at, a) in self.cascades.iter().enumerate() {
            for (b, coupling) in self.cascades[..at].iter().zip(&mut couplings) {
                coupling.observe(a, b);
            }
        }
    }

    /// Records that `missing` samples are missing.
    pub(crate) fn gap(&mut self, missing: u32) {
        self.cascades.iter_mut().for_each(|cascade| cascade.gap(missing));
    }

    /// The estimators of these samples followed, after a gap, by those of `later`.
    pub(crate) fn followed_by(mut self, later: &Self) -> Self {
        self.cascades.iter_mut().zip(&later.cascades).for_each(|(cascade, later)| cascade.merge(later));
        self.couplings.iter_mut().zip(&later.couplings).for_each(|(coupling, later)| coupling.merge(later));
        self
    }

    /// The cascade of a channel.
    pub(crate) fn cascade(&self, channel: usize) -> &Cascade<OCTAVES, OVERLAP> {
        &self.cascades[channel]
    }

    /// Covariances of the second differences of all channels at one octave, up to a common factor; `None` where the octave
    /// has no differences.
    pub(crate) fn covariances(&self, octave: usize) -> Option<DMatrix<f64>> {
        let mut covariances = DMatrix::zeros(self.cascades.len(), self.cascades.len());
        let mut couplings = self.couplings.iter();
        for (i, cascade) in self.cascades.iter().enumerate() {
            let (squares, count) = cascade.sum_of_squares(octave).filter(|&(_, count)| count > 0)?;
            covariances[(i, i)] = squares as f64 / count as f64;
            for (j, coupling) in (0..i).zip(&mut couplings) {
                let (products, count) = coupling.sum_of_products(octave).filter(|&(_, count)| count > 0)?;
                covariances[(i, j)] = products as f64 / count as f64;
                covariances[(j, i)] = covariances[(i, j)];
            }
        }
        Some(covariances)
    }
}

/// Estimators of one half of a recording, or of both halves, in physical units.
#[derive(Clone)]
pub(crate) struct RecordPart {
    /// In the order of all positions.
    pub channels: Vec<ChannelProfile>,
    estimators: CoupledEstimators,
    /// Smallest distance of two values by channel, in its unit: one count, or several.
    resolutions: Vec<f64>,
    period_s: f64,
}

/// The curves of the recording as measured, and the estimators of its halves after preprocessing.
pub(crate) struct RecordEstimators {
    /// In the order of the recording's channels.
    pub measured: Vec<Curve<OCTAVES>>,
    pub first: RecordPart,
    pub second: RecordPart,
    /// Both halves, with a gap between them.
    pub both: RecordPart,
}

impl RecordEstimators {
    /// One pass over `measurement`. The channels of each part are `coupled`, then all others that were recorded.
    pub(crate) fn estimate(
        measurement: &Measurement,
        coupled: &[ChannelProfile],
        preprocessing: &Preprocessing,
    ) -> Self {
        let period_s = measurement.period_s();
        let mut measured: Vec<Cascade<OCTAVES, OVERLAP>> =
            measurement.channels.iter().map(|_| Cascade::new()).collect();
        let others = measurement.profiles().filter(|channel| !coupled.contains(channel));
        let channels: Vec<ChannelProfile> = coupled.iter().copied().chain(others).collect();
        let counts: Vec<&[i32]> =
            channels.iter().filter_map(|channel| Some(measurement.channel(channel)?.counts.as_slice())).collect();
        let resolutions =
            channels.iter().map(|channel| f64::from(preprocessing.counts_per_step(*channel)) * channel.lsb).collect();
        let estimators = CoupledEstimators::new(channels.len(), coupled.len());
        let part = RecordPart { channels: channels.clone(), estimators, resolutions, period_s };
        let mut halves = [part.clone(), part];
        for position in 0..measurement.len() {
            let half = &mut halves[usize::from(position >= measurement.len() / 2)].estimators;
            let missing = measurement.missing_before(position);
            if missing > 0 {
                measured.iter_mut().for_each(|estimator| estimator.gap(missing));
                half.gap(missing);
            }
            for (estimator, channel) in measured.iter_mut().zip(&measurement.channels) {
                estimator.push(channel.counts[position]);
            }
            if preprocessing.excludes(position) {
                half.gap(1);
            } else {
                half.push(channels.iter().zip(&counts).map(|(channel, counts)| {
                    let steps = f64::from(counts[position]) * STEPS_PER_COUNT;
                    (steps - STEPS_PER_COUNT * preprocessing.offset(*channel, position) / channel.lsb).round() as i32
                }));
            }
        }
        let curves = measured.iter().zip(&measurement.channels);
        let measured =
            curves.map(|(estimator, channel)| estimator.curve(period_s).scaled(channel.profile.lsb)).collect();
        let [first, second] = halves;
        let both = RecordPart { estimators: first.estimators.clone().followed_by(&second.estimators), ..first.clone() };
        Self { measured, first, second, both }
    }
}

impl RecordPart {
    /// Position of a channel.
    pub(crate) fn position(&self, channel: ChannelProfile) -> Option<usize> {
        self.channels.iter().position(|of| *of == channel)
    }

    /// Allan variances of the channel at a position, in its unit squared.
    pub(crate) fn curve(&self, channel: usize) -> Curve<OCTAVES> {
        self.estimators.cascade(channel).curve(self.period_s).scaled(self.step_size(channel))
    }

    /// Smallest distance of two values of the channel at a position, in its unit.
    pub(crate) fn resolution(&self, channel: usize) -> f64 {
        self.resolutions[channel]
    }

    /// Smallest distance of two values of a channel, in its unit; 0 of a channel that was not recorded.
    pub(crate) fn resolution_of(&self, channel: ChannelProfile) -> f64 {
        self.position(channel).map_or(0.0, |position| self.resolution(position))
    }

    /// Allan covariances of two coupled channels, in the product of their units.
    pub(crate) fn covariance(&self, a: usize, b: usize) -> CovarianceCurve<OCTAVES> {
        let (high, low) = (a.max(b), a.min(b));
        let mut points = self.estimators.couplings[high * (high - 1) / 2 + low].points();
        points.iter_mut().for_each(|point| point.covariance *= self.step_size(a) * self.step_size(b));
        points
    }

    /// Physical size of 1 in what the estimators take.
    fn step_size(&self, channel: usize) -> f64 {
        self.channels[channel].lsb / STEPS_PER_COUNT
    }
}
