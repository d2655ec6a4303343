//! N of a sensor once a minute: SysTick reads a sample, the main loop prints the Allan deviation and the fit.
//!
//! No wiring: the sensor is a pseudo-random generator. Replace `read_sensor` by a read of your own.
#![no_std]
#![no_main]

use allan_core::{Cascade, NoiseTerm, fit::fit_power_laws};
use core::cell::RefCell;
use cortex_m::{Peripherals, peripheral::syst::SystClkSource};
use cortex_m_rt::{entry, exception};
use critical_section::Mutex;
use {defmt_rtt as _, panic_probe as _};

const RATE: u32 = 100; // samples a second
const CLOCK: u32 = 16_000_000; // the STM32F405 starts with its internal oscillator
const LSB: f64 = 0.05; // deg/s per count

static ESTIMATOR: Mutex<RefCell<Cascade<20, 8>>> = Mutex::new(RefCell::new(Cascade::new()));

/// White noise with a standard deviation of 100/√12 counts, by the generator of S. Park and K. Miller (1988).
fn read_sensor(state: &mut u64) -> i32 {
    *state = *state * 16_807 % 2_147_483_647;
    (*state % 100) as i32
}

#[exception]
fn SysTick() {
    static mut STATE: u64 = 1;
    let sample = read_sensor(STATE);
    critical_section::with(|section| ESTIMATOR.borrow_ref_mut(section).push(sample));
}

#[entry]
fn main() -> ! {
    if let Some(peripherals) = Peripherals::take() {
        let mut timer = peripherals.SYST;
        timer.set_clock_source(SystClkSource::Core);
        timer.set_reload(CLOCK / RATE - 1);
        timer.enable_counter();
        timer.enable_interrupt();
    }
    loop {
        cortex_m::asm::delay(60 * CLOCK);
        // The interrupt waits for the copy alone; a curve takes millions of instructions.
        let snapshot = critical_section::with(|section| ESTIMATOR.borrow_ref(section).snapshot());
        let curve = snapshot.curve_without_confidence(1.0 / f64::from(RATE)).scaled(LSB);
        let model = fit_power_laws(&curve, &NoiseTerm::BASELINE);
        if let Some(n) = model.get(NoiseTerm::AngleRandomWalk) {
            defmt::println!("N = {} ({} to {}) deg/√s after {} samples", n.value, n.low, n.high, snapshot.len());
        }
    }
}
