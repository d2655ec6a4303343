//! What crosses the wire: output words and the burst read.

use embedded_hal::spi::Operation;

use crate::channel::Channel;
use crate::fault::{Faults, burst_faults};
use crate::sample::Counts;

/// Bytes in a burst read: the request and twelve output words.
pub const BURST_BYTES: usize = 26;

/// What the controller sends in a burst read: a read of GLOB_CMD (0x3E00), then zeros.
pub const BURST_REQUEST: [u8; BURST_BYTES] = {
    let mut request = [0; BURST_BYTES];
    request[0] = 0x3E;
    request
};

/// The operations of a burst read with a pause of `gap_ns` between its words and the stall at its end.
pub(crate) fn spaced_burst(
    answer: &mut [u8; BURST_BYTES],
    gap_ns: u32,
    stall_ns: u32,
) -> [Operation<'_, u8>; BURST_BYTES] {
    static REQUEST: [u8; BURST_BYTES] = BURST_REQUEST;
    let mut words = answer.chunks_exact_mut(2).zip(REQUEST.chunks_exact(2));
    core::array::from_fn(|index| {
        // Words and pauses take turns: as many operations as there are bytes.
        let word = if index % 2 == 0 { words.next() } else { None };
        match word {
            Some((answer, request)) => Operation::Transfer(answer, request),
            None => Operation::DelayNs(if index == BURST_BYTES - 1 { stall_ns } else { gap_ns }),
        }
    })
}

const NEW_DATA: u16 = 1 << 15;
const ERROR_ALARM: u16 = 1 << 14;

/// An output register as read: bit 15 new data, bit 14 error or alarm, below them the 12- or 14-bit field.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct OutputWord(pub u16);

impl OutputWord {
    /// The word of a fresh, healthy reading: new data set, error clear, `counts` cut to the channel's field.
    pub const fn fresh(channel: Channel, counts: i16) -> Self {
        Self(NEW_DATA | (counts as u16 & field_mask(channel)))
    }

    /// Bit 15: the register was updated since it was last read.
    pub const fn new_data(self) -> bool {
        self.0 & NEW_DATA != 0
    }

    /// Bit 14: an error or alarm flag is set in DIAG_STAT.
    pub const fn error_alarm(self) -> bool {
        self.0 & ERROR_ALARM != 0
    }

    /// The data field as it is, without the flags and without a sign.
    pub const fn field(self, channel: Channel) -> u16 {
        self.0 & field_mask(channel)
    }

    /// The data field as a count, sign-extended where the channel is signed. Bits above the field are ignored.
    pub const fn counts(self, channel: Channel) -> i16 {
        let field = self.field(channel);
        if channel.signed() {
            let shift = 16 - channel.bits();
            ((field << shift) as i16) >> shift
        } else {
            field as i16
        }
    }
}

const fn field_mask(channel: Channel) -> u16 {
    (1 << channel.bits()) - 1
}

/// How far a field must be moved to have its top bit in bit 15, and whether that is a sign; in burst order.
const FIELDS: [(u32, bool); 12] = {
    let mut fields = [(0, false); 12];
    let mut index = 0;
    while index < fields.len() {
        fields[index] = (16 - Channel::ALL[index].bits(), Channel::ALL[index].signed());
        index += 1;
    }
    fields
};

/// The twelve output words of one burst read, in the order of [`Channel::ALL`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Burst {
    /// Output words, SUPPLY_OUT first.
    pub words: [OutputWord; 12],
}

impl Burst {
    /// Reads what came in during a burst. The first two bytes (while the request went out) carry no data.
    /// Every input is accepted: whether to believe it is the question of [`Judge`](crate::Judge).
    pub fn from_bytes(bytes: &[u8; BURST_BYTES]) -> Self {
        let mut words = [OutputWord::default(); 12];
        for (word, pair) in words.iter_mut().zip(bytes[2..].chunks_exact(2)) {
            *word = OutputWord(u16::from_be_bytes([pair[0], pair[1]]));
        }
        Self { words }
    }

    /// The burst of a fresh, healthy sample: inverse of [`counts`](Self::counts) for counts inside their fields.
    pub fn fresh(counts: &Counts) -> Self {
        let mut words = [OutputWord::default(); 12];
        for (word, channel) in words.iter_mut().zip(Channel::ALL) {
            *word = OutputWord::fresh(channel, counts.get(channel));
        }
        Self { words }
    }

    /// The bytes that the part sends in a burst, the two before the data zero; inverse of
    /// [`from_bytes`](Self::from_bytes).
    pub fn to_bytes(&self) -> [u8; BURST_BYTES] {
        let mut bytes = [0; BURST_BYTES];
        for (pair, word) in bytes[2..].chunks_exact_mut(2).zip(self.words) {
            pair.copy_from_slice(&word.0.to_be_bytes());
        }
        bytes
    }

    /// Sign-extended counts.
    pub fn counts(&self) -> Counts {
        let mut counts = [0; 12];
        for ((count, word), (shift, signed)) in counts.iter_mut().zip(self.words).zip(FIELDS) {
            let aligned = word.0 << shift;
            *count = if signed { aligned as i16 >> shift } else { (aligned >> shift) as i16 };
        }
        Counts::new(counts)
    }

    /// Faults that this burst shows by itself; [`Faults::REPEATED`], [`Faults::FROZEN`] and [`Faults::X_SIGN`] need a
    /// [`Judge`](crate::Judge).
    pub fn faults(&self) -> Faults {
        burst_faults(self)
    }
}
