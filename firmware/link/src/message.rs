//! Messages from the firmware to the host.
//!
//! The order of variants and fields is the wire format. New ones are only appended; names do not matter.

use crate::text::MAX_TEXT;
use heapless::{String, Vec};
use serde::{Deserialize, Deserializer, Serialize};

/// Most averaging factors of a channel: 24 octaves from n = 8 and n = 1, 2, 4 below them.
pub const MAX_OCTAVES: usize = 28;
/// Most coefficients of a channel's baseline model.
pub const MAX_COEFFICIENTS: usize = 8;
/// Most terms that the model search adds to the baseline model of a channel.
pub const MAX_ADDED_TERMS: usize = 5;
/// Most covariates on which a channel is regressed.
pub const MAX_COVARIATES: usize = 5;
/// Most octaves for which the Allan deviation before and after compensation is sent.
pub const MAX_DEVIATIONS: usize = 12;
/// Most bursts in one raw message.
pub const MAX_RAW_BURSTS: usize = 16;

/// One message as received.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[allow(clippy::large_enum_variant, reason = "messages are received and dropped one at a time")]
pub enum Message {
    /// Device and settings; the first message of every report.
    Hello(Hello),
    /// Sums and fitted model of one channel.
    Channel(ChannelMessage),
    /// Counters of lost data by cause; the last message of every report.
    Health(Health),
    /// One line of text.
    Log(String<MAX_TEXT>),
    /// Bursts as read from the sensor; sent while the raw stream is on.
    Raw(RawMessage),
    /// Errors of a channel's model from the epoch before on the finished epoch.
    Validation(ValidationMessage),
    /// The model that a channel has learned from the finished epoch; it is validated on the next one.
    Learned(LearnedMessage),
}

/// One message to be sent, by reference: the device has no memory for a copy. Variants are those of [`Message`].
#[derive(Debug, Clone, Copy, Serialize)]
#[allow(missing_docs, reason = "documented at `Message`")]
pub enum MessageRef<'a> {
    Hello(&'a Hello),
    Channel(&'a ChannelMessage),
    Health(&'a Health),
    Log(&'a str),
    Raw(&'a RawMessage),
    Validation(&'a ValidationMessage),
    Learned(&'a LearnedMessage),
}

impl<'a> From<&'a Message> for MessageRef<'a> {
    fn from(message: &'a Message) -> Self {
        match message {
            Message::Hello(hello) => Self::Hello(hello),
            Message::Channel(channel) => Self::Channel(channel),
            Message::Health(health) => Self::Health(health),
            Message::Log(text) => Self::Log(text),
            Message::Raw(raw) => Self::Raw(raw),
            Message::Validation(validation) => Self::Validation(validation),
            Message::Learned(learned) => Self::Learned(learned),
        }
    }
}

/// Device and settings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Hello {
    /// Version of the firmware: major, minor, patch.
    pub firmware: (u8, u8, u8),
    /// The sensor's product identification register, 0x4015 for an ADIS16405; 0 before the sensor has answered.
    pub product_id: u16,
    /// Full scale of the gyroscopes in deg/s: 75, 150 or 300.
    pub gyro_full_scale: u16,
    /// Base-2 logarithm of the taps in each stage of the sensor's filter, 0 for no filter.
    pub filter_taps_log2: u8,
    /// Programmed sample rate in Hz.
    pub sample_rate_hz: f64,
    /// Sample rate in Hz, measured with the microcontroller's clock and used in this report. `None` before 64 samples: the report then uses
    /// the programmed rate.
    pub measured_rate_hz: Option<f64>,
    /// Serial clock of the sensor's bus as set in the hardware, in Hz.
    pub spi_clock_hz: u32,
    /// Time since the application started, in microseconds.
    pub uptime_us: u64,
    /// True if the sensor answers and is being sampled.
    pub sampling: bool,
    /// Number of epochs finished before this one.
    pub epoch: u32,
    /// Length of an epoch in s, 0 for an epoch without end.
    pub epoch_s: u32,
    /// How the application was started.
    pub boot: Boot,
}

/// Source of a microcontroller's clocks.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum ClockSource {
    /// The crystal of the board: within some 50 ppm.
    #[default]
    Crystal,
    /// The internal oscillator, within some percent, since the crystal did not start.
    Internal,
}

/// How the application was started.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Boot {
    /// Reason for which the microcontroller started.
    pub cause: BootCause,
    /// Starts since power-on, this one included, as counted in retained RAM.
    pub starts: u32,
    /// Channels whose statistics were restored from retained RAM.
    pub restored_channels: u8,
    /// Text of the panic or fault that ended the previous run; empty if there was none.
    pub crash_record: String<MAX_TEXT>,
    /// Source of the microcontroller's clocks, on which all times and rates of the report depend.
    pub clock: ClockSource,
    /// True if this start follows the third crash within ten minutes: no stored data are used. Appended to version 4; false for a device
    /// that does not send it.
    #[serde(deserialize_with = "default_if_absent")]
    pub safe_mode: bool,
}

/// Reason for which the microcontroller started.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum BootCause {
    /// The reset flags name no cause.
    #[default]
    Unknown,
    /// The supply came on.
    PowerOn,
    /// The supply fell below the brown-out threshold.
    BrownOut,
    /// The reset pin was low.
    Pin,
    /// The firmware restarted itself, by a command or after a panic.
    Software,
    /// The watchdog expired.
    Watchdog,
}

impl BootCause {
    /// The cause in words, after "started".
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::Unknown => "for no known reason",
            Self::PowerOn => "by power-on",
            Self::BrownOut => "by a brown-out",
            Self::Pin => "by the reset pin",
            Self::Software => "by the program",
            Self::Watchdog => "by the watchdog",
        }
    }
}

/// Exact sums of one channel and the baseline model fitted to them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ChannelMessage {
    /// Position of the channel in the burst, 1 for gyro X.
    pub channel: u8,
    /// Samples taken.
    pub samples: u64,
    /// Samples missing between them, for any reason. Time goes on through them.
    pub missing: u64,
    /// Sums of every octave, by rising averaging factor.
    pub octaves: Vec<ReportedOctave, MAX_OCTAVES>,
    /// Coefficients of the fitted baseline model; empty for temperature and supply.
    pub coefficients: Vec<ReportedCoefficient, MAX_COEFFICIENTS>,
    /// Error of the previous epoch's model on this epoch's curve; `None` without a previous model or a curve.
    pub unseen_error: Option<ReportedModelError>,
    /// Missing samples that never arrived: lost edges, failed transfers, bursts dropped because the queue was full. Counted since the epoch
    /// began or the device started.
    pub lost: u64,
    /// Missing samples that arrived and were refused in this channel, counted over the same time. [`Health`] has the
    /// causes.
    pub refused: u64,
    /// Missing samples that the curve replaces: those in gaps that its longer octaves bridge.
    pub replaced: u64,
    /// True if the channel failed its last self-test. Its samples are used: motion also fails the test.
    pub self_test_failed: bool,
}

/// Sums of one averaging factor of one channel, as exact integers.
///
/// The Allan variance in counts² is `sum / (2 · n² · count) − interpolation`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ReportedOctave {
    /// Averaging factor in samples.
    pub n: u64,
    /// Sum of the squared second differences of the running sum of counts, at distance `n`.
    pub sum: u128,
    /// Number of second differences in the sum.
    pub count: u64,
    /// Variance that replacing missing samples has added, counts².
    pub interpolation: f32,
}

/// Error of a model on a curve to which it was not fitted, over the octaves with enough data; `v` is the measured, `m` the
/// modelled Allan variance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ReportedModelError {
    /// `mean edf·(ln(m/v) + v/m − 1)`; about 1 for a true model.
    pub deviance_per_point: f64,
    /// `100·sqrt(mean (½ ln(v/m))²)`.
    pub rms_percent: f64,
}

/// A term of the noise model. Channel units are deg/s for gyros, g for accelerometers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum ReportedTerm {
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
    /// N behind a filter; shape: taps of each of its two averages, and filter steps per sample.
    Filtered,
    /// Standard deviation of first-order Gauss-Markov noise; shape: time constant in s.
    Markov,
    /// Standard deviation of noise in a narrow band; shape: frequency and bandwidth in Hz.
    Resonance,
    /// Amplitude of a sinusoid; shape: frequency in Hz.
    Sinusoid,
}

/// A fitted coefficient with its 95 % bounds, in the unit that its [`ReportedTerm`] gives.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ReportedCoefficient {
    /// Term of the model.
    pub term: ReportedTerm,
    /// Best value.
    pub value: f64,
    /// Lower 95 % bound.
    pub low: f64,
    /// Upper 95 % bound.
    pub high: f64,
}

/// The model that a channel has learned from a finished epoch.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LearnedMessage {
    /// Position of the channel in the burst.
    pub channel: u8,
    /// Number of the epoch: epochs finished before it.
    pub epoch: u32,
    /// Covariates with a significant sensitivity, subtracted from the next epoch on.
    pub regressors: Vec<ReportedRegressor, MAX_COVARIATES>,
    /// Terms that were added to N, B and K to fit the compensated stream, in the order of the search.
    pub added_terms: Vec<ReportedAddedTerm, MAX_ADDED_TERMS>,
    /// p-value of the compensated stream's residual under N, B and K alone.
    pub p_before: f64,
    /// p-value with the added terms.
    pub p_after: f64,
}

/// A covariate that is subtracted from a channel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ReportedRegressor {
    /// Position of the covariate in the burst.
    pub covariate: u8,
    /// Sensitivity, in the channel's unit over the covariate's.
    pub value: f64,
    /// Lower 95 % bound.
    pub low: f64,
    /// Upper 95 % bound.
    pub high: f64,
    /// Value of the covariate at which the correction is 0, in its unit.
    pub reference: f64,
}

/// A term that the model search has added to the baseline model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ReportedAddedTerm {
    /// Its coefficient.
    pub coefficient: ReportedCoefficient,
    /// Parameters of the term's shape, as listed at [`ReportedTerm`]; empty for terms without a shape.
    pub shape: Vec<ReportedParameter, 2>,
    /// Decrease of the deviance: the square of a number of standard deviations.
    pub score: f64,
    /// Averaging factor with the largest residual of the model without the term.
    pub n: u64,
    /// Measured over modelled deviation at `n`, less 1.
    pub excess: f64,
    /// The residual at `n` in standard deviations.
    pub sigmas: f64,
}

/// A parameter of a term's shape with its 95 % bounds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ReportedParameter {
    /// Best value.
    pub value: f64,
    /// Lower 95 % bound.
    pub low: f64,
    /// Upper 95 % bound.
    pub high: f64,
}

/// Errors and bias drift of a finished epoch, without and with the model learned from the epoch before.
///
/// The compensated stream is `y − Σ value·(covariate − reference)` over the regressors of the previous epoch's
/// [`LearnedMessage`]; without regressors it is the stream itself.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ValidationMessage {
    /// Position of the channel in the burst.
    pub channel: u8,
    /// Number of the epoch on which the model is validated: epochs finished before it.
    pub epoch: u32,
    /// Error of N, B and K on the stream itself.
    pub before: Option<ReportedModelError>,
    /// Error of the full model on the compensated stream.
    pub after: Option<ReportedModelError>,
    /// Change of the means since the epoch before; `None` if a mean does not cover all samples of its epoch, as after a
    /// restart.
    pub shift: Option<ReportedShift>,
    /// Allan deviations of both streams, by rising averaging factor.
    pub drift: Vec<ReportedDeviations, MAX_DEVIATIONS>,
}

/// Change of a stream's mean from one epoch to the next, in the channel's unit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ReportedShift {
    /// Change of the mean as sampled.
    pub raw: f64,
    /// Change of the mean of the compensated stream.
    pub compensated: f64,
}

/// Allan deviation of a stream and of the same stream compensated, over the same samples, in the channel's unit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ReportedDeviations {
    /// Averaging factor in samples.
    pub n: u64,
    /// Allan deviation as sampled.
    pub raw: f64,
    /// Allan deviation of the compensated stream.
    pub compensated: f64,
}

/// Consecutive bursts as read from the sensor.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RawMessage {
    /// Sample number of the first burst since sampling began with these settings; it rises by one every sample period,
    /// lost samples included.
    pub first: u64,
    /// Time of the first burst's data-ready edge, in microseconds since the application started.
    pub at_us: u64,
    /// Register SENS_AVG (gyro range and filter) during all of these bursts.
    pub sens_avg: u16,
    /// The bursts.
    pub bursts: Vec<RawBurst, MAX_RAW_BURSTS>,
}

/// One burst of a raw message.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct RawBurst {
    /// Microseconds since the edge of the burst before; 0 for the first of a message.
    pub after_us: u32,
    /// Sample periods since the burst before; 0 for the first of a message.
    pub periods: u32,
    /// The twelve output words, most significant byte first.
    pub words: [[u8; 2]; 12],
}

/// A counter or figure of [`Health`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Counter {
    /// The name of the field in [`Health`].
    pub name: &'static str,
    /// The value.
    pub value: u32,
    /// True if it counts events, and so does not rise without faults. Others count samples, or are load figures.
    pub counts_events: bool,
}

/// Defines [`Health`] and everything that enumerates its fields from one list.
macro_rules! health {
    ($($(#[$attribute:meta])* $kind:ident $name:ident,)*) => {
        /// Counters since the application started or the statistics were reset, and load figures. Counters saturate.
        #[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
        pub struct Health {
            $($(#[$attribute])* pub $name: u32,)*
        }

        impl Health {
            /// Number of counters and figures.
            pub const COUNTERS: usize = [$(stringify!($name)),*].len();

            /// All counters and figures, in the order of the message.
            #[must_use]
            pub fn counters(&self) -> [Counter; Self::COUNTERS] {
                [$(Counter { name: stringify!($name), value: self.$name, counts_events: health!($kind) }),*]
            }

            /// The counter with this name.
            pub fn counter_mut(&mut self, name: &str) -> Option<&mut u32> {
                match name {
                    $(stringify!($name) => Some(&mut self.$name),)*
                    _ => None,
                }
            }

            /// Adds two sets of counters, saturating. Each counter is counted in one of them: the other has 0.
            #[must_use]
            pub fn with(&self, others: &Self) -> Self {
                Self { $($name: self.$name.saturating_add(others.$name)),* }
            }
        }
    };
    (event) => { true };
    (figure) => { false };
}

health! {
    /// Bursts that arrived, usable or not.
    figure bursts,
    /// Bursts of which at least one inertial channel was used.
    figure used,
    /// Bursts with an inertial word whose new-data bit was clear.
    event no_new_data,
    /// Bursts with a word whose error bit was set; a warning, the samples are used. The `diag_` counters have the causes.
    event error_alarm,
    /// Bursts with a supply outside 4.75 V to 5.25 V; a warning, the samples are used.
    event supply,
    /// Bursts in which every bit was 0.
    event stuck_low,
    /// Bursts whose last two words were all ones.
    event stuck_high,
    /// Bursts whose bits were shifted by 1 to 15 clocks.
    event shifted,
    /// Bursts of a frozen sensor: the inertial words equal for four lengths of the filter and at least 16 bursts, or all twelve
    /// words for 512.
    event frozen,
    /// Bursts with a rate beyond the sensor's range.
    event impossible_rate,
    /// Bursts whose x rate may have lost its sign.
    event x_sign,
    /// Bursts whose inertial words equal those of the burst before.
    event repeated,
    /// Bursts whose bus transfer failed.
    event bus_errors,
    /// Bursts dropped because the queue was full.
    event queue_full,
    /// Largest number of bursts in the queue.
    figure queue_peak,
    /// Data-ready edges missing, by the time between those that came.
    event lost_edges,
    /// Data-ready edges at no multiple of the sample period.
    event spurious_edges,
    /// Bursts not used because the sensor was suspect and had not been probed yet.
    event suspect,
    /// Losses of the sensor after it had delivered samples.
    event recoveries,
    /// Raw messages dropped because the transmit queue was full.
    event raw_dropped,
    /// Received bytes lost because they came faster than they were read.
    event serial_overruns,
    /// Commands that were not understood.
    event bad_commands,
    /// Share of the time that the processor was awake, in 1/1000.
    figure awake_permille,
    /// Longest sampling interrupt in processor cycles.
    figure sampling_cycles,
    /// Longest run of the estimators in processor cycles, preemption included.
    figure estimator_cycles,
    /// Largest stack depth in bytes.
    figure stack_bytes,
    /// Size of the stack in bytes.
    figure stack_size,
    /// Used bursts of which a channel was refused.
    event partly_used,
    /// Used bursts with a warning: error bit set, or supply outside 4.75 V to 5.25 V.
    event marked,
    /// Bursts refused because their supply was below 3 V or above 6 V, at which the sensor does not run.
    event implausible_supply,
    /// Reads of DIAG_STAT because the error bit was set, at most one a second.
    event diag_reads,
    /// Reads of DIAG_STAT with bit 0: supply below 4.75 V.
    event diag_supply_low,
    /// Reads of DIAG_STAT with bit 1: supply above 5.25 V.
    event diag_supply_high,
    /// Reads of DIAG_STAT with bit 2: a flash update failed.
    event diag_flash_update,
    /// Reads of DIAG_STAT with bit 3: a frame had a wrong number of clocks.
    event diag_spi,
    /// Reads of DIAG_STAT with bit 4: a sensor was beyond its range.
    event diag_over_range,
    /// Reads of DIAG_STAT with bit 5 or one of bits 10 to 15: a self-test failed.
    event diag_self_test,
    /// Reads of DIAG_STAT with bit 6: the checksum of the flash memory is wrong.
    event diag_flash_checksum,
    /// Reads of DIAG_STAT with bit 8 or 9: an alarm was raised.
    event diag_alarm,
    /// Steps of recovery: the registers were read again and set where they differed.
    event rereads,
    /// Steps of recovery: the microcontroller's SPI was reset and the sensor probed.
    event bus_resets,
    /// Steps of recovery: the sensor was reset by its software command.
    event sensor_resets,
    /// Steps of recovery: the sensor was reset by its RST line.
    event reset_lines,
    /// Bursts not used because the sensor's filter still contained samples from before a self-test, a reset or a change of settings.
    /// Includes the 32 bursts after a start or such a change from which the gate against gross errors learns the noise.
    event settling,
    /// Times that the data-ready line was masked because it oscillated.
    event data_ready_masked,
    /// Bursts of which a channel was refused as a gross error: its step from the sample before is too large for its noise.
    event gross_errors,
    /// Messages and text lines not copied to the USB port because the host did not read it.
    event usb_dropped,
    /// Bursts refused because the error flag was set in some words and clear in others, which no sensor sends. Appended to version 4; 0 for
    /// a device that does not send it.
    #[serde(deserialize_with = "default_if_absent")]
    event mixed_alarm,
}

/// Deserialises a last field that the sender may not know. The frame's checksum is right, so a failure means that it is
/// absent.
fn default_if_absent<'de, T: Deserialize<'de> + Default, D: Deserializer<'de>>(deserializer: D) -> Result<T, D::Error> {
    Ok(T::deserialize(deserializer).unwrap_or_default())
}
