//! For any answer of the bus, every procedure ends in bounded time with a value or an error, and none panics.

use std::convert::Infallible;

use adis16405_driver::{
    Adis16405, Alarm, AlarmNumber, AlarmThreshold, AlarmWatch, BURST_BYTES, BurstValidator, Channel, Config, DacLevel,
    GyroRange, Register, Stimulus,
};
use embedded_hal::delay::DelayNs;
use embedded_hal::spi::{ErrorType, Operation, SpiDevice};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

/// A bus that answers with the given bytes, repeated.
struct RepeatingBus {
    bytes: Vec<u8>,
    at: usize,
    transactions: usize,
}

impl ErrorType for RepeatingBus {
    type Error = Infallible;
}

impl SpiDevice for RepeatingBus {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        self.transactions += 1;
        for operation in operations {
            if let Operation::Transfer(answer, _) = operation {
                for byte in answer.iter_mut() {
                    *byte = self.bytes[self.at % self.bytes.len()];
                    self.at += 1;
                }
            }
        }
        Ok(())
    }
}

/// The sum of the requested delays, µs.
#[derive(Default)]
struct TotalDelay(u64);

impl DelayNs for TotalDelay {
    fn delay_ns(&mut self, ns: u32) {
        self.0 += u64::from(ns).div_ceil(1000);
    }

    fn delay_us(&mut self, us: u32) {
        self.0 += u64::from(us);
    }
}

/// Half of the answers begin with a valid PROD_ID, so that procedures get past the identification.
fn answers() -> impl Strategy<Value = Vec<u8>> {
    let any = prop::collection::vec(any::<u8>(), 1..200);
    let plausible = any.clone().prop_map(|bytes| [vec![0x00, 0x00, 0x40, 0x15], bytes].concat());
    prop_oneof![any, plausible]
}

proptest! {
    #![proptest_config(ProptestConfig {
        rng_seed: RngSeed::Fixed(16405),
        failure_persistence: None,
        ..ProptestConfig::with_cases(2048)
    })]

    #[test]
    fn every_procedure_ends_in_bounded_time(bytes in answers(), choice in 0..16u32, verify: bool) {
        let bus = RepeatingBus { bytes, at: 0, transactions: 0 };
        let mut imu = Adis16405::new(bus, TotalDelay::default(), Config::default()).with_verified_writes(verify);
        let (watch, threshold) = (AlarmWatch::RateOfChange(7), AlarmThreshold::Above(100));
        let alarm = Alarm { source: Channel::GyroZ, watch, threshold };
        let ended: Result<String, _> = match choice {
            0 => imu.start_up().map(|value| format!("{value:?}")),
            1 => imu.software_reset().map(|value| format!("{value:?}")),
            2 => imu.self_test().map(|value| format!("{value:?}")),
            3 => imu.flash_test().map(|value| format!("{value:?}")),
            4 => imu.stimulus_response(Stimulus::Negative).map(|value| format!("{value:?}")),
            5 => imu.auto_null().map(|value| format!("{value:?}")),
            6 => imu.precision_auto_null().map(|value| format!("{value:?}")),
            7 => imu.factory_restore().map(|value| format!("{value:?}")),
            8 => imu.flash_update().map(|value| format!("{value:?}")),
            9 => imu.set_alarm(AlarmNumber::Two, Some(alarm)).map(|value| format!("{value:?}")),
            10 => imu.alarm(AlarmNumber::One).map(|value| format!("{value:?}")),
            11 => imu.set_range(GyroRange::Dps150).map(|value| format!("{value:?}")),
            12 => imu.keep_negative_x_bias_on_host().map(|value| format!("{value:?}")),
            13 => imu.set_aux_dac(DacLevel::default()).map(|value| format!("{value:?}")),
            14 => imu.wake().map(|value| format!("{value:?}")),
            _ => imu.read_registers([Register::TempOut, Register::DiagStat]).map(|value| format!("{value:?}")),
        };
        if let Err(error) = &ended {
            prop_assert!(!error.to_string().is_empty());
        }
        // The longest delay is the 31 s of the precision auto-null; a stimulus response takes the most frames.
        let (bus, delay) = imu.release();
        prop_assert!(delay.0 < 32_000_000, "{} µs", delay.0);
        prop_assert!(bus.transactions < 1000);
    }

    #[test]
    fn every_burst_is_validated_and_its_values_are_finite(bytes in prop::collection::vec(any::<u8>(), 1..100)) {
        let mut imu = Adis16405::new(RepeatingBus { bytes, at: 0, transactions: 0 }, TotalDelay::default(), Config::default());
        let mut validator = BurstValidator::default().with_x_sign_at_risk(true);
        for _ in 0..50 {
            let burst = imu.burst().unwrap();
            let validity = validator.validate(&burst);
            prop_assert_eq!(validity.faults.cause().is_none(), validity.faults.is_empty());
            let sample = imu.sample_from(burst);
            prop_assert!(sample.gyro_dps().into_iter().chain(sample.accl_g()).all(f32::is_finite));
        }
        prop_assert_eq!(validator.counters().bursts, 50);
        prop_assert_eq!(imu.release().0.at, 50 * BURST_BYTES);
    }
}
