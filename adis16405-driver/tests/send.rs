//! The futures of the asynchronous driver are `Send`, so that executors with several threads (tokio) and interrupt
//! executors (embassy) accept them. The test is that this file compiles.
#![cfg(feature = "async")]

use std::convert::Infallible;
use std::num::NonZeroU8;

use adis16405_driver::{Adis16405, Async, Config, Register, Sleep, Stimulus};
use embedded_hal_async::delay::DelayNs;
use embedded_hal_async::spi::{ErrorType, Operation, SpiDevice};

/// A bus whose futures are `Send`, which reads zeros.
struct ZeroBus;

impl ErrorType for ZeroBus {
    type Error = Infallible;
}

impl SpiDevice for ZeroBus {
    async fn transaction(&mut self, _: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        Ok(())
    }
}

struct NoDelay;

impl DelayNs for NoDelay {
    async fn delay_ns(&mut self, _: u32) {}
}

fn assert_send<T: Send>(_: T) {}

#[test]
fn the_futures_of_the_driver_are_send() {
    let mut imu: Adis16405<ZeroBus, NoDelay, Async> = Adis16405::new_async(ZeroBus, NoDelay, Config::default());
    assert_send(imu.burst());
    assert_send(imu.read());
    assert_send(imu.init());
    assert_send(imu.start_up());
    assert_send(imu.software_reset());
    assert_send(imu.configure(Config::default()));
    assert_send(imu.read_registers([Register::TempOut, Register::DiagStat]));
    assert_send(imu.update_register(Register::AuxDac, 1, 1));
    assert_send(imu.self_test());
    assert_send(imu.stimulus_response(Stimulus::Positive));
    assert_send(imu.flash_update());
    assert_send(imu.sleep(Sleep::HalfSeconds(NonZeroU8::MIN)));
    assert_send(imu.wake());
    assert_send(imu);
}
