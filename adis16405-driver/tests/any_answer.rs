//! Whatever the bus answers, every procedure ends, in bounded time, with a value or an error.

use std::convert::Infallible;

use adis16405_driver::{
    Adis16405, Alarm, AlarmNumber, BURST_BYTES, Channel, Config, DacLevel, GyroRange, Judge, Register, Stimulus,
    Threshold, Watch,
};
use embedded_hal::delay::DelayNs;
use embedded_hal::spi::{ErrorType, Operation, SpiDevice};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

/// A bus that answers with the bytes that it has, over and over.
struct Babble {
    bytes: Vec<u8>,
    at: usize,
    transactions: usize,
}

impl ErrorType for Babble {
    type Error = Infallible;
}

impl SpiDevice for Babble {
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

/// Sums what it is asked to wait, µs.
#[derive(Default)]
struct Clock(u64);

impl DelayNs for Clock {
    fn delay_ns(&mut self, ns: u32) {
        self.0 += u64::from(ns).div_ceil(1000);
    }

    fn delay_us(&mut self, us: u32) {
        self.0 += u64::from(us);
    }
}

/// Half of the answers contain a right PROD_ID somewhere, so that procedures get past their first step.
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
    fn every_procedure_ends(bytes in answers(), choice in 0..16u32, verify: bool) {
        let bus = Babble { bytes, at: 0, transactions: 0 };
        let mut imu = Adis16405::new(bus, Config::default()).with_verified_writes(verify);
        let mut clock = Clock::default();
        let alarm = Alarm { source: Channel::GyroZ, watch: Watch::RateOfChange(7), threshold: Threshold::Above(100) };
        let ended: Result<String, _> = match choice {
            0 => imu.start_up(&mut clock).map(|value| format!("{value:?}")),
            1 => imu.software_reset(&mut clock).map(|value| format!("{value:?}")),
            2 => imu.self_test(&mut clock).map(|value| format!("{value:?}")),
            3 => imu.flash_test(&mut clock).map(|value| format!("{value:?}")),
            4 => imu.stimulus_response(Stimulus::Negative, &mut clock).map(|value| format!("{value:?}")),
            5 => imu.auto_null(&mut clock).map(|value| format!("{value:?}")),
            6 => imu.precision_auto_null(&mut clock).map(|value| format!("{value:?}")),
            7 => imu.factory_restore(&mut clock).map(|value| format!("{value:?}")),
            8 => imu.flash_update(&mut clock).map(|value| format!("{value:?}")),
            9 => imu.set_alarm(AlarmNumber::Two, Some(alarm)).map(|value| format!("{value:?}")),
            10 => imu.alarm(AlarmNumber::One).map(|value| format!("{value:?}")),
            11 => imu.set_range(GyroRange::Dps150).map(|value| format!("{value:?}")),
            12 => imu.keep_negative_x_bias_on_host().map(|value| format!("{value:?}")),
            13 => imu.set_aux_dac(DacLevel::default()).map(|value| format!("{value:?}")),
            14 => imu.wake(&mut clock).map(|value| format!("{value:?}")),
            _ => imu.read_registers([Register::TempOut, Register::DiagStat]).map(|value| format!("{value:?}")),
        };
        if let Err(error) = &ended {
            prop_assert!(!error.to_string().is_empty());
        }
        // The longest pause is the precision null's 30 s, the most frames are those of eight samples, twice.
        prop_assert!(clock.0 < 31_000_000, "{} µs", clock.0);
        prop_assert!(imu.release().transactions < 1000);
    }

    #[test]
    fn every_burst_is_judged(bytes in prop::collection::vec(any::<u8>(), 1..100)) {
        let mut imu = Adis16405::new(Babble { bytes, at: 0, transactions: 0 }, Config::default());
        let mut judge = Judge::default().with_x_sign_at_risk(true);
        for _ in 0..50 {
            let burst = imu.burst().unwrap();
            let verdict = judge.judge(&burst);
            prop_assert_eq!(verdict.faults.cause().is_none(), verdict.faults.is_empty());
            let sample = imu.sample_of(burst);
            prop_assert!(sample.gyro_dps().into_iter().chain(sample.accl_g()).all(f32::is_finite));
        }
        prop_assert_eq!(judge.counters().bursts, 50);
        prop_assert_eq!(imu.release().at, 50 * BURST_BYTES);
    }
}
