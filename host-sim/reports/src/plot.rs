//! The picture of one channel: Allan deviation above, what the model leaves of it beneath.

mod panel;
mod read_off;
mod residual;

use crate::wording;
use noise_analysis::report::{ChannelReport, CurvePoint, ModelReport, ReadOff};
use panel::{Frame, Panel, ink};
use plotters::coord::Shift;
use plotters::prelude::*;

/// Width and height of the picture, pixels; large so that whole pixels are fine enough.
const SIZE: (u32, u32) = (1600, 1200);
/// Width and height when there is nothing to see.
const EMPTY: (u32, u32) = (1600, 170);
const LEFT: i32 = 150;
const RIGHT: i32 = 1570;
const CURVE: Frame = Frame { left: LEFT, right: RIGHT, top: 112, bottom: 800 };
const RESIDUAL: Frame = Frame { left: LEFT, right: RIGHT, top: 858, bottom: 1104 };

const TEXT: RGBColor = RGBColor(0x1C, 0x24, 0x30);
const FAINT_TEXT: RGBColor = RGBColor(0x5B, 0x66, 0x75);
const GRID: RGBColor = RGBColor(0xC6, 0xCE, 0xD8);
const FINE_GRID: RGBColor = RGBColor(0xE9, 0xED, 0xF2);
const MEASURED: RGBColor = RGBColor(0x1F, 0x5F, 0xA8);
const BEFORE: RGBColor = RGBColor(0xD9, 0x73, 0x0D);
const AFTER: RGBColor = RGBColor(0x0F, 0x8A, 0x6C);
const READ_OFF: RGBColor = RGBColor(0x7B, 0x5E, 0xA7);

/// Every colour of the picture as the SVG writes it, with the colour that replaces it on a dark ground.
pub const DARK: [(&str, &str); 8] = [
    ("#1C2430", "#E6EAF0"),
    ("#5B6675", "#9AA7B8"),
    ("#C6CED8", "#3D4858"),
    ("#E9EDF2", "#232B37"),
    ("#1F5FA8", "#6CB2FF"),
    ("#D9730D", "#FFA94D"),
    ("#0F8A6C", "#3DD6AC"),
    ("#7B5EA7", "#B79CE6"),
];

type Canvas<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Failed = DrawingAreaErrorKind<std::io::Error>;
type Drawn = Result<(), Failed>;

/// Why there is no picture.
#[derive(Debug, thiserror::Error)]
#[error("cannot draw the Allan deviation of {channel}: {reason}")]
pub struct PlotError {
    /// The channel's name.
    pub channel: String,
    /// What the drawing library said.
    pub reason: String,
}

/// The picture of `channel` as an SVG document of its own. Points that a logarithmic axis cannot show (zero, not
/// finite) are left out.
pub fn allan(channel: &ChannelReport) -> Result<String, PlotError> {
    let points: Vec<&CurvePoint> =
        channel.curve.iter().filter(|point| shown(point.tau_s) && shown(point.adev)).collect();
    let size = if points.is_empty() { EMPTY } else { SIZE };
    let mut svg = String::new();
    let canvas = SVGBackend::with_string(&mut svg, size).into_drawing_area();
    let drawn = if points.is_empty() { excuse(&canvas, channel) } else { draw(&canvas, channel, &points) };
    drop(canvas);
    drawn.map_err(|error| PlotError { channel: channel.name.clone(), reason: error.to_string() })?;
    Ok(svg)
}

fn title(canvas: &Canvas<'_>, channel: &ChannelReport) -> Drawn {
    let title = format!("{} · Allan deviation", channel.name);
    canvas.draw(&Text::new(title, (LEFT, 26), ink(&TEXT, 36)))
}

/// Why there is nothing to see.
fn excuse(canvas: &Canvas<'_>, channel: &ChannelReport) -> Drawn {
    title(canvas, channel)?;
    let text = if channel.curve.is_empty() {
        "the record is too short for a point of the curve"
    } else {
        "no deviation above zero: the channel did not change"
    };
    canvas.draw(&Text::new(text, (LEFT, 100), ink(&FAINT_TEXT, 32)))?;
    canvas.present()
}

fn draw(canvas: &Canvas<'_>, channel: &ChannelReport, points: &[&CurvePoint]) -> Drawn {
    title(canvas, channel)?;
    legend(canvas, channel)?;
    let before = model_line(channel, &channel.before);
    let after = if effects_added(channel) { model_line(channel, &channel.after) } else { Vec::new() };

    let taus = panel::span(points.iter().map(|point| point.tau_s.log10()), 0.14);
    let heights = points
        .iter()
        // A point of one degree of freedom has an interval of decades: it may leave the picture.
        .flat_map(|p| [p.adev, p.low.max(p.adev / 3.0), p.high.min(p.adev * 3.0)])
        .chain(before.iter().chain(&after).map(|&(_, adev)| adev))
        .chain(read_off::floor(&channel.read_off))
        .filter(|&value| shown(value))
        .map(f64::log10);
    let area = Panel::new(canvas, &CURVE, taus.clone(), panel::span(heights, 0.12));
    area.decades_across(false)?;
    area.decades_up()?;
    area.frame()?;
    let label = format!("Allan deviation σ(τ), {}", wording::unit(&channel.unit));
    area.label_up(&label)?;

    read_off::draw(&area, &channel.read_off)?;
    curve(&area, points)?;
    let logs = |line: &[(f64, f64)]| -> Vec<(f64, f64)> {
        line.iter().map(|&(tau, adev)| (tau.log10(), adev.log10())).collect()
    };
    area.area.draw(&PathElement::new(logs(&before), BEFORE.stroke_width(4)))?;
    if !after.is_empty() {
        area.area.draw(&PathElement::new(logs(&after), AFTER.stroke_width(4)))?;
    }
    markers(&area, points.iter().map(|p| (p.tau_s.log10(), p.adev.log10())))?;
    residual::draw(canvas, taus, channel)?;
    canvas.present()
}

/// Whether the picture has a second model to show.
fn effects_added(channel: &ChannelReport) -> bool {
    channel.after != channel.before && !channel.after.adev.is_empty()
}

fn shown(value: f64) -> bool {
    value.is_finite() && value > 0.0
}

/// The model at the octaves, (τ, σ), without what cannot be shown.
fn model_line(channel: &ChannelReport, model: &ModelReport) -> Vec<(f64, f64)> {
    let taus = channel.curve.iter().map(|point| point.tau_s);
    taus.zip(model.adev.iter().copied()).filter(|&(tau, adev)| shown(tau) && shown(adev)).collect()
}

/// The 95 % interval as a band, and as a bar at each point.
fn curve(area: &Panel<'_>, points: &[&CurvePoint]) -> Drawn {
    let bounds: Vec<(f64, f64, f64)> = points
        .iter()
        .filter(|point| shown(point.low) && shown(point.high))
        .map(|point| (point.tau_s.log10(), area.clamp(point.low.log10()), area.clamp(point.high.log10())))
        .collect();
    intervals(area, &bounds)
}

/// Band and bars of `(across, low, high)`.
fn intervals(area: &Panel<'_>, bounds: &[(f64, f64, f64)]) -> Drawn {
    let upper = bounds.iter().map(|&(tau, _, high)| (tau, high));
    let lower = bounds.iter().rev().map(|&(tau, low, _)| (tau, low));
    if bounds.len() > 1 {
        let outline: Vec<(f64, f64)> = upper.chain(lower).collect();
        area.area.draw(&Polygon::new(outline, MEASURED.mix(0.13)))?;
    }
    for &(tau, low, high) in bounds {
        let bar = vec![(tau, low), (tau, high)];
        area.area.draw(&PathElement::new(bar, MEASURED.mix(0.7).stroke_width(3)))?;
    }
    Ok(())
}

/// One dot per measured point.
fn markers(area: &Panel<'_>, places: impl Iterator<Item = (f64, f64)>) -> Drawn {
    for place in places {
        area.area.draw(&Circle::new(place, 7, MEASURED.filled()))?;
    }
    Ok(())
}

fn legend(canvas: &Canvas<'_>, channel: &ChannelReport) -> Drawn {
    const LINE: i32 = 82;
    const SWATCH: i32 = 46;
    let mut left = LEFT;
    let mut entry = |text: &str, colour: RGBColor, shape: Shape| -> Drawn {
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
        let style = ink(&TEXT, 30).pos(panel::MIDDLE_LEFT);
        canvas.draw(&Text::new(text.to_owned(), (left + SWATCH + 14, LINE), style))?;
        // Sans-serif letters of 24 px are about 12 px wide.
        left += SWATCH + 14 + 12 * text.chars().count() as i32 + 34;
        Ok(())
    };
    entry("measured, 95 % interval", MEASURED, Shape::DotInBand)?;
    entry("declared model (N, B, K)", BEFORE, Shape::Line)?;
    if effects_added(channel) {
        entry("with traced effects", AFTER, Shape::Line)?;
    }
    let ReadOff { angle_random_walk, bias_instability, rate_random_walk } = &channel.read_off;
    if [angle_random_walk, bias_instability, rate_random_walk].iter().any(|slope| slope.is_some()) {
        entry("slopes read off", READ_OFF, Shape::Dashes)?;
    }
    Ok(())
}

enum Shape {
    DotInBand,
    Line,
    Dashes,
}
