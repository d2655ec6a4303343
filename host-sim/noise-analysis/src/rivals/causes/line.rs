//! Lines of the spectrum that channels show, by their frequency.

use super::grouping::join;
use crate::bounds::{BoundedEstimate, ChannelEstimate};
use crate::effects::{Effect, LineEvidence};
use std::f64::consts::{PI, SQRT_2};

/// Quantile of the normal distribution for a two-sided level of 1 %: equal frequencies are farther apart once in a hundred.
pub(super) const NORMAL_995: f64 = 2.576;

/// The place of a line in a comb: k·f₀ + j·Δ, with the frequency f₀ of the fundamental and Δ of the modulation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Tooth {
    /// k, from 1 on.
    pub harmonic: u32,
    /// j, 0 at a harmonic.
    pub sideband: i32,
}

impl Tooth {
    pub(super) const FUNDAMENTAL: Self = Self { harmonic: 1, sideband: 0 };

    /// The number of the harmonic; `None` of a sideband.
    pub(super) fn multiple(self) -> Option<u32> {
        (self.sideband == 0).then_some(self.harmonic)
    }
}

/// A line of one channel.
#[derive(Clone)]
pub(super) struct Line {
    pub(super) channel: usize,
    pub(super) effect: Effect,
    pub(super) evidence: LineEvidence,
    /// Hz, with its bounds.
    pub(super) frequency_hz: BoundedEstimate,
    /// Hz.
    pub(super) frequency: f64,
    /// Standard deviation of the frequency, Hz.
    pub(super) error: f64,
    /// Amplitude of a sinusoid of the line's power.
    pub(super) amplitude: ChannelEstimate,
    /// Full width at half maximum, Hz.
    width: f64,
}

impl Line {
    /// `None` of what is no line.
    fn new(channel: usize, effect: &Effect) -> Option<Self> {
        let (frequency_hz, amplitude, width, evidence) = match effect {
            Effect::SinusoidalLine(of) => (of.frequency_hz, of.amplitude, 0.0, of.evidence),
            Effect::ResonantLine(of) => {
                (of.frequency_hz, of.deviation.scaled(SQRT_2), of.bandwidth_hz.value, of.evidence)
            }
            _ => return None,
        };
        Some(Self {
            channel,
            effect: effect.clone(),
            evidence,
            frequency_hz,
            frequency: frequency_hz.value,
            error: frequency_hz.error(),
            amplitude,
            width,
        })
    }

    /// Standard deviation of the frequency in a record of `duration_s`, Hz, without the error of the sample rate, which lines of one
    /// record share: `√3/(πT)` times the relative error of the amplitude (D. Rife and R. Boorstyn, "Single-tone parameter
    /// estimation from discrete-time observations", IEEE Trans. Inf. Theory 20, 1974).
    pub(super) fn error_by_amplitude(&self, duration_s: f64) -> f64 {
        let relative = self.amplitude.error() / self.amplitude.value.max(f64::MIN_POSITIVE);
        (3f64.sqrt() / (PI * duration_s) * relative).min(self.error)
    }
}

/// Lines of several channels at one frequency.
pub(super) struct Frequency {
    pub(super) lines: Vec<Line>,
}

impl Frequency {
    /// The lines of the effects of all channels in a record of `duration_s`, by their frequency.
    pub(super) fn all(channels: &[(&str, &[Effect])], duration_s: f64) -> Vec<Self> {
        let lines = channels
            .iter()
            .enumerate()
            .flat_map(|(channel, (_, effects))| effects.iter().filter_map(move |effect| Line::new(channel, effect)));
        let mut groups: Vec<Vec<Line>> = Vec::new();
        let is_same =
            |known: &Line, line: &Line| (known.frequency - line.frequency).abs() < reach(known, line, duration_s);
        lines.for_each(|line| join(&mut groups, is_same, line));
        let mut frequencies: Vec<Self> = groups.into_iter().map(|lines| Self { lines }).collect();
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

/// Largest distance of two lines of one frequency: their joint error, half their widths, and the resolution of the record.
fn reach(line: &Line, other: &Line, duration_s: f64) -> f64 {
    NORMAL_995 * line.error.hypot(other.error) + 0.5 * line.width.max(other.width) + 1.0 / duration_s
}
