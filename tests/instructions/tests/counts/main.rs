//! Builds the counting images for both cores, runs them in QEMU and compares the counts with bounds.
//!
//! The board mps2-an386 has a Cortex-M4F. For the Cortex-M0+, whose board QEMU lacks, the image is compiled for
//! ARMv6-M and runs on the Cortex-M3 of mps2-an385, which executes the same instructions.

mod calls;
mod functions;
mod image;

use image::{Counts, M0_PLUS, M4F};
use std::ops::RangeInclusive;

/// The count may change by a tenth with the compiler.
fn band(count: f64) -> RangeInclusive<f64> {
    0.9 * count..=1.1 * count
}

fn assert_counts(counts: &Counts, expected: &[(&str, f64)]) {
    let counted = expected.iter().map(|&(name, expected)| (name, counts.number(name), expected));
    let others: Vec<_> = counted.filter(|(_, count, expected)| !band(*expected).contains(count)).collect();
    assert!(others.is_empty(), "name, instructions, and expected instructions ± 10 %: {others:?}");
}

#[test]
fn the_estimator_takes_as_many_instructions_as_measured_on_a_cortex_m4f() {
    let counts = M4F.counts();
    assert!(counts.number("push_p8") <= 200.0, "a sample takes {} instructions on average", counts.number("push_p8"));
    assert!(counts.number("lossy_push_p8") <= 250.0, "{} with 1 % of them missing", counts.number("lossy_push_p8"));
    assert_counts(
        counts,
        &[
            ("push_p4", 164.0),
            ("push_p8", 197.0),
            ("push_p16", 213.0),
            ("early_push_p8", 418.0),
            ("push_p8_24_bits", 694.0),
            ("worst_push_p8", 3_811.0),
            ("lossy_push_p8", 222.0),
            ("gap_of_1_p8", 4_900.0),
            ("gap_of_100_p8", 9_490.0),
            ("longest_gap_p8", 19_146.0),
            ("coupling_p8", 1_506.0),
            ("hadamard_p8", 1_299.0),
            ("fractional_p8", 1_252.0),
        ],
    );
}

#[test]
fn the_estimator_takes_as_many_instructions_as_measured_on_a_cortex_m0_plus() {
    let counts = M0_PLUS.counts();
    assert!(counts.number("lossy_push_p8") <= 650.0, "{} with 1 % of them missing", counts.number("lossy_push_p8"));
    assert_counts(
        counts,
        &[
            ("push_p4", 415.0),
            ("push_p8", 506.0),
            ("push_p16", 606.0),
            ("early_push_p8", 886.0),
            ("push_p8_24_bits", 2_309.0),
            ("worst_push_p8", 12_412.0),
            ("lossy_push_p8", 553.0),
            ("gap_of_1_p8", 14_133.0),
            ("gap_of_100_p8", 21_250.0),
            ("longest_gap_p8", 35_624.0),
        ],
    );
}

/// Name, instructions, and a bound on the bytes of stack, an interrupt's included. The tone is a square wave, which
/// adds two terms: such a trace is about the longest one.
const FITS: [(&str, f64, f64); 5] = [
    ("fit", 30.1e6, 7_100.0),
    ("goodness", 2.87e6, 5_200.0),
    ("trace_nothing", 135e6, 9_300.0),
    ("trace_tone", 2.6e9, 10_000.0),
    ("sensitivities", 50.4e6, 11_800.0),
];

#[test]
fn fit_and_trace_take_instructions_and_stack_as_measured_on_a_cortex_m4f() {
    let counts = M4F.counts();
    assert_counts(counts, &FITS.map(|(name, instructions, _)| (name, instructions)));
    let stacks = FITS.map(|(name, _, limit)| (name, counts.number(&format!("{name}_stack")), limit));
    assert!(stacks.iter().all(|(_, stack, limit)| stack <= limit), "name, bytes of stack, and their limit: {stacks:?}");
}

#[test]
fn the_estimator_is_within_its_memory_on_both_cores() {
    for target in [M4F, M0_PLUS] {
        let counts = target.counts();
        println!("P = 4, 8, 16: {}, {}, {} bytes", counts.number("p4"), counts.number("p8"), counts.number("p16"));
        assert!(counts.number("p4") <= 2_900.0 && counts.number("p8") <= 3_700.0);
    }
}
