//! The SPI port: frames of 16 bits, answers one frame later, burst reads, and the checker of the bus timing. Limits are those of Table 2 of
//! the data sheet (Rev. B, page 6).

use crate::activity::Activity;
use std::fmt;

/// Least pause between frames in normal mode, ns.
pub const MIN_STALL_NORMAL_NS: u64 = 9_000;
/// Least pause between frames in low-power mode, ns.
const MIN_STALL_LOW_POWER_NS: u64 = 75_000;
/// Least time from one falling edge of chip select to the next in normal mode, ns.
pub const MIN_READ_RATE_NORMAL_NS: u64 = 40_000;
/// Least time from one falling edge of chip select to the next in low-power mode, ns.
const MIN_READ_RATE_LOW_POWER_NS: u64 = 150_000;
/// Highest SCK in normal mode, Hz.
pub const MAX_SCK_NORMAL_HZ: u32 = 2_000_000;
/// Highest SCK in a burst read, Hz.
pub const MAX_SCK_BURST_HZ: u32 = 1_000_000;
/// Highest SCK in low-power mode, Hz.
const MAX_SCK_LOW_POWER_HZ: u32 = 300_000;
/// Lowest SCK, Hz.
const MIN_SCK_HZ: u32 = 10_000;

/// Reaction of the part to a controller that violates the data sheet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Strictness {
    /// Every violation is recorded without consequences: data are right at any clock and pause.
    Lenient,
    /// A transaction that comes too soon or is clocked too fast is garbled: the controller reads wrong words until chip select rises, no
    /// frame is executed, and DIAG_STAT bit 3 is set. Behaviour of drivers that the data sheet neither shows nor forbids is accepted with a
    /// [`Note`].
    #[default]
    DataSheet,
    /// Everything that would get a note is a violation too, with its consequences. In addition, chip select must be high for a time between
    /// two frames. The data sheet gives no minimum. Drivers that raise chip select between frames keep it high for the stall; the ADIS16470
    /// needs 1 µs.
    Pedantic {
        /// Least time of chip select high, ns.
        least_high_ns: u64,
    },
}

/// Accepted behaviour that the data sheet does not show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Note {
    /// Virtual time, ns.
    pub at_ns: u64,
    /// The kind of the behaviour.
    pub kind: NoteKind,
}

/// Behaviour that the part accepts with a note.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoteKind {
    /// Chip select stayed low between two frames; Figure 11 shows it high.
    SelectLow,
    /// A write of 0 went to the upper byte of a register of 8 bits.
    UnusedByte {
        /// Address of the byte.
        address: u8,
    },
    /// A frame of ones, which some controllers send to receive an answer.
    DummyFrame,
    /// A write of 0 to the upper byte of GLOB_CMD follows a command while the part is busy with it.
    SecondCommandByte,
    /// SCK is above 300 kHz at SMPL_PRD = 0x09, which is normal mode by Tables 1 and 2 and page 13, and low-power mode by Table 7.
    FastClockAt0x09 {
        /// The clock, Hz.
        sck_hz: u32,
    },
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "at {:.6} s: ", self.at_ns as f64 * 1e-9)?;
        match self.kind {
            NoteKind::SelectLow => write!(f, "chip select low between two frames"),
            NoteKind::UnusedByte { address } => write!(f, "write of 0 to the unused byte {address:#04x}"),
            NoteKind::DummyFrame => write!(f, "frame 0xFFFF"),
            NoteKind::SecondCommandByte => write!(f, "second byte of GLOB_CMD while the part is busy"),
            NoteKind::FastClockAt0x09 { sck_hz } => {
                write!(f, "SCK of {sck_hz} Hz at SMPL_PRD = 0x09, which Table 7 of the data sheet forbids")
            }
        }
    }
}

/// The greatest SMPL_PRD of normal mode by Tables 1 and 2 and page 13; it is 0x08 in Table 7: see
/// [`NoteKind::FastClockAt0x09`].
pub(crate) const NORMAL_MODE_MAX_SMPL_PRD: u16 = 0x09;

/// The answer if the data sheet defines none: after a write, in the first frame of a burst, and from an unreadable
/// register.
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
    /// The pause between frames is too short.
    Stall {
        /// The pause, ns.
        stall_ns: u64,
        /// The least allowed, ns.
        least_ns: u64,
    },
    /// The time from one falling edge of chip select to the next is too short.
    ReadRate {
        /// The time, ns.
        interval_ns: u64,
        /// The least allowed, ns.
        least_ns: u64,
    },
    /// Chip select was high for too short a time between frames, or not at all. Only a [pedantic](Strictness::Pedantic)
    /// part checks this.
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
    /// The pulse on chip select was too short to wake the part.
    WakePulse {
        /// The time of chip select low, ns.
        low_ns: u64,
        /// The least that wakes the part, ns.
        least_ns: u64,
    },
    /// The pulse of the external sample clock was too short.
    SyncPulse {
        /// The time, ns.
        high_ns: u64,
        /// The least allowed, ns.
        least_ns: u64,
    },
    /// The pulses of the external sample clock come too fast.
    SyncPeriod {
        /// The time from one rising edge to the next, ns.
        period_ns: u64,
        /// The least allowed, ns.
        least_ns: u64,
    },
    /// Chip select rose inside a 16-bit frame or a burst.
    FrameLength {
        /// Whole bytes since chip select fell.
        bytes: usize,
    },
    /// SCK is too fast.
    Clock {
        /// The clock, Hz.
        sck_hz: u32,
        /// The highest allowed, Hz.
        most_hz: u32,
    },
    /// SCK is too slow.
    SlowClock {
        /// The clock, Hz.
        sck_hz: u32,
        /// The lowest allowed, Hz.
        least_hz: u32,
    },
    /// The controller clocked without chip select.
    NotSelected,
    /// A frame came during a procedure that needs a silent bus.
    Busy {
        /// The procedure.
        activity: Activity,
    },
    /// An unreadable register was read, or an unwritable byte written.
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
            ViolationKind::ReadRate { interval_ns, least_ns } => {
                write!(f, "chip select fell {interval_ns} ns after the frame before, at least {least_ns} ns needed")
            }
            ViolationKind::WakePulse { low_ns, least_ns } => {
                write!(f, "chip select low for {low_ns} ns while asleep, at least {least_ns} ns wake the part")
            }
            ViolationKind::SyncPulse { high_ns, least_ns } => {
                write!(f, "pulse of the sample clock of {high_ns} ns, at least {least_ns} ns needed")
            }
            ViolationKind::SyncPeriod { period_ns, least_ns } => {
                write!(f, "period of the sample clock of {period_ns} ns, at least {least_ns} ns needed")
            }
            ViolationKind::SlowClock { sck_hz, least_hz } => {
                write!(f, "SCK of {sck_hz} Hz, at least {least_hz} Hz needed")
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

/// All violations and notes are counted; the first thousand of each are stored.
#[derive(Clone, Debug, Default)]
pub(crate) struct BusLog {
    pub(crate) violations: Vec<Violation>,
    pub(crate) violation_count: u64,
    pub(crate) notes: Vec<Note>,
    pub(crate) note_count: u64,
}

impl BusLog {
    const STORED: usize = 1000;

    pub(crate) fn violation(&mut self, at_ns: u64, kind: ViolationKind) {
        self.violation_count += 1;
        if self.violations.len() < Self::STORED {
            self.violations.push(Violation { at_ns, kind });
        }
    }

    pub(crate) fn note(&mut self, at_ns: u64, kind: NoteKind) {
        self.note_count += 1;
        if self.notes.len() < Self::STORED {
            self.notes.push(Note { at_ns, kind });
        }
    }
}

/// State of the SPI port.
#[derive(Clone, Debug)]
pub(crate) struct SpiPort {
    /// SCK, Hz; `None` if bytes take no time and the clock is not checked.
    pub(crate) sck_hz: Option<u32>,
    pub(crate) strictness: Strictness,
    selected: bool,
    /// Time at which chip select fell last, ns.
    selected_at_ns: u64,
    /// True if chip select has fallen since the part fell asleep.
    may_wake: bool,
    /// Time at which chip select fell before the latest word, ns.
    word_select_at_ns: Option<u64>,
    deselected_at_ns: Option<u64>,
    /// Time for which chip select was high before it fell, ns; `None` if it was never low before.
    high_ns: Option<u64>,
    /// True if a rule was violated since chip select fell.
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
    /// Bytes since chip select fell; `None` if it was already high.
    pub(crate) bytes: Option<usize>,
    /// True in the middle of a frame.
    pub(crate) in_frame: bool,
    /// True in the middle of a burst read.
    pub(crate) in_burst: bool,
}

/// The begin of a word: within the rules of the part, or garbled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum WordStart {
    Sound,
    Garbled,
}

/// The word that is sent instead of `word` if the part is addressed too soon.
fn garble(word: u16) -> u16 {
    (word ^ UNDEFINED).rotate_left(1)
}

/// The result of exchanging a byte.
pub(crate) struct Shifted {
    pub(crate) answer: u8,
    /// The word from the controller, if the byte completed one.
    pub(crate) word: Option<u16>,
}

impl SpiPort {
    pub(crate) fn new() -> Self {
        Self {
            sck_hz: None,
            strictness: Strictness::default(),
            selected: false,
            selected_at_ns: 0,
            may_wake: false,
            word_select_at_ns: None,
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

    /// Makes the port wait for a new fall of chip select, which is low, before a pulse can wake the part.
    pub(crate) fn fall_asleep(&mut self) {
        self.may_wake = false;
    }

    /// Time for which chip select has been low, ns; `None` if it is high, or has been low since the part fell asleep.
    pub(crate) fn wake_pulse_ns(&self, now_ns: u64) -> Option<u64> {
        (self.selected && self.may_wake).then(|| now_ns - self.selected_at_ns)
    }

    /// True if behaviour that would get a note is a violation.
    pub(crate) fn is_pedantic(&self) -> bool {
        matches!(self.strictness, Strictness::Pedantic { .. })
    }

    /// True if the next byte is the first of a word.
    pub(crate) fn at_word_begin(&self) -> bool {
        self.upper_byte.is_none()
    }

    /// Duration of a byte, ns.
    pub(crate) fn byte_ns(&self) -> u64 {
        self.sck_hz.map_or(0, |sck_hz| 8_000_000_000u64.div_ceil(u64::from(sck_hz)))
    }

    /// Lets chip select fall.
    pub(crate) fn select(&mut self, now_ns: u64) {
        self.selected = true;
        self.selected_at_ns = now_ns;
        self.may_wake = true;
        self.high_ns = self.deselected_at_ns.map(|at_ns| now_ns - at_ns);
        self.garbled = false;
        self.bytes_since_select = 0;
        self.upper_byte = None;
    }

    /// Lets chip select rise; an incomplete frame or burst is dropped.
    pub(crate) fn deselect(&mut self, now_ns: u64) -> Deselected {
        self.deselected_at_ns = Some(now_ns);
        Deselected {
            bytes: std::mem::take(&mut self.selected).then_some(self.bytes_since_select),
            in_frame: self.upper_byte.take().is_some(),
            in_burst: self.burst.take().is_some(),
        }
    }

    /// Loads the next word to be sent, and checks chip select, pauses and clock before it.
    pub(crate) fn begin_word(&mut self, now_ns: u64, smpl_prd: u16, log: &mut BusLog) -> WordStart {
        if !self.garbled {
            let violated = match &self.burst {
                None => self.check_frame(now_ns, smpl_prd, log),
                Some(burst) => {
                    let most_hz =
                        if smpl_prd > NORMAL_MODE_MAX_SMPL_PRD { MAX_SCK_LOW_POWER_HZ } else { MAX_SCK_BURST_HZ };
                    burst.next == 0 && self.clock_is_wrong(now_ns, most_hz, log)
                }
            };
            self.garbled = violated && self.strictness != Strictness::Lenient;
        }
        let word = self.burst.as_ref().map_or(self.answer, |burst| burst.words[burst.next]);
        self.outgoing = if self.garbled { garble(word) } else { word };
        if self.garbled { WordStart::Garbled } else { WordStart::Sound }
    }

    /// Checks the pauses and the clock of a frame; true if a rule is violated.
    fn check_frame(&mut self, now_ns: u64, smpl_prd: u16, log: &mut BusLog) -> bool {
        let is_first = self.bytes_since_select == 0;
        let low_power = smpl_prd > NORMAL_MODE_MAX_SMPL_PRD;
        let (least_stall_ns, least_interval_ns, most_hz) = if low_power {
            (MIN_STALL_LOW_POWER_NS, MIN_READ_RATE_LOW_POWER_NS, MAX_SCK_LOW_POWER_HZ)
        } else {
            (MIN_STALL_NORMAL_NS, MIN_READ_RATE_NORMAL_NS, MAX_SCK_NORMAL_HZ)
        };
        let mut violated = false;
        let mut violation = |kind| {
            log.violation(now_ns, kind);
            violated = true;
        };
        if let Strictness::Pedantic { least_high_ns: least_ns } = self.strictness {
            let high_ns = if is_first { self.high_ns } else { Some(0) };
            if let Some(high_ns) = high_ns.filter(|high_ns| *high_ns < least_ns) {
                violation(ViolationKind::SelectHigh { high_ns, least_ns });
            }
        }
        let stall_ns = self.last_word_end_ns.map(|end_ns| now_ns - end_ns);
        if let Some(stall_ns) = stall_ns.filter(|stall_ns| *stall_ns < least_stall_ns) {
            violation(ViolationKind::Stall { stall_ns, least_ns: least_stall_ns });
        } else if is_first
            && let Some(before_ns) = self.word_select_at_ns
            && self.selected_at_ns - before_ns < least_interval_ns
        {
            let interval_ns = self.selected_at_ns - before_ns;
            violation(ViolationKind::ReadRate { interval_ns, least_ns: least_interval_ns });
        }
        self.word_select_at_ns = Some(self.selected_at_ns);
        if !is_first && !self.is_pedantic() {
            log.note(now_ns, NoteKind::SelectLow);
        }
        if let (NORMAL_MODE_MAX_SMPL_PRD, Some(sck_hz)) =
            (smpl_prd, self.sck_hz.filter(|hz| *hz > MAX_SCK_LOW_POWER_HZ))
        {
            if self.is_pedantic() {
                return self.clock_is_wrong(now_ns, MAX_SCK_LOW_POWER_HZ, log) || violated;
            }
            log.note(now_ns, NoteKind::FastClockAt0x09 { sck_hz });
        }
        self.clock_is_wrong(now_ns, most_hz, log) || violated
    }

    /// Checks the clock; true if it is beyond its limits.
    fn clock_is_wrong(&self, now_ns: u64, most_hz: u32, log: &mut BusLog) -> bool {
        match self.sck_hz {
            Some(sck_hz) if sck_hz > most_hz => log.violation(now_ns, ViolationKind::Clock { sck_hz, most_hz }),
            Some(sck_hz) if sck_hz < MIN_SCK_HZ => {
                log.violation(now_ns, ViolationKind::SlowClock { sck_hz, least_hz: MIN_SCK_HZ });
            }
            _ => return false,
        }
        true
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
        let Some(burst) = &mut self.burst else {
            return !self.garbled;
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
