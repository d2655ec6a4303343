//! Figures on the pages of allan-core about its estimators: bytes, longest averaging times, degrees of freedom. These tests are here
//! because the packaged crate has no access to the generator of documentation.

use allan_core::confidence::edf;
use allan_core::{Cascade, VarianceFractions};
use system_tests::generated;

const README: &str = "allan-core/README.md";
const PARAMETERS: &str = "allan-core/guide/parameters.md";

/// A number with its digits in groups of three.
fn grouped(number: usize) -> String {
    if number < 1_000 { number.to_string() } else { format!("{},{:03}", number / 1_000, number % 1_000) }
}

/// Bytes of estimators with 16, 20 and 24 octaves.
fn bytes<const OVERLAP: usize>() -> [String; 3] {
    [Cascade::<16, OVERLAP>::memory(), Cascade::<20, OVERLAP>::memory(), Cascade::<24, OVERLAP>::memory()].map(grouped)
}

/// The degrees of freedom of white noise in a record of 1000 averaging times, as a percentage of those with full
/// overlap.
fn percent_of_freedom(overlap: u32) -> f64 {
    let freedom = |overlap: u32| edf(1_024, 998 * u64::from(overlap) + 1, overlap, VarianceFractions::WHITE);
    // The loss of an overlap falls with its square, so 16 lacks a third of its gain over 8.
    let full = freedom(16) + (freedom(16) - freedom(8)) / 3.0;
    100.0 * freedom(overlap) / full
}

#[test]
fn the_bytes_of_an_estimator_are_in_the_docs() {
    let by_overlap = [bytes::<4>(), bytes::<8>(), bytes::<16>()];
    let mut table = "| | `OVERLAP` 4 | 8 | 16 |\n|---|---|---|---|\n".to_owned();
    for (at, octaves) in [16, 20, 24].into_iter().enumerate() {
        let cells = by_overlap.each_ref().map(|bytes| bytes[at].as_str());
        table += &format!("| {octaves} octaves | {} |\n", cells.join(" | "));
    }
    generated(README, "memory", &table);
    generated(PARAMETERS, "overlap-16", &by_overlap[2].join(", "));
}

#[test]
fn the_degrees_of_freedom_of_an_overlap_are_in_the_docs() {
    let [of_4, of_8] = [4, 8].map(|overlap| format!("{:.0} %", percent_of_freedom(overlap)));
    assert!(percent_of_freedom(16) > 99.0, "with 16 {} %", percent_of_freedom(16));
    generated(README, "freedom", &format!("{of_4} with an overlap of 4, {of_8} with 8"));
    generated(PARAMETERS, "overlap-4", &format!("{} | {of_4}", bytes::<4>().join(", ")));
    generated(PARAMETERS, "overlap-8", &format!("{} | {of_8}", bytes::<8>().join(", ")));
}

#[test]
fn the_longest_averaging_times_are_in_the_docs() {
    let mut table = "| `OCTAVES` | longest averaging time |\n|---|---|\n".to_owned();
    for octaves in [12, 16, 20, 24_u32] {
        // The sample rate is 200 samples a second.
        let text = match f64::from(1_u32 << (octaves - 1)) / 200.0 {
            seconds if seconds < 60.0 => format!("{seconds:.0} s"),
            seconds if seconds < 600.0 => format!("{:.1} min", seconds / 60.0),
            seconds if seconds < 3_600.0 => format!("{:.0} min", seconds / 60.0),
            seconds => format!("{:.1} h", seconds / 3_600.0),
        };
        table += &format!("| {octaves} | {text} |\n");
    }
    generated(PARAMETERS, "longest", &table);
}

#[test]
fn the_scatter_of_a_point_is_in_the_docs() {
    let mut table = "| record, in averaging times | standard deviation of σ |\n|---|---|\n".to_owned();
    for length in [10, 30, 100, 1_000] {
        // n is 1024 with 8-fold overlap; `length` is that of the record in averaging times.
        let edf = edf(1_024, (length - 2) * 8 + 1, 8, VarianceFractions::WHITE);
        let percent = 100.0 / (2.0 * edf).sqrt();
        let digits = if percent < 10.0 { 1 } else { 0 };
        table += &format!("| {} τ | {percent:.digits$} % |\n", grouped(length as usize));
    }
    generated("allan-core/guide/recording.md", "scatter", &table);
}
