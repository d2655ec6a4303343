//! The cascade as words.

use super::{Cascade, Moments};
use crate::state::{State, serde_by_state, signed, wide};

serde_by_state!(OCTAVES, OVERLAP for Cascade<OCTAVES, OVERLAP>);

impl<const OCTAVES: usize, const OVERLAP: usize> State for Cascade<OCTAVES, OVERLAP> {
    const EMPTY: Self = Self::new();
    const KIND: u8 = b'A';
    const OCTAVES: usize = OCTAVES;
    const OVERLAP: usize = OVERLAP;
    const WORDS: usize = 4 + OVERLAP + OCTAVES * (OVERLAP + 1 + 4 + 1);

    fn walk<E>(&mut self, mut visit: impl FnMut(&mut u64) -> Result<(), E>) -> Result<(), E> {
        visit(&mut self.samples)?;
        visit(&mut self.missing)?;
        visit(&mut self.elapsed)?;
        signed(&mut self.sum, &mut visit)?;
        for sum in self.recent.iter_mut().chain(self.lines.as_flattened_mut()).chain(&mut self.oldest) {
            signed(sum, &mut visit)?;
        }
        for Moments { squares, fourths } in &mut self.moments {
            wide(squares, &mut visit)?;
            wide(fourths, &mut visit)?;
        }
        self.differences.iter_mut().try_for_each(visit)
    }

    fn flaw(&self) -> Option<&'static str> {
        if self.elapsed > self.samples {
            return Some("more samples since the last gap than in all");
        }
        if self.recent[Self::slot(self.elapsed)] != self.sum {
            return Some("the newest running sum is not the running sum");
        }
        for (level, line) in self.lines.iter().enumerate() {
            // The sums of a stretch's start and of the time before it.
            let step = self.elapsed >> level.min(63);
            let empty = |back: u64| step <= back && line[Self::slot(step.wrapping_sub(back))] != 0;
            if (OVERLAP as u64..2 * OVERLAP as u64).any(empty) {
                return Some("running sums from before the first sample");
            }
        }
        for (octave, moments) in self.moments.iter().enumerate() {
            let count = self.differences[octave].checked_add(self.open_differences(octave));
            if count.is_none_or(|count| count > self.samples) {
                return Some("more differences than samples");
            }
            if moments.squares == 0 && moments.fourths != 0 || count == Some(0) && moments.squares != 0 {
                return Some("a sum over no differences that is not 0");
            }
        }
        None
    }
}
