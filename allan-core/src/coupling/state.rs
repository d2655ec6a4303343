//! The coupling as words.

use super::Coupling;
use crate::state::{State, serde_by_state, wide};

serde_by_state!(OCTAVES for Coupling<OCTAVES>);

impl<const OCTAVES: usize> State for Coupling<OCTAVES> {
    const EMPTY: Self = Self::new();
    const KIND: u8 = b'C';
    const OCTAVES: usize = OCTAVES;
    const OVERLAP: usize = 0;
    const WORDS: usize = OCTAVES * 3 + 1;

    fn walk<E>(&mut self, mut visit: impl FnMut(&mut u64) -> Result<(), E>) -> Result<(), E> {
        for product in &mut self.products {
            let mut bits = *product as u128;
            wide(&mut bits, &mut visit)?;
            *product = bits as i128;
        }
        self.counts.iter_mut().chain([&mut self.out_of_step]).try_for_each(visit)
    }

    fn flaw(&self) -> Option<&'static str> {
        let idle = |(product, count): (&i128, &u64)| *count == 0 && *product != 0;
        self.products.iter().zip(&self.counts).any(idle).then_some("a sum over no products that is not 0")
    }
}
