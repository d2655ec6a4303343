//! Builds the counting images for both cores, runs them in QEMU and compares the counts with bounds.
//!
//! The board mps2-an386 has a Cortex-M4F. For the Cortex-M0+, whose board QEMU lacks, the image is compiled for
//! ARMv6-M and runs on the Cortex-M3 of mps2-an385, which executes the same instructions.

mod calls;
mod functions;
mod image;

use image::{Counts, M0_PLUS, M4F};
use std::ops::RangeInclusive;
use std::path::Path;

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
    let (lossy, gate) = (counts.number("lossy_push_p8"), counts.number("gate"));
    assert!(lossy + gate <= 250.0, "{lossy} with 1 % of them missing, and {gate} of the gate");
    assert_counts(
        counts,
        &[
            ("push_p4", 164.0),
            ("push_p8", 198.0),
            ("push_p16", 213.0),
            ("early_push_p8", 342.0),
            ("push_p8_24_bits", 694.0),
            ("worst_push_p8", 3_690.0),
            ("lossy_push_p8", 223.0),
            ("gate", 23.9),
            ("gap_of_1_p8", 4_691.0),
            ("gap_of_100_p8", 9_142.0),
            ("longest_gap_p8", 18_527.0),
            ("coupling_p8", 1_506.0),
            ("hadamard_p8", 1_227.0),
            ("fractional_p8", 423.0),
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
            ("push_p8", 505.0),
            ("push_p16", 606.0),
            ("early_push_p8", 746.0),
            ("push_p8_24_bits", 2_309.0),
            ("worst_push_p8", 11_892.0),
            ("lossy_push_p8", 542.0),
            ("gate", 31.2),
            ("gap_of_1_p8", 13_297.0),
            ("gap_of_100_p8", 20_340.0),
            ("longest_gap_p8", 34_779.0),
        ],
    );
}

/// Name, instructions, and a bound on the bytes of stack, an interrupt's included. The tone is a square wave, which
/// adds two terms: such a trace is about the longest one.
const FITS: [(&str, f64, f64); 5] = [
    ("fit", 30.1e6, 7_200.0),
    ("goodness", 2.87e6, 5_200.0),
    ("trace_nothing", 138e6, 9_300.0),
    ("trace_tone", 2.76e9, 10_000.0),
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

/// Asserts that the last cells of a page's row, separated by `separator`, are the number of this name on the two cores.
fn assert_row(page: &str, start: &str, separator: &str, name: &str) {
    let row = page.lines().rfind(|line| line.starts_with(start)).unwrap_or_else(|| panic!("no row {start}"));
    let cells: Vec<&str> = row.trim_end_matches(" |").rsplitn(3, separator).collect();
    for (core, cell) in [M0_PLUS, M4F].into_iter().zip(cells) {
        let count = core.counts().number(name);
        // In the page on the parameters the cells before the last one have other separators.
        let digits: String = cell.rsplit(" | ").next().unwrap_or(cell).chars().filter(char::is_ascii_digit).collect();
        let documented: f64 = digits.parse().expect("a number of instructions");
        println!("{start} {} | {count}", core.target());
        assert!(band(count).contains(&documented), "{start} {count} on {core:?}, not {cell}");
    }
}

/// The page on which a cost is stated; others quote it.
const COSTS: &str = include_str!("../../../../docs/costs.md");

#[test]
fn the_pages_have_the_instructions_of_a_sample() {
    let page = include_str!("../../../../allan-core/guide/parameters.md");
    for overlap in [4, 8, 16] {
        assert_row(page, &format!("| {overlap} |"), ", ", &format!("push_p{overlap}"));
    }
    for (row, name) in [
        ("| average |", "push_p8"),
        ("| average, 1 % of the samples missing |", "lossy_push_p8"),
        ("| the firmware's gate against gross errors, before it |", "gate"),
        ("| when every octave is due |", "worst_push_p8"),
        ("| the same after a gap of 1 sample |", "gap_of_1_p8"),
        ("| after 100 missing samples |", "gap_of_100_p8"),
        ("| after 2²⁰, the longest gap that is bridged |", "longest_gap_p8"),
    ] {
        assert_row(COSTS, row, " | ", name);
    }
}

/// The cells of a row of the page on costs, without "instructions".
fn stated(row: &str) -> Vec<&'static str> {
    let line = COSTS.lines().find(|line| line.starts_with(&format!("| {row} |")));
    let cells = line.unwrap_or_else(|| panic!("no row {row}")).trim_matches('|').split('|').skip(1);
    cells.map(|cell| cell.trim().trim_end_matches(" instructions")).collect()
}

#[test]
fn what_quotes_a_cost_has_the_figure_of_the_page_on_costs() {
    let [average, lossy, most] =
        ["average", "average, 1 % of the samples missing", "when every octave is due"].map(stated);
    let [one, hundred, longest] =
        ["the same after a gap of 1 sample", "after 100 missing samples", "after 2²⁰, the longest gap that is bridged"]
            .map(stated);
    let [fit, goodness, nothing, tone, sensitivities] = [
        "fit of N, B and K with bounds",
        "its p-value",
        "trace that finds nothing",
        "trace that adds the two terms of a square wave",
        "sensitivities of one channel to two others",
    ]
    .map(|row| stated(row)[0]);
    let row = |label: &str, cells: &[&str]| format!("| {label} | {} |", cells.join(" | "));
    let start = |label: &str, cell: &str| format!("| {label} | {cell} |");
    let sentence =
        format!("takes {} instructions on average on a Cortex-M4F and {} on a Cortex-M0+", average[0], average[1]);
    let of_gaps =
        format!("{} instructions on average with 1 % of the samples missing, {} without", lossy[0], average[0]);
    let quotations = [
        ("README.md", sentence),
        ("docs/gaps.md", of_gaps),
        ("allan-core/README.md", format!("| {} on average, {} at most |", average[0], most[0])),
        ("allan-core/README.md", format!("| and `fit` of N, B and K | 56.1 kB | {fit} |")),
        ("allan-core/guide/parameters.md", format!("| {} |", average.join(", "))),
        ("allan-core/src/cascade.rs", row("instructions on average", &average)),
        ("allan-core/src/cascade.rs", row("instructions at most", &most)),
        ("allan-core/src/cascade/block.rs", row("instructions on average", &average)),
        ("allan-core/src/cascade/gap.rs", row("instructions of the next sample, 1 missing", &one)),
        ("allan-core/src/cascade/gap.rs", row("instructions of the next sample, 100 missing", &hundred)),
        ("allan-core/src/cascade/gap.rs", row("instructions of the next sample, 2²⁰ missing", &longest)),
        ("allan-core/src/fit.rs", start("instructions", fit)),
        ("allan-core/src/fit.rs", start("instructions", goodness)),
        ("allan-core/src/trace.rs", start("instructions", nothing)),
        ("allan-core/src/trace.rs", start("instructions that add two terms", tone)),
        ("allan-core/src/regression.rs", start("instructions", sensitivities)),
    ];
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    for (file, quotation) in quotations {
        let text = std::fs::read_to_string(root.join(file)).expect("a file");
        let words: Vec<&str> = text.split_whitespace().collect();
        assert!(words.join(" ").contains(&quotation), "{file} does not have \"{quotation}\"");
    }
}
