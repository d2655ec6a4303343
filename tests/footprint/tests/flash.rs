//! Flash that the libraries take of a Cortex-M.

use driver_footprint::{M4F, added_bytes, built, panic_symbols};

/// The limits are the sizes measured when the test was written, and a tenth.
#[test]
fn the_driver_takes_at_most_a_tenth_more_flash_than_when_it_was_measured() {
    for (features, limit) in [("burst", 6_600), ("everything", 21_100), ("asynchronous", 31_300)] {
        let bytes = added_bytes(M4F, features);
        println!("{features}: {bytes} bytes");
        assert!(bytes <= limit, "{features}: {bytes} bytes of flash, more than {limit}");
    }
}

/// As above; on a Cortex-M4F, whose floating-point unit has single precision.
#[test]
fn the_estimator_takes_at_most_a_tenth_more_flash_than_when_it_was_measured() {
    for (features, limit) in
        [("push", 6_900), ("variances", 8_900), ("power-laws", 29_200), ("curve", 28_500), ("fit", 54_300)]
    {
        let bytes = added_bytes(M4F, features);
        println!("{features}: {bytes} bytes");
        assert!(bytes <= limit, "{features}: {bytes} bytes of flash, more than {limit}");
    }
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
    assert_eq!(panic_symbols(&built(M4F, "push")), [""; 0]);
    // The search finds what it looks for: a fit indexes slices.
    assert!(!panic_symbols(&built(M4F, "fit")).is_empty());
}
