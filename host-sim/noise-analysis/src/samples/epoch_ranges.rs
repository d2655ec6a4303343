//! The epochs into which the two halves of a record are cut.

use std::ops::Range;

/// Samples; five minutes at 100 Hz.
const LONGEST_EPOCH: u64 = 1 << 15;
/// Samples; its curve separates white noise from a line.
const SHORTEST_EPOCH: u64 = 1 << 10;
const MIN_EPOCHS: u64 = 12;

/// Sample periods in an epoch, a power of 2, and the epochs of both halves; `None` if the record is too short.
pub(crate) fn epochs(record: Range<u64>, middle: u64) -> Option<(u64, [Vec<Range<u64>>; 2])> {
    let half = middle.checked_sub(record.start)?.min(record.end.checked_sub(middle)?);
    let epoch = (half / MIN_EPOCHS).min(LONGEST_EPOCH).checked_ilog2().map(|log2| 1 << log2)?;
    if epoch < SHORTEST_EPOCH {
        return None;
    }
    let from = |from: u64| -> Vec<_> { (0..half / epoch).map(|k| from + k * epoch..from + (k + 1) * epoch).collect() };
    Some((epoch, [from(middle - half / epoch * epoch), from(middle)]))
}
