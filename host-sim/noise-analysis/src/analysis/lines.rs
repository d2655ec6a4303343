//! The lines of a spectrum as terms of the model. One that wanders leaves many: they are taken together.

use crate::findings::MeasuredValue;
use crate::series::Series;
use crate::spectra;
use crate::uniform_series::UniformSeries;
use allan_core::Model;
use allan_core::term::{NoiseTerm, Resonance, Sinusoid};

/// Lines closer than this share of their frequency, or than a few of their widths, are one that wanders.
const NEAR: f64 = 0.03;
const NEAR_WIDTHS: f64 = 3.0;
/// Resolutions within which a sinusoid and what its taper leaves beside it are one.
const NEAR_RESOLUTIONS: f64 = 8.0;
/// A resonance is at a frequency of so many of its widths or higher.
const BROADEST: f64 = 1.5;
/// Noise beside a Markov process is at least this part of it.
const LEAST_NOISE: f64 = 1e-6;
/// A line that is wider than this part of its frequency may be the background's own form.
const BROAD: f64 = 0.1;
/// A line that changes its phase more seldom than so many times in the record is as good as steady.
const CHANGES: f64 = 30.0;

/// Relative standard deviation of the clock that the sample rate was measured with: a crystal to ±100 ppm.
const CLOCK: f64 = 5e-5;

/// A line, or several that are one.
#[derive(Debug, Clone, Copy)]
pub(super) struct Line {
    /// Hz.
    pub frequency: MeasuredValue,
    /// Standard deviation of its signal, in the channel's unit.
    pub deviation: MeasuredValue,
    /// Full width at half maximum, Hz; 0 where it is no wider than the record resolves.
    pub width: MeasuredValue,
    /// −2 log-likelihood ratio.
    pub statistic: f64,
    /// Of the strongest by chance anywhere.
    pub p_value: f64,
    duration_s: f64,
}

/// The lines of a series, the strongest first, over a background that `known` describes or, without it, over any of
/// white, flicker and walking noise.
pub(super) fn of(series: &Series, known: Option<&Model>) -> Vec<Line> {
    let duration_s = series.duration_s();
    let is_line = |line: &spectra::SpectralLine| {
        let finite = line.frequency.error.is_finite() && line.deviation.error.is_finite();
        // Broader than high up: that is a Markov process, and the curve's.
        finite && line.frequency.value > BROADEST * line.width.map_or(0.0, |width| width.value)
    };
    let mut rest: Vec<spectra::SpectralLine> = found(series, known).into_iter().filter(is_line).collect();
    let mut lines = Vec::new();
    while let Some(strongest) = rest.first().copied() {
        let reach = NEAR_WIDTHS * strongest.width.map_or(0.0, |width| width.value);
        let reach = reach.max(NEAR_RESOLUTIONS / duration_s);
        let same = |line: &spectra::SpectralLine| {
            let distance = (line.frequency.value - strongest.frequency.value).abs();
            // Two steady lines stay two, however near.
            let wanders = line.width.is_some() || strongest.width.is_some();
            distance < reach || (wanders && distance < NEAR * strongest.frequency.value)
        };
        let (one, others): (Vec<_>, Vec<_>) = rest.into_iter().partition(same);
        lines.push(Line::together(&one, duration_s));
        rest = others;
    }
    lines
}

fn found(series: &Series, known: Option<&Model>) -> Vec<spectra::SpectralLine> {
    let grid = UniformSeries::from_series(series);
    match known {
        Some(model) => spectra::find_lines_over(&grid, |frequency| background(model, frequency)),
        None => spectra::find_lines(&grid),
    }
}

/// By how much the Markov terms of a model raise the density of its other noise.
fn background(model: &Model, frequency: f64) -> f64 {
    let part = |of: &dyn Fn(&NoiseTerm) -> bool| {
        let terms = model.terms().iter().copied().filter(|term| of(&term.kind));
        Model::new(model.sample_period(), terms).density(frequency)
    };
    let markov = part(&|kind| matches!(kind, NoiseTerm::Markov(_)));
    let noise = part(&|kind| !matches!(kind, NoiseTerm::Markov(_) | NoiseTerm::Resonance(_) | NoiseTerm::Sinusoid(_)));
    // Where a filter leaves nothing, rounding does.
    1.0 + markov / noise.max(LEAST_NOISE * markov)
}

/// The terms that a trace may add for them.
pub(super) fn kinds(lines: &[Line]) -> Vec<NoiseTerm> {
    lines.iter().map(Line::kind).collect()
}

impl Line {
    /// Of the same power and mean frequency, as wide as what is taken together.
    fn together(lines: &[spectra::SpectralLine], duration_s: f64) -> Self {
        let power = |line: &spectra::SpectralLine| line.deviation.value * line.deviation.value;
        let total: f64 = lines.iter().map(power).sum();
        let mean = |of: &dyn Fn(&spectra::SpectralLine) -> f64| {
            lines.iter().map(|line| power(line) * of(line)).sum::<f64>() / total
        };
        let frequency = mean(&|line| line.frequency.value);
        let spread = mean(&|line| (line.frequency.value - frequency).powi(2)).sqrt();
        let own = mean(&|line| line.width.map_or(0.0, |width| width.value));
        let width_error = mean(&|line| line.width.map_or(0.0, |width| width.error));
        let strongest = lines[0];
        Self {
            frequency: MeasuredValue {
                value: frequency,
                error: strongest.frequency.error.max(spread).hypot(CLOCK * frequency),
            },
            deviation: MeasuredValue {
                value: total.sqrt(),
                error: strongest.deviation.error * total.sqrt() / strongest.deviation.value,
            },
            // 2.35 standard deviations are the width of a normal bell at half its height.
            width: MeasuredValue { value: own.hypot(2.35 * spread), error: width_error.hypot(spread) },
            statistic: lines.iter().map(|line| line.statistic).fold(0.0, f64::max),
            p_value: lines.iter().map(|line| line.p_value).fold(1.0, f64::min),
            duration_s,
        }
    }

    /// Whether both are at one frequency.
    pub(super) fn is_same(&self, other: &Self) -> bool {
        let reach = self.width.value.max(other.width.value).max(NEAR_RESOLUTIONS / self.duration_s);
        (self.frequency.value - other.frequency.value).abs() < reach
    }

    /// Whether it is a sinusoid.
    pub(super) fn is_steady(&self) -> bool {
        matches!(self.kind(), NoiseTerm::Sinusoid(_))
    }

    /// Whether it is broad enough to be taken for a part of the background, and the reverse.
    pub(super) fn is_broad(&self) -> bool {
        self.width.value > BROAD * self.frequency.value
    }

    /// A sinusoid, or a resonance where the phase is lost often.
    pub(super) fn kind(&self) -> NoiseTerm {
        let (frequency, bandwidth) = (self.frequency.value, self.width.value);
        if bandwidth * self.duration_s < CHANGES {
            NoiseTerm::Sinusoid(Sinusoid { frequency })
        } else {
            NoiseTerm::Resonance(Resonance { frequency, bandwidth })
        }
    }
}
