//! The in-between sums as words.

use super::{Between, FACTORS};
use crate::cascade::Moments;
use crate::state::{State, serde_by_state};

serde_by_state!(OCTAVES, OVERLAP for Between<OCTAVES, OVERLAP>);

impl<const OCTAVES: usize, const OVERLAP: usize> State for Between<OCTAVES, OVERLAP> {
    const EMPTY: Self = Self::new();
    const KIND: u8 = b'B';
    const OCTAVES: usize = OCTAVES;
    const OVERLAP: usize = OVERLAP;
    const WORDS: usize = OCTAVES * FACTORS.len() * 5;

    fn walk<E>(&mut self, mut visit: impl FnMut(&mut u64) -> Result<(), E>) -> Result<(), E> {
        for Moments { squares, fourths } in self.moments.as_flattened_mut() {
            squares.words().into_iter().try_for_each(&mut visit)?;
            fourths.words().into_iter().try_for_each(&mut visit)?;
        }
        self.counts.as_flattened_mut().iter_mut().try_for_each(visit)
    }

    fn flaw(&self) -> Option<&'static str> {
        let idle = |(moments, count): (&Moments, &u64)| *count == 0 && *moments != Moments::NONE;
        let mut sums = self.moments.as_flattened().iter().zip(self.counts.as_flattened());
        sums.any(idle).then_some("a sum over no differences that is not 0")
    }
}
