//! Average and largest instructions of the estimator, and of the estimators that use its sums.

use crate::emulator::instructions;
use crate::late_state;
use allan_core::{Cascade, Coupling, FractionalOctaves, Hadamard, Snapshot};
use core::hint::black_box;
use cortex_m_semihosting::{hprint, hprintln};

const OCTAVES: usize = 24;
const SAMPLES: usize = 4_000;
/// Number of estimators whose next push is the longest one.
const WORST: usize = 100;

/// Noise with a standard deviation of 20 counts, like that of a gyro at rest, times `factor`.
fn noise(factor: i32) -> [i32; SAMPLES] {
    let mut state = 1_u64;
    let mut uniform = || {
        state = state * 16_807 % 2_147_483_647;
        (state % 41) as i32 - 20
    };
    core::array::from_fn(|_| (uniform() + uniform() + uniform()) * factor)
}

pub(crate) fn count() {
    let sensor = noise(1);
    let wide = noise(1 << 16);
    push::<4>("push_p4", &sensor);
    push::<8>("push_p8", &sensor);
    push::<16>("push_p16", &sensor);
    push::<8>("push_p8_24_bits", &wide);
    worst::<4>("worst_push_p4");
    worst::<8>("worst_push_p8");
    worst::<16>("worst_push_p16");
    let mut cascade = black_box(Cascade::<OCTAVES, 8>::new());
    report("push_slice_p8", SAMPLES as u32, || cascade.push_slice(black_box(&sensor)));
    gaps("lossy_push_p8", &sensor);
    additional_estimators(&sensor);
    let curve = late_state::after_constant::<OCTAVES, 8>(0, 1 << 24);
    report("curve_p8", 10, || (0..10).for_each(|_| drop(black_box(black_box(&curve).curve(0.01)))));
    report("curve_without_confidence_p8", 10, || {
        (0..10).for_each(|_| drop(black_box(black_box(&curve).curve_without_confidence(0.01))));
    });
    let mut snapshot = Snapshot::empty();
    report("snapshot_p8", 10, || (0..10).for_each(|_| black_box(&curve).snapshot_into(black_box(&mut snapshot))));
    hprintln!("bytes snapshot_p8 {}", size_of::<Snapshot<OCTAVES, 8>>());
    hprintln!("bytes p4 {}", Cascade::<OCTAVES, 4>::memory());
    hprintln!("bytes p8 {}", Cascade::<OCTAVES, 8>::memory());
    hprintln!("bytes p16 {}", Cascade::<OCTAVES, 16>::memory());
}

/// Counts pushes in a long record, and those of its first 2040 samples.
fn push<const OVERLAP: usize>(name: &str, samples: &[i32; SAMPLES]) {
    let mut cascade = black_box(late_state::after_constant::<OCTAVES, OVERLAP>(0, 1 << 20));
    samples.iter().for_each(|&sample| cascade.push(sample));
    report(name, SAMPLES as u32, || samples.iter().for_each(|&sample| cascade.push(sample)));
    black_box(&cascade);
    cascade.reset();
    let samples = &samples[..2040];
    hprint!("early ");
    report(name, samples.len() as u32, || samples.iter().for_each(|&sample| cascade.push(sample)));
    black_box(&cascade);
}

/// Counts samples of which every hundredth is missing, and the longest sample after a gap, for which every line
/// changes, with differences of more than 16 bits. An estimator of 24 octaves bridges gaps of at most 2²⁰ samples.
fn gaps(name: &str, samples: &[i32; SAMPLES]) {
    let mut cascade = black_box(late_state::after_constant::<OCTAVES, 8>(0, 1 << 20));
    samples.iter().for_each(|&sample| cascade.push(sample));
    report(name, SAMPLES as u32, || {
        for hundred in samples.chunks(100) {
            hundred[1..].iter().for_each(|&sample| cascade.push(sample));
            cascade.gap(black_box(1));
        }
    });
    black_box(&cascade);
    let mut cascades = black_box([const { Cascade::<OCTAVES, 8>::new() }; WORST]);
    for (name, missing) in [("gap_of_1_p8", 1), ("gap_of_100_p8", 100), ("longest_gap_p8", 1 << 20)] {
        cascades.fill_with(|| late_state::after_constant::<OCTAVES, 8>(0, (1 << 26) - 1 - u64::from(missing)));
        report(name, WORST as u32, || {
            for cascade in &mut cascades {
                cascade.gap(black_box(missing));
                cascade.push(black_box(1 << 23));
            }
        });
        black_box(&cascades);
    }
}

/// Counts the push that completes a difference at every octave, with differences of more than 16 bits.
fn worst<const OVERLAP: usize>(name: &str) {
    let mut cascades = black_box([const { Cascade::<OCTAVES, OVERLAP>::new() }; WORST]);
    cascades.fill_with(|| late_state::after_constant::<OCTAVES, OVERLAP>(0, (1 << 26) - 1));
    report(name, WORST as u32, || cascades.iter_mut().for_each(|cascade| cascade.push(black_box(1 << 23))));
    black_box(&cascades);
}

type Channel = Cascade<OCTAVES, 8>;

/// Counts the instructions per sample of estimators that use the sums of one channel, or of two for the coupling.
fn additional_estimators(samples: &[i32; SAMPLES]) {
    let mut coupling = black_box(Coupling::<OCTAVES>::new());
    let mut hadamard = black_box(Hadamard::<OCTAVES, 8>::new());
    let mut fractional = black_box(FractionalOctaves::<OCTAVES, 8>::new());
    let pushes = run(samples, |_, _| ());
    for (name, total) in [
        ("coupling_p8", run(samples, |a, b| coupling.observe(a, b))),
        ("hadamard_p8", run(samples, |a, _| hadamard.observe(a))),
        ("fractional_p8", run(samples, |a, _| fractional.observe(a))),
    ] {
        hprintln!("count {} {}", name, (total - pushes) / SAMPLES as u64);
    }
}

fn run(samples: &[i32; SAMPLES], mut observe: impl FnMut(&Channel, &Channel)) -> u64 {
    let (mut a, mut b) = (Channel::new(), Channel::new());
    instructions(|| {
        for &sample in samples {
            a.push(sample);
            b.push(-sample);
            observe(black_box(&a), black_box(&b));
        }
    })
}

/// Prints the average instructions of a run; `work` makes `times` runs.
fn report(name: &str, times: u32, work: impl FnOnce()) {
    let tenths = instructions(work) / u64::from(black_box(times) / 10);
    hprintln!("count {} {}.{}", name, tenths / 10, tenths % 10);
}
