//! Random faults of the lines between sensor and microcontroller.

use adis16405_driver::BURST_BYTES;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Faults of the lines. Bits are inverted in every frame, each with the same probability; the other faults occur by
/// bursts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LineFault {
    /// Bits of the sensor's answers are inverted.
    AnswerBits,
    /// Bits of the requests to the sensor are inverted.
    RequestBits,
    /// A run of 2 to 16 bits of the answer is inverted.
    AnswerRun,
    /// The answer is stuck from a random bit on.
    StuckFrom {
        /// True if it reads ones.
        high: bool,
    },
    /// The sensor misses a clock, and the following bits come early.
    MissingClock,
    /// The sensor sees an extra clock, and the following bits come late.
    ExtraClock,
    /// The previous burst arrives again.
    Repeated,
    /// Chip select rises within the burst.
    ShortSelect,
    /// The supply dips within the burst, and the sensor starts up again.
    Reset,
    /// The transfer of the burst ends with an error.
    Failed,
    /// The data-ready edge does not come.
    LostEdge,
    /// The data-ready edge comes twice.
    DoubledEdge,
}

impl LineFault {
    /// All faults.
    pub const ALL: [Self; 13] = [
        Self::AnswerBits,
        Self::RequestBits,
        Self::AnswerRun,
        Self::StuckFrom { high: false },
        Self::StuckFrom { high: true },
        Self::MissingClock,
        Self::ExtraClock,
        Self::Repeated,
        Self::ShortSelect,
        Self::Reset,
        Self::Failed,
        Self::LostEdge,
        Self::DoubledEdge,
    ];

    /// True if the fault occurs by bits, false if by bursts.
    pub fn is_of_bits(self) -> bool {
        matches!(self, Self::AnswerBits | Self::RequestBits)
    }
}

/// A [`LineFault`] and its probability.
#[derive(Debug, Clone)]
pub struct RandomFault {
    fault: LineFault,
    probability: f64,
    random: ChaCha8Rng,
}

impl RandomFault {
    /// A fault with this probability per bit or per burst.
    ///
    /// # Panics
    /// The probability is not in 0 to 1.
    pub fn new(fault: LineFault, probability: f64, seed: u64) -> Self {
        assert!((0.0..=1.0).contains(&probability), "{probability}");
        Self { fault, probability, random: ChaCha8Rng::seed_from_u64(seed) }
    }

    /// The fault.
    pub(crate) fn fault(&self) -> LineFault {
        self.fault
    }

    /// True if this is `fault` and it occurs now.
    pub(crate) fn meets(&mut self, fault: LineFault) -> bool {
        self.fault == fault && self.random.random_bool(self.probability)
    }

    pub(crate) fn damage_request(&mut self, request: &mut [u8]) {
        self.invert(LineFault::RequestBits, request);
    }

    fn invert(&mut self, fault: LineFault, bytes: &mut [u8]) {
        if self.fault == fault {
            for bit in 0..8 * bytes.len() {
                set(bytes, bit, get(bytes, bit) ^ self.random.random_bool(self.probability));
            }
        }
    }

    /// The number of bytes after which the burst ends, if it ends early.
    pub(crate) fn shortened(&mut self) -> Option<usize> {
        let ends = self.meets(LineFault::ShortSelect) || self.meets(LineFault::Reset);
        ends.then(|| self.random.random_range(1..BURST_BYTES))
    }

    /// Damages an answer of the sensor; `before` is the previous burst if the answer is one. True if the sensor has seen a wrong number of
    /// clocks.
    pub(crate) fn damage_answer(&mut self, answer: &mut [u8], before: Option<&[u8; BURST_BYTES]>) -> bool {
        self.invert(LineFault::AnswerBits, answer);
        let Some(before) = before else { return false };
        let damages = matches!(
            self.fault,
            LineFault::AnswerRun
                | LineFault::StuckFrom { .. }
                | LineFault::MissingClock
                | LineFault::ExtraClock
                | LineFault::Repeated
        );
        if !damages || !self.meets(self.fault) {
            return false;
        }
        let (sent, bits) = (answer.to_vec(), 8 * BURST_BYTES);
        let sent = |bit| bit < bits && get(&sent, bit);
        let from = self.random.random_range(0..bits);
        match self.fault {
            LineFault::AnswerRun => {
                let end = bits.min(from + self.random.random_range(2..=16));
                (from..end).for_each(|bit| set(answer, bit, !sent(bit)));
            }
            LineFault::StuckFrom { high } => (from..bits).for_each(|bit| set(answer, bit, high)),
            LineFault::MissingClock => (from..bits).for_each(|bit| set(answer, bit, sent(bit + 1))),
            LineFault::ExtraClock => (from.max(1)..bits).for_each(|bit| set(answer, bit, sent(bit - 1))),
            LineFault::Repeated => answer.copy_from_slice(before),
            _ => return false,
        }
        matches!(self.fault, LineFault::MissingClock | LineFault::ExtraClock)
    }
}

fn get(bytes: &[u8], bit: usize) -> bool {
    bytes[bit / 8] << (bit % 8) & 0x80 != 0
}

fn set(bytes: &mut [u8], bit: usize, value: bool) {
    let mask = 0x80 >> (bit % 8);
    bytes[bit / 8] = if value { bytes[bit / 8] | mask } else { bytes[bit / 8] & !mask };
}
