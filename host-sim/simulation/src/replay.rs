//! Replay of a recording over an SPI bus to the real driver.
//!
//! Each burst of a frame log is one transaction; so is each row of a table, as the burst that the part would have sent.
//! The driver requests and decodes it as from a part. The decoded samples are the recording.

use crate::bus_timing::CapturedBusTiming;
use adis16405_driver::{Adis16405, BURST_BYTES, BURST_REQUEST, Burst, Channel, Config, GyroRange, Register};
use embedded_hal::delay::DelayNs;
use embedded_hal::spi::{Error, ErrorKind, ErrorType, Operation, SpiDevice};
use recordings::count_table;
use recordings::frame_log::Frame;
use recordings::recorded_file::FrameReader;
use recordings::recording::{MAX_SAMPLES, Recorder, Recording, TimeStamp};
use recordings::{FileBytes, InputError, Reason, SelectionError};
use std::cell::RefCell;
use std::rc::Rc;

/// A replayed recording.
#[derive(Debug)]
pub struct Replay {
    /// The samples that the driver decoded.
    pub recording: Recording,
    /// Number of transactions that were not burst reads; they are not decoded.
    pub other_transactions: u64,
    /// The times on the bus, as far as the file has them.
    pub timing: CapturedBusTiming,
}

/// Replays a table of counts, a frame log or an export of a logic analyzer; the header of `file` tells which.
///
/// # Errors
/// The file cannot be read, or a transaction differs from the one that the driver requests.
pub fn replay(file: impl Into<FileBytes>, range: GyroRange) -> Result<Replay, InputError> {
    let file = &file.into();
    match FrameReader::open(file)? {
        Some(frames) => replay_frames(file, frames, range),
        None => replay_table(file, range),
    }
}

/// Replays a table of counts: every row as the burst that the part would have sent.
fn replay_table(file: &FileBytes, range: GyroRange) -> Result<Replay, InputError> {
    let mut recorder: Option<Recorder> = None;
    let mut player = Player::new();
    let damage = count_table::for_each_row(file, range, |channels, time_stamp, counts| {
        let answer = Burst::from_counts(&counts).to_bytes();
        let burst = player.burst(&BURST_REQUEST, &answer)?;
        recorder.get_or_insert_with(|| Recorder::new(channels.to_vec(), range)).push(time_stamp, &burst);
        Ok(())
    })
    .map_err(|error| match &error.reason {
        // No option assigns columns to channels here.
        Reason::Selection(selection) if matches!(**selection, SelectionError::NoChannel(_)) => {
            let told = "no known column; expected names such as gyro_x_counts";
            InputError { reason: Reason::other(told), ..error }
        }
        _ => error,
    })?;
    let recording = recorder.map(Recorder::finish).ok_or_else(|| InputError::file(file.name(), Reason::NoData))?;
    let recording = Recording { damage, ..recording };
    Ok(Replay { recording, other_transactions: 0, timing: CapturedBusTiming::default() })
}

/// The range is `range` unless a write to SENS_AVG before the first burst selects another.
fn replay_frames(file: &FileBytes, mut frames: FrameReader, range: GyroRange) -> Result<Replay, InputError> {
    // The range that the log selected last, and the range of the bursts so far.
    let (mut selected, mut taken_in) = (range, range);
    let mut recorder = Recorder::new(Channel::ALL.to_vec(), range);
    let mut player = Player::new();
    let mut bursts = 0u64;
    let mut other_transactions = 0;
    let mut timing = CapturedBusTiming::default();
    while let Some(captured) = frames.next()? {
        timing.add(&captured, is_burst(&captured.frame));
        let frame = captured.frame;
        if is_burst(&frame) {
            if bursts == 0 {
                recorder.set_range(selected);
                taken_in = selected;
            } else if selected != taken_in {
                let (before, now) = (full_scale(taken_in), full_scale(selected));
                let reason = Reason::other(format!(
                    "the gyro range changes from {before} to {now} deg/s between bursts; give each range its own log"
                ));
                return Err(InputError::line(file.name(), frames.line(), reason));
            }
            if bursts == MAX_SAMPLES {
                return Err(InputError::line(file.name(), frames.line(), Reason::TooManySamples));
            }
            let burst = player
                .burst(&frame.mosi, &frame.miso)
                .map_err(|reason| InputError::line(file.name(), frames.line(), reason))?;
            recorder.push(TimeStamp::from_time(frame.time_s), &burst);
            bursts += 1;
        } else {
            other_transactions += 1;
            selected = range_written(&frame).unwrap_or(selected);
        }
    }
    if bursts == 0 {
        let told = "no burst transaction (26 bytes that start with 3E00)";
        return Err(InputError::file(file.name(), Reason::other(told)));
    }
    let recording = Recording { damage: frames.take_damage(bursts), ..recorder.finish() };
    Ok(Replay { recording, other_transactions, timing })
}

/// The driver on a replay bus.
struct Player {
    bus: ReplayBus,
    driver: Adis16405<ReplayBus, NoDelay>,
}

impl Player {
    fn new() -> Self {
        let bus = ReplayBus::default();
        Self { driver: Adis16405::new(bus.clone(), NoDelay, Config::default()), bus }
    }

    /// Makes the driver read one recorded transaction.
    fn burst(&mut self, mosi: &[u8], miso: &[u8]) -> Result<Burst, Reason> {
        self.bus.load(mosi, miso);
        self.driver.burst().map_err(|e| Reason::other(format!("replay over the bus: {e}")))
    }
}

/// A replay takes no time.
struct NoDelay;

impl DelayNs for NoDelay {
    fn delay_ns(&mut self, _: u32) {}
}

fn is_burst(frame: &Frame) -> bool {
    frame.mosi.len() == BURST_BYTES && frame.mosi.starts_with(&BURST_REQUEST[..2])
}

/// The range that a write to the upper byte of SENS_AVG selects; `None` for other transactions and undefined codes.
fn range_written(frame: &Frame) -> Option<GyroRange> {
    let [address, code] = frame.mosi[..] else {
        return None;
    };
    if [address, 0] != Register::SensAvg.write_high_frame(0) {
        return None;
    }
    match code & 0x07 {
        0x04 => Some(GyroRange::Dps300),
        0x02 => Some(GyroRange::Dps150),
        0x01 => Some(GyroRange::Dps75),
        _ => None,
    }
}

/// Full scale of a range, deg/s.
fn full_scale(range: GyroRange) -> u16 {
    match range {
        GyroRange::Dps300 => 300,
        GyroRange::Dps150 => 150,
        GyroRange::Dps75 => 75,
    }
}

/// An SPI bus that plays back one recorded transaction at a time. Clones are handles on the same bus.
#[derive(Debug, Clone, Default)]
struct ReplayBus(Rc<RefCell<Recorded>>);

#[derive(Debug, Default)]
struct Recorded {
    mosi: Vec<u8>,
    miso: Vec<u8>,
    played: bool,
}

/// The difference of the driver's transaction from the recorded one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ReplayError {
    /// No transaction was loaded since the last one.
    NothingLoaded,
    /// A byte from the host differs from the recorded one.
    OtherRequest {
        /// Position in the transaction, from 0.
        at: usize,
    },
    /// The transaction has more or fewer bytes than the recorded one.
    OtherLength {
        /// Bytes recorded.
        recorded: usize,
    },
}

impl Error for ReplayError {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Other
    }
}

impl ReplayBus {
    /// Loads the next transaction: the request that the host must send, and the answer.
    fn load(&self, mosi: &[u8], miso: &[u8]) {
        let mut recorded = self.0.borrow_mut();
        recorded.mosi.clear();
        recorded.mosi.extend_from_slice(mosi);
        recorded.miso.clear();
        recorded.miso.extend_from_slice(miso);
        recorded.played = false;
    }
}

impl Recorded {
    /// The answer to byte `at` of the transaction.
    fn exchange(&self, at: usize, byte: u8) -> Result<u8, ReplayError> {
        match (self.mosi.get(at), self.miso.get(at)) {
            (Some(&expected), Some(&answer)) if expected == byte => Ok(answer),
            (Some(_), Some(_)) => Err(ReplayError::OtherRequest { at }),
            _ => Err(ReplayError::OtherLength { recorded: self.mosi.len() }),
        }
    }
}

impl ErrorType for ReplayBus {
    type Error = ReplayError;
}

impl SpiDevice<u8> for ReplayBus {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), ReplayError> {
        let mut recorded = self.0.borrow_mut();
        if recorded.played || recorded.mosi.is_empty() {
            return Err(ReplayError::NothingLoaded);
        }
        recorded.played = true;
        let mut at = 0;
        for operation in operations {
            match operation {
                Operation::Read(words) => {
                    for word in words.iter_mut() {
                        *word = recorded.exchange(at, 0)?;
                        at += 1;
                    }
                }
                Operation::Write(words) => {
                    for word in words.iter() {
                        recorded.exchange(at, *word)?;
                        at += 1;
                    }
                }
                Operation::Transfer(read, write) => {
                    // The shorter side is padded, as embedded-hal requires: zeros are sent, surplus answers are
                    // dropped.
                    for i in 0..read.len().max(write.len()) {
                        let answer = recorded.exchange(at, write.get(i).copied().unwrap_or(0))?;
                        if let Some(word) = read.get_mut(i) {
                            *word = answer;
                        }
                        at += 1;
                    }
                }
                Operation::TransferInPlace(words) => {
                    for word in words.iter_mut() {
                        *word = recorded.exchange(at, *word)?;
                        at += 1;
                    }
                }
                Operation::DelayNs(_) => {}
            }
        }
        if at == recorded.mosi.len() { Ok(()) } else { Err(ReplayError::OtherLength { recorded: recorded.mosi.len() }) }
    }
}
