//! The pauses between frames, the level of chip select during them, and the bus that keeps them.

use embedded_hal::spi::Operation;

/// Level of chip select during the stall between frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum SelectDuringStall {
    /// High, the default: each frame is a transaction, and the driver's delay follows (as in Linux and PX4). On a
    /// shared bus, other devices can use the time.
    #[default]
    High,
    /// Low: the stall is an [`Operation::DelayNs`] at the transaction's end; then
    /// [`Timing::select_high_ns`](crate::Timing::select_high_ns).
    Low,
}

/// Longest single delay, µs. Some HALs compute its cycles in 32 bits, which 25 s at 168 MHz overflow.
pub(crate) const LONGEST_DELAY_US: u32 = 100_000;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FramePauses {
    /// Pause with chip select low, ns.
    pub(crate) low_ns: u32,
    /// Pause with chip select high, ns.
    pub(crate) high_ns: u32,
}

impl FramePauses {
    /// The pauses after a frame whose stall is `stall_ns`; chip select is high for at least `least_high_ns`.
    pub(crate) fn new(select: SelectDuringStall, stall_ns: u32, least_high_ns: u32) -> Self {
        match select {
            SelectDuringStall::High => Self { low_ns: 0, high_ns: stall_ns.max(least_high_ns) },
            SelectDuringStall::Low => Self { low_ns: stall_ns, high_ns: least_high_ns },
        }
    }

    /// Drops the last operation, the pause with chip select low, if it is 0: devices without a delay cannot carry it
    /// out.
    pub(crate) fn operations<'a, 'b>(&self, operations: &'a mut [Operation<'b, u8>]) -> &'a mut [Operation<'b, u8>] {
        if self.low_ns > 0 {
            return operations;
        }
        operations.split_last_mut().map_or(&mut [], |(_, others)| others)
    }
}

/// The SPI device of the part, and the delay that keeps the pauses between its transactions.
#[derive(Debug)]
pub(crate) struct SensorBus<SPI, D> {
    pub(crate) spi: SPI,
    pub(crate) delay: D,
    /// Pause before the next transaction, ns; not 0 after a dropped future.
    pub(crate) pending_pause_ns: u32,
}

impl<SPI, D> SensorBus<SPI, D> {
    pub(crate) const fn new(spi: SPI, delay: D) -> Self {
        Self { spi, delay, pending_pause_ns: 0 }
    }
}
