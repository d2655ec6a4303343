//! The sensor's bus apart from sampling: serial clock, probing (identify, test, configure), auto-null.

use adis16405_driver::{Adis16405, Config, Diagnosis, DioSignal, Error, Product, Register, SelfTest, Timing};
use core::fmt;
use embedded_hal::delay::DelayNs;
use embedded_hal::spi::SpiDevice;

/// Largest serial clock of a burst read in Hz (ADIS16400/ADIS16405 data sheet Rev. B, page 10).
pub const BURST_LIMIT_HZ: u32 = 1_000_000;
/// Largest serial clock in the sensor's low-power mode in Hz (data sheet Rev. B, page 10).
pub(crate) const LOW_POWER_LIMIT_HZ: u32 = 300_000;

/// The largest clock of at most `limit_hz` that a divider by 2, 4, 8 … 256 makes of `bus_hz`; `None` if 256 is not enough.
///
/// HALs round a request to the nearest prescaler, which may exceed the sensor's limit.
#[must_use]
pub const fn largest_clock_hz(bus_hz: u32, limit_hz: u32) -> Option<u32> {
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
pub const fn prescaled_clock_hz(bus_hz: u32, field: u8) -> u32 {
    bus_hz.div_ceil(1 << (field as u32 % 8 + 1))
}

/// How thoroughly a sensor is probed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ProbeScope {
    /// First end an unfinished frame, and wake a sensor that sleeps, by a pulse on chip select.
    pub pulse: bool,
    /// First reset the sensor by its command.
    pub reset: bool,
    /// Run the self-test.
    pub self_test: bool,
}

/// A sensor that has passed a probe.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SensorIdentity {
    /// Product that answered.
    pub product: Product,
    /// The self-test, if it was requested.
    pub test: Option<SelfTest>,
}

/// Why a probe has failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ProbeError<E> {
    /// The bus failed, another product answered, or a register did not take its value.
    Driver(Error<E>),
    /// The self-test failed.
    SelfTest(Diagnosis),
}

impl<E> From<Error<E>> for ProbeError<E> {
    fn from(error: Error<E>) -> Self {
        Self::Driver(error)
    }
}

impl<E: fmt::Debug> fmt::Display for ProbeError<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Driver(error) => error.fmt(f),
            Self::SelfTest(diagnosis) => write!(f, "self-test failed, DIAG_STAT {:#06x}", diagnosis.bits()),
        }
    }
}

/// Identifies the sensor, runs its self-test, and configures it: range, filter, sample period, and data ready on DIO1,
/// active high. A negative bias of gyro x is moved from the sensor to the host.
///
/// # Errors
/// As [`ProbeError`] lists them.
pub fn probe<SPI: SpiDevice<u8>>(
    (bus, delay): (SPI, impl DelayNs),
    config: Config,
    scope: ProbeScope,
) -> Result<SensorIdentity, ProbeError<SPI::Error>> {
    // The sensor may be in low-power mode until it is configured.
    let mut sensor = Adis16405::new(bus, delay, config).with_stall_ns(Timing::DEFAULT.stall_ns.low_power);
    if scope.pulse {
        // Whether the sensor answers is for the steps below to find out.
        let _ = sensor.wake();
    }
    let product = if scope.reset { sensor.software_reset()? } else { sensor.init()? };
    let test = if scope.self_test { Some(sensor.self_test()?) } else { None };
    if let Some(test) = test.filter(|test| test.diagnosis.intersects(Diagnosis::SELF_TEST_FAILURES)) {
        return Err(ProbeError::SelfTest(test.diagnosis));
    }
    // With such a bias, bursts lose the sign of negative x rates (erratum). The Allan variance does not depend on the bias.
    if sensor.x_sign_at_risk() {
        sensor.keep_negative_x_bias_on_host()?;
    }
    sensor.set_data_ready(Some(DioSignal::default()))?;
    Ok(SensorIdentity { product, test })
}

/// Reads DIAG_STAT, which clears it. `None` if the sensor does not answer: the bus failed, or all bits are set, of which one
/// is not defined.
pub(crate) fn read_diagnosis<SPI: SpiDevice<u8>>(
    (bus, delay): (SPI, impl DelayNs),
    config: Config,
) -> Option<Diagnosis> {
    let answer = Adis16405::new(bus, delay, config).read_register(Register::DiagStat).ok()?;
    (answer != u16::MAX).then(|| Diagnosis::from_bits_truncate(answer))
}

/// Has the sensor store its present gyro output as the bias; it must be still.
///
/// # Errors
/// The bus failed, or the sensor does not answer afterwards.
pub fn auto_null<SPI: SpiDevice<u8>>(
    (bus, delay): (SPI, impl DelayNs),
    config: Config,
) -> Result<(), Error<SPI::Error>> {
    // The sensor may be in low-power mode.
    let stall_ns = Timing::DEFAULT.stall_ns.low_power;
    Adis16405::new(bus, delay, config).with_stall_ns(stall_ns).auto_null().map(|_offsets| ())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_clock_does_not_exceed_the_limit() {
        assert_eq!(largest_clock_hz(84_000_000, 1_000_000), Some(656_250));
        assert_eq!(largest_clock_hz(64_000_000, 1_000_000), Some(1_000_000));
        assert_eq!(largest_clock_hz(64_000_001, 1_000_000), Some(500_000));
        assert_eq!(largest_clock_hz(1_000_000, 1_000_000), Some(500_000));
        assert_eq!(largest_clock_hz(257_000_000, 1_000_000), None);
        assert_eq!(largest_clock_hz(u32::MAX, 0), None);
    }

    #[test]
    fn a_prescaler_field_is_decoded_as_in_the_reference_manual() {
        assert_eq!(prescaled_clock_hz(84_000_000, 0b000), 42_000_000);
        assert_eq!(prescaled_clock_hz(84_000_000, 0b101), 1_312_500);
        assert_eq!(prescaled_clock_hz(84_000_000, 0b110), 656_250);
        assert_eq!(prescaled_clock_hz(84_000_000, 0b111), 328_125);
    }
}
