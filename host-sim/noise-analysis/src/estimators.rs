//! Estimators of several channels of a recording: Allan variances of the whole as it was measured, and Allan variances and
//! covariances of its two halves.
//!
//! All channels are on one time grid. A sample that one channel lacks is missing in that channel alone; products of two
//! channels are taken where both have a sample.

use crate::parallel::in_parallel;
use crate::preprocessing::{Exclusion, Preprocessing};
use crate::shorter_times::{ShorterTimes, ShorterTimesOfChannel};
use crate::streamed_curves::STEPS_PER_COUNT;
use crate::{OCTAVES, OVERLAP};
use allan_core::regression::CovarianceCurve;
use allan_core::{Cascade, Coupling, Covariance, Curve};
use measurement::{ChannelProfile, MeasuredChannel, Measurement};
use nalgebra::DMatrix;

/// Cascades of channels on a common time grid, each with gaps of its own, and the Allan covariance of every pair of the first of them.
#[derive(Clone)]
pub(crate) struct CoupledEstimators {
    cascades: Vec<Cascade<OCTAVES, OVERLAP>>,
    /// Samples that are missing in each channel since its last one.
    missing: Vec<u32>,
    /// Of channel `i` with channel `j < i`, at index `i·(i−1)/2 + j`.
    couplings: Vec<Coupling<OCTAVES>>,
}

impl CoupledEstimators {
    /// Estimators of so many channels, of which the first `coupled` have a covariance with each other.
    pub(crate) fn new(channels: usize, coupled: usize) -> Self {
        Self {
            cascades: vec![Cascade::new(); channels],
            missing: vec![0; channels],
            couplings: vec![Coupling::new(); coupled * coupled.saturating_sub(1) / 2],
        }
    }

    /// Takes the sample of every channel in the next sample period; `None` where a channel has none.
    pub(crate) fn push(&mut self, values: impl Iterator<Item = Option<i32>>) {
        for ((cascade, missing), value) in self.cascades.iter_mut().zip(&mut self.missing).zip(values) {
            match value {
                Some(value) => {
                    cascade.gap(std::mem::take(missing));
                    cascade.push(value);
                }
                None => *missing = missing.saturating_add(1),
            }
        }
        let mut couplings = self.couplings.iter_mut();
        for (at, a) in self.cascades.iter().enumerate() {
            for ((b, other), coupling) in self.cascades[..at].iter().zip(&self.missing).zip(&mut couplings) {
                // Products are taken where both channels have a sample.
                if self.missing[at] == 0 && *other == 0 {
                    coupling.observe(a, b);
                }
            }
        }
    }

    /// Records that the samples of `missing` sample periods are missing in every channel.
    pub(crate) fn gap(&mut self, missing: u32) {
        self.missing.iter_mut().for_each(|of| *of = of.saturating_add(missing));
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
    shorter: Option<ShorterCurves>,
}

/// The curves at averaging times that are too short for the estimators, which have the means of samples.
#[derive(Clone)]
struct ShorterCurves {
    samples_per_mean: u64,
    /// Averaging factor from which on the estimators are used, samples.
    until: u64,
    /// By channel, with the samples that were replaced.
    curves: Vec<(Curve<OCTAVES>, u64)>,
}

/// The curves of the recording as measured, and the estimators of its halves.
pub(crate) struct RecordEstimators {
    /// Of the recording as measured, without preprocessing, in the order of its channels.
    pub measured: Vec<Curve<OCTAVES>>,
    /// The halves with spikes and knocks.
    pub raw: [RecordPart; 2],
    /// The halves without what the rules of the first half exclude.
    pub ruled: [RecordPart; 2],
    /// Both halves, with a gap between them, without what the whole record shows.
    pub both: RecordPart,
}

impl RecordEstimators {
    /// Estimates from `measurement`, or where that has means from them and from the `shorter` averaging times. The channels of
    /// each part are `coupled`, then all others that were recorded.
    pub(crate) fn estimate(
        measurement: &Measurement,
        shorter: Option<&ShorterTimes>,
        coupled: &[ChannelProfile],
        preprocessing: &Preprocessing,
    ) -> Self {
        let (ruled, both) = (Exclusion::ByFirstHalf, Exclusion::ByWhole);
        // Nothing is estimated twice.
        let mut distinct = vec![Exclusion::None];
        let is_distinct =
            |of: Exclusion| preprocessing.excludes_any(of) || (of == both && preprocessing.has_responses());
        distinct.extend([ruled, both].into_iter().filter(|&of| is_distinct(of)));
        let work: Vec<(Exclusion, Half)> =
            distinct.iter().flat_map(|&of| [Half::First, Half::Second].map(|half| (of, half))).collect();
        let parts = in_parallel(&work, |&(exclusion, of)| half(measurement, coupled, preprocessing, exclusion, of));
        let of = |exclusion: Exclusion| {
            let position = distinct.iter().position(|of| *of == exclusion).unwrap_or(0);
            [parts[2 * position].clone(), parts[2 * position + 1].clone()]
        };
        let (raw, ruled, [first, second]) = (of(Exclusion::None), of(ruled), of(both));
        let both = RecordPart { estimators: first.estimators.clone().followed_by(&second.estimators), ..first };
        let Some(shorter) = shorter else { return Self { measured: measured(measurement), raw, ruled, both } };
        let halves = |parts: [RecordPart; 2], exclusion: Exclusion| {
            let [first, second] = parts;
            [(0, first), (1, second)]
                .map(|(half, part)| part.with_shorter(shorter, exclusion, |of| of.half(half, exclusion)))
        };
        Self {
            measured: shorter.channels.iter().map(|channel| channel.measured.clone()).collect(),
            raw: halves(raw, Exclusion::None),
            ruled: halves(ruled, Exclusion::ByFirstHalf),
            both: both.with_shorter(shorter, Exclusion::ByWhole, |of| of.both(Exclusion::ByWhole)),
        }
    }
}

/// The curves of all channels as measured.
fn measured(measurement: &Measurement) -> Vec<Curve<OCTAVES>> {
    let curve = |channel: &MeasuredChannel| {
        let mut estimator = Cascade::<OCTAVES, OVERLAP>::new();
        let mut missing = 0_u32;
        for (position, &count) in channel.counts.iter().enumerate() {
            missing = missing.saturating_add(measurement.missing_before(position));
            if channel.is_refused(position) {
                missing = missing.saturating_add(1);
                continue;
            }
            estimator.gap(std::mem::take(&mut missing));
            estimator.push(count);
        }
        estimator.curve(measurement.period_s()).scaled(channel.profile.lsb)
    };
    in_parallel(&measurement.channels, curve)
}

/// The estimators of a half of a recording, by time, without the samples of `exclusion`.
fn half(
    measurement: &Measurement,
    coupled: &[ChannelProfile],
    preprocessing: &Preprocessing,
    exclusion: Exclusion,
    half: Half,
) -> RecordPart {
    let others = measurement.profiles().filter(|channel| !coupled.contains(channel));
    let channels: Vec<ChannelProfile> = coupled.iter().copied().chain(others).collect();
    let resolutions =
        channels.iter().map(|channel| f64::from(preprocessing.counts_per_step(*channel)) * channel.lsb).collect();
    let mut estimators = CoupledEstimators::new(channels.len(), coupled.len());
    let recorded: Vec<RecordedSamples> = channels
        .iter()
        .filter_map(|channel| {
            let of = measurement.channel(channel)?;
            let excluded = preprocessing.excluded(*channel, exclusion);
            let is_corrected = preprocessing.corrects(*channel, exclusion);
            Some(RecordedSamples { channel: of, is_excluded: positions(measurement, of, &excluded), is_corrected })
        })
        .collect();
    let middle = measurement.middle();
    let second = measurement.slots.partition_point(|&slot| slot < middle);
    let (positions, begins_at) = match half {
        Half::First => (0..second, 0),
        Half::Second => (second..measurement.len(), middle),
    };
    for position in positions {
        let slot = measurement.slots[position];
        // Of a gap over the middle, each half has the samples on its side.
        let own = u32::try_from(slot - begins_at).unwrap_or(u32::MAX);
        estimators.gap(measurement.missing_before(position).min(own));
        estimators.push(recorded.iter().map(|of| {
            (!of.is_excluded[position]).then(|| {
                let steps = f64::from(of.channel.counts[position]) * STEPS_PER_COUNT;
                if !of.is_corrected {
                    return steps as i32;
                }
                let profile = of.channel.profile;
                (steps - STEPS_PER_COUNT * preprocessing.offset(profile, exclusion, slot) / profile.lsb).round() as i32
            })
        }));
    }
    RecordPart { channels, estimators, resolutions, period_s: measurement.period_s(), shorter: None }
}

/// A half of a recording, by time.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Half {
    First,
    Second,
}

/// A channel's samples, and whether each is left out.
struct RecordedSamples<'a> {
    channel: &'a MeasuredChannel,
    is_excluded: Vec<bool>,
    /// Whether an offset is subtracted from any of them.
    is_corrected: bool,
}

/// For each sample of a channel whether it was refused or its sample period is one of `excluded`.
fn positions(measurement: &Measurement, channel: &MeasuredChannel, excluded: &[u64]) -> Vec<bool> {
    let mut is_excluded = vec![false; channel.counts.len()];
    let refused = channel.refused.values().flatten().copied();
    let of_slots = excluded.iter().filter_map(|slot| measurement.slots.binary_search(slot).ok());
    for position in refused.chain(of_slots) {
        if let Some(of) = is_excluded.get_mut(position) {
            *of = true;
        }
    }
    is_excluded
}

impl RecordPart {
    /// Of one channel, whose estimator has counts of [`STEPS_PER_COUNT`] steps.
    pub(crate) fn of_channel(channel: ChannelProfile, cascade: Cascade<OCTAVES, OVERLAP>, period_s: f64) -> Self {
        let estimators = CoupledEstimators { cascades: vec![cascade], missing: vec![0], couplings: Vec::new() };
        Self { channels: vec![channel], estimators, resolutions: vec![channel.lsb], period_s, shorter: None }
    }

    /// The part with the curves of `shorter` at averaging times that are too short for its own samples, which are means.
    fn with_shorter(
        self,
        shorter: &ShorterTimes,
        exclusion: Exclusion,
        curve: impl Fn(&ShorterTimesOfChannel) -> Curve<OCTAVES>,
    ) -> Self {
        let of = |channel: &ChannelProfile| {
            let of = shorter.of(*channel)?;
            Some((of.resolution, (curve(of), of.replaced(exclusion))))
        };
        let (resolutions, curves) =
            self.channels.iter().map(|channel| of(channel).unwrap_or((channel.lsb, (Curve::empty(), 0)))).unzip();
        let shorter = ShorterCurves { samples_per_mean: shorter.samples_per_mean, until: shorter.until(), curves };
        Self { resolutions, shorter: Some(shorter), ..self }
    }

    /// Seconds between samples.
    pub(crate) fn sample_period(&self) -> f64 {
        self.shorter.as_ref().map_or(self.period_s, |shorter| self.period_s / shorter.samples_per_mean as f64)
    }

    /// Least averaging factor at which the covariances of channels are known, samples.
    pub(crate) fn coupled_from(&self) -> u64 {
        self.shorter.as_ref().map_or(1, |shorter| shorter.until)
    }

    /// Position of a channel.
    pub(crate) fn position(&self, channel: ChannelProfile) -> Option<usize> {
        self.channels.iter().position(|of| *of == channel)
    }

    /// Allan variances of the channel at a position, in its unit squared.
    pub(crate) fn curve(&self, channel: usize) -> Curve<OCTAVES> {
        let own = self.estimators.cascade(channel).curve(self.period_s).scaled(self.step_size(channel));
        match &self.shorter {
            None => own,
            Some(shorter) => {
                shorter.curves[channel].0.clone().continued_by_means(&own, shorter.samples_per_mean, shorter.until)
            }
        }
    }

    /// Samples of the channel at a position that were replaced because they are missing.
    pub(crate) fn replaced(&self, channel: usize) -> u64 {
        if let Some(shorter) = &self.shorter {
            return shorter.curves[channel].1;
        }
        let cascade = self.estimators.cascade(channel);
        let sums = (0..OCTAVES).filter_map(|octave| cascade.octave_sums(octave));
        sums.map(|sums| u64::from(sums.interpolation.replaced())).sum()
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
        if let Some(shorter) = &self.shorter {
            let in_samples = |point: &Covariance| Covariance { n: point.n * shorter.samples_per_mean, ..*point };
            return points.iter().map(in_samples).filter(|point| point.n >= shorter.until).collect();
        }
        points
    }

    /// Physical size of 1 in what the estimators take.
    fn step_size(&self, channel: usize) -> f64 {
        self.channels[channel].lsb / STEPS_PER_COUNT
    }
}
