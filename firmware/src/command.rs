//! Commands of the serial port: keys that act at once, and lines that end with Enter.

use crate::bench_console::{hexadecimal, register};
use adis16405_driver::{GyroRange, Register};
use heapless::Vec;

/// The lines that `?` prints, each in 80 columns.
pub const HELP: [&str; 34] = [
    "at the press of a key:",
    "?          this list",
    "t          report as a table",
    "s          status: sensor, rate, epoch, start",
    "k          counters of what was lost and why",
    "v          version",
    "r          report in frames, for a program",
    "settings, with Enter:",
    "f RATE     sample rate in Hz, such as f 819.2",
    "g RANGE    gyro range in deg/s: 75, 150 or 300",
    "n TAPS     filter, log2 of the taps of each stage: 0 to 6",
    "e SECONDS  length of an epoch, 0 for one without end",
    "i SECONDS  time between reports, 0 for none",
    "w 1, w 0   start and stop the raw stream of bursts",
    "p ID       take a part with this PROD_ID for an ADIS16405, 0 for none",
    "persist    keep settings and learned models without power",
    "forget     erase what is kept",
    "clear      reset the statistics",
    "the sensor, which must be still, with Enter:",
    "check      self-test: passed or failed",
    "deflect    self-test with the deflection of each axis",
    "arm        allow one write to the sensor's flash within 10 s, such as autonull",
    "autonull   store the gyro output as the bias",
    "the bench, with Enter:",
    "dump       all registers of the sensor by name, in hexadecimal",
    "peek REG   read one: peek smpl_prd, or by its address peek 36",
    "poke R V   write one: poke smpl_prd 0007; check undoes it",
    "compare R  read one 10,000 times, count the answers that differ",
    "measure    SCK, stall and read rate, period and width of data ready",
    "careful 1  longer times on the bus, if the sensor answers wrongly; careful 0",
    "help       this list",
    "boot       restart; the statistics are kept",
    "bootsel    start the boot loader, which takes a UF2 file over USB",
    "brownout   program a reset below 2.7 V into the microcontroller",
];

/// A valid command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DeviceCommand {
    /// List the commands.
    Help,
    /// Send a report in frames.
    Report,
    /// Print the report as a table.
    Table,
    /// Print the state of the device.
    Status,
    /// Print the version of the firmware.
    Version,
    /// Print the counters that are not 0.
    Counters,
    /// Reset statistics, models and counters.
    ResetStatistics,
    /// Set the sample rate, in 1/1000 Hz.
    Rate(u32),
    /// Set the full scale of the gyros.
    Range(GyroRange),
    /// Set the base-2 logarithm of the filter's taps.
    Filter(u8),
    /// Set the length of an epoch in s, 0 for no end.
    Epoch(u32),
    /// Set the seconds between reports, 0 for none.
    Interval(u32),
    /// Start or stop the stream of raw bursts.
    RawStream(bool),
    /// Take a part that answers this PROD_ID for an ADIS16405, 0 for none.
    ProductId(u16),
    /// Probe the sensor, self-test included.
    SelfTest,
    /// Program the brown-out level into the microcontroller's option bytes.
    BrownOut,
    /// Allow auto-null for 10 s.
    ArmAutoNull,
    /// Store the present gyro output as the bias in the sensor.
    AutoNull,
    /// Print all registers of the sensor.
    DumpRegisters,
    /// Read a register of the sensor.
    ReadRegister(Register),
    /// Write a register of the sensor.
    WriteRegister(Register, u16),
    /// Read a register of the sensor many times, and count the answers that differ.
    CompareReads(Register),
    /// Print the times of the bus and of data ready.
    Measure,
    /// Run the self-test with its deflections.
    Deflections,
    /// Keep longer times on the sensor's bus, or the usual ones.
    CarefulBus(bool),
    /// Keep settings and models in flash memory.
    Persist,
    /// Erase what is kept there.
    Forget,
    /// Restart the microcontroller.
    Restart,
    /// Start the boot loader that takes an image over USB.
    BootLoader,
}

/// Why input is no command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CommandError {
    /// No command begins with this byte. The rest of the line is ignored, except keys that act at once.
    UnknownKey(u8),
    /// The line, which begins with this letter, is no command.
    InvalidLine(u8),
}

/// Longest line in bytes.
const MAX_LINE: usize = 32;

/// Parses commands from received bytes.
///
/// Commands that change or interrupt something are whole lines, so that noise on an unconnected input does not trigger them.
#[derive(Debug, Clone, Default)]
pub struct CommandParser {
    line: Vec<u8, MAX_LINE>,
    /// The line is invalid: ignored up to its end.
    invalid: bool,
}

impl CommandParser {
    /// Takes one byte and returns the command or error that it completes, if any.
    pub fn push(&mut self, byte: u8) -> Option<Result<DeviceCommand, CommandError>> {
        match byte {
            b'\r' | b'\n' => {
                let invalid = core::mem::take(&mut self.invalid);
                let &letter = self.line.first().filter(|_| !invalid)?;
                let command = whole_line(&self.line).ok_or(CommandError::InvalidLine(letter));
                self.line.clear();
                Some(command)
            }
            0x08 | 0x7F => {
                self.line.pop();
                None
            }
            _ if self.line.is_empty() && key(byte).is_some() => key(byte).map(Ok),
            _ if self.invalid => None,
            b' ' if self.line.is_empty() => None,
            b'a'..=b'z' | b'0'..=b'9' | b'.' | b'_' | b' ' if !self.line.is_empty() || LINE_STARTS.contains(&byte) => {
                self.line.push(byte).err().map(|byte| self.reject(byte))
            }
            _ => Some(self.reject(byte)),
        }
    }

    fn reject(&mut self, byte: u8) -> Result<DeviceCommand, CommandError> {
        let error =
            self.line.first().map_or(CommandError::UnknownKey(byte), |&letter| CommandError::InvalidLine(letter));
        self.line.clear();
        self.invalid = true;
        Err(error)
    }
}

fn key(byte: u8) -> Option<DeviceCommand> {
    Some(match byte {
        b'?' => DeviceCommand::Help,
        b'r' => DeviceCommand::Report,
        b't' => DeviceCommand::Table,
        b's' => DeviceCommand::Status,
        b'k' => DeviceCommand::Counters,
        b'v' => DeviceCommand::Version,
        _ => return None,
    })
}

/// Letters that a line may begin with.
const LINE_STARTS: &[u8] = b"fgneiwcabpdhm";

fn whole_line(line: &[u8]) -> Option<DeviceCommand> {
    let words = core::str::from_utf8(line).ok()?.split_ascii_whitespace();
    if let Some(command) = register_command(words) {
        return Some(command);
    }
    let line: Vec<u8, MAX_LINE> = line.iter().copied().filter(|&byte| byte != b' ').collect();
    match line.as_slice() {
        b"help" => return Some(DeviceCommand::Help),
        b"dump" => return Some(DeviceCommand::DumpRegisters),
        b"measure" => return Some(DeviceCommand::Measure),
        b"deflect" => return Some(DeviceCommand::Deflections),
        b"careful1" => return Some(DeviceCommand::CarefulBus(true)),
        b"careful0" => return Some(DeviceCommand::CarefulBus(false)),
        b"check" => return Some(DeviceCommand::SelfTest),
        b"arm" => return Some(DeviceCommand::ArmAutoNull),
        b"autonull" => return Some(DeviceCommand::AutoNull),
        b"clear" => return Some(DeviceCommand::ResetStatistics),
        b"persist" => return Some(DeviceCommand::Persist),
        b"forget" => return Some(DeviceCommand::Forget),
        b"boot" => return Some(DeviceCommand::Restart),
        b"bootsel" => return Some(DeviceCommand::BootLoader),
        b"brownout" => return Some(DeviceCommand::BrownOut),
        _ => {}
    }
    let (&letter, digits) = line.split_first()?;
    let thousandths = thousandths(digits)?;
    if letter == b'f' {
        return Some(DeviceCommand::Rate(thousandths));
    }
    let number = if thousandths % 1000 == 0 { thousandths / 1000 } else { return None };
    match (letter, number) {
        (b'g', 300) => Some(DeviceCommand::Range(GyroRange::Dps300)),
        (b'g', 150) => Some(DeviceCommand::Range(GyroRange::Dps150)),
        (b'g', 75) => Some(DeviceCommand::Range(GyroRange::Dps75)),
        (b'n', 0..=6) => Some(DeviceCommand::Filter(number as u8)),
        (b'e', _) => Some(DeviceCommand::Epoch(number)),
        (b'i', _) => Some(DeviceCommand::Interval(number)),
        (b'p', _) => u16::try_from(number).ok().map(DeviceCommand::ProductId),
        (b'w', 0) => Some(DeviceCommand::RawStream(false)),
        (b'w', 1) => Some(DeviceCommand::RawStream(true)),
        _ => None,
    }
}

/// `peek REGISTER`, `compare REGISTER` or `poke REGISTER VALUE`.
fn register_command<'a>(mut words: impl Iterator<Item = &'a str>) -> Option<DeviceCommand> {
    let (verb, register) = (words.next()?, register(words.next()?)?);
    let command = match verb {
        "peek" => DeviceCommand::ReadRegister(register),
        "compare" => DeviceCommand::CompareReads(register),
        "poke" => DeviceCommand::WriteRegister(register, hexadecimal(words.next()?)?),
        _ => return None,
    };
    words.next().is_none().then_some(command)
}

/// Parses a decimal number as thousandths, truncated after the third decimal; the largest is 4 294 967.295.
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
mod tests {
    extern crate std;

    use super::*;
    use std::vec::Vec;

    fn parse(text: &str) -> Vec<Result<DeviceCommand, CommandError>> {
        let mut parser = CommandParser::default();
        text.bytes().filter_map(|byte| parser.push(byte)).collect()
    }

    #[test]
    fn single_letters_act_at_once_and_numbers_with_enter() {
        assert_eq!(parse("r?"), [Ok(DeviceCommand::Report), Ok(DeviceCommand::Help)]);
        assert_eq!(
            parse("f 819.2\rn4\ng 75\r\n"),
            [
                Ok(DeviceCommand::Rate(819_200)),
                Ok(DeviceCommand::Filter(4)),
                Ok(DeviceCommand::Range(GyroRange::Dps75)),
            ]
        );
        assert_eq!(
            parse("e3600\ri0\rw1\rw 0\r"),
            [
                Ok(DeviceCommand::Epoch(3600)),
                Ok(DeviceCommand::Interval(0)),
                Ok(DeviceCommand::RawStream(true)),
                Ok(DeviceCommand::RawStream(false)),
            ]
        );
        assert_eq!(
            parse("f.5\rf5.\rf1.23456\r"),
            [Ok(DeviceCommand::Rate(500)), Ok(DeviceCommand::Rate(5000)), Ok(DeviceCommand::Rate(1234)),]
        );
    }

    #[test]
    fn commands_that_change_something_are_whole_lines() {
        assert_eq!(
            parse("clear\rcheck\narm\rautonull\rboot\rbrownout\rbootsel\rp 3\r"),
            [
                Ok(DeviceCommand::ResetStatistics),
                Ok(DeviceCommand::SelfTest),
                Ok(DeviceCommand::ArmAutoNull),
                Ok(DeviceCommand::AutoNull),
                Ok(DeviceCommand::Restart),
                Ok(DeviceCommand::BrownOut),
                Ok(DeviceCommand::BootLoader),
                Ok(DeviceCommand::ProductId(3)),
            ]
        );
        assert_eq!(
            parse("dump\rmeasure\rdeflect\rcareful 1\rcareful 0\rpersist\rforget\rhelp\r"),
            [
                Ok(DeviceCommand::DumpRegisters),
                Ok(DeviceCommand::Measure),
                Ok(DeviceCommand::Deflections),
                Ok(DeviceCommand::CarefulBus(true)),
                Ok(DeviceCommand::CarefulBus(false)),
                Ok(DeviceCommand::Persist),
                Ok(DeviceCommand::Forget),
                Ok(DeviceCommand::Help),
            ]
        );
        assert_eq!(
            parse("peek smpl_prd\rpeek 36\rcompare 56\rpoke sens_avg 0x0402\rpoke 3e 80 \r"),
            [
                Ok(DeviceCommand::ReadRegister(Register::SmplPrd)),
                Ok(DeviceCommand::ReadRegister(Register::SmplPrd)),
                Ok(DeviceCommand::CompareReads(Register::ProdId)),
                Ok(DeviceCommand::WriteRegister(Register::SensAvg, 0x0402)),
                Ok(DeviceCommand::WriteRegister(Register::GlobCmd, 0x0080)),
            ]
        );
        // After an unknown key the line is ignored, except the key `t`, which acts at once.
        assert_eq!(
            parse("xautonull\rclear\r"),
            [Err(CommandError::UnknownKey(b'x')), Ok(DeviceCommand::Table), Ok(DeviceCommand::ResetStatistics),]
        );
    }

    #[test]
    fn an_error_is_reported_once_and_ends_with_the_line() {
        assert_eq!(
            parse("xyXY5r\rr"),
            [Err(CommandError::UnknownKey(b'x')), Ok(DeviceCommand::Report), Ok(DeviceCommand::Report)]
        );
        assert_eq!(parse("f1\u{8}\u{8}r"), [Ok(DeviceCommand::Report)], "backspace deletes a letter");
        let long = "f000000000000000000000000000000000\r";
        for wrong in [
            "f\r",
            "f.\r",
            "n7\r",
            "n1.5\r",
            "g100\r",
            "w2\r",
            "f1e3\r",
            "f-1\r",
            "f1.2.3\r",
            "f1.2345x\r",
            "e4294968\r",
            "p65536\r",
            "cl3ar\r",
            "peek\r",
            "peek smpl\r",
            "poke 36\r",
            "poke 36 10000\r",
            "poke 36 1 2\r",
            long,
        ] {
            let letter = wrong.as_bytes()[0];
            assert_eq!(parse(wrong), [Err(CommandError::InvalidLine(letter))], "{wrong}");
        }
    }

    /// The first letters in the help are exactly the keys and the letters that a line may begin with.
    #[test]
    fn the_help_is_complete() {
        let first = |line: &&str| line.split([' ', ',']).next().unwrap().as_bytes()[0];
        let listed: Vec<u8> = HELP.iter().filter(|line| !line.ends_with(':')).map(first).collect();
        for letter in b'!'..=b'~' {
            let known = key(letter).is_some() || LINE_STARTS.contains(&letter);
            assert_eq!(known, listed.contains(&letter), "{}", letter as char);
        }
    }

    /// A million random bytes give keys, but no command that changes something.
    #[test]
    fn noise_changes_nothing() {
        let mut parser = CommandParser::default();
        let mut state = 1_u64;
        for _ in 0..1_000_000 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            if let Some(Ok(command)) = parser.push((state >> 56) as u8) {
                use DeviceCommand::{Counters, Help, Report, Status, Table, Version};
                assert!(matches!(command, Help | Report | Table | Status | Counters | Version), "{command:?}");
            }
        }
    }
}
