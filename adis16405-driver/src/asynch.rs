//! The methods of the driver over an asynchronous [`SpiDevice`] (feature `async`).

use crate::driver::Async;
use crate::fronts::front;
use embedded_hal_async::delay::DelayNs;
use embedded_hal_async::digital::Wait;
use embedded_hal_async::spi::{Operation, SpiDevice};

front!(Async, new_async, [async], [.await]);

impl<SPI: SpiDevice<u8>, D: DelayNs> Adis16405<SPI, D, Async> {
    /// Waits until `line`, the data-ready input, is high, then [`read`](Self::read)s: one sample per pulse. If [data
    /// ready is active low](Self::set_data_ready), pass an inverted input.
    ///
    /// A pulse is high for 100 to 200 µs (data sheet Rev. B, page 14). A burst takes at least 208 µs, so no pulse is
    /// read twice:
    ///
    /// - A pulse before the call is read at once.
    /// - A pulse during a read is read next if the line is still high. If its sample was in the burst already, the next
    ///   burst has [`Faults::NO_NEW_DATA`](crate::Faults::NO_NEW_DATA).
    /// - A pulse between two calls is lost with its sample: compare the times of samples with the sample period.
    /// - A line that stays high gives [`Faults::NO_NEW_DATA`](crate::Faults::NO_NEW_DATA). A line that stays low needs
    ///   a timeout; a future that is dropped while it waits has sent nothing.
    ///
    /// # Errors
    /// [`Error::Pin`] if the line cannot be waited for, and those of [`read`](Self::read).
    pub async fn read_on(&mut self, line: &mut impl Wait) -> Result<ImuSample, Error<SPI::Error>> {
        line.wait_for_high().await.map_err(|_| Error::Pin)?;
        self.read().await
    }
}
