//! What a person or a program may type.

use adis16405_driver::GyroRange;
use heapless::Vec;

/// What `?` answers, line by line.
pub const HELP: [&str; 18] = [
    "at the press of a key:",
    "?          this list",
    "r          report in frames, for a program",
    "t          report as a table",
    "s          status",
    "k          counters of what was lost and why",
    "v          version",
    "and, with Enter:",
    "f RATE     sample rate in Hz, such as f 819.2",
    "g RANGE    gyro range in deg/s: 75, 150 or 300",
    "n TAPS     filter, log2 of the taps of each stage: 0 to 6",
    "e SECONDS  length of an epoch, 0 for one without end",
    "i SECONDS  time between reports, 0 for none",
    "w 1, w 0   start and stop the stream of raw bursts",
    "check      self-test of the sensor",
    "arm, null  null the gyro bias; null must follow within 10 s",
    "zero       forget the statistics and begin again",
    "boot       restart; the statistics are kept",
];

/// One command, checked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Command {
    /// List the commands.
    Help,
    /// Report in frames.
    Report,
    /// Report as a table of text.
    Table,
    /// Who, how long, how many.
    Status,
    /// Version of the firmware.
    Version,
    /// Counters of faults.
    Faults,
    /// Forget what was learnt.
    ResetStatistics,
    /// Sample rate in 1/1000 Hz.
    Rate(u32),
    /// Full scale of the gyros.
    Range(GyroRange),
    /// Base-2 logarithm of the filter's taps.
    Filter(u8),
    /// Length of an epoch in s, 0 for no end.
    Epoch(u32),
    /// Seconds between reports, 0 for none.
    Interval(u32),
    /// Whether to send the raw bursts.
    Raw(bool),
    /// Run the sensor's self-test.
    SelfTest,
    /// Make ready for auto-null.
    ArmNull,
    /// Carry out auto-null.
    Null,
    /// Restart the microcontroller.
    Restart,
}

/// What is wrong with what was typed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mistake {
    /// No command begins with this byte. What follows on the line is ignored, keys that act at once excepted.
    Unknown(u8),
    /// The line that begins with this letter is no command.
    Line(u8),
}

/// Longest line in bytes.
const LONGEST: usize = 16;

/// Puts commands together from bytes.
///
/// Whatever changes or interrupts something takes a whole line, so that noise on an open input does not do it.
#[derive(Debug, Clone, Default)]
pub struct Parser {
    line: Vec<u8, LONGEST>,
    spoilt: bool,
}

impl Parser {
    /// Takes one byte: the command or mistake that it completes, if any.
    pub fn push(&mut self, byte: u8) -> Option<Result<Command, Mistake>> {
        match byte {
            b'\r' | b'\n' => {
                let spoilt = core::mem::take(&mut self.spoilt);
                let &letter = self.line.first().filter(|_| !spoilt)?;
                let command = whole_line(&self.line).ok_or(Mistake::Line(letter));
                self.line.clear();
                Some(command)
            }
            b' ' => None,
            0x08 | 0x7F => {
                self.line.pop();
                None
            }
            _ if self.line.is_empty() && key(byte).is_some() => key(byte).map(Ok),
            _ if self.spoilt => None,
            b'a'..=b'z' | b'0'..=b'9' | b'.' if !self.line.is_empty() || STARTS.contains(&byte) => {
                self.line.push(byte).err().map(|byte| self.spoil(byte))
            }
            _ => Some(self.spoil(byte)),
        }
    }

    fn spoil(&mut self, byte: u8) -> Result<Command, Mistake> {
        let mistake = self.line.first().map_or(Mistake::Unknown(byte), |&letter| Mistake::Line(letter));
        self.line.clear();
        self.spoilt = true;
        Err(mistake)
    }
}

fn key(byte: u8) -> Option<Command> {
    Some(match byte {
        b'?' => Command::Help,
        b'r' => Command::Report,
        b't' => Command::Table,
        b's' => Command::Status,
        b'k' => Command::Faults,
        b'v' => Command::Version,
        _ => return None,
    })
}

/// Letters that a line may begin with.
const STARTS: &[u8] = b"fgneiwcazb";

fn whole_line(line: &[u8]) -> Option<Command> {
    match line {
        b"check" => return Some(Command::SelfTest),
        b"arm" => return Some(Command::ArmNull),
        b"null" => return Some(Command::Null),
        b"zero" => return Some(Command::ResetStatistics),
        b"boot" => return Some(Command::Restart),
        _ => {}
    }
    let (&letter, digits) = line.split_first()?;
    let thousandths = thousandths(digits)?;
    if letter == b'f' {
        return Some(Command::Rate(thousandths));
    }
    let number = if thousandths % 1000 == 0 { thousandths / 1000 } else { return None };
    match (letter, number) {
        (b'g', 300) => Some(Command::Range(GyroRange::Dps300)),
        (b'g', 150) => Some(Command::Range(GyroRange::Dps150)),
        (b'g', 75) => Some(Command::Range(GyroRange::Dps75)),
        (b'n', 0..=6) => Some(Command::Filter(number as u8)),
        (b'e', _) => Some(Command::Epoch(number)),
        (b'i', _) => Some(Command::Interval(number)),
        (b'w', 0) => Some(Command::Raw(false)),
        (b'w', 1) => Some(Command::Raw(true)),
        _ => None,
    }
}

/// A decimal number in thousandths, cut after the third decimal; the largest is 4 294 967.295.
fn thousandths(digits: &[u8]) -> Option<u32> {
    let mut parts = digits.split(|&byte| byte == b'.');
    let (whole, fraction) = (parts.next()?, parts.next().unwrap_or_default());
    if parts.next().is_some() || whole.is_empty() && fraction.is_empty() {
        return None;
    }
    let digit = |byte: u8| byte.is_ascii_digit().then(|| u32::from(byte - b'0'));
    let append = |number: u32, byte: u8| number.checked_mul(10)?.checked_add(digit(byte)?);
    if !fraction.iter().all(u8::is_ascii_digit) {
        return None;
    }
    let decimals = fraction.iter().copied().chain(core::iter::repeat(b'0')).take(3);
    whole.iter().copied().chain(decimals).try_fold(0, append)
}

#[cfg(test)]
#[path = "command_tests.rs"]
mod tests;
