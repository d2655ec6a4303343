//! The sensor's bus outside of sampling: clock, probe, auto-null.

use adis16405_driver::{
    Adis16405, Channel, Config, Diagnosis, DioSignal, Error, GyroBias, Product, Register, SelfTest, Timing,
};
use core::fmt;
use embedded_hal::delay::DelayNs;
use embedded_hal::spi::SpiDevice;

/// Largest serial clock of a burst read in Hz (ADIS16400/ADIS16405 data sheet Rev. B, page 10).
pub const BURST_LIMIT_HZ: u32 = 1_000_000;
/// Largest serial clock in the sensor's low-power mode in Hz (data sheet Rev. B, page 10).
pub(crate) const LOW_POWER_LIMIT_HZ: u32 = 300_000;

/// The field of CR1 for the largest clock of at most `limit_hz`, or for the slowest one, and that clock in Hz, rounded
/// up: `bus_hz` over `2^(field + 1)`. Some HALs round the requested clock up, above the sensor's limit.
pub fn prescaled_clock(bus_hz: u32, limit_hz: u32) -> (u8, u32) {
    let clock_hz = |field: u8| bus_hz.div_ceil(2 << field);
    let field = (0..8).find(|&field| clock_hz(field) <= limit_hz).unwrap_or(7);
    (field, clock_hz(field))
}

/// The scope of a probe.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ProbeScope {
    /// End an unfinished frame, and wake a sleeping sensor, by a pulse on chip select first.
    pub pulse: bool,
    /// Reset the sensor by its command first.
    pub reset: bool,
    /// Run the self-test.
    pub self_test: bool,
}

/// A driver for either power mode: with the low-power stall at `sck_hz`.
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

/// Outcome of a self-test, `None` if it did not end. Samples are used after each outcome, since motion fails it too (data
/// sheet Rev. B, page 15).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TestOutcome(Option<SelfTest>);

impl TestOutcome {
    pub(crate) fn passed(self) -> bool {
        self.0.is_some_and(|test| test.passed())
    }

    pub(crate) fn failed_sensors(self) -> impl Iterator<Item = Channel> {
        self.0.into_iter().flat_map(|test| test.diagnosis.failed_sensors())
    }

    fn name(self) -> &'static str {
        match self.0 {
            Some(test) if test.passed() => "passed",
            Some(test) if test.ran => "failed",
            Some(_) => "did not run",
            None => "did not end",
        }
    }
}

#[cfg(all(target_os = "none", feature = "microcontroller"))]
impl defmt::Format for TestOutcome {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "{=str}", self.name());
        self.failed_sensors().for_each(|channel| defmt::write!(f, " {=str}", channel.name()));
    }
}

impl fmt::Display for TestOutcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())?;
        let Some(test) = self.0 else { return Ok(()) };
        write!(f, ", DIAG_STAT {:#06x}", test.diagnosis.bits())?;
        if self.name() != "failed" {
            return Ok(());
        }
        f.write_str(":")?;
        self.failed_sensors().try_for_each(|channel| write!(f, " {}", channel.name()))
    }
}

/// Identifies the sensor (also by `prod_id`, unless 0), tests and configures it: range, filter, period, data ready on
/// DIO1, active high. A negative bias of gyro x moves to the host.
///
/// # Errors
/// The bus failed, another product answered, or a register did not take its value. A failed self-test is not an error.
pub fn probe<SPI: SpiDevice<u8>>(
    bus: (SPI, impl DelayNs),
    config: Config,
    sck_hz: u32,
    scope: ProbeScope,
    prod_id: u16,
) -> Result<SensorIdentity, Error<SPI::Error>> {
    // The sensor may be in low-power mode.
    let mut sensor = addressed(bus, config, sck_hz);
    if prod_id != 0 {
        sensor = sensor.with_prod_id(prod_id);
    }
    if scope.pulse {
        // The result of the pulse does not matter: `init` checks that the sensor answers.
        let _ = sensor.wake();
    }
    let product = if scope.reset { sensor.software_reset()? } else { sensor.init()? };
    let test = match scope.self_test.then(|| sensor.self_test()) {
        None => None,
        Some(Ok(test)) => Some(TestOutcome(Some(test))),
        Some(Err(Error::Deadline { .. })) => Some(TestOutcome(None)),
        Some(Err(error)) => return Err(error),
    };
    sensor.set_data_ready(Some(DioSignal::default()))?;
    Ok(SensorIdentity { product, test })
}

/// Reads and so clears DIAG_STAT; `None` if the bus failed or all bits are set, one of which is undefined.
pub(crate) fn read_diagnosis<SPI: SpiDevice<u8>>(
    (bus, delay): (SPI, impl DelayNs),
    config: Config,
) -> Option<Diagnosis> {
    let answer = Adis16405::new(bus, delay, config).read_register(Register::DiagStat).ok()?;
    (answer != u16::MAX).then(|| Diagnosis::from_bits_truncate(answer))
}

/// Makes the sensor store its present gyro output as the bias; it must be still. Returns the correction. A negative one
/// of x is not applied.
///
/// # Errors
/// The bus failed, or the sensor does not answer afterwards.
pub fn auto_null<SPI: SpiDevice<u8>>(
    bus: (SPI, impl DelayNs),
    config: Config,
    sck_hz: u32,
) -> Result<GyroBias, Error<SPI::Error>> {
    addressed(bus, config, sck_hz).auto_null()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The field 0b000 divides by 2, 0b111 by 256 (RM0090 section 28.5.1).
    #[test]
    fn the_clock_does_not_exceed_the_limit() {
        assert_eq!(prescaled_clock(84_000_000, 1_000_000), (0b110, 656_250));
        assert_eq!(prescaled_clock(84_000_000, 2_000_000), (0b101, 1_312_500));
        assert_eq!(prescaled_clock(84_000_000, 42_000_000), (0b000, 42_000_000));
        assert_eq!(prescaled_clock(64_000_000, 1_000_000), (0b101, 1_000_000));
        assert_eq!(prescaled_clock(64_000_001, 1_000_000), (0b110, 500_001));
        assert_eq!(prescaled_clock(257_000_000, 1_000_000), (0b111, 1_003_907), "none is slow enough");
    }
}
