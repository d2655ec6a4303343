//! An axis of a figure: linear or logarithmic, with its ticks at round values.

use crate::rounding::{column_prefix, extremes, significant};

/// Values from `from` to `to` along pixels from `start` to `end`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Axis {
    pub label: String,
    pub is_logarithmic: bool,
    pub from: f64,
    pub to: f64,
    pub start: f64,
    pub end: f64,
}

/// Without a label: a fine line of a logarithmic grid.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Tick {
    pub value: f64,
    pub label: Option<String>,
}

pub(super) fn has_logarithm(value: f64) -> bool {
    value.is_finite() && value > 0.0
}

const LEAST_DECADES: f64 = 0.4;
const MOST_DECADES: f64 = 40.0;

impl Axis {
    /// Logarithmic over the `values` it can show, a twentieth wider at both ends.
    pub(super) fn logarithmic(label: &str, values: impl Iterator<Item = f64>, pixels: [f64; 2]) -> Self {
        let (mut low, mut high) = extremes(values.filter(|value| has_logarithm(*value)).map(f64::log10));
        if !(low.is_finite() && high.is_finite()) {
            (low, high) = (0.0, 1.0);
        }
        low = low.max(high - MOST_DECADES);
        let margin = 0.05 * (high - low) + ((LEAST_DECADES - (high - low)) / 2.0).max(0.0);
        let [from, to] = [low - margin, high + margin].map(|log| 10f64.powf(log.clamp(-300.0, 300.0)));
        Self { label: label.to_owned(), is_logarithmic: true, from, to, start: pixels[0], end: pixels[1] }
    }

    /// Linear over `values`, a twentieth wider at both ends.
    pub(super) fn linear(label: &str, values: impl Iterator<Item = f64>, pixels: [f64; 2]) -> Self {
        let (mut low, mut high) = extremes(values.filter(|value| value.is_finite()));
        if !(low.is_finite() && high.is_finite() && (high - low).is_finite()) {
            (low, high) = (0.0, 1.0);
        }
        if high == low {
            let half = if low == 0.0 { 1.0 } else { low.abs() };
            (low, high) = (low - half, high + half);
        }
        let margin = 0.05 * (high - low);
        let (from, to) = (low - margin, high + margin);
        Self { label: label.to_owned(), is_logarithmic: false, from, to, start: pixels[0], end: pixels[1] }
    }

    pub(super) fn between(mut self, from: f64, to: f64) -> Self {
        (self.from, self.to) = (from, to);
        self
    }

    /// `None` outside of the axis.
    pub(super) fn at(&self, value: f64) -> Option<f64> {
        let pixel = self.unbounded(value)?;
        let (low, high) = self.ends();
        (low - 0.5..=high + 0.5).contains(&pixel).then_some(pixel)
    }

    fn ends(&self) -> (f64, f64) {
        (self.start.min(self.end), self.start.max(self.end))
    }

    /// Up to one axis length outside.
    pub(super) fn unclipped(&self, value: f64) -> Option<f64> {
        let (low, high) = self.ends();
        self.unbounded(value).map(|pixel| pixel.clamp(2.0 * low - high, 2.0 * high - low))
    }

    /// Moved to the nearer end if outside.
    pub(super) fn clamped(&self, value: f64) -> Option<f64> {
        let value = if self.is_logarithmic && value == 0.0 { self.from } else { value };
        let (low, high) = self.ends();
        self.unbounded(value).map(|pixel| pixel.clamp(low, high))
    }

    fn unbounded(&self, value: f64) -> Option<f64> {
        let part = if self.is_logarithmic {
            has_logarithm(value).then(|| (value / self.from).ln() / (self.to / self.from).ln())?
        } else {
            (value - self.from) / (self.to - self.from)
        };
        part.is_finite().then_some(self.start + part * (self.end - self.start))
    }

    /// Name, and unit with the prefix of the ticks.
    pub(super) fn title(&self) -> String {
        match self.label.rsplit_once(", ") {
            Some((name, unit)) => format!("{name}, {}{unit}", self.prefix().0),
            None => self.label.clone(),
        }
    }

    fn prefix(&self) -> (&'static str, f64) {
        const WITHOUT: [&str; 7] = ["s", "min", "h", "d", "Hz", "°C", "σ"];
        match self.label.rsplit_once(", ") {
            Some((_, unit)) if !WITHOUT.contains(&unit) => column_prefix([self.from.abs(), self.to.abs()].into_iter()),
            _ => ("", 1.0),
        }
    }

    pub(super) fn ticks(&self) -> Vec<Tick> {
        if self.is_logarithmic { self.decades() } else { self.steps() }
    }

    /// Lines at `digit · 10^decade`, labelled between decades if fewer than three.
    fn decades(&self) -> Vec<Tick> {
        let (first, last) = (self.from.log10().floor() as i32, self.to.log10().ceil() as i32);
        let inside = |value: f64| value >= self.from * (1.0 - 1e-9) && value <= self.to * (1.0 + 1e-9);
        let shown = (first..=last).filter(|decade| inside(10f64.powi(*decade))).count();
        let every = 1 + last.saturating_sub(first) / 10;
        let is_labelled = |decade: i32, digit: u8| match digit {
            1 => decade % every == 0,
            2 | 5 => shown < 3,
            _ => shown == 0,
        };
        let factor = self.prefix().1;
        let shift = factor.log10().round() as i32;
        let is_plain = self.from >= factor * 1e-4 * (1.0 - 1e-9) && self.to < factor * 1e5;
        let grid = (first..=last).flat_map(|decade| (1..=9_u8).map(move |digit| (decade, digit)));
        grid.map(|(decade, digit)| (decade, digit, f64::from(digit) * 10f64.powi(decade)))
            .filter(|(_, digit, value)| inside(*value) && (every == 1 || *digit == 1))
            .map(|(decade, digit, value)| Tick {
                value,
                label: is_labelled(decade, digit).then(|| decade_label(digit, decade - shift, is_plain)),
            })
            .collect()
    }

    /// Lines at multiples of 1, 2 or 5 times a power of ten, about five.
    fn steps(&self) -> Vec<Tick> {
        let factor = self.prefix().1;
        let rough = (self.to - self.from) / factor / 5.0;
        let power = 10f64.powf(rough.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0].into_iter().map(|digit| digit * power).find(|step| *step >= rough);
        let step = step.unwrap_or(rough);
        let decimals = (-step.log10().floor()).clamp(0.0, 12.0) as usize;
        let (first, last) = ((self.from / factor / step).ceil(), (self.to / factor / step).floor());
        let count = (last - first).clamp(-1.0, 50.0) as i64 + 1;
        (0..count)
            .map(|index| {
                let value = (first + index as f64) * step;
                let text = format!("{value:.decimals$}");
                let is_zero = text.trim_start_matches('-').bytes().all(|digit| matches!(digit, b'0' | b'.'));
                let label = if is_zero { "0".to_owned() } else { text.replace('-', "−") };
                Tick { value: factor * value, label: Some(label) }
            })
            .collect()
    }
}

/// `0.002` or `2·10⁻³`, the same for all labels of an axis.
fn decade_label(digit: u8, decade: i32, is_plain: bool) -> String {
    if is_plain {
        return significant(f64::from(digit) * 10f64.powi(decade), 1);
    }
    let power = format!("10{}", superscript(decade));
    if digit == 1 { power } else { format!("{digit}·{power}") }
}

fn superscript(value: i32) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let raised = |letter: char| letter.to_digit(10).map_or('⁻', |digit| DIGITS[digit as usize]);
    value.to_string().chars().map(raised).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis) -> Vec<String> {
        axis.ticks().into_iter().filter_map(|tick| tick.label).collect()
    }

    #[test]
    fn decades_are_labelled() {
        let axis = Axis::logarithmic("", [1e-3, 1e4].into_iter(), [0.0, 100.0]);
        assert_eq!(labels(&axis), ["0.001", "0.01", "0.1", "1", "10", "100", "1,000", "10,000"]);
        let tiny = Axis::logarithmic("", [2e-7, 3e-6].into_iter(), [0.0, 100.0]);
        assert_eq!(labels(&tiny), ["2·10⁻⁷", "5·10⁻⁷", "10⁻⁶", "2·10⁻⁶"]);
        let wide = Axis::logarithmic("", [1e-5, 1e-1].into_iter(), [0.0, 100.0]);
        assert_eq!(labels(&wide), ["10⁻⁵", "10⁻⁴", "10⁻³", "10⁻²", "10⁻¹"]);
    }

    #[test]
    fn steps_are_round() {
        let axis = Axis::linear("", [-0.3, 0.41].into_iter(), [100.0, 0.0]);
        assert_eq!(labels(&axis), ["−0.2", "0", "0.2", "0.4"]);
    }

    #[test]
    fn small_values_have_a_prefix() {
        let bias = Axis::linear("bias, g", [-0.003, 0.0041].into_iter(), [100.0, 0.0]);
        assert_eq!(
            (bias.title().as_str(), labels(&bias)),
            ("bias, mg", ["−2", "0", "2", "4"].map(str::to_owned).to_vec())
        );
        let curve = Axis::logarithmic("σ(τ), g", [2e-4, 3e-2].into_iter(), [0.0, 100.0]);
        assert_eq!(
            (curve.title().as_str(), labels(&curve)),
            ("σ(τ), mg", ["0.2", "0.5", "1", "2", "5", "10", "20"].map(str::to_owned).to_vec())
        );
        let time = Axis::logarithmic("τ, s", [0.01, 0.09].into_iter(), [0.0, 100.0]);
        assert_eq!(time.title(), "τ, s");
    }

    #[test]
    fn values_are_where_the_axis_says() {
        let axis = Axis::logarithmic("", std::iter::empty(), [0.0, 100.0]).between(1.0, 100.0);
        assert_eq!(axis.at(10.0), Some(50.0));
        assert_eq!(axis.at(1000.0), None);
        assert_eq!(axis.clamped(1000.0), Some(100.0));
        assert_eq!(axis.clamped(0.0), Some(0.0));
        assert_eq!(axis.at(f64::NAN), None);
        let odd = Axis::linear("", [f64::MAX, f64::MIN].into_iter(), [0.0, 100.0]);
        assert!(odd.from < odd.to && odd.to.is_finite());
    }
}
