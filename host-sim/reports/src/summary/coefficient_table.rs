//! N, B and K of gyros and accelerometers in users' units, with the data sheet and the errors of the models.

use super::model_error::{HIGH_DEVIANCE, error_change, models};
use crate::coefficients::{KINDS, LETTERS, coefficient};
use crate::rounding::{NONE, column_prefix, estimate, parameter_magnitude, significant};
use noise_analysis::report::{ChannelReport, DataSheetReport, Parameter, Report};
use noise_analysis::units::conversions;

/// Minimum of the Allan deviation over B: `sqrt(2 ln 2/π)`.
const MINIMUM_OVER_B: f64 = 0.664;

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CoefficientTable {
    /// `gyro` or `accel`.
    pub title: &'static str,
    pub names: [&'static str; 3],
    /// Units of N, B and K, prefixes included.
    pub units: [String; 3],
    /// One row a channel, then that of the data sheet, if it is known.
    pub rows: Vec<CoefficientTableRow>,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CoefficientTableRow {
    /// The axis, or `sheet`.
    pub label: String,
    /// Name in the report; empty for the data sheet.
    pub channel: String,
    /// N, B and K of the model `final` with bounds; `–` if absent.
    pub coefficients: [String; 3],
    /// Error of σ on the unseen half, without and with effects.
    pub error: String,
    pub is_high: bool,
}

struct Group {
    title: &'static str,
    prefix: &'static str,
    names: [&'static str; 3],
    /// The units of N, B and K, as [`conversions`] has them, and as they are printed.
    units: [&'static str; 3],
    symbols: [&'static str; 3],
    /// Factor from the one to the other.
    factor: f64,
}

const GROUPS: [Group; 2] = [
    Group {
        title: "gyro",
        prefix: "gyro_",
        names: ["angle random walk", "bias instability", "rate random walk"],
        units: ["deg/sqrt(h)", "deg/h", "deg/h/sqrt(h)"],
        symbols: ["°/√h", "°/h", "°/h/√h"],
        factor: 1.0,
    },
    Group {
        title: "accel",
        prefix: "accl_",
        names: ["velocity random walk", "bias instability", "accel. random walk"],
        units: ["ug/sqrt(Hz)", "ug", "ug/sqrt(h)"],
        symbols: ["g/√Hz", "g", "g/√h"],
        factor: 1e-6,
    },
];

/// N, B and K of a channel in its unit and seconds, with its errors.
#[derive(Debug, Clone, PartialEq)]
pub struct ChannelCoefficients {
    pub name: String,
    pub unit: String,
    pub coefficients: [Option<Parameter>; 3],
    /// [`ModelErrorReport::rms_percent`] on unseen data, without and with effects.
    pub rms_percent: [Option<f64>; 2],
    /// Deviance per point on unseen data, with effects.
    pub deviance: Option<f64>,
}

impl From<&ChannelReport> for ChannelCoefficients {
    fn from(channel: &ChannelReport) -> Self {
        Self {
            name: channel.name.clone(),
            unit: channel.unit.clone(),
            coefficients: KINDS.map(|kind| coefficient(channel, kind)),
            rms_percent: models(channel).map(|model| model.unseen.rms_percent),
            deviance: channel.after.unseen.deviance_per_point,
        }
    }
}

pub fn coefficient_tables(report: &Report) -> Vec<CoefficientTable> {
    let channels: Vec<ChannelCoefficients> = report.channels.iter().map(ChannelCoefficients::from).collect();
    let sheet = |prefix: &str| {
        let first = report.channels.iter().find(|channel| channel.name.starts_with(prefix))?;
        first.figure_data.data_sheet.as_ref().map(sheet_coefficients)
    };
    tables_of(&channels, report.sample_rate_hz, sheet)
}

/// N, B and K with units, without intervals, such as `N 2.424 °/√h`; a letter alone without a number.
pub(crate) fn coefficients_in_short(report: &Report, channel: &str) -> [String; 3] {
    let tables = coefficient_tables(report);
    let row = tables.iter().find_map(|table| Some((table, table.rows.iter().find(|row| row.channel == channel)?)));
    std::array::from_fn(|index| {
        let number = row.and_then(|(_, row)| row.coefficients[index].split(' ').next());
        let number = number.filter(|number| number.starts_with(|first: char| first.is_ascii_digit()));
        let unit = row.map_or("", |(table, _)| table.units[index].as_str());
        number.map_or_else(|| LETTERS[index].to_owned(), |number| format!("{} {number} {unit}", LETTERS[index]))
    })
}

/// Tables of channels at `sample_rate_hz`, without a data sheet.
pub fn tables_of_channels(channels: &[ChannelCoefficients], sample_rate_hz: f64) -> Vec<CoefficientTable> {
    tables_of(channels, sample_rate_hz, |_| None)
}

/// `sheet` has the data sheet's N, B, K by prefix of names.
fn tables_of(
    all: &[ChannelCoefficients],
    sample_rate_hz: f64,
    sheet: impl Fn(&str) -> Option<[Option<f64>; 3]>,
) -> Vec<CoefficientTable> {
    let table = |&Group { title, prefix, names, units, symbols, factor }: &Group| {
        let channels: Vec<&ChannelCoefficients> = all.iter().filter(|of| of.name.starts_with(prefix)).collect();
        let first = channels.first()?;
        // Prefix, and factor to the unit with it.
        let columns: [(&str, f64); 3] = std::array::from_fn(|index| {
            let known = conversions(KINDS[index], &first.unit, sample_rate_hz);
            let factor =
                known.iter().find(|known| known.unit == units[index]).map_or(1.0, |known| known.factor) * factor;
            let shown = channels.iter().filter_map(|channel| channel.coefficients[index].as_ref());
            let (prefix, divisor) = column_prefix(shown.map(|n| factor * parameter_magnitude(n)));
            (prefix, factor / divisor)
        });
        let cells = |cell: &dyn Fn(usize, f64) -> Option<String>| {
            std::array::from_fn(|index| cell(index, columns[index].1).unwrap_or_else(|| NONE.to_owned()))
        };
        let row = |channel: &&ChannelCoefficients| CoefficientTableRow {
            label: channel.name.trim_start_matches(prefix).to_owned(),
            channel: channel.name.clone(),
            coefficients: cells(&|index, scale| {
                let n = channel.coefficients[index].as_ref()?;
                Some(estimate(n.value * scale, n.low * scale, n.high * scale))
            }),
            error: error_change(channel.rms_percent),
            is_high: channel.deviance.is_some_and(|of| of > HIGH_DEVIANCE),
        };
        let sheet = sheet(prefix).map(|sheet| CoefficientTableRow {
            label: "sheet".to_owned(),
            channel: String::new(),
            coefficients: cells(&|index, scale| {
                let number = |value: f64| significant(value * scale, 2);
                let value = sheet[index]?;
                let of_minimum = || format!("{} = {}/{MINIMUM_OVER_B}", number(value), number(value * MINIMUM_OVER_B));
                Some(if index == 1 { of_minimum() } else { number(value) })
            }),
            error: String::new(),
            is_high: false,
        });
        let units = std::array::from_fn(|index| format!("{}{}", columns[index].0, symbols[index]));
        Some(CoefficientTable { title, names, units, rows: channels.iter().map(row).chain(sheet).collect() })
    };
    GROUPS.iter().filter_map(table).collect()
}

/// N, B and K of a data sheet in the channel's unit and seconds; B is the in-run bias stability over 0.664.
fn sheet_coefficients(sheet: &DataSheetReport) -> [Option<f64>; 3] {
    let minimum = sheet.in_run_bias_stability;
    [sheet.angle_random_walk, minimum.map(|minimum| minimum / MINIMUM_OVER_B), sheet.rate_random_walk]
}
