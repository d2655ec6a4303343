//! Complete records compared with records that have lost samples.

use super::estimate::EstimatedRecord;
use super::loss_pattern::LossPattern;
use super::noise::{RATE_HZ, TestNoise};
use reports::formatting::{TextTable, number};
use serde::{Serialize, Serializer};
use statrs::statistics::Statistics;
use std::io::{self, Write};

/// The results for every noise and every loss.
#[derive(Debug, Clone, Serialize)]
pub struct LossTable {
    pub records: u64,
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

const RANGES: [(&str, u64, u64); 4] =
    [("1 … 4", 1, 4), ("8 … 512", 8, 512), ("1,024 … 8,192", 1024, 8192), ("above", 8193, u64::MAX)];

impl LossTable {
    /// Writes two tables as text: the variances, then the coefficients.
    pub fn write(&self, out: &mut impl Write) -> io::Result<()> {
        let hours = self.samples as f64 / RATE_HZ / 3600.0;
        writeln!(out, "{} records of {hours:.2} h at {RATE_HZ} SPS for each noise\n", self.records)?;
        writeln!(
            out,
            "variance over that of the complete record, minus 1, in %: the octave that is farthest from 0, and its"
        )?;
        writeln!(
            out,
            "standard error; in brackets without the correction; smallest degrees of freedom over the complete ones"
        )?;
        let row = |comparison: &LossComparison| {
            let mut cells = vec![
                comparison.noise.to_string(),
                comparison.loss.to_string(),
                format!("{:.2}", 100.0 * comparison.lost),
                format!("{}", comparison.same_longest),
            ];
            for (_, from, to) in RANGES {
                let octaves = comparison.octaves.iter().filter(|octave| (from..=to).contains(&octave.n));
                let weight = |octave: &OctaveRatio| {
                    if to == u64::MAX { (octave.bias / octave.standard_error).abs() } else { octave.bias.abs() }
                };
                let worst = octaves.clone().max_by(|a, b| weight(a).total_cmp(&weight(b)));
                let edf = octaves.map(|octave| octave.edf).fold(f64::INFINITY, f64::min);
                cells.push(worst.map_or_else(String::new, |worst| {
                    let [bias, error, uncorrected] =
                        [worst.bias, worst.standard_error, worst.uncorrected].map(|share| 100.0 * share);
                    format!("{bias:+.2} ± {error:.2} ({uncorrected:+.2}) {edf:.3}")
                }));
            }
            cells
        };
        let header = ["noise", "lost", "%", "same longest τ"].into_iter().chain(RANGES.map(|(name, ..)| name));
        writeln!(out, "{}\n", TextTable::new(header, 2, self.comparisons.iter().map(row)))?;
        writeln!(
            out,
            "fitted coefficients, % of the truth: what the losses change ± its standard error, scatter and bias"
        )?;
        writeln!(
            out,
            "of the complete records; records of which the 95 % interval holds the truth, with and without losses"
        )?;
        let rows = self.comparisons.iter().flat_map(|comparison| {
            comparison.coefficients.iter().map(|coefficient| {
                vec![
                    comparison.noise.to_string(),
                    comparison.loss.to_string(),
                    coefficient.symbol.to_owned(),
                    format!("{:+.3} ± {:.3}", 100.0 * coefficient.shift, 100.0 * coefficient.standard_error),
                    number(100.0 * coefficient.scatter),
                    format!("{:+.2}", 100.0 * coefficient.complete_bias),
                    coefficient.covered.to_string(),
                    coefficient.complete_covered.to_string(),
                ]
            })
        });
        let header = ["noise", "lost", "", "change", "scatter", "bias", "hold", "complete"];
        writeln!(out, "{}", TextTable::new(header, 3, rows))
    }
}
