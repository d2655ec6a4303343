//! Builds the counting images for both cores, runs them in QEMU and compares the counts with bounds and with the documentation.
//!
//! The board mps2-an386 has a Cortex-M4F. QEMU has no board with a Cortex-M0+, so its image is compiled for ARMv6-M and
//! runs on the Cortex-M3 of mps2-an385, which executes the same instructions.

mod calls;
mod functions;
mod image;

use image::{Counts, M0_PLUS, M4F};
use system_tests::generated_within;

/// Relative change of a count that another compiler may cause.
const TOLERANCE: f64 = 0.1;

/// All checks are one test: each test may run as its own process, and the images take long to run.
#[test]
fn the_counts_of_the_images_are_within_their_bounds_and_in_the_docs() {
    let [m4f, m0_plus] = [M4F.counts(), M0_PLUS.counts()];
    the_estimator_is_within_its_budget(m4f, m0_plus);
    fit_and_trace_are_within_their_stack(m4f);
    what_the_docs_do_not_state_is_as_measured(m4f, m0_plus);
    functions::errors_and_instructions_are_those_of_their_table();
    functions::both_cores_give_the_same_bits();
    functions::libm_has_an_error_below_1e_14();
    write_the_page_on_costs(m4f, m0_plus);
    write_quotations(m4f, m0_plus);
    calls::the_documentation_of_each_call_has_its_counts();
}

#[test]
#[ignore = "long: an image for each of 26 calls takes a minute; run with --long"]
fn the_flash_of_each_call_is_in_the_docs() {
    calls::the_documentation_of_each_call_has_its_flash();
}

fn the_estimator_is_within_its_budget(m4f: &Counts, m0_plus: &Counts) {
    let push = m4f.number("push_p8");
    assert!(push <= 200.0, "a sample takes {push} instructions on average on a Cortex-M4F");
    let (lossy, gate) = (m4f.number("lossy_push_p8"), m4f.number("gate"));
    assert!(lossy + gate <= 250.0, "{lossy} with 1 % of the samples missing, and {gate} of the gate on a Cortex-M4F");
    let lossy = m0_plus.number("lossy_push_p8");
    assert!(lossy <= 650.0, "{lossy} with 1 % of the samples missing on a Cortex-M0+");
    for counts in [m4f, m0_plus] {
        let [p4, p8] = ["p4", "p8"].map(|overlap| counts.number(overlap));
        assert!(p4 <= 2_900.0 && p8 <= 3_700.0, "an estimator has {p4} bytes with P = 4, {p8} with 8");
    }
}

/// A fit or a trace on a Cortex-M4F. The tone is a square wave that adds two terms, which makes one of the longest
/// traces.
struct Fit {
    label: &'static str,
    name: &'static str,
    /// Bound on the bytes of stack, including an interrupt's.
    stack: f64,
}

const FITS: [Fit; 5] = [
    Fit { label: "fit of N, B and K with bounds", name: "fit", stack: 7_200.0 },
    Fit { label: "its p-value", name: "goodness", stack: 5_200.0 },
    Fit { label: "trace that finds nothing", name: "trace_nothing", stack: 9_300.0 },
    Fit { label: "trace that adds the two terms of a square wave", name: "trace_tone", stack: 10_000.0 },
    Fit { label: "sensitivities of one channel to two others", name: "sensitivities", stack: 11_800.0 },
];

fn fit_and_trace_are_within_their_stack(m4f: &Counts) {
    for Fit { label, name, stack: limit } in FITS {
        let stack = m4f.number(&format!("{name}_stack"));
        assert!(stack <= limit, "{label}: {stack} bytes of stack, more than {limit}");
    }
}

fn what_the_docs_do_not_state_is_as_measured(m4f: &Counts, m0_plus: &Counts) {
    for (counts, name, expected) in [
        (m4f, "early_push_p8", 342.0),
        (m4f, "push_p8_24_bits", 694.0),
        (m4f, "coupling_p8", 1_506.0),
        (m4f, "hadamard_p8", 1_227.0),
        (m4f, "fractional_p8", 423.0),
        (m0_plus, "early_push_p8", 746.0),
        (m0_plus, "push_p8_24_bits", 2_309.0),
    ] {
        let count = counts.number(name);
        assert!((count - expected).abs() <= TOLERANCE * expected, "{name}: {count} instructions, not {expected}");
    }
}

/// A count, with three digits from a million on.
fn figure(count: f64) -> String {
    let (number, unit) = if count < 1e6 { (count, "") } else { (count / 1e6, " million") };
    let decimals = if unit.is_empty() { 0 } else { (2.0 - number.log10().floor()).max(0.0) as usize };
    let text = format!("{number:.decimals$}");
    let whole = text.split('.').next().unwrap_or_default().len();
    let (thousands, rest) = text.split_at(whole.saturating_sub(3));
    format!("{thousands}{}{rest}{unit}", if thousands.is_empty() { "" } else { "," })
}

fn write_the_page_on_costs(m4f: &Counts, m0_plus: &Counts) {
    let mut samples =
        "| `Cascade<24, 8>`, instructions of one sample | Cortex-M4F | Cortex-M0+ |\n|---|---|---|\n".to_owned();
    for (label, name) in [
        ("average", "push_p8"),
        ("average, 1 % of the samples missing", "lossy_push_p8"),
        ("the firmware's gate against gross errors, before it", "gate"),
        ("when every octave is due", "worst_push_p8"),
        ("the same after a gap of 1 sample", "gap_of_1_p8"),
        ("after 100 missing samples", "gap_of_100_p8"),
        ("after 2²⁰, the longest gap that is bridged", "longest_gap_p8"),
    ] {
        let [first, second] = [m4f, m0_plus].map(|counts| figure(counts.number(name)));
        samples += &format!("| {label} | {first} | {second} |\n");
    }
    generated_within("docs/costs.md", "samples", &samples, TOLERANCE);
    let mut fits = "| | instructions | time | stack |\n|---|---|---|---|\n".to_owned();
    for Fit { label, name, stack } in FITS {
        let count = m4f.number(name);
        let seconds = count / 168e6;
        let decimals = (1.0 - seconds.log10().floor()).max(0.0) as usize;
        let kilobytes = stack / 1e3;
        fits += &format!("| {label} | {} | {seconds:.decimals$} s | below {kilobytes:.1} kB |\n", figure(count));
    }
    generated_within("docs/costs.md", "fits", &fits, TOLERANCE);
}

fn write_quotations(m4f: &Counts, m0_plus: &Counts) {
    let [average, lossy, most, fit, trace] =
        ["push_p8", "lossy_push_p8", "worst_push_p8", "fit", "trace_tone"].map(|name| figure(m4f.number(name)));
    let on_m0_plus = |name: &str| figure(m0_plus.number(name));
    let curve = figure(m4f.number("Cascade::curve average"));
    for (page, part, text) in [
        (
            "README.md",
            "push",
            format!("{average} instructions on average on a Cortex-M4F and {}", on_m0_plus("push_p8")),
        ),
        (
            "docs/gaps.md",
            "push",
            format!("{lossy} instructions on average with 1 % of the samples missing, {average} without"),
        ),
        ("allan-core/README.md", "push", format!("{average} on average, {most} at most")),
        ("allan-core/README.md", "curve", curve),
        ("allan-core/README.md", "fit", fit.clone()),
        (
            "allan-core/README.md",
            "limits",
            format!(
                "{fit} instructions on a Cortex-M4F and {} on a Cortex-M0+, a trace up to {trace} on a Cortex-M4F",
                on_m0_plus("fit::fit average")
            ),
        ),
    ] {
        generated_within(page, part, &text, TOLERANCE);
    }
    for overlap in [4, 8, 16] {
        let [first, second] = [m4f, m0_plus].map(|counts| figure(counts.number(&format!("push_p{overlap}"))));
        let part = format!("instructions-{overlap}");
        generated_within("allan-core/guide/parameters.md", &part, &format!("{first}, {second}"), TOLERANCE);
    }
}
