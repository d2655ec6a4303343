//! What the amplitudes of the harmonics of a periodic signal say of its form: a square wave, a sinusoid, or neither.

use super::line::{Frequency, Line};
use crate::bounds::{BoundedEstimate, ChannelEstimate};
use crate::distributions::{NORMAL_975, upper_tail};
use crate::effects::{Effect, LineSource, Multiples, Periodic, ResonantLine, SinusoidalLine, SquareWave};
use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_4;

/// Standard deviations within which the harmonics of a square wave have the amplitudes of one.
pub(super) const SQUARE_SIGMAS: f64 = 3.0;
/// Largest part by which an amplitude may differ from that of a square wave beyond its error: edges that take a tenth of a
/// period lower the fifth harmonic by `1 − sinc(5/10)` = 0.36.
pub(super) const SQUARE_TOLERANCE: f64 = 0.36;
/// Probability that an unrelated line has the amplitude of a harmonic of a square wave within [`SQUARE_TOLERANCE`], if
/// amplitudes are spread evenly over the logarithm of two decades: ln(1.36/0.64)/ln 100.
pub(super) const SQUARE_BY_CHANCE: f64 = 0.164;

/// Least deviation of the higher harmonics of a signal that is no sinusoid, over that of its fundamental: that of a square wave,
/// `√(π²/8 − 1)`.
const NO_SINUSOID: f64 = 0.483;

/// What a line is to the fundamental.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Multiple {
    /// The line at so many times its frequency.
    Harmonic(u32),
    /// A line beside such a multiple, at the distance of the modulation.
    Sideband,
}

impl Multiple {
    /// The number of the harmonic.
    fn harmonic(self) -> Option<u32> {
        match self {
            Self::Harmonic(number) => Some(number),
            Self::Sideband => None,
        }
    }
}

/// The lines of each channel among these frequencies.
pub(super) fn by_channel<'f>(
    members: impl IntoIterator<Item = (Multiple, &'f Frequency)>,
) -> BTreeMap<usize, Vec<(Multiple, Line)>> {
    let mut channels: BTreeMap<usize, Vec<(Multiple, Line)>> = BTreeMap::new();
    for (multiple, frequency) in members {
        for line in &frequency.lines {
            channels.entry(line.channel).or_default().push((multiple, line.clone()));
        }
    }
    channels
}

fn amplitude_of(lines: &[(Multiple, Line)], harmonic: u32) -> Option<ChannelEstimate> {
    Some(lines.iter().find(|(multiple, _)| *multiple == Multiple::Harmonic(harmonic))?.1.amplitude)
}

/// Whether the lines of a channel have the amplitudes of a square wave: 1/k at the odd multiples k, the first and the third
/// among them, and none at even ones that a wave with two unequal halves would have to show.
pub(super) fn is_square(lines: &[(Multiple, Line)]) -> bool {
    let (Some(first), Some(_)) = (amplitude_of(lines, 1), amplitude_of(lines, 3)) else { return false };
    let error = |of: &ChannelEstimate| (of.high - of.low) / (2.0 * NORMAL_975);
    let has_size = |(multiple, line): &(Multiple, Line)| {
        let Multiple::Harmonic(multiple) = *multiple else { return true };
        let amplitude = line.amplitude;
        let expected = first.value / f64::from(multiple);
        if multiple.is_multiple_of(2) {
            return amplitude.value < SQUARE_TOLERANCE * expected;
        }
        let joint = error(&amplitude).hypot(error(&first) / f64::from(multiple));
        (amplitude.value - expected).abs() < SQUARE_TOLERANCE * expected + SQUARE_SIGMAS * joint
    };
    lines.iter().all(has_size)
}

/// Whether the lines of a channel are those of a signal that is the same every period and no sinusoid: a steady fundamental, its second
/// and its third harmonic, and higher harmonics with at least the part [`NO_SINUSOID`] of its deviation.
pub(super) fn is_no_sinusoid(lines: &[(Multiple, Line)]) -> bool {
    let Some(fundamental) = fundamental(lines).filter(|of| matches!(of.effect, Effect::SinusoidalLine(_))) else {
        return false;
    };
    let shows = |harmonic: u32| amplitude_of(lines, harmonic).is_some();
    shows(2) && shows(3) && over_fundamental(lines, fundamental, |of| of.value) > NO_SINUSOID
}

/// The signal of these lines of a channel, if they have a fundamental and higher harmonics.
pub(super) fn no_sinusoid(lines: &[(Multiple, Line)]) -> Option<Effect> {
    let line = fundamental(lines)?;
    let percent = |of: fn(&ChannelEstimate) -> f64| 100.0 * over_fundamental(lines, line, of);
    let highest = higher(lines).filter_map(|(multiple, _)| multiple.harmonic()).max()?;
    let amplitude = |harmonic: u32| amplitude_of(lines, harmonic).map_or(0.0, |of| of.value);
    // An ordinate over the noise is half of the likelihood ratio of its line.
    let over_noise = |(_, line): &(Multiple, Line)| match line.evidence.source {
        LineSource::Spectrum(of) => 0.5 * of.sigmas * of.sigmas,
        LineSource::Curve(_) => 0.0,
    };
    let p_value = match line.evidence.source {
        LineSource::Spectrum(of) => of.p_value,
        LineSource::Curve(of) => 2.0 * upper_tail(of.gain_sigmas),
    };
    let periodic = Periodic {
        frequency_hz: line.frequency_hz,
        amplitude: line.amplitude,
        harmonics_percent: BoundedEstimate::new(percent(|of| of.value), percent(|of| of.low), percent(|of| of.high)),
        harmonics: (2..=highest).map(amplitude).collect(),
        sum: higher(lines).map(over_noise).sum(),
        p_value,
    };
    Some(periodic.into())
}

/// The line at the fundamental.
fn fundamental(lines: &[(Multiple, Line)]) -> Option<&Line> {
    lines.iter().find(|(multiple, _)| *multiple == Multiple::Harmonic(1)).map(|(_, line)| line)
}

/// The lines at higher multiples.
fn higher(lines: &[(Multiple, Line)]) -> impl Iterator<Item = &(Multiple, Line)> {
    lines.iter().filter(|(multiple, _)| matches!(multiple, Multiple::Harmonic(2..)))
}

/// Deviation of the higher harmonics over that of the fundamental.
fn over_fundamental(lines: &[(Multiple, Line)], fundamental: &Line, of: impl Fn(&ChannelEstimate) -> f64) -> f64 {
    higher(lines).map(|(_, line)| of(&line.amplitude).powi(2)).sum::<f64>().sqrt() / fundamental.amplitude.value
}

/// The square wave whose lowest odd harmonic in a channel is among `lines`. A square wave of amplitude A, half the distance of
/// its levels, has the harmonics 4A/(πk).
pub(super) fn square_wave(lines: &[(Multiple, Line)]) -> Option<Effect> {
    let (harmonic, line) = lines.iter().find_map(|(multiple, line)| match *multiple {
        Multiple::Harmonic(harmonic) if !harmonic.is_multiple_of(2) => Some((harmonic, line)),
        _ => None,
    })?;
    let square = SquareWave {
        frequency_hz: line.frequency_hz.scaled(1.0 / f64::from(harmonic)),
        amplitude: line.amplitude.scaled(FRAC_PI_4 * f64::from(harmonic)),
        multiples: multiples(lines),
        line: line.evidence,
    };
    Some(square.into())
}

/// The lowest of the lines of a channel, with the numbers of all.
pub(super) fn periodic(lines: &[(Multiple, Line)]) -> Effect {
    let multiples = (lines.len() > 1).then(|| multiples(lines));
    match lines[0].1.effect.clone() {
        Effect::SinusoidalLine(line) => SinusoidalLine { multiples, ..line }.into(),
        Effect::ResonantLine(line) => ResonantLine { multiples, ..line }.into(),
        other => other,
    }
}

/// What these lines are to the fundamental.
fn multiples(lines: &[(Multiple, Line)]) -> Multiples {
    let harmonics: Vec<u32> = lines.iter().filter_map(|(multiple, _)| multiple.harmonic()).collect();
    Multiples { sidebands: lines.len() - harmonics.len(), harmonics }
}
