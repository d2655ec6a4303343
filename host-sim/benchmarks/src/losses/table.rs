//! Comparison of the complete records with those that have lost samples.

use super::{EstimatedRecord, Loss, LossPlan, RATE_HZ, TestNoise};
use reports::formatting::{TextTable, number};
use serde::{Serialize, Serializer};
use statrs::statistics::Statistics;
use std::io::{self, Write};

/// The results for every noise and every loss.
#[derive(Debug, Clone, Serialize)]
pub struct LossTable {
    /// How many records were simulated.
    #[serde(skip)]
    pub plan: LossPlan,
    /// One for each noise and loss.
    pub comparisons: Vec<LossComparison>,
}

/// The records of one noise with one loss, beside the same records without.
#[derive(Debug, Clone, Serialize)]
pub struct LossComparison {
    /// The noise.
    #[serde(serialize_with = "as_text")]
    pub noise: TestNoise,
    /// The loss.
    #[serde(serialize_with = "as_text")]
    pub loss: Loss,
    /// Share of the samples that was lost, of all records.
    pub lost: f64,
    /// Records in which the longest averaging time is that of the complete record.
    pub same_longest: usize,
    /// Averaging factor by averaging factor.
    pub octaves: Vec<OctaveRatio>,
    /// N, B and K as far as the noise has them.
    pub coefficients: Vec<CoefficientComparison>,
}

/// One averaging factor of the records with losses, relative to the complete records.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct OctaveRatio {
    /// Averaging factor, samples.
    pub n: u64,
    /// Mean variance over the mean variance of the complete records, minus 1.
    pub bias: f64,
    /// Standard error of the bias, from the scatter of the differences record by record.
    pub standard_error: f64,
    /// The same before what the interpolation adds is subtracted.
    pub uncorrected: f64,
    /// Mean degrees of freedom over those of the complete records.
    pub edf: f64,
}

/// One coefficient of the model that is fitted to the curves.
#[derive(Debug, Clone, Serialize)]
pub struct CoefficientComparison {
    /// N, B or K.
    pub symbol: &'static str,
    /// Mean estimate over the truth, minus 1.
    pub bias: f64,
    /// Standard error of the bias.
    pub standard_error: f64,
    /// The same for the complete records.
    pub complete_bias: f64,
    /// Standard deviation of the estimates over the truth.
    pub scatter: f64,
    /// Records of which the 95 % interval contains the truth.
    pub covered: usize,
    /// The same without losses.
    pub complete_covered: usize,
}

fn as_text<S: Serializer>(value: &impl ToString, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&value.to_string())
}

impl LossComparison {
    /// Compares pairs of a complete record and the same record with losses.
    #[must_use]
    pub fn new(noise: TestNoise, loss: Loss, pairs: &[(&EstimatedRecord, &EstimatedRecord)]) -> Self {
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
        let lossy: Vec<f64> = pairs.iter().map(|(_, lossy)| estimate(lossy)).collect();
        Self {
            symbol,
            bias: lossy.iter().mean() - 1.0,
            standard_error: standard_error(&lossy),
            complete_bias: pairs.iter().map(|(complete, _)| estimate(complete)).mean() - 1.0,
            scatter: lossy.iter().std_dev(),
            covered: pairs.iter().filter(|(_, lossy)| covers(lossy)).count(),
            complete_covered: pairs.iter().filter(|(complete, _)| covers(complete)).count(),
        }
    }
}

fn standard_error(values: &[f64]) -> f64 {
    values.iter().std_dev() / (values.len() as f64).sqrt()
}

/// Ranges of averaging factors of the table.
const RANGES: [(&str, u64, u64); 4] =
    [("1 … 4", 1, 4), ("8 … 512", 8, 512), ("1,024 … 8,192", 1024, 8192), ("above", 8193, u64::MAX)];

impl LossTable {
    /// Writes two tables as text: the variances, then the coefficients.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn write(&self, out: &mut impl Write) -> io::Result<()> {
        let hours = self.plan.samples as f64 / RATE_HZ / 3600.0;
        writeln!(out, "{} records of {hours:.2} h at {RATE_HZ} SPS for each noise\n", self.plan.records)?;
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
            "fitted coefficients: bias ± standard error and scatter in % of the truth, intervals that hold it"
        )?;
        let rows = self.comparisons.iter().flat_map(|comparison| {
            comparison.coefficients.iter().map(|coefficient| {
                vec![
                    comparison.noise.to_string(),
                    comparison.loss.to_string(),
                    coefficient.symbol.to_owned(),
                    format!("{:+.2} ± {:.2}", 100.0 * coefficient.bias, 100.0 * coefficient.standard_error),
                    format!("{:+.2}", 100.0 * coefficient.complete_bias),
                    number(100.0 * coefficient.scatter),
                    coefficient.covered.to_string(),
                    coefficient.complete_covered.to_string(),
                ]
            })
        });
        let header = ["noise", "lost", "", "bias", "complete", "scatter", "hold", "complete"];
        writeln!(out, "{}", TextTable::new(header, 3, rows))
    }
}
