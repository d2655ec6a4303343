//! The Cortex-M core: sleep, SysTick as the cycle counter, load figures, and the LED, which SysTick blinks.

use super::Microcontroller;
use super::settings_flash::SettingsFlash;
use crate::board::{BoardMeters, BrownOutLevel, Chip, HostPort};
use crate::settings_store::StoreError;
use core::sync::atomic::{AtomicU32, Ordering::Relaxed};
use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use embedded_hal::digital::OutputPin;
use link::ClockSource;

/// Longest sampling interrupt in cycles; written by the sampling interrupts only.
pub static SAMPLING_CYCLES: AtomicU32 = AtomicU32::new(0);
/// Longest run of the estimators in cycles; written by their interrupt only.
pub static ESTIMATOR_CYCLES: AtomicU32 = AtomicU32::new(0);
/// Received bytes that each port has lost; written by its interrupt only.
static SERIAL_OVERRUNS: [AtomicU32; HostPort::COUNT] = [const { AtomicU32::new(0) }; HostPort::COUNT];

/// Rate in Hz at which SysTick wakes the main loop, also without a sensor. At 168 MHz the reload value fits SysTick's 24 bits.
pub const WAKE_HZ: u32 = 16;

/// Runs `work` and stores the cycles that it took in `longest` if they are the most so far. `work` must take less than one
/// period of SysTick, which counts down.
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
    let overruns = &SERIAL_OVERRUNS[port as usize];
    overruns.store(overruns.load(Relaxed).saturating_add(lost), Relaxed);
}

/// An LED that blinks once a second while the clocks come from the crystal, and eight times a second while they come from the
/// internal oscillator.
pub struct Blinker<L> {
    led: L,
    /// Ticks of SysTick for which the LED is on, and then off.
    half_period: u32,
    ticks: u32,
}

impl<L: OutputPin> Blinker<L> {
    /// Blinks `led`, whichever of its levels is the bright one.
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

/// Requests of interrupts.
pub struct Interrupts {
    /// Those of the serial ports, which transmit what is queued.
    pub transmit: fn(),
    /// That of the end of a burst.
    pub end_burst: fn(),
}

/// The processor of a microcontroller.
pub struct Processor<M, R> {
    microcontroller: M,
    interrupts: Interrupts,
    reset_line: Option<R>,
}

impl<M: Microcontroller, R: OutputPin> Processor<M, R> {
    /// Starts SysTick.
    pub fn new(
        (microcontroller, core_hz): (M, u32),
        mut systick: SYST,
        interrupts: Interrupts,
        reset_line: Option<R>,
    ) -> Self {
        systick.set_clock_source(SystClkSource::Core);
        systick.set_reload(core_hz / WAKE_HZ - 1);
        systick.clear_current();
        systick.enable_interrupt();
        systick.enable_counter();
        Self { microcontroller, interrupts, reset_line }
    }
}

impl<M: Microcontroller, R: OutputPin> Chip for &mut Processor<M, R> {
    fn microseconds(&mut self) -> u32 {
        M::counter()
    }

    fn sleep(&mut self, mut clock: impl FnMut(u32)) {
        cortex_m::interrupt::free(|_| {
            clock(M::counter());
            cortex_m::asm::wfi();
            clock(M::counter());
        });
    }

    fn transmit(&mut self) {
        (self.interrupts.transmit)();
    }

    fn abandon_burst(&mut self) {
        (self.interrupts.end_burst)();
    }

    fn feed(&mut self) {
        self.microcontroller.feed();
    }

    fn restart(&mut self) {
        M::restart()
    }

    fn set_reset_line(&mut self, active: bool) -> bool {
        let Some(line) = &mut self.reset_line else { return false };
        if active { line.set_low() } else { line.set_high() }.is_ok()
    }

    fn program_brown_out(&mut self) -> BrownOutLevel {
        M::program_brown_out()
    }

    fn keeps_record(&mut self) -> bool {
        SettingsFlash::<M::Flash>::store().is_some()
    }

    fn read_record(&mut self, record: &mut [u8]) -> Option<usize> {
        SettingsFlash::<M::Flash>::store()?.read(record)
    }

    fn write_record(&mut self, record: &[u8]) -> Result<(), StoreError> {
        SettingsFlash::<M::Flash>::store().ok_or(StoreError::NoMemory)?.replace(record)
    }

    fn start_boot_loader(&mut self) -> bool {
        M::start_boot_loader();
        false
    }

    fn meters(&mut self) -> BoardMeters {
        let (stack_bytes, stack_size) = stack();
        BoardMeters {
            asleep_us: 0,
            serial_overruns: SERIAL_OVERRUNS.iter().map(|overruns| overruns.load(Relaxed)).fold(0, u32::saturating_add),
            sampling_cycles: SAMPLING_CYCLES.load(Relaxed),
            estimator_cycles: ESTIMATOR_CYCLES.load(Relaxed),
            stack_bytes,
            stack_size,
        }
    }
}

/// Largest depth and size of the stack in bytes. The start-up code fills the stack with a pattern; the depth is what lies
/// above the last word that still holds it, counted from the end of the stack.
fn stack() -> (u32, u32) {
    unsafe extern "C" {
        static _stack_start: u32;
        static _stack_end: u32;
    }
    /// The pattern of cortex-m-rt's feature paint-stack.
    const PAINT: u32 = 0xCCCC_CCCC;
    let (start, end) = (&raw const _stack_start as usize, &raw const _stack_end as usize);
    // SAFETY: the stack lies between these linker symbols and is readable RAM.
    let is_painted = |&address: &usize| unsafe { (address as *const u32).read_volatile() } == PAINT;
    let size = start - end;
    ((size - (end..start).step_by(4).take_while(is_painted).count() * 4) as u32, size as u32)
}
