//! Checks of the answers against limits, with the probable cause of each failure.

use super::transcript::{PATTERNS, Topic, Transcript, raw_messages};
use adis16405_driver::{Channel, GyroRange, OutputWord, Product};
use link::{BootCause, ClockSource, Health, RawMessage, Received};
use std::collections::BTreeMap;
use std::fmt;

/// A check: a figure, its limit, and the probable cause if it is beyond the limit.
#[derive(Debug, Clone, PartialEq)]
pub struct Check {
    /// Name of the figure.
    pub name: &'static str,
    /// The figure; empty if it was not measured.
    pub measured: String,
    /// Its limit, with the page or table of the data sheet.
    pub limit: String,
    /// The probable cause of a failure; `None` if the check passes.
    pub cause: Option<Cause>,
}

/// Probable cause of a failure.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Cause {
    /// Nothing was received.
    Silent,
    /// No version line was received.
    NotThisFirmware,
    /// Messages were lost between board and host.
    LinkLoss,
    /// The crystal did not start.
    NoCrystal,
    /// The board has restarted during the run.
    Restarted(BootCause),
    /// There is no answer and no data-ready pulse.
    NoSupply,
    /// All answers are zeros, but data ready pulses.
    DataLow,
    /// All answers are ones, but data ready pulses.
    DataHigh,
    /// PROD_ID is shifted by a bit.
    SpiMode,
    /// Every register gives the same answer.
    RequestsLost,
    /// These bits never change.
    StuckBits(u16),
    /// It is another sensor of the family, with this PROD_ID.
    OtherProduct(u16),
    /// Ones arrive as zeros, but no zero arrives as a one.
    OnesLost,
    /// Bits are damaged at random.
    BitErrors,
    /// Answers are right only at the slow clock.
    FastClockFails,
    /// SCK is beyond the sensor's limit.
    SckTooFast,
    /// Frames follow one another too soon.
    FramesTooSoon,
    /// These bits of written values arrive damaged.
    WritesDamaged(u16),
    /// These sensors fail the self-test.
    SelfTest(String),
    /// The stimulus does not deflect these axes.
    NoDeflection(String),
    /// There is no data-ready pulse, although the sensor answers.
    NoDataReady,
    /// Data ready has another rate than set.
    DataReadyRate,
    /// The data-ready pulses have a wrong width.
    DataReadyWidth,
    /// The data-ready line has many edges in a row.
    DataReadyFloats,
    /// Data-ready edges do not arrive.
    EdgesLost,
    /// There are data-ready edges without a sample.
    EdgesAdded,
    /// The noise is larger than the sensor's.
    TooNoisy,
    /// The noise is smaller than the sensor's.
    TooQuiet,
    /// The filter does not have the effect of its setting.
    FilterNotSet,
    /// The supply is below its window, in mV.
    SupplyLow(u32),
    /// The supply is above its window, in mV.
    SupplyHigh(u32),
    /// The line from DOUT is interrupted at times.
    LooseData,
    /// Clocks are lost or doubled.
    ClockEdges,
    /// The same burst repeats.
    Frozen,
    /// Bursts have no new sample.
    NothingNew,
    /// The sensor was lost and recovered.
    Recovered,
    /// The board is too slow.
    BoardOverrun,
    /// The sum of the accelerations is not that of gravity, or the rates are not near 0.
    Moving,
    /// The bursts of two ports differ.
    PortsDiffer,
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = match self {
            Self::Silent => {
                "Nothing answers. Another port, no image on the board, or TX and RX exchanged: a Pico is /dev/ttyACM0; the UART has 460,800 Bd."
            }
            Self::NotThisFirmware => {
                "Another device, or another baud rate: `v` is not answered by \"ADIS16405 noise observatory\"."
            }
            Self::LinkLoss => {
                "Messages are lost between board and host: ground, the length of the serial wires, a hub, or a busy host."
            }
            Self::NoCrystal => "The crystal did not start: times and rates are those of the internal oscillator.",
            Self::Restarted(cause) => return write!(f, "The board has restarted meanwhile ({cause:?}): its supply?"),
            Self::NoSupply => {
                "The sensor neither answers nor gives data-ready pulses: no 5 V at VCC, no ground, or RST is low."
            }
            Self::DataLow => {
                "The sensor runs, but DOUT reads low: DOUT and DIN exchanged, a wire of DOUT, SCLK, DIN or CS open, or a divider in DOUT."
            }
            Self::DataHigh => "The sensor runs, but DOUT reads high: CS does not reach the sensor, or DOUT is shorted.",
            Self::SpiMode => {
                "PROD_ID arrives shifted by a bit: SPI mode 3 is needed; else a ringing or slow edge of SCLK."
            }
            Self::RequestsLost => "Every register gives the same answer: requests do not arrive, the wire of DIN.",
            Self::StuckBits(bits) => {
                return write!(
                    f,
                    "The bits {bits:#06x} of every answer are stuck: the SPI of the board samples them too late or too soon."
                );
            }
            Self::OtherProduct(id) => {
                return write!(f, "Another sensor, PROD_ID {id}. If it is an ADIS16405 nevertheless: p {id}.");
            }
            Self::OnesLost => {
                "Ones arrive as zeros, never the reverse: the high level of DOUT is too low. Remove a divider or level shifter."
            }
            Self::BitErrors => "Bits are damaged at random: cable length, ground, or crosstalk on DOUT or DIN.",
            Self::FastClockFails => {
                "Right at 300 kHz, wrong at the clock of bursts: SCLK or DOUT is too slow. A shorter cable, or longer times on the bus."
            }
            Self::SckTooFast => "SCK is set above the sensor's limit.",
            Self::FramesTooSoon => "Frames follow one another too soon for the sensor.",
            Self::WritesDamaged(bits) => {
                return write!(f, "Written values arrive damaged in the bits {bits:#06x}: the wire of DIN.");
            }
            Self::SelfTest(sensors) => {
                return write!(f, "Self-test failed: {sensors}. Keep the sensor still and repeat; else it is broken.");
            }
            Self::NoDeflection(axes) => {
                return write!(f, "The stimulus of the self-test does not deflect {axes}: broken.");
            }
            Self::NoDataReady => {
                "The sensor answers, but no data-ready pulse arrives: DIO1 is open, or on another pin."
            }
            Self::DataReadyRate => {
                "Data ready comes at another rate than was set: another signal on the pin, or the sensor's clock."
            }
            Self::DataReadyWidth => {
                "The pulse of data ready has another width: inverted, or another signal on the pin."
            }
            Self::DataReadyFloats => "The data-ready input oscillates: DIO1 is open or loose, or its ground is.",
            Self::EdgesLost => "Data-ready edges are lost: a loose wire of DIO1, or the board is late.",
            Self::EdgesAdded => "Data-ready edges are doubled: ringing or crosstalk on DIO1.",
            Self::TooNoisy => "More noise than the sensor makes: vibration of the bench, the supply, or damaged bits.",
            Self::TooQuiet => "Less noise than the sensor makes: a filter that was not set, or values that repeat.",
            Self::FilterNotSet => "The filter has another effect than was set: SENS_AVG does not take its value.",
            Self::SupplyLow(mv) if *mv < 4_000 => {
                return write!(
                    f,
                    "The supply is {mv} mV: VCC is on a 3.3 V pin and needs 5 V, on a Pico pin 40 (VBUS)."
                );
            }
            Self::SupplyLow(mv) => {
                return write!(
                    f,
                    "The supply is {mv} mV: a better USB cable or a supply of 5 V. Samples are used and marked."
                );
            }
            Self::SupplyHigh(mv) => return write!(f, "The supply is {mv} mV: more than 5.25 V can damage the sensor."),
            Self::LooseData => "Bursts of zeros or ones at times: a loose wire of DOUT, CS or the supply.",
            Self::ClockEdges => {
                "Bursts are shifted at times: edges of SCLK are lost or doubled; ringing, or a loose wire."
            }
            Self::Frozen => "The sensor repeats one burst: reset it by its supply.",
            Self::NothingNew => "Bursts have no new sample: DIO1 is not the sensor's data ready.",
            Self::Recovered => "The sensor was lost and recovered: a loose wire or its supply.",
            Self::BoardOverrun => "The board does not keep up: please report it.",
            Self::Moving => "Not at rest, or not a sensor's values: keep it still; else damaged bits.",
            Self::PortsDiffer => "The two ports do not carry the same bursts: one of them loses bytes.",
        };
        f.write_str(text)
    }
}

impl Check {
    fn new(name: &'static str, measured: impl Into<String>, limit: &str, cause: Option<Cause>) -> Self {
        Self { name, measured: measured.into(), limit: limit.to_owned(), cause }
    }

    /// A check that could not be measured.
    fn not_run(name: &'static str, limit: &str) -> Self {
        Self::new(name, "", limit, None)
    }
}

/// The value of a line `NAME  ADDRESS  VALUE …` about a register.
fn register_value(line: &str) -> Option<u16> {
    u16::from_str_radix(line.split_whitespace().nth(2)?.strip_prefix("0x")?, 16).ok()
}

/// The number after `prefix` in a line; it may have commas between thousands.
fn number_behind(line: &str, prefix: &str) -> Option<f64> {
    line.split_once(prefix)?.1.split_whitespace().next()?.trim_end_matches(':').replace(',', "").parse().ok()
}

fn identity(transcript: &Transcript) -> Option<u16> {
    transcript.lines(Topic::Identity).filter(|line| line.starts_with("PROD_ID")).find_map(register_value)
}

/// True if the sensor gives no answer that the firmware accepts.
pub(super) fn is_deaf(transcript: &Transcript) -> bool {
    let known = identity(transcript).and_then(Product::from_prod_id).is_some();
    !known && !transcript.hello(Topic::Report).is_some_and(|hello| hello.sampling)
}

/// Reads of PROD_ID at the clock of bursts.
#[derive(Debug, Default)]
struct Reads {
    number: u32,
    others: u32,
    /// Bits in which any read differed from the expected value.
    bits: u16,
    /// True if the first read of a batch was wrong.
    is_first_wrong: bool,
}

fn reads(transcript: &Transcript) -> Reads {
    let mut reads = Reads::default();
    for line in transcript.lines(Topic::Reads).filter(|line| line.starts_with("PROD_ID")) {
        let (Some(first), Some(others)) = (register_value(line), line.split_whitespace().nth(3)) else { continue };
        let bits = line.split_once("bits 0x").and_then(|(_, bits)| u16::from_str_radix(bits, 16).ok());
        let wrong = first ^ identity(transcript).filter(|id| *id != 0).unwrap_or(EXPECTED);
        reads.number += number_behind(line, " of ").map_or(0, |number| number as u32);
        reads.others += others.parse().unwrap_or(0);
        reads.bits |= bits.unwrap_or(0) | wrong;
        reads.is_first_wrong |= wrong != 0;
    }
    reads
}

/// True if further reads would give no new information.
pub(super) fn reads_are_wrong(transcript: &Transcript) -> bool {
    let Reads { others, is_first_wrong, .. } = reads(transcript);
    others > 0 || is_first_wrong || is_deaf(transcript)
}

/// PROD_ID of an ADIS16405.
const EXPECTED: u16 = 16405;
/// Other sensors of the family, by PROD_ID.
const FAMILY: [u16; 17] = [
    16300, 16334, 16350, 16354, 16355, 16360, 16362, 16364, 16365, 16367, 16407, 16445, 16448, 16480, 16485, 16488,
    16495,
];

/// All checks; those that reveal a cause come first.
#[must_use]
pub fn checks(transcript: &Transcript) -> Vec<Check> {
    if transcript.is_silent() {
        return vec![Check::new("console", "nothing received", "a version line", Some(Cause::Silent))];
    }
    let mut checks = vec![console(transcript), link(transcript)];
    checks.extend(board(transcript));
    checks.extend(identification(transcript));
    checks.extend(bus_times(transcript));
    checks.extend(data_ready(transcript));
    checks.extend(self_test(transcript));
    checks.extend(bursts(transcript));
    checks.extend(noise(transcript));
    checks.push(second_port(transcript));
    checks
}

fn console(transcript: &Transcript) -> Check {
    let version = transcript.lines(Topic::Version).find(|line| line.starts_with("ADIS16405 noise observatory"));
    let cause = version.is_none().then_some(Cause::NotThisFirmware);
    Check::new("console", version.unwrap_or("no version line"), "a version line", cause)
}

fn link(transcript: &Transcript) -> Check {
    let counters = &transcript.counters;
    // The port may be opened within a message, which is then damaged.
    let damaged = counters.bad_frames.saturating_sub(1) + counters.missing;
    let measured = format!("{} messages, {damaged} lost", counters.frames);
    Check::new("serial link", measured, "none lost", (damaged > 0).then_some(Cause::LinkLoss))
}

fn board(transcript: &Transcript) -> Vec<Check> {
    let Some(first) = transcript.hello(Topic::Report) else {
        return vec![Check::not_run("clock of the board", "crystal"), Check::not_run("restarts", "none")];
    };
    let is_internal = first.boot.clock == ClockSource::Internal;
    let clock = if is_internal { "internal oscillator" } else { "crystal" };
    let last = transcript.hello(Topic::BurstReport).unwrap_or(first);
    let restarts = last.boot.starts.saturating_sub(first.boot.starts);
    vec![
        Check::new("clock of the board", clock, "crystal", is_internal.then_some(Cause::NoCrystal)),
        Check::new(
            "restarts",
            format!("{restarts}"),
            "none",
            (restarts > 0).then_some(Cause::Restarted(last.boot.cause)),
        ),
    ]
}

fn identification(transcript: &Transcript) -> Vec<Check> {
    let (name, limit) = ("PROD_ID", "16405 (0x4015)");
    let Some(id) = identity(transcript) else {
        let answer = transcript.lines(Topic::Identity).next().unwrap_or("no answer").to_owned();
        return vec![Check::new(name, answer, limit, Some(Cause::NoSupply))];
    };
    let reads = reads(transcript);
    let has_pulses = pulse_width_us(transcript).is_some();
    let other = transcript.lines(Topic::OtherRegister).find_map(register_value);
    let is_accepted = Product::from_prod_id(id).is_some() || !is_deaf(transcript);
    let cause = match id {
        _ if is_accepted => None,
        0x0000 if has_pulses => Some(Cause::DataLow),
        0xFFFF if has_pulses => Some(Cause::DataHigh),
        0x0000 | 0xFFFF => Some(Cause::NoSupply),
        _ if (id & !1) == EXPECTED << 1 || (id & 0x7FFF) == EXPECTED >> 1 => Some(Cause::SpiMode),
        _ if other == Some(id) => Some(Cause::RequestsLost),
        _ if FAMILY.contains(&id) => Some(Cause::OtherProduct(id)),
        _ if reads.others == 0 && (id ^ EXPECTED).count_ones() <= 2 => Some(Cause::StuckBits(id ^ EXPECTED)),
        _ if id & !EXPECTED == 0 => Some(Cause::OnesLost),
        _ => Some(Cause::BitErrors),
    };
    let mut checks = vec![Check::new(name, format!("{id} ({id:#06x})"), limit, cause)];
    if reads.number > 0 && is_accepted {
        let Reads { number, others, bits, is_first_wrong } = reads;
        let wrong = others > 0 || is_first_wrong;
        let cause = match bits {
            _ if !wrong => None,
            _ if bits & !id == 0 => Some(Cause::OnesLost),
            _ if is_first_wrong || others > number / 10 => Some(Cause::FastClockFails),
            _ => Some(Cause::BitErrors),
        };
        let measured = format!("{others} of {number} differ, bits {bits:#06x}");
        checks.push(Check::new("PROD_ID again and again", measured, "none", cause));
    } else {
        checks.push(Check::not_run("PROD_ID again and again", "none differs"));
    }
    let (mut written, mut bits) = (0, 0);
    for pattern in PATTERNS {
        let line = transcript.lines(Topic::Pattern(pattern)).find(|line| line.starts_with("ALM_MAG1"));
        if let Some(value) = line.and_then(register_value) {
            written += 1;
            bits |= value ^ pattern;
        }
    }
    checks.push(match written {
        0 => Check::not_run("registers written, read", "as written"),
        _ => {
            let measured = format!("{written} patterns, wrong bits {bits:#06x}");
            let cause = (bits != 0).then_some(Cause::WritesDamaged(bits));
            Check::new("registers written, read", measured, "as written", cause)
        }
    });
    checks
}

fn bus_times(transcript: &Transcript) -> Vec<Check> {
    let line = |start: &str| transcript.lines(Topic::Measurement).find(|line| line.starts_with(start));
    let sck = line("SCK: ").and_then(|line| Some((line, number_behind(line, "SCK: ")?)));
    let sck = match sck {
        None => Check::not_run("SCK", "1,000,000 Hz at most (Table 2)"),
        Some((line, set_hz)) => {
            let measured = number_behind(line, " us: ").map_or(String::new(), |hz| format!(", {hz:.0} Hz in a burst"));
            let is_too_fast = set_hz > 1e6 || number_behind(line, " us: ").is_some_and(|hz| hz > 1.02e6);
            let text = format!("{set_hz:.0} Hz set{measured}");
            Check::new("SCK", text, "1,000,000 Hz at most (Table 2)", is_too_fast.then_some(Cause::SckTooFast))
        }
    };
    let times = line("stall: CS high for ");
    let times = times
        .and_then(|line| Some((number_behind(line, "CS high for ")?, number_behind(line, "read rate: ")?)))
        .filter(|_| !is_deaf(transcript));
    // At 204.8 SPS the sensor is in normal mode. The board measures times to 1 us.
    let limit = "9 and 40 us at least (Table 2)";
    let times = match times {
        None => Check::not_run("stall, frame to frame", limit),
        Some((stall_us, frame_us)) => {
            let cause = (stall_us < 8.0 || frame_us < 39.0).then_some(Cause::FramesTooSoon);
            Check::new("stall, frame to frame", format!("{stall_us} and {frame_us} us"), limit, cause)
        }
    };
    vec![sck, times]
}

/// Width of the data-ready pulse, µs.
fn pulse_width_us(transcript: &Transcript) -> Option<f64> {
    transcript.lines(Topic::Measurement).find_map(|line| number_behind(line, "DRDY: high for "))
}

fn data_ready(transcript: &Transcript) -> Vec<Check> {
    let (rate_limit, width_limit) = ("within 3 % (Table 1)", "100 to 200 us (p. 14)");
    if is_deaf(transcript) {
        return vec![Check::not_run("data ready", rate_limit), Check::not_run("its pulse", width_limit)];
    }
    let floats = transcript.health(Topic::BurstReport).is_some_and(|health| health.data_ready_masked > 0);
    let no_edges = if floats { Cause::DataReadyFloats } else { Cause::NoDataReady };
    let rates = transcript.lines(Topic::Measurement).find_map(|line| {
        let measured = line.strip_prefix("DRDY: ")?.split_whitespace().next()?.parse::<f64>().ok()?;
        let set = line.rsplit_once(" Hz set")?.0.rsplit(' ').next()?.parse::<f64>().ok()?;
        Some((measured, set))
    });
    let rate = match rates {
        // Each recovery restarts the count of edges, so this check is not run.
        None if pulse_width_us(transcript).is_some() => Check::not_run("data ready", rate_limit),
        None => Check::new("data ready", "too few edges", rate_limit, Some(no_edges.clone())),
        Some((hz, set)) => {
            let cause = (!(0.97..=1.03).contains(&(hz / set))).then_some(Cause::DataReadyRate);
            Check::new("data ready", format!("{hz} Hz, {set} Hz set"), rate_limit, cause)
        }
    };
    let width = match pulse_width_us(transcript) {
        None => Check::new("its pulse", "none", width_limit, Some(no_edges)),
        Some(us) => {
            // The board measures the level to within some us.
            let cause = (!(95.0..=205.0).contains(&us)).then_some(Cause::DataReadyWidth);
            Check::new("its pulse", format!("{us} us"), width_limit, cause)
        }
    };
    vec![rate, width]
}

/// Names of the axes of the self-test, in the order of its answers.
const AXES: [&str; 6] = ["gyro x", "gyro y", "gyro z", "accl x", "accl y", "accl z"];

fn self_test(transcript: &Transcript) -> Vec<Check> {
    let line = |start: &str| transcript.lines(Topic::SelfTest).find_map(|line| line.split_once(start));
    let passed = match line("check: ") {
        None => Check::not_run("self-test", "passed (p. 15)"),
        Some((_, verdict)) if verdict.starts_with("passed") => {
            Check::new("self-test", "passed", "passed (p. 15)", None)
        }
        Some(_) => {
            let sensors = line("self-test ").map_or("unknown", |(_, text)| text).to_owned();
            let cause = Cause::SelfTest(sensors.clone());
            Check::new("self-test", sensors, "passed (p. 15)", Some(cause))
        }
    };
    let counts = |sign: &str| -> Option<Vec<i32>> {
        let line = transcript.lines(Topic::Deflections).find_map(|line| line.strip_prefix(sign))?;
        let counts = line.split_whitespace().map(str::parse).collect::<Result<Vec<i32>, _>>().ok()?;
        (counts.len() == 6).then_some(counts)
    };
    // The limits are five deviations of the difference of two means over eight samples of 0.9 deg/s or 9 mg rms (Table
    // 1).
    let limit = "45 counts of gyros, 7 of accelerometers at least";
    let deflection = match (counts("positive "), counts("negative ")) {
        (Some(positive), Some(negative)) => {
            let is_still = |axis: usize| {
                let least = if axis < 3 { 45 } else { 7 };
                let opposite = axis < 3 && positive[axis].signum() == negative[axis].signum();
                positive[axis].abs() < least || opposite
            };
            let still: Vec<&str> = (0..6).filter(|&axis| is_still(axis)).map(|axis| AXES[axis]).collect();
            let measured = positive.iter().map(i32::to_string).collect::<Vec<_>>().join(" ");
            let cause = (!still.is_empty()).then(|| Cause::NoDeflection(still.join(", ")));
            Check::new("deflections", measured, limit, cause)
        }
        _ => Check::not_run("deflections", limit),
    };
    vec![passed, deflection]
}

/// Mean and standard deviation of a channel in a part of the raw stream, in its unit; `None` with fewer than two
/// bursts.
fn statistics(transcript: &Transcript, topic: Topic, channel: Channel) -> Option<(f64, f64)> {
    let (mut number, mut sum, mut squares) = (0.0, 0.0, 0.0);
    for raw in transcript.raw(topic) {
        let range = GyroRange::from_sens_avg(raw.sens_avg)?;
        for burst in &raw.bursts {
            let word = OutputWord(u16::from_be_bytes(burst.words[channel as usize]));
            let value = f64::from(word.counts(channel)) * channel.lsb(range) + channel.offset();
            (number, sum, squares) = (number + 1.0, sum + value, squares + value * value);
        }
    }
    let mean = sum / number;
    (number > 1.0).then(|| (mean, ((squares / number - mean * mean).max(0.0) * number / (number - 1.0)).sqrt()))
}

const GYROS: [Channel; 3] = [Channel::GyroX, Channel::GyroY, Channel::GyroZ];
const ACCELEROMETERS: [Channel; 3] = [Channel::AcclX, Channel::AcclY, Channel::AcclZ];

fn texts(values: impl IntoIterator<Item = f64>, decimals: usize) -> String {
    values.into_iter().map(|value| format!("{value:.decimals$}")).collect::<Vec<_>>().join(" ")
}

/// Checks the standard deviations without a filter and behind one of 16 taps, at 819.2 SPS.
fn noise(transcript: &Transcript) -> Vec<Check> {
    let deviation = |topic, channel| statistics(transcript, topic, channel).map(|(_, deviation)| deviation);
    let all = |topic, channels: [Channel; 3]| -> Option<Vec<f64>> {
        channels.into_iter().map(|channel| deviation(topic, channel)).collect()
    };
    let mut checks = Vec::new();
    // The limits are a factor of two around the typical values of Table 1.
    for (name, channels, unit, scale, typical) in [
        ("noise of the gyros", GYROS, "deg/s", 1.0, 0.9),
        ("noise of the accelerometers", ACCELEROMETERS, "mg", 1e3, 9.0),
    ] {
        let limit = format!("{} to {} {unit} (Table 1: {typical})", typical / 2.0, typical * 2.0);
        checks.push(match all(Topic::Unfiltered, channels) {
            None => Check::not_run(name, &limit),
            Some(deviations) => {
                let scaled: Vec<f64> = deviations.iter().map(|deviation| deviation * scale).collect();
                let cause = if scaled.iter().any(|value| *value > 2.0 * typical) {
                    Some(Cause::TooNoisy)
                } else {
                    scaled.iter().any(|value| *value < typical / 2.0).then_some(Cause::TooQuiet)
                };
                Check::new(name, format!("{} {unit}", texts(scaled, 2)), &limit, cause)
            }
        });
    }
    // Two averages of N = 16 samples leave sqrt((2N² + 1)/(3N³)) = 0.204 of white noise, within 5 % in four seconds. Rounding to 3.33 mg
    // adds a fifth to the value of accelerometers.
    let limit = "0.15 to 0.30 of it (0.204 for white noise)";
    let ratios = || -> Option<Vec<f64>> {
        let channels = GYROS.into_iter().chain(ACCELEROMETERS);
        channels
            .map(|channel| Some(deviation(Topic::Filtered, channel)? / deviation(Topic::Unfiltered, channel)?))
            .collect()
    };
    checks.push(match ratios() {
        None => Check::not_run("behind a filter of 16 taps", limit),
        Some(ratios) => {
            let cause = ratios.iter().any(|ratio| !(0.15..=0.30).contains(ratio)).then_some(Cause::FilterNotSet);
            Check::new("behind a filter of 16 taps", texts(ratios, 2), limit, cause)
        }
    });
    checks
}

/// The counters of damaged bursts with their probable causes; root causes come first.
fn damage(health: &Health) -> [(&'static str, u32, Cause); 12] {
    // A burst at a spurious edge comes too soon after the previous one.
    let unless_added = |cause| if health.spurious_edges > 0 { Cause::EdgesAdded } else { cause };
    [
        ("stuck low", health.stuck_low, Cause::LooseData),
        ("stuck high", health.stuck_high, Cause::LooseData),
        ("frozen", health.frozen, Cause::Frozen),
        ("shifted", health.shifted, Cause::ClockEdges),
        ("SPI errors of the sensor", health.diag_spi, unless_added(Cause::ClockEdges)),
        ("no new data", health.no_new_data, unless_added(Cause::NothingNew)),
        ("error flag in some words", health.mixed_alarm, Cause::BitErrors),
        ("implausible supply", health.implausible_supply, Cause::BitErrors),
        ("impossible rate", health.impossible_rate, Cause::BitErrors),
        ("gross errors", health.gross_errors, Cause::BitErrors),
        ("transfers failed", health.bus_errors, Cause::BoardOverrun),
        ("queue full", health.queue_full, Cause::BoardOverrun),
    ]
}

fn bursts(transcript: &Transcript) -> Vec<Check> {
    let Some(health) = transcript.health(Topic::BurstReport) else {
        let names = [("bursts", "all used"), ("data-ready edges", "none lost"), ("supply", "4.75 to 5.25 V (p. 5)")];
        return names.map(|(name, limit)| Check::not_run(name, limit)).into();
    };
    let refused = health.bursts.saturating_sub(health.used).saturating_sub(health.settling);
    let damage = damage(health);
    let mut measured = format!("{} of {} used", health.used, health.bursts);
    for (name, count, _) in damage.iter().filter(|(_, count, _)| *count > 0) {
        measured += &format!(", {name} {count}");
    }
    let first = damage.into_iter().find(|(_, count, _)| *count > 0);
    // Bursts still arrive while the report is made, so a few may be missing.
    let cause = match first {
        Some((_, _, cause)) => Some(cause),
        None if health.data_ready_masked > 0 => Some(Cause::DataReadyFloats),
        None if health.bursts == 0 => Some(Cause::NoDataReady),
        None if refused > 8 => Some(Cause::Recovered),
        None => None,
    };
    let mut checks = vec![Check::new("bursts", measured, "all used but the first 32", cause)];

    let Health { lost_edges, spurious_edges, recoveries, data_ready_masked, .. } = *health;
    let cause = if data_ready_masked > 0 {
        Some(Cause::DataReadyFloats)
    } else if lost_edges > 0 {
        Some(Cause::EdgesLost)
    } else if spurious_edges > 0 {
        Some(Cause::EdgesAdded)
    } else {
        (recoveries > 0).then_some(Cause::Recovered)
    };
    let measured = format!("{lost_edges} lost, {spurious_edges} spurious, sensor lost {recoveries} times");
    checks.push(Check::new("data-ready edges", measured, "none", cause));

    let supply = statistics(transcript, Topic::Bursts, Channel::Supply).map(|(mean, _)| mean);
    checks.push(match supply {
        None => Check::not_run("supply", "4.75 to 5.25 V (p. 5)"),
        Some(volts) => {
            let cause = match (volts * 1e3).round() as u32 {
                mv @ ..4_750 => Some(Cause::SupplyLow(mv)),
                mv @ 5_251.. => Some(Cause::SupplyHigh(mv)),
                _ => None,
            };
            Check::new("supply", format!("{volts:.3} V"), "4.75 to 5.25 V (p. 5)", cause)
        }
    });
    // The limits are three times the initial biases of 50 mg and 3 deg/s, 1 sigma (Table 1).
    let means = |channels: [Channel; 3]| -> Option<Vec<f64>> {
        channels.into_iter().map(|channel| Some(statistics(transcript, Topic::Bursts, channel)?.0)).collect()
    };
    if let (Some(rates), Some(forces)) = (means(GYROS), means(ACCELEROMETERS)) {
        let gravity = forces.iter().map(|force| force * force).sum::<f64>().sqrt();
        let cause = (!(0.85..=1.15).contains(&gravity)).then_some(Cause::Moving);
        checks.push(Check::new("acceleration", format!("{gravity:.3} g in all"), "0.85 to 1.15 g (Table 1)", cause));
        let cause = rates.iter().any(|rate| rate.abs() > 9.0).then_some(Cause::Moving);
        checks.push(Check::new("rates", format!("{} deg/s", texts(rates, 1)), "9 deg/s at most (Table 1)", cause));
    }
    checks
}

/// The bursts of a raw stream by their numbers.
fn numbered<'a>(messages: impl Iterator<Item = &'a RawMessage>) -> BTreeMap<u64, [[u8; 2]; 12]> {
    let mut bursts = BTreeMap::new();
    for raw in messages {
        let mut number = raw.first;
        for burst in &raw.bursts {
            number += u64::from(burst.periods);
            bursts.insert(number, burst.words);
        }
    }
    bursts
}

fn second_port(transcript: &Transcript) -> Check {
    let (name, limit) = ("second port", "the same bursts");
    let Some(heard) = &transcript.second_port else { return Check::not_run(name, limit) };
    let heard: &[Received] = heard;
    let (one, other) = (numbered(transcript.raw(Topic::Bursts)), numbered(raw_messages(heard.iter())));
    // The streams begin and end within a few messages of each other.
    let within = |bursts: &BTreeMap<u64, [[u8; 2]; 12]>| {
        let (first, last) = (bursts.keys().next().copied()?, bursts.keys().next_back().copied()?);
        Some((first, last))
    };
    let (Some(a), Some(b)) = (within(&one), within(&other)) else {
        return Check::new(name, "no bursts", limit, Some(Cause::PortsDiffer));
    };
    let (first, last) = (a.0.max(b.0), a.1.min(b.1));
    let differ = (first..=last).filter(|number| one.get(number) != other.get(number)).count();
    let compared = last.saturating_sub(first) + 1;
    let cause = (differ > 0 || (compared as usize) < one.len() / 2).then_some(Cause::PortsDiffer);
    Check::new(name, format!("{compared} bursts compared, {differ} differ"), limit, cause)
}
