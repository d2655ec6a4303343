//! The memory of an estimator, as the README states it.

use allan_core::Cascade;

const README: &str = include_str!("../README.md");

/// Bytes of 16, 20 and 24 octaves.
const fn bytes<const OVERLAP: usize>() -> [usize; 3] {
    [size_of::<Cascade<16, OVERLAP>>(), size_of::<Cascade<20, OVERLAP>>(), size_of::<Cascade<24, OVERLAP>>()]
}

#[test]
fn an_estimator_takes_the_bytes_of_the_readme() {
    assert!(README.contains("| 16 octaves | 1,888 | 2,432 | 3,520 |"), "the table of the README");
    assert_eq!([bytes::<4>()[0], bytes::<8>()[0], bytes::<16>()[0]], [1_888, 2_432, 3_520]);
    assert!(README.contains("| 20 octaves | 2,336 | 3,008 | 4,352 |"), "the table of the README");
    assert_eq!([bytes::<4>()[1], bytes::<8>()[1], bytes::<16>()[1]], [2_336, 3_008, 4_352]);
    assert!(README.contains("| 24 octaves | 2,784 | 3,584 | 5,184 |"), "the table of the README");
    assert_eq!([bytes::<4>()[2], bytes::<8>()[2], bytes::<16>()[2]], [2_784, 3_584, 5_184]);
}

#[test]
fn bridging_gaps_takes_32_bytes_an_octave_and_32_more() {
    assert!(README.contains("Bridging gaps takes `32 + 32·OCTAVES` of them"), "the sentence of the README");
    // Without gaps: five numbers and the recent sums; of an octave two moments, the line, the oldest sum and the count.
    let without = |octaves: usize, overlap: usize| 32 + 8 * overlap + octaves * (48 + 8 * overlap);
    assert_eq!(size_of::<Cascade<24, 8>>(), without(24, 8) + 32 + 32 * 24);
    assert_eq!(size_of::<Cascade<16, 4>>(), without(16, 4) + 32 + 32 * 16);
}
