//! Two reports, or a report and the data sheet, compared coefficient by coefficient.

use crate::formatting::number;
use crate::rounding::{probability, significant};
use crate::saved_report::{SavedChannel, SavedPoint, SavedReport};
use noise_analysis::bounds::BoundedEstimate;
use noise_analysis::report::comparison::{Verdict, verdicts};
use serde::Serialize;
use std::io::{self, Write};

/// Coefficients that are compared, by their names in a report.
const KINDS: [&str; 3] = ["angle_random_walk", "bias_instability", "rate_random_walk"];
/// Channels of the conditions: they differ between records of any sensor, and rounded temperatures have no white noise.
const CONDITIONS: [&str; 2] = ["temp", "supply"];
/// The lowest point of the measured Allan deviation, which data sheets call in-run bias stability.
const LOWEST: &str = "lowest_allan_deviation";

/// Why reports cannot be compared.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ComparisonError {
    #[error("{channel} is in {first} in one report and in {second} in the other")]
    Units {
        /// Such as `gyro_x`.
        channel: String,
        first: String,
        second: String,
    },
    #[error("no coefficient of a channel is in both")]
    Nothing,
    #[error(
        "the report has no values of a data sheet: analyse the recording with --sensor, and the name or the profile of the sensor"
    )]
    NoDataSheet,
}

/// A comparison.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    pub coefficients: Vec<ComparedCoefficient>,
}

/// One coefficient in both.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ComparedCoefficient {
    pub channel: String,
    pub kind: String,
    pub unit: String,
    pub first: Bounded,
    pub second: Bounded,
    /// Sign of the difference, if significant.
    pub verdict: Verdict,
    /// Probability that estimates of one truth differ as much.
    pub p_value: f64,
}

/// An estimate with its 95 % bounds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Bounded {
    pub value: f64,
    pub low: f64,
    pub high: f64,
}

impl From<BoundedEstimate> for Bounded {
    fn from(BoundedEstimate { value, low, high }: BoundedEstimate) -> Self {
        Self { value, low, high }
    }
}

type Pair = (String, &'static str, String, BoundedEstimate, BoundedEstimate);

/// Compares the final models of two reports, without temperature and supply.
///
/// # Errors
/// A channel has different units, or nothing is in both.
pub fn of_reports(first: &SavedReport, second: &SavedReport) -> Result<Comparison, ComparisonError> {
    let mut pairs = Vec::new();
    let of_sensor = first.channels.iter().filter(|channel| !CONDITIONS.contains(&channel.name.as_str()));
    for (one, other) in of_sensor.filter_map(|one| Some((one, second.channel(&one.name)?))) {
        if one.unit != other.unit {
            return Err(ComparisonError::Units {
                channel: one.name.clone(),
                first: one.unit.clone(),
                second: other.unit.clone(),
            });
        }
        for kind in KINDS {
            if let (Some((a, unit)), Some((b, _))) = (coefficient(one, kind), coefficient(other, kind)) {
                pairs.push((one.name.clone(), kind, unit, a, b));
            }
        }
    }
    compared(pairs)
}

/// Compares a report with typical values of its sensor's data sheet, which have no interval.
///
/// # Errors
/// The report has no values of a data sheet, or they say nothing of what was measured.
pub fn with_data_sheet(report: &SavedReport) -> Result<Comparison, ComparisonError> {
    let exact = |value: f64| BoundedEstimate { value, low: value, high: value };
    let specified = || report.channels.iter().filter_map(|channel| Some((channel.data_sheet.as_ref()?, channel)));
    if specified().next().is_none() {
        return Err(ComparisonError::NoDataSheet);
    }
    let mut pairs = Vec::new();
    for (specified, channel) in specified() {
        for (kind, value) in [(KINDS[0], specified.angle_random_walk), (KINDS[2], specified.rate_random_walk)] {
            if let (Some(value), Some((measured, unit))) = (value, coefficient(channel, kind)) {
                pairs.push((channel.name.clone(), kind, unit, exact(value), measured));
            }
        }
        if let (Some(value), Some(lowest)) = (specified.in_run_bias_stability, lowest(channel)) {
            pairs.push((channel.name.clone(), LOWEST, channel.unit.clone(), exact(value), lowest));
        }
    }
    compared(pairs)
}

fn coefficient(channel: &SavedChannel, kind: &str) -> Option<(BoundedEstimate, String)> {
    let of = channel.coefficient(kind)?;
    Some((BoundedEstimate { value: of.value, low: of.low, high: of.high }, of.unit))
}

fn lowest(channel: &SavedChannel) -> Option<BoundedEstimate> {
    let positive = channel.curve.iter().filter(|point| point.adev > 0.0);
    let SavedPoint { adev, low, high, .. } = positive.min_by(|a, b| a.adev.total_cmp(&b.adev))?;
    Some(BoundedEstimate { value: *adev, low: *low, high: *high })
}

fn compared(pairs: Vec<Pair>) -> Result<Comparison, ComparisonError> {
    if pairs.is_empty() {
        return Err(ComparisonError::Nothing);
    }
    let estimates: Vec<(BoundedEstimate, BoundedEstimate)> = pairs.iter().map(|(.., a, b)| (*a, *b)).collect();
    let row =
        |((channel, kind, unit, first, second), (verdict, p_value)): (Pair, (Verdict, f64))| ComparedCoefficient {
            channel,
            kind: kind.to_owned(),
            unit,
            first: first.into(),
            second: second.into(),
            verdict,
            p_value,
        };
    Ok(Comparison { coefficients: pairs.into_iter().zip(verdicts(&estimates)).map(row).collect() })
}

impl Comparison {
    /// Writes a table, whose columns of values are headed `first` and `second`.
    pub fn write(&self, first: &str, second: &str, out: &mut impl Write) -> io::Result<()> {
        let mut table = comfy_table::Table::new();
        table.load_preset(comfy_table::presets::NOTHING);
        table.set_header(["channel", "coefficient", first, second, "unit", "ratio", second, "p"]);
        for row in &self.coefficients {
            let verdict = match row.verdict {
                Verdict::Better => "better",
                Verdict::Worse => "worse",
                Verdict::NotDistinguishable => "not distinguishable",
            };
            table.add_row([
                row.channel.clone(),
                row.kind.replace('_', " "),
                bounded(row.first),
                bounded(row.second),
                row.unit.clone(),
                significant(row.second.value / row.first.value, 3),
                verdict.to_owned(),
                probability(row.p_value),
            ]);
        }
        writeln!(out, "{table}")
    }
}

fn bounded(Bounded { value, low, high }: Bounded) -> String {
    if low == value && high == value {
        number(value)
    } else {
        format!("{} [{}, {}]", number(value), number(low), number(high))
    }
}
