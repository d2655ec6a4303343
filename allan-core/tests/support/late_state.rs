//! The state of an estimator late in a record, without pushing all its samples: made as its serialised words.
//!
//! `no_std`, as the instruction counts on the target use it too.

use allan_core::Cascade;
use serde::Deserialize;
use serde::de::value::{Error, SeqDeserializer};

/// The estimator to which `sample` was pushed `samples` times.
pub(crate) fn after_constant<const OCTAVES: usize, const OVERLAP: usize>(
    sample: i32,
    samples: u64,
) -> Cascade<OCTAVES, OVERLAP> {
    let header = [2, b'A', OCTAVES as u8, OVERLAP as u8];
    // Three times (now, the one from which the first eleven octaves settle, the end of the last gap), four numbers
    // of samples (before the start, missing, absent, pending), the sum and the recent sums; of each octave, 4 words of
    // moments, the oldest sum, the line, the end of the last gap, the number of differences before it, and 3 words of gaps.
    let of_octave = 5 + OVERLAP + 5;
    let own = 8 + OVERLAP;
    let words = own + OCTAVES * of_octave;
    let sum_at = |step: u64, level: usize| i64::from(sample).wrapping_mul((step << level) as i64) as u64;
    // The sum in a slot of a line that holds the steps from `nearest` before the newest on; 0 before the first sample.
    let in_line = |slot: usize, level: usize, nearest: u64| {
        let newest = (samples >> level).wrapping_sub(nearest);
        let back = nearest + (newest.wrapping_sub(slot as u64) & (OVERLAP as u64 - 1));
        (samples >> level).checked_sub(back).map_or(0, |step| sum_at(step, level))
    };
    let fine = OVERLAP.trailing_zeros() as usize;
    let word = |at: usize| match at {
        0 => samples,
        1..7 => 0,
        7 => sum_at(samples, 0),
        at if at < own => in_line(at - 8, 0, 0),
        at => {
            let (octave, field) = ((at - own) / of_octave, (at - own) % of_octave);
            let Some(level) = octave.checked_sub(fine) else { return 0 };
            match field {
                4 => sum_at((samples >> level).saturating_sub(2 * OVERLAP as u64), level),
                field if (5..5 + OVERLAP).contains(&field) => in_line(field - 5, level, OVERLAP as u64),
                _ => 0,
            }
        }
    };
    let crc = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);
    let mut digest = crc.digest();
    digest.update(&header);
    (0..words).for_each(|at| digest.update(&word(at).to_le_bytes()));
    let checksum = u64::from(digest.finalize());
    let header = u64::from(u32::from_be_bytes(header));
    let sequence = core::iter::once(header).chain((0..words).map(word)).chain(core::iter::once(checksum));
    Cascade::deserialize(SeqDeserializer::<_, Error>::new(sequence)).expect("a state that samples lead to")
}
