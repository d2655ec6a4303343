//! What the application does to the sensor while it is not sampled.

use adis16405_driver::{Adis16405, Config, Diagnosis, DioSignal, Error, Product};
use core::fmt;
use embedded_hal::delay::DelayNs;
use embedded_hal::spi::SpiDevice;

/// What a sensor that answers says of itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Identity {
    /// Which part it is.
    pub product: Product,
    /// Whether the self-test was seen to run; a part that was asleep tests nothing.
    pub tested: bool,
    /// DIAG_STAT after the self-test.
    pub diagnosis: Diagnosis,
}

/// Why the sensor cannot be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trouble<E> {
    /// The driver's word.
    Driver(Error<E>),
    /// The self-test found something.
    SelfTest(Diagnosis),
}

impl<E> From<Error<E>> for Trouble<E> {
    fn from(error: Error<E>) -> Self {
        Self::Driver(error)
    }
}

impl<E: fmt::Debug> fmt::Display for Trouble<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Driver(error) => error.fmt(f),
            Self::SelfTest(diagnosis) => write!(f, "self-test failed, DIAG_STAT {:#06x}", diagnosis.bits()),
        }
    }
}

/// Identifies the sensor, tests it, and configures it: range, filter, sample period, data ready on DIO1, active high, and
/// no negative bias of gyro x.
///
/// # Errors
/// The bus failed, something else answers, the self-test failed, or a register did not take its value.
pub fn bring_up<SPI: SpiDevice<u8>>(
    (bus, mut pause): (SPI, impl DelayNs),
    config: Config,
) -> Result<Identity, Trouble<SPI::Error>> {
    let mut sensor = Adis16405::new(bus, config);
    let product = sensor.init()?;
    let test = sensor.self_test(&mut pause)?;
    if test.diagnosis.intersects(Diagnosis::SELF_TEST_FAILURES) {
        return Err(Trouble::SelfTest(test.diagnosis));
    }
    // Otherwise bursts would lose the sign of negative x rates; a constant is nothing to the Allan variance.
    if sensor.x_sign_at_risk() {
        sensor.keep_negative_x_bias_on_host()?;
    }
    sensor.set_data_ready(Some(DioSignal::default()))?;
    Ok(Identity { product, tested: test.ran, diagnosis: test.diagnosis })
}

/// Has the sensor take its present gyro output for the bias; it must be still.
///
/// # Errors
/// The bus failed, or the sensor does not answer afterwards.
pub fn auto_null<SPI: SpiDevice<u8>>(
    (bus, mut pause): (SPI, impl DelayNs),
    config: Config,
) -> Result<(), Error<SPI::Error>> {
    Adis16405::new(bus, config).auto_null(&mut pause).map(|_offsets| ())
}
