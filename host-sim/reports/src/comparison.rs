//! Two reports, or a report and the data sheet, compared coefficient by coefficient.

use crate::coefficients::KINDS;
use crate::formatting::{number, plain_table};
use crate::rounding::{probability, significant};
use crate::saved_report::{SavedChannel, SavedReport};
use noise_analysis::bounds::BoundedEstimate;
use noise_analysis::report::comparison::{Verdict, verdicts};
use noise_analysis::report::{CurvePoint, Parameter};
use serde::Serialize;
use std::io::{self, Write};

/// Channels of the conditions: they differ between records of any sensor, and rounded temperatures have no white noise.
const CONDITIONS: [&str; 2] = ["temp", "supply"];
/// The lowest point of the measured Allan deviation, which data sheets call in-run bias stability.
const LOWEST: &str = "lowest_allan_deviation";

#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ComparisonError {
    #[error("{channel} is in {first} in one report and in {second} in the other")]
    Units { channel: String, first: String, second: String },
    #[error("no coefficient of a channel is in both")]
    Nothing,
    #[error(
        "the report has no values of a data sheet: analyse the recording with --sensor, and the name or the profile of the sensor"
    )]
    NoDataSheet,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    pub coefficients: Vec<ComparedCoefficient>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ComparedCoefficient {
    pub channel: String,
    pub kind: String,
    pub unit: String,
    pub first: BoundedEstimate,
    pub second: BoundedEstimate,
    /// Sign of the difference, if significant.
    pub verdict: Verdict,
    /// Probability that estimates of one truth differ as much.
    pub p_value: f64,
}

/// Channel, kind, both estimates.
type Pair<'a> = (&'a SavedChannel, &'static str, Parameter, Parameter);

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
            pairs.extend(one.coefficient(kind).zip(other.coefficient(kind)).map(|(a, b)| (one, kind, a, b)));
        }
    }
    compared(pairs)
}

/// Compares a report with typical values of its sensor's data sheet, which have no interval.
///
/// # Errors
/// The report has no values of a data sheet, or they say nothing of what was measured.
pub fn with_data_sheet(report: &SavedReport) -> Result<Comparison, ComparisonError> {
    let specified = || report.channels.iter().filter_map(|channel| Some((channel.data_sheet.as_ref()?, channel)));
    if specified().next().is_none() {
        return Err(ComparisonError::NoDataSheet);
    }
    let mut pairs = Vec::new();
    for (specified, channel) in specified() {
        for (kind, value) in [(KINDS[0], specified.angle_random_walk), (KINDS[2], specified.rate_random_walk)] {
            pairs.extend(value.zip(channel.coefficient(kind)).map(|(value, of)| exact(channel, kind, value, of)));
        }
        let lowest = specified.in_run_bias_stability.zip(lowest(channel));
        pairs.extend(lowest.map(|(value, of)| exact(channel, LOWEST, value, of)));
    }
    compared(pairs)
}

fn exact<'a>(channel: &'a SavedChannel, kind: &'static str, value: f64, measured: Parameter) -> Pair<'a> {
    (channel, kind, BoundedEstimate::exact(value).parameter(measured.unit.clone()), measured)
}

fn lowest(channel: &SavedChannel) -> Option<Parameter> {
    let positive = channel.curve.iter().filter(|point| point.adev > 0.0);
    let CurvePoint { adev, low, high, .. } = positive.min_by(|a, b| a.adev.total_cmp(&b.adev))?;
    Some(Parameter::new(*adev, *low, *high, channel.unit.clone()))
}

fn compared(pairs: Vec<Pair<'_>>) -> Result<Comparison, ComparisonError> {
    if pairs.is_empty() {
        return Err(ComparisonError::Nothing);
    }
    let estimates: Vec<_> = pairs.iter().map(|(.., first, second)| (first.estimate(), second.estimate())).collect();
    let row = |((channel, kind, first, second), (verdict, p_value)): (Pair<'_>, (Verdict, f64))| ComparedCoefficient {
        channel: channel.name.clone(),
        kind: kind.to_owned(),
        first: first.estimate(),
        second: second.estimate(),
        unit: first.unit,
        verdict,
        p_value,
    };
    Ok(Comparison { coefficients: pairs.into_iter().zip(verdicts(&estimates)).map(row).collect() })
}

impl Comparison {
    /// Writes a table, whose columns of values are headed `first` and `second`.
    pub fn write(&self, first: &str, second: &str, out: &mut impl Write) -> io::Result<()> {
        let mut table = plain_table(["channel", "coefficient", first, second, "unit", "ratio", second, "p"]);
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

fn bounded(BoundedEstimate { value, low, high }: BoundedEstimate) -> String {
    if low == value && high == value {
        number(value)
    } else {
        format!("{} [{}, {}]", number(value), number(low), number(high))
    }
}
