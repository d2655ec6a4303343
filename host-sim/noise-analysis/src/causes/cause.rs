//! A cause, and what each channel shows of it.

use crate::findings::{Effect, Parameter};

/// What one channel shows of a cause.
pub(super) struct Shown {
    /// Position of the channel in the report.
    pub channel: usize,
    /// The effect by which the channel reports the cause.
    pub effect: Effect,
    /// The effects that it stands for: itself, or the harmonics of a periodic signal.
    pub parts: Vec<Effect>,
}

/// A cause, with the channels that show it in the order of the report.
pub(super) struct Cause {
    pub shown: Vec<Shown>,
}

impl Cause {
    /// The channel that shows the cause most clearly: whose principal parameter has the narrowest interval for its value. Of
    /// a line that has a width in some channels it is one of these: a channel in which it is weaker may not resolve it.
    pub(super) fn clearest(&self) -> &Shown {
        let has_width = |shown: &&Shown| shown.effect.kind == "resonance";
        let of_width = self.shown.iter().filter(has_width).reduce(narrower);
        of_width.unwrap_or_else(|| self.shown[1..].iter().fold(&self.shown[0], narrower))
    }
}

fn narrower<'s>(best: &'s Shown, next: &'s Shown) -> &'s Shown {
    let width = |shown: &Shown| shown.effect.parameters.values().map(relative_width).fold(f64::INFINITY, size_width);
    if width(next) < width(best) { next } else { best }
}

/// Width of the interval of a parameter over its value, of one that says how large an effect is.
fn relative_width(parameter: &Parameter) -> Option<f64> {
    let is_size = !matches!(parameter.unit.as_str(), "s" | "Hz" | "") && parameter.value != 0.0;
    is_size.then(|| (parameter.high - parameter.low) / parameter.value.abs())
}

fn size_width(least: f64, width: Option<f64>) -> f64 {
    width.map_or(least, |width| least.min(width))
}
