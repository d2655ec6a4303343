//! Flash that the libraries take of a Cortex-M.

use driver_footprint::{M0_PLUS, M4F, added_bytes, built, flash_bytes, panic_symbols};

/// The limits are the sizes measured when the test was written, and a tenth.
#[test]
fn the_driver_takes_at_most_a_tenth_more_flash_than_when_it_was_measured() {
    for (features, limit) in [("burst", 7_300), ("everything", 21_100), ("asynchronous", 31_300)] {
        let bytes = added_bytes(M4F, features);
        println!("{features}: {bytes} bytes");
        assert!(bytes <= limit, "{features}: {bytes} bytes of flash, more than {limit}");
    }
}

/// Whole images for a Cortex-M4F, whose floating-point unit has single precision: the row of the table in the
/// documentation, the features, and the largest size that was promised, in bytes.
const IMAGES: [(&str, &str, u32); 5] = [
    ("`push`, `push_slice`, `gap`", "push", 10 * 1024),
    ("and `curve_without_confidence`", "variances", 10 * 1024),
    ("and `fit_power_laws` of N, B and K", "power-laws", 25 * 1024),
    ("`push` and `curve`", "curve", 30 * 1024),
    ("and `fit` of N, B and K", "fit", 57 * 1024),
];

/// A kB is 1,024 bytes.
#[test]
fn the_documentation_has_the_flash_of_whole_images() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../");
    let page = |path: &str| std::fs::read_to_string(format!("{folder}{path}")).expect("a page");
    let pages = ["allan-core/README.md", "allan-core/guide/costs.md", "docs/costs.md"].map(|path| (path, page(path)));
    let mut wrong = String::new();
    for (image, features, limit) in IMAGES {
        let bytes = flash_bytes(&built(M4F, features));
        println!("{image}: {bytes} bytes");
        assert!(bytes <= limit, "{image}: {bytes} bytes of flash, more than {limit}");
        let size = f64::from(bytes) / 1024.0;
        for (path, page) in &pages {
            let cell = page.lines().find_map(|line| line.strip_prefix(&format!("| {image} | "))?.split(" kB").next());
            let documented: Option<f64> = cell.and_then(|cell| cell.parse().ok());
            // A twentieth with the compiler.
            if documented.is_none_or(|documented| (documented - size).abs() > 0.05 * size) {
                wrong += &format!("{path}: {image}: {size:.1} kB, not {cell:?}\n");
            }
        }
    }
    assert_eq!(wrong, "", "\n{wrong}");
}

/// The code of a fit is that of all curves: a second estimator adds its own sums and its curve.
#[test]
fn a_second_estimator_of_another_size_links_no_second_fit() {
    let [one, two] = ["fit", "two-fits"].map(|features| added_bytes(M4F, features));
    println!("one fit: {one} bytes, two: {two} bytes");
    // A second fit would add 23 kB.
    assert!(two - one <= 11_000, "{} bytes for the second estimator", two - one);
}

#[test]
fn adding_samples_and_gaps_links_no_panic() {
    for target in [M4F, M0_PLUS] {
        assert_eq!(panic_symbols(&built(target, "push")), [""; 0], "{target}");
        // The search finds what it looks for: a fit indexes slices.
        assert!(!panic_symbols(&built(target, "fit")).is_empty(), "{target}");
    }
}
