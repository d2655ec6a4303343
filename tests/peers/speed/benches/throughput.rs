//! Time per sample: singly and in slices, at several lengths of the record, and with the optional statistics.
//!
//! `cargo bench -p speed --manifest-path tests/peers/Cargo.toml`; criterion prints the time of 1,000 samples and their rate.

#[path = "../../../../allan-core/tests/support/late_state.rs"]
mod late_state;

use allan_core::{Cascade, Coupling, FractionalOctaves, Hadamard};
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use late_state::after_constant;
use std::hint::black_box;

const OCTAVES: usize = 24;
const SAMPLES: usize = 1_000;

/// Counts like those of a gyro at rest, with a standard deviation of 20: sums of three uniform numbers.
fn samples() -> Vec<i32> {
    let mut state = 1_u64;
    let mut uniform = || {
        state = state * 16_807 % 2_147_483_647;
        (state % 41) as i32 - 20
    };
    (0..SAMPLES).map(|_| uniform() + uniform() + uniform()).collect()
}

fn overlap<const OVERLAP: usize>(criterion: &mut Criterion) {
    let samples = samples();
    let mut group = criterion.benchmark_group(format!("P = {OVERLAP}"));
    group.throughput(Throughput::Elements(SAMPLES as u64));
    for length in [1_000_000, 100_000_000, 10_000_000_000] {
        let fresh = after_constant::<OCTAVES, OVERLAP>(3, length);
        group.bench_function(BenchmarkId::new("push", length), |bencher| {
            let mut cascade = fresh.clone();
            bencher.iter(|| black_box(&samples).iter().for_each(|&sample| cascade.push(sample)));
        });
        group.bench_function(BenchmarkId::new("push_slice", length), |bencher| {
            let mut cascade = fresh.clone();
            bencher.iter(|| cascade.push_slice(black_box(&samples)));
        });
    }
}

fn optional_statistics(criterion: &mut Criterion) {
    let samples = samples();
    let mut group = criterion.benchmark_group("push of two channels, and");
    group.throughput(Throughput::Elements(SAMPLES as u64));
    let (mut a, mut b) = (Cascade::<OCTAVES, 8>::new(), Cascade::<OCTAVES, 8>::new());
    let (mut coupling, mut hadamard, mut fractional) =
        (Coupling::<OCTAVES>::new(), Hadamard::new(), FractionalOctaves::new());
    let mut run = |name: &str, observe: &mut dyn FnMut(&Cascade<OCTAVES, 8>, &Cascade<OCTAVES, 8>)| {
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                for &sample in black_box(&samples) {
                    a.push(sample);
                    b.push(-sample);
                    observe(&a, &b);
                }
            });
        });
    };
    run("nothing", &mut |_, _| ());
    run("their coupling", &mut |a, b| coupling.observe(a, b));
    run("the Hadamard variance", &mut |a, _| hadamard.observe(a));
    run("the factors between octaves", &mut |a, _| fractional.observe(a));
}

fn all(criterion: &mut Criterion) {
    overlap::<4>(criterion);
    overlap::<8>(criterion);
    overlap::<16>(criterion);
    optional_statistics(criterion);
}

criterion_group!(benches, all);
criterion_main!(benches);
