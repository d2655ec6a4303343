//! Statistics of the running epoch: exact sums for every channel and every pair of channels, and the curve, baseline model
//! and report that are made of one channel's sums.

use adis16405_driver::{Channel, Config};
use allan_core::{Cascade, Curve, Model, NoiseTerm, OctaveSums, fit::fit, model};
use heapless::Vec;
use link::{ChannelMessage, ReportedCoefficient, ReportedModelError, ReportedOctave, ReportedTerm};

/// Channels that are estimated, by index: the six inertial channels, then the covariates temperature and supply.
pub const CHANNELS: [Channel; 8] = {
    let [a, b, c, d, e, f] = Channel::INERTIAL;
    [a, b, c, d, e, f, Channel::Temp, Channel::Supply]
};
/// Number of inertial channels, which come first in [`CHANNELS`] and have models.
pub(crate) const INERTIAL: usize = Channel::INERTIAL.len();
/// Number of gyros, which come first in [`CHANNELS`].
pub(crate) const GYROS: usize = 3;

/// Octaves of averaging factors on the device: up to 2²³ samples, 11 hours at 204.8 samples a second.
pub const OCTAVES: usize = 24;
/// Overlap of the second differences on the device.
pub const OVERLAP: usize = 8;

/// The streaming estimator of one channel.
pub type ChannelEstimator = Cascade<OCTAVES, OVERLAP>;

/// The statistics of the running epoch.
#[derive(Debug)]
pub struct Statistics {
    /// Estimators of [`CHANNELS`].
    pub(crate) estimators: [ChannelEstimator; CHANNELS.len()],
    /// Sums over pairs of channels.
    pub(crate) cross_sums: CrossSums,
}

impl Statistics {
    /// Statistics of no sample.
    #[must_use]
    pub const fn new() -> Self {
        Self { estimators: [const { ChannelEstimator::new() }; CHANNELS.len()], cross_sums: CrossSums::new() }
    }

    /// Takes one sample of every channel.
    pub(crate) fn push(&mut self, counts: [i32; CHANNELS.len()]) {
        for (estimator, count) in self.estimators.iter_mut().zip(counts) {
            estimator.push(count);
        }
        self.cross_sums.add(&self.estimators, counts);
    }

    /// Discards all samples.
    pub(crate) fn reset(&mut self) {
        self.estimators.iter_mut().for_each(Cascade::reset);
        self.cross_sums.reset();
    }
}

impl Default for Statistics {
    fn default() -> Self {
        Self::new()
    }
}

/// The exact sums of one channel: a fifth of the estimator's size, and all that reports and models are made of.
///
/// Sums of fourth powers are left out, since the device reports nothing that depends on them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ChannelSums {
    /// Samples taken.
    pub samples: u64,
    /// Samples missing between them.
    pub missing: u64,
    /// For every octave the sum of the squared second differences in counts², and their number.
    pub octaves: [(u128, u64); OCTAVES],
}

impl ChannelSums {
    /// Sums of no samples.
    pub const EMPTY: Self = Self { samples: 0, missing: 0, octaves: [(0, 0); OCTAVES] };

    /// Copies the sums of an estimator.
    #[must_use]
    pub fn from_estimator(estimator: &ChannelEstimator) -> Self {
        let octaves = core::array::from_fn(|octave| estimator.sum_of_squares(octave).unwrap_or_default());
        Self { samples: estimator.len(), missing: estimator.missing(), octaves }
    }

    /// Has an estimator continue from these sums, as after a gap.
    pub fn restore(&self, estimator: &mut ChannelEstimator) {
        estimator.restore(self.samples, self.missing, |octave| self.octave(octave));
    }

    /// Rebuilds the Allan variance curve of a channel in its unit.
    ///
    /// Not inlined, here and below: frames of 0.7 to 1.9 kB (curve, sums) would otherwise be part of every caller's.
    #[inline(never)]
    pub fn rebuild_curve(&self, curve: &mut Curve<OCTAVES>, channel: Channel, config: Config) {
        let period = 1.0 / config.sample_period().hz();
        ChannelEstimator::rebuild_curve(curve, period, self.samples, |octave| self.octave(octave));
        curve.scale(channel.lsb(config.range()));
    }

    /// Fits the baseline model (N, B and K) to the curve of a channel, in its unit.
    #[must_use]
    #[inline(never)]
    pub fn fit_baseline(&self, channel: Channel, config: Config) -> Model {
        let mut curve = Curve::empty();
        self.rebuild_curve(&mut curve, channel, config);
        fit(&curve, &NoiseTerm::BASELINE)
    }

    /// Error of a model that was not fitted to these sums; `None` if no octave can be compared.
    #[must_use]
    #[inline(never)]
    pub(crate) fn error_of(&self, model: &Model, channel: Channel, config: Config) -> Option<ReportedModelError> {
        let mut curve = Curve::empty();
        self.rebuild_curve(&mut curve, channel, config);
        model_error(model, &curve)
    }

    /// The report on one channel; `unseen_error` is that of the previous epoch's model.
    #[must_use]
    pub fn report(
        &self,
        channel: Channel,
        baseline: Option<&Model>,
        unseen_error: Option<ReportedModelError>,
    ) -> ChannelMessage {
        let mut report = ChannelMessage {
            channel: channel as u8,
            samples: self.samples,
            missing: self.missing,
            octaves: Vec::new(),
            coefficients: Vec::new(),
            unseen_error,
        };
        let octaves = self.octaves.iter().enumerate().filter(|(_, (_, count))| *count > 0);
        let octaves = octaves.map(|(octave, &(sum, count))| ReportedOctave { n: 1 << octave, sum, count });
        report.octaves.extend(octaves.take(link::MAX_OCTAVES));
        let coefficient = |term: &model::FittedTerm| {
            let (value, low, high) = (term.value, term.low, term.high);
            ReportedCoefficient { term: reported_term(term.kind), value, low, high }
        };
        let coefficients = baseline.into_iter().flat_map(Model::terms).map(coefficient);
        report.coefficients.extend(coefficients.take(link::MAX_COEFFICIENTS));
        report
    }

    fn octave(&self, octave: usize) -> OctaveSums {
        let (squares, count) = self.octaves[octave];
        OctaveSums { squares, count, ..OctaveSums::default() }
    }
}

/// Error of a model on a curve; `None` if no octave can be compared.
pub(crate) fn model_error(model: &Model, curve: &Curve<OCTAVES>) -> Option<ReportedModelError> {
    let error = allan_core::model::Discrepancy::between(model, curve)?;
    Some(ReportedModelError { deviance_per_point: error.deviance_per_point, rms_percent: error.rms_percent })
}

pub(crate) fn reported_term(kind: NoiseTerm) -> ReportedTerm {
    match kind {
        NoiseTerm::Quantization => ReportedTerm::Quantization,
        NoiseTerm::AngleRandomWalk => ReportedTerm::AngleRandomWalk,
        NoiseTerm::BiasInstability => ReportedTerm::BiasInstability,
        NoiseTerm::RateRandomWalk => ReportedTerm::RateRandomWalk,
        NoiseTerm::RateRamp => ReportedTerm::RateRamp,
        NoiseTerm::Filtered(_) => ReportedTerm::Filtered,
        NoiseTerm::Markov(_) => ReportedTerm::Markov,
        NoiseTerm::Resonance(_) => ReportedTerm::Resonance,
        NoiseTerm::Sinusoid(_) => ReportedTerm::Sinusoid,
    }
}

/// First octave of the cross sums: 256 samples. Covariates act slowly, and the sums over pairs are updated once in 32
/// samples at most, an eighth of this octave's averaging time.
pub(crate) const FIRST_CROSS_OCTAVE: usize = 8;
/// Octaves of the cross sums: up to 2¹⁹ samples, 43 minutes at 204.8 samples a second.
pub(crate) const CROSS_OCTAVES: usize = 12;
/// Pairs of channels of which one may be a regressor of the other: all but the pairs of two gyros.
const PAIRS: [(usize, usize); 25] = {
    let mut pairs = [(0, 0); 25];
    let (mut low, mut at) = (0, 0);
    while low < CHANNELS.len() {
        let mut high = if low < GYROS { GYROS } else { low + 1 };
        while high < CHANNELS.len() {
            pairs[at] = (low, high);
            (high, at) = (high + 1, at + 1);
        }
        low += 1;
    }
    assert!(at == pairs.len());
    pairs
};

/// Sums of products of the second differences of pairs of channels, octave by octave, and the sum of every channel's counts,
/// over the samples that all channels have taken.
///
/// A count has 14 bits, so a difference is within ±2¹⁴·n, and in 2⁴⁰ samples there are 2⁴³/n of them: no sum exceeds
/// 2⁷¹·n ≤ 2⁹⁰. A sum takes 96 bits: a low word of 64 and a high word of 32 bits.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct CrossSums {
    low: [[u64; PAIRS.len()]; CROSS_OCTAVES],
    high: [[i32; PAIRS.len()]; CROSS_OCTAVES],
    /// Products in each octave's sums.
    counts: [u64; CROSS_OCTAVES],
    totals: [i64; CHANNELS.len()],
    samples: u64,
}

impl CrossSums {
    const fn new() -> Self {
        let (low, high) = ([[0; PAIRS.len()]; CROSS_OCTAVES], [[0; PAIRS.len()]; CROSS_OCTAVES]);
        Self { low, high, counts: [0; CROSS_OCTAVES], totals: [0; CHANNELS.len()], samples: 0 }
    }

    fn reset(&mut self) {
        // In place: assigning a new value would build it, 3.8 kB, on the stack first.
        self.low.fill([0; PAIRS.len()]);
        self.high.fill([0; PAIRS.len()]);
        (self.counts, self.totals, self.samples) = ([0; CROSS_OCTAVES], [0; CHANNELS.len()], 0);
    }

    /// Adds the counts that all estimators have just taken, and the second differences that these completed.
    fn add(&mut self, estimators: &[ChannelEstimator; CHANNELS.len()], counts: [i32; CHANNELS.len()]) {
        self.samples += 1;
        for (total, count) in self.totals.iter_mut().zip(counts) {
            *total += i64::from(count);
        }
        for (octave, count) in (FIRST_CROSS_OCTAVE..).zip(&mut self.counts) {
            if estimators[0].newest_difference(octave).is_none() {
                return; // longer octaves have completed none either
            }
            // All channels have the same gaps, so they complete their differences together.
            let differences =
                estimators.each_ref().map(|estimator| estimator.newest_difference(octave).unwrap_or_default());
            let row = octave - FIRST_CROSS_OCTAVE;
            let sums = self.low[row].iter_mut().zip(&mut self.high[row]);
            for ((low, high), (a, b)) in sums.zip(PAIRS) {
                let sum = wide(*low, *high) + i128::from(differences[a]) * i128::from(differences[b]);
                (*low, *high) = (sum as u64, (sum >> 64) as i32);
            }
            *count += 1;
        }
    }
}

fn wide(low: u64, high: i32) -> i128 {
    i128::from(high) << 64 | i128::from(low)
}

/// Mean of every channel of [`CHANNELS`] in counts.
pub(crate) type ChannelMeans = [f64; CHANNELS.len()];

/// Allan covariances and means of a finished epoch, rounded from its [`CrossSums`]: nothing is added to them any more.
#[derive(Debug, Clone, PartialEq)]
pub struct AllanCovariances {
    /// Allan covariance of each pair at each octave in counts².
    pairs: [[f64; CROSS_OCTAVES]; PAIRS.len()],
    counts: [u64; CROSS_OCTAVES],
    /// Mean of every channel; 0 without samples.
    pub means: ChannelMeans,
    /// Samples that all channels took together.
    pub samples: u64,
}

impl AllanCovariances {
    /// Covariances of no samples.
    pub const EMPTY: Self = Self {
        pairs: [[0.0; CROSS_OCTAVES]; PAIRS.len()],
        counts: [0; CROSS_OCTAVES],
        means: [0.0; CHANNELS.len()],
        samples: 0,
    };

    /// Overwrites them with those of an epoch's sums, in place: 2.6 kB.
    pub(crate) fn fill(&mut self, sums: &CrossSums) {
        (self.counts, self.samples) = (sums.counts, sums.samples);
        self.means = sums.totals.map(|total| total as f64 / sums.samples.max(1) as f64);
        for (pair, covariances) in self.pairs.iter_mut().enumerate() {
            for (k, covariance) in covariances.iter_mut().enumerate() {
                let (n, count) = ((1_u64 << (FIRST_CROSS_OCTAVE + k)) as f64, sums.counts[k].max(1) as f64);
                *covariance = wide(sums.low[k][pair], sums.high[k][pair]) as f64 / (2.0 * count * n * n);
            }
        }
    }

    /// Allan covariance of two channels at averaging factor `n`, in the product of their counts; `None` where it was not
    /// estimated, as for two gyros.
    #[must_use]
    pub fn covariance(&self, a: usize, b: usize, n: u64) -> Option<f64> {
        let pair = PAIRS.iter().position(|&pair| pair == (a.min(b), a.max(b)))?;
        let octave = (n.trailing_zeros() as usize).checked_sub(FIRST_CROSS_OCTAVE).filter(|_| n.is_power_of_two())?;
        let known = *self.counts.get(octave)? > 0;
        known.then(|| self.pairs[pair][octave])
    }
}
