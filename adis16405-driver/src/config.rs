//! The configuration: gyro range, filter and sample clock, and the response of the filter. A value that the part would
//! not accept cannot be constructed.

use crate::channel::GyroRange;
use crate::clock::{ConfigError, SampleClock, SamplePeriod};

/// Gyro range, filter and sample clock: a combination that the part accepts. The default is that of the part after
/// reset: ±300 °/s, M = 2 (four samples an average), 819.2 samples per second.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "SerializedConfig", into = "SerializedConfig"))]
pub struct Config {
    range: GyroRange,
    filter_taps_log2: u8,
    sample_period: SamplePeriod,
    external_clock: bool,
}

impl Config {
    /// `filter_taps_log2` is M in SENS_AVG bits 2:0, 0 to 6: the filter is two cascaded averages of 2^M samples each.
    ///
    /// # Errors
    /// [`ConfigError::FilterTaps`] if M is above 6 or below the minimum of `range`.
    pub const fn new(range: GyroRange, filter_taps_log2: u8, sample_period: SamplePeriod) -> Result<Self, ConfigError> {
        if filter_taps_log2 > 6 || filter_taps_log2 < range.min_filter_taps_log2() {
            return Err(ConfigError::FilterTaps { range, filter_taps_log2 });
        }
        Ok(Self { range, filter_taps_log2, sample_period, external_clock: false })
    }

    /// The same configuration with another range.
    ///
    /// # Errors
    /// [`ConfigError::FilterTaps`] if the range needs more filter taps than are set.
    pub const fn with_range(mut self, range: GyroRange) -> Result<Self, ConfigError> {
        self.range = range;
        self.checked()
    }

    /// The same configuration with another filter.
    ///
    /// # Errors
    /// [`ConfigError::FilterTaps`] if M is above 6 or below the minimum of the range.
    pub const fn with_filter_taps_log2(mut self, filter_taps_log2: u8) -> Result<Self, ConfigError> {
        self.filter_taps_log2 = filter_taps_log2;
        self.checked()
    }

    /// The same configuration with the internal clock and another sample period.
    #[must_use]
    pub const fn with_sample_period(mut self, sample_period: SamplePeriod) -> Self {
        self.sample_period = sample_period;
        self.external_clock = false;
        self
    }

    /// The same configuration with [`SampleClock::External`]. Without a clock at its pin the part takes no samples.
    #[must_use]
    pub const fn with_external_clock(mut self) -> Self {
        self.external_clock = true;
        self
    }

    const fn checked(self) -> Result<Self, ConfigError> {
        match Self::new(self.range, self.filter_taps_log2, self.sample_period) {
            Ok(_) => Ok(self),
            Err(error) => Err(error),
        }
    }

    /// Gyro range.
    pub const fn range(self) -> GyroRange {
        self.range
    }

    /// M: each filter stage averages 2^M samples.
    pub const fn filter_taps_log2(self) -> u8 {
        self.filter_taps_log2
    }

    /// The response of the filter.
    pub const fn filter(self) -> BartlettFilter {
        BartlettFilter::new(self.filter_taps_log2)
    }

    /// Period of the internal clock, kept while an external one is selected.
    pub const fn sample_period(self) -> SamplePeriod {
        self.sample_period
    }

    /// The source of the sample clock.
    pub const fn sample_clock(self) -> SampleClock {
        if self.external_clock { SampleClock::External } else { SampleClock::Internal(self.sample_period) }
    }

    /// The value of SMPL_PRD.
    pub const fn smpl_prd(self) -> u8 {
        match self.sample_clock() {
            SampleClock::Internal(period) => period.register(),
            SampleClock::External => 0,
        }
    }

    /// The value of SENS_AVG.
    pub const fn sens_avg(self) -> u16 {
        self.range.sens_avg_code() << 8 | self.filter_taps_log2 as u16
    }
}

impl Default for Config {
    fn default() -> Self {
        Self {
            range: GyroRange::Dps300,
            filter_taps_log2: 2,
            sample_period: SamplePeriod::RESET,
            external_clock: false,
        }
    }
}

/// How a [`Config`] is serialised; [`Config::new`] checks it again when it is deserialised.
#[cfg(feature = "serde")]
#[derive(serde::Serialize, serde::Deserialize)]
#[serde(rename = "Config")]
struct SerializedConfig {
    range: GyroRange,
    filter_taps_log2: u8,
    sample_period: SamplePeriod,
    external_clock: bool,
}

#[cfg(feature = "serde")]
impl From<Config> for SerializedConfig {
    fn from(config: Config) -> Self {
        Self {
            range: config.range(),
            filter_taps_log2: config.filter_taps_log2(),
            sample_period: config.sample_period(),
            external_clock: config.smpl_prd() == 0,
        }
    }
}

#[cfg(feature = "serde")]
impl TryFrom<SerializedConfig> for Config {
    type Error = ConfigError;

    fn try_from(stored: SerializedConfig) -> Result<Self, ConfigError> {
        let config = Self::new(stored.range, stored.filter_taps_log2, stored.sample_period)?;
        Ok(if stored.external_clock { config.with_external_clock() } else { config })
    }
}

/// The digital filter of gyroscopes, accelerometers and magnetometers: two cascaded averages of N = 2^M samples each, a
/// Bartlett window of 2N + 1 taps, of which the first and the last are 0, with a phase of N samples (data sheet Rev. B,
/// Figure 15).
///
/// The −3 dB frequencies that Linux lists for this part are those of two plain averages, to the digits given. The
/// analog poles before the filter, at 404 Hz and 757 Hz (0.48 ms of delay by a figure for a sibling part), are not
/// included.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BartlettFilter {
    taps_log2: u8,
}

/// Bisection steps after which a −3 dB frequency is exact in `f64`.
const BISECTIONS: u32 = 52;

impl BartlettFilter {
    /// `taps_log2` is M, 0 (no filter) to 6; larger values are taken as 6.
    pub const fn new(taps_log2: u8) -> Self {
        Self { taps_log2: if taps_log2 > 6 { 6 } else { taps_log2 } }
    }

    /// N, the number of samples that each stage averages.
    pub const fn taps(self) -> u32 {
        1 << self.taps_log2
    }

    /// Number of taps, 2N + 1. The first and the last are 0, so that an output depends on 2N − 1 samples.
    pub const fn length(self) -> u32 {
        2 * self.taps() + 1
    }

    /// Group delay in samples, N, at every frequency.
    pub const fn group_delay(self) -> u32 {
        self.taps()
    }

    /// Amplitude response at `frequency` in cycles per sample (that is f/fs; 0.5 is the Nyquist frequency):
    /// |sin(πNf/fs) / (N·sin(πf/fs))|².
    pub fn gain(self, frequency: f64) -> f64 {
        // sin(Nx)/(N·sin x) is the product of cos(2ᵏx) over k = 0…M − 1.
        let mut cosine = cos_pi(frequency);
        let mut stage = 1.0;
        for _ in 0..self.taps_log2 {
            stage *= cosine;
            cosine = 2.0 * cosine * cosine - 1.0;
        }
        stage * stage
    }

    /// The −3 dB frequency in cycles per sample; multiply by the sample rate for Hz. `None` for M = 0.
    pub fn cutoff(self) -> Option<f64> {
        if self.taps_log2 == 0 {
            return None;
        }
        // The gain falls from 1 at frequency 0 to 0 at 1/N.
        let (mut low, mut high) = (0.0, 1.0 / f64::from(self.taps()));
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (low + high);
            let gain = self.gain(middle);
            if gain * gain > 0.5 { low = middle } else { high = middle }
        }
        Some(low)
    }

    /// The factor by which the filter changes the variance of white noise, (2N² + 1)/(3N³): the sum of the squared
    /// weights.
    pub fn white_noise_gain(self) -> f64 {
        let n = f64::from(self.taps());
        (2.0 * n * n + 1.0) / (3.0 * n * n * n)
    }

    /// Weight of the sample taken `age` samples ago. The weights are a triangle over the ages 0 to 2N, with its peak at N,
    /// and sum to 1.
    pub fn weight(self, age: u32) -> f64 {
        let n = self.taps();
        let height = if age <= n { age } else { (2 * n).saturating_sub(age) };
        f64::from(height) / f64::from(n * n)
    }
}

/// cos(πx), by its Taylor series after reduction of x to 0…1/2.
fn cos_pi(x: f64) -> f64 {
    let turn = x.abs() % 2.0;
    let half = if turn > 1.0 { 2.0 - turn } else { turn };
    let (sign, folded) = if half > 0.5 { (-1.0, 1.0 - half) } else { (1.0, half) };
    let square = (core::f64::consts::PI * folded) * (core::f64::consts::PI * folded);
    // Horner's scheme from the term of degree 22, which is below 2⁻⁵³ at π/2.
    let mut sum = 1.0;
    for k in (1..=11).rev() {
        sum = 1.0 - square * sum / f64::from((2 * k - 1) * (2 * k));
    }
    sign * sum
}
