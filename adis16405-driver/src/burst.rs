//! The burst read: its bytes on the bus, its twelve output words, and the counts that they hold.

use embedded_hal::spi::Operation;

use crate::channel::Channel;

/// Bytes in a burst read: the two-byte request and twelve 16-bit output words.
pub const BURST_BYTES: usize = 26;

/// The bytes that the controller sends in a burst read: a read of GLOB_CMD (0x3E00), then zeros.
pub const BURST_REQUEST: [u8; BURST_BYTES] = {
    let mut request = [0; BURST_BYTES];
    request[0] = 0x3E;
    request
};

/// A burst read with `gap_ns` between words and `last_ns` after the last.
pub(crate) fn burst_with_gaps(
    answer: &mut [u8; BURST_BYTES],
    gap_ns: u32,
    last_ns: u32,
) -> [Operation<'_, u8>; BURST_BYTES] {
    static REQUEST: [u8; BURST_BYTES] = BURST_REQUEST;
    let mut words = answer.chunks_exact_mut(2).zip(REQUEST.chunks_exact(2));
    core::array::from_fn(|index| {
        // 13 words alternate with 13 pauses: 26 operations.
        let word = if index % 2 == 0 { words.next() } else { None };
        match word {
            Some((answer, request)) => Operation::Transfer(answer, request),
            None => Operation::DelayNs(if index == BURST_BYTES - 1 { last_ns } else { gap_ns }),
        }
    })
}

const NEW_DATA: u16 = 1 << 15;
const ERROR_ALARM: u16 = 1 << 14;

/// An output register: bit 15 new data, bit 14 error/alarm, below them 12 or 14 bits of data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct OutputWord(pub u16);

impl OutputWord {
    /// The word of a new sample without errors, `counts` truncated to the channel's width.
    pub const fn from_counts(channel: Channel, counts: i16) -> Self {
        Self(NEW_DATA | (counts as u16 & field_mask(channel)))
    }

    /// Bit 15: the register was updated since the previous read.
    pub const fn new_data(self) -> bool {
        self.0 & NEW_DATA != 0
    }

    /// Bit 14: an error or alarm flag is set in DIAG_STAT.
    pub const fn error_alarm(self) -> bool {
        self.0 & ERROR_ALARM != 0
    }

    /// The data field without flags and without sign extension.
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

/// For each channel in burst order: the left shift that moves its sign bit to bit 15, and whether it is signed.
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
    /// Decodes the 26 bytes received during a burst read. The first two, received while the request is sent, are
    /// ignored. Any bytes are accepted; [`BurstValidator`](crate::BurstValidator) decides whether they are usable.
    pub fn from_bytes(bytes: &[u8; BURST_BYTES]) -> Self {
        let mut words = [OutputWord::default(); 12];
        for (word, pair) in words.iter_mut().zip(bytes[2..].chunks_exact(2)) {
            *word = OutputWord(u16::from_be_bytes([pair[0], pair[1]]));
        }
        Self { words }
    }

    /// The burst of a new sample without errors; inverse of [`counts`](Self::counts) within the channels' widths.
    pub fn from_counts(counts: &Counts) -> Self {
        let mut words = [OutputWord::default(); 12];
        for (word, channel) in words.iter_mut().zip(Channel::ALL) {
            *word = OutputWord::from_counts(channel, counts.get(channel));
        }
        Self { words }
    }

    /// The 26 bytes of a burst read, the first two zero; inverse of [`from_bytes`](Self::from_bytes).
    pub fn to_bytes(&self) -> [u8; BURST_BYTES] {
        let mut bytes = [0; BURST_BYTES];
        for (pair, word) in bytes[2..].chunks_exact_mut(2).zip(self.words) {
            pair.copy_from_slice(&word.0.to_be_bytes());
        }
        bytes
    }

    /// The data fields of the twelve words, sign-extended where the channel is signed.
    pub fn counts(&self) -> Counts {
        let mut counts = [0; 12];
        for ((count, word), (shift, signed)) in counts.iter_mut().zip(self.words).zip(FIELDS) {
            let aligned = word.0 << shift;
            *count = if signed { aligned as i16 >> shift } else { (aligned >> shift) as i16 };
        }
        Counts::new(counts)
    }
}

/// The twelve register counts of one sample, sign-extended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Counts([i16; 12]);

impl Counts {
    /// The counts of an array in burst order ([`Channel::ALL`]).
    pub const fn new(counts: [i16; 12]) -> Self {
        Self(counts)
    }

    /// The count of one channel.
    pub const fn get(&self, channel: Channel) -> i16 {
        self.0[channel as usize]
    }

    /// All counts in burst order.
    pub const fn as_array(&self) -> &[i16; 12] {
        &self.0
    }

    /// Counts of the gyroscopes x, y, z.
    pub const fn gyro(&self) -> [i16; 3] {
        [self.0[1], self.0[2], self.0[3]]
    }

    /// Counts of the accelerometers x, y, z.
    pub const fn accl(&self) -> [i16; 3] {
        [self.0[4], self.0[5], self.0[6]]
    }

    /// Counts of the magnetometers x, y, z.
    pub const fn magn(&self) -> [i16; 3] {
        [self.0[7], self.0[8], self.0[9]]
    }
}
