//! The form of a periodic signal by the amplitudes of its lines: a square wave, a modulated line, a sinusoid, or none of these.

use super::line::{Frequency, Line, Tooth};
use crate::bounds::{BoundedEstimate, ChannelEstimate};
use crate::distributions::upper_tail;
use crate::effects::{
    Effect, LineSource, ModulatedLine, ModulationEvidence, Multiples, Periodic, ResonantLine, SinusoidalLine,
    SquareWave,
};
use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_4;

/// Standard deviations within which the harmonics of a square wave have the amplitudes of one.
const SQUARE_SIGMAS: f64 = 3.0;
/// Largest part by which an amplitude may differ from that of a square wave beyond its error: edges that take a tenth of a
/// period lower the fifth harmonic by `1 − sinc(5/10)` = 0.36.
const SQUARE_TOLERANCE: f64 = 0.36;
/// Probability that an unrelated line has the amplitude of a harmonic of a square wave within [`SQUARE_TOLERANCE`], if
/// amplitudes are spread evenly over the logarithm of two decades: ln(1.36/0.64)/ln 100.
pub(super) const SQUARE_BY_CHANCE: f64 = 0.164;

/// Least deviation of the higher harmonics of a signal that is no sinusoid over its fundamental's: a square wave's, `√(π²/8 − 1)`.
const NO_SINUSOID: f64 = 0.483;

pub(super) fn by_channel<'f>(
    members: impl IntoIterator<Item = (Tooth, &'f Frequency)>,
) -> BTreeMap<usize, Vec<(Tooth, Line)>> {
    let mut channels: BTreeMap<usize, Vec<(Tooth, Line)>> = BTreeMap::new();
    for (tooth, frequency) in members {
        for line in &frequency.lines {
            channels.entry(line.channel).or_default().push((tooth, line.clone()));
        }
    }
    channels
}

fn harmonic(lines: &[(Tooth, Line)], number: u32) -> Option<&Line> {
    lines.iter().find(|(tooth, _)| tooth.multiple() == Some(number)).map(|(_, line)| line)
}

fn amplitude_of(lines: &[(Tooth, Line)], number: u32) -> Option<ChannelEstimate> {
    Some(harmonic(lines, number)?.amplitude)
}

/// True if two amplitudes of about this `size` are equal within [`SQUARE_TOLERANCE`] and their errors.
pub(super) fn is_equal(one: ChannelEstimate, other: ChannelEstimate, size: f64) -> bool {
    (one.value - other.value).abs() < SQUARE_TOLERANCE * size + SQUARE_SIGMAS * one.error().hypot(other.error())
}

/// True if the lines of a channel have the amplitudes of a square wave: 1/k at the odd multiples k, the first and the third
/// among them, and none at even ones that a wave with two unequal halves would have to show.
pub(super) fn is_square(lines: &[(Tooth, Line)]) -> bool {
    let (Some(first), Some(_)) = (amplitude_of(lines, 1), amplitude_of(lines, 3)) else { return false };
    let has_size = |(tooth, line): &(Tooth, Line)| {
        let Some(multiple) = tooth.multiple() else { return true };
        let expected = first.scaled(1.0 / f64::from(multiple));
        if multiple.is_multiple_of(2) {
            return line.amplitude.value < SQUARE_TOLERANCE * expected.value;
        }
        is_equal(line.amplitude, expected, expected.value)
    };
    lines.iter().all(has_size)
}

/// True if the lines of a channel are those of a signal that is the same every period and no sinusoid: a steady fundamental, its second
/// and its third harmonic, and higher harmonics with at least the part [`NO_SINUSOID`] of its deviation.
pub(super) fn is_no_sinusoid(lines: &[(Tooth, Line)]) -> bool {
    let Some(fundamental) = harmonic(lines, 1).filter(|of| matches!(of.effect, Effect::SinusoidalLine(_))) else {
        return false;
    };
    let shows = |number: u32| harmonic(lines, number).is_some();
    shows(2) && shows(3) && over_fundamental(lines, fundamental, |of| of.value) > NO_SINUSOID
}

/// The signal of these lines of a channel, if they have a fundamental and higher harmonics.
pub(super) fn no_sinusoid(lines: &[(Tooth, Line)]) -> Option<Effect> {
    let line = harmonic(lines, 1)?;
    let percent = |of: fn(&ChannelEstimate) -> f64| 100.0 * over_fundamental(lines, line, of);
    let highest = higher(lines).filter_map(|(tooth, _)| tooth.multiple()).max()?;
    let amplitude = |number: u32| amplitude_of(lines, number).map_or(0.0, |of| of.value);
    // An ordinate over the noise is half of the likelihood ratio of its line.
    let over_noise = |(_, line): &(Tooth, Line)| match line.evidence.source {
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

/// The lines at higher multiples.
fn higher(lines: &[(Tooth, Line)]) -> impl Iterator<Item = &(Tooth, Line)> {
    lines.iter().filter(|(tooth, _)| matches!(tooth.multiple(), Some(2..)))
}

/// Deviation of the higher harmonics over that of the fundamental.
fn over_fundamental(lines: &[(Tooth, Line)], fundamental: &Line, of: impl Fn(&ChannelEstimate) -> f64) -> f64 {
    higher(lines).map(|(_, line)| of(&line.amplitude).powi(2)).sum::<f64>().sqrt() / fundamental.amplitude.value
}

/// The square wave whose lowest odd harmonic in a channel is among `lines`. A square wave of amplitude A, half the distance of
/// its levels, has the harmonics 4A/(πk).
pub(super) fn square_wave(lines: &[(Tooth, Line)]) -> Option<Effect> {
    let mut harmonics = lines.iter().filter_map(|(tooth, line)| Some((tooth.multiple()?, line)));
    let (multiple, line) = harmonics.find(|(multiple, _)| !multiple.is_multiple_of(2))?;
    let square = SquareWave {
        frequency_hz: line.frequency_hz.scaled(1.0 / f64::from(multiple)),
        amplitude: line.amplitude.scaled(FRAC_PI_4 * f64::from(multiple)),
        multiples: multiples(lines),
        line: line.evidence,
    };
    Some(square.into())
}

/// A line whose amplitude changes, by the lines at its frequency and beside it in all channels; `None` if there are others, or it is alone.
pub(super) fn modulated_line(members: &[(Tooth, Frequency)]) -> Option<Effect> {
    let line = |sideband: i32| {
        let tooth = Tooth { sideband, ..Tooth::FUNDAMENTAL };
        members.iter().find(|(of, _)| *of == tooth).map(|(_, frequency)| frequency.best())
    };
    let [below, line, above] = [line(-1)?, line(0)?, line(1)?];
    // The amplitude of either sideband is half the depth of that of the line.
    let depth = |of: fn(&ChannelEstimate) -> f64| {
        (of(&below.amplitude) + of(&above.amplitude)) / line.amplitude.value.max(f64::MIN_POSITIVE)
    };
    let change_hz = |above: f64, below: f64| 0.5 * (above - below);
    let [upper, lower] = [above.frequency_hz, below.frequency_hz];
    let change_hz = BoundedEstimate::new(
        change_hz(upper.value, lower.value),
        change_hz(upper.low, lower.high).max(0.0),
        change_hz(upper.high, lower.low),
    );
    let modulated = ModulatedLine {
        frequency_hz: line.frequency_hz,
        amplitude: line.amplitude,
        depth: BoundedEstimate::new(depth(|of| of.value), depth(|of| of.low), depth(|of| of.high)),
        period_s: change_hz.inverse(),
        of_phase: false,
        evidence: ModulationEvidence::Sidebands(line.evidence),
    };
    members.iter().all(|(tooth, _)| tooth.harmonic == 1).then(|| modulated.into())
}

/// The lowest of the lines of a channel, with the numbers of all.
pub(super) fn periodic(lines: &[(Tooth, Line)]) -> Effect {
    let multiples = (lines.len() > 1).then(|| multiples(lines));
    match lines[0].1.effect.clone() {
        Effect::SinusoidalLine(line) => SinusoidalLine { multiples, ..line }.into(),
        Effect::ResonantLine(line) => ResonantLine { multiples, ..line }.into(),
        other => other,
    }
}

fn multiples(lines: &[(Tooth, Line)]) -> Multiples {
    let harmonics: Vec<u32> = lines.iter().filter_map(|(tooth, _)| tooth.multiple()).collect();
    Multiples { sidebands: lines.len() - harmonics.len(), harmonics }
}
