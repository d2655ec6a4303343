//! What DIAG_STAT says.

use crate::channel::Channel;

bitflags::bitflags! {
    /// DIAG_STAT. Reading it clears it, so what a procedure reads on its way is handed out with its result.
    ///
    /// Bits 12 to 10 are z, y, x gyro after three sources; Linux has x and z the other way round. That a condition that
    /// persists comes back with the next sample is not confirmed by any source at hand.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
    #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
    pub struct Diagnosis: u16 {
        /// Supply below 4.75 V.
        const SUPPLY_LOW = 1 << 0;
        /// Supply above 5.25 V.
        const SUPPLY_HIGH = 1 << 1;
        /// A flash or control update failed.
        const FLASH_UPDATE = 1 << 2;
        /// A frame with a number of clocks that is no multiple of 16.
        const SPI = 1 << 3;
        /// A sensor is over its range.
        const OVER_RANGE = 1 << 4;
        /// The self-test failed; the bits from [`GYRO_X`](Self::GYRO_X) on tell where.
        const SELF_TEST = 1 << 5;
        /// The checksum of the flash memory is wrong.
        const FLASH_CHECKSUM = 1 << 6;
        /// Alarm 1.
        const ALARM_1 = 1 << 8;
        /// Alarm 2.
        const ALARM_2 = 1 << 9;
        /// Self-test of gyro x failed.
        const GYRO_X = 1 << 10;
        /// Self-test of gyro y failed.
        const GYRO_Y = 1 << 11;
        /// Self-test of gyro z failed.
        const GYRO_Z = 1 << 12;
        /// Self-test of accelerometer x failed.
        const ACCL_X = 1 << 13;
        /// Self-test of accelerometer y failed.
        const ACCL_Y = 1 << 14;
        /// Self-test of accelerometer z failed.
        const ACCL_Z = 1 << 15;
    }
}

impl Diagnosis {
    /// Everything by which a self-test fails.
    pub const SELF_TEST_FAILURES: Self = Self::SELF_TEST
        .union(Self::GYRO_X)
        .union(Self::GYRO_Y)
        .union(Self::GYRO_Z)
        .union(Self::ACCL_X)
        .union(Self::ACCL_Y)
        .union(Self::ACCL_Z);

    /// The sensors that failed their self-test.
    pub fn failed_sensors(self) -> impl Iterator<Item = Channel> {
        Channel::INERTIAL
            .into_iter()
            .enumerate()
            .filter(move |(index, _)| self.bits() & Self::GYRO_X.bits() << index != 0)
            .map(|(_, channel)| channel)
    }
}
