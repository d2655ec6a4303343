//! Complete records compared with records that have lost samples.

use super::estimate::EstimatedRecord;
use super::loss_pattern::LossPattern;
use super::noise::TestNoise;
use serde::{Serialize, Serializer};
use statrs::statistics::Statistics;

/// The results for every noise and every loss.
#[derive(Debug, Clone, Serialize)]
pub struct LossTable {
    pub records: u64,
    pub rate_hz: f64,
    pub samples: usize,
    pub comparisons: Vec<LossComparison>,
}

/// Records of one noise with one loss, and without.
#[derive(Debug, Clone, Serialize)]
pub struct LossComparison {
    #[serde(serialize_with = "as_text")]
    pub noise: TestNoise,
    #[serde(serialize_with = "as_text")]
    pub loss: LossPattern,
    /// Lost fraction of all samples.
    pub lost: f64,
    /// Number of records that keep the longest averaging time.
    pub same_longest: usize,
    pub octaves: Vec<OctaveRatio>,
    /// Comparisons of N, B and K, if the noise has them.
    pub coefficients: Vec<CoefficientComparison>,
}

/// One averaging factor with losses, relative to the complete records.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct OctaveRatio {
    pub n: u64,
    /// Ratio of mean variances, less 1.
    pub bias: f64,
    /// Standard error of the bias, from the scatter of the differences.
    pub standard_error: f64,
    /// Bias without the correction for interpolation.
    pub uncorrected: f64,
    /// Ratio of mean degrees of freedom.
    pub edf: f64,
}

/// One fitted coefficient. Behind the filter the fit begins at four filter lengths.
#[derive(Debug, Clone, Serialize)]
pub struct CoefficientComparison {
    pub symbol: &'static str,
    /// Bias in complete records: mean over truth, less 1.
    pub complete_bias: f64,
    /// Scatter in complete records: standard deviation over truth.
    pub scatter: f64,
    /// Mean difference caused by the losses, over truth.
    pub shift: f64,
    pub standard_error: f64,
    /// Number of records whose 95 % interval contains the truth.
    pub covered: usize,
    /// Number of complete records whose 95 % interval contains the truth.
    pub complete_covered: usize,
}

fn as_text<S: Serializer>(value: &impl ToString, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&value.to_string())
}

impl LossComparison {
    /// Compares pairs of a complete record and the same record with losses.
    #[must_use]
    pub fn new(noise: TestNoise, loss: LossPattern, pairs: &[(&EstimatedRecord, &EstimatedRecord)]) -> Self {
        let total = |of: fn(&(&EstimatedRecord, &EstimatedRecord)) -> u64| pairs.iter().map(of).sum::<u64>() as f64;
        let longest = |record: &EstimatedRecord| record.curve.points().last().map(|point| point.n);
        let octaves = pairs.first().map_or(0, |(complete, _)| complete.curve.points().len());
        Self {
            noise,
            loss,
            lost: 1.0 - total(|(_, lossy)| lossy.samples) / total(|(complete, _)| complete.samples),
            same_longest: pairs.iter().filter(|(complete, lossy)| longest(complete) == longest(lossy)).count(),
            octaves: (0..octaves).filter_map(|octave| OctaveRatio::new(octave, pairs)).collect(),
            coefficients: (noise.truth().into_iter().enumerate())
                .map(|(term, (symbol, truth))| CoefficientComparison::new(symbol, truth, term, pairs))
                .collect(),
        }
    }
}

impl OctaveRatio {
    fn new(octave: usize, pairs: &[(&EstimatedRecord, &EstimatedRecord)]) -> Option<Self> {
        let n = 1 << octave;
        let points = pairs.iter().filter_map(|(complete, lossy)| {
            let at = |record: &EstimatedRecord| record.curve.points().iter().find(|point| point.n == n).copied();
            Some((at(complete)?, at(lossy)?))
        });
        let points: Vec<_> = points.collect();
        let complete = points.iter().map(|(complete, _)| complete.avar).mean();
        let differences: Vec<f64> = points.iter().map(|(complete, lossy)| lossy.avar - complete.avar).collect();
        let added = points.iter().map(|(_, lossy)| lossy.interpolation).mean();
        let bias = differences.iter().mean() / complete;
        (!points.is_empty()).then(|| Self {
            n,
            bias,
            standard_error: standard_error(&differences) / complete,
            uncorrected: bias + added / complete,
            edf: points.iter().map(|(_, lossy)| lossy.edf).mean()
                / points.iter().map(|(complete, _)| complete.edf).mean(),
        })
    }
}

impl CoefficientComparison {
    fn new(symbol: &'static str, truth: f64, term: usize, pairs: &[(&EstimatedRecord, &EstimatedRecord)]) -> Self {
        let estimate = |record: &EstimatedRecord| record.model.terms()[term].value / truth;
        let covers = |record: &EstimatedRecord| {
            let term = &record.model.terms()[term];
            (term.low..=term.high).contains(&truth)
        };
        let complete: Vec<f64> = pairs.iter().map(|(complete, _)| estimate(complete)).collect();
        let shifts: Vec<f64> = pairs.iter().map(|(complete, lossy)| estimate(lossy) - estimate(complete)).collect();
        Self {
            symbol,
            complete_bias: complete.iter().mean() - 1.0,
            scatter: complete.iter().std_dev(),
            shift: shifts.iter().mean(),
            standard_error: standard_error(&shifts),
            covered: pairs.iter().filter(|(_, lossy)| covers(lossy)).count(),
            complete_covered: pairs.iter().filter(|(complete, _)| covers(complete)).count(),
        }
    }
}

fn standard_error(values: &[f64]) -> f64 {
    values.iter().std_dev() / (values.len() as f64).sqrt()
}
