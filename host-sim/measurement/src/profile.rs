//! The description of a sensor before it is measured.

use allan_core::term::MovingAverageFilter;
use serde::{Deserialize, Serialize};

/// Relative standard deviation of the clock of an ordinary host: a crystal that is not trimmed, 20 ppm.
pub const HOST_CLOCK_ERROR: f64 = 20e-6;
/// Relative standard deviation of the sample rate: by the clock of a host whose crystal is good to ±100 ppm (2 σ).
pub(crate) const SAMPLE_RATE_ERROR: f64 = 5e-5;
/// The data sheet states what is typical; single parts, and their mounting, are up to ten times worse. Half an order of
/// magnitude beyond that, √10·10, no such part is known.
pub(crate) const LARGEST_SENSITIVITY_MULTIPLE: f64 = 31.622_776_601_683_79;
/// The largest variance that rounding makes of noise of 0.45 counts: that of a mean halfway between two counts, by the normal
/// distribution (0.27 of a mean at a count). Larger noise rounds like white noise of a twelfth of a count², to 3 % of its deviation,
/// wherever its mean is. A fourth is no limit: halfway between two counts the smallest noise has it.
pub(crate) const DITHERED_AVAR_COUNTS2: f64 = 0.3;
/// Ratio of the sensor's nominal clock to a sample rate up to which both may be the same clock: a crystal-less oscillator is
/// off by some percent.
const SAME_CLOCK: f64 = 1.1;
/// Relative distance from a whole number up to which the clocks of sensor and reader may differ.
const WHOLE: f64 = 0.01;

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
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::AngularRate,
        Self::SpecificForce,
        Self::MagneticField,
        Self::Temperature,
        Self::SupplyVoltage,
        Self::AuxiliaryVoltage,
    ];

    /// Name in profile files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::AngularRate => "angular_rate",
            Self::SpecificForce => "specific_force",
            Self::MagneticField => "magnetic_field",
            Self::Temperature => "temperature",
            Self::SupplyVoltage => "supply_voltage",
            Self::AuxiliaryVoltage => "auxiliary_voltage",
        }
    }

    /// The unit in which it is analysed.
    #[must_use]
    pub fn unit(self) -> &'static str {
        match self {
            Self::AngularRate => "deg/s",
            Self::SpecificForce => "g",
            Self::MagneticField => "gauss",
            Self::Temperature => "degC",
            Self::SupplyVoltage | Self::AuxiliaryVoltage => "V",
        }
    }

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
    /// The measured quantity.
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

impl ChannelProfile {
    /// A channel of which nothing is known but its name and quantity: counts of 1 unit, the axis by the end of the name.
    #[must_use]
    pub fn generic(name: &'static str, quantity: Quantity) -> Self {
        let axis = ["x", "y", "z"].into_iter().find(|axis| name.rsplit('_').next() == Some(axis));
        Self {
            name,
            quantity,
            axis: axis.unwrap_or(""),
            unit: quantity.unit(),
            lsb: 1.0,
            initial_bias_error: None,
            range: None,
            data_sheet: DataSheetNoise::default(),
            sensitivities: DataSheetSensitivities::default(),
        }
    }
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
    /// The drawn curve of the Allan deviation, by averaging time; empty where there is none.
    pub curve: &'static [DataSheetDeviation],
}

/// Allan deviation of a channel in the figure of a data sheet, in the channel's unit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct DataSheetDeviation {
    /// Averaging time, s.
    pub tau_s: f64,
    /// Mean over parts.
    pub mean: f64,
    /// Mean less the standard deviation over parts.
    pub low: f64,
    /// Mean plus the standard deviation over parts.
    pub high: f64,
}

/// Typical sensitivities of the bias of a channel by its data sheet, magnitudes; `None` where it says nothing.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DataSheetSensitivities {
    /// To temperature, in the channel's unit per °C.
    pub temperature: Option<f64>,
    /// To the supply voltage, in the channel's unit per V.
    pub supply: Option<f64>,
    /// Sensitivity of a gyroscope to specific force, in the channel's unit per g.
    pub specific_force: Option<f64>,
}

impl DataSheetSensitivities {
    /// To a quantity that was measured beside the channel.
    #[must_use]
    pub fn to(&self, quantity: Quantity) -> Option<f64> {
        match quantity {
            Quantity::Temperature => self.temperature,
            Quantity::SupplyVoltage => self.supply,
            Quantity::SpecificForce => self.specific_force,
            _ => None,
        }
    }
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
    /// Low-pass filters that the sensor may have put before its samples, every value of which is read, the shortest first.
    pub filters: Vec<MovingAverageFilter>,
    /// True if a low-pass filter of the second order may be in their place, in the part or in what reads it.
    pub may_be_low_pass: bool,
    /// Allan variance of a channel at the shortest octaves, in counts², above which rounding to counts adds white noise and
    /// nothing else.
    pub dithered_avar_counts2: f64,
    /// Largest plausible multiple of a sensitivity of the data sheet: a larger one is no sensitivity of the sensor.
    pub largest_sensitivity_multiple: f64,
    /// Relative standard deviation of the clock of the host that stamps the samples.
    pub host_clock_error: f64,
    /// Relative standard deviation of the sample rate as the analysis is given it: the error of a line's frequency.
    pub sample_rate_error: f64,
}

impl SensorProfile {
    /// Any inertial sensor, of which no data sheet is known: three gyroscopes, accelerometers and magnetometers, temperature,
    /// supply and an auxiliary voltage.
    ///
    /// The trace tries moving averages and Bartlett windows of 2 to 64 taps a stage at the rate of the samples, and no native
    /// rate is known.
    #[must_use]
    pub fn generic() -> Self {
        const CHANNELS: [(&str, Quantity); 12] = [
            ("gyro_x", Quantity::AngularRate),
            ("gyro_y", Quantity::AngularRate),
            ("gyro_z", Quantity::AngularRate),
            ("accl_x", Quantity::SpecificForce),
            ("accl_y", Quantity::SpecificForce),
            ("accl_z", Quantity::SpecificForce),
            ("magn_x", Quantity::MagneticField),
            ("magn_y", Quantity::MagneticField),
            ("magn_z", Quantity::MagneticField),
            ("temp", Quantity::Temperature),
            ("supply", Quantity::SupplyVoltage),
            ("aux_adc", Quantity::AuxiliaryVoltage),
        ];
        let taps = || (1..=6).map(|taps_log2| 1 << taps_log2);
        let moving_average = |taps| MovingAverageFilter { stages: 1, taps, decimation: 1.0 };
        Self {
            name: "generic",
            channels: CHANNELS.map(|(name, quantity)| ChannelProfile::generic(name, quantity)).to_vec(),
            internal_rate_hz: 0.0,
            native_rates_hz: Vec::new(),
            filters: taps().map(moving_average).chain(taps().map(MovingAverageFilter::bartlett)).collect(),
            may_be_low_pass: true,
            // Rounding is white where the noise reaches from one count to the next, whatever the part.
            dithered_avar_counts2: DITHERED_AVAR_COUNTS2,
            largest_sensitivity_multiple: LARGEST_SENSITIVITY_MULTIPLE,
            host_clock_error: HOST_CLOCK_ERROR,
            sample_rate_error: SAMPLE_RATE_ERROR,
        }
    }

    /// The channel named `name`.
    #[must_use]
    pub fn channel(&self, name: &str) -> Option<ChannelProfile> {
        self.channels.iter().copied().find(|channel| channel.name == name)
    }

    /// The filters as they appear in samples at `rate_hz`: each with every value read, and, where the sensor's own clock is
    /// faster than the reader, each that is longer than the sample period read once in `internal_rate_hz/rate_hz` values. That
    /// decimation is the start of a search: neither clock is known exactly.
    #[must_use]
    pub fn filters_read_at(&self, rate_hz: f64) -> Vec<MovingAverageFilter> {
        let decimation = self.internal_rate_hz / rate_hz;
        let is_correlated = |filter: &&MovingAverageFilter| {
            decimation > SAME_CLOCK && f64::from(filter.stages) * f64::from(filter.taps) > decimation
        };
        let slow = self.filters.iter().filter(is_correlated);
        let slow = slow.map(|filter| MovingAverageFilter { decimation, ..*filter });
        self.filters.iter().copied().chain(slow).collect()
    }

    /// Values of the sensor's clock from one sample to the next where a reader at `rate_hz` takes each so many-th; 1 where that is no
    /// whole number to [`WHOLE`].
    #[must_use]
    pub fn read_every(&self, rate_hz: f64) -> u32 {
        let decimation = self.internal_rate_hz / rate_hz;
        let is_whole = (decimation - decimation.round()).abs() <= WHOLE * decimation;
        if is_whole { (decimation.round() as u32).max(1) } else { 1 }
    }

    /// The native rate that is nearest to `rate_hz`, Hz; `None` where the profile names none.
    #[must_use]
    pub fn nearest_native_rate_hz(&self, rate_hz: f64) -> Option<f64> {
        let distance = |native: &f64| (native - rate_hz).abs();
        self.native_rates_hz.iter().copied().min_by(|a, b| distance(a).total_cmp(&distance(b)))
    }
}
