//! The image for an STM32F405 or STM32F427 with an 8 MHz crystal (Olimex STM32-H405 and the like).
//!
//! | pin | signal | at the sensor |
//! |---|---|---|
//! | PA4 | chip select, active low | CS |
//! | PA5, PA6, PA7 | SPI1 SCK, MISO, MOSI, mode 3 | SCLK, DOUT, DIN |
//! | PB0 | data ready, rising edge | DIO1 |
//! | PA2, PA3 | USART2 TX, RX, 460 800 Bd 8N1 | to the host |
//!
//! The sensor runs from 5 V, its outputs are read by 5 V tolerant pins and its inputs take 3.3 V.
#![no_std]
#![no_main]

mod console;
mod panic;
mod sampling;

use adis16405_driver::{Adis16405, Config, GyroRange, SamplePeriod, TimeBase};
use console::Console;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m_rt::{entry, exception};
use defmt_rtt as _;
use embedded_hal_bus::spi::ExclusiveDevice;
use firmware::{App, Queue, Settings, Uptime, bring_up, log_frame, spi_clock};
use stm32f4xx_hal::gpio::{Edge, PinState};
use stm32f4xx_hal::{pac, prelude::*, rcc, serial, spi};

const CRYSTAL_HZ: u32 = 8_000_000;
const CORE_HZ: u32 = 168_000_000;
const SPI_BUS_HZ: u32 = 84_000_000;
const BAUD: u32 = 460_800;
const REPORT_INTERVAL_US: u64 = 10_000_000;
const RETRY_US: u32 = 1_000_000;
const UPTIME_PERIOD_US: u32 = 4_000_000_000;
/// SysTick at a tenth of a second, so that the main loop goes round without a sensor too.
const WAKE_TICKS: u32 = CORE_HZ / 8 / 10;

/// 204.8 samples a second, ±300 °/s, no filter.
const CONFIG: Config = {
    let Ok(period) = SamplePeriod::from_divisor(TimeBase::Fast, 8) else { panic!("divisor") };
    let Ok(config) = Config::new(GyroRange::Dps300, 0, period) else { panic!("filter") };
    config
};

#[entry]
fn main() -> ! {
    static mut ARRIVALS: Queue = Queue::new();
    let (Some(device), Some(mut core)) = (pac::Peripherals::take(), cortex_m::Peripherals::take()) else {
        panic!("peripherals taken twice");
    };
    let clocks = rcc::Config::hse(CRYSTAL_HZ.Hz()).sysclk(CORE_HZ.Hz()).pclk1(42.MHz()).pclk2(SPI_BUS_HZ.Hz());
    let mut rcc = device.RCC.freeze(clocks);
    let gpioa = device.GPIOA.split(&mut rcc);
    let gpiob = device.GPIOB.split(&mut rcc);

    let mut timer = device.TIM2.counter_us(&mut rcc);
    timer.start(UPTIME_PERIOD_US.micros()).expect("the period fits 32 bits");
    let mut uptime = Uptime::new(UPTIME_PERIOD_US, timer.now().ticks());
    core.SYST.set_clock_source(SystClkSource::External);
    core.SYST.set_reload(WAKE_TICKS - 1);
    core.SYST.clear_current();
    core.SYST.enable_interrupt();
    core.SYST.enable_counter();

    let line = serial::Config::default().baudrate(BAUD.bps());
    let usart = device.USART2.serial(((gpioa.pa2), (gpioa.pa3)), line, &mut rcc).expect("a baud rate within reach");
    let mut console = Console::start(usart, &mut core.NVIC);
    let mut encoder = link::Encoder::new();

    let request = spi_clock::fastest_at_most(rcc.clocks.pclk2().raw(), spi_clock::BURST_LIMIT_HZ)
        .expect("a prescaler for the burst limit");
    let mode = spi::Mode { polarity: spi::Polarity::IdleHigh, phase: spi::Phase::CaptureOnSecondTransition };
    let pins = (Some(gpioa.pa5), Some(gpioa.pa6), Some(gpioa.pa7));
    let bus = device.SPI1.spi(pins, mode, request.Hz(), &mut rcc);
    let spi_clock_hz = sampling::spi_clock_hz(rcc.clocks.pclk2().raw());
    assert!(spi_clock_hz <= spi_clock::BURST_LIMIT_HZ, "serial clock above the burst limit");
    let select = gpioa.pa4.into_push_pull_output_in_state(PinState::High);
    let stall = sampling::Stall(device.TIM5.delay_us(&mut rcc));
    let bus = ExclusiveDevice::new(bus, select, stall).expect("the pin cannot fail");
    let mut sensor = Adis16405::new(bus, CONFIG);

    defmt::info!("SCK {=u32} Hz", spi_clock_hz);
    let product_id = loop {
        match bring_up(&mut sensor) {
            Ok(product_id) => break product_id,
            Err(error) => {
                if let Some(frame) = log_frame(&mut encoder, format_args!("sensor: {error}; trying again")) {
                    console.say(&frame);
                }
                defmt::warn!("no sensor");
                let until = uptime.at(timer.now().ticks()) + u64::from(RETRY_US);
                while uptime.at(timer.now().ticks()) < until {
                    cortex_m::asm::wfi();
                }
            }
        }
    };

    let mut data_ready = gpiob.pb0.into_pull_down_input();
    data_ready.make_interrupt_source(&mut device.SYSCFG.constrain(&mut rcc));
    let mut exti = device.EXTI;
    data_ready.trigger_on_edge(&mut exti, Edge::Rising);
    data_ready.enable_interrupt(&mut exti);
    let (producer, mut arrivals) = ARRIVALS.split();
    sampling::start(sensor, producer, data_ready, &mut core.NVIC);

    let settings = Settings { config: CONFIG, product_id, spi_clock_hz, report_interval_us: REPORT_INTERVAL_US };
    let app: &'static mut App =
        cortex_m::singleton!(: App = App::new(settings, encoder)).expect("the application starts once");
    defmt::info!("sampling");
    loop {
        while let Some(arrival) = arrivals.dequeue() {
            app.take(arrival, arrivals.len());
        }
        while let Some(byte) = console.received() {
            app.command(byte);
        }
        if !app.poll(uptime.at(timer.now().ticks()), &mut console) {
            cortex_m::asm::wfi();
        }
    }
}

#[exception]
fn SysTick() {}
