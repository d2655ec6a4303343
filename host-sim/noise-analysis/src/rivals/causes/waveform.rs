//! What the amplitudes of the harmonics of a periodic signal say of its form: a square wave, a sawtooth, or another one.

use super::line::{Frequency, Line};
use crate::bounds::{BoundedEstimate, ChannelEstimate};
use crate::distributions::NORMAL_975;
use crate::effects::{
    Effect, Multiples, Observation, ResonantLine, SinusoidalLine, SquareWave, Unexplained, UnexplainedPlace,
};
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

/// What a line is to the fundamental.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Multiple {
    /// The line at so many times its frequency.
    Harmonic(u32),
    /// A line beside such a multiple, at the distance of the modulation.
    Sideband,
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
    amplitude_of(lines, 3).is_some() && fall_with_their_number(lines, |multiple| multiple % 2 == 1)
}

/// Whether the lines of a channel have the amplitudes of a signal that rises and jumps: 1/k at every multiple k, the first three
/// among them.
pub(super) fn is_sawtooth(lines: &[(Multiple, Line)]) -> bool {
    [2, 3].iter().all(|harmonic| amplitude_of(lines, *harmonic).is_some()) && fall_with_their_number(lines, |_| true)
}

/// Whether the lines of a channel have amplitudes of 1/k of the first at the multiples k that the signal has, and hardly any at
/// the others.
fn fall_with_their_number(lines: &[(Multiple, Line)], has: impl Fn(u32) -> bool) -> bool {
    let Some(first) = amplitude_of(lines, 1) else { return false };
    let error = |of: &ChannelEstimate| (of.high - of.low) / (2.0 * NORMAL_975);
    let has_size = |(multiple, line): &(Multiple, Line)| {
        let Multiple::Harmonic(multiple) = *multiple else { return true };
        let amplitude = line.amplitude;
        let expected = first.value / f64::from(multiple);
        if !has(multiple) {
            return amplitude.value < SQUARE_TOLERANCE * expected;
        }
        let joint = error(&amplitude).hypot(error(&first) / f64::from(multiple));
        (amplitude.value - expected).abs() < SQUARE_TOLERANCE * expected + SQUARE_SIGMAS * joint
    };
    lines.iter().all(has_size)
}

/// A signal that rises evenly and jumps back: no effect that has a name.
pub(super) fn sawtooth(lines: &[(Multiple, Line)]) -> Option<Effect> {
    let (_, line) = lines.iter().find(|(multiple, _)| *multiple == Multiple::Harmonic(1))?;
    let higher = || lines.iter().filter(|(multiple, _)| *multiple != Multiple::Harmonic(1)).map(|(_, line)| line);
    let lacking = |of: fn(&ChannelEstimate) -> f64| {
        100.0 * higher().map(|line| of(&line.amplitude).powi(2)).sum::<f64>().sqrt() / line.amplitude.value
    };
    let unexplained = Unexplained {
        place: UnexplainedPlace::Frequency(line.frequency_hz),
        excess_percent: Some(BoundedEstimate::new(lacking(|of| of.value), lacking(|of| of.low), lacking(|of| of.high))),
        observation: Observation::Sawtooth { multiples: multiples(lines), line: line.evidence },
    };
    Some(unexplained.into())
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
    let harmonic = |(multiple, _): &(Multiple, Line)| match multiple {
        Multiple::Harmonic(number) => Some(*number),
        Multiple::Sideband => None,
    };
    let harmonics: Vec<u32> = lines.iter().filter_map(harmonic).collect();
    Multiples { sidebands: lines.len() - harmonics.len(), harmonics }
}
