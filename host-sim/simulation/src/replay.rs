//! A recording back through the emulated bus and the real driver.
//!
//! What a file holds is turned into burst transactions. The driver asks for each as it would ask a part, and what it
//! decodes becomes the recording.

mod bus;

pub use bus::{ReplayBus, ReplayError};

use adis16405_driver::{Adis16405, BURST_BYTES, BURST_REQUEST, Burst, Channel, Config, GyroRange, Register};
use recordings::csv::Rows;
use recordings::frame_log::{Frame, Frames};
use recordings::recording::{Clock, Recorder, Recording};
use recordings::{InputError, Reason};
use std::path::Path;

/// A replayed recording and what else was on the bus.
#[derive(Debug)]
pub struct Replay {
    /// As the driver read it.
    pub recording: Recording,
    /// Transactions that were no bursts; they are not decoded.
    pub other_transactions: u64,
}

/// Replays a table of counts or a frame log; which of them `file` is, its header says.
///
/// # Errors
/// The file cannot be read, or the driver meets a transaction that it did not ask for.
pub fn replay(file: &Path, range: GyroRange) -> Result<Replay, InputError> {
    if recordings::is_frame_log(file)? { replay_log(file, range) } else { replay_table(file, range) }
}

/// Replays a table: every row as the burst in which the part would have sent it.
///
/// # Errors
/// As [`replay`].
pub fn replay_table(file: &Path, range: GyroRange) -> Result<Replay, InputError> {
    let mut rows = Rows::open(file)?;
    let mut recorder = Recorder::new(rows.channels(), range);
    let mut player = Player::new();
    while let Some(row) = rows.next()? {
        let answer = Burst::from_counts(&row.counts).to_bytes();
        let burst =
            player.burst(&BURST_REQUEST, &answer).map_err(|reason| InputError::line(file, rows.line(), reason))?;
        recorder.push(row.clock, &burst);
    }
    Ok(Replay { recording: recorder.finish(), other_transactions: 0 })
}

/// Replays a frame log. A write of the range to SENS_AVG in the log sets the range from there on, else it is `range`.
///
/// # Errors
/// As [`replay`].
pub fn replay_log(file: &Path, range: GyroRange) -> Result<Replay, InputError> {
    let mut frames = Frames::open(file)?;
    let mut recorder = Recorder::new(Channel::ALL.to_vec(), range);
    let mut player = Player::new();
    let mut bursts = 0u64;
    let mut other_transactions = 0;
    while let Some(frame) = frames.next()? {
        if is_burst(&frame) {
            let burst = player
                .burst(&frame.mosi, &frame.miso)
                .map_err(|reason| InputError::line(file, frames.line(), reason))?;
            recorder.push(Clock::at(frame.time_s), &burst);
            bursts += 1;
        } else {
            other_transactions += 1;
            if let Some(range) = range_written(&frame) {
                recorder.set_range(range);
            }
        }
    }
    if bursts == 0 {
        return Err(InputError::file(file, Reason::NoBurst));
    }
    Ok(Replay { recording: recorder.finish(), other_transactions })
}

/// The driver on a bus that plays back.
struct Player {
    bus: ReplayBus,
    driver: Adis16405<ReplayBus>,
}

impl Player {
    fn new() -> Self {
        let bus = ReplayBus::default();
        Self { driver: Adis16405::new(bus.clone(), Config::default()), bus }
    }

    /// Plays one transaction and has the driver read it.
    fn burst(&mut self, mosi: &[u8], miso: &[u8]) -> Result<Burst, Reason> {
        self.bus.load(mosi, miso);
        self.driver.burst().map_err(|e| Reason::Bus(e.to_string()))
    }
}

fn is_burst(frame: &Frame) -> bool {
    frame.mosi.len() == BURST_BYTES && frame.mosi.starts_with(&BURST_REQUEST[..2])
}

/// The range that a write to the upper byte of SENS_AVG selects; undefined codes change nothing.
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
