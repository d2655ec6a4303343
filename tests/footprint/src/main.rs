//! An image that uses the part of the driver or of allan-core selected by its features, or counts the instructions of a
//! burst.
#![no_std]
#![no_main]

mod bus;
#[cfg(feature = "calls")]
mod calls;
#[cfg(feature = "counted")]
mod counted;
#[cfg(feature = "push")]
mod estimator;
#[cfg(any(feature = "everything", feature = "asynchronous"))]
mod methods;

use cortex_m_rt::entry;
use cortex_m_semihosting::debug;

#[entry]
fn main() -> ! {
    let bus = bus::Bus::new();
    #[cfg(feature = "burst")]
    core::hint::black_box(sample(bus).is_ok());
    #[cfg(feature = "counted")]
    counted::count(bus);
    #[cfg(feature = "everything")]
    core::hint::black_box(methods::blocking(bus).is_ok());
    #[cfg(feature = "asynchronous")]
    core::hint::black_box(methods::asynchronous(bus));
    #[cfg(feature = "push")]
    estimator::run();
    #[cfg(feature = "calls")]
    calls::run();
    core::hint::black_box(bus);
    debug::exit(debug::EXIT_SUCCESS);
    loop {
        cortex_m::asm::wfi();
    }
}

/// The calls that sampling needs: start, burst, validation, values.
#[cfg(feature = "burst")]
fn sample(bus: bus::Bus) -> Result<(), adis16405_driver::Error<core::convert::Infallible>> {
    use adis16405_driver::{Adis16405, BurstValidator, Config};
    use core::hint::black_box;
    let mut imu = Adis16405::new(bus, bus, black_box(Config::default()));
    let mut validator = BurstValidator::default();
    imu.init()?;
    let burst = imu.burst()?;
    black_box(validator.validate(&burst));
    let sample = imu.sample_from(burst);
    black_box((sample.gyro_udps(), sample.accl_ug(), sample.magn_ugauss(), sample.temp_mdegc(), sample.supply_uv()));
    Ok(())
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    debug::exit(debug::EXIT_FAILURE);
    loop {}
}
