//! The serial clock: HALs round a request to the nearest prescaler, which may be above the sensor's limit.

/// SCK limit of a burst read in Hz (ADIS16400/ADIS16405 data sheet Rev. B, page 10).
pub const BURST_LIMIT_HZ: u32 = 1_000_000;

/// The fastest clock of at most `limit_hz` that a divider by 2, 4, 8 … 256 makes of `bus_hz`.
///
/// `None` if even 256 is not enough.
#[must_use]
pub const fn fastest_at_most(bus_hz: u32, limit_hz: u32) -> Option<u32> {
    let mut shift = 1;
    while shift <= 8 {
        if bus_hz.div_ceil(1 << shift) <= limit_hz {
            return Some(bus_hz >> shift);
        }
        shift += 1;
    }
    None
}

/// The clock that a divider by `2^(field + 1)` makes of `bus_hz`, in Hz, rounded up; `field` as in an STM32's CR1.
#[must_use]
pub const fn of_prescaler(bus_hz: u32, field: u8) -> u32 {
    bus_hz.div_ceil(1 << (field as u32 % 8 + 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_clock_is_never_above_the_limit() {
        assert_eq!(fastest_at_most(84_000_000, 1_000_000), Some(656_250));
        assert_eq!(fastest_at_most(64_000_000, 1_000_000), Some(1_000_000));
        assert_eq!(fastest_at_most(64_000_001, 1_000_000), Some(500_000));
        assert_eq!(fastest_at_most(1_000_000, 1_000_000), Some(500_000));
        assert_eq!(fastest_at_most(257_000_000, 1_000_000), None);
        assert_eq!(fastest_at_most(u32::MAX, 0), None);
    }

    #[test]
    fn a_prescaler_field_is_read_as_the_reference_manual_says() {
        assert_eq!(of_prescaler(84_000_000, 0b000), 42_000_000);
        assert_eq!(of_prescaler(84_000_000, 0b101), 1_312_500);
        assert_eq!(of_prescaler(84_000_000, 0b110), 656_250);
        assert_eq!(of_prescaler(84_000_000, 0b111), 328_125);
    }
}
