//! What the firmware has to say.

use heapless::{String, Vec};
use serde::{Deserialize, Serialize};

/// Most points of a curve: 24 octaves from n = 8 and n = 1, 2, 4 below them.
pub const MAX_POINTS: usize = 28;
/// Most coefficients of a model.
pub const MAX_COEFFICIENTS: usize = 8;
/// Longest log line in bytes.
pub const MAX_TEXT: usize = 120;

/// One message. Variants are only ever appended: their position is their number on the wire.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[allow(clippy::large_enum_variant, reason = "messages are built, sent and dropped one at a time")]
pub enum Message {
    /// Who speaks and with which settings; the first message of every report.
    Hello(Hello),
    /// What one channel has shown so far.
    Channel(ChannelReport),
    /// What was lost and why; the last message of every report.
    Health(Health),
    /// One line for a person.
    Log(String<MAX_TEXT>),
}

/// Who speaks and with which settings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Hello {
    /// Version of the firmware: major, minor, patch.
    pub firmware: (u8, u8, u8),
    /// The sensor's product identification register, 0x4015 for an ADIS16405.
    pub product_id: u16,
    /// Full scale of the gyroscopes in deg/s: 75, 150 or 300.
    pub gyro_full_scale: u16,
    /// Base-2 logarithm of the taps in each stage of the sensor's filter, 0 for none.
    pub filter_taps_log2: u8,
    /// Programmed sample rate in Hz.
    pub sample_rate_hz: f64,
    /// Serial clock of the sensor's bus that was really set, in Hz.
    pub spi_clock_hz: u32,
    /// Time since the application started, in microseconds.
    pub uptime_us: u64,
}

/// What one channel has shown so far: exact sums, and the model fitted to them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ChannelReport {
    /// Position of the channel in the burst, 1 for gyro X.
    pub channel: u8,
    /// Samples that entered the estimator.
    pub samples: u64,
    /// Samples known to be missing among them.
    pub missing: u64,
    /// The curve, by rising averaging factor.
    pub points: Vec<Point, MAX_POINTS>,
    /// The fitted model.
    pub coefficients: Vec<Coefficient, MAX_COEFFICIENTS>,
}

/// One averaging factor of a curve, as exact integers.
///
/// The Allan variance in counts² is `sum / (2 · n² · count)`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Point {
    /// Averaging factor in samples.
    pub n: u64,
    /// Sum of the squared second differences of the running sum of counts, at distance `n`.
    pub sum: u128,
    /// How many second differences were summed.
    pub count: u64,
}

/// A term of the noise model. Variants are only ever appended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Term {
    /// N, in channel units times the square root of a second (deg/s·√s, which is deg/√s).
    AngleRandomWalk,
    /// B, in channel units.
    BiasInstability,
    /// K, in channel units per square root of a second.
    RateRandomWalk,
}

/// One fitted coefficient with its 95 % bounds, in physical units.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Coefficient {
    /// Which term of the model.
    pub term: Term,
    /// Best value.
    pub value: f64,
    /// Lower 95 % bound.
    pub low: f64,
    /// Upper 95 % bound.
    pub high: f64,
}

/// What was lost and why, since the application started. Every count stops at its largest value.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Health {
    /// Bursts that arrived, usable or not.
    pub bursts: u32,
    /// Bursts that were used.
    pub used: u32,
    /// Bursts with a word whose new-data bit was clear.
    pub no_new_data: u32,
    /// Bursts with a word whose error bit was set.
    pub error_alarm: u32,
    /// Bursts with a supply outside 4.75 V to 5.25 V.
    pub supply: u32,
    /// Bursts of nothing but zeros.
    pub stuck_low: u32,
    /// Bursts of nothing but ones.
    pub stuck_high: u32,
    /// Bursts whose inertial words equal those of the burst before.
    pub repeated: u32,
    /// Bursts that the bus refused.
    pub bus_errors: u32,
    /// Bursts dropped because the queue was full.
    pub queue_full: u32,
    /// Most bursts that ever waited in the queue.
    pub queue_peak: u32,
}
