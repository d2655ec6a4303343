//! The driver: a bus, a mode, and what is remembered of the part.

use core::marker::PhantomData;

use crate::config::Config;
use crate::frame::Burst;
use crate::sample::Sample;
use crate::session::State;
use crate::timing::{ByMode, Timing};

/// Marks a driver over a blocking [`SpiDevice`](embedded_hal::spi::SpiDevice).
#[derive(Clone, Copy, Debug)]
pub enum Blocking {}

/// Marks a driver over an asynchronous `SpiDevice` of embedded-hal-async.
#[cfg(feature = "async")]
#[derive(Clone, Copy, Debug)]
pub enum Async {}

/// An ADIS16405 or ADIS16400 on an SPI bus, blocking, or asynchronous with `MODE` = `Async` of feature `async`.
///
/// Every 16-bit frame is a transaction of its own, so chip select is high between frames; the stall is part of the
/// transaction, after the frame. The device must therefore support
/// [`Operation::DelayNs`](embedded_hal::spi::Operation::DelayNs).
#[derive(Debug)]
pub struct Adis16405<SPI, MODE = Blocking> {
    pub(crate) spi: SPI,
    pub(crate) state: State,
    mode: PhantomData<MODE>,
}

impl<SPI, MODE> Adis16405<SPI, MODE> {
    pub(crate) fn on(spi: SPI, config: Config) -> Self {
        Self { spi, state: State::new(config), mode: PhantomData }
    }

    /// Sets the pause after each frame in ns, for both clock modes.
    #[must_use]
    pub fn with_stall_ns(mut self, stall_ns: u32) -> Self {
        self.state.timing.stall_ns = ByMode { normal: stall_ns, low_power: stall_ns };
        self
    }

    /// Sets all times that the driver keeps.
    #[must_use]
    pub fn with_timing(mut self, timing: Timing) -> Self {
        self.state.timing = timing;
        self.state.mode = timing.clock_mode(self.state.config.smpl_prd());
        self
    }

    /// Whether registers that were changed are read back and compared, in the bits that they have. True unless set.
    #[must_use]
    pub fn with_verified_writes(mut self, verify: bool) -> Self {
        self.state.verify = verify;
        self
    }

    /// What [`init`](Self::init) sets, or what was set since.
    pub fn config(&self) -> Config {
        self.state.config
    }

    /// The times that the driver keeps.
    pub fn timing(&self) -> Timing {
        self.state.timing
    }

    /// True if XGYRO_OFF was negative when it was last read or written by way of the typed methods: then the sign of x
    /// rates cannot be trusted once a burst was read. `keep_negative_x_bias_on_host` mends it: see
    /// [`GyroBias`](crate::GyroBias).
    pub fn x_sign_at_risk(&self) -> bool {
        self.state.sign_at_risk
    }

    /// A burst of this part as a sample, with the range and the host-side bias that hold now.
    pub fn sample_of(&self, burst: Burst) -> Sample {
        Sample::new(burst.counts(), self.state.config.range()).with_host_bias_x(self.state.host_bias_x)
    }

    /// Gives the bus back.
    pub fn release(self) -> SPI {
        self.spi
    }
}
