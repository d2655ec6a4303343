//! The numbers in the pages of the guide.

use allan_core::{Cascade, Snapshot, VarianceFractions, confidence::edf};

/// Digits in groups of three.
fn grouped(number: usize) -> String {
    if number < 1_000 { number.to_string() } else { format!("{},{:03}", number / 1_000, number % 1_000) }
}

#[test]
fn the_scatter_of_a_point_is_that_of_the_page_on_recording() {
    let page = include_str!("../guide/recording.md");
    for (length, name) in [(10, "10"), (30, "30"), (100, "100"), (1_000, "1,000")] {
        // n = 1024 with 8-fold overlap, in a record of so many averaging times.
        let edf = edf(1_024, (length - 2) * 8 + 1, 8, VarianceFractions::WHITE);
        let percent = 100.0 / (2.0 * edf).sqrt();
        let digits = if percent < 10.0 { 1 } else { 0 };
        let row = format!("| {name} τ | {percent:.digits$} % |");
        assert!(page.contains(&row), "the page lacks: {row}");
    }
}

#[test]
fn the_memory_and_the_times_are_those_of_the_page_on_parameters() {
    let page = include_str!("../guide/parameters.md");
    macro_rules! bytes {
        ($overlap:literal) => {
            [Cascade::<16, $overlap>::memory(), Cascade::<20, $overlap>::memory(), Cascade::<24, $overlap>::memory()]
        };
    }
    for (overlap, bytes) in [(4, bytes!(4)), (8, bytes!(8)), (16, bytes!(16))] {
        let row = format!("| {overlap} | {} |", bytes.map(grouped).join(", "));
        assert!(page.contains(&row), "the page lacks: {row}");
    }
    // As the documentation of a snapshot says.
    assert_eq!(size_of::<Snapshot<24, 8>>(), 16 + 64 * 24);
    let longest = |octaves: u32| f64::from(1_u32 << (octaves - 1)) / 200.0;
    assert_eq!(format!("{:.0} s", longest(12)), "10 s");
    assert_eq!(format!("{:.1} min", longest(16) / 60.0), "2.7 min");
    assert_eq!(format!("{:.0} min", longest(20) / 60.0), "44 min");
    assert_eq!(format!("{:.1} h", longest(24) / 3_600.0), "11.7 h");
    for row in ["| 12 | 10 s |", "| 16 | 2.7 min |", "| 20 | 44 min |", "| 24 | 11.7 h |"] {
        assert!(page.contains(row), "the page lacks: {row}");
    }
}

#[test]
fn the_share_of_the_degrees_of_freedom_is_that_of_the_page_on_parameters() {
    let page = include_str!("../guide/parameters.md");
    // A record of 1000 averaging times; 16-fold overlap is within half a percent of full overlap.
    let freedom = |overlap: u32| edf(1_024, 998 * u64::from(overlap) + 1, overlap, VarianceFractions::WHITE);
    let share = |overlap| 100.0 * freedom(overlap) / freedom(16);
    assert!(page.contains("| 93 % of full overlap |") && (share(4) - 93.0).abs() < 1.0, "{}", share(4));
    assert!(page.contains("| 98 % |") && (share(8) - 98.0).abs() < 1.0, "{}", share(8));
}
