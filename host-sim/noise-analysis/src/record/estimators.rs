//! Estimators of several channels of a recording: Allan variances of the whole as it was measured, and Allan variances and
//! covariances of its two halves.
//!
//! All channels are on one time grid. A sample that one channel lacks is missing in that channel alone; products of two
//! channels are taken where both have a sample.

use crate::OCTAVES;
use crate::parallel::in_parallel;
use crate::record::condensed_record::CondensedRecord;
use crate::record::preprocessing::Preprocessing;
use crate::record::sample_curves::SampleCurves;
use crate::samples::exclusion::Exclusion;
use crate::samples::gapped_cascade::GappedCascade;
use crate::samples::rounding::Rounding;
use crate::samples::streamed_curves::STEPS_PER_COUNT;
use allan_core::host::NewestDifferences;
use allan_core::regression::CovarianceCurve;
use allan_core::{Coupling, Curve};
use measurement::{ChannelId, ChannelProfile, MeasuredChannel, Measurement, PerChannel, Quantity};
use nalgebra::DMatrix;

/// Cascades of channels on a common time grid, each with gaps of its own, and the Allan covariance of every pair of the first of them.
#[derive(Clone)]
pub(crate) struct CoupledEstimators {
    cascades: Vec<GappedCascade>,
    couplings: Vec<CoupledPair>,
    /// Of each cascade, while a sample is taken.
    newest: Vec<Option<NewestDifferences<OCTAVES>>>,
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
        Self::of_pairs(channels, pairs(coupled))
    }

    /// Estimators of so many channels, of which these pairs have a covariance.
    fn of_pairs(channels: usize, pairs: impl Iterator<Item = [usize; 2]>) -> Self {
        Self {
            cascades: vec![GappedCascade::default(); channels],
            couplings: pairs.map(|channels| CoupledPair { channels, coupling: Coupling::new() }).collect(),
            newest: Vec::new(),
        }
    }

    /// Takes the sample of every channel in the next sample period; `None` where a channel has none.
    pub(crate) fn push(&mut self, values: impl Iterator<Item = Option<i32>>) {
        self.newest.clear();
        for (cascade, value) in self.cascades.iter_mut().zip(values) {
            cascade.push_one(value);
            self.newest.push(cascade.has_latest().then(|| NewestDifferences::of(cascade.cascade())));
        }
        for CoupledPair { channels: [a, b], coupling } in &mut self.couplings {
            // Products are taken where both channels have a sample.
            if let (Some(a), Some(b)) = (&self.newest[*a], &self.newest[*b]) {
                coupling.observe_differences(a, b);
            }
        }
    }

    /// Records that the samples of `missing` sample periods are missing in every channel.
    pub(crate) fn gap(&mut self, missing: u32) {
        self.cascades.iter_mut().for_each(|cascade| cascade.miss(missing.into()));
    }

    /// The estimators of these samples followed, after a gap, by those of `later`.
    pub(crate) fn followed_by(mut self, later: &Self) -> Self {
        self.cascades.iter_mut().zip(&later.cascades).for_each(|(cascade, later)| cascade.merge(later));
        self.couplings.iter_mut().zip(&later.couplings).for_each(|(pair, later)| pair.coupling.merge(&later.coupling));
        self
    }

    /// The cascade of a channel.
    pub(crate) fn cascade(&self, channel: usize) -> &GappedCascade {
        &self.cascades[channel]
    }

    /// Covariances of the second differences of all channels at one octave, up to a common factor, 0 of channels that are not coupled;
    /// `None` where the octave has no differences.
    pub(crate) fn covariances(&self, octave: usize) -> Option<DMatrix<f64>> {
        let mut covariances = DMatrix::zeros(self.cascades.len(), self.cascades.len());
        for (i, cascade) in self.cascades.iter().enumerate() {
            let (squares, count) = cascade.cascade().sum_of_squares(octave).filter(|&(_, count)| count > 0)?;
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

/// All pairs of these channels.
fn pairs<T: Copy>(coupled: &[T]) -> impl Iterator<Item = [T; 2]> {
    coupled.iter().enumerate().flat_map(|(at, &a)| coupled[..at].iter().map(move |&b| [a, b]))
}

/// Estimators of one half of a recording, or of both halves, in physical units.
#[derive(Clone)]
pub(crate) struct RecordPart {
    pub channels: PerChannel<ChannelProfile>,
    estimators: CoupledEstimators,
    /// Smallest distance of two values, in the channel's unit: one count, or several.
    resolutions: PerChannel<f64>,
    period_s: f64,
    /// Samples of a mean, where the estimators have means; otherwise 1.
    samples_per_mean: u64,
    /// Least averaging factor of the covariances, samples.
    until: u64,
    /// What is known of the samples beside the estimators.
    samples: PerChannel<CurveOfSamples>,
}

/// The curve of the samples of a channel whose estimators have means of them.
#[derive(Clone)]
struct CurveOfSamples {
    curve: Curve<OCTAVES>,
    /// Samples that were replaced because they are missing.
    replaced: u64,
    /// Averaging factor from which on the curve is that of the means, samples; `None` where that of the samples is complete.
    means_from: Option<u64>,
    /// What the knocks and spikes that are left out of the means add to it, by averaging factor in samples.
    events: Vec<(u64, f64)>,
}

impl CurveOfSamples {
    /// Where the estimators have all samples.
    const fn none() -> Self {
        Self { curve: Curve::empty(), replaced: 0, means_from: Some(1), events: Vec::new() }
    }

    /// The curve, continued by that of the means.
    fn continued(&self, means: &Curve<OCTAVES>, samples_per_mean: u64) -> Curve<OCTAVES> {
        let Some(means_from) = self.means_from else { return self.curve.clone() };
        let mut curve = self.curve.clone().continued_by_means(means, samples_per_mean, means_from);
        if !self.events.is_empty() {
            let added = |n: u64| self.events.iter().find(|(of, _)| *of == n).map_or(0.0, |(_, avar)| *avar);
            curve.replace_avar(|point| point.avar + added(point.n));
        }
        curve
    }
}

/// The curves of the recording as measured, and its estimators without what the whole record shows.
pub(crate) struct RecordEstimators {
    /// Of the recording as measured, without preprocessing.
    pub measured: PerChannel<Curve<OCTAVES>>,
    /// Both halves, with a gap between them.
    pub both: RecordPart,
    /// The second half alone.
    pub second: RecordPart,
}

/// The estimators of the two halves without what the first half shows: nothing of the second half decides what is left of either.
pub(crate) struct HalfEstimators {
    /// As they were recorded.
    pub recorded: [RecordPart; 2],
    /// With the bias that the first half foretells subtracted.
    pub foretold: [RecordPart; 2],
    /// The same without knocks and spikes by the rules of the first half.
    pub ruled: [RecordPart; 2],
}

impl RecordEstimators {
    /// Estimates from the means of `record`, and from the curves of its samples at shorter averaging times.
    pub(crate) fn estimate(record: &CondensedRecord, preprocessing: &Preprocessing) -> Self {
        let [halves] = half_parts(record, record, preprocessing, [Exclusion::ByWhole]);
        Self::new(record, halves)
    }

    /// The same, and the halves by what the `first_half` shows.
    pub(crate) fn estimate_with_halves(
        record: &CondensedRecord,
        first_half: &CondensedRecord,
        preprocessing: &Preprocessing,
    ) -> (Self, HalfEstimators) {
        let [recorded, foretold, ruled, whole] = half_parts(record, first_half, preprocessing, EXCLUSIONS);
        let with_samples = |halves: [RecordPart; 2], exclusion: Exclusion| {
            let [first, second] = halves;
            [(0, first), (1, second)].map(|(half, part)| {
                let samples = |channel: ChannelId| {
                    let of = &record.channels[channel].samples;
                    of_half(of, half, exclusion, preprocessing.corrects(channel, exclusion))
                };
                part.with_samples(record, samples)
            })
        };
        let halves = HalfEstimators {
            recorded: with_samples(recorded, Exclusion::Nothing),
            foretold: with_samples(foretold, Exclusion::BiasOfFirstHalf),
            ruled: with_samples(ruled, Exclusion::ByFirstHalf),
        };
        (Self::new(record, whole), halves)
    }

    /// From the halves without what the whole record shows.
    fn new(record: &CondensedRecord, [first, second]: [RecordPart; 2]) -> Self {
        let both = first.followed_by(&second);
        let of_both = |channel: ChannelId| {
            let of = &record.channels[channel].samples;
            let replaced = of.replaced(Exclusion::ByWhole);
            CurveOfSamples {
                curve: of.both(Exclusion::ByWhole),
                replaced,
                means_from: Some(of.until()),
                events: Vec::new(),
            }
        };
        let of_second = |channel: ChannelId| of_half(&record.channels[channel].samples, 1, Exclusion::ByWhole, false);
        Self {
            measured: record.channels.map(|channel| channel.samples.measured.clone()),
            both: both.with_samples(record, of_both),
            second: second.with_samples(record, of_second),
        }
    }
}

/// What the `samples` of a half show; the means lack the knocks and spikes, and something may be subtracted from them.
fn of_half(samples: &SampleCurves, half: usize, exclusion: Exclusion, is_corrected: bool) -> CurveOfSamples {
    let (curve, replaced, means_from) = (samples.half(half, exclusion), samples.replaced(exclusion), samples.until());
    let lacks_events = exclusion.keeps_events() && samples.samples_per_mean > 1;
    if lacks_events && !is_corrected {
        return CurveOfSamples { curve, replaced, means_from: None, events: Vec::new() };
    }
    let mut events = Vec::new();
    if lacks_events && samples.is_screened {
        let without = samples.half(half, Exclusion::ByWhole);
        let pairs = curve.points().iter().zip(without.points()).filter(|(with, _)| with.n >= means_from);
        events = pairs.map(|(with, without)| (with.n, (with.avar - without.avar).max(0.0))).collect();
    }
    CurveOfSamples { curve, replaced, means_from: Some(means_from), events }
}

/// What may be left out of a recording and subtracted from it.
const EXCLUSIONS: [Exclusion; 4] =
    [Exclusion::Nothing, Exclusion::BiasOfFirstHalf, Exclusion::ByFirstHalf, Exclusion::ByWhole];

/// The halves of a record for each of these exclusions, by its means alone. The resolution of the channels, unless it is by the whole record, is
/// that of the `first_half`.
fn half_parts<const COUNT: usize>(
    record: &CondensedRecord,
    first_half: &CondensedRecord,
    preprocessing: &Preprocessing,
    exclusions: [Exclusion; COUNT],
) -> [[RecordPart; 2]; COUNT] {
    let measurement = record.means.as_ref();
    let alike = AlikeExclusions::new(measurement, preprocessing, exclusions);
    let work: Vec<(usize, Half)> =
        (0..COUNT).flat_map(|of| [Half::First, Half::Second].map(|half| (of, half))).collect();
    let own = in_parallel(&work, |&(of, half)| own_estimators(measurement, preprocessing, (&alike, of), half));
    std::array::from_fn(|of| {
        let shows_resolution = if exclusions[of] == Exclusion::ByWhole { record } else { first_half };
        [0, 1].map(|half| {
            let estimators = alike.estimators(of, |of| &own[2 * of + half]);
            RecordPart::of_means(record, shows_resolution, estimators)
        })
    })
}

/// Which exclusions leave a channel the same samples: nothing is estimated twice.
struct AlikeExclusions<const COUNT: usize> {
    exclusions: [Exclusion; COUNT],
    /// For each exclusion and channel, the number of the first exclusion that does.
    first: [Vec<usize>; COUNT],
    /// Pairs of channels whose covariance is asked for.
    coupled: Vec<[usize; 2]>,
}

impl<const COUNT: usize> AlikeExclusions<COUNT> {
    fn new(measurement: &Measurement, preprocessing: &Preprocessing, exclusions: [Exclusion; COUNT]) -> Self {
        let quantity = |channel: ChannelId| measurement[channel].profile.quantity;
        let is_coupled = |of: Quantity| of.is_inertial() || of.is_environment();
        let coupled: Vec<ChannelId> = measurement.ids().filter(|&channel| is_coupled(quantity(channel))).collect();
        // No rate is a covariate of another one.
        let is_rate = |channel: &ChannelId| quantity(*channel) == Quantity::AngularRate;
        let coupled = pairs(&coupled).filter(|pair| !pair.iter().all(is_rate));
        let first = exclusions.map(|of| {
            let is_alike = |channel, other: &Exclusion| preprocessing.leaves_the_same(channel, *other, of);
            let first = |channel| exclusions.iter().position(|other| is_alike(channel, other)).unwrap_or(0);
            measurement.ids().map(first).collect()
        });
        Self { exclusions, first, coupled: coupled.map(|pair| pair.map(ChannelId::position)).collect() }
    }

    /// The number of the first exclusion that leaves both channels the same samples as the one of this number.
    fn first_of_pair(&self, of: usize, pair: &[usize; 2]) -> usize {
        let is_alike =
            |other: &usize| pair.iter().all(|&channel| self.first[*other][channel] == self.first[of][channel]);
        (0..of).find(is_alike).unwrap_or(of)
    }

    /// The pairs of channels of which no exclusion before this one leaves the same samples.
    fn own_pairs(&self, of: usize) -> impl Iterator<Item = [usize; 2]> {
        self.coupled.iter().copied().filter(move |pair| self.first_of_pair(of, pair) == of)
    }

    /// The estimators for an exclusion, from its own ones and those of the exclusions before it.
    fn estimators<'e>(&self, of: usize, own: impl Fn(usize) -> &'e CoupledEstimators) -> CoupledEstimators {
        let cascade = |(channel, &first): (usize, &usize)| own(first).cascades[channel].clone();
        let coupling = |pair: &[usize; 2]| {
            own(self.first_of_pair(of, pair)).couplings.iter().find(|known| known.channels == *pair).cloned()
        };
        CoupledEstimators {
            cascades: self.first[of].iter().enumerate().map(cascade).collect(),
            couplings: self.coupled.iter().filter_map(coupling).collect(),
            newest: Vec::new(),
        }
    }
}

/// The estimators of a half of a recording, by time, of the channels and the pairs that are an exclusion's own.
fn own_estimators<const COUNT: usize>(
    measurement: &Measurement,
    preprocessing: &Preprocessing,
    (alike, of): (&AlikeExclusions<COUNT>, usize),
    half: Half,
) -> CoupledEstimators {
    let exclusion = alike.exclusions[of];
    let mut estimators = CoupledEstimators::of_pairs(measurement.channels.len(), alike.own_pairs(of));
    let is_own = |channel: usize| {
        alike.first[of][channel] == of || estimators.couplings.iter().any(|pair| pair.channels.contains(&channel))
    };
    let is_own: Vec<bool> = (0..measurement.channels.len()).map(is_own).collect();
    if !is_own.contains(&true) {
        return estimators;
    }
    let recorded: Vec<RecordedSamples> = measurement
        .ids()
        .map(|id| {
            let channel = &measurement[id];
            let excluded = preprocessing.excluded(id, exclusion);
            let is_corrected = preprocessing.corrects(id, exclusion);
            // An offset of all samples is in no difference, and large ones would leave no room for steps.
            let origin = channel.used_samples(&measurement.slots).next().map_or(0, |(_, count)| count);
            RecordedSamples {
                id,
                channel,
                origin,
                is_excluded: positions(measurement, channel, &excluded),
                is_corrected,
            }
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
        estimators.push(recorded.iter().zip(&is_own).map(|(of, is_own)| {
            (*is_own && !of.is_excluded[position]).then(|| {
                let counts = f64::from(of.channel.counts[position]) - f64::from(of.origin);
                let steps = counts * STEPS_PER_COUNT;
                if !of.is_corrected {
                    return steps as i32;
                }
                let offset = preprocessing.offset(of.id, exclusion, slot);
                (steps - STEPS_PER_COUNT * offset / of.channel.profile.lsb).round() as i32
            })
        }));
    }
    estimators
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
    /// Counts from which its samples are counted.
    origin: i32,
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
    /// With these estimators of the means of `record`; the resolution of each channel is that which `shows_resolution` has.
    fn of_means(record: &CondensedRecord, shows_resolution: &CondensedRecord, estimators: CoupledEstimators) -> Self {
        let measurement = record.means.as_ref();
        Self {
            channels: measurement.profiles().collect(),
            estimators,
            resolutions: shows_resolution.channels.map(|of| of.samples.resolution),
            period_s: measurement.period_s(),
            samples_per_mean: record.samples_per_mean,
            until: 1,
            samples: measurement.ids().map(|_| CurveOfSamples::none()).collect(),
        }
    }

    /// This part followed, after a gap, by `later`.
    pub(crate) fn followed_by(&self, later: &Self) -> Self {
        Self { estimators: self.estimators.clone().followed_by(&later.estimators), ..self.clone() }
    }

    /// Of channels that are not coupled, whose estimators have counts of [`STEPS_PER_COUNT`] steps.
    pub(crate) fn new(channels: PerChannel<ChannelProfile>, cascades: Vec<GappedCascade>, period_s: f64) -> Self {
        Self {
            resolutions: channels.map(|channel| channel.lsb),
            samples: channels.map(|_| CurveOfSamples::none()),
            channels,
            estimators: CoupledEstimators { cascades, couplings: Vec::new(), newest: Vec::new() },
            period_s,
            samples_per_mean: 1,
            until: 1,
        }
    }

    /// The part with what is known of the samples of `record` beside its means.
    fn with_samples(self, record: &CondensedRecord, samples: impl Fn(ChannelId) -> CurveOfSamples) -> Self {
        let until = record.channels.iter().map(|of| of.samples.until()).max().unwrap_or(1);
        Self { until, samples: record.channels.ids().map(samples).collect(), ..self }
    }

    /// Seconds between samples.
    pub(crate) fn sample_period(&self) -> f64 {
        self.period_s / self.samples_per_mean as f64
    }

    /// Least averaging factor at which the covariances of channels are known, samples.
    pub(crate) fn coupled_from(&self) -> u64 {
        self.until
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
        self.samples[channel].continued(&own, self.samples_per_mean)
    }

    /// The rounding errors of a channel; white where its noise is not traced, as it is of a gyro or accelerometer alone.
    pub(crate) fn rounding(&self, channel: ChannelId) -> Rounding {
        let resolution = self.resolution(channel);
        match self.channels[channel].quantity {
            quantity if quantity.is_inertial() => Rounding::of_curve(&self.curve(channel), resolution),
            _ => Rounding::white(resolution, self.sample_period()),
        }
    }

    /// Allan variances of a channel without correlated rounding errors: what models are fitted to and compared with.
    pub(crate) fn curve_before_rounding(&self, channel: ChannelId) -> Curve<OCTAVES> {
        self.rounding(channel).subtracted_from(self.curve(channel))
    }

    /// Samples of a channel that were replaced because they are missing.
    pub(crate) fn replaced(&self, channel: ChannelId) -> u64 {
        match self.samples_per_mean {
            1 => self.estimators.cascade(channel.position()).cascade().replaced(),
            _ => self.samples[channel].replaced,
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
        for point in points.iter_mut() {
            point.n *= self.samples_per_mean;
            point.covariance *= self.step_size(a) * self.step_size(b);
        }
        points.retain(|point| point.n >= self.until);
        points
    }

    /// Physical size of 1 in what the estimators take.
    fn step_size(&self, channel: ChannelId) -> f64 {
        self.channels[channel].lsb / STEPS_PER_COUNT
    }
}
