//! What is known of a sensor before it is measured.

use allan_core::term::MovingAverageFilter;

/// Physical quantity that a channel measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Angular rate about an axis: a gyroscope.
    AngularRate,
    /// Specific force along an axis: an accelerometer.
    SpecificForce,
    /// Magnetic field along an axis.
    MagneticField,
    /// Temperature of the sensor.
    Temperature,
    /// Supply voltage.
    SupplyVoltage,
    /// Voltage at an auxiliary input.
    AuxiliaryVoltage,
}

impl Quantity {
    /// Gyroscopes and accelerometers.
    #[must_use]
    pub fn is_inertial(self) -> bool {
        matches!(self, Self::AngularRate | Self::SpecificForce)
    }

    /// Temperature and supply: conditions that move slowly and that other channels may follow.
    #[must_use]
    pub fn is_environment(self) -> bool {
        matches!(self, Self::Temperature | Self::SupplyVoltage)
    }
}

/// One output of a sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChannelProfile {
    /// Name in reports and file headers, such as `gyro_x`.
    pub name: &'static str,
    /// What it measures.
    pub quantity: Quantity,
    /// Axis, `x`, `y` or `z`; empty for a quantity without one.
    pub axis: &'static str,
    /// Unit of [`lsb`](Self::lsb), such as `deg/s`.
    pub unit: &'static str,
    /// Size of one count, in `unit`.
    pub lsb: f64,
    /// Initial bias error (1 σ over parts), in `unit`: the distance by which the biases of two parts differ. `None` where
    /// it is not known.
    pub initial_bias_error: Option<f64>,
    /// Largest magnitude that the channel can measure, in `unit`; `None` where it is not known.
    pub range: Option<f64>,
    /// Noise by the data sheet.
    pub data_sheet: DataSheetNoise,
    /// Sensitivities by the data sheet.
    pub sensitivities: DataSheetSensitivities,
}

/// Typical noise of a channel by its data sheet; `None` where it says nothing.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DataSheetNoise {
    /// Angle or velocity random walk: the channel's unit times √s.
    pub angle_random_walk: Option<f64>,
    /// In-run bias stability: the Allan deviation at the minimum of its curve, in the channel's unit.
    pub in_run_bias_stability: Option<f64>,
    /// Rate random walk: the channel's unit per √s.
    pub rate_random_walk: Option<f64>,
}

/// Typical sensitivities of the bias of a channel by its data sheet, magnitudes; `None` where it says nothing.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DataSheetSensitivities {
    /// To temperature, in the channel's unit per °C.
    pub temperature: Option<f64>,
    /// To the supply voltage, in the channel's unit per V.
    pub supply: Option<f64>,
    /// Of a gyroscope to specific force, in the channel's unit per g.
    pub specific_force: Option<f64>,
}

/// A sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorProfile {
    /// Name of the part.
    pub name: &'static str,
    /// Every output, in the order of a burst.
    pub channels: Vec<ChannelProfile>,
    /// Rate of the sensor's own sample clock, before any reduction, Hz.
    pub internal_rate_hz: f64,
    /// Rates at which the sensor can be set to sample, Hz.
    pub native_rates_hz: Vec<f64>,
    /// Low-pass filters that the sensor may have put before its samples, for the trace to try, the simplest first.
    pub filters: Vec<MovingAverageFilter>,
    /// Allan variance of a channel at the shortest octaves, in counts², above which rounding to counts adds white noise and
    /// nothing else.
    pub dithered_avar_counts2: f64,
    /// Relative standard deviation of the clock of the host that stamps the samples.
    pub host_clock_error: f64,
    /// Relative standard deviation of the sample rate as the analysis is given it: the error of a line's frequency.
    pub sample_rate_error: f64,
}

impl SensorProfile {
    /// The channel named `name`.
    #[must_use]
    pub fn channel(&self, name: &str) -> Option<ChannelProfile> {
        self.channels.iter().copied().find(|channel| channel.name == name)
    }

    /// The native rate that is nearest to `rate_hz`, Hz; `None` where the profile names none.
    #[must_use]
    pub fn nearest_native_rate_hz(&self, rate_hz: f64) -> Option<f64> {
        let distance = |native: &f64| (native - rate_hz).abs();
        self.native_rates_hz.iter().copied().min_by(|a, b| distance(a).total_cmp(&distance(b)))
    }
}
