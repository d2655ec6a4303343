//! Confidence on simulated noise: coverage of the bounds, degrees of freedom at every overlap, noise types.

use allan_core::{Cascade, Curve, PowerLaw, VarianceFractions};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::sync::LazyLock;

fn assert_coverage(records: &SimulatedRecords) {
    let compared: Vec<usize> = (0..OCTAVES).filter(|&octave| records.dof[octave] >= 3.0).collect();
    assert!(compared.len() >= 10, "all but the last octave, at least");
    for octave in compared {
        let share = |covered: u32| f64::from(covered) / RECORDS as f64;
        let (known, identified) = (share(records.covered[octave]), share(records.covered_as_identified[octave]));
        println!("n = 2^{octave}: edf {:.1}, coverage {known}, {identified}", records.dof[octave]);
        assert!((0.94..=0.96).contains(&known), "n = 2^{octave}, edf {}: {known}", records.dof[octave]);
        // Here the noise type is classified from the same record.
        assert!(identified >= 0.93, "n = 2^{octave}, edf {}: {identified}", records.dof[octave]);
    }
}

#[test]
fn bounds_cover_white_noise_in_94_to_96_percent() {
    assert_coverage(&WHITE);
}

#[test]
fn bounds_cover_flicker_noise_in_94_to_96_percent() {
    assert_coverage(&FLICKER);
}

#[test]
fn bounds_cover_a_random_walk_in_94_to_96_percent() {
    assert_coverage(&WALK);
}

#[test]
fn bounds_cover_a_mixture_in_94_to_96_percent() {
    assert_coverage(&MIXTURE);
}

#[test]
fn a_pure_noise_is_classified_correctly_in_95_percent() {
    for (records, noise) in [(&*WHITE, PowerLaw::White), (&*FLICKER, PowerLaw::Flicker), (&*WALK, PowerLaw::RandomWalk)]
    {
        for (octave, named) in records.named.iter().enumerate() {
            let right = f64::from(named[noise as usize]) / RECORDS as f64;
            println!("n = 2^{octave}: {noise:?} in {right}");
            assert!(right >= 0.95, "n = 2^{octave}: {noise:?} in {right}");
        }
    }
}

/// Degrees of freedom at each overlap over those of full overlap, for 2¹⁷ samples and `n` = 2¹⁰ to 2¹⁴,
/// which is the same as 2¹² samples and `n` = 2⁵ to 2⁹. Computed independently from Greenhall's sums.
fn assert_loss(records: &SimulatedRecords, table: &[[f64; OVERLAPS]; 5]) {
    for (octave, row) in (5..).zip(table) {
        let found = records.equivalent_dof(octave);
        for (overlap, ratio) in row.iter().enumerate() {
            let (found, expected) = (found[overlap] / found[OVERLAPS - 1], ratio / row[OVERLAPS - 1]);
            // Three standard deviations of 4,000 runs, by their bootstrap: 0.02 for P = 1 and 2, 0.01 beyond.
            let tolerance = if overlap < 2 { 0.06 } else { 0.03 };
            assert!((found - expected).abs() < tolerance, "n = 2^{octave}, P = {}: {found}, {expected}", 1 << overlap);
        }
    }
}

#[test]
fn partial_overlap_costs_the_calculated_degrees_of_freedom() {
    assert_loss(
        &WHITE,
        &[
            [0.447, 0.764, 0.929, 0.982, 0.996],
            [0.450, 0.767, 0.931, 0.983, 0.996],
            [0.457, 0.773, 0.934, 0.985, 0.997],
            [0.470, 0.784, 0.942, 0.989, 0.999],
            [0.499, 0.810, 0.959, 0.998, 1.004],
        ],
    );
    assert_loss(
        &FLICKER,
        &[
            [0.758, 0.974, 0.999, 1.001, 1.000],
            [0.762, 0.978, 1.001, 1.002, 1.001],
            [0.771, 0.985, 1.004, 1.004, 1.002],
            [0.790, 1.000, 1.013, 1.008, 1.004],
            [0.832, 1.035, 1.032, 1.018, 1.009],
        ],
    );
    assert_loss(
        &WALK,
        &[
            [0.965, 1.002, 1.002, 1.001, 1.000],
            [0.971, 1.006, 1.004, 1.002, 1.001],
            [0.983, 1.014, 1.008, 1.004, 1.002],
            [1.010, 1.030, 1.017, 1.008, 1.004],
            [1.072, 1.069, 1.037, 1.019, 1.010],
        ],
    );
}

/// Counts to a standard deviation of 1: rounding adds 10⁻⁷ of the white variance.
const SCALE: f64 = 1_000.0;

/// White, flicker and random-walk noise in these amounts.
#[derive(Debug, Clone, Copy)]
struct Noise {
    white: f64,
    flicker: f64,
    walk: f64,
}

const WHITE_NOISE: Noise = Noise { white: 1.0, flicker: 0.0, walk: 0.0 };
const FLICKER_NOISE: Noise = Noise { white: 0.0, flicker: 1.0, walk: 0.0 };
const RANDOM_WALK: Noise = Noise { white: 0.0, flicker: 0.0, walk: 1.0 };
/// White noise up to n = 16, flicker noise around 64, random walk from 256.
const MIXED_NOISE: Noise = Noise { white: 1.0, flicker: 0.15, walk: 0.012 };

/// Flicker noise is a sum of Markov processes of equal variance whose relaxation times are a factor of 4 apart, from
/// two thirds of a sample, below which it would be white, to 40 times the record.
const MARKOV: usize = 10;

/// Factor by which the state of a process decays from one sample to the next.
fn kept(process: usize) -> f64 {
    (-1.5 / 4_f64.powi(process as i32)).exp()
}

impl Noise {
    fn record(self, samples: usize, seed: u64) -> Vec<i32> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let (mut markov, mut walk) = ([0.0; MARKOV], 0.0);
        markov.iter_mut().for_each(|state| *state = normal());
        let sample = |_| {
            let mut value = 0.0;
            if self.white > 0.0 {
                value += self.white * normal();
            }
            if self.flicker > 0.0 {
                for (process, state) in markov.iter_mut().enumerate() {
                    let kept = kept(process);
                    *state = kept * *state + (1.0 - kept * kept).sqrt() * normal();
                    value += self.flicker * *state;
                }
            }
            if self.walk > 0.0 {
                walk += self.walk * normal();
                value += walk;
            }
            (value * SCALE).round() as i32
        };
        (0..samples).map(sample).collect()
    }

    /// The three parts of the Allan variance, in counts²: white, flicker, walk.
    fn parts(self, n: u64) -> [f64; 3] {
        let real = n as f64;
        let markov = |process: usize| {
            // The variance of a sum of m values, from the autocovariance.
            let sum =
                |m: u64| m as f64 + 2.0 * (1..m).map(|j| (m - j) as f64 * kept(process).powf(j as f64)).sum::<f64>();
            (4.0 * sum(n) - sum(2 * n)) / (2.0 * real * real)
        };
        let flicker = if self.flicker > 0.0 { (0..MARKOV).map(markov).sum() } else { 0.0 };
        let parts = [1.0 / real, flicker, (2.0 * real * real + 1.0) / (6.0 * real)];
        let amounts = [self.white, self.flicker, self.walk];
        [0, 1, 2].map(|k| parts[k] * amounts[k] * amounts[k] * SCALE * SCALE)
    }

    fn avar(self, n: u64) -> f64 {
        self.parts(n).iter().sum()
    }

    fn variance_fractions(self, n: u64) -> VarianceFractions {
        let [white, flicker, random_walk] = self.parts(n).map(|part| part / self.avar(n));
        VarianceFractions { quantization: 0.0, white, flicker, random_walk }
    }
}

const RECORDS: u64 = 4_000;
const SAMPLES: usize = 1 << 12;
const OCTAVES: usize = 11;
/// P = 1, 2, 4, 8, 16.
const OVERLAPS: usize = 5;

static WHITE: LazyLock<SimulatedRecords> = LazyLock::new(|| SimulatedRecords::run(WHITE_NOISE, 0));
static FLICKER: LazyLock<SimulatedRecords> = LazyLock::new(|| SimulatedRecords::run(FLICKER_NOISE, 10_000));
static WALK: LazyLock<SimulatedRecords> = LazyLock::new(|| SimulatedRecords::run(RANDOM_WALK, 20_000));
static MIXTURE: LazyLock<SimulatedRecords> = LazyLock::new(|| SimulatedRecords::run(MIXED_NOISE, 30_000));

/// The results of all records of one noise, by octave.
struct SimulatedRecords {
    /// Calculated degrees of freedom, P = 8.
    dof: [f64; OCTAVES],
    /// Number of bounds that cover the truth, with the true noise and with the classified noise.
    covered: [u32; OCTAVES],
    covered_as_identified: [u32; OCTAVES],
    /// Number of records classified as each noise.
    named: [[u32; 4]; OCTAVES],
    /// Sum and sum of squares of the variances that each overlap measured, over the true variance.
    measured: [[(f64, f64); OVERLAPS]; OCTAVES],
}

impl SimulatedRecords {
    fn run(noise: Noise, seed: u64) -> Self {
        let truth: Vec<_> =
            (0..OCTAVES).map(|octave| (noise.avar(1 << octave), noise.variance_fractions(1 << octave))).collect();
        let octave = |n: u64| n.trailing_zeros() as usize;
        let mut records = Self {
            dof: [0.0; OCTAVES],
            covered: [0; OCTAVES],
            covered_as_identified: [0; OCTAVES],
            named: [[0; 4]; OCTAVES],
            measured: [[(0.0, 0.0); OVERLAPS]; OCTAVES],
        };
        for record in 0..RECORDS {
            let record = noise.record(SAMPLES, seed + record);
            let curves = [
                curve::<1>(&record),
                curve::<2>(&record),
                curve::<4>(&record),
                curve::<8>(&record),
                curve::<16>(&record),
            ];
            for (overlap, curve) in curves.iter().enumerate() {
                for point in curve.points() {
                    let ratio = point.avar / truth[octave(point.n)].0;
                    let (sum, squares) = &mut records.measured[octave(point.n)][overlap];
                    (*sum, *squares) = (*sum + ratio, *squares + ratio * ratio);
                }
            }
            let [.., identified, _] = curves;
            for point in identified.points() {
                let octave = octave(point.n);
                records.named[octave][point.power_law as usize] += 1;
                records.covered_as_identified[octave] += u32::from((point.low..=point.high).contains(&truth[octave].0));
            }
            for point in identified.with_confidence(|point| truth[octave(point.n)].1).points() {
                let octave = octave(point.n);
                records.dof[octave] = point.edf;
                records.covered[octave] += u32::from((point.low..=point.high).contains(&truth[octave].0));
            }
        }
        records
    }

    /// Degrees of freedom by the scatter of the records, by overlap.
    fn equivalent_dof(&self, octave: usize) -> [f64; OVERLAPS] {
        self.measured[octave].map(|(sum, squares)| {
            let mean = sum / RECORDS as f64;
            2.0 * mean * mean / (squares / RECORDS as f64 - mean * mean)
        })
    }
}

fn curve<const OVERLAP: usize>(record: &[i32]) -> Curve<OCTAVES> {
    let mut cascade = Cascade::<OCTAVES, OVERLAP>::new();
    cascade.push_slice(record);
    cascade.curve(1.0)
}
