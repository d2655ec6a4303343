//! The straight lines of the slope method: thick where the slope was found, dashed on to where the coefficient is read.

use super::panel::{DrawError, DrawResult, Panel, SLOPES, has_logarithm};
use crate::formatting::{number, unit};
use noise_analysis::report::{SlopeMethodReport, SlopeMethodValue};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::f64::consts::{LN_2, PI};

/// A straight line of the log-log plane through `(at, height)`.
struct Slope {
    slope: f64,
    at: f64,
    height: f64,
}

impl Slope {
    fn height_at(&self, tau: f64) -> f64 {
        self.height + self.slope * (tau - self.at)
    }

    /// The part of `from..to` whose heights are in the panel.
    fn visible(&self, area: &Panel<'_>, from: f64, to: f64) -> Option<(f64, f64)> {
        let (mut from, mut to) = (from.max(area.across.start), to.min(area.across.end));
        if self.slope == 0.0 {
            if !area.up.contains(&self.height) {
                return None;
            }
        } else {
            let reach = |height: f64| self.at + (height - self.height) / self.slope;
            let (a, b) = (reach(area.up.start), reach(area.up.end));
            from = from.max(a.min(b));
            to = to.min(a.max(b));
        }
        (from < to).then_some((from, to))
    }
}

/// The deviation that the axis must reach down to for the flat line and its label; absent without a flat line.
pub(super) fn floor(read_off: &SlopeMethodReport) -> Option<f64> {
    let value = read_off.bias_instability.as_ref()?.value * flat_factor();
    has_logarithm(value).then_some(value * 0.9)
}

/// Deviation of the flat line over the bias instability: 0.664.
fn flat_factor() -> f64 {
    (2.0 * LN_2 / PI).sqrt()
}

/// Draws the lines with the values of their coefficients: −½ through N at 1 s, flat at `B·sqrt(2 ln 2/π)`, +½ through K
/// at 3 s (IEEE Std 952, annex C).
pub(super) fn draw(area: &Panel<'_>, read_off: &SlopeMethodReport) -> DrawResult {
    let lines = [
        ("N", read_off.angle_random_walk.as_ref(), -0.5, 1.0, 1.0),
        ("B", read_off.bias_instability.as_ref(), 0.0, 1.0, flat_factor()),
        ("K", read_off.rate_random_walk.as_ref(), 0.5, 3.0, 1.0),
    ];
    let mut labels: Vec<Label> = Vec::new();
    for (symbol, value, slope, read_at, factor) in lines {
        let Some(value) = value.filter(|v| [v.value, v.from_s, v.to_s].iter().all(|&number| has_logarithm(number)))
        else {
            continue;
        };
        let line = Slope { slope, at: f64::log10(read_at), height: (value.value * factor).log10() };
        if let Some(middle) = draw_line(area, &line, value)? {
            let label = Label::under(area, &line, middle, symbol, value);
            labels.push(label.below(&labels));
        }
    }
    labels.iter().try_for_each(|label| label.draw(area))
}

/// Draws one line. Returns the middle of the visible part of where it was found.
fn draw_line(area: &Panel<'_>, line: &Slope, value: &SlopeMethodValue) -> Result<Option<f64>, DrawError> {
    let (from, to) = (value.from_s.log10(), value.to_s.log10());
    let (mut start, mut end) = (from - 0.3, to + 0.3);
    if line.slope != 0.0 {
        start = start.min(line.at);
        end = end.max(line.at);
    }
    if let Some((start, end)) = line.visible(area, start, end) {
        const DASH: f64 = 0.05;
        let mut at = start;
        while at < end {
            let stop = (at + DASH * 0.6).min(end);
            let dash = vec![(at, line.height_at(at)), (stop, line.height_at(stop))];
            area.line(dash, SLOPES.mix(0.8).stroke_width(3))?;
            at += DASH;
        }
    }
    let Some((from, to)) = line.visible(area, from, to) else { return Ok(None) };
    let found = vec![(from, line.height_at(from)), (to, line.height_at(to))];
    area.line(found, SLOPES.mix(0.3).stroke_width(14))?;
    Ok(Some((from + to) / 2.0))
}

/// The height of a label with the space below it, pixels.
const LABEL_HEIGHT: i32 = 32;

/// A coefficient's value beside its line.
struct Label {
    text: String,
    h_pos: HPos,
    place: (f64, f64),
    shift: (i32, i32),
    /// Left and right end, pixels.
    across: (i32, i32),
    top: i32,
}

impl Label {
    /// A label below `line` and inside the panel: left of `middle` for a falling line, right of it for a rising one, so
    /// that the line does not cross it.
    fn under(area: &Panel<'_>, line: &Slope, middle: f64, symbol: &str, value: &SlopeMethodValue) -> Self {
        let text = format!("{symbol} = {} {}", number(value.value), unit(&value.unit));
        let (width, pixels) = area.text_width(&text);
        let (first, last) = (area.across.start + width, area.across.end - width);
        let (h_pos, at, shift) = match line.slope {
            slope if slope < 0.0 => (HPos::Right, middle.max(first), (-14, 14)),
            slope if slope > 0.0 => (HPos::Left, middle.min(last), (14, 14)),
            _ => (HPos::Right, middle.max(first), (30, 14)),
        };
        let place = (at, area.clamp(line.height_at(at)));
        let (x, y) = area.area.map_coordinate(&place);
        let x = x + shift.0;
        let across = if matches!(h_pos, HPos::Left) { (x, x + pixels) } else { (x - pixels, x) };
        Label { text, h_pos, place, shift, across, top: y + shift.1 }
    }

    /// The label moved down until it covers none of `others`.
    fn below(mut self, others: &[Label]) -> Self {
        // Each step clears at least one of the others.
        for _ in others {
            let covered = others.iter().find(|other| self.covers(other));
            let Some(distance) = covered.map(|other| other.top + LABEL_HEIGHT - self.top) else { break };
            self.top += distance;
            self.shift.1 += distance;
        }
        self
    }

    fn covers(&self, other: &Label) -> bool {
        self.across.0 < other.across.1 && other.across.0 < self.across.1 && (self.top - other.top).abs() < LABEL_HEIGHT
    }

    fn draw(&self, area: &Panel<'_>) -> DrawResult {
        let anchor = Pos { h_pos: self.h_pos, v_pos: VPos::Top };
        area.text(self.place, self.shift, self.text.clone(), &SLOPES, 28, anchor)
    }
}
