//! Commands of the serial port: keys that act at once, and lines that end with Enter.

use crate::answer::Answer;
use crate::bench_console::{hexadecimal, register};
use crate::receive::LOST;
use adis16405_driver::{GyroRange, Register};
use heapless::Vec;
use link::{TextLine, text};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(all(target_os = "none", feature = "microcontroller"), derive(defmt::Format))]
pub(crate) enum Command {
    Answer(Answer),
    Report,
    Version,
    ResetStatistics,
    /// Sample rate, 1/1000 Hz.
    Rate(u32),
    Range(GyroRange),
    /// Base-2 logarithm of the taps.
    Filter(u8),
    /// Length of an epoch, s; 0 for no end.
    Epoch(u32),
    /// Time between reports, s; 0 for none.
    Interval(u32),
    RawStream(bool),
    /// PROD_ID to accept for an ADIS16405; 0 for none.
    ProductId(u16),
    SelfTest,
    BrownOut,
    Arm,
    AutoNull,
    ReadRegister(Register),
    WriteRegister(Register, u16),
    /// Read many times and count different answers.
    CompareReads(Register),
    SlowBus(bool),
    Persist,
    Forget,
    Restart,
    BootLoader,
}

/// Form of a command, and its constructor.
#[derive(Clone, Copy)]
enum Form {
    Title,
    Key(Command),
    Word(Command),
    Thousandths(fn(u32) -> Command),
    Number(fn(u32) -> Option<Command>),
    Register(fn(Register) -> Command),
    RegisterValue(fn(Register, u16) -> Command),
}

/// Usage (begins with the command's word), form and help of each command, in the order of `?`; lines fit 80 columns.
static COMMANDS: [(&str, Form, &str); 35] = {
    use Command as C;
    use Form::{Key, Number, RegisterValue, Thousandths, Title, Word};
    [
        ("at the press of a key:", Title, ""),
        ("?", Key(C::Answer(Answer::Help)), "this list"),
        ("t", Key(C::Answer(Answer::Table)), "report as a table"),
        ("s", Key(C::Answer(Answer::Status)), "status: sensor, rate, epoch, start"),
        ("k", Key(C::Answer(Answer::Counters)), "counters of what was lost and why"),
        ("v", Key(C::Version), "version"),
        ("r", Key(C::Report), "report in frames, for a program"),
        ("settings, with Enter:", Title, ""),
        ("f RATE", Thousandths(C::Rate), "sample rate in Hz, such as f 819.2"),
        ("g RANGE", Number(range), "gyro range in deg/s: 75, 150 or 300"),
        (
            "n TAPS",
            Number(|taps| (taps <= 6).then_some(C::Filter(taps as u8))),
            "filter, log2 of the taps of each stage: 0 to 6",
        ),
        ("e SECONDS", Number(|s| Some(C::Epoch(s))), "length of an epoch, 0 for one without end"),
        ("i SECONDS", Number(|s| Some(C::Interval(s))), "time between reports, 0 for none"),
        (
            "w 1, w 0",
            Number(|on| (on <= 1).then_some(C::RawStream(on == 1))),
            "start and stop the raw stream of bursts",
        ),
        (
            "p ID",
            Number(|id| Some(C::ProductId(id.try_into().ok()?))),
            "take a part with this PROD_ID for an ADIS16405, 0 for none",
        ),
        ("persist", Word(C::Persist), "keep settings and learned models without power"),
        ("forget", Word(C::Forget), "erase what is kept"),
        ("clear", Word(C::ResetStatistics), "reset the statistics"),
        ("the sensor, which must be still, with Enter:", Title, ""),
        ("check", Word(C::SelfTest), "self-test: passed or failed"),
        ("deflect", Word(C::Answer(Answer::Deflections)), "self-test with the deflection of each axis"),
        ("arm", Word(C::Arm), "allow one write to the sensor's flash within 10 s, such as autonull"),
        ("autonull", Word(C::AutoNull), "store the gyro output as the bias"),
        ("the bench, with Enter:", Title, ""),
        ("dump", Word(C::Answer(Answer::Registers)), "all registers of the sensor by name, in hexadecimal"),
        ("peek REG", Form::Register(C::ReadRegister), "read one: peek smpl_prd, or by its address peek 36"),
        ("poke R V", RegisterValue(C::WriteRegister), "write one: poke smpl_prd 0007; check undoes it"),
        ("compare R", Form::Register(C::CompareReads), "read one 10,000 times, count the answers that differ"),
        ("measure", Word(C::Answer(Answer::Measurement)), "SCK, stall and read rate, period and width of data ready"),
        ("bus slow", Word(C::SlowBus(true)), "longer times on the bus, if the sensor answers wrongly"),
        ("bus usual", Word(C::SlowBus(false)), "the usual times on the bus"),
        ("help", Word(C::Answer(Answer::Help)), "this list"),
        ("boot", Word(C::Restart), "restart; the statistics are kept"),
        ("bootsel", Word(C::BootLoader), "start the boot loader, which takes an image over USB"),
        ("brownout", Word(C::BrownOut), "program a reset below 2.7 V into the microcontroller"),
    ]
};

/// Line of the help at an index.
pub fn help(index: usize) -> Option<TextLine> {
    COMMANDS.get(index).map(|(usage, form, help)| match form {
        Form::Title => text!("{usage}"),
        _ => text!("{usage:<10} {help}"),
    })
}

fn range(degrees: u32) -> Option<Command> {
    Some(Command::Range(match degrees {
        300 => GyroRange::Dps300,
        150 => GyroRange::Dps150,
        75 => GyroRange::Dps75,
        _ => return None,
    }))
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum CommandError {
    /// No command begins with this byte; the rest of the line is ignored, except keys.
    UnknownKey(u8),
    /// A line with this first letter is no command.
    InvalidLine(u8),
    LostBytes,
}

/// Longest line of a command, bytes.
const MAX_LINE: usize = 32;

/// Parses commands. A command is a whole line, so that noise on an open input triggers none.
#[derive(Debug, Clone, Default)]
pub(crate) struct CommandParser {
    line: Vec<u8, MAX_LINE>,
    invalid: bool,
}

impl CommandParser {
    pub(crate) fn push(&mut self, byte: u8) -> Option<Result<Command, CommandError>> {
        match byte {
            b'\r' | b'\n' => {
                let invalid = core::mem::take(&mut self.invalid);
                let &letter = self.line.first().filter(|_| !invalid)?;
                let command = whole_line(&self.line).ok_or(CommandError::InvalidLine(letter));
                self.line.clear();
                Some(command)
            }
            LOST => {
                self.line.clear();
                (!core::mem::replace(&mut self.invalid, true)).then_some(Err(CommandError::LostBytes))
            }
            0x08 | 0x7F => {
                self.line.pop();
                None
            }
            _ if self.line.is_empty() && key(byte).is_some() => key(byte).map(Ok),
            _ if self.invalid => None,
            b' ' if self.line.is_empty() => None,
            b'a'..=b'z' | b'0'..=b'9' | b'.' | b'_' | b' ' if !self.line.is_empty() || begins_line(byte) => {
                self.line.push(byte).err().map(|byte| self.reject(byte))
            }
            _ => Some(self.reject(byte)),
        }
    }

    fn reject(&mut self, byte: u8) -> Result<Command, CommandError> {
        let error =
            self.line.first().map_or(CommandError::UnknownKey(byte), |&letter| CommandError::InvalidLine(letter));
        self.line.clear();
        self.invalid = true;
        Err(error)
    }
}

fn key(byte: u8) -> Option<Command> {
    COMMANDS.iter().find_map(|(usage, form, _)| match form {
        Form::Key(command) if usage.as_bytes() == [byte] => Some(*command),
        _ => None,
    })
}

fn begins_line(byte: u8) -> bool {
    let is_line = |form: &Form| !matches!(form, Form::Title | Form::Key(_));
    COMMANDS.iter().any(|(usage, form, _)| is_line(form) && usage.as_bytes()[0] == byte)
}

fn whole_line(line: &[u8]) -> Option<Command> {
    let line = core::str::from_utf8(line).ok()?;
    COMMANDS.iter().find_map(|(usage, form, _)| form.parse(line.trim_start().strip_prefix(word(usage, form))?))
}

/// The command's word in a usage text: all of the text if no argument follows.
fn word<'a>(usage: &'a str, form: &Form) -> &'a str {
    match form {
        Form::Word(_) => usage,
        _ => usage.split(' ').next().unwrap_or_default(),
    }
}

impl Form {
    fn parse(self, rest: &str) -> Option<Command> {
        let mut words = rest.split_ascii_whitespace();
        let first = words.next();
        let command = match self {
            Self::Word(command) => first.is_none().then_some(command)?,
            Self::Thousandths(command) => command(thousandths(first?)?),
            Self::Number(command) => {
                let thousandths = thousandths(first?)?;
                command(thousandths.is_multiple_of(1000).then_some(thousandths / 1000)?)?
            }
            Self::Register(command) => command(register(first?)?),
            Self::RegisterValue(command) => command(register(first?)?, hexadecimal(words.next()?)?),
            Self::Title | Self::Key(_) => return None,
        };
        words.next().is_none().then_some(command)
    }
}

/// Decimal number in thousandths, truncated; at most 4 294 967.295.
fn thousandths(digits: &str) -> Option<u32> {
    let mut parts = digits.split('.');
    let (whole, fraction) = (parts.next()?, parts.next().unwrap_or_default());
    if parts.next().is_some() || whole.is_empty() && fraction.is_empty() {
        return None;
    }
    let digit = |byte: u8| byte.is_ascii_digit().then(|| u32::from(byte - b'0'));
    let append = |number: u32, byte: u8| number.checked_mul(10)?.checked_add(digit(byte)?);
    if !fraction.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    let decimals = fraction.bytes().chain(core::iter::repeat(b'0')).take(3);
    whole.bytes().chain(decimals).try_fold(0, append)
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use std::vec::Vec;

    fn parse(text: &str) -> Vec<Result<Command, CommandError>> {
        let mut parser = CommandParser::default();
        text.bytes().filter_map(|byte| parser.push(byte)).collect()
    }

    #[test]
    fn single_letters_act_at_once_and_numbers_with_enter() {
        assert_eq!(parse("r?"), [Ok(Command::Report), Ok(Command::Answer(Answer::Help))]);
        assert_eq!(
            parse("f 819.2\rn4\ng 75\r\n"),
            [Ok(Command::Rate(819_200)), Ok(Command::Filter(4)), Ok(Command::Range(GyroRange::Dps75)),]
        );
        assert_eq!(
            parse("e3600\ri0\rw1\rw 0\r"),
            [
                Ok(Command::Epoch(3600)),
                Ok(Command::Interval(0)),
                Ok(Command::RawStream(true)),
                Ok(Command::RawStream(false)),
            ]
        );
        assert_eq!(
            parse("f.5\rf5.\rf1.23456\r"),
            [Ok(Command::Rate(500)), Ok(Command::Rate(5000)), Ok(Command::Rate(1234)),]
        );
    }

    #[test]
    fn commands_that_change_something_are_whole_lines() {
        assert_eq!(
            parse("clear\rcheck\narm\rautonull\rboot\rbrownout\rbootsel\rp 3\r"),
            [
                Ok(Command::ResetStatistics),
                Ok(Command::SelfTest),
                Ok(Command::Arm),
                Ok(Command::AutoNull),
                Ok(Command::Restart),
                Ok(Command::BrownOut),
                Ok(Command::BootLoader),
                Ok(Command::ProductId(3)),
            ]
        );
        assert_eq!(
            parse("dump\rmeasure\rdeflect\rbus slow\rbus usual\rpersist\rforget\rhelp\r"),
            [
                Ok(Command::Answer(Answer::Registers)),
                Ok(Command::Answer(Answer::Measurement)),
                Ok(Command::Answer(Answer::Deflections)),
                Ok(Command::SlowBus(true)),
                Ok(Command::SlowBus(false)),
                Ok(Command::Persist),
                Ok(Command::Forget),
                Ok(Command::Answer(Answer::Help)),
            ]
        );
        assert_eq!(
            parse("peek smpl_prd\rpeek 36\rcompare 56\rpoke sens_avg 0x0402\rpoke 3e 80 \r"),
            [
                Ok(Command::ReadRegister(Register::SmplPrd)),
                Ok(Command::ReadRegister(Register::SmplPrd)),
                Ok(Command::CompareReads(Register::ProdId)),
                Ok(Command::WriteRegister(Register::SensAvg, 0x0402)),
                Ok(Command::WriteRegister(Register::GlobCmd, 0x0080)),
            ]
        );
        // A word runs only as a whole line; `t` is a key and acts at once.
        assert_eq!(
            parse("xautonull\rclear\r"),
            [Err(CommandError::UnknownKey(b'x')), Ok(Command::Answer(Answer::Table)), Ok(Command::ResetStatistics),]
        );
    }

    #[test]
    fn an_error_is_reported_once_and_ends_with_the_line() {
        assert_eq!(parse("xyXY5r\rr"), [Err(CommandError::UnknownKey(b'x')), Ok(Command::Report), Ok(Command::Report)]);
        assert_eq!(parse("f1\u{8}\u{8}r"), [Ok(Command::Report)], "backspace deletes a letter");
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

    #[test]
    fn every_command_of_the_list_is_parsed() {
        for (index, (usage, form, _)) in COMMANDS.iter().enumerate() {
            assert!(help(index).is_some_and(|line| line.len() <= 80), "{usage}");
            let argument = match form {
                Form::Title => continue,
                Form::Key(command) => {
                    assert_eq!(parse(usage), [Ok(*command)], "{usage}");
                    continue;
                }
                Form::Word(_) => "",
                Form::Thousandths(_) | Form::Number(_) if *usage == "g RANGE" => "300",
                Form::Thousandths(_) | Form::Number(_) => "1",
                Form::Register(_) => "36",
                Form::RegisterValue(_) => "36 7",
            };
            let typed = std::format!("{} {argument}\r", word(usage, form));
            let expected = form.parse(argument).expect("a command");
            assert_eq!(parse(&typed), [Ok(expected)], "{typed}");
        }
        assert!(help(COMMANDS.len()).is_none());
    }

    #[test]
    fn noise_runs_no_command_that_needs_a_whole_line() {
        let mut parser = CommandParser::default();
        let mut state = 1_u64;
        for _ in 0..1_000_000 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            if let Some(Ok(command)) = parser.push((state >> 56) as u8) {
                let is_key = COMMANDS.iter().any(|(_, form, _)| matches!(form, Form::Key(key) if *key == command));
                assert!(is_key, "{command:?}");
            }
        }
    }
}
