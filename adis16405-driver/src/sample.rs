//! One sample in physical units.

use crate::burst::Counts;
use crate::channel::{Channel, GyroRange};
use crate::validity::Faults;

/// The counts of one sample with their gyro range, and values in physical units.
///
/// Values exist as `f32` and as exact `i32` in 10⁻⁶ (temperature also 10⁻³) of the unit, by the data sheet's scales.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ImuSample {
    counts: Counts,
    range: GyroRange,
    host_bias_x: i16,
    warnings: Faults,
}

/// One count of XGYRO_OFF, 0.0125 °/s, in 10⁻⁶ °/s.
const BIAS_UDPS: i32 = 12_500;

impl ImuSample {
    /// A sample of counts taken in `range`, without a host-side bias correction.
    pub const fn new(counts: Counts, range: GyroRange) -> Self {
        Self { counts, range, host_bias_x: 0, warnings: Faults::empty() }
    }

    /// Sets the correction of x in counts of 0.0125 °/s: see [`GyroBias`](crate::GyroBias).
    #[must_use]
    pub const fn with_host_bias_x(mut self, host_bias_x: i16) -> Self {
        self.host_bias_x = host_bias_x;
        self
    }

    /// Sets the faults that the burst shows and for which it was not refused.
    #[must_use]
    pub const fn with_warnings(mut self, warnings: Faults) -> Self {
        self.warnings = warnings;
        self
    }

    /// Faults for which the burst was not refused, [`Faults::WARNINGS`] by default
    /// ([`with_refused_faults`](crate::Adis16405::with_refused_faults)); none without validation.
    pub const fn warnings(&self) -> Faults {
        self.warnings
    }

    /// The counts as the part sent them, without the host-side bias correction.
    pub const fn counts(&self) -> &Counts {
        &self.counts
    }

    /// The gyro range in which the sample was taken.
    pub const fn range(&self) -> GyroRange {
        self.range
    }

    /// The bias correction that is added to the x rate, in counts of 0.0125 °/s.
    pub const fn host_bias_x(&self) -> i16 {
        self.host_bias_x
    }

    /// Angular rates about x, y, z in 10⁻⁶ °/s, host-side bias correction included.
    pub fn gyro_udps(&self) -> [i32; 3] {
        let lsb = self.range.lsb_udps();
        let [x, y, z] = self.counts.gyro().map(|count| i32::from(count) * lsb);
        [x + i32::from(self.host_bias_x) * BIAS_UDPS, y, z]
    }

    /// Angular rates about x, y, z in °/s, host-side bias correction included.
    pub fn gyro_dps(&self) -> [f32; 3] {
        self.gyro_udps().map(millionths)
    }

    /// Specific forces along x, y, z in 10⁻⁶ g.
    pub fn accl_ug(&self) -> [i32; 3] {
        self.counts.accl().map(|count| i32::from(count) * 3_330)
    }

    /// Specific forces along x, y, z in g.
    pub fn accl_g(&self) -> [f32; 3] {
        self.accl_ug().map(millionths)
    }

    /// Magnetic field along x, y, z in 10⁻⁶ gauss.
    pub fn magn_ugauss(&self) -> [i32; 3] {
        self.counts.magn().map(|count| i32::from(count) * 500)
    }

    /// Magnetic field along x, y, z in gauss.
    pub fn magn_gauss(&self) -> [f32; 3] {
        self.magn_ugauss().map(millionths)
    }

    /// Supply voltage in 10⁻⁶ V.
    pub fn supply_uv(&self) -> i32 {
        i32::from(self.counts.get(Channel::Supply)) * 2_418
    }

    /// Supply voltage in V.
    pub fn supply_v(&self) -> f32 {
        millionths(self.supply_uv())
    }

    /// Voltage at the auxiliary input in 10⁻⁶ V.
    pub fn aux_adc_uv(&self) -> i32 {
        i32::from(self.counts.get(Channel::AuxAdc)) * 806
    }

    /// Voltage at the auxiliary input in V.
    pub fn aux_adc_v(&self) -> f32 {
        millionths(self.aux_adc_uv())
    }

    /// Temperature in 10⁻⁶ °C for `udegc_per_count`: 140,000 (data sheet Rev. B, Table 9) or 135,700 (Analog Devices'
    /// register map).
    pub fn temp_udegc(&self, udegc_per_count: i32) -> i32 {
        25_000_000i32.saturating_add(i32::from(self.counts.get(Channel::Temp)).saturating_mul(udegc_per_count))
    }

    /// Internal temperature in 10⁻³ °C, at 0.14 °C a count: see [`temp_udegc`](Self::temp_udegc).
    pub fn temp_mdegc(&self) -> i32 {
        25_000 + 140 * i32::from(self.counts.get(Channel::Temp))
    }

    /// Internal temperature in °C, at 0.14 °C a count: see [`temp_udegc`](Self::temp_udegc).
    pub fn temp_degc(&self) -> f32 {
        self.temp_mdegc() as f32 * 1e-3
    }
}

fn millionths(value: i32) -> f32 {
    value as f32 * 1e-6
}
