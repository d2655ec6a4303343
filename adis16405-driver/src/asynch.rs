//! The shell over an asynchronous [`SpiDevice`], feature `async`.

use core::pin::pin;

use embedded_hal_async::delay::DelayNs;
use embedded_hal_async::spi::{Operation, SpiDevice};

use crate::alarm::{Alarm, AlarmNumber};
use crate::compensation::Compensation;
use crate::config::{Config, GyroRange};
use crate::diagnosis::Diagnosis;
use crate::driver::{Adis16405, Async};
use crate::error::Error;
use crate::frame::{BURST_BYTES, BURST_REQUEST, Burst, spaced_burst};
use crate::offset::{FactoryRestore, GyroBias};
use crate::pin::{DacLevel, Gpio, Signal};
use crate::port::{Port, Step};
use crate::product::Product;
use crate::register::Register;
use crate::sample::Sample;
use crate::self_test::{FlashTest, SelfTest, Stimulus};
use crate::session::{Refusal, Session};
use crate::shell::procedures;
use crate::sleep::Sleep;
#[cfg(doc)]
use crate::timing::Timing;

impl<SPI: SpiDevice<u8>> Adis16405<SPI, Async> {
    /// Takes the bus; nothing is sent before [`init`](Self::init).
    pub fn new_async(spi: SPI, config: Config) -> Self {
        Self::on(spi, config)
    }

    /// Reads all twelve outputs in one transaction of 26 bytes, 208 µs at 1 MHz.
    ///
    /// # Errors
    /// Only of the bus: whether the data can be believed is for [`Judge`](crate::Judge) to say.
    pub async fn burst(&mut self) -> Result<Burst, Error<SPI::Error>> {
        let mut answer = [0; BURST_BYTES];
        let stall_ns = self.state.stall_ns();
        match self.state.timing.word_gap_ns {
            0 => {
                self.spi
                    .transaction(&mut [Operation::Transfer(&mut answer, &BURST_REQUEST), Operation::DelayNs(stall_ns)])
                    .await?
            }
            gap_ns => self.spi.transaction(&mut spaced_burst(&mut answer, gap_ns, stall_ns)).await?,
        }
        Ok(Burst::from_bytes(&answer))
    }

    /// Reads a burst as a sample that knows its range and bias.
    ///
    /// # Errors
    /// Only of the bus, as [`burst`](Self::burst).
    pub async fn sample(&mut self) -> Result<Sample, Error<SPI::Error>> {
        let burst = self.burst().await?;
        Ok(self.sample_of(burst))
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
            let port = Port::new();
            run(&mut self.spi, &mut NoPause, &port, Session::new(&port, &mut self.state).$name($($passed)*)).await
        }
    };
    (@paced [$($doc:tt)*] $name:ident [] [$($declared:tt)*] [$($passed:tt)*] $output:ty) => {
        $($doc)*
        pub async fn $name(&mut self, $($declared)* delay: &mut impl DelayNs) -> Result<$output, Error<SPI::Error>> {
            let port = Port::new();
            run(&mut self.spi, delay, &port, Session::new(&port, &mut self.state).$name($($passed)*)).await
        }
    };
}
procedures!(methods);

async fn run<SPI: SpiDevice<u8>, T>(
    spi: &mut SPI,
    delay: &mut impl DelayNs,
    port: &Port,
    procedure: impl Future<Output = Result<T, Refusal>>,
) -> Result<T, Error<SPI::Error>> {
    let mut procedure = pin!(procedure);
    loop {
        match port.resume(procedure.as_mut()) {
            Ok(result) => return result.map_err(Error::over_bus),
            Err(step) => port.answer(perform(spi, delay, step).await?),
        }
    }
}

/// What all procedures share, so that it is in flash once.
#[inline(never)]
async fn perform<SPI: SpiDevice<u8>>(
    spi: &mut SPI,
    delay: &mut impl DelayNs,
    step: Step,
) -> Result<[u8; 2], SPI::Error> {
    let mut answer = [0; 2];
    match step {
        Step::Frame { request, stall_ns } => {
            spi.transaction(&mut [Operation::Transfer(&mut answer, &request), Operation::DelayNs(stall_ns)]).await?;
        }
        Step::Select { ns } => spi.transaction(&mut [Operation::DelayNs(ns)]).await?,
        Step::Pause { us } => delay.delay_us(us).await,
    }
    Ok(answer)
}

/// For procedures of frames alone.
struct NoPause;

impl DelayNs for NoPause {
    async fn delay_ns(&mut self, _: u32) {}
}
