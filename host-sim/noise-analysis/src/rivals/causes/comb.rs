//! Lines that are one periodic signal: the harmonics of a fundamental, and sidebands where its amplitude or phase is modulated.

use super::line::{Frequency, Line, NORMAL_995, Tooth};
use super::waveform::{SQUARE_BY_CHANCE, by_channel, is_equal, is_square};
use crate::spectra::nearest_multiple;

/// Probability of chance below which lines are those of a comb.
const BY_CHANCE: f64 = 0.01;
/// Part of the record's resolution by which lines a few resolutions apart move each other's frequency.
const SHIFT_OF_NEIGHBOURS: f64 = 0.1;

/// The lines of one periodic signal, as positions in the list of frequencies, the fundamental first.
pub(super) struct Comb {
    pub(super) teeth: Vec<(usize, Tooth)>,
    /// Probability that as many lines lie at these frequencies by chance.
    p_value: f64,
}

impl Comb {
    /// The comb of several harmonics that is least likely by chance, else a single modulated line; `None` where chance is likely.
    pub(super) fn find(frequencies: &[Frequency], duration_s: f64) -> Option<Self> {
        let lines = Lines { frequencies, duration_s };
        lines.most_certain_harmonics().or_else(|| lines.modulated_line())
    }
}

struct Lines<'f> {
    frequencies: &'f [Frequency],
    duration_s: f64,
}

struct Member {
    number: usize,
    tooth: Tooth,
    /// How far from the comb's frequency it could lie, Hz.
    within: f64,
}

impl Lines<'_> {
    fn best(&self, number: usize) -> &Line {
        self.frequencies[number].best()
    }

    /// Logarithm of the range in which unrelated lines lie: from 1/T of a record of T to the highest line that it shows.
    fn log_range(&self) -> f64 {
        let highest = self.frequencies.iter().map(|of| of.best().frequency).fold(0.0, f64::max);
        (highest * self.duration_s).ln().max(1.0)
    }

    fn most_certain_harmonics(&self) -> Option<Comb> {
        let count = self.frequencies.len();
        let frequency = |number: usize| self.best(number).frequency;
        let is_slow = |first: usize, beside: usize| {
            first != beside && (frequency(beside) - frequency(first)).abs() < 0.5 * frequency(first)
        };
        let steady: Vec<(usize, Option<usize>)> = (0..count).map(|first| (first, None)).collect();
        let pairs = (0..count).flat_map(|first| (0..count).map(move |beside| (first, beside)));
        let modulated: Vec<(usize, Option<usize>)> = pairs
            .filter(|&(first, beside)| is_slow(first, beside))
            .map(|(first, beside)| (first, Some(beside)))
            .collect();
        // Half of the probability is for those without sidebands, half for those with.
        let tried = [steady, modulated].into_iter().flat_map(|candidates| {
            let trials = 2.0 * candidates.len() as f64;
            candidates.into_iter().filter_map(move |(first, beside)| self.harmonics(first, beside, trials))
        });
        tried.filter(|comb| comb.p_value < BY_CHANCE).min_by(|a, b| a.p_value.total_cmp(&b.p_value))
    }

    /// The lines at the multiples of a fundamental, and beside them at the distance of the line `beside` it, with the probability that as
    /// many are there by chance in so many trials.
    ///
    /// Unrelated lines are spread evenly over the logarithm of the frequency, over a [range](Self::log_range) L. One lies within d of a
    /// multiple k of f₀ with the probability 2d/(k·f₀·L), and within d of one of the multiples from 1 to k with the sum of these; with
    /// sidebands each multiple has three such places. Of m other lines the number that do has at most the binomial distribution with the
    /// largest d. The highest multiple that is counted is the one for which chance is least, of those that occur.
    fn harmonics(&self, first: usize, beside: Option<usize>, trials: f64) -> Option<Comb> {
        let others: Vec<usize> =
            (0..self.frequencies.len()).filter(|&number| number != first && Some(number) != beside).collect();
        let places = if beside.is_some() { 3.0 } else { 1.0 };
        let covered = |member: &Member| 2.0 * member.within * places / self.best(first).frequency;
        // A line as wide as the distance of the comb's frequencies lies at one of them in any case.
        let members = |width: f64| {
            let all = others.iter().filter_map(move |number| self.member(first, beside, *number, width));
            all.filter(|member| covered(member) < 1.0)
        };
        let own_width = self.frequencies[first].width();
        // Harmonic k shows a frequency that wanders k times as well as the fundamental.
        let harmonics = members(own_width).filter_map(|member| Some((member.tooth.multiple()?, member.number)));
        let width = harmonics.min_by_key(|(multiple, _)| *multiple).map_or(own_width, |(multiple, number)| {
            own_width.max(self.frequencies[number].width() / f64::from(multiple))
        });
        let mut members: Vec<Member> = members(width).collect();
        members.sort_by_key(|member| member.tooth.harmonic);
        // Sidebands of one line alone are a modulated line.
        members.last().filter(|highest| highest.tooth.harmonic > 1)?;
        let first_multiple = if beside.is_some() { 1 } else { 2 };
        let (mut least, mut largest) = (f64::INFINITY, 0.0_f64);
        for (at, member) in members.iter().enumerate() {
            largest = largest.max(covered(member));
            let multiples: f64 = (first_multiple..=member.tooth.harmonic).map(|k| 1.0 / f64::from(k)).sum();
            let probability = (largest * multiples / self.log_range()).min(largest);
            least = least.min(binomial_tail(at + 1, others.len(), probability));
        }
        let count = members.len() as f64;
        let side = |beside: usize| if self.best(beside).frequency > self.best(first).frequency { 1 } else { -1 };
        let own = beside.map(|beside| (beside, Tooth { harmonic: 1, sideband: side(beside) }));
        let others = members.iter().map(|member| (member.number, member.tooth));
        let teeth: Vec<(usize, Tooth)> =
            std::iter::once((first, Tooth::FUNDAMENTAL)).chain(own).chain(others).collect();
        let lines = by_channel(teeth.iter().map(|&(number, tooth)| (tooth, &self.frequencies[number])));
        let by_amplitude = if lines.values().any(|lines| is_square(lines)) { SQUARE_BY_CHANCE } else { 1.0 };
        Some(Comb { teeth, p_value: trials * (least * count * by_amplitude).min(1.0) })
    }

    /// The place of a line in a comb, if it lies at one: at the multiple nearest to it, or beside that. The fundamental wanders over
    /// `width_of_first`, Hz.
    fn member(&self, first: usize, beside: Option<usize>, number: usize, width_of_first: f64) -> Option<Member> {
        let (carrier, line) = (self.best(first), self.best(number));
        let modulation = beside.map(|beside| self.best(beside));
        let change = modulation.map_or(0.0, |of| (of.frequency - carrier.frequency).abs());
        let at = |sideband: i32| {
            let offset = f64::from(sideband) * change;
            let (times, distance) = nearest_multiple(line.frequency - offset, carrier.frequency, f64::INFINITY);
            let tooth = Tooth { harmonic: times as u32, sideband };
            let error_of_change = modulation.filter(|_| sideband != 0).map_or(0.0, |of| of.error.hypot(carrier.error));
            let error = (times * carrier.error).hypot(line.error).hypot(error_of_change);
            let width = 0.5 * (times * width_of_first).max(self.frequencies[number].width());
            let within = NORMAL_995 * error + width + 1.0 / self.duration_s;
            // The fundamental itself, in another channel, is a member already.
            (tooth != Tooth::FUNDAMENTAL && distance < within)
                .then_some((distance / within, Member { number, tooth, within }))
        };
        let sidebands = if beside.is_some() { -1..=1 } else { 0..=0 };
        sidebands.filter_map(at).min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, member)| member)
    }

    /// A line between two others of one channel that are equally strong and equally far from it, as one has whose amplitude swells and
    /// fades, and the lines of the channel at further multiples of this distance, as a line has that is switched on and off. Of those that
    /// are unlikely by chance the ones with the largest sidebands.
    ///
    /// Unrelated lines between which another one lies have it anywhere, and amplitudes as different as those of any lines.
    fn modulated_line(&self) -> Option<Comb> {
        let count = self.frequencies.len();
        let pairs = (0..count).flat_map(|below| (below + 1..count).map(move |line| [below, line]));
        let triples = pairs.flat_map(|[below, line]| (line + 1..count).map(move |above| [below, line, above]));
        let of_one_channel: Vec<[usize; 3]> =
            triples.filter(|triple| self.in_one_channel(*triple).next().is_some()).collect();
        let error = |number: usize| self.best(number).error_by_amplitude(self.duration_s);
        let p_value = |triple: [usize; 3]| {
            let [low, middle, high] = triple.map(|number| self.best(number).frequency);
            let errors = error(triple[1]).hypot(0.5 * error(triple[0]).hypot(error(triple[2])));
            let within = NORMAL_995 * errors + SHIFT_OF_NEIGHBOURS / self.duration_s;
            let is_in_the_middle = (0.5 * (low + high) - middle).abs() < within;
            let has_equal_sidebands = |[below, line, above]: [&Line; 3]| {
                let mean = 0.5 * (below.amplitude.value + above.amplitude.value);
                mean < line.amplitude.value && is_equal(below.amplitude, above.amplitude, mean)
            };
            (is_in_the_middle && high - low < middle && self.in_one_channel(triple).any(has_equal_sidebands))
                .then(|| 2.0 * within / (high - low) * SQUARE_BY_CHANCE * of_one_channel.len() as f64)
        };
        let strength =
            |[below, _, above]: [usize; 3]| self.best(below).amplitude.value + self.best(above).amplitude.value;
        let likely =
            of_one_channel.iter().filter_map(|triple| Some((*triple, p_value(*triple).filter(|of| *of < BY_CHANCE)?)));
        let ([below, line, above], p_value) = likely.max_by(|a, b| strength(a.0).total_cmp(&strength(b.0)))?;
        let [low, middle, high] = [below, line, above].map(|number| self.best(number).frequency);
        let change = 0.5 * (high - low);
        let tooth = |number: usize| {
            let offset = self.best(number).frequency - middle;
            let (multiple, distance) = nearest_multiple(offset.abs(), change, f64::INFINITY);
            let errors = error(number).hypot(error(line)).hypot(multiple * 0.5 * error(below).hypot(error(above)));
            let within = NORMAL_995 * errors + SHIFT_OF_NEIGHBOURS / self.duration_s;
            // One of 2k places near f₀, with the spread of unrelated lines that harmonics have.
            let by_chance = 4.0 * multiple * within / (middle * self.log_range()) * count as f64;
            let is_further = distance < within
                && by_chance < BY_CHANCE
                && self.in_one_channel([below, line, number]).next().is_some();
            let sideband = if number == line { 0 } else { multiple.copysign(offset) as i32 };
            let is_of_three = [below, line, above].contains(&number);
            (is_of_three || is_further).then_some((number, Tooth { harmonic: 1, sideband }))
        };
        Some(Comb { teeth: (0..count).filter_map(tooth).collect(), p_value })
    }

    /// Three lines, by each channel that shows all of them.
    fn in_one_channel(&self, numbers: [usize; 3]) -> impl Iterator<Item = [&Line; 3]> {
        let [first, others @ ..] = numbers.map(|number| &self.frequencies[number]);
        first.lines.iter().filter_map(move |line| {
            let [second, third] = others.map(|of| of.lines.iter().find(|other| other.channel == line.channel));
            Some([line, second?, third?])
        })
    }
}

/// Probability that of `count` independent events of `probability` each at least `least` occur.
fn binomial_tail(least: usize, count: usize, probability: f64) -> f64 {
    if probability <= 0.0 {
        return 0.0;
    }
    statrs::function::beta::beta_reg(least as f64, (count + 1 - least) as f64, probability.min(1.0))
}
