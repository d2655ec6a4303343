//! Lines that are the harmonics of one periodic signal, and the sidebands of these.

use super::line::{Frequency, NORMAL_995};
use super::waveform::{Multiple, SQUARE_BY_CHANCE, by_channel, is_square};

/// Probability of chance below which lines at multiples of a frequency are its harmonics.
pub(super) const BY_CHANCE: f64 = 0.01;

/// A fundamental, its harmonics and their sidebands: positions in the list of frequencies.
pub(super) struct HarmonicSeries {
    pub(super) members: Vec<(usize, Multiple)>,
    /// Probability that as many lines lie at these frequencies by chance.
    p_value: f64,
}

/// The series that is least likely by chance, if chance is unlikely.
pub(super) fn most_certain(frequencies: &[Frequency], duration_s: f64) -> Option<HarmonicSeries> {
    let count = frequencies.len();
    let comb = |fundamental, sideband| Comb { frequencies, fundamental, sideband, duration_s };
    let steady: Vec<Comb> = (0..count).map(|fundamental| comb(fundamental, None)).collect();
    let pairs = (0..count).flat_map(|fundamental| (0..count).map(move |sideband| (fundamental, sideband)));
    let frequency = |number: usize| frequencies[number].best().frequency;
    let is_slow = |(fundamental, sideband): &(usize, usize)| {
        fundamental != sideband
            && (frequency(*sideband) - frequency(*fundamental)).abs() < 0.5 * frequency(*fundamental)
    };
    let modulated: Vec<Comb> =
        pairs.filter(is_slow).map(|(fundamental, sideband)| comb(fundamental, Some(sideband))).collect();
    // Half of the probability is for those without sidebands, half for those with.
    let tried = [steady, modulated].into_iter().flat_map(|combs| {
        let trials = 2.0 * combs.len() as f64;
        combs.into_iter().filter_map(move |comb| {
            let series = comb.series()?;
            Some(HarmonicSeries { p_value: trials * series.p_value, ..series })
        })
    });
    tried.filter(|series| series.p_value < BY_CHANCE).min_by(|a, b| a.p_value.total_cmp(&b.p_value))
}

/// The frequencies at which a periodic signal has lines: the multiples k·f₀ of its frequency, and k·f₀ ± Δ where its amplitude or
/// its phase is modulated at the frequency Δ.
struct Comb<'f> {
    frequencies: &'f [Frequency],
    fundamental: usize,
    /// A line beside the fundamental, whose distance is that of the modulation.
    sideband: Option<usize>,
    duration_s: f64,
}

/// A line at one of the frequencies of a comb.
struct Tooth {
    number: usize,
    /// The multiple at which, or nearest to which, the line lies.
    harmonic: u32,
    /// What the line is to the fundamental: that multiple, or a sideband of it.
    multiple: Multiple,
    /// How far from the comb's frequency it could lie, Hz.
    within: f64,
}

impl Comb<'_> {
    /// The lines at the comb's frequencies, with the probability that as many are there by chance.
    ///
    /// Unrelated lines are spread evenly over the logarithm of the frequency, from 1/T of a record of T to the highest line that it
    /// shows: over L = ln(f·T). One lies within d of a multiple k of f₀ with the probability 2d/(k·f₀·L), and within d of one of
    /// the multiples from 1 to k with the sum of these; with sidebands each multiple has three such places. Of m other lines the
    /// number that do has at most the binomial distribution with the largest d. The highest multiple that is counted is the one
    /// for which chance is least, of those that occur.
    fn series(&self) -> Option<HarmonicSeries> {
        let Self { frequencies, fundamental, sideband, duration_s } = *self;
        let others: Vec<usize> =
            (0..frequencies.len()).filter(|&number| number != fundamental && Some(number) != sideband).collect();
        let places = if sideband.is_some() { 3.0 } else { 1.0 };
        let first = frequencies[fundamental].best().frequency;
        let covered = |within: f64| 2.0 * within * places / first;
        let teeth = |width: f64| others.iter().filter_map(move |number| self.tooth(*number, width));
        let own_width = frequencies[fundamental].width();
        // Where the frequency wanders, harmonic k shows it k times as well as the fundamental.
        let lowest = teeth(own_width)
            .filter(|tooth| tooth.multiple != Multiple::Sideband && covered(tooth.within) < 1.0)
            .min_by_key(|tooth| tooth.harmonic);
        let width = lowest
            .map_or(own_width, |tooth| own_width.max(frequencies[tooth.number].width() / f64::from(tooth.harmonic)));
        let mut teeth: Vec<Tooth> = teeth(width).collect();
        // What is as wide as the distance of the comb's frequencies lies at one of them in any case.
        teeth.retain(|tooth| covered(tooth.within) < 1.0);
        // Sidebands of one line alone are a line whose amplitude changes.
        if !teeth.iter().any(|tooth| tooth.harmonic > 1) {
            return None;
        }
        teeth.sort_by_key(|tooth| tooth.harmonic);
        let highest = frequencies.iter().map(|of| of.best().frequency).fold(0.0, f64::max);
        let log_range = (highest * duration_s).ln().max(1.0);
        let first_multiple = if sideband.is_some() { 1 } else { 2 };
        let (mut least, mut largest) = (f64::INFINITY, 0.0_f64);
        for (at, tooth) in teeth.iter().enumerate() {
            largest = largest.max(covered(tooth.within));
            let multiples: f64 = (first_multiple..=tooth.harmonic).map(|k| 1.0 / f64::from(k)).sum();
            least = least.min(binomial_tail(at + 1, others.len(), (largest * multiples / log_range).min(largest)));
        }
        let count = teeth.len() as f64;
        let mut members = vec![(fundamental, Multiple::Harmonic(1))];
        members.extend(sideband.map(|sideband| (sideband, Multiple::Sideband)));
        members.extend(teeth.iter().map(|tooth| (tooth.number, tooth.multiple)));
        let lines = by_channel(members.iter().map(|&(number, multiple)| (multiple, &frequencies[number])));
        let by_amplitude = if lines.values().any(|lines| is_square(lines)) { SQUARE_BY_CHANCE } else { 1.0 };
        Some(HarmonicSeries { members, p_value: (least * count * by_amplitude).min(1.0) })
    }

    /// The place of a line in the comb, if it lies at one: at the multiple nearest to it, or beside that. The fundamental wanders over
    /// `width_of_first`, Hz.
    fn tooth(&self, number: usize, width_of_first: f64) -> Option<Tooth> {
        let (first, line) = (&self.frequencies[self.fundamental], &self.frequencies[number]);
        let sideband = self.sideband.map(|sideband| self.frequencies[sideband].best());
        let [carrier, frequency] = [first, line].map(|of| of.best().frequency);
        let modulation = sideband.map(|sideband| (sideband.frequency - carrier).abs());
        let offsets = [Some(0.0), modulation, modulation.map(|of| -of)];
        let at = |offset: f64| {
            let times = ((frequency - offset) / carrier).round();
            let harmonic = times as u32;
            let (error_of_modulation, multiple) = match sideband.filter(|_| offset != 0.0) {
                Some(sideband) => (sideband.error.hypot(first.best().error), Multiple::Sideband),
                None => (0.0, Multiple::Harmonic(harmonic)),
            };
            let error = (times * first.best().error).hypot(line.best().error).hypot(error_of_modulation);
            let width = 0.5 * (times * width_of_first).max(line.width());
            let within = NORMAL_995 * error + width + 1.0 / self.duration_s;
            let distance = (frequency - times * carrier - offset).abs();
            // The fundamental itself, in another channel, is a member already.
            let is_other = harmonic >= 1 && multiple != Multiple::Harmonic(1);
            (is_other && distance < within).then_some((distance / within, Tooth { number, harmonic, multiple, within }))
        };
        let places = offsets.into_iter().flatten().filter_map(at);
        places.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, tooth)| tooth)
    }
}

/// Probability that of `count` independent events of `probability` each at least `least` occur.
fn binomial_tail(least: usize, count: usize, probability: f64) -> f64 {
    if probability <= 0.0 {
        return 0.0;
    }
    statrs::function::beta::beta_reg(least as f64, (count + 1 - least) as f64, probability.min(1.0))
}
