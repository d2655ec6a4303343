//! The driver with arbitrary answers of the bus.

use adis16405_driver::{Adis16405, AlarmNumber, Burst, BurstValidator, Config, Stimulus};
use core::convert::Infallible;
use embedded_hal::delay::DelayNs;
use embedded_hal::spi::{ErrorType, Operation, SpiDevice};

/// A bus that answers with these bytes, then with 0xFF.
struct Answers<'a>(core::slice::Iter<'a, u8>);

impl ErrorType for Answers<'_> {
    type Error = Infallible;
}

impl SpiDevice for Answers<'_> {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        for operation in operations {
            if let Operation::Transfer(read, _) = operation {
                read.fill_with(|| self.0.next().copied().unwrap_or(0xFF));
            }
        }
        Ok(())
    }
}

struct NoDelay;

impl DelayNs for NoDelay {
    fn delay_ns(&mut self, _: u32) {}
}

/// Every procedure ends for any answers of the sensor. The first byte selects the procedure; the others are the
/// answers.
pub(crate) fn answers_of_the_bus(bytes: &[u8]) {
    let Some((&choice, answers)) = bytes.split_first() else { return };
    let mut imu = Adis16405::new(Answers(answers.iter()), NoDelay, Config::default());
    let mut validator = BurstValidator::default();
    // Any result is acceptable.
    let _result = match choice % 12 {
        0 => imu.init().is_ok(),
        1 => imu.software_reset().is_ok(),
        2 => imu.self_test().is_ok(),
        3 => imu.flash_test().is_ok(),
        4 => imu.stimulus_response(Stimulus::Positive).is_ok(),
        5 => imu.precision_auto_null().is_ok(),
        6 => imu.factory_restore().is_ok(),
        7 => imu.flash_update().is_ok(),
        8 => imu.alarm(AlarmNumber::One).is_ok(),
        9 => imu.gyro_offsets().is_ok(),
        10 => imu.gpio().is_ok(),
        _ => true,
    };
    for _ in 0..20 {
        if let Ok(burst) = imu.burst() {
            validator.validate(&burst);
            assert_eq!(Burst::from_bytes(&burst.to_bytes()), burst);
            imu.sample_from(burst).gyro_dps();
        }
    }
}
