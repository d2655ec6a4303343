//! A panel of a figure: a rectangle with its axes (logarithms across, logarithms or percent up), the measured points in
//! it, and the colours of the figure.

use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::ops::Range;

pub(super) const TEXT: RGBColor = RGBColor(0x1C, 0x24, 0x30);
pub(super) const FAINT_TEXT: RGBColor = RGBColor(0x5B, 0x66, 0x75);
const GRID: RGBColor = RGBColor(0xC6, 0xCE, 0xD8);
const FINE_GRID: RGBColor = RGBColor(0xE9, 0xED, 0xF2);
pub(super) const MEASURED: RGBColor = RGBColor(0x1F, 0x5F, 0xA8);
pub(super) const BEFORE: RGBColor = RGBColor(0xD9, 0x73, 0x0D);
pub(super) const AFTER: RGBColor = RGBColor(0x0F, 0x8A, 0x6C);
pub(super) const SLOPES: RGBColor = RGBColor(0x7B, 0x5E, 0xA7);

/// The colours above in the same order, as the SVG writes them, each with the colour that replaces it on a dark page.
pub const DARK_COLOURS: [(&str, &str); 8] = [
    ("#1C2430", "#E6EAF0"),
    ("#5B6675", "#9AA7B8"),
    ("#C6CED8", "#3D4858"),
    ("#E9EDF2", "#232B37"),
    ("#1F5FA8", "#6CB2FF"),
    ("#D9730D", "#FFA94D"),
    ("#0F8A6C", "#3DD6AC"),
    ("#7B5EA7", "#B79CE6"),
];

pub(super) type Canvas<'a> = DrawingArea<SVGBackend<'a>, Shift>;
pub(super) type DrawError = DrawingAreaErrorKind<std::io::Error>;
pub(super) type DrawResult = Result<(), DrawError>;

const CENTRE: Pos = Pos { h_pos: HPos::Center, v_pos: VPos::Center };
pub(super) const MIDDLE_LEFT: Pos = Pos { h_pos: HPos::Left, v_pos: VPos::Center };
const MIDDLE_RIGHT: Pos = Pos { h_pos: HPos::Right, v_pos: VPos::Center };
const TOP_CENTRE: Pos = Pos { h_pos: HPos::Center, v_pos: VPos::Top };

/// Whether a logarithmic axis can show `value`.
pub(super) fn has_logarithm(value: f64) -> bool {
    value.is_finite() && value > 0.0
}

/// Style of a text in `colour`, letters of `size` pixels.
pub(super) fn text_style(colour: &RGBColor, size: i32) -> TextStyle<'static> {
    ("sans-serif", size).into_font().color(colour)
}

/// Edges of a panel, pixels.
pub(super) struct Frame {
    pub left: i32,
    pub right: i32,
    pub top: i32,
    pub bottom: i32,
}

/// From the least to the greatest of `values`, wider at both ends by `margin` times the distance between them, or by half
/// a decade if that distance is below 0.2 decades.
pub(super) fn span(values: impl Iterator<Item = f64>, margin: f64) -> Range<f64> {
    let (low, high) =
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
    match high - low {
        distance if !distance.is_finite() => 0.0..1.0,
        distance if distance < 0.2 => (low - 0.5)..(high + 0.5),
        distance => (low - margin * distance.min(2.0))..(high + margin * distance.min(2.0)),
    }
}

/// A drawing area with its axes: `across` and `up` are their ranges.
pub(super) struct Panel<'a> {
    pub area: DrawingArea<SVGBackend<'a>, Cartesian2d<RangedCoordf64, RangedCoordf64>>,
    pub across: Range<f64>,
    pub up: Range<f64>,
    pixels_across: f64,
}

impl<'a> Panel<'a> {
    pub(super) fn new(canvas: &Canvas<'a>, frame: &Frame, across: Range<f64>, up: Range<f64>) -> Self {
        let pixels = (frame.left..frame.right, frame.bottom..frame.top);
        let coordinates = Cartesian2d::<RangedCoordf64, RangedCoordf64>::new(across.clone(), up.clone(), pixels);
        let pixels_across = f64::from(frame.right - frame.left);
        Panel { area: canvas.apply_coord_spec(coordinates), across, up, pixels_across }
    }

    /// About how wide `text` of the panel's size is, in decades and in pixels: its letters take 13 pixels.
    pub(super) fn text_width(&self, text: &str) -> (f64, i32) {
        let pixels = 13 * i32::try_from(text.chars().count()).unwrap_or(0) + 20;
        (f64::from(pixels) / self.pixels_across * (self.across.end - self.across.start), pixels)
    }

    /// `height` moved into the panel.
    pub(super) fn clamp(&self, height: f64) -> f64 {
        height.clamp(self.up.start, self.up.end)
    }

    pub(super) fn frame(&self) -> DrawResult {
        let (x, y) = (&self.across, &self.up);
        let corners = vec![(x.start, y.end), (x.start, y.start), (x.end, y.start), (x.end, y.end), (x.start, y.end)];
        self.line(corners, FAINT_TEXT.stroke_width(2))
    }

    /// Grid of the averaging times, with their labels if `labelled`.
    pub(super) fn decades_across(&self, labelled: bool) -> DrawResult {
        for tick in ticks(&self.across) {
            self.line_up(tick.at, tick.labelled)?;
            if labelled && tick.labelled {
                self.text((tick.at, self.up.start), (0, 12), tick.label(), &TEXT, 28, TOP_CENTRE)?;
            }
        }
        Ok(())
    }

    /// Grid and labels of the deviations.
    pub(super) fn decades_up(&self) -> DrawResult {
        for tick in ticks(&self.up) {
            self.line_across(tick.at, if tick.labelled { &GRID } else { &FINE_GRID })?;
            if tick.labelled {
                let place = (self.across.start, tick.at);
                self.text(place, (-12, 0), tick.label(), &TEXT, 28, MIDDLE_RIGHT)?;
            }
        }
        Ok(())
    }

    /// Grid and labels at the multiples of `step`.
    pub(super) fn steps_up(&self, step: f64) -> DrawResult {
        let (first, last) = ((self.up.start / step).ceil(), (self.up.end / step).floor());
        let mut index = first;
        while index <= last {
            let value = index * step;
            self.line_across(value, if index == 0.0 { &FAINT_TEXT } else { &GRID })?;
            let label = match value {
                0.0 => "0".to_owned(),
                value if value < 0.0 => format!("−{}", -value),
                value => format!("+{value}"),
            };
            self.text((self.across.start, value), (-12, 0), label, &TEXT, 28, MIDDLE_RIGHT)?;
            index += 1.0;
        }
        Ok(())
    }

    pub(super) fn label_up(&self, label: &str) -> DrawResult {
        let place = (self.across.start, (self.up.start + self.up.end) / 2.0);
        let style = text_style(&TEXT, 30).pos(CENTRE).transform(FontTransform::Rotate270);
        self.area.draw(&(EmptyElement::at(place) + Text::new(label.to_owned(), (-112, 0), style)))
    }

    pub(super) fn label_across(&self, label: &str) -> DrawResult {
        let place = ((self.across.start + self.across.end) / 2.0, self.up.start);
        self.text(place, (0, 52), label.to_owned(), &TEXT, 30, TOP_CENTRE)
    }

    /// `text` at `place`, moved by `shift` pixels.
    pub(super) fn text(
        &self,
        place: (f64, f64),
        shift: (i32, i32),
        text: String,
        colour: &RGBColor,
        size: i32,
        anchor: Pos,
    ) -> DrawResult {
        let text = Text::new(text, shift, text_style(colour, size).pos(anchor));
        self.area.draw(&(EmptyElement::at(place) + text))
    }

    /// The 95 % intervals `(across, low, high)`: a band through all of them, and a bar for each.
    pub(super) fn intervals(&self, bounds: &[(f64, f64, f64)]) -> DrawResult {
        let upper = bounds.iter().map(|&(tau, _, high)| (tau, high));
        let lower = bounds.iter().rev().map(|&(tau, low, _)| (tau, low));
        if bounds.len() > 1 {
            let outline: Vec<(f64, f64)> = upper.chain(lower).collect();
            self.area.draw(&Polygon::new(outline, MEASURED.mix(0.13)))?;
        }
        for &(tau, low, high) in bounds {
            self.line(vec![(tau, low), (tau, high)], MEASURED.mix(0.7).stroke_width(3))?;
        }
        Ok(())
    }

    /// A dot for each measured point.
    pub(super) fn markers(&self, points: impl Iterator<Item = (f64, f64)>) -> DrawResult {
        for point in points {
            self.area.draw(&Circle::new(point, 7, MEASURED.filled()))?;
        }
        Ok(())
    }

    /// A line through `points`.
    pub(super) fn line(&self, points: Vec<(f64, f64)>, style: ShapeStyle) -> DrawResult {
        self.area.draw(&PathElement::new(points, style))
    }

    fn line_across(&self, height: f64, colour: &RGBColor) -> DrawResult {
        self.line(vec![(self.across.start, height), (self.across.end, height)], colour.stroke_width(2))
    }

    fn line_up(&self, at: f64, major: bool) -> DrawResult {
        let colour = if major { GRID } else { FINE_GRID };
        self.line(vec![(at, self.up.start), (at, self.up.end)], colour.stroke_width(2))
    }
}

/// A line of a logarithmic grid at `digit · 10^decade`; `at` is its logarithm.
struct Tick {
    digit: u8,
    decade: i32,
    at: f64,
    labelled: bool,
}

impl Tick {
    fn label(&self) -> String {
        if (-3..=3).contains(&self.decade) {
            let value = f64::from(self.digit) * 10f64.powi(self.decade);
            let decimals = usize::try_from(-self.decade).unwrap_or(0);
            return format!("{value:.decimals$}");
        }
        let power = format!("10{}", superscript(self.decade));
        match self.digit {
            1 => power,
            digit => format!("{digit}·{power}"),
        }
    }
}

/// The grid lines in `range` of logarithms. An axis shorter than three decades has labels between the decades too; one
/// of twelve decades and more has grid lines at some of the decades only.
fn ticks(range: &Range<f64>) -> Vec<Tick> {
    let inside = |at: f64| at >= range.start - 1e-9 && at <= range.end + 1e-9;
    let (first, last) = (range.start.floor() as i32, range.end.ceil() as i32);
    let decades = (first..=last).filter(|&decade| inside(f64::from(decade))).count();
    let every = 1 + last.saturating_sub(first) / 12;
    let labelled = |decade: i32, digit: u8| match digit {
        1 => decade % every == 0,
        2 | 5 => decades < 3,
        _ => decades == 0,
    };
    let grid = (first..=last).flat_map(|decade| (1..=9u8).map(move |digit| (decade, digit)));
    grid.map(|(decade, digit)| Tick {
        digit,
        decade,
        at: f64::from(decade) + f64::from(digit).log10(),
        labelled: labelled(decade, digit),
    })
    .filter(|tick| inside(tick.at) && (every == 1 || tick.digit == 1))
    .collect()
}

fn superscript(value: i32) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let raised = |letter: char| letter.to_digit(10).map_or('⁻', |digit| DIGITS[digit as usize]);
    value.to_string().chars().map(raised).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(range: Range<f64>) -> Vec<String> {
        let labelled = |tick: &Tick| tick.labelled.then(|| tick.label());
        ticks(&range).iter().filter_map(labelled).collect()
    }

    #[test]
    fn decades_are_labelled() {
        assert_eq!(labels(-3.1..4.2), ["0.001", "0.01", "0.1", "1", "10", "100", "1000", "10⁴"]);
    }

    #[test]
    fn a_short_axis_is_labelled_between_the_decades() {
        assert_eq!(labels(-1.8..-0.9), ["0.02", "0.05", "0.1"]);
        assert_eq!(labels(-4.9..-4.2), ["2·10⁻⁵", "3·10⁻⁵", "4·10⁻⁵", "5·10⁻⁵", "6·10⁻⁵"]);
    }

    #[test]
    fn a_span_of_no_width_is_widened() {
        assert_eq!(span(std::iter::empty(), 0.1), 0.0..1.0);
        assert_eq!(span([2.0].into_iter(), 0.1), 1.5..2.5);
        assert_eq!(span([0.0, 1.0].into_iter(), 0.1), -0.1..1.1);
    }
}
