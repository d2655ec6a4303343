//! The figure of one channel as SVG: Allan deviation above, what the model leaves of it beneath.

mod panel;
mod slopes;

pub use panel::DARK_COLOURS;

use crate::formatting;
use allan_core::Model;
use noise_analysis::nonstationarity::ChannelExplanation;
use noise_analysis::report::{ChannelReport, CurvePoint, ModelErrorReport, ModelReport, SlopeMethodReport};
use panel::{
    AFTER, BEFORE, Canvas, DrawResult, FAINT_TEXT, Frame, MEASURED, MIDDLE_LEFT, Panel, SLOPES, TEXT, has_logarithm,
    span, text_style,
};
use plotters::prelude::*;
use std::ops::Range;

/// Width and height of the figure, pixels; large, since the drawing library rounds to whole pixels.
const SIZE: (u32, u32) = (1600, 1200);
/// Width and height of a figure without points.
const EMPTY: (u32, u32) = (1600, 170);
const LEFT: i32 = 150;
const RIGHT: i32 = 1570;
const CURVE: Frame = Frame { left: LEFT, right: RIGHT, top: 112, bottom: 800 };
const RESIDUAL: Frame = Frame { left: LEFT, right: RIGHT, top: 858, bottom: 1104 };

/// A figure could not be drawn.
#[derive(Debug, thiserror::Error)]
#[error("cannot draw the Allan deviation of {channel}: {reason}")]
pub struct FigureError {
    /// The channel's name.
    pub channel: String,
    /// What the drawing library said.
    pub reason: String,
}

/// The figure of `channel` as an SVG document. Points that a logarithmic axis cannot show (zero, not finite) are left out.
///
/// # Errors
/// The drawing library fails.
pub fn allan_deviation(channel: &ChannelReport) -> Result<String, FigureError> {
    let points: Vec<&CurvePoint> =
        channel.curve.iter().filter(|point| has_logarithm(point.tau_s) && has_logarithm(point.adev)).collect();
    let size = if points.is_empty() { EMPTY } else { SIZE };
    let mut svg = String::new();
    let canvas = SVGBackend::with_string(&mut svg, size).into_drawing_area();
    let drawn = if points.is_empty() { draw_empty(&canvas, channel) } else { draw(&canvas, channel, &points) };
    drop(canvas);
    drawn.map_err(|error| FigureError { channel: channel.name.clone(), reason: error.to_string() })?;
    Ok(svg)
}

fn title(canvas: &Canvas<'_>, channel: &ChannelReport) -> DrawResult {
    let title = format!("{} · Allan deviation", channel.name);
    canvas.draw(&Text::new(title, (LEFT, 26), text_style(&TEXT, 36)))
}

/// The reason why there are no points.
fn draw_empty(canvas: &Canvas<'_>, channel: &ChannelReport) -> DrawResult {
    title(canvas, channel)?;
    let text = if channel.curve.is_empty() {
        "the record is too short for a point of the curve"
    } else {
        "no deviation above zero: the channel did not change"
    };
    canvas.draw(&Text::new(text, (LEFT, 100), text_style(&FAINT_TEXT, 32)))?;
    canvas.present()
}

fn draw(canvas: &Canvas<'_>, channel: &ChannelReport, points: &[&CurvePoint]) -> DrawResult {
    title(canvas, channel)?;
    legend(canvas, channel)?;
    let before = model_line(channel, &channel.before);
    let after = if effects_added(channel) { model_line(channel, &channel.after) } else { Vec::new() };

    let taus = span(points.iter().map(|point| point.tau_s.log10()), 0.14);
    let heights = points
        .iter()
        // The interval of a point with one degree of freedom spans decades: it is cut off at a factor of three.
        .flat_map(|p| [p.adev, p.low.max(p.adev / 3.0), p.high.min(p.adev * 3.0)])
        .chain(before.iter().chain(&after).map(|&(_, adev)| adev))
        .chain(slopes::floor(&channel.read_off))
        .filter(|&value| has_logarithm(value))
        .map(f64::log10);
    let area = Panel::new(canvas, &CURVE, taus.clone(), span(heights, 0.12));
    area.decades_across(false)?;
    area.decades_up()?;
    area.frame()?;
    let label = format!("Allan deviation σ(τ), {}", formatting::unit(&channel.unit));
    area.label_up(&label)?;

    slopes::draw(&area, &channel.read_off)?;
    let bounds: Vec<(f64, f64, f64)> = points
        .iter()
        .filter(|point| has_logarithm(point.low) && has_logarithm(point.high))
        .map(|point| (point.tau_s.log10(), area.clamp(point.low.log10()), area.clamp(point.high.log10())))
        .collect();
    area.intervals(&bounds)?;
    let logs = |line: &[(f64, f64)]| -> Vec<(f64, f64)> {
        line.iter().map(|&(tau, adev)| (tau.log10(), adev.log10())).collect()
    };
    area.line(logs(&before), BEFORE.stroke_width(4))?;
    if !after.is_empty() {
        area.line(logs(&after), AFTER.stroke_width(4))?;
    }
    area.markers(points.iter().map(|p| (p.tau_s.log10(), p.adev.log10())))?;
    draw_residual(canvas, taus, channel)?;
    canvas.present()
}

/// Whether there is a second model to show.
fn effects_added(channel: &ChannelReport) -> bool {
    channel.after != channel.before && !channel.after.adev.is_empty()
}

/// The model at the octaves, (τ, σ), without what cannot be shown.
fn model_line(channel: &ChannelReport, model: &ModelReport) -> Vec<(f64, f64)> {
    let taus = channel.curve.iter().map(|point| point.tau_s);
    taus.zip(model.adev.iter().copied()).filter(|&(tau, adev)| has_logarithm(tau) && has_logarithm(adev)).collect()
}

fn legend(canvas: &Canvas<'_>, channel: &ChannelReport) -> DrawResult {
    const LINE: i32 = 82;
    const SWATCH: i32 = 46;
    let mut left = LEFT;
    let mut entry = |text: &str, colour: RGBColor, shape: Shape| -> DrawResult {
        let (start, end) = ((left, LINE), (left + SWATCH, LINE));
        match shape {
            Shape::DotInBand => {
                let band = [(left, LINE - 11), (left + SWATCH, LINE + 11)];
                canvas.draw(&Rectangle::new(band, colour.mix(0.13).filled()))?;
                let middle = left + SWATCH / 2;
                let bar = vec![(middle, LINE - 11), (middle, LINE + 11)];
                canvas.draw(&PathElement::new(bar, colour.mix(0.7).stroke_width(3)))?;
                canvas.draw(&Circle::new((middle, LINE), 7, colour.filled()))?;
            }
            Shape::Line => canvas.draw(&PathElement::new(vec![start, end], colour.stroke_width(4)))?,
            Shape::Dashes => {
                for dash in 0..3 {
                    let from = left + dash * 17;
                    let path = vec![(from, LINE), (from + 11, LINE)];
                    canvas.draw(&PathElement::new(path, colour.stroke_width(3)))?;
                }
            }
        }
        let style = text_style(&TEXT, 30).pos(MIDDLE_LEFT);
        canvas.draw(&Text::new(text.to_owned(), (left + SWATCH + 14, LINE), style))?;
        // Sans-serif letters of 24 px are about 12 px wide.
        left += SWATCH + 14 + 12 * text.chars().count() as i32 + 34;
        Ok(())
    };
    entry("measured, 95 % interval", MEASURED, Shape::DotInBand)?;
    entry("baseline model (N, B, K)", BEFORE, Shape::Line)?;
    if effects_added(channel) {
        entry("with traced effects", AFTER, Shape::Line)?;
    }
    let SlopeMethodReport { angle_random_walk, bias_instability, rate_random_walk } = &channel.read_off;
    if [angle_random_walk, bias_instability, rate_random_walk].iter().any(|slope| slope.is_some()) {
        entry("slope method", SLOPES, Shape::Dashes)?;
    }
    Ok(())
}

/// How the legend shows an entry.
enum Shape {
    DotInBand,
    Line,
    Dashes,
}

/// The lower panel: measured over modelled deviation, in percent. The model is that with the traced effects if there is
/// one; the baseline model is then a line.
fn draw_residual(canvas: &Canvas<'_>, taus: Range<f64>, channel: &ChannelReport) -> DrawResult {
    let added = effects_added(channel);
    let best = if added { &channel.after } else { &channel.before };
    let points = residuals(channel, best);
    let baseline = if added { residuals(channel, &channel.before) } else { Vec::new() };
    let extreme = points.iter().chain(&baseline).map(|r| r.percent.abs()).fold(0.0, f64::max);
    let limit = (extreme * 1.25).clamp(4.0, 250.0);
    let area = Panel::new(canvas, &RESIDUAL, taus, -limit..limit);
    area.decades_across(true)?;
    area.steps_up(label_distance(limit))?;
    area.frame()?;
    area.label_up("σ / model − 1, %")?;
    area.label_across("averaging time τ, s")?;

    let bounds: Vec<(f64, f64, f64)> = points
        .iter()
        .filter(|residual| residual.low.is_finite() && residual.high.is_finite())
        .map(|residual| (residual.tau, area.clamp(residual.low), area.clamp(residual.high)))
        .collect();
    area.intervals(&bounds)?;
    if added {
        let line: Vec<(f64, f64)> =
            baseline.iter().map(|residual| (residual.tau, area.clamp(residual.percent))).collect();
        area.line(line, BEFORE.stroke_width(3))?;
    }
    let colour = if added { AFTER } else { BEFORE };
    let zero = vec![(area.across.start, 0.0), (area.across.end, 0.0)];
    area.line(zero, colour.stroke_width(4))?;
    area.markers(points.iter().map(|residual| (residual.tau, area.clamp(residual.percent))))
}

/// A point of the lower panel: `tau` is the logarithm of the averaging time, the others are percent.
struct Residual {
    tau: f64,
    percent: f64,
    low: f64,
    high: f64,
}

fn residuals(channel: &ChannelReport, model: &ModelReport) -> Vec<Residual> {
    let pairs = channel.curve.iter().zip(model.adev.iter().copied());
    pairs
        .filter(|(point, adev)| has_logarithm(point.tau_s) && has_logarithm(point.adev) && has_logarithm(*adev))
        .map(|(point, adev)| Residual::new(point, adev))
        .filter(|residual| residual.percent.is_finite())
        .collect()
}

impl Residual {
    fn new(point: &CurvePoint, adev: f64) -> Self {
        let percent = |deviation: f64| 100.0 * (deviation / adev - 1.0);
        Residual {
            tau: point.tau_s.log10(),
            percent: percent(point.adev),
            low: percent(point.low),
            high: percent(point.high),
        }
    }
}

/// A round distance that puts two or three labels on either side of zero.
fn label_distance(limit: f64) -> f64 {
    const ROUND: [f64; 6] = [2.0, 5.0, 10.0, 20.0, 50.0, 100.0];
    ROUND.into_iter().find(|step| limit / step < 3.5).unwrap_or(100.0)
}

/// The figure of an explained channel as an SVG document: the curve of the second half, with the baseline model and the
/// predictive model of the first.
///
/// # Errors
/// The drawing library fails.
pub fn explained_channel(of: &ChannelExplanation) -> Result<String, FigureError> {
    let unseen = &of.curves.unseen;
    let model = |model: &Model, [fitted, error]: [f64; 2]| ModelReport {
        terms: Vec::new(),
        adev: unseen.points().iter().map(|point| model.avar(point.n).sqrt()).collect(),
        fitted: ModelErrorReport { deviance_per_point: Some(fitted), ..Default::default() },
        unseen: ModelErrorReport { deviance_per_point: Some(error), ..Default::default() },
        unseen_excluding: None,
    };
    allan_deviation(&ChannelReport {
        name: format!("{}, second half; models of the first", of.channel.name),
        unit: of.channel.unit.to_owned(),
        samples: unseen.samples(),
        missing: Default::default(),
        // With the degrees of freedom of the tables.
        curve: unseen.points().iter().map(|point| CurvePoint::new(point, unseen.samples())).collect(),
        read_off: SlopeMethodReport { angle_random_walk: None, bias_instability: None, rate_random_walk: None },
        before: model(&of.trace.before, of.errors.baseline),
        assessment: Default::default(),
        effects: Vec::new(),
        after: model(&of.predictive, of.errors.predictive),
        refitted: model(&of.predictive, of.errors.predictive),
        at_rest: Vec::new(),
    })
}

#[cfg(test)]
mod tests {
    use super::label_distance;

    #[test]
    fn few_labels_on_either_side() {
        for limit in [4.0, 6.9, 12.0, 33.0, 60.0, 130.0, 250.0] {
            let labels = (limit / label_distance(limit)).floor();
            assert!((1.0..=3.0).contains(&labels), "{limit}: {labels}");
        }
    }
}
