//! Lines of the spectrum that channels show, by their frequency.

use crate::distributions::NORMAL_975;
use crate::findings::{Effect, Parameter};
use std::f64::consts::{PI, SQRT_2};

/// Quantile of the normal distribution for a two-sided level of 1 %: equal frequencies are farther apart once in a hundred.
pub(super) const NORMAL_995: f64 = 2.576;

/// Whether an effect is a line of the spectrum.
pub(super) fn is_line(effect: &Effect) -> bool {
    matches!(effect.kind.as_str(), "sinusoid" | "resonance")
}

/// A line of one channel.
#[derive(Clone)]
pub(super) struct Line {
    pub(super) channel: usize,
    pub(super) effect: Effect,
    /// Hz.
    pub(super) frequency: f64,
    /// Standard deviation of the frequency, Hz.
    pub(super) error: f64,
    /// Full width at half maximum, Hz.
    width: f64,
}

impl Line {
    fn new(channel: usize, effect: &Effect) -> Option<Self> {
        let frequency = effect.parameters.get("frequency")?;
        Some(Self {
            channel,
            effect: effect.clone(),
            frequency: frequency.value,
            error: (frequency.high - frequency.low) / (2.0 * NORMAL_975),
            width: effect.parameters.get("bandwidth").map_or(0.0, |bandwidth| bandwidth.value),
        })
    }

    /// Standard deviation of the frequency in a record of `duration_s`, Hz, without the error of the sample rate, which lines of one
    /// record share: `√3/(πT)` times the relative error of the amplitude (D. Rife and R. Boorstyn, "Single-tone parameter
    /// estimation from discrete-time observations", IEEE Trans. Inf. Theory 20, 1974).
    pub(super) fn error_by_amplitude(&self, duration_s: f64) -> f64 {
        let relative = |of: Parameter| (of.high - of.low) / (2.0 * NORMAL_975 * of.value.max(f64::MIN_POSITIVE));
        let by_amplitude = self.amplitude().map_or(f64::INFINITY, |of| 3f64.sqrt() / (PI * duration_s) * relative(of));
        by_amplitude.min(self.error)
    }

    /// Amplitude of a sinusoid of the line's power, as a parameter.
    pub(super) fn amplitude(&self) -> Option<Parameter> {
        let parameters = &self.effect.parameters;
        let of_deviation = |of: &Parameter| scaled(of, SQRT_2);
        parameters.get("amplitude").cloned().or_else(|| parameters.get("deviation").map(of_deviation))
    }
}

pub(super) fn scaled(of: &Parameter, factor: f64) -> Parameter {
    Parameter::new(factor * of.value, factor * of.low, factor * of.high, of.unit.clone())
}

/// Lines of several channels at one frequency.
pub(super) struct Frequency {
    pub(super) lines: Vec<Line>,
}

impl Frequency {
    /// The lines of the effects of all channels in a record of `duration_s`, by their frequency.
    pub(super) fn all(channels: &[(&str, &[Effect])], duration_s: f64) -> Vec<Self> {
        let lines = channels.iter().enumerate().flat_map(|(channel, (_, effects))| {
            effects.iter().filter(|effect| is_line(effect)).filter_map(move |effect| Line::new(channel, effect))
        });
        let mut frequencies: Vec<Self> = Vec::new();
        for line in lines {
            let is_same = |known: &&mut Self| {
                let known = known.best();
                (known.frequency - line.frequency).abs() < reach(known, &line, duration_s)
            };
            match frequencies.iter_mut().find(is_same) {
                Some(known) => known.lines.push(line),
                None => frequencies.push(Self { lines: vec![line] }),
            }
        }
        frequencies.sort_by(|a, b| a.best().frequency.total_cmp(&b.best().frequency));
        frequencies
    }

    /// The line whose frequency is known best.
    pub(super) fn best(&self) -> &Line {
        self.lines[1..].iter().fold(&self.lines[0], |best, next| if next.error < best.error { next } else { best })
    }

    /// Full width at half maximum in the channel that shows the widest line, Hz.
    pub(super) fn width(&self) -> f64 {
        self.lines.iter().map(|line| line.width).fold(0.0, f64::max)
    }
}

/// How far two lines of one frequency may be apart: their joint error, half their widths, and the resolution of the record.
fn reach(line: &Line, other: &Line, duration_s: f64) -> f64 {
    NORMAL_995 * line.error.hypot(other.error) + 0.5 * line.width.max(other.width) + 1.0 / duration_s
}
