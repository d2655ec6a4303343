//! Flash of the libraries on a Cortex-M.

use driver_footprint::{M0_PLUS, M4F, added_bytes, built, flash_bytes, panic_symbols};
use system_tests::generated_within;

/// The limits are the sizes when the test was written, plus a tenth.
#[test]
fn the_driver_takes_at_most_a_tenth_more_flash_than_when_it_was_measured() {
    for (features, limit) in [("burst", 7_300), ("everything", 21_100), ("asynchronous", 31_300)] {
        let bytes = added_bytes(M4F, features);
        println!("{features}: {bytes} bytes");
        assert!(bytes <= limit, "{features}: {bytes} bytes of flash, more than {limit}");
    }
}

/// A whole image for a Cortex-M4F, which has a single-precision floating-point unit.
struct WholeImage {
    /// Label in the tables of the documentation.
    label: &'static str,
    features: &'static str,
    /// The largest size that the documentation promises, bytes.
    limit: u32,
}

const IMAGES: [WholeImage; 5] = [
    WholeImage { label: "`push`, `push_slice`, `gap`", features: "push", limit: 10 * 1024 },
    WholeImage { label: "and `curve_without_confidence`", features: "variances", limit: 10 * 1024 },
    WholeImage { label: "and `fit_power_laws` of N, B and K", features: "power-laws", limit: 25 * 1024 },
    WholeImage { label: "`push` and `curve`", features: "curve", limit: 30 * 1024 },
    WholeImage { label: "and `fit` of N, B and K", features: "fit", limit: 57 * 1024 },
];

/// A kB is 1,024 bytes. Another compiler may add a twentieth.
#[test]
fn the_flash_of_whole_images_is_in_the_docs() {
    let mut rows = String::new();
    for WholeImage { label, features, limit } in IMAGES {
        let bytes = flash_bytes(&built(M4F, features));
        assert!(bytes <= limit, "{label}: {bytes} bytes of flash, more than {limit}");
        let size = format!("{:.1} kB", f64::from(bytes) / 1024.0);
        generated_within("allan-core/README.md", &format!("flash-{features}"), &size, 0.05);
        rows += &format!("| {label} | {size} |\n");
    }
    for (page, label) in [
        ("docs/costs.md", "image for a Cortex-M4F, optimised for size"),
        ("allan-core/guide/costs.md", "an image of a Cortex-M4F with"),
    ] {
        generated_within(page, "flash", &format!("| {label} | flash |\n|---|---|\n{rows}"), 0.05);
    }
}

/// All curves share the code of a fit: a second estimator adds only its sums and its curve.
#[test]
fn a_second_estimator_of_another_size_links_no_second_fit() {
    let [one, two] = ["fit", "two-fits"].map(|features| added_bytes(M4F, features));
    println!("one fit: {one} bytes, two: {two} bytes");
    // The code of a second fit would add 23 kB.
    assert!(two - one <= 11_000, "{} bytes for the second estimator", two - one);
}

#[test]
fn adding_samples_and_gaps_links_no_panic() {
    for target in [M4F, M0_PLUS] {
        assert_eq!(panic_symbols(&built(target, "push")), [""; 0], "{target}");
        // A fit indexes slices, so its image must have panics: the search for them works.
        assert!(!panic_symbols(&built(target, "fit")).is_empty(), "{target}");
    }
}
