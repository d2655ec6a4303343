//! Several recordings of one sensor: whether they show the same noise, the model of all of them, and how much more noise a
//! running machine makes than a still one.
//!
//! **Same noise.** At one averaging time, k recordings give Allan variances `v_i` with `ν_i` degrees of freedom. If the true variances are
//! equal, Bartlett's statistic `T = (Σν·ln v̄ − Σ ν_i ln v_i)/C`, `v̄ = Σ ν_i v_i/Σν`, `C = 1 + (Σ 1/ν_i − 1/Σν)/(3(k−1))`, is the
//! likelihood ratio and follows χ² with k−1 degrees of freedom (M. Bartlett, Proc. R. Soc. A 160, 1937). Octaves share samples: with a
//! correlation ρ of two octaves' variances their statistics, sums of k−1 squares each, have the covariance `2(k−1)ρ²`. The sum over the
//! octaves is compared with a scaled χ² of the same mean and variance (F. Satterthwaite, Biometrics 2, 1946).
//!
//! **Inflation.** Of a running and a still recording, `v_r/v_s` divided by the ratio of the true variances follows F with
//! `ν_r` and `ν_s` degrees of freedom, which gives the interval of the ratio.
//!
//! With an excess kurtosis κ of differences their mean square has `(2 + κ)/2` times the variance, which divides the degrees of freedom.

use crate::distributions::chi_squared_tail;
use crate::report::TermReport;
use crate::report::comparison::rejected;
use crate::samples::gapped_cascade::GappedCascade;
use crate::{OCTAVES, OVERLAP};
use allan_core::confidence::{NORMAL_975, octave_correlation};
use allan_core::trace::{LineCandidates, trace};
use allan_core::{AllanPoint, Cascade, Curve, Model};
use measurement::{ChannelProfile, MeasuredChannel, Measurement};
use serde::Serialize;
use std::borrow::Borrow;

/// Degrees of freedom from which a point takes part: below, the approximations by χ² and F are coarse.
const LEAST_EDF: f64 = 5.0;
/// Probability that recordings of the same noise in all channels are said to differ in one.
pub const DIFFERENCE_SIGNIFICANCE: f64 = 0.01;
/// Largest relative difference of two sample rates: octaves are numbers of samples, and σ² of white noise changes as much as the rate.
const RATE_TOLERANCE: f64 = 0.002;

#[derive(Debug, Clone, PartialEq)]
pub enum IncomparableRecordings {
    /// The sample rates, Hz, differ by more than 0.2 %.
    Rates(f64, f64),
    NoChannel,
}

impl std::error::Error for IncomparableRecordings {}

impl std::fmt::Display for IncomparableRecordings {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Rates(one, other) => {
                write!(out, "sample rates of {one:.3} and {other:.3} Hz: recordings are compared at one rate")
            }
            Self::NoChannel => write!(out, "no channel is in all recordings"),
        }
    }
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NoiseAgreement {
    pub schema: u32,
    /// Rate of the first recording, Hz.
    pub sample_rate_hz: f64,
    pub samples: Vec<u64>,
    pub channels: Vec<ChannelAgreement>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChannelAgreement {
    pub name: String,
    pub unit: String,
    /// Probability that recordings of the same noise differ as much; absent if no octave has enough differences.
    pub p_value: Option<f64>,
    /// True if the recordings show the same noise at a significance of 1 % over all channels (Holm).
    pub agree: bool,
    pub octaves: Vec<OctaveAgreement>,
    /// The model of all recordings together; empty where they differ.
    pub joint: Vec<TermReport>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OctaveAgreement {
    pub tau_s: f64,
    /// Allan deviation of each recording, in the channel's unit.
    pub adev: Vec<f64>,
    /// Probability that recordings of the same noise differ as much at this averaging time.
    pub p_value: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NoiseInflation {
    pub schema: u32,
    /// Rate of the still recordings, Hz.
    pub sample_rate_hz: f64,
    pub channels: Vec<ChannelInflation>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChannelInflation {
    pub name: String,
    pub unit: String,
    pub octaves: Vec<OctaveInflation>,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct OctaveInflation {
    pub tau_s: f64,
    /// Allan deviation at rest, in the channel's unit.
    pub still: f64,
    /// Allan deviation while the machine runs.
    pub running: f64,
    pub factor: f64,
    /// Lower 95 % bound of the ratio of the true deviations.
    pub low: f64,
    pub high: f64,
}

/// Compares the noise of two or more recordings, and fits one model to those that agree.
///
/// # Errors
/// See [`IncomparableRecordings`].
pub fn compare(recordings: &[Measurement]) -> Result<NoiseAgreement, IncomparableRecordings> {
    let shared = shared_channels(recordings)?;
    let rate = recordings.first().map_or(0.0, |first| first.sample_rate_hz);
    let mut channels: Vec<ChannelAgreement> = shared.iter().map(|channel| agreement(recordings, channel)).collect();
    decide(&mut channels);
    Ok(NoiseAgreement {
        schema: crate::report::SCHEMA,
        sample_rate_hz: rate,
        samples: recordings.iter().map(|recording| recording.len() as u64).collect(),
        channels,
    })
}

/// The noise of `running` over that of the `still` recordings together.
///
/// # Errors
/// See [`IncomparableRecordings`].
pub fn inflation(still: &[Measurement], running: &Measurement) -> Result<NoiseInflation, IncomparableRecordings> {
    let all: Vec<&Measurement> = still.iter().chain([running]).collect();
    let shared = shared_channels(&all)?;
    let of = |channel: &ChannelProfile| {
        let lsb = finest_lsb(&all, channel);
        let period_s = still.first()?.period_s();
        let still: Vec<Cascade<OCTAVES, OVERLAP>> = still.iter().filter_map(|of| cascade(of, channel, lsb)).collect();
        let [still, running] = [merged(&still)?, cascade(running, channel, lsb)?]
            .map(|cascade| fitted(&cascade, lsb, period_s, running).0);
        let pairs = still.points().iter().zip(running.points()).filter(|(a, b)| a.n == b.n);
        let octaves = pairs.filter_map(|(still, running)| octave_inflation(still, running)).collect();
        Some(ChannelInflation { name: channel.name.to_owned(), unit: channel.unit.to_owned(), octaves })
    };
    Ok(NoiseInflation {
        schema: crate::report::SCHEMA,
        sample_rate_hz: running.sample_rate_hz,
        channels: shared.iter().filter_map(of).collect(),
    })
}

/// The channels of the first recording that the others have in the same unit.
fn shared_channels<M: Borrow<Measurement>>(recordings: &[M]) -> Result<Vec<ChannelProfile>, IncomparableRecordings> {
    let Some((first, others)) = recordings.split_first() else { return Err(IncomparableRecordings::NoChannel) };
    let first: &Measurement = first.borrow();
    for other in others {
        let (one, other) = (first.sample_rate_hz, other.borrow().sample_rate_hz);
        if (one / other).ln().abs() > RATE_TOLERANCE {
            return Err(IncomparableRecordings::Rates(one, other));
        }
    }
    let has = |recording: &M, channel: &ChannelProfile| {
        recording.borrow().channel(channel).is_some_and(|other| other.profile.unit == channel.unit)
    };
    let shared: Vec<ChannelProfile> =
        first.profiles().filter(|channel| others.iter().all(|other| has(other, channel))).collect();
    if shared.is_empty() { Err(IncomparableRecordings::NoChannel) } else { Ok(shared) }
}

/// The smallest count of a channel in any of the recordings, in its unit: the step in which all of them are summed.
fn finest_lsb<M: Borrow<Measurement>>(recordings: &[M], channel: &ChannelProfile) -> f64 {
    let lsb = |recording: &M| recording.borrow().channel(channel).map(|measured| measured.profile.lsb);
    recordings.iter().filter_map(lsb).fold(f64::INFINITY, f64::min)
}

/// The estimator of one channel of a recording, with its gaps, in steps of `lsb`.
fn cascade(recording: &Measurement, channel: &ChannelProfile, lsb: f64) -> Option<Cascade<OCTAVES, OVERLAP>> {
    let measured: &MeasuredChannel = recording.channel(channel)?;
    // 1 in recordings of one range: the counts stay as they are. A float too large for an integer becomes the largest one.
    let steps = measured.profile.lsb / lsb;
    let samples = measured.used_samples(&recording.slots);
    let mut cascade = GappedCascade::default();
    let from = recording.slots.first().copied().unwrap_or(0);
    cascade.push_slots(from, samples.map(|(slot, count)| (slot, (f64::from(count) * steps).round() as i32)));
    Some(cascade.cascade().clone())
}

/// One estimator of all differences, none of which has samples of two recordings.
fn merged(cascades: &[Cascade<OCTAVES, OVERLAP>]) -> Option<Cascade<OCTAVES, OVERLAP>> {
    let (first, others) = cascades.split_first()?;
    let mut all = first.clone();
    others.iter().for_each(|other| all.merge(other));
    Some(all)
}

/// The curve of an estimator that counts steps of `lsb`, in the channel's unit, with the confidence of its own traced model, and that model.
fn fitted(
    cascade: &Cascade<OCTAVES, OVERLAP>,
    lsb: f64,
    period_s: f64,
    recording: &Measurement,
) -> (Curve<OCTAVES>, Model) {
    let curve = cascade.curve(period_s).scaled(lsb);
    let model = trace(&curve, LineCandidates::Curve, &recording.profile.filters).after;
    (curve.with_confidence(|point| model.variance_fractions(point.n)), model)
}

/// Degrees of freedom of a point, fewer where the differences have heavy tails.
fn degrees_of_freedom(point: &AllanPoint) -> f64 {
    point.edf / (1.0 + 0.5 * point.kurtosis.unwrap_or(0.0).max(0.0))
}

fn agreement(recordings: &[Measurement], channel: &ChannelProfile) -> ChannelAgreement {
    let name = channel.name.to_owned();
    let empty = ChannelAgreement {
        name,
        unit: channel.unit.to_owned(),
        p_value: None,
        agree: false,
        octaves: Vec::new(),
        joint: Vec::new(),
    };
    let lsb = finest_lsb(recordings, channel);
    let cascades: Vec<Cascade<OCTAVES, OVERLAP>> =
        recordings.iter().filter_map(|of| cascade(of, channel, lsb)).collect();
    let (Some(all), Some(first)) = (merged(&cascades), recordings.first()) else { return empty };
    let period_s = first.period_s();
    let (_, model) = fitted(&all, lsb, period_s, first);
    let curves: Vec<Curve<OCTAVES>> = cascades
        .iter()
        .map(|of| of.curve(period_s).scaled(lsb).with_confidence(|point| model.variance_fractions(point.n)))
        .collect();
    let octaves = octaves_of(&curves);
    let statistics: Vec<(u64, f64)> = octaves.iter().map(|points| (points[0].n, bartlett(points))).collect();
    let freedom = (recordings.len() - 1) as f64;
    ChannelAgreement {
        p_value: p_value_of_sum(&statistics, freedom, &model),
        octaves: octaves
            .iter()
            .zip(&statistics)
            .map(|(points, &(_, statistic))| OctaveAgreement {
                tau_s: points[0].tau,
                adev: points.iter().map(|point| point.avar.sqrt()).collect(),
                p_value: chi_squared_tail(statistic, freedom),
            })
            .collect(),
        joint: model.terms().iter().map(|term| TermReport::new(term, channel.unit)).collect(),
        ..empty
    }
}

/// The points of all curves at each averaging factor at which every one has enough degrees of freedom.
fn octaves_of(curves: &[Curve<OCTAVES>]) -> Vec<Vec<AllanPoint>> {
    let Some((first, others)) = curves.split_first() else { return Vec::new() };
    let usable = |point: &AllanPoint| point.avar > 0.0 && degrees_of_freedom(point) >= LEAST_EDF;
    let of = |point: &AllanPoint| {
        let same = |curve: &Curve<OCTAVES>| curve.points().iter().find(|other| other.n == point.n).copied();
        let all: Option<Vec<AllanPoint>> = [Some(*point)].into_iter().chain(others.iter().map(same)).collect();
        all.filter(|all| all.iter().all(usable))
    };
    first.points().iter().filter_map(of).collect()
}

fn bartlett(points: &[AllanPoint]) -> f64 {
    let weighted: Vec<(f64, f64)> = points.iter().map(|point| (degrees_of_freedom(point), point.avar)).collect();
    let total: f64 = weighted.iter().map(|(edf, _)| edf).sum();
    let pooled = weighted.iter().map(|(edf, avar)| edf * avar).sum::<f64>() / total;
    let statistic: f64 = weighted.iter().map(|(edf, avar)| edf * (pooled / avar).ln()).sum();
    let inverse: f64 = weighted.iter().map(|(edf, _)| 1.0 / edf).sum();
    statistic / (1.0 + (inverse - 1.0 / total) / (3.0 * (points.len() as f64 - 1.0)))
}

/// Probability that the sum of the statistics of all octaves is at least as large; each is χ² with `freedom` degrees of freedom.
fn p_value_of_sum(statistics: &[(u64, f64)], freedom: f64, model: &Model) -> Option<f64> {
    if statistics.is_empty() || freedom <= 0.0 {
        return None;
    }
    let mean = freedom * statistics.len() as f64;
    let mut variance = 0.0;
    for (one, _) in statistics {
        for (other, _) in statistics {
            let lag = one.ilog2().abs_diff(other.ilog2()) as usize;
            let of = octave_correlation(lag, model.variance_fractions(*one), model.variance_fractions(*other));
            variance += 2.0 * freedom * of * of;
        }
    }
    let sum: f64 = statistics.iter().map(|(_, statistic)| statistic).sum();
    let scale = variance / (2.0 * mean);
    Some(chi_squared_tail(sum / scale, mean / scale))
}

/// Sets which channels agree, and takes the joint model from those that differ.
fn decide(channels: &mut [ChannelAgreement]) {
    let p_values: Vec<f64> = channels.iter().filter_map(|channel| channel.p_value).collect();
    let mut different = rejected(&p_values, DIFFERENCE_SIGNIFICANCE).into_iter();
    for channel in channels {
        channel.agree = channel.p_value.is_some() && different.next() == Some(false);
        if !channel.agree {
            channel.joint.clear();
        }
    }
}

/// The ratio of two deviations with its 95 % bounds; `None` where a point has too few degrees of freedom.
fn octave_inflation(still: &AllanPoint, running: &AllanPoint) -> Option<OctaveInflation> {
    let (above, below) = (degrees_of_freedom(running), degrees_of_freedom(still));
    if above < LEAST_EDF || below < LEAST_EDF || still.avar <= 0.0 || running.avar <= 0.0 {
        return None;
    }
    let ratio = running.avar / still.avar;
    Some(OctaveInflation {
        tau_s: still.tau,
        still: still.avar.sqrt(),
        running: running.avar.sqrt(),
        factor: ratio.sqrt(),
        low: (ratio / f_quantile(NORMAL_975, above, below)).sqrt(),
        high: (ratio / f_quantile(-NORMAL_975, above, below)).sqrt(),
    })
}

/// Quantile of the F distribution with `above` and `below` degrees of freedom at the normal deviate `z`: the cube root of
/// χ²/ν is nearly normal with mean `1 − 2/(9ν)` and variance `2/(9ν)` (E. Paulson, Ann. Math. Stat. 13, 1942).
///
/// Unlike the incomplete beta function it holds for millions of degrees of freedom. From five on it is within 4 % of exact 95 % quantiles.
fn f_quantile(z: f64, above: f64, below: f64) -> f64 {
    let (a, b) = (2.0 / (9.0 * above), 2.0 / (9.0 * below));
    // ((1 − b)·x − (1 − a))² = z²·(b·x² + a) for x = F^⅓, the root on the side of z.
    let (square, linear, constant) =
        ((1.0 - b).powi(2) - z * z * b, -2.0 * (1.0 - b) * (1.0 - a), (1.0 - a).powi(2) - z * z * a);
    let root = (linear * linear - 4.0 * square * constant).max(0.0).sqrt();
    let x = (-linear + z.signum() * root) / (2.0 * square);
    x.max(0.0).powi(3)
}

#[cfg(test)]
mod tests {
    use super::{bartlett, f_quantile};
    use crate::distributions::chi_squared_tail;
    use allan_core::{AllanPoint, Cascade};
    use statrs::distribution::{ContinuousCDF, FisherSnedecor};

    fn point(avar: f64, edf: f64) -> AllanPoint {
        let mut cascade = Cascade::<1, 1>::new();
        (0..3).for_each(|sample| cascade.push(sample));
        let mut point = cascade.curve(1.0).points()[0];
        (point.avar, point.edf) = (avar, edf);
        point
    }

    #[test]
    fn quantiles_of_f_are_those_of_the_exact_distribution() {
        for (above, below) in [(5.0, 5.0), (5.0, 80.0), (12.0, 7.0), (300.0, 40.0), (900.0, 900.0)] {
            let exact = FisherSnedecor::new(above, below).unwrap();
            for (z, probability) in [(1.96, 0.975), (-1.96, 0.025)] {
                let (found, exact) = (f_quantile(z, above, below), exact.inverse_cdf(probability));
                assert!((found / exact - 1.0).abs() < 0.04, "{above} {below} {probability}: {found}, not {exact}");
            }
        }
        // Two millions and one: the normal approximation of ln F, whose variance is 2/ν₁ + 2/ν₂.
        let found = f_quantile(1.96, 2e6, 1e6).ln();
        assert!((found / (1.96 * 3e-6_f64.sqrt()) - 1.0).abs() < 1e-3, "{found}");
    }

    /// NIST's e-Handbook, section 1.3.5.7 (ten batches of ten gears): T = 20.78586, and 0.0136 for χ² with nine degrees of freedom.
    #[test]
    fn bartletts_statistic_is_that_of_the_handbook() {
        // Standard deviations of the ten batches, GEAR.DAT.
        let deviations = [
            0.004_346_1,
            0.005_216_4,
            0.003_977_5,
            0.003_852_7,
            0.007_578_5,
            0.009_885_0,
            0.007_874_8,
            0.003_628_2,
            0.004_137_7,
            0.005_328_9,
        ];
        let points: Vec<AllanPoint> = deviations.iter().map(|deviation| point(deviation * deviation, 9.0)).collect();
        let found = bartlett(&points);
        assert!((found - 20.785_86).abs() < 0.01, "{found}");
        assert!((chi_squared_tail(found, 9.0) - 0.0136).abs() < 2e-4);
    }
}
