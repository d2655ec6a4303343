//! The memory of an estimator and of its snapshot, as the documentation states it.

use allan_core::{Cascade, Snapshot};

#[test]
fn bridging_gaps_takes_32_bytes_an_octave_and_32_more() {
    // Without gaps: five numbers and the recent sums; of an octave two moments, the line, the oldest sum and the count.
    let without = |octaves: usize, overlap: usize| 32 + 8 * overlap + octaves * (48 + 8 * overlap);
    assert_eq!(size_of::<Cascade<24, 8>>(), without(24, 8) + 32 + 32 * 24);
    assert_eq!(size_of::<Cascade<16, 4>>(), without(16, 4) + 32 + 32 * 16);
}

#[test]
fn a_snapshot_takes_64_bytes_an_octave_and_16_more() {
    assert_eq!(size_of::<Snapshot<24, 8>>(), 16 + 64 * 24);
}
