//! Estimators of several channels: Allan variances of the whole recording, and variances and covariances of its halves.
//!
//! All channels share one time grid; covariances use the samples that both channels have.

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

/// Cascades of channels on a common time grid, and the Allan covariances of the coupled pairs.
#[derive(Clone)]
pub(crate) struct CoupledEstimators {
    cascades: Vec<GappedCascade>,
    couplings: Vec<CoupledPair>,
    /// Per cascade, while a sample is taken.
    newest: Vec<Option<NewestDifferences<OCTAVES>>>,
}

#[derive(Clone)]
struct CoupledPair {
    channels: [usize; 2],
    coupling: Coupling<OCTAVES>,
}

impl CoupledEstimators {
    /// `channels` estimators; those at the positions `coupled` have covariances with each other.
    pub(crate) fn new(channels: usize, coupled: &[usize]) -> Self {
        Self::of_pairs(channels, pairs(coupled))
    }

    fn of_pairs(channels: usize, pairs: impl Iterator<Item = [usize; 2]>) -> Self {
        Self {
            cascades: vec![GappedCascade::default(); channels],
            couplings: pairs.map(|channels| CoupledPair { channels, coupling: Coupling::new() }).collect(),
            newest: Vec::new(),
        }
    }

    /// Takes each channel's sample of the next sample period.
    pub(crate) fn push(&mut self, values: impl Iterator<Item = Option<i32>>) {
        self.newest.clear();
        for (cascade, value) in self.cascades.iter_mut().zip(values) {
            cascade.push_one(value);
            self.newest.push(cascade.has_latest().then(|| NewestDifferences::of(cascade.cascade())));
        }
        for CoupledPair { channels: [a, b], coupling } in &mut self.couplings {
            if let (Some(a), Some(b)) = (&self.newest[*a], &self.newest[*b]) {
                coupling.observe_differences(a, b);
            }
        }
    }

    pub(crate) fn gap(&mut self, missing: u32) {
        self.cascades.iter_mut().for_each(|cascade| cascade.miss(missing.into()));
    }

    /// These estimators, then those of `later` behind a gap.
    pub(crate) fn followed_by(mut self, later: &Self) -> Self {
        self.cascades.iter_mut().zip(&later.cascades).for_each(|(cascade, later)| cascade.merge(later));
        self.couplings.iter_mut().zip(&later.couplings).for_each(|(pair, later)| pair.coupling.merge(&later.coupling));
        self
    }

    pub(crate) fn cascade(&self, channel: usize) -> &GappedCascade {
        &self.cascades[channel]
    }

    /// Covariances of second differences at one octave, up to a common factor, 0 if not coupled; `None` without any.
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

fn pairs<T: Copy>(coupled: &[T]) -> impl Iterator<Item = [T; 2]> {
    coupled.iter().enumerate().flat_map(|(at, &a)| coupled[..at].iter().map(move |&b| [a, b]))
}

/// Estimators of one half or both halves of a recording, in physical units.
#[derive(Clone)]
pub(crate) struct RecordPart {
    pub channels: PerChannel<ChannelProfile>,
    estimators: CoupledEstimators,
    /// Smallest distance of two values, in the channel's unit.
    resolutions: PerChannel<f64>,
    period_s: f64,
    samples_per_mean: u64,
    /// Least averaging factor of the covariances, samples.
    until: u64,
    samples: PerChannel<CurveOfSamples>,
}

/// The curve of the samples of a channel that is estimated from means.
#[derive(Clone)]
struct CurveOfSamples {
    curve: Curve<OCTAVES>,
    replaced: u64,
    /// Averaging factor from which on the curve is that of the means; `None` if that of the samples is complete.
    means_from: Option<u64>,
    /// Added variance of the knocks and spikes that the means leave out, by averaging factor in samples.
    events: Vec<(u64, f64)>,
}

impl CurveOfSamples {
    /// For estimators that have all samples.
    const fn none() -> Self {
        Self { curve: Curve::empty(), replaced: 0, means_from: Some(1), events: Vec::new() }
    }

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

/// Curves as measured, and estimators without the effects of the whole record.
pub(crate) struct RecordEstimators {
    pub measured: PerChannel<Curve<OCTAVES>>,
    pub both: RecordPart,
    pub second: RecordPart,
}

/// Estimators of the two halves, without influence of the second half on exclusions.
pub(crate) struct HalfEstimators {
    pub recorded: [RecordPart; 2],
    /// Less the bias that the first half predicts.
    pub foretold: [RecordPart; 2],
    /// Also without knocks and spikes by the rules of the first half.
    pub ruled: [RecordPart; 2],
}

impl RecordEstimators {
    /// Estimates from the means of `record`, and from its samples' curves at shorter averaging times.
    pub(crate) fn estimate(record: &CondensedRecord, preprocessing: &Preprocessing) -> Self {
        let [halves] = half_parts(record, record, preprocessing, [Exclusion::ByWhole]);
        Self::new(record, halves)
    }

    /// [`estimate`](Self::estimate), and the halves by the `first_half`.
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

/// Curve of the `samples` of a half; the means lack knocks and spikes, and may be corrected.
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

const EXCLUSIONS: [Exclusion; 4] =
    [Exclusion::Nothing, Exclusion::BiasOfFirstHalf, Exclusion::ByFirstHalf, Exclusion::ByWhole];

/// The halves of a record for each exclusion, by its means alone, with the resolution of the `first_half`.
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

/// Exclusions that leave a channel the same samples, so that nothing is estimated twice.
struct AlikeExclusions<const COUNT: usize> {
    exclusions: [Exclusion; COUNT],
    /// Number of the first exclusion alike, by exclusion and channel.
    first: [Vec<usize>; COUNT],
    coupled: Vec<[usize; 2]>,
}

impl<const COUNT: usize> AlikeExclusions<COUNT> {
    fn new(measurement: &Measurement, preprocessing: &Preprocessing, exclusions: [Exclusion; COUNT]) -> Self {
        let quantity = |channel: ChannelId| measurement[channel].profile.quantity;
        let is_coupled = |of: Quantity| of.is_inertial() || of.is_environment();
        let coupled: Vec<ChannelId> = measurement.ids().filter(|&channel| is_coupled(quantity(channel))).collect();
        // Rates are not covariates of each other.
        let is_rate = |channel: &ChannelId| quantity(*channel) == Quantity::AngularRate;
        let coupled = pairs(&coupled).filter(|pair| !pair.iter().all(is_rate));
        let first = exclusions.map(|of| {
            let is_alike = |channel, other: &Exclusion| preprocessing.leaves_the_same(channel, *other, of);
            let first = |channel| exclusions.iter().position(|other| is_alike(channel, other)).unwrap_or(0);
            measurement.ids().map(first).collect()
        });
        Self { exclusions, first, coupled: coupled.map(|pair| pair.map(ChannelId::position)).collect() }
    }

    /// Number of the first exclusion that leaves both channels the same samples as `of`.
    fn first_of_pair(&self, of: usize, pair: &[usize; 2]) -> usize {
        let is_alike =
            |other: &usize| pair.iter().all(|&channel| self.first[*other][channel] == self.first[of][channel]);
        (0..of).find(is_alike).unwrap_or(of)
    }

    /// Pairs of channels that no earlier exclusion leaves the same samples.
    fn own_pairs(&self, of: usize) -> impl Iterator<Item = [usize; 2]> {
        self.coupled.iter().copied().filter(move |pair| self.first_of_pair(of, pair) == of)
    }

    /// Estimators of an exclusion, from its own and those of the exclusions before.
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

/// Estimators of a half, for the channels and pairs that are an exclusion's own.
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
            // An offset is in no difference, and a large one would leave no room for steps.
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
        // A gap over the middle is split between the halves.
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

#[derive(Clone, Copy, PartialEq, Eq)]
enum Half {
    First,
    Second,
}

struct RecordedSamples<'a> {
    id: ChannelId,
    channel: &'a MeasuredChannel,
    origin: i32,
    is_excluded: Vec<bool>,
    /// True if an offset is subtracted from any sample.
    is_corrected: bool,
}

/// Per sample, whether it is refused or in `excluded`.
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
    /// From the means of `record`; resolutions are those of `shows_resolution`.
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

    pub(crate) fn followed_by(&self, later: &Self) -> Self {
        Self { estimators: self.estimators.clone().followed_by(&later.estimators), ..self.clone() }
    }

    /// For uncoupled channels, in counts of [`STEPS_PER_COUNT`] steps.
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

    fn with_samples(self, record: &CondensedRecord, samples: impl Fn(ChannelId) -> CurveOfSamples) -> Self {
        let until = record.channels.iter().map(|of| of.samples.until()).max().unwrap_or(1);
        Self { until, samples: record.channels.ids().map(samples).collect(), ..self }
    }

    pub(crate) fn sample_period(&self) -> f64 {
        self.period_s / self.samples_per_mean as f64
    }

    pub(crate) fn coupled_from(&self) -> u64 {
        self.until
    }

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

    /// The rounding errors of a channel; white unless it is a gyro or accelerometer.
    pub(crate) fn rounding(&self, channel: ChannelId) -> Rounding {
        let resolution = self.resolution(channel);
        match self.channels[channel].quantity {
            quantity if quantity.is_inertial() => Rounding::of_curve(&self.curve(channel), resolution),
            _ => Rounding::white(resolution, self.sample_period()),
        }
    }

    /// Allan variances without correlated rounding errors, for fits and comparisons.
    pub(crate) fn curve_before_rounding(&self, channel: ChannelId) -> Curve<OCTAVES> {
        self.rounding(channel).subtracted_from(self.curve(channel))
    }

    pub(crate) fn replaced(&self, channel: ChannelId) -> u64 {
        match self.samples_per_mean {
            1 => self.estimators.cascade(channel.position()).cascade().replaced(),
            _ => self.samples[channel].replaced,
        }
    }

    pub(crate) fn resolution(&self, channel: ChannelId) -> f64 {
        self.resolutions[channel]
    }

    /// Allan covariances, in the product of both units; none if not coupled.
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

    /// Physical size of 1 in the estimators.
    fn step_size(&self, channel: ChannelId) -> f64 {
        self.channels[channel].lsb / STEPS_PER_COUNT
    }
}
