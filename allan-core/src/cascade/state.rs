//! The cascade as words.

use super::sum::Sum;
use super::{Cascade, Moments};
use crate::state::{State, serde_by_state, signed};

serde_by_state!(OCTAVES, OVERLAP for Cascade<OCTAVES, OVERLAP>);

impl<const OCTAVES: usize, const OVERLAP: usize> State for Cascade<OCTAVES, OVERLAP> {
    const EMPTY: Self = Self::new();
    const KIND: u8 = b'A';
    const OCTAVES: usize = OCTAVES;
    const OVERLAP: usize = OVERLAP;
    const WORDS: usize = 4 + OVERLAP + OCTAVES * (4 + 1 + OVERLAP + 1);

    fn walk<E>(&mut self, mut visit: impl FnMut(&mut u64) -> Result<(), E>) -> Result<(), E> {
        visit(&mut self.ended)?;
        visit(&mut self.missing)?;
        visit(&mut self.elapsed)?;
        for sum in [&mut self.sum].into_iter().chain(&mut self.recent) {
            signed(sum, &mut visit)?;
        }
        for octave in &mut self.octaves {
            let Moments { squares, fourths } = &mut octave.moments;
            squares.words().into_iter().chain(fourths.words()).try_for_each(&mut visit)?;
            for sum in [&mut octave.oldest].into_iter().chain(&mut octave.line) {
                signed(sum, &mut visit)?;
            }
            visit(&mut octave.differences)?;
        }
        Ok(())
    }

    fn flaw(&self) -> Option<&'static str> {
        let Some(samples) = self.ended.checked_add(self.elapsed) else {
            return Some("more samples than can be counted");
        };
        if self.recent[Self::slot(self.elapsed)] != self.sum {
            return Some("the newest running sum is not the running sum");
        }
        for (k, octave) in self.octaves.iter().enumerate() {
            // The sums of a stretch's start and of the time before it.
            let step = self.elapsed >> k.saturating_sub(Self::FINE);
            let empty = |back: u64| step <= back && octave.line[Self::slot(step.wrapping_sub(back))] != 0;
            if (OVERLAP as u64..2 * OVERLAP as u64).any(empty) {
                return Some("running sums from before the first sample");
            }
            let count = octave.differences.checked_add(self.open_differences(k));
            if count.is_none_or(|count| count > samples) {
                return Some("more differences than samples");
            }
            let no_sum = octave.moments.squares == Sum::ZERO || count == Some(0);
            if no_sum && octave.moments != Moments::NONE {
                return Some("a sum over no differences that is not 0");
            }
        }
        None
    }
}
