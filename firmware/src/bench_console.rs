//! Requests of a user at a bench (registers, bus and data-ready times, self-test), during which sampling pauses.

use crate::answer::AnswerLine;
use crate::board::{Board, FrameTimes};
use crate::device::{DeviceState, clock_limit_hz};
use crate::number_text::Decimal;
use crate::sensor::{LOW_POWER_LIMIT_HZ, addressed};
use adis16405_driver::{Access, Adis16405, BURST_BYTES, Config, Error, Register, Stimulus, Timing};
use embedded_hal::delay::DelayNs;
use embedded_hal::spi::SpiDevice;
use link::{TextLine, text};

/// The register with this name, or with this address in hexadecimal: `smpl_prd`, `36`, `0x36`.
pub(crate) fn register(name: &str) -> Option<Register> {
    let address = hexadecimal(name).and_then(|address| u8::try_from(address).ok());
    let is_meant = |register: &&Register| {
        register.name().eq_ignore_ascii_case(name) || address.is_some_and(|address| register.address() == address & !1)
    };
    Register::ALL.iter().find(is_meant).copied()
}

/// A number of at most 16 bits in hexadecimal, with or without `0x`.
pub(crate) fn hexadecimal(digits: &str) -> Option<u16> {
    let digits = digits.strip_prefix("0x").unwrap_or(digits);
    // `from_str_radix` would also accept a sign.
    digits.bytes().all(|byte| byte.is_ascii_hexdigit()).then(|| u16::from_str_radix(digits, 16).ok())?
}

enum Request {
    Read(Register),
    Write(Register, u16),
    Deflections(Stimulus),
    Compare(Register),
}

/// Overlapping reads of [`Request::Compare`]: 0.43 s in normal, 1.6 s in low-power mode.
const COMPARED_READS: usize = 10_000;
const OVERLAPPING_READS: usize = 16;

/// Returns the first value, the number of other values, and the bits in which they differ.
fn compared<SPI: SpiDevice<u8>, D: DelayNs>(
    register: Register,
    sensor: &mut Adis16405<SPI, D>,
) -> Result<[i16; 6], Error<SPI::Error>> {
    let first = sensor.read_register(register)?;
    let (mut others, mut bits) = (0, 0);
    for _ in 0..COMPARED_READS / OVERLAPPING_READS {
        for value in sensor.read_registers([register; OVERLAPPING_READS])? {
            others += i16::from(value != first);
            bits |= value ^ first;
        }
    }
    Ok([first as i16, others, bits as i16, 0, 0, 0])
}

/// Asks the sensor while sampling is off, with timing for either power mode; many reads go as fast as configured.
/// Returns a register's value, six deflections or [`compared`]; the error is text to be printed.
#[allow(clippy::result_large_err, reason = "the text of an error is made where its type is known, and printed")]
fn ask(request: Request, state: &DeviceState, board: &mut impl Board) -> Result<[i16; 6], TextLine> {
    board.set_sampling(false);
    let is_fast = matches!(request, Request::Compare(_));
    let sck_hz = board.set_clock_limit(if is_fast { clock_limit_hz(state.config) } else { LOW_POWER_LIMIT_HZ });
    let answer = {
        let mut sensor = addressed(board.sensor_bus(), state.config, sck_hz);
        let answer = match request {
            Request::Read(register) => sensor.read_register(register).map(|value| [value as i16, 0, 0, 0, 0, 0]),
            Request::Write(register, value) => sensor.write_register(register, value).map(|()| [0; 6]),
            Request::Deflections(stimulus) => sensor.stimulus_response(stimulus),
            Request::Compare(register) => {
                compared(register, &mut sensor.with_timing(Timing::DEFAULT).with_sck_hz(sck_hz))
            }
        };
        answer.map_err(|error| text!("{error}"))
    };
    board.set_clock_limit(clock_limit_hz(state.config));
    state.resume_sampling(board);
    answer
}

/// The line of a register that was read, also one of the dump.
#[inline(never)]
pub(crate) fn read_register(register: Register, state: &DeviceState, board: &mut impl Board) -> TextLine {
    if register.access() == Access::Write {
        return text!("{} cannot be read", register.name());
    }
    let answer = ask(Request::Read(register), state, board);
    register_line(register, answer.map(|[value, ..]| text!("{:#06x}  {value}", value as u16)))
}

pub(crate) fn compare_reads(register: Register, state: &DeviceState, board: &mut impl Board) -> TextLine {
    let differences = |[first, others, bits, ..]: [i16; 6]| {
        text!("{:#06x}  {others} of {COMPARED_READS} differ, bits {:#06x}", first as u16, bits as u16)
    };
    register_line(register, ask(Request::Compare(register), state, board).map(differences))
}

fn register_line(register: Register, answer: Result<TextLine, TextLine>) -> TextLine {
    let (Ok(answer) | Err(answer)) = answer;
    text!("{:<10} {:#04x}  {answer}", register.name(), register.address())
}

/// Bits of GLOB_CMD that write the sensor's flash (data sheet Rev. B, pages 10 and 13).
const FLASH_COMMANDS: u16 = 1 << 0 | 1 << 1 | 1 << 3 | 1 << 4;

/// True if this value writes the sensor's flash, one of 10,000 cycles.
pub(crate) fn writes_flash(register: Register, value: u16) -> bool {
    register == Register::GlobCmd && value & FLASH_COMMANDS != 0
}

/// Writes a register and reads it back if possible; `check` restores the device's own settings.
pub(crate) fn write_register(register: Register, value: u16, state: &DeviceState, board: &mut impl Board) -> TextLine {
    let name = register.name();
    match register.access() {
        Access::Read => text!("{name} cannot be written"),
        access => match ask(Request::Write(register, value), state, board) {
            Ok(_) if access == Access::Write => text!("{name} written"),
            Ok(_) => read_register(register, state, board),
            Err(error) => text!("{name}: {error}"),
        },
    }
}

/// A line of the dump: readable registers by address; clears DIAG_STAT.
pub(crate) fn dump_line(state: &DeviceState, board: &mut impl Board, index: usize) -> AnswerLine {
    match Register::ALL.get(index) {
        Some(register) if register.access() == Access::Write => AnswerLine::Skip,
        Some(&register) => AnswerLine::Text(read_register(register, state, board)),
        None => AnswerLine::End,
    }
}

/// Longest wait for a data-ready pulse, sample periods, and its minimum, µs.
const PULSE_PERIODS: f64 = 2.5;
const PULSE_US: u32 = 250_000;

pub(crate) fn measurement_line(state: &DeviceState, board: &mut impl Board, index: usize) -> AnswerLine {
    let hz = |hz: f64| Decimal::significant(hz, 5);
    AnswerLine::Text(match index {
        0 => {
            let burst_us = board.frame_times().low_us;
            let bits = 8 * BURST_BYTES as u32;
            match (state.is_sampled(), burst_us) {
                (true, 1..) => text!(
                    "SCK: {} Hz set; the last burst of {bits} bits took {burst_us} us: {} Hz with its gaps",
                    state.spi_clock_hz,
                    hz(f64::from(bits) * 1e6 / f64::from(burst_us))
                ),
                _ => text!("SCK: {} Hz set; no burst to measure", state.spi_clock_hz),
            }
        }
        1 => match register_frames(state, board) {
            Ok(FrameTimes { shortest_high_us, shortest_period_us, .. }) => text!(
                "stall: CS high for {shortest_high_us} us or more; read rate: {shortest_period_us} us or more a frame"
            ),
            Err(error) => text!("stall: {error}"),
        },
        2 => {
            let programmed = hz(state.config.sample_period().hz());
            match board.estimators(|estimators| estimators.measured_hz()) {
                Some(measured) => {
                    let period_us = Decimal::significant(1e6 / measured, 6);
                    text!("DRDY: {} Hz, period {period_us} us, {programmed} Hz set", hz(measured))
                }
                None => text!("DRDY: fewer than 64 edges; {programmed} Hz set"),
            }
        }
        3 => {
            board.set_sampling(false);
            let limit_us = PULSE_US.max((1e6 * PULSE_PERIODS / state.config.sample_period().hz()) as u32);
            let width = board.data_ready_width_us(limit_us);
            state.resume_sampling(board);
            match width {
                Some(us) => text!("DRDY: high for {us} us, within some us"),
                None => text!("DRDY: no pulse in {} ms", limit_us / 1000),
            }
        }
        _ => return AnswerLine::End,
    })
}

#[allow(clippy::result_large_err, reason = "as for `ask`")]
fn register_frames(state: &DeviceState, board: &mut impl Board) -> Result<FrameTimes, TextLine> {
    board.frame_times();
    ask(Request::Read(Register::ProdId), state, board)?;
    Ok(board.frame_times())
}

/// Deflections of gyros x, y, z and accelerometers x, y, z, counts.
pub(crate) fn deflection_line(state: &DeviceState, board: &mut impl Board, index: usize) -> AnswerLine {
    let (sign, stimulus) = match index {
        0 => return AnswerLine::Text(text!("deflections in counts: gyros x y z, accelerometers x y z")),
        1 => ("positive", Stimulus::Positive),
        2 => ("negative", Stimulus::Negative),
        _ => return AnswerLine::End,
    };
    let test_s = deflection_s(state.config);
    if test_s > LONGEST_TEST_S {
        let test_s = Decimal::significant(test_s, 2);
        return AnswerLine::Text(text!("{sign} not run, it takes {test_s} s: another rate or filter"));
    }
    let response = ask(Request::Deflections(stimulus), state, board);
    // The filter still contains samples of the deflected sensor.
    let now_us = board.now_us();
    board.estimators(|estimators| estimators.accept_samples_after_settling(now_us));
    AnswerLine::Text(match response {
        Ok([a, b, c, d, e, f]) => text!("{sign} {a} {b} {c}  {d} {e} {f}"),
        Err(error) => text!("{sign} {error}"),
    })
}

/// Longest test with one stimulus, s; everything else waits for it.
const LONGEST_TEST_S: f64 = 3.0;

/// Duration of the test with one stimulus, s: two filter lengths and eight samples.
fn deflection_s(config: Config) -> f64 {
    let samples = (2 << config.filter_taps_log2()) + 8;
    2.0 * f64::from(samples) / config.sample_period().hz()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn registers_are_found_by_name_and_by_address() {
        assert_eq!(["smpl_prd", "SMPL_PRD", "36", "0x36", "37"].map(register), [Some(Register::SmplPrd); 5]);
        assert_eq!(["", "smpl", "0x", "fff", "58", "+36", "0x0x36"].map(register), [None; 7]);
        assert_eq!(["0400", "0x400", "ffff"].map(hexadecimal), [Some(0x400), Some(0x400), Some(0xFFFF)]);
        assert_eq!(["", "10000", "-1", "0x", "g"].map(hexadecimal), [None; 5]);
    }
}
