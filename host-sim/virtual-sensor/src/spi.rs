//! The SPI port: frames of 16 bits, answers one frame later, burst reads; and the checker of the bus timing.

use crate::activity::Activity;
use std::fmt;

/// Least pause between frames in normal mode, ns.
pub const MIN_STALL_NORMAL_NS: u64 = 9_000;
/// Least pause between frames in low-power mode, ns; no available source confirms it.
const MIN_STALL_LOW_POWER_NS: u64 = 75_000;
/// Highest SCK in normal mode, Hz.
pub const MAX_SCK_NORMAL_HZ: u32 = 2_000_000;
/// Highest SCK in a burst read, Hz.
pub const MAX_SCK_BURST_HZ: u32 = 1_000_000;
/// Highest SCK in low-power mode, Hz.
const MAX_SCK_LOW_POWER_HZ: u32 = 300_000;

/// The answer where the data sheet defines none: after a write, in the first frame of a burst, from a register that cannot
/// be read.
pub(crate) const UNDEFINED: u16 = 0xA5A5;
/// The answer on a line that no part drives.
pub(crate) const FLOATING: u8 = 0xFF;

/// One violation of the data sheet's rules by the controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Violation {
    /// Virtual time, ns.
    pub at_ns: u64,
    /// The rule that was violated.
    pub kind: ViolationKind,
}

/// The rules that the checker knows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ViolationKind {
    /// Too short a pause between frames.
    Stall {
        /// The pause, ns.
        stall_ns: u64,
        /// The least allowed, ns.
        least_ns: u64,
    },
    /// Chip select was high for too short a time between frames, or not at all. Checked if the part is strict
    /// ([`set_strict_select`](crate::VirtualAdis16405::set_strict_select)).
    SelectHigh {
        /// The time, ns.
        high_ns: u64,
        /// The least allowed, ns.
        least_ns: u64,
    },
    /// The reset line was low for too short a time.
    ResetPulse {
        /// The time, ns.
        low_ns: u64,
        /// The least that resets the part, ns.
        least_ns: u64,
    },
    /// Chip select rose inside a 16-bit frame or a burst.
    FrameLength {
        /// Whole bytes since chip select fell.
        bytes: usize,
    },
    /// SCK too fast.
    Clock {
        /// The clock, Hz.
        sck_hz: u32,
        /// The highest allowed, Hz.
        most_hz: u32,
    },
    /// Clocked without chip select.
    NotSelected,
    /// A frame during a procedure that needs a silent bus.
    Busy {
        /// The procedure.
        activity: Activity,
    },
    /// A register was read that cannot be read, or a byte written that cannot be written.
    Address {
        /// Address of the byte.
        address: u8,
        /// True for a write.
        write: bool,
    },
    /// A sample was taken with a combination of range and filter taps that the part does not allow.
    Configuration {
        /// SENS_AVG.
        sens_avg: u16,
    },
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "at {:.6} s: ", self.at_ns as f64 * 1e-9)?;
        match self.kind {
            ViolationKind::Stall { stall_ns, least_ns } => {
                write!(f, "stall of {stall_ns} ns between frames, at least {least_ns} ns needed")
            }
            ViolationKind::SelectHigh { high_ns, least_ns } => {
                write!(f, "chip select high for {high_ns} ns between frames, at least {least_ns} ns needed")
            }
            ViolationKind::ResetPulse { low_ns, least_ns } => {
                write!(f, "reset line low for {low_ns} ns, at least {least_ns} ns needed")
            }
            ViolationKind::FrameLength { bytes } => write!(f, "chip select rose after {bytes} bytes"),
            ViolationKind::Clock { sck_hz, most_hz } => write!(f, "SCK of {sck_hz} Hz, at most {most_hz} Hz allowed"),
            ViolationKind::NotSelected => write!(f, "clocked without chip select"),
            ViolationKind::Busy { activity } => write!(f, "addressed while busy with {activity:?}"),
            ViolationKind::Address { address, write: true } => {
                write!(f, "write to {address:#04x}, which cannot be written")
            }
            ViolationKind::Address { address, write: false } => {
                write!(f, "read of {address:#04x}, which cannot be read")
            }
            ViolationKind::Configuration { sens_avg } => {
                write!(f, "SENS_AVG {sens_avg:#06x} has too few taps for its range, or no valid range")
            }
        }
    }
}

/// All violations, counted; the first thousand are stored.
#[derive(Clone, Debug, Default)]
pub(crate) struct ViolationLog {
    pub(crate) first: Vec<Violation>,
    pub(crate) count: u64,
}

impl ViolationLog {
    const STORED: usize = 1000;

    pub(crate) fn add(&mut self, at_ns: u64, kind: ViolationKind) {
        self.count += 1;
        if self.first.len() < Self::STORED {
            self.first.push(Violation { at_ns, kind });
        }
    }
}

/// State of the SPI port.
#[derive(Clone, Debug)]
pub(crate) struct SpiPort {
    /// SCK, Hz; `None` if bytes take no time and the clock is not checked.
    pub(crate) sck_hz: Option<u32>,
    /// The least time that chip select must be high between frames, ns, if the part is strict about it.
    pub(crate) least_high_ns: Option<u64>,
    selected: bool,
    deselected_at_ns: Option<u64>,
    /// How long chip select was high before it fell, ns; `None` if it was never low before.
    high_ns: Option<u64>,
    /// A rule of the strict part was violated since chip select fell.
    garbled: bool,
    bytes_since_select: usize,
    /// The first byte of a frame, until the second one comes.
    upper_byte: Option<u8>,
    /// The word that is being shifted out.
    outgoing: u16,
    /// The answer to the latest frame, which the next one shifts out.
    answer: u16,
    burst: Option<BurstRead>,
    last_word_end_ns: Option<u64>,
}

/// A burst read under way.
#[derive(Clone, Debug)]
struct BurstRead {
    words: [u16; 12],
    next: usize,
}

/// The state in which chip select rose.
pub(crate) struct Deselected {
    /// Bytes since chip select fell; `None` if it was high already.
    pub(crate) bytes: Option<usize>,
    /// In the middle of a frame.
    pub(crate) in_frame: bool,
    /// In the middle of a burst read.
    pub(crate) in_burst: bool,
}

/// Whether a word begins within the rules of a strict part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum WordStart {
    Sound,
    Garbled,
}

/// The word that goes out when the part should have sent `word` and was addressed too soon.
fn garble(word: u16) -> u16 {
    (word ^ UNDEFINED).rotate_left(1)
}

/// A byte as exchanged.
pub(crate) struct Shifted {
    pub(crate) answer: u8,
    /// The word from the controller, if the byte completed one.
    pub(crate) word: Option<u16>,
}

impl SpiPort {
    pub(crate) fn new() -> Self {
        Self {
            sck_hz: None,
            least_high_ns: None,
            selected: false,
            deselected_at_ns: None,
            high_ns: None,
            garbled: false,
            bytes_since_select: 0,
            upper_byte: None,
            outgoing: UNDEFINED,
            answer: UNDEFINED,
            burst: None,
            last_word_end_ns: None,
        }
    }

    pub(crate) fn is_selected(&self) -> bool {
        self.selected
    }

    /// Whether the next byte is the first of a word.
    pub(crate) fn at_word_begin(&self) -> bool {
        self.upper_byte.is_none()
    }

    /// Duration of a byte, ns.
    pub(crate) fn byte_ns(&self) -> u64 {
        self.sck_hz.map_or(0, |sck_hz| 8_000_000_000u64.div_ceil(u64::from(sck_hz)))
    }

    /// Chip select falls.
    pub(crate) fn select(&mut self, now_ns: u64) {
        self.selected = true;
        self.high_ns = self.deselected_at_ns.map(|at_ns| now_ns - at_ns);
        self.garbled = false;
        self.bytes_since_select = 0;
        self.upper_byte = None;
    }

    /// Chip select rises; an incomplete frame or burst is dropped.
    pub(crate) fn deselect(&mut self, now_ns: u64) -> Deselected {
        self.deselected_at_ns = Some(now_ns);
        Deselected {
            bytes: std::mem::take(&mut self.selected).then_some(self.bytes_since_select),
            in_frame: self.upper_byte.take().is_some(),
            in_burst: self.burst.take().is_some(),
        }
    }

    /// Loads the word that goes out next and checks chip select, pause and clock before it.
    pub(crate) fn begin_word(&mut self, now_ns: u64, low_power: bool, violations: &mut ViolationLog) -> WordStart {
        if self.garbled {
            self.outgoing = garble(self.answer);
            return WordStart::Garbled;
        }
        if let (None, Some(least_ns)) = (&self.burst, self.least_high_ns) {
            let high_ns = if self.bytes_since_select > 0 { Some(0) } else { self.high_ns };
            if let Some(high_ns) = high_ns.filter(|high_ns| *high_ns < least_ns) {
                violations.add(now_ns, ViolationKind::SelectHigh { high_ns, least_ns });
                self.garbled = true;
            }
        }
        let (least_ns, most_hz) = match (low_power, &self.burst) {
            (true, _) => (MIN_STALL_LOW_POWER_NS, MAX_SCK_LOW_POWER_HZ),
            (false, None) => (MIN_STALL_NORMAL_NS, MAX_SCK_NORMAL_HZ),
            (false, Some(_)) => (MIN_STALL_NORMAL_NS, MAX_SCK_BURST_HZ),
        };
        if let (None, Some(end_ns)) = (&self.burst, self.last_word_end_ns) {
            let stall_ns = now_ns - end_ns;
            if stall_ns < least_ns {
                violations.add(now_ns, ViolationKind::Stall { stall_ns, least_ns });
                self.garbled |= self.least_high_ns.is_some();
            }
        }
        if let Some(sck_hz) = self.sck_hz.filter(|hz| *hz > most_hz) {
            violations.add(now_ns, ViolationKind::Clock { sck_hz, most_hz });
        }
        if self.garbled {
            self.outgoing = garble(self.answer);
            return WordStart::Garbled;
        }
        self.outgoing = self.burst.as_ref().map_or(self.answer, |burst| burst.words[burst.next]);
        WordStart::Sound
    }

    /// Exchanges a byte, the upper one of a word first.
    pub(crate) fn shift(&mut self, byte: u8) -> Shifted {
        self.bytes_since_select += 1;
        let [upper, lower] = self.outgoing.to_be_bytes();
        match self.upper_byte.take() {
            None => {
                self.upper_byte = Some(byte);
                Shifted { answer: upper, word: None }
            }
            Some(first) => Shifted { answer: lower, word: Some(u16::from_be_bytes([first, byte])) },
        }
    }

    /// Ends a word. Returns true if it was a frame to be executed, false if it was garbled or part of a burst.
    pub(crate) fn end_word(&mut self, now_ns: u64) -> bool {
        self.last_word_end_ns = Some(now_ns);
        if self.garbled {
            return false;
        }
        let Some(burst) = &mut self.burst else {
            return true;
        };
        burst.next += 1;
        if burst.next == burst.words.len() {
            self.burst = None;
        }
        false
    }

    /// Sets the answer that the next frame shifts out.
    pub(crate) fn answer(&mut self, word: u16) {
        self.answer = word;
    }

    /// Shifts `words` out in the frames that follow.
    pub(crate) fn begin_burst(&mut self, words: [u16; 12]) {
        self.answer = UNDEFINED;
        self.burst = Some(BurstRead { words, next: 0 });
    }
}
