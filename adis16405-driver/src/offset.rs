//! Corrections of the sensors.

/// Where the bias correction of the gyros is applied, in counts of 0.0125 °/s that are added to the outputs.
///
/// After a burst read the ADIS16405 drops the sign bit of negative x rates while XGYRO_OFF is negative, in single reads
/// that follow too (reported for all units tested). A negative correction of x is therefore kept by the driver, which
/// adds it to the rates of its [`Sample`](crate::Sample)s; the raw counts do not contain it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct GyroBias {
    /// XGYRO_OFF, YGYRO_OFF and ZGYRO_OFF.
    pub part: [i16; 3],
    /// Added to x on the host.
    pub host_x: i16,
}

impl GyroBias {
    /// The correction that is in effect about x, y and z.
    pub fn total(&self) -> [i16; 3] {
        let [x, y, z] = self.part;
        [x.saturating_add(self.host_x), y, z]
    }
}

/// The user's corrections that a restore of the factory calibration overwrote.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FactoryRestore {
    /// Gyro bias, 0.0125 °/s per count.
    pub gyro: GyroBias,
    /// Accelerometer bias x, y, z, 3.33 mg per count.
    pub accl: [i16; 3],
    /// Hard iron x, y, z, 0.5 mgauss per count.
    pub hard_iron: [i16; 3],
    /// Soft iron x, y, z, 0x0800 = 1.
    pub soft_iron: [u16; 3],
}
