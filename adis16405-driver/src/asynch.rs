//! The methods of the driver over an asynchronous [`SpiDevice`] (feature `async`).

use core::pin::pin;
use core::task::Poll;

use embedded_hal_async::delay::DelayNs;
use embedded_hal_async::spi::{Operation, SpiDevice};

use crate::alarms::{Alarm, AlarmNumber};
use crate::burst::{BURST_BYTES, BURST_REQUEST, Burst, burst_with_gaps};
use crate::calibration::{FactoryRestore, GyroBias, OnChipCompensation};
use crate::channel::GyroRange;
use crate::clock::SamplePeriod;
#[cfg(doc)]
use crate::clock::Timing;
use crate::commands::{Product, Sleep};
use crate::config::Config;
use crate::driver::{Adis16405, Async, procedures};
use crate::error::{Diagnosis, Error, FlashUpdate};
use crate::pins::{DacLevel, DioSignal, Gpio};
use crate::protocol::{BusRequest, Protocol, ProtocolError, RequestSlot, resume};
use crate::register::Register;
use crate::sample::ImuSample;
use crate::self_test::{FlashTest, SelfTest, Stimulus};

impl<SPI: SpiDevice<u8>> Adis16405<SPI, Async> {
    /// A driver on `spi` for a part that is to be configured with `config`. Nothing is sent before
    /// [`init`](Self::init).
    pub fn new_async(spi: SPI, config: Config) -> Self {
        Self::with_state(spi, config)
    }

    /// Reads all twelve outputs in one transaction of 26 bytes, 208 µs at 1 MHz.
    ///
    /// # Errors
    /// [`Error::Spi`]. Whether the data are usable is for [`read`](Self::read) or a
    /// [`BurstValidator`](crate::BurstValidator) to decide.
    pub async fn burst(&mut self) -> Result<Burst, Error<SPI::Error>> {
        let mut answer = [0; BURST_BYTES];
        let stall_ns = self.state.stall_ns();
        match self.state.timing.word_gap_ns {
            0 => {
                self.spi
                    .transaction(&mut [Operation::Transfer(&mut answer, &BURST_REQUEST), Operation::DelayNs(stall_ns)])
                    .await
            }
            gap_ns => self.spi.transaction(&mut burst_with_gaps(&mut answer, gap_ns, stall_ns)).await,
        }
        .map_err(Error::Spi)?;
        Ok(Burst::from_bytes(&answer))
    }

    /// Reads a burst, validates it together with the bursts that this method has read before
    /// ([`BurstValidator`](crate::BurstValidator)), and returns it as a sample. Call it at every data-ready edge.
    ///
    /// [`burst`](Self::burst) and [`sample_from`](Self::sample_from) give the sample without a check.
    ///
    /// # Errors
    /// [`Error::Unusable`] with the faults of the burst, [`Error::NotReady`] if the driver [is not](Self::is_ready),
    /// [`Error::Spi`].
    pub async fn read(&mut self) -> Result<ImuSample, Error<SPI::Error>> {
        if !self.is_ready() {
            return Err(Error::NotReady);
        }
        let burst = self.burst().await?;
        self.checked_sample(burst).map_err(Error::Unusable)
    }
}

macro_rules! methods {
    ($(
        $(#[$doc:meta])*
        $pace:ident fn $name:ident $([const $length:ident: usize])? ($($argument:ident: $type:ty),*) -> $output:ty;
    )*) => {
        impl<SPI: SpiDevice<u8>> Adis16405<SPI, Async> {
            $(methods! {
                @$pace [$(#[$doc])*] $name [$(const $length: usize)?] [$($argument: $type,)*] [$($argument),*] $output
            })*
        }
    };
    (@framed [$($doc:tt)*] $name:ident [$($n:tt)*] [$($declared:tt)*] [$($passed:tt)*] $output:ty) => {
        $($doc)*
        pub async fn $name<$($n)*>(&mut self, $($declared)*) -> Result<$output, Error<SPI::Error>> {
            let slot = RequestSlot::new();
            run(&mut self.spi, &mut NoPause, &slot, Protocol::new(&slot, &mut self.state).$name($($passed)*)).await
        }
    };
    (@paced [$($doc:tt)*] $name:ident [] [$($declared:tt)*] [$($passed:tt)*] $output:ty) => {
        $($doc)*
        pub async fn $name(&mut self, $($declared)* delay: &mut impl DelayNs) -> Result<$output, Error<SPI::Error>> {
            let slot = RequestSlot::new();
            run(&mut self.spi, delay, &slot, Protocol::new(&slot, &mut self.state).$name($($passed)*)).await
        }
    };
    (@stimulating [$($doc:tt)*] $name:ident [] [$($declared:tt)*] [$($passed:tt)*] $output:ty) => {
        $($doc)*
        pub async fn $name(&mut self, $($declared)* delay: &mut impl DelayNs) -> Result<$output, Error<SPI::Error>> {
            let slot = RequestSlot::new();
            let mut protocol = Protocol::new(&slot, &mut self.state);
            let result = run(&mut self.spi, delay, &slot, protocol.$name($($passed)*)).await;
            if self.state.stimulated {
                // The first error is the one to report; the state tells whether this attempt has succeeded.
                let _ = self.stop_stimulus().await;
            }
            result
        }
    };
}
procedures!(methods);

/// Runs a procedure to its end.
async fn run<SPI: SpiDevice<u8>, T>(
    spi: &mut SPI,
    delay: &mut impl DelayNs,
    slot: &RequestSlot,
    procedure: impl Future<Output = Result<T, ProtocolError>>,
) -> Result<T, Error<SPI::Error>> {
    let mut procedure = pin!(procedure);
    loop {
        match resume(procedure.as_mut()) {
            Poll::Ready(result) => return result.map_err(Error::with_bus_error),
            Poll::Pending => perform(spi, delay, slot).await.map_err(Error::Spi)?,
        }
    }
}

/// Carries out the request in the slot and responds to it. Not inlined, so that all methods share one copy in flash.
#[inline(never)]
async fn perform<SPI: SpiDevice<u8>>(
    spi: &mut SPI,
    delay: &mut impl DelayNs,
    slot: &RequestSlot,
) -> Result<(), SPI::Error> {
    let mut answer = [0; 2];
    match slot.placed() {
        BusRequest::Frame { bytes, stall_ns } => {
            spi.transaction(&mut [Operation::Transfer(&mut answer, &bytes), Operation::DelayNs(stall_ns)]).await?;
        }
        BusRequest::ChipSelectPulse { ns } => spi.transaction(&mut [Operation::DelayNs(ns)]).await?,
        BusRequest::Pause { us } => delay.delay_us(us).await,
    }
    slot.respond(answer);
    Ok(())
}

/// The delay of methods whose procedure requests no pause.
struct NoPause;

impl DelayNs for NoPause {
    async fn delay_ns(&mut self, _: u32) {}
}
