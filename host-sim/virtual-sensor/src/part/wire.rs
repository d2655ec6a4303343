//! The SPI side: chip select, words, and how the bus is used.

use super::VirtualAdis16405;
use super::access::UNDEFINED;
use super::activity::Activity;
use crate::police::{self, ViolationKind};
use crate::registers;

const DIAG_SPI: u16 = 1 << 3;
/// What the controller reads while nobody drives the line.
const FLOATING: u8 = 0xFF;

/// State of the serial port.
#[derive(Clone, Debug)]
pub(super) struct Wire {
    pub(super) sck_hz: Option<u32>,
    selected: bool,
    selected_bytes: usize,
    upper_byte: Option<u8>,
    outgoing: u16,
    reply: u16,
    burst: Option<Burst>,
    last_word_end_ns: Option<u64>,
}

/// A burst read under way.
#[derive(Clone, Debug)]
struct Burst {
    words: [u16; 12],
    next: usize,
}

impl Wire {
    pub(super) fn new() -> Self {
        Self {
            sck_hz: None,
            selected: false,
            selected_bytes: 0,
            upper_byte: None,
            outgoing: UNDEFINED,
            reply: UNDEFINED,
            burst: None,
            last_word_end_ns: None,
        }
    }
}

impl VirtualAdis16405 {
    /// SCK in Hz; `None` if the words take no time and the clock is not to be judged.
    pub fn set_sck_hz(&mut self, sck_hz: Option<u32>) {
        self.wire.sck_hz = sck_hz.map(|hz| hz.max(1));
    }

    /// Chip select falls.
    pub fn select(&mut self) {
        self.wire.selected = true;
        self.wire.selected_bytes = 0;
        self.wire.upper_byte = None;
    }

    /// Chip select rises. A burst or a frame that is not complete is lost.
    pub fn deselect(&mut self) {
        let bytes = self.wire.selected_bytes;
        let half_a_frame = self.wire.upper_byte.take().is_some();
        if self.powered {
            if half_a_frame {
                self.diagnosis |= DIAG_SPI;
            }
            if half_a_frame || self.wire.burst.is_some() {
                self.record.add(self.now_ns, ViolationKind::FrameLength { bytes });
            }
            if bytes == 0 && self.wire.selected {
                self.wake();
            }
        }
        self.wire.burst = None;
        self.wire.selected = false;
    }

    /// Exchanges one 16-bit word.
    pub fn transfer(&mut self, word: u16) -> u16 {
        u16::from_be_bytes(word.to_be_bytes().map(|byte| self.transfer_byte(byte)))
    }

    /// Exchanges half a word, the upper byte first.
    pub fn transfer_byte(&mut self, byte: u8) -> u8 {
        if !self.wire.selected {
            self.record.add(self.now_ns, ViolationKind::NotSelected);
            return FLOATING;
        }
        if self.wire.upper_byte.is_none() && self.powered {
            self.begin_word();
        }
        self.wire.selected_bytes += 1;
        if let Some(sck_hz) = self.wire.sck_hz {
            self.advance_to(self.now_ns + 8_000_000_000u64.div_ceil(u64::from(sck_hz)));
        }
        let [upper, lower] = self.wire.outgoing.to_be_bytes();
        let answer = match self.wire.upper_byte.take() {
            None => {
                self.wire.upper_byte = Some(byte);
                upper
            }
            Some(first) => {
                if self.powered {
                    self.end_word(u16::from_be_bytes([first, byte]));
                }
                lower
            }
        };
        if self.powered { answer } else { FLOATING }
    }

    /// The activity that wants the bus to be silent.
    fn silence(&self) -> Option<Activity> {
        self.activity.map(|(activity, _)| activity).filter(|activity| activity.silent())
    }

    fn begin_word(&mut self) {
        let (least_ns, most_hz) = match (self.low_power(), &self.wire.burst) {
            (true, _) => (police::MIN_STALL_LOW_POWER_NS, police::MAX_SCK_LOW_POWER_HZ),
            (false, None) => (police::MIN_STALL_NORMAL_NS, police::MAX_SCK_NORMAL_HZ),
            (false, Some(_)) => (police::MIN_STALL_NORMAL_NS, police::MAX_SCK_BURST_HZ),
        };
        if let (None, Some(end_ns)) = (&self.wire.burst, self.wire.last_word_end_ns) {
            let stall_ns = self.now_ns - end_ns;
            if stall_ns < least_ns {
                self.record.add(self.now_ns, ViolationKind::Stall { stall_ns, least_ns });
            }
        }
        if let Some(sck_hz) = self.wire.sck_hz.filter(|hz| *hz > most_hz) {
            self.record.add(self.now_ns, ViolationKind::Clock { sck_hz, most_hz });
        }
        if let Some(activity) = self.silence() {
            self.record.add(self.now_ns, ViolationKind::Busy { activity });
        }
        self.wire.outgoing = match &self.wire.burst {
            Some(burst) => burst.words[burst.next],
            None => self.wire.reply,
        };
    }

    fn end_word(&mut self, word: u16) {
        self.wire.last_word_end_ns = Some(self.now_ns);
        let silence = self.silence().is_some();
        match &mut self.wire.burst {
            Some(burst) => {
                burst.next += 1;
                if burst.next == burst.words.len() {
                    self.wire.burst = None;
                }
            }
            None if silence => self.wire.reply = 0,
            None => self.execute(word),
        }
    }

    fn execute(&mut self, word: u16) {
        let [upper, lower] = word.to_be_bytes();
        let address = upper & 0x7F;
        self.wire.reply = UNDEFINED;
        if upper & 0x80 != 0 {
            self.write(address, lower);
        } else if address & 0x7E == registers::GLOB_CMD {
            let words = self.read_burst();
            self.wire.burst = Some(Burst { words, next: 0 });
        } else {
            self.wire.reply = self.read(address);
        }
    }
}
