//! The Cortex-M core: sleep, SysTick as the cycle counter, load figures, and the LED, which SysTick blinks.

use crate::receive::HostPort;
use core::sync::atomic::{AtomicU32, Ordering::Relaxed};
use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use embedded_hal::digital::OutputPin;
use link::ClockSource;

/// Longest sampling interrupt in cycles; only the sampling interrupts write it.
pub static SAMPLING_CYCLES: AtomicU32 = AtomicU32::new(0);
/// Longest run of the estimators in cycles; only their interrupt writes it.
pub static ESTIMATOR_CYCLES: AtomicU32 = AtomicU32::new(0);
/// Lost bytes of each port; only the port's interrupt writes its count.
pub(super) static LOST_BYTES: [AtomicU32; HostPort::COUNT] = [const { AtomicU32::new(0) }; HostPort::COUNT];

/// SysTick interrupts a second, which wake the main loop; the reload value fits 24 bits at 168 MHz.
pub const WAKE_HZ: u32 = 16;

/// Runs `work`, which must be shorter than a period of SysTick, and keeps the largest number of cycles in `longest`.
pub fn measure(longest: &AtomicU32, work: impl FnOnce()) {
    let start = SYST::get_current();
    work();
    let end = SYST::get_current();
    let cycles = if start >= end { start - end } else { start + SYST::get_reload() + 1 - end };
    if cycles > longest.load(Relaxed) {
        longest.store(cycles, Relaxed);
    }
}

/// Counts received bytes that `port` has lost.
pub fn count_lost_bytes(port: HostPort, lost: u32) {
    let all = &LOST_BYTES[port as usize];
    all.store(all.load(Relaxed).saturating_add(lost), Relaxed);
}

/// Blinks the LED: once a second with the crystal, eight times with the internal oscillator.
pub struct Blinker<L> {
    led: L,
    half_period: u32,
    ticks: u32,
}

impl<L: OutputPin> Blinker<L> {
    /// A blinker of `led`; either level may be the bright one.
    pub fn new(led: L, clock: ClockSource) -> Self {
        let half_period = match clock {
            ClockSource::Crystal => WAKE_HZ / 2,
            ClockSource::Internal => WAKE_HZ / 16,
        };
        Self { led, half_period, ticks: 0 }
    }

    /// To be called at every interrupt of SysTick.
    pub fn tick(&mut self) {
        let high = (self.ticks / self.half_period).is_multiple_of(2);
        let _infallible_on_these_pins = if high { self.led.set_high() } else { self.led.set_low() };
        self.ticks = self.ticks.wrapping_add(1);
    }
}

/// Starts SysTick with [`WAKE_HZ`] interrupts a second.
pub fn start_systick(mut systick: SYST, core_hz: u32) {
    systick.set_clock_source(SystClkSource::Core);
    systick.set_reload(core_hz / WAKE_HZ - 1);
    systick.clear_current();
    systick.enable_interrupt();
    systick.enable_counter();
}

/// Largest depth and size of the stack in bytes. The depth ends at the last word of the start-up pattern.
pub(super) fn stack() -> (u32, u32) {
    unsafe extern "C" {
        static _stack_start: u32;
        static _stack_end: u32;
    }
    /// The pattern of cortex-m-rt's `paint-stack`.
    const PAINT: u32 = 0xCCCC_CCCC;
    let (start, end) = (&raw const _stack_start as usize, &raw const _stack_end as usize);
    // SAFETY: the stack lies between these linker symbols and is readable RAM.
    let is_painted = |&address: &usize| unsafe { (address as *const u32).read_volatile() } == PAINT;
    let size = start - end;
    ((size - (end..start).step_by(4).take_while(is_painted).count() * 4) as u32, size as u32)
}
