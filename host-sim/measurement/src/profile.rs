//! Known properties of a sensor.

use allan_core::term::MovingAverageFilter;
use serde::{Deserialize, Serialize};

/// Relative standard deviation of the clock of an ordinary host: 20 ppm, as of an untrimmed crystal.
pub const HOST_CLOCK_ERROR: f64 = 20e-6;
/// Relative standard deviation of the sample rate, by the clock of a host whose crystal is within ±100 ppm (2 σ).
pub(crate) const SAMPLE_RATE_ERROR: f64 = 5e-5;
/// Largest factor on a typical sensitivity: single parts reach 10, and none is known to reach √10·10.
pub(crate) const LARGEST_SENSITIVITY_MULTIPLE: f64 = 31.622_776_601_683_79;
/// Largest Allan variance of rounded noise of 0.45 counts, with its mean halfway between two counts. The rounding of
/// larger noise is white.
pub(crate) const DITHERED_AVAR_COUNTS2: f64 = 0.3;
/// Ratio of nominal clock to sample rate up to which both may be one clock, since oscillators have errors of some
/// percent.
const SAME_CLOCK: f64 = 1.1;
/// Largest relative deviation of the clocks of sensor and reader from an integer ratio.
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
    /// All quantities.
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

    /// The unit in which the quantity is analysed.
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

    /// True for angular rate and specific force.
    #[must_use]
    pub fn is_inertial(self) -> bool {
        matches!(self, Self::AngularRate | Self::SpecificForce)
    }

    /// True for temperature and supply, on which other channels may depend.
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
    /// Initial bias error, 1 σ over parts, in `unit`; `None` if unknown.
    pub initial_bias_error: Option<f64>,
    /// Largest magnitude, in `unit`; `None` if unknown.
    pub range: Option<f64>,
    pub data_sheet: DataSheetNoise,
    pub sensitivities: DataSheetSensitivities,
}

impl ChannelProfile {
    /// A channel with only a name and a quantity: counts of 1 unit, the axis by the end of the name.
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
    /// Sensitivity to temperature, in the channel's unit per °C.
    pub temperature: Option<f64>,
    /// Sensitivity to the supply voltage, in the channel's unit per V.
    pub supply: Option<f64>,
    /// Sensitivity of a gyroscope to specific force, in the channel's unit per g.
    pub specific_force: Option<f64>,
}

impl DataSheetSensitivities {
    /// Sensitivity to a measured quantity.
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
    /// True if a second-order low-pass may replace these filters.
    pub may_be_low_pass: bool,
    /// Allan variance at the shortest octaves, counts², above which the rounding is white noise.
    pub dithered_avar_counts2: f64,
    /// Largest plausible factor on a data sheet's sensitivity.
    pub largest_sensitivity_multiple: f64,
    /// Relative standard deviation of the clock of the host that stamps the samples.
    pub host_clock_error: f64,
    /// Relative standard deviation of the sample rate, and so of the frequency of a line.
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
            // These values do not depend on the sensor.
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

    /// The filters in samples at `rate_hz`, if every value is read or one of `internal_rate_hz/rate_hz`.
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

    /// Sensor values per sample of a reader at `rate_hz`; 1 unless the ratio is an integer to [`WHOLE`].
    #[must_use]
    pub fn read_every(&self, rate_hz: f64) -> u32 {
        let decimation = self.internal_rate_hz / rate_hz;
        let is_whole = (decimation - decimation.round()).abs() <= WHOLE * decimation;
        if is_whole { (decimation.round() as u32).max(1) } else { 1 }
    }

    /// The native rate nearest to `rate_hz`, Hz; `None` if the profile has no native rates.
    #[must_use]
    pub fn nearest_native_rate_hz(&self, rate_hz: f64) -> Option<f64> {
        let distance = |native: &f64| (native - rate_hz).abs();
        self.native_rates_hz.iter().copied().min_by(|a, b| distance(a).total_cmp(&distance(b)))
    }
}
