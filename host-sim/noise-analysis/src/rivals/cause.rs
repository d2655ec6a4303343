//! A cause, and what each channel shows of it.

use crate::bounds::BoundedEstimate;
use crate::effects::Effect;

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
    /// Position of the channel that shows the cause most clearly: one of whose sizes has the narrowest interval for its value. Of
    /// a line that has a width in some channels it is one of these: a channel in which it is weaker may not resolve it.
    pub(super) fn clearest(&self) -> usize {
        let positions = 0..self.shown.len();
        let of_width = positions.clone().filter(|at| matches!(self.shown[*at].effect, Effect::ResonantLine(_)));
        let narrower = |best: usize, next: usize| if self.width(next) < self.width(best) { next } else { best };
        of_width.reduce(narrower).or_else(|| positions.reduce(narrower)).unwrap_or(0)
    }

    /// The least width of the interval of a size over its value.
    fn width(&self, at: usize) -> f64 {
        let relative = |of: BoundedEstimate| (of.value != 0.0).then(|| (of.high - of.low) / of.value.abs());
        self.shown[at].effect.sizes().filter_map(relative).fold(f64::INFINITY, f64::min)
    }
}
