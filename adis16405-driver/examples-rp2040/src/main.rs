//! Embassy on a Raspberry Pi Pico: prints the angular rates of a sample at each data-ready pulse, and resets a sensor that is silent.
//!
//! | Pico | sensor |
//! |---|---|
//! | GP17 (pin 22) | CS |
//! | GP18, GP16, GP19 (24, 21, 25) | SCLK, DOUT, DIN: SPI0, mode 3, by DMA |
//! | GP20 (26) | DIO1, data ready |
//! | VBUS (40), GND (38) | VCC, GND |
//!
//! The sensor runs from 5 V and drives its outputs from an internal 3.3 V: connect every signal directly, without a divider or a
//! level shifter (data sheet Rev. B, page 5).
#![no_std]
#![no_main]

use adis16405_driver::{Adis16405, Config, Error};
use defmt_rtt as _;
use embassy_embedded_hal::shared_bus::asynch::spi::SpiDevice;
use embassy_executor::Spawner;
use embassy_rp::gpio::{Input, Level, Output, Pull};
use embassy_rp::spi::{self, Phase, Polarity, Spi};
use embassy_rp::{bind_interrupts, dma, peripherals};
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::mutex::Mutex;
use embassy_time::{Delay, Duration, with_timeout};
use panic_probe as _;

bind_interrupts!(struct Irqs {
    DMA_IRQ_0 => dma::InterruptHandler<peripherals::DMA_CH0>, dma::InterruptHandler<peripherals::DMA_CH1>;
});

#[embassy_executor::main]
async fn main(_spawner: Spawner) {
    let p = embassy_rp::init(Default::default());
    // High before the clock idles high: no edge reaches a sensor that is selected.
    let select = Output::new(p.PIN_17, Level::High);
    let mut config = spi::Config::default();
    config.frequency = 1_000_000;
    (config.polarity, config.phase) = (Polarity::IdleHigh, Phase::CaptureOnSecondTransition); // mode 3
    let spi = Spi::new(p.SPI0, p.PIN_18, p.PIN_19, p.PIN_16, p.DMA_CH0, p.DMA_CH1, Irqs, config);
    let bus: Mutex<NoopRawMutex, _> = Mutex::new(spi);
    // With a pull-down an unplugged sensor gives no pulse.
    let mut data_ready = Input::new(p.PIN_20, Pull::Down);

    let mut imu = Adis16405::new_async(SpiDevice::new(&bus, select), Delay, Config::default());
    loop {
        if let Err(error) = imu.start_up().await {
            defmt::error!("{}", defmt::Debug2Format(&error));
            continue;
        }
        // A pulse comes every 1.2 ms.
        while let Ok(read) = with_timeout(Duration::from_millis(50), imu.read_on(&mut data_ready)).await {
            match read {
                Ok(sample) => defmt::println!("{} °/s", sample.gyro_dps()),
                Err(Error::Unusable(faults)) => defmt::warn!("no sample: {}", faults),
                Err(error) => defmt::error!("{}", defmt::Debug2Format(&error)),
            }
        }
        defmt::warn!("no data-ready pulse for 50 ms");
    }
}
