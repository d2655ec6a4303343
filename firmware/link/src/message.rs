//! What the firmware has to say.

use heapless::{String, Vec};
use serde::{Deserialize, Serialize};

/// Most points of a curve: 24 octaves from n = 8 and n = 1, 2, 4 below them.
pub const MAX_POINTS: usize = 28;
/// Most coefficients of a model.
pub const MAX_COEFFICIENTS: usize = 8;
/// Most terms beyond the declared ones that are traced in a channel.
pub const MAX_EFFECTS: usize = 5;
/// Most covariates that a channel can follow.
pub const MAX_CAUSES: usize = 5;
/// Most octaves at which the drift before and after compensation is told.
pub const MAX_DRIFTS: usize = 12;
/// Longest log line in bytes.
pub const MAX_TEXT: usize = 120;
/// Most bursts in one message of the raw stream.
pub const MAX_RAW: usize = 16;

/// One message, as it is received. Variants are only ever appended: their position is their number on the wire.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[allow(clippy::large_enum_variant, reason = "messages are received and dropped one at a time")]
pub enum Message {
    /// Who speaks and with which settings; the first message of every report.
    Hello(Hello),
    /// What one channel has shown so far.
    Channel(ChannelReport),
    /// What was lost and why; the last message of every report.
    Health(Health),
    /// One line for a person.
    Log(String<MAX_TEXT>),
    /// Bursts as they came off the bus, while a recording is asked for.
    Raw(Raw),
    /// What an epoch says to what was learnt of a channel in the epoch before.
    Checked(Checked),
    /// What an epoch has taught of a channel, for the one after it.
    Learnt(Learnt),
}

/// One message, as it is sent: from where its content is, on a device that has no room for a copy. Variants as in [`Message`].
#[derive(Debug, Clone, Copy, Serialize)]
#[allow(missing_docs, reason = "those of `Message`")]
pub enum MessageRef<'a> {
    Hello(&'a Hello),
    Channel(&'a ChannelReport),
    Health(&'a Health),
    Log(&'a str),
    Raw(&'a Raw),
    Checked(&'a Checked),
    Learnt(&'a Learnt),
}

impl<'a> From<&'a Message> for MessageRef<'a> {
    fn from(message: &'a Message) -> Self {
        match message {
            Message::Hello(hello) => Self::Hello(hello),
            Message::Channel(report) => Self::Channel(report),
            Message::Health(health) => Self::Health(health),
            Message::Log(text) => Self::Log(text),
            Message::Raw(raw) => Self::Raw(raw),
            Message::Checked(checked) => Self::Checked(checked),
            Message::Learnt(learnt) => Self::Learnt(learnt),
        }
    }
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
    /// Sample rate in Hz measured against the microcontroller's clock; `None` until two samples have come.
    pub measured_rate_hz: Option<f64>,
    /// Serial clock of the sensor's bus that was really set, in Hz.
    pub spi_clock_hz: u32,
    /// Time since the application started, in microseconds.
    pub uptime_us: u64,
    /// Whether the sensor answers and is being sampled.
    pub sampling: bool,
    /// Epochs finished before this one.
    pub epoch: u32,
    /// Length of an epoch in s, 0 for one that never ends.
    pub epoch_s: u32,
    /// How the application came to start.
    pub boot: Boot,
}

/// How the application came to start.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Boot {
    /// Why the microcontroller started.
    pub cause: BootCause,
    /// Starts since the supply came on, this one included, as far as the retained memory tells.
    pub starts: u32,
    /// Channels whose statistics were carried over from before the start.
    pub kept_channels: u8,
    /// What the panic or fault before this start left; empty if there was none.
    pub last_words: String<MAX_TEXT>,
}

/// Why the microcontroller started. Variants are only ever appended.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum BootCause {
    /// Nothing that the reset flags tell.
    #[default]
    Unknown,
    /// The supply came on.
    PowerOn,
    /// The supply dipped below the brown-out threshold.
    BrownOut,
    /// The reset pin.
    Pin,
    /// The firmware itself: a command, or a panic.
    Software,
    /// The watchdog.
    Watchdog,
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
    /// The fitted model; none for the covariates.
    pub coefficients: Vec<Coefficient, MAX_COEFFICIENTS>,
    /// How wrong the model of the epoch before is on this epoch's curve; `None` without either.
    pub unseen: Option<ModelError>,
}

/// How wrong a model is on a curve that it was not fitted to.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ModelError {
    /// `mean edf·(ln(m/v) + v/m − 1)` over the octaves with enough data; about 1 for a true model.
    pub deviance_per_point: f64,
    /// `100·sqrt(mean (½ ln(v/m))²)`.
    pub rms_percent: f64,
}

/// Errors and bias drift over an epoch, before and after what the epoch before had taught of the channel.
///
/// The compensated stream is `y − Σ value·(covariate − reference)` over the causes that were [`Learnt`] one epoch earlier; it
/// is the stream itself if there were none.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Checked {
    /// Position of the channel in the burst.
    pub channel: u8,
    /// The epoch that was not seen before: so many were finished before it.
    pub epoch: u32,
    /// N, B and K on the stream itself.
    pub before: Option<ModelError>,
    /// The traced model on the compensated stream.
    pub after: Option<ModelError>,
    /// By how much the means moved since the epoch before; `None` if they are not known of all samples, as after a restart.
    pub shift: Option<Shift>,
    /// Allan deviations of both streams, by rising averaging factor.
    pub drift: Vec<Drift, MAX_DRIFTS>,
}

/// By how much the mean of a stream moved from one epoch to the next, in the channel's unit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Shift {
    /// Of the stream.
    pub raw: f64,
    /// Of the compensated stream.
    pub compensated: f64,
}

/// Allan deviation of a stream and of the same stream compensated, over the same samples.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Drift {
    /// Averaging factor in samples.
    pub n: u64,
    /// Of the stream, in the channel's unit.
    pub raw: f64,
    /// Of the compensated stream.
    pub compensated: f64,
}

/// What an epoch has taught of a channel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Learnt {
    /// Position of the channel in the burst.
    pub channel: u8,
    /// The epoch that taught it: so many were finished before it.
    pub epoch: u32,
    /// What the channel follows beyond doubt, to be subtracted from now on; empty: nothing is.
    pub causes: Vec<Cause, MAX_CAUSES>,
    /// The terms that N, B and K lack in the compensated stream, in the order in which they were found; empty: nothing is
    /// missing.
    pub effects: Vec<Effect, MAX_EFFECTS>,
    /// Probability of a residual as large under N, B and K if they were all there is in the compensated stream.
    pub p_before: f64,
    /// The same with the effects.
    pub p_after: f64,
}

/// A covariate that a channel follows.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Cause {
    /// Position of the covariate in the burst.
    pub covariate: u8,
    /// Sensitivity in the channel's unit over the covariate's.
    pub value: f64,
    /// Lower 95 % bound.
    pub low: f64,
    /// Upper 95 % bound.
    pub high: f64,
    /// Value of the covariate at which nothing is subtracted, in its unit.
    pub reference: f64,
}

/// A term that the declared model lacks.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Effect {
    /// Its coefficient.
    pub coefficient: Coefficient,
    /// Its shape, as the [`Term`] says; empty for those that have none.
    pub shape: Vec<Bounded, 2>,
    /// How much it explains: the square of a number of standard deviations.
    pub score: f64,
    /// Averaging factor at which the model without it was furthest off.
    pub n: u64,
    /// Measured over modelled deviation there, less 1.
    pub excess: f64,
    /// The same in standard deviations.
    pub sigmas: f64,
}

/// A parameter of a shape with its 95 % bounds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Bounded {
    /// Best value.
    pub value: f64,
    /// Lower 95 % bound.
    pub low: f64,
    /// Upper 95 % bound.
    pub high: f64,
}

/// Bursts in a row, as they came off the bus.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Raw {
    /// Number of the first burst's sample since sampling began with these settings; grows by one a sample period, by more
    /// across a gap.
    pub first: u64,
    /// Time of its data-ready edge, in microseconds since the application started.
    pub at_us: u64,
    /// Register SENS_AVG that holds for all of them: range and filter.
    pub sens_avg: u16,
    /// The bursts.
    pub bursts: Vec<RawBurst, MAX_RAW>,
}

/// One burst of the raw stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct RawBurst {
    /// Microseconds since the edge of the burst before; 0 for the first of a message.
    pub after_us: u32,
    /// Sample periods since the burst before; 0 for the first of a message.
    pub periods: u32,
    /// The twelve output words, most significant byte first.
    pub words: [[u8; 2]; 12],
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
    /// Q, in channel units times a second.
    Quantization,
    /// R, in channel units per second.
    RateRamp,
    /// N behind a filter; shape: taps of each of its two averages, and how many of its steps a sample is.
    Filtered,
    /// Standard deviation of correlated noise; shape: time constant in s.
    Markov,
    /// Standard deviation of noise in a narrow band; shape: frequency and bandwidth in Hz.
    Resonance,
    /// Amplitude of a line; shape: frequency in Hz.
    Sinusoid,
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

/// What was lost and why, since the application started or the statistics were reset. Every count stops at its largest
/// value.
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
    /// Bursts that were good but for a clock that was lost or counted twice.
    pub shifted: u32,
    /// Bursts whose twelve words had not changed for hundreds of samples.
    pub frozen: u32,
    /// Bursts with a rate beyond what the sensor can measure.
    pub impossible_rate: u32,
    /// Bursts whose x rate may have lost its sign.
    pub x_sign: u32,
    /// Bursts whose inertial words equal those of the burst before.
    pub repeated: u32,
    /// Bursts that the bus refused.
    pub bus_errors: u32,
    /// Bursts dropped because the queue was full.
    pub queue_full: u32,
    /// Most bursts that ever waited in the queue.
    pub queue_peak: u32,
    /// Data-ready edges that never came, by the time between those that did.
    pub lost_edges: u32,
    /// Data-ready edges that came out of step.
    pub stray_edges: u32,
    /// Bursts not used because the sensor had been silent or out of step and was not yet checked.
    pub unchecked: u32,
    /// How often the sensor was lost and sought again.
    pub recoveries: u32,
    /// Messages of the raw stream that found no room on the line.
    pub raw_dropped: u32,
    /// Bytes lost because they came faster than they were read.
    pub serial_overruns: u32,
    /// Commands that were not understood.
    pub bad_commands: u32,
    /// Part of the time that the processor was awake, in 1/1000.
    pub awake_permille: u32,
    /// Longest sampling interrupt in processor cycles.
    pub sampling_cycles: u32,
    /// Longest turn of the estimators in processor cycles, interruptions included.
    pub estimator_cycles: u32,
    /// Most bytes of stack ever used.
    pub stack_bytes: u32,
    /// Bytes of stack that there are.
    pub stack_size: u32,
}
