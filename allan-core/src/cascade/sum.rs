//! A sum of 127 bits that stays at its maximum once it is full.

/// In two words, `high·2⁶³ + low`, so that most additions touch one of them: its top bit is the carry.
///
/// Where the carry is left standing for a while, the same sum has another pair of words: equality is that of values.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sum {
    low: u64,
    high: u64,
}

const CARRY: u64 = 1 << 63;

impl Sum {
    pub(crate) const ZERO: Self = Self { low: 0, high: 0 };
    pub(crate) const MAX: u128 = (1 << 127) - 1;

    #[inline]
    pub(crate) fn get(self) -> u128 {
        ((u128::from(self.high) << 63) + u128::from(self.low)).min(Self::MAX)
    }

    pub(crate) fn is_full(self) -> bool {
        self.get() == Self::MAX
    }

    pub(crate) fn add(&mut self, value: u128) {
        *self = Self::from(self.get().saturating_add(value));
    }

    /// Adds less than 2⁶³.
    #[inline]
    pub(crate) fn add_word(&mut self, word: u64) {
        if self.must_carry() {
            self.carry();
        }
        self.low += word;
        if self.must_carry() {
            self.carry();
        }
    }

    /// Adds a word without a look at the carry; `low` must not pass 2⁶⁴.
    #[inline]
    pub(crate) fn add_below_carry(&mut self, word: u64) {
        self.low += word;
    }

    #[inline]
    pub(crate) fn must_carry(self) -> bool {
        self.low >= CARRY
    }

    #[cold]
    pub(crate) fn carry(&mut self) {
        *self = Self::from(self.get());
    }

    /// Both words as an addition leaves them, the lower one first.
    #[cfg(feature = "serde")]
    pub(crate) fn words(&mut self) -> [&mut u64; 2] {
        self.carry();
        [&mut self.low, &mut self.high]
    }
}

impl From<u128> for Sum {
    fn from(value: u128) -> Self {
        let value = value.min(Self::MAX);
        Self { low: value as u64 & (CARRY - 1), high: (value >> 63) as u64 }
    }
}

impl PartialEq for Sum {
    fn eq(&self, other: &Self) -> bool {
        self.get() == other.get()
    }
}

impl Eq for Sum {}
