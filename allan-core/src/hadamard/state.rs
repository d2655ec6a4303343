//! The Hadamard variance as words.

use super::Hadamard;
use crate::state::{State, serde_by_state, wide};

serde_by_state!(OCTAVES, OVERLAP for Hadamard<OCTAVES, OVERLAP>);

impl<const OCTAVES: usize, const OVERLAP: usize> State for Hadamard<OCTAVES, OVERLAP> {
    const EMPTY: Self = Self::new();
    const KIND: u8 = b'H';
    const OCTAVES: usize = OCTAVES;
    const OVERLAP: usize = OVERLAP;
    const WORDS: usize = OCTAVES * 3;

    fn walk<E>(&mut self, mut visit: impl FnMut(&mut u64) -> Result<(), E>) -> Result<(), E> {
        for square in &mut self.squares {
            wide(square, &mut visit)?;
        }
        self.counts.iter_mut().try_for_each(visit)
    }

    fn flaw(&self) -> Option<&'static str> {
        let idle = |(square, count): (&u128, &u64)| *count == 0 && *square != 0;
        self.squares.iter().zip(&self.counts).any(idle).then_some("a sum over no differences that is not 0")
    }
}
