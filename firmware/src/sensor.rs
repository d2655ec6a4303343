//! The sensor's bus apart from sampling: serial clock, probing (identify, test, configure), auto-null.

use adis16405_driver::{Adis16405, Channel, Config, Diagnosis, DioSignal, Error, Product, Register, Timing};
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

/// The sensor as it is addressed while its power mode may be either: with the stall of low-power mode, at a serial clock of
/// `sck_hz`.
pub(crate) fn addressed<SPI: SpiDevice<u8>, D: DelayNs>(
    (bus, delay): (SPI, D),
    config: Config,
    sck_hz: u32,
) -> Adis16405<SPI, D> {
    Adis16405::new(bus, delay, config).with_stall_ns(Timing::DEFAULT.stall_ns.low_power).with_sck_hz(sck_hz)
}

/// A sensor that has passed a probe.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SensorIdentity {
    /// Product that answered.
    pub product: Product,
    /// The self-test, if it was requested.
    pub test: Option<TestOutcome>,
}

/// How a self-test has ended. None of the outcomes says that samples are of no use: a test fails under motion too (data sheet
/// Rev. B, page 15: zero motion gives results that are more reliable).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TestOutcome {
    /// It has ended with these flags, those of failed sensors among them.
    Ended(Diagnosis),
    /// It was not seen to run; these are the flags.
    NotSeen(Diagnosis),
    /// It did not end.
    Endless,
}

impl TestOutcome {
    /// Whether it has run and no sensor has failed.
    #[must_use]
    pub fn passed(self) -> bool {
        matches!(self, Self::Ended(diagnosis) if !diagnosis.intersects(Diagnosis::SELF_TEST_FAILURES))
    }

    /// The sensors that have failed.
    pub fn failed_sensors(self) -> impl Iterator<Item = Channel> {
        let diagnosis = match self {
            Self::Ended(diagnosis) | Self::NotSeen(diagnosis) => diagnosis,
            Self::Endless => Diagnosis::empty(),
        };
        diagnosis.failed_sensors()
    }
}

impl fmt::Display for TestOutcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Ended(diagnosis) if self.passed() => write!(f, "passed, DIAG_STAT {:#06x}", diagnosis.bits()),
            Self::Ended(diagnosis) => {
                write!(f, "failed, DIAG_STAT {:#06x}:", diagnosis.bits())?;
                self.failed_sensors().try_for_each(|channel| write!(f, " {}", channel.name()))
            }
            Self::NotSeen(diagnosis) => write!(f, "did not run, DIAG_STAT {:#06x}", diagnosis.bits()),
            Self::Endless => write!(f, "did not end"),
        }
    }
}

/// Identifies the sensor, by `prod_id` too unless that is 0, runs its self-test, and configures it: range, filter, sample period, and data ready on DIO1,
/// active high. A negative bias of gyro x is moved from the sensor to the host.
///
/// # Errors
/// The bus failed, another product answered, or a register did not take its value. A self-test that fails is none.
pub fn probe<SPI: SpiDevice<u8>>(
    bus: (SPI, impl DelayNs),
    config: Config,
    sck_hz: u32,
    scope: ProbeScope,
    prod_id: u16,
) -> Result<SensorIdentity, Error<SPI::Error>> {
    // The sensor may be in low-power mode until it is configured.
    let mut sensor = addressed(bus, config, sck_hz);
    if prod_id != 0 {
        sensor = sensor.with_prod_id(prod_id);
    }
    if scope.pulse {
        // Whether the sensor answers is for the steps below to find out.
        let _ = sensor.wake();
    }
    let product = if scope.reset { sensor.software_reset()? } else { sensor.init()? };
    let test = if scope.self_test { Some(self_test(&mut sensor)?) } else { None };
    // With such a bias, bursts lose the sign of negative x rates (erratum). The Allan variance does not depend on the bias.
    if sensor.x_sign_at_risk() {
        sensor.keep_negative_x_bias_on_host()?;
    }
    sensor.set_data_ready(Some(DioSignal::default()))?;
    Ok(SensorIdentity { product, test })
}

fn self_test<SPI: SpiDevice<u8>>(sensor: &mut Adis16405<SPI, impl DelayNs>) -> Result<TestOutcome, Error<SPI::Error>> {
    match sensor.self_test() {
        Ok(test) if test.ran => Ok(TestOutcome::Ended(test.diagnosis)),
        Ok(test) => Ok(TestOutcome::NotSeen(test.diagnosis)),
        Err(Error::Deadline { .. }) => Ok(TestOutcome::Endless),
        Err(error) => Err(error),
    }
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
    bus: (SPI, impl DelayNs),
    config: Config,
    sck_hz: u32,
) -> Result<(), Error<SPI::Error>> {
    addressed(bus, config, sck_hz).auto_null().map(|_offsets| ())
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
