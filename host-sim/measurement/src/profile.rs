//! Known properties of a sensor.

use allan_core::term::MovingAverageFilter;
use serde::{Deserialize, Serialize};

/// Relative standard deviation of the clock of an ordinary host: a crystal that is not trimmed, 20 ppm.
pub const HOST_CLOCK_ERROR: f64 = 20e-6;
/// Relative standard deviation of the sample rate: by the clock of a host whose crystal is good to ±100 ppm (2 σ).
pub(crate) const SAMPLE_RATE_ERROR: f64 = 5e-5;
/// Largest factor on a typical sensitivity: single parts reach 10, and none is known at √10·10.
pub(crate) const LARGEST_SENSITIVITY_MULTIPLE: f64 = 31.622_776_601_683_79;
/// Largest variance of rounded noise of 0.45 counts, halfway between two counts; larger noise is rounded as if white.
pub(crate) const DITHERED_AVAR_COUNTS2: f64 = 0.3;
/// Ratio of nominal clock to sample rate up to which both may be one clock: oscillators are off by percents.
const SAME_CLOCK: f64 = 1.1;
/// Relative distance from a whole ratio of the clocks of sensor and reader.
const WHOLE: f64 = 0.01;

/// Physical quantity that a channel measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    AngularRate,
    SpecificForce,
    MagneticField,
    Temperature,
    SupplyVoltage,
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

    /// Temperature and supply, which other channels may follow.
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
    pub quantity: Quantity,
    /// Axis, `x`, `y` or `z`; empty for a quantity without one.
    pub axis: &'static str,
    /// Unit of [`lsb`](Self::lsb), such as `deg/s`.
    pub unit: &'static str,
    /// Size of one count, in `unit`.
    pub lsb: f64,
    /// 1 σ over parts, in `unit`; `None` if unknown.
    pub initial_bias_error: Option<f64>,
    /// Largest magnitude, in `unit`; `None` if unknown.
    pub range: Option<f64>,
    pub data_sheet: DataSheetNoise,
    pub sensitivities: DataSheetSensitivities,
}

impl ChannelProfile {
    /// Name and quantity alone: counts of 1 unit, the axis by the name's end.
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

/// Typical noise by the data sheet; `None` if not stated.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DataSheetNoise {
    /// Angle or velocity random walk: the channel's unit times √s.
    pub angle_random_walk: Option<f64>,
    /// Allan deviation at the minimum, in the channel's unit.
    pub in_run_bias_stability: Option<f64>,
    /// Rate random walk: the channel's unit per √s.
    pub rate_random_walk: Option<f64>,
    /// Drawn Allan deviation by averaging time; may be empty.
    pub curve: &'static [DataSheetDeviation],
}

/// Drawn Allan deviation in the channel's unit, with ±1 σ over parts.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct DataSheetDeviation {
    /// Averaging time, s.
    pub tau_s: f64,
    pub mean: f64,
    pub low: f64,
    pub high: f64,
}

/// Magnitudes of typical sensitivities by the data sheet; `None` if not stated.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DataSheetSensitivities {
    /// To temperature, in the channel's unit per °C.
    pub temperature: Option<f64>,
    /// To the supply voltage, in the channel's unit per V.
    pub supply: Option<f64>,
    /// For a gyroscope to specific force, in the channel's unit per g.
    pub specific_force: Option<f64>,
}

impl DataSheetSensitivities {
    /// To a measured quantity.
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
    pub name: &'static str,
    /// Every output, in the order of a burst.
    pub channels: Vec<ChannelProfile>,
    /// Rate of the sensor's own sample clock, before any reduction, Hz.
    pub internal_rate_hz: f64,
    /// Rates at which the sensor can be set to sample, Hz.
    pub native_rates_hz: Vec<f64>,
    /// Possible low-pass filters of the sensor, all values read, the shortest first.
    pub filters: Vec<MovingAverageFilter>,
    /// True if a second-order low-pass may take their place.
    pub may_be_low_pass: bool,
    /// Allan variance at the shortest octaves, counts², above which rounding is white noise.
    pub dithered_avar_counts2: f64,
    /// Largest plausible factor on a data sheet's sensitivity.
    pub largest_sensitivity_multiple: f64,
    /// Relative standard deviation of the clock of the host that stamps the samples.
    pub host_clock_error: f64,
    /// Relative standard deviation of the sample rate, and so of a line's frequency.
    pub sample_rate_error: f64,
}

impl SensorProfile {
    /// Any inertial sensor: three gyroscopes, accelerometers and magnetometers, temperature, supply and ADC.
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
            // Independent of the sensor.
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

    /// The filters in samples at `rate_hz`, every value read or one in `internal_rate_hz/rate_hz`.
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

    /// Sensor values per sample of a reader at `rate_hz`; 1 unless whole to [`WHOLE`].
    #[must_use]
    pub fn read_every(&self, rate_hz: f64) -> u32 {
        let decimation = self.internal_rate_hz / rate_hz;
        let is_whole = (decimation - decimation.round()).abs() <= WHOLE * decimation;
        if is_whole { (decimation.round() as u32).max(1) } else { 1 }
    }

    /// Hz; `None` if the profile names none.
    #[must_use]
    pub fn nearest_native_rate_hz(&self, rate_hz: f64) -> Option<f64> {
        let distance = |native: &f64| (native - rate_hz).abs();
        self.native_rates_hz.iter().copied().min_by(|a, b| distance(a).total_cmp(&distance(b)))
    }
}
