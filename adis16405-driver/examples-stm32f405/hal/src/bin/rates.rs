//! Prints the angular rates once a second. PA4 CS, PA5 SCLK, PA6 DOUT, PA7 DIN.
//! The sensor runs from 5 V and drives its outputs from an internal 3.3 V: connect every signal directly, without a divider
//! or a level shifter (data sheet Rev. B, page 5).
#![no_std]
#![no_main]

use adis16405_driver::{Adis16405, Config};
use defmt_rtt as _;
use embedded_hal::{delay::DelayNs, spi::MODE_3};
use embedded_hal_bus::spi::ExclusiveDevice;
use panic_probe as _;
use stm32f4xx_hal::{gpio::PinState, pac, prelude::*, rcc};

#[cortex_m_rt::entry]
fn main() -> ! {
    let device = pac::Peripherals::take().unwrap();
    let mut rcc = device.RCC.freeze(rcc::Config::hsi()); // 16 MHz, which is 1 MHz · 16
    let gpioa = device.GPIOA.split(&mut rcc);
    let wires = (Some(gpioa.pa5), Some(gpioa.pa6), Some(gpioa.pa7));
    let bus = device.SPI1.spi(wires, MODE_3, 1.MHz(), &mut rcc);
    let spi = ExclusiveDevice::new_no_delay(bus, gpioa.pa4.into_push_pull_output_in_state(PinState::High)).unwrap();
    let mut imu = Adis16405::new(spi, device.TIM2.delay_us(&mut rcc), Config::default());
    defmt::info!("{}", imu.start_up().unwrap());
    let mut timer = device.TIM5.delay_us(&mut rcc);
    loop {
        timer.delay_ms(1000);
        match imu.read() {
            Ok(sample) => defmt::println!("{} °/s", sample.gyro_dps()),
            Err(error) => defmt::println!("{}", defmt::Debug2Format(&error)),
        }
    }
}
