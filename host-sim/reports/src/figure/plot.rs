//! A figure: panels with axes, lines, bands and markers, as SVG, with its values for the page's script.

use super::axis::{Axis, Tick};
use crate::rounding::{quantity_digits, significant};
use maud::{Markup, html};

/// Width of every figure, and edges of its panels, pixels.
pub(super) const WIDTH: f64 = 760.0;
pub(super) const LEFT: f64 = 76.0;
pub(super) const RIGHT: f64 = 744.0;
/// Top of the first panel: below the legend.
pub(super) const TOP: f64 = 34.0;
/// Distance of two panels, and space for the last axis' labels.
const BETWEEN: f64 = 22.0;
const BELOW: f64 = 48.0;
/// Space above the first panel for a tick's label.
const ABOVE: f64 = 10.0;

/// The style of a line, in the order of the colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Look {
    Measured,
    /// Second and third axis of an overview.
    SecondAxis,
    ThirdAxis,
    Model,
    /// The baseline model of the first half.
    Before,
    Term,
    Reference,
    Followed,
}

impl Look {
    pub(super) fn class(self) -> &'static str {
        COLOURS[self as usize].0
    }
}

/// Class and colours of each [`Look`] on light and dark ground: contrast of at least 4.5:1.
pub(super) const COLOURS: [(&str, &str, &str); 8] = [
    ("measured", "#1f5fa8", "#6cb2ff"),
    ("second", "#a8480d", "#ffab5e"),
    ("third", "#0b7559", "#3dd6ac"),
    ("model", "#0b7559", "#3dd6ac"),
    ("before", "#a8480d", "#ffab5e"),
    ("term", "#75559f", "#bfa5ea"),
    ("reference", "#5b6675", "#9aa7b8"),
    ("followed", "#a8286b", "#ff8fc4"),
];

pub(super) const TAU: &str = "averaging time τ, s";
/// Looks of the channels of one unit.
pub(super) const LOOKS: [Look; 3] = [Look::Measured, Look::SecondAxis, Look::ThirdAxis];

pub(super) fn deviation_label(unit: &str) -> String {
    format!("Allan deviation σ(τ), {}", crate::rounding::unit(unit))
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Line {
    pub name: String,
    pub look: Look,
    pub points: Vec<(f64, f64)>,
    /// Empty without.
    pub bounds: Vec<(f64, f64)>,
    pub has_dots: bool,
    pub is_joined: bool,
    pub in_legend: bool,
    /// Empty without.
    pub mark: String,
    pub mark_is_right: bool,
}

impl Line {
    pub(super) fn new(name: impl Into<String>, look: Look, points: Vec<(f64, f64)>) -> Self {
        let (name, bounds, mark) = (name.into(), Vec::new(), String::new());
        let (has_dots, is_joined, in_legend, mark_is_right) = (false, true, true, false);
        Self { name, look, points, bounds, has_dots, is_joined, in_legend, mark, mark_is_right }
    }

    pub(super) fn with_bounds(self, bounds: Vec<(f64, f64)>) -> Self {
        Self { bounds, ..self }
    }

    /// Dots without a line between them.
    pub(super) fn dotted(self) -> Self {
        Self { is_joined: false, ..self.with_dots() }
    }

    pub(super) fn with_dots(self) -> Self {
        Self { has_dots: true, ..self }
    }

    pub(super) fn unlisted(self) -> Self {
        Self { in_legend: false, ..self }
    }

    pub(super) fn marked(self, mark: impl Into<String>) -> Self {
        Self { mark: mark.into(), ..self }
    }

    pub(super) fn marked_right(self, mark: impl Into<String>) -> Self {
        Self { mark_is_right: true, ..self.marked(mark) }
    }
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Place {
    pub label: String,
    pub from: f64,
    pub to: f64,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Panel {
    pub across: Axis,
    pub up: Axis,
    pub lines: Vec<Line>,
    pub places: Vec<Place>,
}

/// A figure with what it says to somebody who does not see it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Plot {
    pub id: String,
    pub title: String,
    /// Alternative text with numbers.
    pub description: String,
    pub(super) panels: Vec<Panel>,
}

impl Place {
    pub(super) fn at_frequency(hz: f64) -> Self {
        Self { label: quantity_digits(hz, "Hz", 3), from: hz, to: hz }
    }
}

impl Plot {
    pub(super) fn new<const PANELS: usize>(
        id: impl Into<String>,
        title: impl Into<String>,
        description: impl Into<String>,
        panels: [Panel; PANELS],
    ) -> Self {
        Self { id: id.into(), title: title.into(), description: description.into(), panels: panels.into() }
    }
}

pub(super) fn frames<const PANELS: usize>(heights: [f64; PANELS]) -> [[f64; 2]; PANELS] {
    let mut top = TOP;
    heights.map(|height| {
        let frame = [top + height, top];
        top += height + BETWEEN;
        frame
    })
}

const LEGEND_ROW: f64 = 20.0;

/// Row and left edge of each of `lines` in a legend, up to the row `last`.
fn legend_places<'l>(lines: impl Iterator<Item = &'l Line>, last: f64) -> Vec<(f64, f64, &'l Line)> {
    let (mut left, mut row) = (LEFT, 0.0);
    let mut entries: Vec<(f64, f64, &Line)> = Vec::new();
    for line in lines.filter(|line| line.in_legend) {
        if entries.iter().any(|(.., known)| known.name == line.name) {
            continue;
        }
        // Letters of 16 px are up to 9.1 px wide.
        let width = 40.0 + 9.1 * line.name.chars().count() as f64;
        if row < last && left > LEFT && left + width > WIDTH {
            (left, row) = (LEFT, row + 1.0);
        }
        entries.push((row, left, line));
        left += width;
    }
    entries
}

pub(super) fn below_legend(frame: [f64; 2], lines: &[Line]) -> [f64; 2] {
    let rows = legend_places(lines.iter(), f64::INFINITY).last().map_or(0.0, |(row, ..)| *row);
    frame.map(|edge| edge + LEGEND_ROW * rows)
}

impl Plot {
    fn top(&self) -> f64 {
        self.panels.first().map_or(TOP, |panel| panel.up.end)
    }

    pub(super) fn height(&self) -> f64 {
        self.panels.last().map_or(TOP, |panel| panel.up.start) + BELOW
    }

    /// A file of its own: style, ground and legend.
    pub(crate) fn file(&self, style: &str) -> Markup {
        let ground = html! {
            style { (maud::PreEscaped(style)) }
            rect class="paper" width=(WIDTH) height=(self.height()) {}
        };
        self.svg(0.0, &ground)
    }

    /// The drawing for the page, whose legend stands beside it.
    pub(crate) fn drawing(&self) -> Markup {
        self.svg(self.top() - ABOVE, &html! {})
    }

    fn svg(&self, top: f64, ground: &Markup) -> Markup {
        let view = format!("0 {} {WIDTH} {}", pixel(top), pixel(self.height() - top));
        html! {
            svg xmlns="http://www.w3.org/2000/svg" viewBox=(view) role="img" aria-label={ (self.title) ". " (self.description) } {
                title { (self.title) }
                (ground)
                (self.legend())
                @for (index, panel) in self.panels.iter().enumerate() {
                    (panel.svg(&format!("{}-{index}", self.id), index + 1 == self.panels.len()))
                }
                line class="cursor" x1="0" x2="0" y1=(self.top()) y2=(self.height() - BELOW) visibility="hidden" {}
            }
        }
    }

    /// Label of the upward axis, swatches and names, for the page.
    pub(crate) fn key(&self) -> Markup {
        html! {
            ul.key {
                @if let Some(first) = self.panels.first() { li.up { (first.up.title()) } }
                @for (.., line) in self.legend_places() {
                    li {
                        svg viewBox="0 0 22 10" aria-hidden="true" {
                            g class=(line.look.class()) {
                                @if line.is_joined { line x1="0" x2="22" y1="5" y2="5" {} }
                                @if line.has_dots { circle cx="11" cy="5" r="3.2" {} }
                            }
                        }
                        (line.name)
                    }
                }
            }
        }
    }

    fn legend_places(&self) -> Vec<(f64, f64, &Line)> {
        legend_places(self.panels.iter().flat_map(|panel| &panel.lines), (self.top() - TOP) / LEGEND_ROW)
    }

    fn legend(&self) -> Markup {
        html! {
            g class="legend" {
                @for (row, left, line) in self.legend_places() {
                    @let middle = 16.0 + LEGEND_ROW * row;
                    g class=(line.look.class()) {
                        @if line.is_joined { line x1=(pixel(left)) x2=(pixel(left + 20.0)) y1=(pixel(middle)) y2=(pixel(middle)) {} }
                        @if line.has_dots { circle cx=(pixel(left + 10.0)) cy=(pixel(middle)) r="3.2" {} }
                    }
                    text x=(pixel(left + 25.0)) y=(pixel(middle + 4.0)) { (line.name) }
                }
            }
        }
    }

    pub(crate) fn values(&self) -> String {
        let panels: Vec<String> = self.panels.iter().map(Panel::values).collect();
        format!("[{}]", panels.join(","))
    }
}

impl Panel {
    pub(super) fn new(across: Axis, up: Axis, lines: Vec<Line>) -> Self {
        Self { across, up, lines, places: Vec::new() }
    }

    pub(super) fn logarithmic(across: &str, up: &str, lines: Vec<Line>, frame: [f64; 2]) -> Self {
        let across = Axis::logarithmic(across, lines.iter().flat_map(places), [LEFT, RIGHT]);
        Self::new(across, Axis::logarithmic(up, lines.iter().flat_map(heights), frame), lines)
    }

    pub(super) fn linear(across: &str, up: &str, lines: Vec<Line>, frame: [f64; 2]) -> Self {
        let across = Axis::linear(across, lines.iter().flat_map(places), [LEFT, RIGHT]);
        Self::new(across, Axis::linear(up, lines.iter().flat_map(heights), frame), lines)
    }

    pub(super) fn with_places(self, places: Vec<Place>) -> Self {
        Self { places, ..self }
    }

    fn svg(&self, id: &str, is_last: bool) -> Markup {
        let (x, y) = (&self.across, &self.up);
        let clip = format!("clip-{id}");
        html! {
            g class="panel" {
                clipPath id=(clip) {
                    rect x=(pixel(x.start)) y=(pixel(y.end)) width=(pixel(x.end - x.start)) height=(pixel(y.start - y.end)) {}
                }
                path class="fine" d=(self.grid(|tick| tick.label.is_none())) {}
                path class="grid" d=(self.grid(|tick| tick.label.is_some())) {}
                @for tick in x.ticks() {
                    @if let (true, Some(at), Some(label)) = (is_last, x.at(tick.value), &tick.label) {
                        text x=(pixel(at)) y=(pixel(y.start + 17.0)) text-anchor="middle" { (label) }
                    }
                }
                @for tick in y.ticks() {
                    @if let (Some(at), Some(label)) = (y.at(tick.value), &tick.label) {
                        text x=(pixel(x.start - 7.0)) y=(pixel(at + 4.5)) text-anchor="end" { (label) }
                    }
                }
                rect class="frame" x=(pixel(x.start)) y=(pixel(y.end))
                    width=(pixel(x.end - x.start)) height=(pixel(y.start - y.end)) {}
                @let middle = (y.start + y.end) / 2.0;
                text class="axis up" x="15" y=(pixel(middle)) text-anchor="middle"
                    transform={ "rotate(-90 15 " (pixel(middle)) ")" } { (y.title()) }
                @if is_last {
                    text class="axis" x=(pixel((x.start + x.end) / 2.0)) y=(pixel(y.start + 38.0)) text-anchor="middle" { (x.title()) }
                }
                g clip-path={ "url(#" (clip) ")" } {
                    @for place in &self.places { (self.place(place)) }
                    @for line in &self.lines { (self.bounds(line)) }
                    @for line in &self.lines { (self.line(line)) }
                }
                @for (place, row) in self.places.iter().zip((0..3).cycle()) {
                    @if let Some(at) = x.at(place.from) {
                        @let is_right = at > (x.start + x.end) / 2.0;
                        text class="place" x=(pixel(if is_right { at - 5.0 } else { at + 5.0 }))
                            y=(pixel(y.end + 15.0 + 15.0 * f64::from(row)))
                            text-anchor=(if is_right { "end" } else { "start" }) { (place.label) }
                    }
                }
                @for line in self.lines.iter().filter(|line| !line.mark.is_empty()) { (self.mark(line)) }
            }
        }
    }

    fn grid(&self, is_chosen: impl Fn(&Tick) -> bool) -> String {
        let (x, y) = (&self.across, &self.up);
        let at = |axis: &Axis| -> Vec<f64> {
            axis.ticks().iter().filter(|tick| is_chosen(tick)).filter_map(|tick| axis.at(tick.value)).collect()
        };
        let upright = at(x).into_iter().map(|at| format!("M{} {}V{}", pixel(at), pixel(y.start), pixel(y.end)));
        let level = at(y).into_iter().map(|at| format!("M{} {}H{}", pixel(x.start), pixel(at), pixel(x.end)));
        upright.chain(level).collect()
    }

    fn place(&self, place: &Place) -> Markup {
        let (from, to) = (self.across.clamped(place.from), self.across.clamped(place.to));
        let (top, bottom) = (self.up.end, self.up.start);
        html! {
            @if let (Some(from), Some(to)) = (from, to) {
                @if to - from > 1.0 {
                    rect class="place" x=(pixel(from)) y=(pixel(top)) width=(pixel(to - from)) height=(pixel(bottom - top)) {}
                } @else {
                    line class="place" x1=(pixel(from)) x2=(pixel(from)) y1=(pixel(top)) y2=(pixel(bottom)) {}
                }
            }
        }
    }

    fn bounds(&self, line: &Line) -> Markup {
        if !line.is_joined {
            return self.error_bars(line);
        }
        let edge = |of: fn(&(f64, f64)) -> f64| -> Vec<(f64, f64)> {
            let pairs = line.points.iter().zip(&line.bounds);
            pairs.filter_map(|((x, _), bounds)| Some((self.across.at(*x)?, self.up.clamped(of(bounds))?))).collect()
        };
        let (low, high) = (edge(|bounds| bounds.0), edge(|bounds| bounds.1));
        html! {
            @if low.len() > 1 && low.len() == high.len() {
                path class={ "band " (line.look.class()) } d={ (path(low.into_iter().chain(high.into_iter().rev()))) "z" } {}
            }
        }
    }

    fn error_bars(&self, line: &Line) -> Markup {
        let bar = |(&(x, _), &(low, high)): (&(f64, f64), &(f64, f64))| {
            Some((self.across.at(x)?, self.up.clamped(low)?, self.up.clamped(high)?))
        };
        let bars = line.points.iter().zip(&line.bounds).filter_map(bar);
        html! {
            g class={ "bar " (line.look.class()) } {
                @for (x, low, high) in bars {
                    line x1=(pixel(x)) x2=(pixel(x)) y1=(pixel(low)) y2=(pixel(high)) {}
                }
            }
        }
    }

    fn line(&self, line: &Line) -> Markup {
        // The panel clips values beyond it.
        let visible: Vec<(f64, f64)> =
            line.points.iter().filter_map(|&(x, y)| Some((self.across.at(x)?, self.up.unclipped(y)?))).collect();
        let inside = |(_, y): &&(f64, f64)| (self.up.end - 0.5..=self.up.start + 0.5).contains(y);
        html! {
            g class=(line.look.class()) data-line=(line.name) {
                @if line.is_joined && visible.len() > 1 { path d=(path(visible.iter().copied())) {} }
                @if line.has_dots {
                    @for (x, y) in visible.iter().filter(inside) { circle cx=(pixel(*x)) cy=(pixel(*y)) r="3.2" {} }
                }
            }
        }
    }

    fn mark(&self, line: &Line) -> Markup {
        let visible = |&(x, y): &(f64, f64)| Some((self.across.at(x)?, self.up.at(y)?));
        let ends = if line.mark_is_right {
            line.points.iter().filter_map(visible).next_back()
        } else {
            line.points.iter().find_map(visible)
        };
        html! {
            @if let Some((x, y)) = ends {
                @let is_right = x > (self.across.start + self.across.end) / 2.0;
                text class="mark" x=(pixel(if is_right { x - 6.0 } else { x + 6.0 })) y=(pixel((y - 6.0).max(self.up.end + 12.0)))
                    text-anchor=(if is_right { "end" } else { "start" }) { (line.mark) }
            }
        }
    }

    fn values(&self) -> String {
        // Equal places are not repeated.
        let first = |pairs: &[(f64, f64)]| numbers(pairs.iter().map(|of| of.0));
        let second = |pairs: &[(f64, f64)]| numbers(pairs.iter().map(|of| of.1));
        let before = [None].into_iter().chain(self.lines.iter().map(Some));
        let lines: Vec<String> = self
            .lines
            .iter()
            .zip(before)
            .map(|(line, before)| {
                let is_same = before.is_some_and(|before| places(before) == places(line));
                let x = if is_same { "null".to_owned() } else { first(&line.points) };
                let bounds = match line.bounds.is_empty() {
                    true => String::new(),
                    false => format!(r#","low":{},"high":{}"#, first(&line.bounds), second(&line.bounds)),
                };
                format!(r#"{{"name":{},"x":{x},"y":{}{bounds}}}"#, quoted(&line.name), second(&line.points))
            })
            .collect();
        format!(r#"{{"x":{},"y":{},"lines":[{}]}}"#, self.across.json(), self.up.json(), lines.join(","))
    }
}

impl Axis {
    fn json(&self) -> String {
        let Self { label, is_logarithmic, from, to, start, end } = self;
        let label = quoted(label);
        format!(r#"{{"label":{label},"log":{is_logarithmic},"from":{from:e},"to":{to:e},"start":{start},"end":{end}}}"#)
    }
}

fn pixel(value: f64) -> String {
    let text = format!("{value:.1}");
    text.strip_suffix(".0").map_or(text.clone(), str::to_owned)
}

/// A relative path through the points, in tenths of a pixel.
fn path(points: impl Iterator<Item = (f64, f64)>) -> String {
    let (mut path, mut last) = ("m".to_owned(), [0.0; 2]);
    for (x, y) in points {
        let here = [x, y].map(|at| (10.0 * at).round());
        for (here, last) in here.into_iter().zip(last) {
            let way = pixel((here - last) / 10.0);
            let way = way.replacen("0.", ".", usize::from(way.trim_start_matches('-').starts_with("0.")));
            if path.len() > 1 && !way.starts_with('-') {
                path.push(' ');
            }
            path.push_str(&way);
        }
        last = here;
    }
    path
}

fn numbers(values: impl Iterator<Item = f64>) -> String {
    let number = |value: f64| match value {
        value if !value.is_finite() => "null".to_owned(),
        0.0 => "0".to_owned(),
        value if (1e-3..1e5).contains(&value.abs()) => significant(value, 4).replace(',', "").replace('−', "-"),
        value => format!("{value:.3e}"),
    };
    let list: Vec<String> = values.map(number).collect();
    format!("[{}]", list.join(","))
}

/// JSON that is safe inside an HTML element.
fn quoted(text: &str) -> String {
    let json = serde_json::to_string(text).unwrap_or_default();
    [('<', "\\u003c"), ('>', "\\u003e"), ('&', "\\u0026")]
        .iter()
        .fold(json, |json, (sign, code)| json.replace(*sign, code))
}

pub(super) fn places(line: &Line) -> Vec<f64> {
    line.points.iter().map(|point| point.0).collect()
}

/// Values, and bounds up to a factor of three.
pub(super) fn heights(line: &Line) -> Vec<f64> {
    let bounds = line.points.iter().zip(&line.bounds);
    let near = bounds.flat_map(|(&(_, y), &(low, high))| [low.max(y / 3.0), high.min(3.0 * y)]);
    line.points.iter().map(|point| point.1).chain(near).collect()
}
