//! Counts the instructions and the stack of every call whose documentation has a table of costs, and prints them over
//! semihosting, one per line: `call NAME METRIC NUMBER`.
#![no_std]
#![no_main]

mod emulator;
#[path = "../../../allan-core/tests/support/late_state.rs"]
mod late_state;

use allan_core::fit::{fit, fit_power_laws, fit_shapes, goodness};
use allan_core::term::Markov;
use allan_core::{
    Cascade, Coupling, Curve, FractionalOctaves, Hadamard, NoiseTerm, OctaveSums, Quantizer, Snapshot, TimeStamps,
};
use core::hint::black_box;
use cortex_m_rt::entry;
use cortex_m_semihosting::hprintln;
use emulator::{instructions, stack_bytes};

const OCTAVES: usize = 24;
const SAMPLES: usize = 4_000;
/// Number of estimators whose next call is counted.
const COPIES: usize = 50;

type Estimator = Cascade<OCTAVES, 8>;

#[entry]
fn main() -> ! {
    emulator::start();
    sample_by_sample();
    longest_samples();
    whole_estimators();
    serialised();
    other_estimators();
    fits();
    emulator::success()
}

/// Noise with a standard deviation of 20 counts, like that of a gyro at rest.
fn noise() -> [i32; SAMPLES] {
    let mut state = 1_u64;
    let mut uniform = || {
        state = state * 16_807 % 2_147_483_647;
        (state % 41) as i32 - 20
    };
    core::array::from_fn(|_| uniform() + uniform() + uniform())
}

/// Prints the instructions of one call; `work` makes `times` calls.
fn count(name: &str, metric: &str, times: usize, work: impl FnOnce()) {
    hprintln!("call {} {} {}", name, metric, instructions(work) / times as u64);
}

fn stack(name: &str, work: impl FnOnce()) {
    hprintln!("call {} stack {}", name, stack_bytes(work));
}

fn measure(name: &str, work: &mut dyn FnMut()) {
    count(name, "average", 1, &mut *work);
    stack(name, work);
}

fn sample_by_sample() {
    let samples = noise();
    let mut late = black_box(late_state::after_constant::<OCTAVES, 8>(0, 1 << 20));
    samples.iter().for_each(|&sample| late.push(sample));
    count("Cascade::push", "average", SAMPLES, || samples.iter().for_each(|&sample| late.push(sample)));
    count("Cascade::push_slice", "average", SAMPLES, || late.push_slice(black_box(&samples)));
    let quantizer = black_box(Quantizer::new(0.5, 0.25).expect("a grid"));
    count("Quantizer::count", "average", SAMPLES, || {
        samples.iter().for_each(|&sample| _ = black_box(quantizer.count(black_box(sample as f32))));
    });
    stack("Quantizer::count", || _ = black_box(quantizer.count(black_box(1.5_f32))));
    let mut stamps = black_box(TimeStamps::new(1_000).expect("a period"));
    count("TimeStamps::push", "average", SAMPLES, || {
        for (time, &sample) in (0_u64..).step_by(1_000).zip(&samples) {
            _ = black_box(stamps.push(&mut late, black_box(time), sample));
        }
    });
    black_box(&late);
}

/// Counts calls on estimators for which the next sample is due in all octaves, with differences of more than 16 bits.
/// An estimator of 24 octaves bridges gaps of at most 2²⁰ samples.
fn longest_samples() {
    const SAMPLE: i32 = 1 << 23;
    let mut estimators = black_box([const { Estimator::new() }; COPIES]);
    let fill = |missing: u32, estimators: &mut [Estimator; COPIES]| {
        estimators.fill_with(|| late_state::after_constant(0, (1 << 26) - 1 - u64::from(missing)));
    };
    fill(0, &mut estimators);
    count("Cascade::push", "most", COPIES, || estimators.iter_mut().for_each(|each| each.push(black_box(SAMPLE))));
    fill(0, &mut estimators);
    stack("Cascade::push", || estimators[0].push(black_box(SAMPLE)));
    stack("Cascade::push_slice", || estimators[1].push_slice(black_box(&[SAMPLE])));
    let mut stamps = black_box(TimeStamps::new(1_000).expect("a period"));
    stack("TimeStamps::push", || _ = black_box(stamps.push(&mut estimators[2], black_box(7), SAMPLE)));
    for (metric, missing) in [("1", 1), ("100", 100), ("longest", 1 << 20)] {
        fill(missing, &mut estimators);
        if missing == 1 {
            count("Cascade::gap", "average", COPIES, || estimators.iter_mut().for_each(|each| each.gap(black_box(1))));
        } else {
            estimators.iter_mut().for_each(|each| each.gap(black_box(missing)));
        }
        count("Cascade::gap", metric, COPIES, || estimators.iter_mut().for_each(|each| each.push(black_box(SAMPLE))));
    }
    fill(1, &mut estimators);
    stack("Cascade::gap", || {
        estimators[0].gap(black_box(1));
        estimators[0].push(black_box(SAMPLE));
    });
    black_box(&estimators);
}

/// Counts calls that act on a whole estimator.
fn whole_estimators() {
    let mut estimator = black_box(late_state::after_constant::<OCTAVES, 8>(0, 1 << 24));
    noise().iter().for_each(|&sample| estimator.push(sample));
    let mut snapshot = Snapshot::empty();
    let mut copy = || black_box(&estimator).snapshot_into(black_box(&mut snapshot));
    count("Cascade::snapshot_into", "average", 10, || (0..10).for_each(|_| copy()));
    stack("Cascade::snapshot_into", copy);
    // The curve exists before the call, so that it is not part of the measured stack.
    let mut curve = Curve::empty();
    let sums = |octave: usize| -> OctaveSums { estimator.octave_sums(octave).unwrap_or_default() };
    let mut rebuild = || Estimator::rebuild_curve(black_box(&mut curve), 0.01, estimator.len(), sums);
    count("Cascade::curve", "average", 1, &mut rebuild);
    stack("Cascade::curve", rebuild);
    let mut rebuild = || Estimator::rebuild_without_confidence(black_box(&mut curve), 0.01, estimator.len(), sums);
    count("Cascade::curve_without_confidence", "average", 1, &mut rebuild);
    stack("Cascade::curve_without_confidence", rebuild);
    let variance = || _ = black_box(black_box(&estimator).allan_variance(black_box(10)));
    count("Cascade::allan_variance", "average", 1, variance);
    stack("Cascade::allan_variance", variance);
    let mut other = Estimator::new();
    let mut restore = || black_box(&mut other).restore(estimator.len(), estimator.missing(), sums);
    count("Cascade::restore", "average", 1, &mut restore);
    stack("Cascade::restore", restore);
    let mut merge = || black_box(&mut other).merge(black_box(&estimator));
    count("Cascade::merge", "average", 1, &mut merge);
    stack("Cascade::merge", merge);
    let mut reset = || black_box(&mut other).reset();
    count("Cascade::reset", "average", 1, &mut reset);
    stack("Cascade::reset", reset);
    black_box((&curve, &other));
}

fn serialised() {
    let estimator = black_box(late_state::after_constant::<OCTAVES, 8>(7, 1 << 24));
    let (mut bytes, mut other) = ([0; 4_500], Estimator::new());
    let mut length = 0;
    let mut write = || length = postcard::to_slice(black_box(&estimator), &mut bytes).expect("room").len();
    count("Serialize", "average", 1, &mut write);
    stack("Serialize", write);
    let mut read = || {
        let mut words = postcard::Deserializer::from_bytes(black_box(&bytes[..length]));
        black_box(&mut other).read_serialized(&mut words).expect("a state");
    };
    count("Cascade::read_serialized", "average", 1, &mut read);
    stack("Cascade::read_serialized", read);
    assert!(other == estimator);
}

/// Counts the instructions per sample of estimators that use the sums of one channel, or of two for the coupling.
fn other_estimators() {
    let samples = noise();
    let mut coupling = black_box(Coupling::<OCTAVES>::new());
    let mut hadamard = black_box(Hadamard::<OCTAVES, 8>::new());
    let mut fractional = black_box(FractionalOctaves::<OCTAVES, 8>::new());
    let pushes = observed(&samples, |_, _| ());
    for (name, total) in [
        ("Coupling::observe", observed(&samples, |a, b| coupling.observe(a, b))),
        ("Hadamard::observe", observed(&samples, |a, _| hadamard.observe(a))),
        ("FractionalOctaves::observe", observed(&samples, |a, _| fractional.observe(a))),
    ] {
        hprintln!("call {} average {}", name, (total - pushes) / SAMPLES as u64);
    }
    let last = late_state::after_constant::<OCTAVES, 8>(7, 1 << 24);
    stack("Coupling::observe", || coupling.observe(black_box(&last), black_box(&last)));
    stack("Hadamard::observe", || hadamard.observe(black_box(&last)));
    stack("FractionalOctaves::observe", || fractional.observe(black_box(&last)));
    // Each estimator has now had a difference in every octave.
    measure("Coupling::points", &mut || _ = black_box(black_box(&coupling).points()));
    measure("Hadamard::points", &mut || _ = black_box(black_box(&hadamard).points(&last, 0.01)));
    measure("FractionalOctaves::curve", &mut || {
        _ = black_box(black_box(&fractional).curve::<{ 4 * OCTAVES }>(&last, 0.01));
    });
}

fn observed(samples: &[i32; SAMPLES], mut observe: impl FnMut(&Estimator, &Estimator)) -> u64 {
    let (mut a, mut b) = (Estimator::new(), Estimator::new());
    instructions(|| {
        for &sample in samples {
            a.push(sample);
            b.push(-sample);
            observe(black_box(&a), black_box(&b));
        }
    })
}

/// Counts fits of 20 points, as of an hour and a half at 204.8 samples a second. White noise and a random walk are
/// equal at n = 2¹⁰, and the points scatter as those of a measured curve.
fn fits() {
    const SAMPLES: u64 = 1 << 21;
    let mut state = 1_u64;
    let table: [(u64, f64); 20] = core::array::from_fn(|octave| {
        let n = 1_u64 << octave;
        state = state * 16_807 % 2_147_483_647;
        let deviation = ((state % 2_001) as f64 / 1_000.0 - 1.0) * 1.4 * libm::sqrt(n as f64 / SAMPLES as f64);
        (n, (1.0 / n as f64 + n as f64 / f64::from(1 << 20)) * (1.0 + deviation))
    });
    let curve = black_box(Curve::<20>::from_points(1.0 / 204.8, SAMPLES, 8, &table).expect("a table"));
    let mut model = allan_core::Model::new(1.0, []);
    measure("Curve::from_points", &mut || {
        _ = black_box(Curve::<20>::from_points(1.0 / 204.8, SAMPLES, 8, black_box(&table)));
    });
    measure("fit::fit", &mut || model = black_box(fit(black_box(&curve), &NoiseTerm::BASELINE)));
    measure("fit::fit_power_laws", &mut || _ = black_box(fit_power_laws(black_box(&curve), &NoiseTerm::BASELINE)));
    // The fit starts with a time constant of 100 s.
    let shapes = [NoiseTerm::AngleRandomWalk, NoiseTerm::Markov(Markov { time_constant: 100.0 })];
    measure("fit::fit_shapes", &mut || _ = black_box(fit_shapes(black_box(&curve), &shapes)));
    measure("fit::goodness", &mut || _ = black_box(goodness(black_box(&curve), &model)));
}
