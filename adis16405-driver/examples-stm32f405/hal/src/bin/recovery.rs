//! A program without a scheduler that goes on, whatever the sensor does: it tests the sensor, reads it at each data-ready
//! edge, clears latched flags, and resets a sensor that gives no sample for a second.
//!
//! | pin | at the sensor |
//! |---|---|
//! | PA4 | CS |
//! | PA5, PA6, PA7 | SCLK, DOUT, DIN |
//! | PB0 | DIO1, data ready |
//! | PB1, open drain | RST |
//!
//! The sensor runs from 5 V and drives its outputs from an internal 3.3 V: connect every signal directly, without a divider
//! or a level shifter (data sheet Rev. B, page 5).
#![no_std]
#![no_main]

use adis16405_driver::{Adis16405, Config, ConfigError, Error, Faults, GyroRange, SamplePeriod};
use cortex_m::peripheral::DWT;
use defmt_rtt as _;
use embedded_hal::spi::MODE_3;
use embedded_hal_bus::spi::ExclusiveDevice;
use panic_probe as _;
use stm32f4xx_hal::gpio::PinState;
use stm32f4xx_hal::{pac, prelude::*, rcc};

/// ±300 °/s, two averages of 2² samples, 204.8 samples per second.
fn config() -> Result<Config, ConfigError> {
    Config::new(GyroRange::Dps300, 2, SamplePeriod::nearest_millihz(204_800)?)
}

/// Cycles of the core in a second.
const SECOND: u32 = 16_000_000;

#[cortex_m_rt::entry]
fn main() -> ! {
    let device = pac::Peripherals::take().unwrap();
    let mut rcc = device.RCC.freeze(rcc::Config::hsi()); // 16 MHz, which is 1 MHz · 16
    let gpioa = device.GPIOA.split(&mut rcc);
    let gpiob = device.GPIOB.split(&mut rcc);
    let wires = (Some(gpioa.pa5), Some(gpioa.pa6), Some(gpioa.pa7));
    let bus = device.SPI1.spi(wires, MODE_3, 1.MHz(), &mut rcc);
    let spi = ExclusiveDevice::new_no_delay(bus, gpioa.pa4.into_push_pull_output_in_state(PinState::High)).unwrap();
    let data_ready = gpiob.pb0.into_floating_input();
    let mut reset = gpiob.pb1.into_open_drain_output_in_state(PinState::High);
    let mut core = cortex_m::Peripherals::take().unwrap();
    core.DCB.enable_trace();
    core.DWT.enable_cycle_counter();

    let mut imu = Adis16405::new(spi, device.TIM2.delay_us(&mut rcc), config().unwrap());
    let mut started = imu.start_up();
    loop {
        if let Err(error) = started {
            defmt::error!("{}", defmt::Debug2Format(&error));
        }
        match imu.self_test() {
            Ok(test) => {
                defmt::info!("self-test {}: {}", if test.passed() { "passed" } else { "failed" }, test.diagnosis)
            }
            Err(error) => defmt::error!("{}", defmt::Debug2Format(&error)),
        }
        let mut latest = DWT::cycle_count();
        while DWT::cycle_count().wrapping_sub(latest) < SECOND {
            if data_ready.is_low() {
                continue;
            }
            match imu.read() {
                Ok(sample) => {
                    latest = DWT::cycle_count();
                    defmt::println!("{} °/s, {} g", sample.gyro_dps(), sample.accl_g());
                    if sample.warnings().contains(Faults::ERROR_ALARM) {
                        match imu.diagnosis() {
                            Ok(diagnosis) => defmt::warn!("{}", diagnosis), // and cleared
                            Err(error) => defmt::error!("{}", defmt::Debug2Format(&error)),
                        }
                    }
                }
                // Already read during this pulse of data ready.
                Err(Error::Unusable(faults)) if faults.contains(Faults::NO_NEW_DATA) => {}
                Err(error) => defmt::error!("{}", defmt::Debug2Format(&error)),
            }
        }
        defmt::warn!("no sample for a second: reset");
        started = imu.hardware_reset(&mut reset);
    }
}
