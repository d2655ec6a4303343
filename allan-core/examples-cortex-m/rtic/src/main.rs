//! RTIC 2: the stability of this board's oscillator against a GNSS receiver with a pulse a second.
//!
//! Wiring: the pulse at PA0. A timer counts the board's clock; its count at a pulse is the phase of the clock, and what it
//! has counted too much or too little since the pulse before is the frequency error. A pulse that is missing shows as twice
//! the time.
#![no_std]
#![no_main]

use {defmt_rtt as _, panic_probe as _};

#[rtic::app(device = stm32f4xx_hal::pac, dispatchers = [CAN1_TX])]
mod app {
    use allan_core::{Cascade, TimeStamps, integer_count};
    use stm32f4xx_hal::gpio::{Edge, Input, PA0};
    use stm32f4xx_hal::pac::TIM2;
    use stm32f4xx_hal::{prelude::*, rcc};

    const CLOCK: u32 = 16_000_000; // Hz, nominal

    #[shared]
    struct Shared {
        /// Counts of 1/CLOCK = 62.5 ns: the longest averaging time is 2¹⁵ s.
        estimator: Cascade<16, 8>,
    }

    #[local]
    struct Local {
        pulse: PA0<Input>,
        timer: TIM2,
        stamps: TimeStamps,
        /// The clock's count at the last pulse, and the same since the start in 64 bits.
        last: Option<(u32, u64)>,
    }

    #[init]
    fn init(mut context: init::Context) -> (Shared, Local) {
        let mut rcc = context.device.RCC.freeze(rcc::Config::hsi());
        let gpioa = context.device.GPIOA.split(&mut rcc);
        let mut pulse = gpioa.pa0.into_floating_input();
        pulse.make_interrupt_source(&mut context.device.SYSCFG.constrain(&mut rcc));
        pulse.trigger_on_edge(&mut context.device.EXTI, Edge::Rising);
        pulse.enable_interrupt(&mut context.device.EXTI);

        let timer = context.device.TIM2;
        rcc.apb1enr().modify(|_, w| w.tim2en().enabled());
        timer.cr1().modify(|_, w| w.cen().enabled()); // counts to 2³² and wraps after 268 s

        let stamps = TimeStamps::new(u64::from(CLOCK)).unwrap_or_else(|| defmt::unreachable!("a positive period"));
        (Shared { estimator: Cascade::new() }, Local { pulse, timer, stamps, last: None })
    }

    #[task(binds = EXTI0, priority = 2, local = [pulse, timer, stamps, last], shared = [estimator])]
    fn second(mut context: second::Context) {
        let local = context.local;
        let now = local.timer.cnt().read().bits();
        local.pulse.clear_interrupt_pending_bit();
        let Some((before, elapsed)) = *local.last else {
            *local.last = Some((now, 0));
            return;
        };
        let counted = now.wrapping_sub(before);
        let elapsed = elapsed + u64::from(counted);
        let missing = match local.stamps.missing(elapsed) {
            Ok(missing) => missing,
            Err(error) => return defmt::warn!("spurious pulse: {}", error),
        };
        *local.last = Some((now, elapsed));
        context.shared.estimator.lock(|estimator| {
            if missing > 0 {
                // The clock's error over several seconds is that of none of them.
                estimator.gap(missing + 1);
            } else if let Ok(error) = integer_count(counted, CLOCK) {
                estimator.push(error);
            }
            if estimator.len() % 60 == 0 {
                // An error says that the task is still running, and prints the numbers of now.
                let _ = report::spawn();
            }
        });
    }

    #[task(priority = 1, shared = [estimator])]
    async fn report(mut context: report::Context) {
        // The lock keeps the pulse out during the copy alone.
        let snapshot = context.shared.estimator.lock(|estimator| estimator.snapshot());
        let curve = snapshot.curve(1.0).scaled(1.0 / f64::from(CLOCK));
        for point in curve.points() {
            defmt::println!(
                "{} s: variance of the frequency {} ({} to {})",
                point.tau,
                point.avar,
                point.low,
                point.high
            );
        }
    }
}
