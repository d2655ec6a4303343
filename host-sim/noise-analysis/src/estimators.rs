//! Estimators of several channels of a recording: Allan variances of the whole as it was measured, and Allan variances and
//! covariances of its two halves.
//!
//! All channels are on one time grid. A sample that one channel lacks is missing in that channel alone; products of two
//! channels are taken where both have a sample.

use crate::parallel::{in_parallel, per_channel};
use crate::preprocessing::{Exclusion, Preprocessing};
use crate::shorter_times::{ShorterTimes, ShorterTimesOfChannel};
use crate::streamed_curves::STEPS_PER_COUNT;
use crate::{OCTAVES, OVERLAP};
use allan_core::regression::CovarianceCurve;
use allan_core::{Cascade, Coupling, Covariance, Curve};
use measurement::{ChannelId, ChannelProfile, MeasuredChannel, Measurement, PerChannel};
use nalgebra::DMatrix;

/// Cascades of channels on a common time grid, each with gaps of its own, and the Allan covariance of every pair of the first of them.
#[derive(Clone)]
pub(crate) struct CoupledEstimators {
    cascades: Vec<Cascade<OCTAVES, OVERLAP>>,
    /// Samples that are missing in each channel since its last one.
    missing: Vec<u32>,
    couplings: Vec<CoupledPair>,
}

/// The covariance of two channels, by their positions.
#[derive(Clone)]
struct CoupledPair {
    channels: [usize; 2],
    coupling: Coupling<OCTAVES>,
}

impl CoupledEstimators {
    /// Estimators of so many channels, of which those at the positions `coupled` have a covariance with each other.
    pub(crate) fn new(channels: usize, coupled: &[usize]) -> Self {
        let pairs = coupled.iter().enumerate().flat_map(|(at, &a)| coupled[..at].iter().map(move |&b| [a, b]));
        Self {
            cascades: vec![Cascade::new(); channels],
            missing: vec![0; channels],
            couplings: pairs.map(|channels| CoupledPair { channels, coupling: Coupling::new() }).collect(),
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
        for CoupledPair { channels: [a, b], coupling } in &mut self.couplings {
            // Products are taken where both channels have a sample.
            if self.missing[*a] == 0 && self.missing[*b] == 0 {
                coupling.observe(&self.cascades[*a], &self.cascades[*b]);
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
        self.couplings.iter_mut().zip(&later.couplings).for_each(|(pair, later)| pair.coupling.merge(&later.coupling));
        self
    }

    /// The cascade of a channel.
    pub(crate) fn cascade(&self, channel: usize) -> &Cascade<OCTAVES, OVERLAP> {
        &self.cascades[channel]
    }

    /// Covariances of the second differences of all channels at one octave, up to a common factor, 0 of channels that are not coupled;
    /// `None` where the octave has no differences.
    pub(crate) fn covariances(&self, octave: usize) -> Option<DMatrix<f64>> {
        let mut covariances = DMatrix::zeros(self.cascades.len(), self.cascades.len());
        for (i, cascade) in self.cascades.iter().enumerate() {
            let (squares, count) = cascade.sum_of_squares(octave).filter(|&(_, count)| count > 0)?;
            covariances[(i, i)] = squares as f64 / count as f64;
        }
        for CoupledPair { channels: [i, j], coupling } in &self.couplings {
            let (products, count) = coupling.sum_of_products(octave).filter(|&(_, count)| count > 0)?;
            covariances[(*i, *j)] = products as f64 / count as f64;
            covariances[(*j, *i)] = covariances[(*i, *j)];
        }
        Some(covariances)
    }
}

/// Estimators of one half of a recording, or of both halves, in physical units.
#[derive(Clone)]
pub(crate) struct RecordPart {
    pub channels: PerChannel<ChannelProfile>,
    estimators: CoupledEstimators,
    /// Smallest distance of two values, in the channel's unit: one count, or several.
    resolutions: PerChannel<f64>,
    period_s: f64,
    shorter: Option<ShorterCurves>,
}

/// The curves at averaging times that are too short for the estimators, which have the means of samples.
#[derive(Clone)]
struct ShorterCurves {
    samples_per_mean: u64,
    /// Averaging factor from which on the estimators are used, samples.
    until: u64,
    /// With the samples that were replaced.
    curves: PerChannel<(Curve<OCTAVES>, u64)>,
}

/// The curves of the recording as measured, and the estimators of its halves.
pub(crate) struct RecordEstimators {
    /// Of the recording as measured, without preprocessing.
    pub measured: PerChannel<Curve<OCTAVES>>,
    /// The halves with spikes and knocks.
    pub raw: [RecordPart; 2],
    /// The halves without what the rules of the first half exclude.
    pub ruled: [RecordPart; 2],
    /// Both halves, with a gap between them, without what the whole record shows.
    pub both: RecordPart,
}

impl RecordEstimators {
    /// Estimates from `measurement`, or where that has means from them and from the `shorter` averaging times, with the covariances of
    /// the channels `coupled`.
    pub(crate) fn estimate(
        measurement: &Measurement,
        shorter: Option<&ShorterTimes>,
        coupled: &[ChannelId],
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
            measured: shorter.channels.map(|channel| channel.measured.clone()),
            raw: halves(raw, Exclusion::None),
            ruled: halves(ruled, Exclusion::ByFirstHalf),
            both: both.with_shorter(shorter, Exclusion::ByWhole, |of| of.both(Exclusion::ByWhole)),
        }
    }
}

/// The curves of all channels as measured.
fn measured(measurement: &Measurement) -> PerChannel<Curve<OCTAVES>> {
    per_channel(measurement.ids(), |id| {
        let channel = &measurement[id];
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
    })
}

/// The estimators of a half of a recording, by time, without the samples of `exclusion`.
fn half(
    measurement: &Measurement,
    coupled: &[ChannelId],
    preprocessing: &Preprocessing,
    exclusion: Exclusion,
    half: Half,
) -> RecordPart {
    let resolution = |channel| f64::from(preprocessing.counts_per_step(channel)) * measurement[channel].profile.lsb;
    let coupled: Vec<usize> = coupled.iter().map(|channel| channel.position()).collect();
    let mut estimators = CoupledEstimators::new(measurement.channels.len(), &coupled);
    let recorded: Vec<RecordedSamples> = measurement
        .ids()
        .map(|id| {
            let channel = &measurement[id];
            let excluded = preprocessing.excluded(id, exclusion);
            let is_corrected = preprocessing.corrects(id, exclusion);
            RecordedSamples { id, channel, is_excluded: positions(measurement, channel, &excluded), is_corrected }
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
                let offset = preprocessing.offset(of.id, exclusion, slot);
                (steps - STEPS_PER_COUNT * offset / of.channel.profile.lsb).round() as i32
            })
        }));
    }
    RecordPart {
        channels: measurement.profiles().collect(),
        estimators,
        resolutions: measurement.ids().map(resolution).collect(),
        period_s: measurement.period_s(),
        shorter: None,
    }
}

/// A half of a recording, by time.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Half {
    First,
    Second,
}

/// A channel's samples, and whether each is left out.
struct RecordedSamples<'a> {
    id: ChannelId,
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
    /// Of channels whose estimators have counts of [`STEPS_PER_COUNT`] steps.
    pub(crate) fn new(
        channels: PerChannel<ChannelProfile>,
        cascades: Vec<Cascade<OCTAVES, OVERLAP>>,
        period_s: f64,
    ) -> Self {
        let missing = vec![0; cascades.len()];
        let estimators = CoupledEstimators { cascades, missing, couplings: Vec::new() };
        let resolutions = channels.map(|channel| channel.lsb);
        Self { channels, estimators, resolutions, period_s, shorter: None }
    }

    /// The part with the curves of `shorter` at averaging times that are too short for its own samples, which are means.
    fn with_shorter(
        self,
        shorter: &ShorterTimes,
        exclusion: Exclusion,
        curve: impl Fn(&ShorterTimesOfChannel) -> Curve<OCTAVES>,
    ) -> Self {
        let curves = shorter.channels.map(|of| (curve(of), of.replaced(exclusion)));
        let resolutions = shorter.channels.map(|of| of.resolution);
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

    /// Channels whose covariance with `channel` is known, in their order.
    pub(crate) fn coupled_with(&self, channel: ChannelId) -> impl Iterator<Item = ChannelId> {
        self.channels.ids().filter(move |&other| other != channel && self.pair(channel, other).is_some())
    }

    fn pair(&self, a: ChannelId, b: ChannelId) -> Option<&CoupledPair> {
        let [a, b] = [a, b].map(ChannelId::position);
        self.estimators.couplings.iter().find(|pair| pair.channels == [a, b] || pair.channels == [b, a])
    }

    /// Allan variances of a channel, in its unit squared.
    pub(crate) fn curve(&self, channel: ChannelId) -> Curve<OCTAVES> {
        let own = self.estimators.cascade(channel.position()).curve(self.period_s).scaled(self.step_size(channel));
        match &self.shorter {
            None => own,
            Some(shorter) => {
                shorter.curves[channel].0.clone().continued_by_means(&own, shorter.samples_per_mean, shorter.until)
            }
        }
    }

    /// Samples of a channel that were replaced because they are missing.
    pub(crate) fn replaced(&self, channel: ChannelId) -> u64 {
        match &self.shorter {
            Some(shorter) => shorter.curves[channel].1,
            None => self.estimators.cascade(channel.position()).replaced(),
        }
    }

    /// Smallest distance of two values of a channel, in its unit.
    pub(crate) fn resolution(&self, channel: ChannelId) -> f64 {
        self.resolutions[channel]
    }

    /// Allan covariances of two channels, in the product of their units; none of channels that are not coupled.
    pub(crate) fn covariance(&self, a: ChannelId, b: ChannelId) -> CovarianceCurve<OCTAVES> {
        let Some(pair) = self.pair(a, b) else { return CovarianceCurve::new() };
        let mut points = pair.coupling.points();
        points.iter_mut().for_each(|point| point.covariance *= self.step_size(a) * self.step_size(b));
        if let Some(shorter) = &self.shorter {
            let in_samples = |point: &Covariance| Covariance { n: point.n * shorter.samples_per_mean, ..*point };
            return points.iter().map(in_samples).filter(|point| point.n >= shorter.until).collect();
        }
        points
    }

    /// Physical size of 1 in what the estimators take.
    fn step_size(&self, channel: ChannelId) -> f64 {
        self.channels[channel].lsb / STEPS_PER_COUNT
    }
}
