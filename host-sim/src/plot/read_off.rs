//! The classical slopes, drawn where they were found and on to where they are read.

use super::panel::Panel;
use super::{Drawn, READ_OFF, shown};
use crate::report::{ReadOff, ReadOffValue};
use crate::wording;
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

/// What the axis must reach down to for the flat line and its label.
pub(super) fn floor(read_off: &ReadOff) -> Option<f64> {
    let value = read_off.bias_instability.as_ref()?.value * flat_factor();
    shown(value).then(|| value * 0.9)
}

fn flat_factor() -> f64 {
    (2.0 * LN_2 / PI).sqrt()
}

/// −½ through N at 1 s, flat at `B·sqrt(2 ln 2/π)`, +½ through K at 3 s (IEEE Std 952, annex C).
pub(super) fn draw(area: &Panel<'_>, read_off: &ReadOff) -> Drawn {
    one(area, "N", read_off.angle_random_walk.as_ref(), -0.5, 1.0, 1.0)?;
    one(area, "B", read_off.bias_instability.as_ref(), 0.0, 1.0, flat_factor())?;
    one(area, "K", read_off.rate_random_walk.as_ref(), 0.5, 3.0, 1.0)
}

/// The line of one coefficient: its height at `read_at` seconds is `factor` times the value.
fn one(area: &Panel<'_>, symbol: &str, value: Option<&ReadOffValue>, slope: f64, read_at: f64, factor: f64) -> Drawn {
    let Some(value) = value else { return Ok(()) };
    if ![value.value, value.from_s, value.to_s].iter().all(|&number| shown(number)) {
        return Ok(());
    }
    let line = Slope { slope, at: read_at.log10(), height: (value.value * factor).log10() };
    let (from, to) = (value.from_s.log10(), value.to_s.log10());
    let (mut start, mut end) = (from - 0.3, to + 0.3);
    if slope != 0.0 {
        start = start.min(line.at);
        end = end.max(line.at);
    }
    if let Some((start, end)) = line.visible(area, start, end) {
        const DASH: f64 = 0.05;
        let mut at = start;
        while at < end {
            let stop = (at + DASH * 0.6).min(end);
            let dash = vec![(at, line.height_at(at)), (stop, line.height_at(stop))];
            area.area.draw(&PathElement::new(dash, READ_OFF.mix(0.8).stroke_width(3)))?;
            at += DASH;
        }
    }
    let Some((from, to)) = line.visible(area, from, to) else { return Ok(()) };
    let found = vec![(from, line.height_at(from)), (to, line.height_at(to))];
    area.area.draw(&PathElement::new(found, READ_OFF.mix(0.3).stroke_width(14)))?;
    label(area, &line, (from + to) / 2.0, symbol, value)
}

/// The value under its line, kept inside the panel.
fn label(area: &Panel<'_>, line: &Slope, middle: f64, symbol: &str, value: &ReadOffValue) -> Drawn {
    let text = format!("{symbol} = {} {}", wording::number(value.value), wording::unit(&value.unit));
    let width = area.text_width(&text);
    let (first, last) = (area.across.start + width, area.across.end - width);
    let (h_pos, at, shift) = match line.slope {
        slope if slope < 0.0 => (HPos::Right, middle.max(first), (-14, 14)),
        slope if slope > 0.0 => (HPos::Left, middle.min(last), (14, 14)),
        _ => (HPos::Right, middle.max(first), (30, 14)),
    };
    let place = (at, area.clamp(line.height_at(at)));
    let anchor = Pos { h_pos, v_pos: VPos::Top };
    area.text(place, shift, text, &READ_OFF, 28, anchor)
}
