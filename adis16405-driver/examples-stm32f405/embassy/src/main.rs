//! Embassy: the asynchronous driver on a bus that it shares with another device, in an executor that runs in an interrupt
//! and accepts `Send` futures only. Each read has a timeout; a read that is dropped costs its sample and nothing else.
//!
//! | pin | at the sensor | |
//! |---|---|---|
//! | PA4 | CS | |
//! | PA5, PA6, PA7 | SCLK, DOUT, DIN | SPI1, mode 3, by DMA2 streams 3 and 2 |
//! | PB0 | DIO1, data ready | with a pull-down: an unplugged sensor gives no pulse |
//! | PB1, open drain | RST | |
//! | PB2 | | chip select of another device on the bus |
//!
//! The sensor runs from 5 V and drives its outputs from an internal 3.3 V: connect every signal directly, without a divider
//! or a level shifter (data sheet Rev. B, page 5).
#![no_std]
#![no_main]

use adis16405_driver::{Adis16405, Async, Config, Faults};
use defmt_rtt as _;
use embassy_embedded_hal::shared_bus::asynch::spi::SpiDevice;
use embassy_executor::{InterruptExecutor, Spawner};
use embassy_stm32::exti::{self, ExtiInput};
use embassy_stm32::gpio::{Level, Output, OutputOpenDrain, Pull, Speed};
use embassy_stm32::interrupt::{self, InterruptExt, Priority};
use embassy_stm32::mode::Async as ByDma;
use embassy_stm32::spi::mode::Master;
use embassy_stm32::spi::{MODE_3, Spi};
use embassy_stm32::time::Hertz;
use embassy_stm32::{bind_interrupts, dma, peripherals};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::mutex::Mutex;
use embassy_time::{Delay, Duration, Timer, with_timeout};
use panic_probe as _;
use static_cell::StaticCell;

type SpiBus = Mutex<CriticalSectionRawMutex, Spi<'static, ByDma, Master>>;
type Device = SpiDevice<'static, CriticalSectionRawMutex, Spi<'static, ByDma, Master>, Output<'static>>;

static BUS: StaticCell<SpiBus> = StaticCell::new();
static URGENT: InterruptExecutor = InterruptExecutor::new();

bind_interrupts!(struct Irqs {
    EXTI0 => exti::InterruptHandler<interrupt::typelevel::EXTI0>;
    DMA2_STREAM2 => dma::InterruptHandler<peripherals::DMA2_CH2>;
    DMA2_STREAM3 => dma::InterruptHandler<peripherals::DMA2_CH3>;
});

/// The executor of the sensor's task runs in this interrupt, of a peripheral that is not used.
#[embassy_stm32::interrupt]
unsafe fn CAN1_TX() {
    // SAFETY: this is the interrupt that `URGENT` was started with.
    unsafe { URGENT.on_interrupt() }
}

#[embassy_executor::main]
async fn main(_spawner: Spawner) {
    let p = embassy_stm32::init(Default::default()); // 16 MHz, which is 1 MHz · 16
    let mut config = embassy_stm32::spi::Config::default();
    config.mode = MODE_3;
    config.frequency = Hertz(1_000_000);
    let spi = Spi::new(p.SPI1, p.PA5, p.PA7, p.PA6, p.DMA2_CH3, p.DMA2_CH2, Irqs, config);
    let bus = BUS.init(Mutex::new(spi));

    let imu = SpiDevice::new(bus, Output::new(p.PA4, Level::High, Speed::Medium));
    let data_ready = ExtiInput::new(p.PB0, p.EXTI0, Pull::Down, Irqs);
    let reset = OutputOpenDrain::new(p.PB1, Level::High, Speed::Low);
    interrupt::CAN1_TX.set_priority(Priority::P6);
    // A `SendSpawner`: the future of the task must be `Send`.
    URGENT.start(interrupt::CAN1_TX).spawn(sample(imu, data_ready, reset).unwrap());

    // Chip select of the sensor is high between its frames, so that others have the bus during its stall.
    let mut other = SpiDevice::new(bus, Output::new(p.PB2, Level::High, Speed::Medium));
    loop {
        let mut answer = [0u8; 2];
        let read = embedded_hal_async::spi::SpiDevice::transfer(&mut other, &mut answer, &[0x80, 0]).await;
        defmt::debug!("the other device: {} {}", read.is_ok(), answer);
        Timer::after_millis(100).await;
    }
}

#[embassy_executor::task]
async fn sample(spi: Device, mut data_ready: ExtiInput<'static, ByDma>, mut reset: OutputOpenDrain<'static>) {
    let mut imu: Adis16405<Device, Delay, Async> = Adis16405::new_async(spi, Delay, Config::default());
    let mut started = imu.start_up().await;
    loop {
        while let Err(error) = started {
            defmt::error!("{}", defmt::Debug2Format(&error));
            started = imu.hardware_reset(&mut reset).await;
        }
        // At 819.2 samples per second a pulse comes every 1.2 ms, and a burst takes 0.2 ms.
        match with_timeout(Duration::from_millis(50), imu.read_on(&mut data_ready)).await {
            Ok(Ok(sample)) => {
                defmt::trace!("{} °/s", sample.gyro_dps());
                if sample.warnings().contains(Faults::ERROR_ALARM) {
                    defmt::warn!("{}", defmt::Debug2Format(&imu.diagnosis().await)); // and cleared
                }
            }
            Ok(Err(error)) => defmt::warn!("{}", defmt::Debug2Format(&error)),
            Err(_) => {
                defmt::warn!("no data-ready pulse for 50 ms: reset");
                started = imu.hardware_reset(&mut reset).await;
            }
        }
    }
}
