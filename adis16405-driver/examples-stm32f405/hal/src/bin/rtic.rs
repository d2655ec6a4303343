//! RTIC 2: a hardware task reads the sensor at each data-ready edge, and a software task prints the mean rates.
//!
//! Wiring: PA4 CS, PA5 SCLK, PA6 DOUT, PA7 DIN, PB0 DIO1 (data ready).
//! The sensor runs from 5 V and drives its outputs from an internal 3.3 V: connect every signal directly, without a divider
//! or a level shifter (data sheet Rev. B, page 5).
#![no_std]
#![no_main]

use defmt_rtt as _;
use panic_probe as _;

#[rtic::app(device = stm32f4xx_hal::pac, dispatchers = [CAN1_TX])]
mod app {
    use adis16405_driver::{Adis16405, Config, Faults};
    use embedded_hal::spi::MODE_3;
    use embedded_hal_bus::spi::{ExclusiveDevice, NoDelay};
    use stm32f4xx_hal::gpio::{Edge, Input, Output, PA4, PB0, PinState};
    use stm32f4xx_hal::pac::{SPI1, TIM2};
    use stm32f4xx_hal::{prelude::*, rcc, spi::Spi, timer::DelayUs};

    type Imu = Adis16405<ExclusiveDevice<Spi<SPI1>, PA4<Output>, NoDelay>, DelayUs<TIM2>>;

    #[shared]
    struct Shared {
        /// Sum of the rates about x, y, z in 10⁻⁶ °/s, and their number.
        sum: ([i64; 3], i64),
    }

    #[local]
    struct Local {
        imu: Imu,
        data_ready: PB0<Input>,
    }

    #[init]
    fn init(mut context: init::Context) -> (Shared, Local) {
        let mut rcc = context.device.RCC.freeze(rcc::Config::hsi()); // 16 MHz, which is 1 MHz · 16
        let gpioa = context.device.GPIOA.split(&mut rcc);
        let gpiob = context.device.GPIOB.split(&mut rcc);
        let wires = (Some(gpioa.pa5), Some(gpioa.pa6), Some(gpioa.pa7));
        let bus = context.device.SPI1.spi(wires, MODE_3, 1.MHz(), &mut rcc);
        let select = gpioa.pa4.into_push_pull_output_in_state(PinState::High);
        let Ok(spi) = ExclusiveDevice::new_no_delay(bus, select);

        let mut imu = Adis16405::new(spi, context.device.TIM2.delay_us(&mut rcc), Config::default());
        // Without a sensor the image stops here; the example `recovery` goes on.
        let product = imu.start_up().unwrap();
        defmt::info!("{}", product);

        // With a pull, so that an unplugged sensor gives no edges.
        let mut data_ready = gpiob.pb0.into_pull_down_input();
        data_ready.make_interrupt_source(&mut context.device.SYSCFG.constrain(&mut rcc));
        data_ready.trigger_on_edge(&mut context.device.EXTI, Edge::Rising);
        data_ready.enable_interrupt(&mut context.device.EXTI);
        (Shared { sum: ([0; 3], 0) }, Local { imu, data_ready })
    }

    #[task(binds = EXTI0, priority = 2, local = [imu, data_ready], shared = [sum])]
    fn sample(mut context: sample::Context) {
        context.local.data_ready.clear_interrupt_pending_bit();
        match context.local.imu.read() {
            Ok(sample) => {
                let full = context.shared.sum.lock(|(sum, number)| {
                    for (sum, rate) in sum.iter_mut().zip(sample.gyro_udps()) {
                        *sum += i64::from(rate);
                    }
                    *number += 1;
                    *number >= 1000
                });
                if full {
                    // An error says that the task is still running: the mean then is over more samples.
                    let _ = report::spawn();
                }
                if sample.warnings().contains(Faults::ERROR_ALARM) {
                    // Reading the reason clears the flag.
                    defmt::warn!("{}", defmt::Debug2Format(&context.local.imu.diagnosis()));
                }
            }
            Err(error) => defmt::warn!("{}", defmt::Debug2Format(&error)),
        }
    }

    #[task(priority = 1, shared = [sum])]
    async fn report(mut context: report::Context) {
        let (sum, number) = context.shared.sum.lock(core::mem::take);
        if number > 0 {
            defmt::println!("{} · 10⁻⁶ °/s, mean of {}", sum.map(|sum| sum / number), number);
        }
    }
}
