//! What the amplitudes of the harmonics of a periodic signal say of its form: a square wave, a sawtooth, or another one.

use super::line::{Frequency, Line, scaled};
use crate::distributions::NORMAL_975;
use crate::findings::{Effect, Parameter};
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

fn amplitude_of(lines: &[(Multiple, Line)], harmonic: u32) -> Option<Parameter> {
    lines.iter().find(|(multiple, _)| *multiple == Multiple::Harmonic(harmonic))?.1.amplitude()
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
    let error = |of: &Parameter| (of.high - of.low) / (2.0 * NORMAL_975);
    let has_size = |(multiple, line): &(Multiple, Line)| {
        let Multiple::Harmonic(multiple) = *multiple else { return true };
        let Some(amplitude) = line.amplitude() else { return false };
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
    let first = line.amplitude()?;
    let higher = lines.iter().filter(|(multiple, _)| *multiple != Multiple::Harmonic(1));
    let amplitudes: Vec<Parameter> = higher.filter_map(|(_, line)| line.amplitude()).collect();
    let lacking = |of: fn(&Parameter) -> f64| {
        100.0 * amplitudes.iter().map(|amplitude| of(amplitude).powi(2)).sum::<f64>().sqrt() / first.value
    };
    let excess = Parameter::new(lacking(|of| of.value), lacking(|of| of.low), lacking(|of| of.high), "%");
    let evidence = format!(
        "{} of one signal, even and odd ones with amplitudes that fall with their number: it rises evenly and jumps back every \
         {:.1} s, which no sinusoid and no square wave does; {}",
        harmonics(lines),
        1.0 / line.frequency,
        line.effect.evidence,
    );
    let frequency = line.effect.parameters.get("frequency")?.clone();
    Some(Effect::new("unexplained", [("frequency", frequency), ("excess_percent", excess)], evidence))
}

/// The square wave whose lowest odd harmonic in a channel is among `lines`. A square wave of amplitude A, half the distance of
/// its levels, has the harmonics 4A/(πk).
pub(super) fn square_wave(lines: &[(Multiple, Line)]) -> Option<Effect> {
    let (harmonic, line) = lines.iter().find_map(|(multiple, line)| match *multiple {
        Multiple::Harmonic(harmonic) if !harmonic.is_multiple_of(2) => Some((harmonic, line)),
        _ => None,
    })?;
    let amplitude = scaled(&line.amplitude()?, FRAC_PI_4 * f64::from(harmonic));
    let frequency = scaled(line.effect.parameters.get("frequency")?, 1.0 / f64::from(harmonic));
    let evidence = format!(
        "{} of a square wave at {:.4} Hz: amplitudes fall with the number of the harmonic; {}",
        harmonics(lines),
        frequency.value,
        line.effect.evidence,
    );
    Some(Effect::new("square_wave", [("frequency", frequency), ("amplitude", amplitude)], evidence))
}

/// The lowest of the lines of a channel, with the number of all.
pub(super) fn periodic(lines: &[(Multiple, Line)]) -> Effect {
    let effect = &lines[0].1.effect;
    if lines.len() == 1 {
        return effect.clone();
    }
    let count = lines.len() as f64;
    let mut effect = effect.clone();
    effect.parameters.insert("harmonics".to_owned(), Parameter::new(count, count, count, ""));
    effect.evidence = format!("{} of one periodic signal; {}", harmonics(lines), effect.evidence);
    effect
}

/// Such as `harmonics 1, 3 and 5 and 2 sidebands`.
fn harmonics(lines: &[(Multiple, Line)]) -> String {
    let numbers: Vec<String> = lines
        .iter()
        .filter_map(|(multiple, _)| match multiple {
            Multiple::Harmonic(number) => Some(number.to_string()),
            Multiple::Sideband => None,
        })
        .collect();
    let harmonics = match numbers.as_slice() {
        [] => String::new(),
        [one] => format!("harmonic {one}"),
        [others @ .., last] => format!("harmonics {} and {last}", others.join(", ")),
    };
    match lines.len() - numbers.len() {
        0 => harmonics,
        count if numbers.is_empty() => format!("{count} sidebands"),
        count => format!("{harmonics} with {count} sidebands"),
    }
}
