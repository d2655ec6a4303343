//! The figures of a report as SVG: overviews, three per channel (Allan deviation, spectrum, bias), and one per finding.

mod axis;
mod channel;
mod evidence;
mod plot;

use crate::finding_text::{channel_list, channel_name};
use crate::live::LiveCurve;
use crate::rounding::{quantity, span};
use crate::summary;
use axis::has_logarithm;
pub(crate) use channel::bias_plot;
use channel::{allan_deviation_plot, measured, spectrum_plot};
pub(crate) use evidence::evidence;
use noise_analysis::report::{ChannelReport, DataSheetReport, Report};
pub(crate) use plot::Plot;
use plot::{COLOURS, LOOKS, Line, Look, Panel, TAU, deviation_label, frames};

/// Growing curves of the channels with `prefix`; `None` without a point.
pub(crate) fn live(curves: &[LiveCurve], prefix: &str) -> Option<Plot> {
    let is_shown = |&(tau, deviation): &(f64, f64)| has_logarithm(tau) && has_logarithm(deviation);
    let shown = curves.iter().filter(|curve| curve.channel.starts_with(prefix) && curve.points.iter().any(is_shown));
    let curves: Vec<&LiveCurve> = shown.collect();
    let first = curves.first()?;
    let line = |(curve, look): (&&LiveCurve, Look)| {
        let name = channel_list([&curve.channel]);
        Line::new(name, look, curve.points.iter().copied().filter(is_shown).collect()).with_dots()
    };
    let lines: Vec<Line> = curves.iter().zip(LOOKS.into_iter().cycle()).map(line).collect();
    let panel = Panel::logarithmic(TAU, &deviation_label(&first.unit), lines, frames([330.0])[0]);
    Some(Plot::new(format!("{prefix}live"), "Allan deviation, while the record grows", "", [panel]))
}

/// Rules of all else, with a colour on light and dark ground.
const RULES: [(&str, &str, &str); 8] = [
    ("svg text{fill", "#1c2430", "#e6eaf0"),
    (".grid{stroke", "#ccd4dd", "#364152"),
    (".fine{stroke", "#eaeef3", "#222b37"),
    (".frame{stroke", "#5b6675", "#9aa7b8"),
    (".paper{fill", "#ffffff", "#171e28"),
    ("rect.place{fill", "#f6e3ef", "#3d2236"),
    ("line.place{stroke", "#a8286b", "#ff8fc4"),
    (".cursor{stroke", "#1c2430", "#e6eaf0"),
];

#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// Name of its file, without an ending.
    pub name: String,
    /// The figure as an SVG document, on light ground.
    pub svg: String,
}

pub(crate) fn style() -> [String; 2] {
    let colours = |ground: usize| {
        let of = |(class, light, dark): &(&str, &str, &str)| {
            let colour = [light, dark][ground];
            format!(".{class} line,.{class} path{{stroke:{colour}}}.{class} circle,path.{class}{{fill:{colour}}}")
        };
        let rules = RULES.iter().map(|(rule, light, dark)| format!("{rule}:{}}}", [light, dark][ground]));
        rules.chain(COLOURS.iter().map(of)).collect::<String>()
    };
    const SHAPES: &str = "svg text{font-size:13px;font-family:system-ui,'Segoe UI',Roboto,'DejaVu Sans',sans-serif}\
        svg .axis{font-size:14px}.grid,.fine,.frame{stroke-width:1;fill:none}\
        svg g>path{fill:none;stroke-width:1.6;stroke-linejoin:round}svg .legend line{stroke-width:2}.bar line{stroke-width:1.4}\
        .model path{stroke-width:2.4}svg path.band{stroke:none;opacity:.2}.cursor{stroke-width:1;stroke-dasharray:3 3}\
        .before path,.before line{stroke-dasharray:7 4}.term path,.term line{stroke-width:1.1;stroke-dasharray:2 3}\
        .reference path,.reference line{stroke-dasharray:10 3 2 3}line.place{stroke-width:1.4;stroke-dasharray:4 3}";
    [format!("{SHAPES}{}", colours(0)), colours(1)]
}

fn standalone(plot: &Plot) -> Picture {
    let [light, _] = style();
    Picture { name: plot.id.clone(), svg: plot.file(&light).into_string() }
}

pub fn pictures(report: &Report) -> Vec<Picture> {
    let overview = story(report).into_iter().chain(overviews(report));
    let channels = report.channels.iter().flat_map(|channel| channel_plots(report, channel));
    let findings =
        (1..).zip(summary::finding_order(report)).filter_map(|(number, index)| evidence(report, index, number));
    overview.chain(channels).chain(findings).map(|plot| standalone(&plot)).collect()
}

pub(crate) fn channel_plots(report: &Report, channel: &ChannelReport) -> Vec<Plot> {
    [Some(allan_deviation_plot(report, channel)), spectrum_plot(report, channel), bias_plot(channel)]
        .into_iter()
        .flatten()
        .collect()
}

pub fn allan_deviation(report: &Report, channel: &ChannelReport) -> String {
    standalone(&allan_deviation_plot(report, channel)).svg
}

/// The channel whose effects lower its error on the unseen half most, else that of the largest error; or `None`.
pub(crate) fn story(report: &Report) -> Option<Plot> {
    let errors: Vec<(&ChannelReport, [f64; 2])> = summary::inertial(report)
        .filter_map(|channel| {
            let [before, after] = summary::models(channel).map(|model| model.unseen.deviance_per_point);
            Some((channel, [before?, after?]))
        })
        .collect();
    let gains = errors.iter().filter(|(_, [before, after])| before > after);
    let shown = gains
        .max_by(|(_, a), (_, b)| (a[0] / a[1]).total_cmp(&(b[0] / b[1])))
        .or_else(|| errors.iter().max_by(|(_, a), (_, b)| a[1].total_cmp(&b[1])));
    shown.map(|&(channel, errors)| channel::story_plot(report, channel, errors))
}

/// The picture of the first finding that has one beside the Allan deviation, or else the curves beside the data sheet.
pub(crate) fn strongest(report: &Report) -> Option<Plot> {
    let pictures = (1..).zip(summary::finding_order(report));
    let first =
        pictures.filter_map(|(number, index)| evidence(report, index, number)).find(|plot| plot.panels.len() == 1);
    let plot = first.or_else(|| overviews(report).into_iter().next())?;
    Some(Plot { id: "strongest".to_owned(), ..plot })
}

pub(crate) fn overviews(report: &Report) -> Vec<Plot> {
    [("gyro_", "gyros"), ("accl_", "accelerometers")]
        .into_iter()
        .filter_map(|(prefix, name)| overview(report, prefix, name))
        .collect()
}

fn overview(report: &Report, prefix: &str, name: &str) -> Option<Plot> {
    let has_curve = |channel: &&ChannelReport| channel.curve.iter().any(|point| has_logarithm(point.adev));
    let of_prefix = report.channels.iter().filter(|channel| channel.name.starts_with(prefix));
    let channels: Vec<&ChannelReport> = of_prefix.filter(has_curve).collect();
    let first = channels.first()?;
    let of_channel = |(channel, look): (&&ChannelReport, Look)| {
        let name = channel_name(channel);
        let model = channel::model_line(channel, &channel.refitted, &format!("model of {name}"), look).unlisted();
        [model, measured(channel, look, &name)]
    };
    let mut lines: Vec<Line> = channels.iter().zip(LOOKS.into_iter().cycle()).flat_map(of_channel).collect();
    let sheet = first.figure_data.data_sheet.as_ref();
    if let Some(sheet) = sheet {
        let taus: Vec<f64> = first.curve.iter().map(|point| point.tau_s).filter(|tau| has_logarithm(*tau)).collect();
        lines.push(data_sheet_line(sheet, &taus));
    }
    let panel = Panel::logarithmic(TAU, &deviation_label(&first.unit), lines, frames([300.0])[0]);
    let lowest = |channel: &&ChannelReport| {
        let lowest = channel.curve.iter().min_by(|a, b| a.adev.total_cmp(&b.adev))?;
        let (tau, deviation) = (span(lowest.tau_s), quantity(lowest.adev, &channel.unit));
        // A curve that still falls at its end has no minimum.
        let is_minimum = channel.curve.last().is_some_and(|last| last.n > lowest.n);
        is_minimum.then(|| format!("{} {deviation} at {tau}", channel_name(channel)))
    };
    let lowest: Vec<String> = channels.iter().filter_map(lowest).collect();
    let lowest = if lowest.is_empty() { String::new() } else { format!(" Lowest: {}.", lowest.join(", ")) };
    let title =
        format!("Allan deviation of the {name}{}", if sheet.is_some() { ", beside the data sheet" } else { "" });
    let description = format!("Points: measured, with 95 % bounds. Lines: models.{lowest}");
    Some(Plot::new(format!("overview-{name}"), title, description, [panel]))
}

/// The data sheet's drawn curve with its scatter over parts, or the stated values at `taus`.
fn data_sheet_line(sheet: &DataSheetReport, taus: &[f64]) -> Line {
    if sheet.curve.is_empty() {
        return Line::new("data sheet", Look::Reference, stated_curve(sheet, taus));
    }
    let points = sheet.curve.iter().map(|of| (of.tau_s, of.mean)).collect();
    let bounds = sheet.curve.iter().map(|of| (of.low, of.high)).collect();
    Line::new("data sheet, mean and ±1 σ over parts", Look::Reference, points).with_bounds(bounds)
}

fn stated_curve(sheet: &DataSheetReport, taus: &[f64]) -> Vec<(f64, f64)> {
    let of = |tau: f64| {
        let square = |value: Option<f64>| value.map_or(0.0, |value| value * value);
        let variance = square(sheet.angle_random_walk) / tau
            + square(sheet.in_run_bias_stability)
            + square(sheet.rate_random_walk) * tau / 3.0;
        (tau, variance.sqrt())
    };
    taus.iter().map(|&tau| of(tau)).collect()
}
