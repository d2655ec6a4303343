//! Periodic causes: lines of several channels at one frequency, the harmonics and sidebands of one fundamental, and lines whose
//! amplitude changes.
//!
//! ```text
//! effects of every channel ─► line (by frequency) ─► harmonic_series (which belong together) ─► waveform (what it is)
//! ```

use super::harmonic_series::{BY_CHANCE, most_certain};
use super::line::{Frequency, Line, NORMAL_995};
use super::waveform::{
    Multiple, SQUARE_BY_CHANCE, SQUARE_SIGMAS, SQUARE_TOLERANCE, by_channel, is_no_sinusoid, is_square, no_sinusoid,
    periodic, square_wave,
};
use crate::bounds::{BoundedEstimate, ChannelEstimate};
use crate::distributions::NORMAL_975;
use crate::effects::{Effect, ModulatedLine, ModulationEvidence};
use crate::rivals::cause::{Cause, Shown};
use std::collections::BTreeMap;

/// By which part of the record's resolution lines that are a few resolutions apart move each other's frequency.
const SHIFT_OF_NEIGHBOURS: f64 = 0.1;

/// The periodic causes of the effects of all channels, each with its unit.
pub(super) fn causes(channels: &[(&str, &[Effect])], duration_s: f64) -> Vec<Cause> {
    let mut frequencies = Frequency::all(channels, duration_s);
    let mut causes = Vec::new();
    while let Some(series) = most_certain(&frequencies, duration_s) {
        let mut members = Vec::new();
        let mut others = Vec::new();
        for (number, frequency) in frequencies.into_iter().enumerate() {
            match series.members.iter().find(|(member, _)| *member == number) {
                Some(&(_, multiple)) => members.push((multiple, frequency)),
                None => others.push(frequency),
            }
        }
        causes.push(harmonic_cause(&members));
        frequencies = others;
    }
    while let Some(places) = modulated_line(&frequencies, duration_s) {
        let further = further_sidebands(&frequencies, places, duration_s);
        causes
            .push(modulated_cause(places.map(|place| &frequencies[place]), further.iter().map(|&at| &frequencies[at])));
        let mut place = 0..;
        frequencies.retain(|_| place.next().is_some_and(|place| !places.contains(&place) && !further.contains(&place)));
    }
    causes.extend(frequencies.into_iter().map(|frequency| harmonic_cause(&[(Multiple::Harmonic(1), frequency)])));
    causes
}

/// A line between two others of one channel that are equally strong and equally far from it: what a sinusoid has whose amplitude
/// swells and fades. Of those that are unlikely by chance the ones with the largest sidebands: a change that is no sinusoid has others
/// at multiples of its frequency.
///
/// Unrelated lines between which another one lies have it anywhere, and amplitudes as different as those of any lines.
fn modulated_line(frequencies: &[Frequency], duration_s: f64) -> Option<[usize; 3]> {
    let count = frequencies.len();
    let pairs = (0..count).flat_map(|low| (low + 1..count).map(move |line| [low, line]));
    let triples = pairs.flat_map(|[low, line]| (line + 1..count).map(move |high| [low, line, high]));
    let lines = |triple: [usize; 3]| triple.map(|place| &frequencies[place]);
    let of_one_channel: Vec<[usize; 3]> = triples.filter(|triple| is_in_one_channel(lines(*triple))).collect();
    let by_chance = |triple: &[usize; 3]| {
        let [below, line, above] = lines(*triple).map(Frequency::best);
        let distance = above.frequency - below.frequency;
        let error = |of: &Line| of.error_by_amplitude(duration_s);
        let errors = error(line).hypot(0.5 * error(below).hypot(error(above)));
        let within = NORMAL_995 * errors + SHIFT_OF_NEIGHBOURS / duration_s;
        let is_in_the_middle = (0.5 * (below.frequency + above.frequency) - line.frequency).abs() < within;
        let is_slow = distance < line.frequency;
        (is_in_the_middle && is_slow && has_equal_sidebands(lines(*triple)))
            .then(|| 2.0 * within / distance * SQUARE_BY_CHANCE * of_one_channel.len() as f64)
    };
    let is_likely = |triple: &&[usize; 3]| by_chance(triple).is_some_and(|p_value| p_value < BY_CHANCE);
    let of_sidebands = |triple: &[usize; 3]| {
        let [below, _, above] = lines(*triple).map(Frequency::best);
        below.amplitude.value + above.amplitude.value
    };
    let likely = of_one_channel.iter().filter(is_likely);
    likely.max_by(|a, b| of_sidebands(a).total_cmp(&of_sidebands(b))).copied()
}

/// The lines of the same channel at further multiples of the distance between a line and its sidebands, which a change of the amplitude has
/// that is no sinusoid, such as a line that is switched on and off.
///
/// Unrelated lines are spread evenly over the logarithm of the frequency, as for [harmonics](super::harmonic_series): one lies within d of
/// one of 2k places near f₀ with the probability 4kd/(f₀·L).
fn further_sidebands(frequencies: &[Frequency], places: [usize; 3], duration_s: f64) -> Vec<usize> {
    let [below, line, above] = places.map(|place| frequencies[place].best());
    let change = 0.5 * (above.frequency - below.frequency);
    let highest = frequencies.iter().map(|of| of.best().frequency).fold(0.0, f64::max);
    let log_range = (highest * duration_s).ln().max(1.0);
    let error = |of: &Line| of.error_by_amplitude(duration_s);
    let error_of_change = 0.5 * error(below).hypot(error(above));
    let is_sideband = |&at: &usize| {
        let other = frequencies[at].best();
        let distance = other.frequency - line.frequency;
        let multiple = (distance / change).round().abs();
        let errors = error(other).hypot(error(line)).hypot(multiple * error_of_change);
        let within = NORMAL_995 * errors + SHIFT_OF_NEIGHBOURS / duration_s;
        let by_chance = 4.0 * multiple * within / (line.frequency * log_range) * frequencies.len() as f64;
        !places.contains(&at)
            && is_in_one_channel([&frequencies[at], &frequencies[places[0]], &frequencies[places[1]]])
            && (distance.abs() - multiple * change).abs() < within
            && by_chance < BY_CHANCE
    };
    (0..frequencies.len()).filter(is_sideband).collect()
}

/// Whether a channel shows all of these lines.
fn is_in_one_channel([first, others @ ..]: [&Frequency; 3]) -> bool {
    let shows = |of: &Frequency, channel: usize| of.lines.iter().any(|line| line.channel == channel);
    first.lines.iter().any(|line| others.iter().all(|other| shows(other, line.channel)))
}

/// Whether a channel shows all three lines, the outer ones with amplitudes that are equal within [`SQUARE_TOLERANCE`] and their
/// errors, and smaller than that of the line between them.
fn has_equal_sidebands([below, line, above]: [&Frequency; 3]) -> bool {
    line.lines.iter().any(|line| {
        let of = |of: &Frequency| Some(of.lines.iter().find(|other| other.channel == line.channel)?.amplitude);
        let (Some(below), Some(above)) = (of(below), of(above)) else { return false };
        let error = |of: &ChannelEstimate| (of.high - of.low) / (2.0 * NORMAL_975);
        let mean = 0.5 * (below.value + above.value);
        let joint = error(&below).hypot(error(&above));
        (below.value - above.value).abs() < SQUARE_TOLERANCE * mean + SQUARE_SIGMAS * joint
            && mean < line.amplitude.value
    })
}

/// A line whose amplitude changes, by the three lines of [`modulated_line`] and its further sidebands.
fn modulated_cause<'f>(lines: [&'f Frequency; 3], further: impl Iterator<Item = &'f Frequency>) -> Cause {
    let [below, line, above] = lines.map(Frequency::best);
    // The amplitude of either sideband is half the depth of that of the line.
    let depth = |of: fn(&ChannelEstimate) -> f64| {
        (of(&below.amplitude) + of(&above.amplitude)) / line.amplitude.value.max(f64::MIN_POSITIVE)
    };
    let change_hz = |[above, below]: [f64; 2]| 0.5 * (above - below);
    let [upper, lower] = [above.frequency_hz, below.frequency_hz];
    let change_hz = BoundedEstimate::new(
        change_hz([upper.value, lower.value]),
        change_hz([upper.low, lower.high]).max(0.0),
        change_hz([upper.high, lower.low]),
    );
    let effect = Effect::from(ModulatedLine {
        frequency_hz: line.frequency_hz,
        amplitude: line.amplitude,
        depth: BoundedEstimate::new(depth(|of| of.value), depth(|of| of.low), depth(|of| of.high)),
        period_s: change_hz.inverse(),
        of_phase: false,
        evidence: ModulationEvidence::Sidebands(line.evidence),
    });
    let mut by_channel: BTreeMap<usize, Vec<Effect>> = BTreeMap::new();
    for line in lines.into_iter().chain(further).flat_map(|frequency| &frequency.lines) {
        by_channel.entry(line.channel).or_default().push(line.effect.clone());
    }
    let shown = by_channel.into_iter().map(|(channel, parts)| Shown { channel, effect: effect.clone(), parts });
    Cause { shown: shown.collect() }
}

/// The cause with these frequencies: a square wave if the amplitudes of a channel say so, else its fundamental line with the
/// number of its harmonics.
fn harmonic_cause(members: &[(Multiple, Frequency)]) -> Cause {
    let by_channel = by_channel(members.iter().map(|(multiple, frequency)| (*multiple, frequency)));
    let is_square = by_channel.values().any(|lines| is_square(lines));
    let is_no_sinusoid = by_channel.values().any(|lines| is_no_sinusoid(lines));
    let shown = by_channel.into_iter().map(|(channel, mut lines)| {
        lines.sort_by(|a, b| a.1.frequency.total_cmp(&b.1.frequency));
        let parts = lines.iter().map(|(_, line)| line.effect.clone()).collect();
        let named = match (is_square, is_no_sinusoid) {
            (true, _) => square_wave(&lines),
            (_, true) => no_sinusoid(&lines),
            _ => None,
        };
        let effect = named.unwrap_or_else(|| periodic(&lines));
        Shown { channel, effect, parts }
    });
    Cause { shown: shown.collect() }
}
