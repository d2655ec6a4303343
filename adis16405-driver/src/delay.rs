//! One delay for the SPI device and for the driver.

use core::cell::RefCell;

use embedded_hal::delay::DelayNs;

/// Shares a delay that can be neither cloned nor made twice: `&SharedDelay` is a [`DelayNs`] too. The SPI device needs
/// a delay beside the driver for [`wake`](crate::Adis16405::wake),
/// [`SelectDuringStall::Low`](crate::SelectDuringStall::Low) and [`Timing::word_gap_ns`](crate::Timing::word_gap_ns).
///
/// ```
/// # use embedded_hal::{delay::DelayNs, digital::OutputPin, spi::SpiBus};
/// use adis16405_driver::{Adis16405, Config, SharedDelay};
/// use embedded_hal_bus::spi::ExclusiveDevice;
/// # fn build<B: SpiBus<u8>, P: OutputPin, D: DelayNs>(bus: B, chip_select: P, timer: D) {
/// let delay = SharedDelay::new(timer);
/// let device = ExclusiveDevice::new(bus, chip_select, &delay).unwrap();
/// let mut imu = Adis16405::new(device, &delay, Config::default());
/// let started = imu.start_up();
/// # let _ = started.is_ok(); }
/// ```
#[derive(Debug)]
pub struct SharedDelay<D>(RefCell<D>);

impl<D> SharedDelay<D> {
    /// A delay that is used by reference.
    pub const fn new(delay: D) -> Self {
        Self(RefCell::new(delay))
    }

    /// Returns the delay.
    pub fn release(self) -> D {
        self.0.into_inner()
    }
}

// The borrows end with each call, so that they cannot overlap.
impl<D: DelayNs> DelayNs for &SharedDelay<D> {
    fn delay_ns(&mut self, ns: u32) {
        self.0.borrow_mut().delay_ns(ns);
    }

    fn delay_us(&mut self, us: u32) {
        self.0.borrow_mut().delay_us(us);
    }

    fn delay_ms(&mut self, ms: u32) {
        self.0.borrow_mut().delay_ms(ms);
    }
}
