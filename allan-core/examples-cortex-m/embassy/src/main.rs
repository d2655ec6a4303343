//! Embassy: noise and drift of the chip's own temperature sensor, in °C, ten samples a second.
//!
//! No wiring. The estimator belongs to one task, so no lock is needed; the report delays the next sample by less than the
//! ticker's period or shows as a missing one.
#![no_std]
#![no_main]

use allan_core::fit::fit_power_laws;
use allan_core::{Cascade, NoiseTerm, Quantizer, TimeStamps};
use embassy_executor::Spawner;
use embassy_stm32::adc::{Adc, SampleTime};
use embassy_time::{Duration, Instant, Ticker};
use {defmt_rtt as _, panic_probe as _};

const PERIOD: Duration = Duration::from_millis(100);

/// The temperature in °C from the reading of 12 bits at a supply of 3.3 V (STM32F405 data sheet, temperature sensor
/// characteristics: 0.76 V at 25 °C, 2.5 mV/°C).
fn celsius(reading: u16) -> f32 {
    (f32::from(reading) * (3.3 / 4096.0) - 0.76) / 0.0025 + 25.0
}

#[embassy_executor::main]
async fn main(_spawner: Spawner) {
    let peripherals = embassy_stm32::init(Default::default());
    let mut adc = Adc::new(peripherals.ADC1);
    let mut sensor = adc.enable_temperature();

    // A hundredth of a degree: far below the noise of a reading, whose LSB is 0.3 °C.
    let Some(quantizer) = Quantizer::new(25.0, 0.01) else { defmt::unreachable!("a positive LSB") };
    let Some(mut stamps) = TimeStamps::new(PERIOD.as_micros()) else { defmt::unreachable!("a positive period") };
    let mut estimator = Cascade::<20, 8>::new();
    let mut ticker = Ticker::every(PERIOD);
    loop {
        ticker.next().await;
        let time = Instant::now().as_micros();
        match quantizer.count(celsius(adc.blocking_read(&mut sensor, SampleTime::CYCLES480))) {
            Ok(count) => {
                if let Err(error) = stamps.push(&mut estimator, time, count) {
                    defmt::warn!("{}", error);
                }
            }
            // Not pushed: the next time stamp shows the gap.
            Err(error) => defmt::warn!("{}", error),
        }
        if estimator.len().is_multiple_of(600) {
            let curve = estimator.curve_without_confidence(PERIOD.as_micros() as f64 * 1e-6).scaled(quantizer.lsb());
            let model = fit_power_laws(&curve, &NoiseTerm::BASELINE);
            for term in model.terms() {
                defmt::println!("{}: {} ({} to {})", term.kind.name(), term.value, term.low, term.high);
            }
        }
    }
}
