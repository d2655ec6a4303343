//! The figures of one channel: Allan deviation with its terms and its residual, spectrum, bias over time.

use super::axis::{Axis, has_logarithm};
use super::plot::{
    LEFT, Line, Look, Panel, Place, Plot, RIGHT, TAU, below_legend, deviation_label, frames, heights, places,
};
use crate::finding_text::channel_name;
use crate::formatting::{capital, words};
use crate::rounding::{NONE, extremes, quantity, span, unit};
use crate::summary::{self, off_percent};
use allan_core::model::{FittedTerm, cube_root_deviation};
use allan_core::{Model, NoiseTerm};
use noise_analysis::report::{ChannelReport, Finding, ModelReport, Report, SlopeMethodReport, SlopeMethodValue};
use std::f64::consts::{LN_2, PI};

/// Bounds of the residual panel, standard deviations.
const RESIDUAL: std::ops::RangeInclusive<f64> = 4.0..=30.0;
/// Points of a term's line per octave.
const PER_OCTAVE: u32 = 2;

pub(super) fn allan_deviation_plot(report: &Report, channel: &ChannelReport) -> Plot {
    let data = measured(channel, Look::Measured, "measured, 95 % bounds");
    let has_terms = channel.refitted.adev != channel.before.adev;
    let mut lines: Vec<Line> = terms(report, channel);
    if has_terms {
        lines.push(model_line(channel, &channel.before, "before: N, B, K of the first half", Look::Before));
    }
    lines.push(model_line(channel, &channel.refitted, "model of the whole record", Look::Model));
    lines.push(data);
    let [curve, residual] = frames([330.0, 120.0]).map(|frame| below_legend(frame, &lines));
    let across = Axis::logarithmic(TAU, lines.iter().flat_map(places), [LEFT, RIGHT]);
    // Terms may lead out of the panel, except the flat line of B.
    let shown = lines.iter().filter(|line| line.look != Look::Term || is_flat(line)).flat_map(heights);
    let up = Axis::logarithmic(&deviation_label(&channel.unit), shown, curve);
    lines.extend(slopes(channel).into_iter().flatten());
    let lower = residual_panel(channel, has_terms, across.clone(), residual);
    let description = format!("{} {}", describe(channel), describe_slopes(channel));
    of_channel(channel, "allan", "Allan deviation", description, [Panel::new(across, up, lines), lower])
}

fn of_channel<const PANELS: usize>(
    channel: &ChannelReport,
    id: &str,
    title: &str,
    description: String,
    panels: [Panel; PANELS],
) -> Plot {
    Plot::new(format!("{}-{id}", channel.name), format!("{} · {title}", channel_name(channel)), description, panels)
}

/// The measured curve, the model of the first half and its error on the second; beside it the model without effects, if these lower the
/// error.
pub(super) fn story_plot(report: &Report, channel: &ChannelReport, [before, after]: [f64; 2]) -> Plot {
    let is_lowered = after < before;
    let models = summary::models(channel);
    let mut lines = Vec::new();
    if is_lowered {
        lines.push(model_line(channel, models[0], "before: N, B, K", Look::Before));
    }
    let name = if is_lowered { "after: with effects" } else { "model of the first half" };
    lines.push(model_line(channel, models[1], name, Look::Model));
    lines.push(measured(channel, Look::Measured, "measured, whole record"));
    let unseen = deviations(channel, &channel.unseen_adev);
    if !unseen.is_empty() {
        lines.push(Line::new("second half, not seen by the fit", Look::Reference, unseen).dotted());
    }
    let [frame] = frames([270.0]).map(|frame| below_legend(frame, &lines));
    let across = Axis::logarithmic(TAU, lines.iter().flat_map(places), [LEFT, RIGHT]);
    let terms = terms(report, channel);
    let level = terms.iter().filter(|line| is_flat(line)).flat_map(heights);
    let up = Axis::logarithmic(&deviation_label(&channel.unit), lines.iter().flat_map(heights).chain(level), frame);
    lines.splice(0..0, terms);
    let name = capital(&channel_name(channel));
    let [before, after] = models.map(|model| model.unseen.rms_percent.map_or_else(|| NONE.to_owned(), off_percent));
    let (title, description) = if is_lowered {
        (
            format!("{name}: σ is off by {before} % without what was found, by {after} % with it"),
            "Both models are fitted to the first half. Their errors are those on the second, up to an eighth of its length.",
        )
    } else {
        (
            format!("{name}: σ is off by {after} %"),
            "The model is fitted to the first half. Its error is that on the second, up to an eighth of its length.",
        )
    };
    Plot::new("story", title, description, [Panel::new(across, up, lines)])
}

/// Slopes of N at 1 s, B at the minimum and K at 3 s, over a factor of four to both sides and to the curve.
fn slopes(channel: &ChannelReport) -> [Option<Line>; 3] {
    let SlopeMethodReport { angle_random_walk, bias_instability, rate_random_walk } = &channel.read_off;
    let line = |slope: &str, found: &SlopeMethodValue, at_s: f64, deviation: &dyn Fn(f64) -> f64| {
        let from = if found.to_s < 0.25 * at_s { found.from_s } else { 0.25 * at_s };
        let to = if found.from_s > 4.0 * at_s { found.to_s } else { 4.0 * at_s };
        let octaves = (to / from).log2().ceil().clamp(1.0, 64.0) as i32;
        let points = (0..=octaves).map(|step| from * (to / from).powf(f64::from(step) / f64::from(octaves)));
        let points: Vec<(f64, f64)> = points.map(|tau| (tau, deviation(tau))).collect();
        let line = Line::new(format!("slope {slope}"), Look::Reference, points).unlisted().marked(slope);
        line.points.iter().all(|&(tau, of)| has_logarithm(tau) && has_logarithm(of)).then_some(line)
    };
    [
        angle_random_walk.as_ref().and_then(|n| line(SLOPES[0], n, 1.0, &|tau| n.value / tau.sqrt())),
        bias_instability
            .as_ref()
            .and_then(|b| line(SLOPES[1], b, (b.from_s * b.to_s).sqrt(), &|_| b.value * (2.0 * LN_2 / PI).sqrt())),
        rate_random_walk.as_ref().and_then(|k| line(SLOPES[2], k, 3.0, &|tau| k.value * (tau / 3.0).sqrt())),
    ]
}

const SLOPES: [&str; 3] = ["−½", "0", "+½"];

fn describe_slopes(channel: &ChannelReport) -> String {
    let lines = slopes(channel);
    let absent: Vec<&str> =
        SLOPES.into_iter().zip(&lines).filter(|(_, line)| line.is_none()).map(|(slope, _)| slope).collect();
    if absent.is_empty() || channel.curve.is_empty() {
        return String::new();
    }
    format!("The slope method finds no slope {} in it.", absent.join(", "))
}

fn describe(channel: &ChannelReport) -> String {
    let shown: Vec<_> = channel.curve.iter().filter(|point| has_logarithm(point.adev)).collect();
    let (Some(first), Some(last)) = (shown.first(), shown.last()) else {
        return if channel.curve.is_empty() {
            "The record is too short for a point of the curve.".to_owned()
        } else {
            "No deviation above zero: the channel did not change.".to_owned()
        };
    };
    let at = |deviation: f64, tau: f64| format!("{} at {}", quantity(deviation, &channel.unit), span(tau));
    let lowest = shown.iter().min_by(|a, b| a.adev.total_cmp(&b.adev)).unwrap_or(first);
    format!(
        "From {} to {}, lowest {}. Below: measured less modelled in standard deviations of each point.",
        at(first.adev, first.tau_s),
        at(last.adev, last.tau_s),
        at(lowest.adev, lowest.tau_s)
    )
}

pub(super) fn model_line(channel: &ChannelReport, model: &ModelReport, name: &str, look: Look) -> Line {
    Line::new(name, look, deviations(channel, &model.adev))
}

/// Averaging time and deviation, as far as both have logarithms.
fn deviations(channel: &ChannelReport, adev: &[f64]) -> Vec<(f64, f64)> {
    let pairs = channel.curve.iter().map(|point| point.tau_s).zip(adev.iter().copied());
    pairs.filter(|&(tau, adev)| has_logarithm(tau) && has_logarithm(adev)).collect()
}

fn terms(report: &Report, channel: &ChannelReport) -> Vec<Line> {
    let (model, rate_hz) = (&channel.refitted, report.sample_rate_hz);
    let [n, b, k] = &summary::coefficients_in_short(report, &channel.name);
    let Some(last) = channel.curve.last().map(|point| point.n) else { return Vec::new() };
    let factors: Vec<u64> = (0..=last.max(1).ilog2() * PER_OCTAVE)
        .map(|step| 2f64.powf(f64::from(step) / f64::from(PER_OCTAVE)).round() as u64)
        .collect();
    let whole = Model::new(1.0 / rate_hz, model.terms.iter().map(|of| of.term));
    let line = |term: &FittedTerm| {
        let kind = term.kind;
        let deviation = |n: u64| (n as f64 / rate_hz, whole.part(term, n).sqrt());
        let points = factors.iter().map(|&n| deviation(n)).filter(|&(_, of)| has_logarithm(of)).collect();
        let line = Line::new(words(kind.name()), Look::Term, points).unlisted();
        match kind {
            NoiseTerm::AngleRandomWalk | NoiseTerm::Filtered(_) | NoiseTerm::LowPass(_) => line.marked(n),
            NoiseTerm::BiasInstability => line.marked(b),
            NoiseTerm::RateRandomWalk => line.marked_right(k),
            NoiseTerm::Quantization => line.marked("Q"),
            NoiseTerm::RateRamp => line.marked_right("R"),
            _ => line,
        }
    };
    let known = whole.terms().iter().filter(|term| term.value > 0.0);
    let mut lines: Vec<Line> = known.map(line).filter(|line| !line.points.is_empty()).collect();
    // White noise of several terms is one N.
    lines.iter_mut().filter(|line| line.mark == *n).skip(1).for_each(|line| line.mark.clear());
    if let Some(first) = lines.first_mut() {
        (first.name, first.in_legend) = ("terms of the whole record".to_owned(), true);
    }
    lines
}

fn is_flat(line: &Line) -> bool {
    line.points.first().map(|of| of.1) == line.points.last().map(|of| of.1)
}

fn residual_panel(channel: &ChannelReport, has_terms: bool, across: Axis, frame: [f64; 2]) -> Panel {
    let of = |model: &ModelReport| -> Vec<(f64, f64)> {
        let pairs = channel.curve.iter().zip(&model.adev);
        pairs
            .filter(|(point, adev)| has_logarithm(point.adev) && has_logarithm(**adev))
            .map(|(point, adev)| (point.tau_s, cube_root_deviation((point.adev / adev).powi(2), point.edf)))
            .filter(|(_, sigma)| sigma.is_finite())
            .collect()
    };
    let left = of(&channel.refitted);
    let before = if has_terms { of(&channel.before) } else { Vec::new() };
    let largest = left.iter().map(|(_, sigma)| 1.2 * sigma.abs()).fold(*RESIDUAL.start(), f64::max);
    let limit = largest.min(*RESIDUAL.end());
    let up = Axis::linear("residual, σ", std::iter::empty(), frame).between(-limit, limit);
    let zone = |value: f64| {
        let name = if value == 0.0 { "zero" } else { "±2 σ" };
        Line::new(name, Look::Reference, vec![(across.from, value), (across.to, value)]).unlisted()
    };
    let mut lines = vec![zone(-2.0), zone(0.0), zone(2.0)];
    if has_terms {
        lines.push(Line::new("before", Look::Before, before).unlisted());
    }
    lines.push(Line::new("residual of the model", Look::Measured, left).dotted().unlisted());
    Panel::new(across, up, lines)
}

fn traced_lines(report: &Report, channel: &ChannelReport) -> Vec<Place> {
    let is_line = |finding: &&Finding| finding.effect.is_line() && finding.channels.contains(&channel.name);
    let lines = report.findings.iter().filter(is_line);
    lines.filter_map(|finding| Some(Place::at_frequency(finding.effect.frequency_hz()?.value))).collect()
}

pub(super) fn spectrum_plot(report: &Report, channel: &ChannelReport) -> Option<Plot> {
    let spectrum = channel.figure_data.spectrum.as_ref()?;
    let along = |values: &[f64]| -> Vec<(f64, f64)> {
        spectrum.frequency_hz.iter().copied().zip(values.iter().copied()).collect()
    };
    let bounds = spectrum.low.iter().copied().zip(spectrum.high.iter().copied()).collect();
    let model = along(&spectrum.model).into_iter().filter(|&(_, density)| has_logarithm(density)).collect();
    let lines = vec![
        Line::new("measured, 95 % bounds", Look::Measured, along(&spectrum.density)).with_bounds(bounds),
        Line::new("model with the filter, without lines", Look::Model, model),
    ];
    let label = format!("root of the spectrum, {}/√Hz", unit(&channel.unit));
    let traced = traced_lines(report, channel);
    let names: Vec<&str> = traced.iter().map(|place| place.label.as_str()).collect();
    let description = if names.is_empty() {
        "No line was traced in it.".to_owned()
    } else {
        format!("Lines were traced at {}.", names.join(", "))
    };
    let panel = Panel::logarithmic("frequency, Hz", &label, lines, frames([300.0])[0]).with_places(traced);
    Some(of_channel(channel, "spectrum", "spectrum", description, [panel]))
}

pub(crate) fn bias_plot(channel: &ChannelReport) -> Option<Plot> {
    let bias = channel.figure_data.bias_over_time.as_ref()?;
    let (scale, per) = time_unit(bias.time_s.last().copied().unwrap_or(0.0));
    let along = |values: &[f64]| -> Vec<(f64, f64)> {
        bias.time_s.iter().map(|time| time / scale).zip(values.iter().copied()).collect()
    };
    let follows = bias.followed.len() == bias.mean.len();
    let mean = Line::new(format!("mean of {}", span(bias.block_s)), Look::Measured, along(&bias.mean));
    let mut upper = vec![mean];
    if follows {
        upper.push(Line::new("what it follows", Look::Followed, along(&bias.followed)));
    }
    let (time, name) = (format!("time, {per}"), unit(&channel.unit));
    let panel = |what: &str, lines, frame| Panel::linear(&time, &format!("{what}, {name}"), lines, frame);
    let (low, high) = extremes(bias.mean.iter().copied());
    let range = quantity(high - low, &channel.unit);
    let description = format!("Means of {} less the mean of the record, over a range of {range}", span(bias.block_s));
    let title = "bias over time";
    if !follows {
        return Some(of_channel(
            channel,
            "bias",
            title,
            format!("{description}."),
            [panel("bias", upper, frames([210.0])[0])],
        ));
    }
    let rest: Vec<f64> = bias.mean.iter().zip(&bias.followed).map(|(mean, followed)| mean - followed).collect();
    let [above, below] = frames([190.0, 150.0]);
    let lower = panel("left", vec![Line::new("left", Look::Model, along(&rest))], below);
    let description = format!("{description}; with what the findings explain of it, and what is left.");
    Some(of_channel(channel, "bias", title, description, [panel("bias", upper, above), lower]))
}

pub(super) fn time_unit(length_s: f64) -> (f64, &'static str) {
    match length_s {
        length if length < 300.0 => (1.0, "s"),
        length if length < 3.0 * 3600.0 => (60.0, "min"),
        length if length < 3.0 * 86_400.0 => (3600.0, "h"),
        _ => (86_400.0, "d"),
    }
}
pub(super) fn measured(channel: &ChannelReport, look: Look, name: &str) -> Line {
    let shown = || channel.curve.iter().filter(|point| has_logarithm(point.tau_s) && has_logarithm(point.adev));
    let points = shown().map(|point| (point.tau_s, point.adev)).collect();
    let bounds = shown().map(|point| (point.low, point.high)).collect();
    Line::new(name, look, points).with_bounds(bounds).dotted()
}
