//! The envelope of a line: changes of its amplitude and phase over the record.
//!
//! The rest of the record times the line's rotating phasor has an in-phase part (amplitude) and a quadrature (phase).
//! In noise their ordinates are exponential; a change is the coherent sum of two sidebands. Wandering falls as 1/f² to
//! the noise (D. B. Leeson, Proc. IEEE 54, 1966).

use super::harmonics::nearest_multiple;
use super::line_models::{Sine, for_each_phase};
use super::periodogram::taper;
use super::whittle::{Sign, SpectralBand, fit_mixture};
use crate::bounds::MeasuredValue;
use crate::distributions::NORMAL_975;
use crate::minimum::summit;
use crate::samples::uniform_series::UniformSeries;
use fourier::Complex;
use std::f64::consts::{PI, TAU};

/// Fewest blocks; the fastest change loses `(π·64/1024)²/3` = 1.3 % of its power.
const BLOCKS: usize = 1024;
/// Fastest change, periods per record.
pub(super) const MOST_PERIODS: usize = 64;
/// Slowest change, periods per record; slower ones are drift of the line.
const FEWEST_PERIODS: usize = 3;
/// Least ratio of the line's frequency to the change's.
const OF_FREQUENCY: usize = 8;
/// Resolutions around a change and its multiples that do not count as noise.
const OF_MULTIPLE: f64 = 0.75;
/// Most peaks that are compared with their surroundings.
const MOST_PEAKS: usize = 8;
/// Ordinates per resolution; a line between two loses at most 0.9 dB.
const PADDING: usize = 2;
/// False-alarm probability per line. Six channels with two lines each have one in a hundred records.
const FALSE_ALARM: f64 = 0.001;
/// Largest ratio, in power, of the other kind of change; a single line at that distance is half of either.
const LARGEST_OTHER: f64 = 0.25;

/// Spacings, in ordinates, of successive parabolas around the maximum.
const AROUND: [f64; 3] = [0.5, 0.15, 0.05];

/// Resolutions within which two frequencies are one.
const SAME: f64 = 1.5;

/// A periodic change of a line's amplitude or phase.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Modulation {
    /// Hz.
    pub frequency: MeasuredValue,
    /// Relative amplitude of the change, or of the phase in rad.
    pub depth: MeasuredValue,
    /// True if the phase changes, not the amplitude.
    pub of_phase: bool,
    /// −2 log-likelihood ratio of the line without the change against with it.
    pub statistic: f64,
    /// [`statistic`](Self::statistic) with significant multiples, as of a switched line.
    pub with_multiples: f64,
}

impl Modulation {
    /// True if a line at a distance, Hz, from the modulated one is a sideband, at a multiple of the change.
    pub(super) fn is_sideband(&self, distance: f64, duration: f64) -> bool {
        let highest = highest_multiple(0.5 * self.statistic);
        let (multiple, distance) = nearest_multiple(distance.abs(), self.frequency.value, highest);
        distance < (SAME / duration).hypot(NORMAL_975 * (multiple - 1.0) * self.frequency.error)
    }

    /// The clearest change of `sine` in `rest`; `None` if noise of `density`, unit²/Hz, or another line explains it.
    pub(super) fn find(
        sine: &Sine,
        rest: &UniformSeries,
        density: f64,
        has_line: impl Fn(f64) -> bool,
    ) -> Option<Self> {
        let most = MOST_PERIODS.min((sine.frequency * rest.duration()) as usize / OF_FREQUENCY);
        let length = rest.values().len();
        let envelope = Envelope::new(sine, rest);
        // Each part has half the power of the noise on both sides of the line.
        let unit = density * envelope.squares / (4.0 * rest.sample_period());
        let periods = |ordinate: usize| ordinate as f64 / PADDING as f64;
        let ordinates = PADDING * FEWEST_PERIODS..=PADDING * most;
        let trials = 2.0 * ordinates.clone().count() as f64;
        let powers: Vec<[f64; 2]> = (0..=PADDING * most + 1).map(|at| envelope.powers(periods(at))).collect();
        let mut peaks: Vec<(f64, Part, f64)> = Vec::new();
        for part in Part::BOTH {
            let power = |at: usize| powers[at][part as usize];
            let is_peak = |&at: &usize| power(at) >= power(at - 1) && power(at) >= power(at + 1);
            let seen = ordinates.clone().filter(is_peak).map(|at| (power(at) / unit, part, periods(at)));
            peaks.extend(seen.filter(|(ratio, ..)| is_seen(*ratio, trials)));
        }
        peaks.sort_by(|one, other| other.0.total_cmp(&one.0));
        peaks.truncate(MOST_PEAKS);
        let over_level = |(_, part, at): (f64, Part, f64)| {
            let at = envelope.vertex(part, at);
            (over_wandering(&envelope, part, at, most, unit), part, at)
        };
        let found = peaks.into_iter().map(over_level);
        let (OverLevel { ratio, multiples }, part, at) =
            found.max_by(|(one, ..), (other, ..)| one.ratio.total_cmp(&other.ratio))?;
        let powers = envelope.powers(at);
        let (power, of_other) = (powers[part as usize], powers[1 - part as usize]);
        let frequency = at / (length as f64 * rest.sample_period());
        if !is_seen(ratio, trials) || (has_line(frequency) && of_other > LARGEST_OTHER * power) {
            return None;
        }
        let depth = 4.0 * power.sqrt() / (envelope.weight * sine.amplitude());
        let relative = 1.0 / (2.0 * ratio).sqrt();
        Some(Self {
            frequency: MeasuredValue { value: frequency, error: 3f64.sqrt() / (PI * rest.duration()) * relative },
            depth: MeasuredValue { value: depth, error: depth * relative },
            of_phase: matches!(part, Part::Quadrature),
            statistic: 2.0 * ratio,
            with_multiples: 2.0 * (ratio + multiples),
        })
    }
}

/// In-phase part and quadrature; as a number, an index.
#[derive(Clone, Copy)]
enum Part {
    InPhase,
    Quadrature,
}

impl Part {
    const BOTH: [Self; 2] = [Self::InPhase, Self::Quadrature];
}

/// Sums over blocks under the taper, times the phasor of a sine.
#[derive(Clone)]
struct Envelope {
    blocks: Vec<Complex<f64>>,
    /// Weights of each block, of all, and squares of all.
    weights: Vec<f64>,
    weight: f64,
    squares: f64,
    /// Turns per block of a change of one period a record.
    turns: f64,
}

impl Envelope {
    fn new(sine: &Sine, rest: &UniformSeries) -> Self {
        let length = rest.values().len();
        let size = (length / BLOCKS).max(1);
        let mut blocks = vec![Complex::<f64>::ZERO; length.div_ceil(size)];
        let (mut weights, mut squares) = (vec![0.0; blocks.len()], 0.0);
        for_each_phase(rest, sine.frequency, |at, value, cosine, sine| {
            if value.is_finite() {
                let weight = taper(at, length);
                blocks[at / size] += weight * value * Complex::new(cosine, -sine);
                weights[at / size] += weight;
                squares += weight * weight;
            }
        });
        let turned = Complex::cis(sine.phase());
        blocks.iter_mut().for_each(|block| *block *= turned);
        let weight = weights.iter().sum();
        Self { blocks, weights, weight, squares, turns: size as f64 / length as f64 }
    }

    /// Phasors of a change of `periods` a record, in the middle of each block.
    fn phasors(&self, periods: f64) -> impl Iterator<Item = Complex<f64>> {
        let turns = TAU * self.turns * periods;
        let turn = Complex::cis(turns);
        std::iter::successors(Some(Complex::cis(0.5 * turns)), move |phasor| Some(phasor * turn))
    }

    fn sums(&self, periods: f64) -> [Complex<f64>; 2] {
        let mut sums = [Complex::ZERO; 2];
        for (block, phasor) in self.blocks.iter().zip(self.phasors(periods)) {
            sums[Part::InPhase as usize] += phasor.conj() * block.re;
            sums[Part::Quadrature as usize] += phasor.conj() * block.im;
        }
        sums
    }

    fn powers(&self, periods: f64) -> [f64; 2] {
        self.sums(periods).map(|sum| sum.norm_sqr())
    }

    fn power(&self, part: Part, periods: f64) -> f64 {
        self.powers(periods)[part as usize]
    }

    /// The maximum near `periods` a record.
    fn vertex(&self, part: Part, periods: f64) -> f64 {
        AROUND
            .into_iter()
            .fold(periods, |at, step| at + step * summit([at - step, at, at + step].map(|at| self.power(part, at))))
    }

    fn without(&self, part: Part, periods: f64) -> Self {
        let size = 2.0 * self.sums(periods)[part as usize] / self.weight;
        let turned = match part {
            Part::InPhase => Complex::ONE,
            Part::Quadrature => Complex::I,
        };
        let of_change = self.phasors(periods).zip(&self.weights).map(|(phasor, weight)| weight * (size * phasor).re);
        let blocks = self.blocks.iter().zip(of_change).map(|(block, change)| block - turned * change).collect();
        Self { blocks, ..self.clone() }
    }
}

/// True if an exponential variable of mean 1 in so many trials is significant by [`FALSE_ALARM`].
fn is_seen(ratio: f64, trials: f64) -> bool {
    trials * (-ratio).exp() <= FALSE_ALARM
}

/// Exponential variable of mean 1 that is as rare as the power of a change of `periods` a record, beside wandering
/// shown by ordinates up to `most`.
///
/// `unit` is the noise around the line. Over noise and a random walk known by m ordinates, the tail is `(1 + r/m)^−m`.
///
/// Significant multiples of the change count too.
fn over_wandering(envelope: &Envelope, part: Part, periods: f64, most: usize, unit: f64) -> OverLevel {
    let rest = envelope.without(part, periods);
    let power = envelope.power(part, periods) / unit;
    let highest = highest_multiple(power);
    let is_multiple = |at: f64| nearest_multiple(at, periods, highest).1 < OF_MULTIPLE;
    let band =
        |periods: f64| SpectralBand { frequency: periods, density: rest.power(part, periods) / unit, ordinates: 1.0 };
    let beside: Vec<SpectralBand> = (1..=most).map(|at| at as f64).filter(|at| !is_multiple(*at)).map(band).collect();
    let bases: Vec<[f64; 2]> = beside.iter().map(|band| [1.0, band.frequency.powi(-2)]).collect();
    let mut densities = [0.0; 2];
    fit_mixture(&beside, &bases, Sign::NonNegative, &mut densities);
    // Chance makes no noise smaller than it is.
    let noise = densities[0].max(1.0);
    let level = |periods: f64| noise + densities[1] / (periods * periods);
    let part_of_walk = |periods: f64| 1.0 - noise / level(periods);
    let shown: f64 = beside.iter().map(|band| part_of_walk(band.frequency).powi(2)).sum();
    let by_chance = |periods: f64, power: f64| {
        let ratio = power / level(periods);
        let known_by = shown / part_of_walk(periods).powi(2);
        if known_by.is_finite() { known_by * (ratio / known_by).ln_1p() } else { ratio }
    };
    let multiples =
        (2..=highest as u32).map(|multiple| f64::from(multiple) * periods).take_while(|at| *at <= most as f64);
    let of_multiples = multiples.map(|at| by_chance(at, rest.power(part, at) / unit));
    let multiples = of_multiples.filter(|ratio| is_seen(*ratio, highest)).sum();
    OverLevel { ratio: by_chance(periods, power), multiples }
}

/// Equivalent exponential variables of a change and its multiples.
struct OverLevel {
    ratio: f64,
    /// The sum over significant multiples.
    multiples: f64,
}

/// Highest significant multiple of a change whose power is `ratio` times the noise, as of a switched line.
fn highest_multiple(ratio: f64) -> f64 {
    (0.5 * ratio).sqrt().floor().max(1.0)
}

pub(super) fn is_same(one: f64, other: f64, duration: f64) -> bool {
    (one - other).abs() < SAME / duration
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    const SAMPLES: usize = 20_000;

    /// A sine of 0.3 at 7.3 Hz in white noise at 50 Hz, whose amplitude or phase changes 5.3 times in the record.
    fn found(seed: u64, amplitude: f64, phase: f64) -> Option<Modulation> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let value = |at: usize| {
            let change = (TAU * 5.3 * at as f64 / SAMPLES as f64).sin();
            let angle = TAU * 7.3 * 0.02 * at as f64 + phase * change;
            0.3 * (1.0 + amplitude * change) * angle.sin() + random.sample::<f64, _>(StandardNormal)
        };
        let series = UniformSeries::new(0.02, (0..SAMPLES).map(value).collect());
        let sine = Sine::fit_near(&series, 7.3, 0.5 / series.duration());
        Modulation::find(&sine, &sine.subtracted_from(&series), 2.0 * 0.02, |_| false)
    }

    #[test]
    fn changes_of_amplitude_and_of_phase_are_told_apart() {
        for seed in 0..4 {
            for (amplitude, phase) in [(0.5, 0.0), (0.0, 0.5)] {
                // Expected 0.09·20,000/8·0.25 = 56, less 10 %: the depth is known to 10 %.
                let found = found(seed, amplitude, phase).expect("47 times the noise");
                assert!((found.frequency.value * 400.0 - 5.3).abs() < 0.6, "{found:?}");
                assert!((found.depth.value / 0.5 - 1.0).abs() < 0.5, "{found:?}");
                // Rife and Boorstyn: √3/(π·400 s) of that.
                assert!((found.frequency.error * 400.0 / (0.1 * 3f64.sqrt() / PI) - 1.0).abs() < 0.5, "{found:?}");
                assert_eq!(found.of_phase, phase > 0.0, "{found:?}");
            }
        }
    }

    /// A random walk of 0.7 rad; then with a change of half a rad beside it.
    #[test]
    fn a_phase_that_wanders_is_no_change_of_it() {
        let changed = |seed: u64, depth: f64| {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let mut phase = 0.0;
            let value = |at: usize| {
                phase += 0.7 / (SAMPLES as f64).sqrt() * random.sample::<f64, _>(StandardNormal);
                let change = depth * (TAU * 5.3 * at as f64 / SAMPLES as f64).sin();
                let noise: f64 = random.sample(StandardNormal);
                12.0 * (TAU * 7.3 * 0.02 * at as f64 + phase + change).sin() + noise
            };
            let series = UniformSeries::new(0.02, (0..SAMPLES).map(value).collect());
            let sine = Sine::fit_near(&series, 7.3, 0.5 / series.duration());
            Modulation::find(&sine, &sine.subtracted_from(&series), 2.0 * 0.02, |_| false)
        };
        // 3 or more of 60 have a probability of 0.003 %.
        let wrong = (0..60).filter(|&seed| changed(seed, 0.0).is_some()).count();
        assert!(wrong < 3, "{wrong} of 60");
        let found = (0..10).filter_map(|seed| changed(seed, 0.5)).filter(|found| found.of_phase);
        let right = found.filter(|found| (found.frequency.value * 400.0 - 5.3).abs() < 0.5).count();
        assert_eq!(right, 10);
    }

    #[test]
    fn a_line_beside_another_is_no_change_of_it() {
        // Two equal lines, 12 resolutions apart: half of the other's power is in either part.
        let value = |at: usize| {
            let turns = 7.3 * 0.02 * at as f64;
            (TAU * turns).sin() + (TAU * (turns + 12.0 * at as f64 / SAMPLES as f64)).cos()
        };
        let series = UniformSeries::new(0.02, (0..SAMPLES).map(value).collect());
        let sine = Sine::fit_near(&series, 7.3, 0.5 / series.duration());
        let rest = sine.subtracted_from(&series);
        let distance = 12.0 / series.duration();
        assert!(
            Modulation::find(&sine, &rest, 0.04, |_| false)
                .is_some_and(|found| found.is_sideband(distance, series.duration()))
        );
        assert_eq!(Modulation::find(&sine, &rest, 0.04, |of| is_same(of, distance, series.duration())), None);
    }

    #[test]
    fn lines_at_multiples_of_a_change_are_its_sidebands() {
        let change = |turns: f64| MeasuredValue { value: turns / 400.0, error: 0.01 / 400.0 };
        let (frequency, depth) = (change(8.0), change(1.0));
        let found = Modulation { frequency, depth, of_phase: false, statistic: 100.0, with_multiples: 100.0 };
        let is_sideband = |turns: f64| found.is_sideband(turns / 400.0, 400.0);
        assert!([8.0, -24.0, 40.5].into_iter().all(is_sideband));
        // The fifth has one part in 25 of 25 times the noise.
        assert!(![4.0, 20.0, 88.0].into_iter().any(is_sideband));
        let clearer = Modulation { statistic: 1000.0, ..found };
        assert!(clearer.is_sideband(88.0 / 400.0, 400.0));
    }

    #[test]
    fn steady_sines_have_none() {
        let false_alarms = (100..400).filter(|&seed| found(seed, 0.0, 0.0).is_some()).count();
        // Four or more of 300 have a probability of 0.03 %.
        assert!(false_alarms <= 3, "{false_alarms}");
    }
}
