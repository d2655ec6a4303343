//! One rectangle of the picture with its axes: logarithms across, logarithms or percent up.

use super::{Canvas, Drawn, FAINT_TEXT, FINE_GRID, GRID, TEXT};
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::ops::Range;

pub(super) const CENTRE: Pos = Pos { h_pos: HPos::Center, v_pos: VPos::Center };
pub(super) const MIDDLE_LEFT: Pos = Pos { h_pos: HPos::Left, v_pos: VPos::Center };
const MIDDLE_RIGHT: Pos = Pos { h_pos: HPos::Right, v_pos: VPos::Center };
const TOP_CENTRE: Pos = Pos { h_pos: HPos::Center, v_pos: VPos::Top };

/// Text of the picture.
pub(super) fn ink(colour: &RGBColor, size: i32) -> TextStyle<'static> {
    ("sans-serif", size).into_font().color(colour)
}

/// Where a panel lies, pixels.
pub(super) struct Frame {
    pub left: i32,
    pub right: i32,
    pub top: i32,
    pub bottom: i32,
}

/// From the least to the greatest of `values`, and `margin` times the distance more at both ends. Without a
/// distance, half a decade to both sides.
pub(super) fn span(values: impl Iterator<Item = f64>, margin: f64) -> Range<f64> {
    let (low, high) =
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
    match high - low {
        distance if !distance.is_finite() => 0.0..1.0,
        distance if distance < 0.2 => (low - 0.5)..(high + 0.5),
        distance => (low - margin * distance.min(2.0))..(high + margin * distance.min(2.0)),
    }
}

/// Axes and what is drawn between them.
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

    pub(super) fn frame(&self) -> Drawn {
        let (x, y) = (&self.across, &self.up);
        let corners = vec![(x.start, y.end), (x.start, y.start), (x.end, y.start), (x.end, y.end), (x.start, y.end)];
        self.area.draw(&PathElement::new(corners, FAINT_TEXT.stroke_width(2)))
    }

    /// Grid of the averaging times, with their labels if `labelled`.
    pub(super) fn decades_across(&self, labelled: bool) -> Drawn {
        for tick in ticks(&self.across) {
            self.line_up(tick.at, tick.labelled)?;
            if labelled && tick.labelled {
                self.text((tick.at, self.up.start), (0, 12), tick.label(), &TEXT, 28, TOP_CENTRE)?;
            }
        }
        Ok(())
    }

    /// Grid and labels of the deviations.
    pub(super) fn decades_up(&self) -> Drawn {
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
    pub(super) fn steps_up(&self, step: f64) -> Drawn {
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

    pub(super) fn label_up(&self, label: &str) -> Drawn {
        let place = (self.across.start, (self.up.start + self.up.end) / 2.0);
        let style = ink(&TEXT, 30).pos(CENTRE).transform(FontTransform::Rotate270);
        self.area.draw(&(EmptyElement::at(place) + Text::new(label.to_owned(), (-112, 0), style)))
    }

    pub(super) fn label_across(&self, label: &str) -> Drawn {
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
    ) -> Drawn {
        let text = Text::new(text, shift, ink(colour, size).pos(anchor));
        self.area.draw(&(EmptyElement::at(place) + text))
    }

    fn line_across(&self, height: f64, colour: &RGBColor) -> Drawn {
        let line = vec![(self.across.start, height), (self.across.end, height)];
        self.area.draw(&PathElement::new(line, colour.stroke_width(2)))
    }

    fn line_up(&self, at: f64, major: bool) -> Drawn {
        let colour = if major { GRID } else { FINE_GRID };
        let line = vec![(at, self.up.start), (at, self.up.end)];
        self.area.draw(&PathElement::new(line, colour.stroke_width(2)))
    }
}

/// A line of a logarithmic grid.
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

/// Every line of the grid in `range` of logarithms; a short axis has labels between the decades too, a very long
/// one only at some of them.
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
    let raised = |letter: char| match letter {
        '-' => '⁻',
        '0' => '⁰',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        '4' => '⁴',
        '5' => '⁵',
        '6' => '⁶',
        '7' => '⁷',
        '8' => '⁸',
        '9' => '⁹',
        other => other,
    };
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
    fn a_span_of_nothing_is_still_an_axis() {
        assert_eq!(span(std::iter::empty(), 0.1), 0.0..1.0);
        assert_eq!(span([2.0].into_iter(), 0.1), 1.5..2.5);
        assert_eq!(span([0.0, 1.0].into_iter(), 0.1), -0.1..1.1);
    }
}
