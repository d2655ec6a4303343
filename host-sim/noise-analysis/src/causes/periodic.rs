//! Periodic causes: lines of several channels at one frequency, the harmonics and sidebands of one fundamental, and lines whose
//! amplitude changes.

use super::cause::{Cause, Shown};
use crate::distributions::NORMAL_975;
use crate::findings::{Effect, Parameter};
use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_4, PI, SQRT_2};

/// Quantile of the normal distribution for a two-sided level of 1 %: equal frequencies are farther apart once in a hundred.
const NORMAL_995: f64 = 2.576;
/// Probability of chance below which lines at multiples of a frequency are its harmonics.
const BY_CHANCE: f64 = 0.01;
/// Standard deviations within which the harmonics of a square wave have the amplitudes of one.
const SQUARE_SIGMAS: f64 = 3.0;
/// Largest part by which an amplitude may differ from that of a square wave beyond its error: edges that take a tenth of a
/// period lower the fifth harmonic by `1 − sinc(5/10)` = 0.36.
const SQUARE_TOLERANCE: f64 = 0.36;
/// Probability that an unrelated line has the amplitude of a harmonic of a square wave within [`SQUARE_TOLERANCE`], if
/// amplitudes are spread evenly over the logarithm of two decades: ln(1.36/0.64)/ln 100.
const SQUARE_BY_CHANCE: f64 = 0.164;
/// By which part of the record's resolution lines that are a few resolutions apart move each other's frequency.
const SHIFT_OF_NEIGHBOURS: f64 = 0.1;

/// Whether an effect is a line of the spectrum.
pub(super) fn is_line(effect: &Effect) -> bool {
    matches!(effect.kind.as_str(), "sinusoid" | "resonance")
}

/// A line of one channel.
#[derive(Clone)]
struct Line {
    channel: usize,
    effect: Effect,
    frequency: f64,
    /// Standard deviation of the frequency, Hz.
    error: f64,
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
    fn error_by_amplitude(&self, duration_s: f64) -> f64 {
        let relative = |of: Parameter| (of.high - of.low) / (2.0 * NORMAL_975 * of.value.max(f64::MIN_POSITIVE));
        let by_amplitude = self.amplitude().map_or(f64::INFINITY, |of| 3f64.sqrt() / (PI * duration_s) * relative(of));
        by_amplitude.min(self.error)
    }

    /// Amplitude of a sinusoid of the line's power, as a parameter.
    fn amplitude(&self) -> Option<Parameter> {
        let parameters = &self.effect.parameters;
        let of_deviation = |of: &Parameter| scaled(of, SQRT_2);
        parameters.get("amplitude").cloned().or_else(|| parameters.get("deviation").map(of_deviation))
    }
}

fn scaled(of: &Parameter, factor: f64) -> Parameter {
    Parameter::new(factor * of.value, factor * of.low, factor * of.high, of.unit.clone())
}

/// Lines of several channels at one frequency.
struct Frequency {
    lines: Vec<Line>,
}

impl Frequency {
    /// The line whose frequency is known best.
    fn best(&self) -> &Line {
        self.lines[1..].iter().fold(&self.lines[0], |best, next| if next.error < best.error { next } else { best })
    }
}

/// How far a multiple of a frequency and a line may be apart: their joint error, half their widths, and the
/// resolution of the record.
fn reach(fundamental: &Line, multiple: f64, line: &Line, duration_s: f64) -> f64 {
    let width = 0.5 * (multiple * fundamental.width).max(line.width);
    NORMAL_995 * (multiple * fundamental.error).hypot(line.error) + width + 1.0 / duration_s
}

/// The periodic causes of the effects of all channels, each with its unit.
pub(super) fn causes(channels: &[(&str, &[Effect])], duration_s: f64) -> Vec<Cause> {
    let lines = channels.iter().enumerate().flat_map(|(channel, (_, effects))| {
        effects.iter().filter(|effect| is_line(effect)).filter_map(move |effect| Line::new(channel, effect))
    });
    let mut frequencies: Vec<Frequency> = Vec::new();
    for line in lines {
        let is_same = |known: &&mut Frequency| {
            let known = known.best();
            (known.frequency - line.frequency).abs() < reach(known, 1.0, &line, duration_s)
        };
        match frequencies.iter_mut().find(is_same) {
            Some(known) => known.lines.push(line),
            None => frequencies.push(Frequency { lines: vec![line] }),
        }
    }
    frequencies.sort_by(|a, b| a.best().frequency.total_cmp(&b.best().frequency));
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
        causes.push(harmonic_cause(members));
        frequencies = others;
    }
    while let Some(places) = modulated_line(&frequencies, duration_s) {
        let (modulated, others): (Vec<_>, Vec<_>) =
            frequencies.into_iter().enumerate().partition(|(number, _)| places.contains(number));
        causes.push(modulated_cause(modulated.into_iter().map(|(_, frequency)| frequency).collect()));
        frequencies = others.into_iter().map(|(_, frequency)| frequency).collect();
    }
    causes.extend(frequencies.into_iter().map(|frequency| harmonic_cause(vec![(Multiple::Harmonic(1), frequency)])));
    causes
}

/// A line between two others of one channel that are equally strong and equally far from it: what a sinusoid has whose amplitude
/// swells and fades. The least likely by chance, if chance is unlikely.
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
    let likely = of_one_channel.iter().filter_map(|triple| Some((by_chance(triple)?, *triple)));
    let (p_value, triple) = likely.min_by(|a, b| a.0.total_cmp(&b.0))?;
    (p_value < BY_CHANCE).then_some(triple)
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
        let of = |of: &Frequency| of.lines.iter().find(|other| other.channel == line.channel)?.amplitude();
        let (Some(below), Some(amplitude), Some(above)) = (of(below), line.amplitude(), of(above)) else {
            return false;
        };
        let error = |of: &Parameter| (of.high - of.low) / (2.0 * NORMAL_975);
        let mean = 0.5 * (below.value + above.value);
        let joint = error(&below).hypot(error(&above));
        (below.value - above.value).abs() < SQUARE_TOLERANCE * mean + SQUARE_SIGMAS * joint && mean < amplitude.value
    })
}

/// A line whose amplitude changes, by the three lines of [`modulated_line`]: no effect that has a name.
fn modulated_cause(lines: Vec<Frequency>) -> Cause {
    let [below, line, above] = [0, 1, 2].map(|place| lines[place].best());
    let size = |of: &Line| of.amplitude().map_or(0.0, |amplitude| amplitude.value);
    let lacking = |amplitudes: [f64; 2]| 100.0 * amplitudes[0].hypot(amplitudes[1]) / size(line).max(f64::MIN_POSITIVE);
    let bound =
        |of: fn(&Parameter) -> f64| lacking([below, above].map(|line| line.amplitude().map_or(0.0, |a| of(&a))));
    let excess = Parameter::new(lacking([size(below), size(above)]), bound(|of| of.low), bound(|of| of.high), "%");
    let frequency = line.effect.parameters["frequency"].clone();
    let evidence = format!(
        "a line at {:.4} Hz between two equal ones {:.4} Hz away: its amplitude swells and fades every {:.0} s, which no sinusoid \
         of one amplitude does; {}",
        line.frequency,
        0.5 * (above.frequency - below.frequency),
        2.0 / (above.frequency - below.frequency),
        line.effect.evidence,
    );
    let effect = Effect::new("unexplained", [("frequency", frequency), ("excess_percent", excess)], evidence);
    let mut by_channel: BTreeMap<usize, Vec<Effect>> = BTreeMap::new();
    for line in lines.iter().flat_map(|frequency| &frequency.lines) {
        by_channel.entry(line.channel).or_default().push(line.effect.clone());
    }
    let shown = by_channel.into_iter().map(|(channel, parts)| Shown { channel, effect: effect.clone(), parts });
    Cause { shown: shown.collect() }
}

/// What a line is to the fundamental.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Multiple {
    /// The line at so many times its frequency.
    Harmonic(u32),
    /// One of a pair of lines at equal distances from such a multiple.
    Sideband,
}

/// A fundamental and its harmonics: positions in the list of frequencies.
struct HarmonicSeries {
    members: Vec<(usize, Multiple)>,
    /// Probability that as many lines lie at multiples by chance.
    p_value: f64,
}

/// The series that is least likely by chance, if chance is unlikely.
fn most_certain(frequencies: &[Frequency], duration_s: f64) -> Option<HarmonicSeries> {
    let series = (0..frequencies.len()).filter_map(|fundamental| series_of(frequencies, fundamental, duration_s));
    let best = series.min_by(|a, b| a.p_value.total_cmp(&b.p_value))?;
    // Each frequency was tried as the fundamental.
    (best.p_value * (frequencies.len() as f64) < BY_CHANCE).then_some(best)
}

/// The lines at multiples of the frequency at `fundamental`.
///
/// Unrelated lines are spread evenly over the logarithm of the frequency, from 1/T of a record of T to the highest line that it
/// shows: over L = ln(f·T). One lies within d of a multiple k of f₀ with the probability 2d/(k·f₀·L), and within d of one of
/// the multiples from 2 to k with the sum of these. Of m other lines the number that do has at most the binomial distribution
/// with the largest d. The highest multiple that is counted is the one for which chance is least, of those that occur.
fn series_of(frequencies: &[Frequency], fundamental: usize, duration_s: f64) -> Option<HarmonicSeries> {
    let first = frequencies[fundamental].best();
    let mut harmonics: Vec<(u32, usize, f64)> = Vec::new();
    let others: Vec<usize> = (0..frequencies.len()).filter(|number| *number != fundamental).collect();
    for &number in &others {
        let line = frequencies[number].best();
        let multiple = (line.frequency / first.frequency).round();
        let within = reach(first, multiple, line, duration_s);
        if multiple >= 2.0 && (line.frequency - multiple * first.frequency).abs() < within {
            harmonics.push((multiple as u32, number, within));
        }
    }
    harmonics.sort_by_key(|&(multiple, ..)| multiple);
    let highest = frequencies.iter().map(|of| of.best().frequency).fold(0.0, f64::max);
    let log_range = (highest * duration_s).ln().max(1.0);
    let (mut least, mut largest) = (f64::INFINITY, 0.0_f64);
    for (at, &(multiple, _, within)) in harmonics.iter().enumerate() {
        largest = largest.max(2.0 * within / first.frequency);
        let multiples: f64 = (2..=multiple).map(|k| 1.0 / f64::from(k)).sum();
        least = least.min(binomial_tail(at + 1, others.len(), (largest * multiples / log_range).min(largest)));
    }
    if harmonics.is_empty() || largest >= 1.0 {
        return None;
    }
    let mut members: Vec<(usize, Multiple)> =
        harmonics.iter().map(|&(multiple, number, _)| (number, Multiple::Harmonic(multiple))).collect();
    members.insert(0, (fundamental, Multiple::Harmonic(1)));
    let by_amplitude = if has_amplitudes_of_square(frequencies, &members) { SQUARE_BY_CHANCE } else { 1.0 };
    let p_value = (least * harmonics.len() as f64 * by_amplitude).min(1.0);
    let sidebands = sidebands(frequencies, first, &members, duration_s);
    members.extend(sidebands);
    Some(HarmonicSeries { members, p_value })
}

/// Whether the lines of any channel have the amplitudes of a square wave.
fn has_amplitudes_of_square(frequencies: &[Frequency], members: &[(usize, Multiple)]) -> bool {
    let mut by_channel: BTreeMap<usize, Vec<(Multiple, Line)>> = BTreeMap::new();
    for &(number, multiple) in members {
        for line in &frequencies[number].lines {
            by_channel.entry(line.channel).or_default().push((multiple, line.clone()));
        }
    }
    by_channel.values().any(|lines| is_square(lines))
}

/// Pairs of lines at equal distances on either side of a member: an amplitude or a frequency that is modulated.
fn sidebands(
    frequencies: &[Frequency],
    first: &Line,
    members: &[(usize, Multiple)],
    duration_s: f64,
) -> Vec<(usize, Multiple)> {
    let is_free = |number: &usize| members.iter().all(|(member, _)| member != number);
    let free: Vec<usize> = (0..frequencies.len()).filter(is_free).collect();
    let pairs = free.iter().enumerate().flat_map(|(at, &low)| free[at + 1..].iter().map(move |&high| (low, high)));
    let near: Vec<(usize, usize)> = pairs
        .filter(|&(low, high)| {
            frequencies[high].best().frequency - frequencies[low].best().frequency < 2.0 * first.frequency
        })
        .collect();
    // By chance for any pair and any member.
    let trials = (near.len() * members.len()) as f64;
    let mut found = Vec::new();
    for &(low, high) in &near {
        let (below, above) = (frequencies[low].best(), frequencies[high].best());
        let is_centre = |(member, _): &(usize, Multiple)| {
            let centre = frequencies[*member].best();
            let distance = (0.5 * (below.frequency + above.frequency) - centre.frequency).abs();
            let error = centre.error.hypot(0.5 * below.error.hypot(above.error));
            let width = 0.5 * centre.width.max(0.5 * (below.width + above.width));
            let within = NORMAL_995 * error + width + 1.0 / duration_s;
            distance < within && 2.0 * within / first.frequency * trials < BY_CHANCE
        };
        if members.iter().any(is_centre) {
            found.extend([(low, Multiple::Sideband), (high, Multiple::Sideband)]);
        }
    }
    found.sort_by_key(|(number, _)| *number);
    found.dedup_by_key(|(number, _)| *number);
    found
}

/// Probability that of `count` independent events of `probability` each at least `least` occur.
fn binomial_tail(least: usize, count: usize, probability: f64) -> f64 {
    if probability <= 0.0 {
        return 0.0;
    }
    statrs::function::beta::beta_reg(least as f64, (count + 1 - least) as f64, probability.min(1.0))
}

/// The cause with these frequencies: a square wave if the amplitudes of a channel say so, else its fundamental line with the
/// number of its harmonics.
fn harmonic_cause(members: Vec<(Multiple, Frequency)>) -> Cause {
    let mut by_channel: BTreeMap<usize, Vec<(Multiple, Line)>> = BTreeMap::new();
    for (multiple, frequency) in members {
        for line in frequency.lines {
            by_channel.entry(line.channel).or_default().push((multiple, line));
        }
    }
    let is_square = by_channel.values().any(|lines| is_square(lines));
    let is_sawtooth = by_channel.values().any(|lines| is_sawtooth(lines));
    let shown = by_channel.into_iter().map(|(channel, mut lines)| {
        lines.sort_by(|a, b| a.1.frequency.total_cmp(&b.1.frequency));
        let parts = lines.iter().map(|(_, line)| line.effect.clone()).collect();
        let named = match (is_square, is_sawtooth) {
            (true, _) => square_wave(&lines),
            (_, true) => sawtooth(&lines),
            _ => None,
        };
        let effect = named.unwrap_or_else(|| periodic(&lines));
        Shown { channel, effect, parts }
    });
    Cause { shown: shown.collect() }
}

fn amplitude_of(lines: &[(Multiple, Line)], harmonic: u32) -> Option<Parameter> {
    lines.iter().find(|(multiple, _)| *multiple == Multiple::Harmonic(harmonic))?.1.amplitude()
}

/// Whether the lines of a channel have the amplitudes of a square wave: 1/k at the odd multiples k, the first and the third
/// among them, and none at even ones that a wave with two unequal halves would have to show.
fn is_square(lines: &[(Multiple, Line)]) -> bool {
    amplitude_of(lines, 3).is_some() && fall_with_their_number(lines, |multiple| multiple % 2 == 1)
}

/// Whether the lines of a channel have the amplitudes of a signal that rises and jumps: 1/k at every multiple k, the first three
/// among them.
fn is_sawtooth(lines: &[(Multiple, Line)]) -> bool {
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
fn sawtooth(lines: &[(Multiple, Line)]) -> Option<Effect> {
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
fn square_wave(lines: &[(Multiple, Line)]) -> Option<Effect> {
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
fn periodic(lines: &[(Multiple, Line)]) -> Effect {
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
