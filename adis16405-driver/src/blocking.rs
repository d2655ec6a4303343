//! The methods of the driver over a blocking [`SpiDevice`].

use crate::driver::Blocking;
use crate::fronts::front;
use embedded_hal::delay::DelayNs;
use embedded_hal::spi::{Operation, SpiDevice};

front!(Blocking, new, [], []);
