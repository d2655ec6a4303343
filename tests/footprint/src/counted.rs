//! Instructions of a burst, of its decoding, of its validation and of its values, each counted separately.
//!
//! QEMU's `-icount shift=0` makes an instruction take 1 ns. SysTick counts at 25 MHz, so a tick is 40 instructions.

use crate::bus::Bus;
use adis16405_driver::{Adis16405, BURST_BYTES, Burst, BurstValidator, Config};
use core::hint::black_box;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::peripheral::{Peripherals, SYST};
use cortex_m_semihosting::hprintln;

const INSTRUCTIONS_PER_TICK: u32 = 40;
const WRAP: u32 = 1 << 24;
const TIMES: u32 = 1000;

pub(crate) fn count(bus: Bus) {
    let Some(peripherals) = Peripherals::take() else { return };
    let mut timer = peripherals.SYST;
    timer.set_clock_source(SystClkSource::Core);
    timer.set_reload(WRAP - 1);
    timer.clear_current();
    timer.enable_counter();

    let mut imu = Adis16405::new(bus, bus, Config::default());
    let mut validator = BurstValidator::default();
    let mut bytes = [0x80; BURST_BYTES];
    for (at, byte) in bytes.iter_mut().enumerate() {
        *byte ^= at as u8;
    }
    bytes[2..4].copy_from_slice(&[0x88, 0x14]);
    let burst = Burst::from_bytes(&bytes);
    report("words", || Burst::from_bytes(black_box(&bytes)));
    report("counts", || black_box(&burst).counts());
    report("validation", || validator.validate(black_box(&burst)));
    report("values", || {
        let sample = imu.sample_from(black_box(burst));
        (sample.gyro_dps(), sample.accl_g())
    });
    report("burst", || imu.burst());
}

/// Prints the average instructions of a run, over [`TIMES`] runs.
fn report<T>(name: &str, mut work: impl FnMut() -> T) {
    let start = SYST::get_current();
    (0..TIMES).for_each(|_| {
        black_box(work());
    });
    let ticks = start.wrapping_sub(SYST::get_current()) & (WRAP - 1);
    hprintln!("{} {}", name, ticks * INSTRUCTIONS_PER_TICK / TIMES);
}
