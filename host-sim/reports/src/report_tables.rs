//! The tables of a channel, which the long form and the page lay out.

use crate::formatting::{count, duration, number, optional, parameter_name, percent, words};
use crate::rounding::{NONE, Scale, parameter_magnitude, significant, supported_digits};
use crate::summary;
use noise_analysis::report::assessment::{Coefficient, NavigationDrift};
use noise_analysis::report::{ChannelReport, ModelErrorReport, TermReport};

#[derive(Debug)]
pub(crate) struct ReportTable {
    pub headings: Vec<String>,
    pub rows: Vec<Vec<String>>,
    /// Columns of text at the left; the others are numbers.
    pub text_columns: usize,
}

impl ReportTable {
    pub(crate) fn new(headings: &[&str], text_columns: usize, rows: impl IntoIterator<Item = Vec<String>>) -> Self {
        let headings = headings.iter().map(|heading| (*heading).to_owned()).collect();
        Self { headings, rows: rows.into_iter().collect(), text_columns }
    }
}

/// The parameters of a model's terms, below the heading `title`.
pub(crate) fn terms(title: &str, terms: &[TermReport]) -> ReportTable {
    let rows = terms.iter().flat_map(|term| {
        term.parameters().into_iter().map(move |(name, parameter)| {
            let scale = Scale::new([parameter_magnitude(&parameter)], &parameter.unit);
            let fit = scale.estimate(&parameter);
            vec![words(term.kind()), parameter_name(name), scale.unit, fit]
        })
    });
    ReportTable::new(&[title, "parameter", "unit", "fit, 95 % interval"], 3, rows)
}

/// Errors of the models on the fitted and on the unseen half.
pub(crate) fn errors(channel: &ChannelReport) -> ReportTable {
    let after = if summary::is_fitted_to_later_quarter(channel) { "after, later quarter" } else { "after" };
    // Fitted, and unseen.
    let row = |name: String, errors: [Option<&ModelErrorReport>; 2]| {
        let cells = |text: &dyn Fn(&ModelErrorReport) -> String| errors.map(|of| of.map_or_else(String::new, text));
        let [rms, deviance] = [cells(&|of| percent(of.rms_percent)), cells(&|of| optional(of.deviance_per_point))];
        let worst = cells(&|of| optional(of.worst_sigma));
        [name].into_iter().chain(rms).chain(deviance).chain(worst).collect::<Vec<String>>()
    };
    let models = [("before", &channel.before), (after, &channel.after)].into_iter().flat_map(|(name, model)| {
        let excluding = model.unseen_excluding.as_ref();
        let excluding = excluding.map(|error| row(format!("{name}, excluding"), [None, Some(error)]));
        [row(name.to_owned(), [&model.fitted, &model.unseen].map(Some))].into_iter().chain(excluding)
    });
    let own_curve = row("first half's curve".to_owned(), [None, Some(&channel.first_half_curve)]);
    let headings = ["model error", "rms fitted", "unseen", "deviance fitted", "unseen", "worst σ fitted", "unseen"];
    ReportTable::new(&headings, 1, models.chain([own_curve]))
}

pub(crate) fn units(coefficients: &[Coefficient]) -> ReportTable {
    let row = |coefficient: &Coefficient| {
        let scale = Scale::new([parameter_magnitude(&coefficient.value)], &coefficient.value.unit);
        let sense = if coefficient.discrete { "discrete, of samples" } else { "continuous" };
        let value = scale.estimate(&coefficient.value);
        vec![words(&coefficient.kind), sense.to_owned(), scale.unit, value]
    };
    ReportTable::new(&["in other units", "", "unit", "value, 95 % interval"], 3, coefficients.iter().map(row))
}

/// Errors of an integral after some times.
pub(crate) fn drift(drifts: &[NavigationDrift]) -> ReportTable {
    let row = |drift: &NavigationDrift| {
        let observed = drift.observed.as_ref();
        let scale = Scale::new([drift.predicted].into_iter().chain(observed.map(parameter_magnitude)), &drift.unit);
        let predicted = scale.number(drift.predicted, 3);
        let observed = observed.map_or_else(|| "too short".to_owned(), |observed| scale.estimate(observed));
        vec![duration(drift.seconds), scale.unit, predicted, observed]
    };
    let headings = ["error after", "unit", "predicted", "unseen half, 95 % interval"];
    ReportTable::new(&headings, 2, drifts.iter().map(row))
}

/// The measured curve and the models; deviations have the digits of the measured interval.
pub(crate) fn curve(channel: &ChannelReport) -> ReportTable {
    let is_same = channel.after == channel.before;
    let scale = Scale::new(channel.curve.iter().map(|point| point.adev), &channel.unit);
    let deviation = format!("σ(τ), {}", scale.unit);
    let models = if is_same { &["model"][..] } else { &["before", "after"] };
    let headings = [&["n", "τ, s", &deviation, "low", "high", "edf", "accuracy, %", "by PSD"][..], models].concat();
    let rows = channel.curve.iter().enumerate().map(|(index, point)| {
        let digits = supported_digits(point.adev, point.low, point.high);
        let shown = |value: Option<f64>| value.map_or_else(|| NONE.to_owned(), |value| scale.number(value, digits));
        let mut row = vec![count(point.n), number(point.tau_s)];
        row.extend([point.adev, point.low, point.high].map(|value| shown(Some(value))));
        row.extend([significant(point.edf, 3), significant(point.accuracy_percent, 2)]);
        row.push(shown(point.adev_by_spectrum));
        row.push(shown(channel.before.adev.get(index).copied()));
        if !is_same {
            row.push(shown(channel.after.adev.get(index).copied()));
        }
        row
    });
    ReportTable::new(&headings, 0, rows)
}
