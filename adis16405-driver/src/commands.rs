//! Procedures on the whole part: identification, start-up, configuration, GLOB_CMD, sleep.

use core::num::NonZeroU8;

use crate::calibration::{FactoryRestore, GyroBias};
use crate::channel::GyroRange;
use crate::clock::{ClockMode, SampleClock, SamplePeriod};
use crate::config::Config;
use crate::error::{Diagnosis, Error, FlashUpdate};
use crate::protocol::{Protocol, ProtocolError, WriteOrder};
use crate::register::Register;

/// A supported part; both differ only in the temperature range of their calibration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Product {
    /// ADIS16400, PROD_ID 0x4010.
    Adis16400,
    /// ADIS16405, PROD_ID 0x4015.
    Adis16405,
}

impl Product {
    /// The part with this value in PROD_ID; `None` for other parts.
    pub const fn from_prod_id(prod_id: u16) -> Option<Self> {
        match prod_id {
            16400 => Some(Product::Adis16400),
            16405 => Some(Product::Adis16405),
            _ => None,
        }
    }

    /// The value of PROD_ID: the part number in decimal.
    pub const fn prod_id(self) -> u16 {
        match self {
            Product::Adis16400 => 16400,
            Product::Adis16405 => 16405,
        }
    }
}

/// Duration of a sleep (SLP_CNT).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Sleep {
    /// This number of half seconds; the part then wakes up by itself.
    HalfSeconds(NonZeroU8),
    /// Until the part is woken, reset or powered on again (bit 8; data sheet Rev. B, page 13).
    Indefinite,
}

/// The bits of GLOB_CMD.
const AUTO_NULL: u16 = 1 << 0;
const FACTORY_RESTORE: u16 = 1 << 1;
const FLASH_UPDATE: u16 = 1 << 3;
const PRECISION_AUTO_NULL: u16 = 1 << 4;
const SOFTWARE_RESET: u16 = 1 << 7;

/// The bit of GPIO_CTRL that makes DIO4 an output.
const DIO4_IS_OUTPUT: u16 = 1 << 3;

/// The bit of SLP_CNT for a sleep without end.
const SLEEP_INDEFINITELY: u16 = 1 << 8;

impl Protocol<'_> {
    pub(crate) async fn identity(&self) -> Result<Product, ProtocolError> {
        let answer = self.read(Register::ProdId).await;
        let overridden = (self.state.prod_id == Some(answer)).then_some(Product::Adis16405);
        Product::from_prod_id(answer).or(overridden).ok_or(Error::Product { answer })
    }

    pub(crate) async fn diagnosis(&self) -> Result<Diagnosis, ProtocolError> {
        Ok(Diagnosis::from_bits_retain(self.read(Register::DiagStat).await))
    }

    pub(crate) async fn init(&mut self) -> Result<Product, ProtocolError> {
        self.state.assume_low_power_until_read();
        let product = self.identity().await?;
        if self.state.stimulated {
            self.stop_stimulus().await?;
        }
        self.configure(self.state.config).await?;
        self.keep_negative_x_bias_on_host().await?;
        Ok(product)
    }

    pub(crate) async fn start_up(&mut self) -> Result<Product, ProtocolError> {
        self.state.mark_registers_unknown();
        self.pause(self.state.timing.start_up_us).await;
        self.init().await
    }

    pub(crate) async fn configure(&mut self, config: Config) -> Result<(), ProtocolError> {
        self.state.configured = false;
        let mode = self.state.timing.clock_mode(config.smpl_prd());
        // The driver keeps the longer stall of low-power mode until it knows that the new sample period is set.
        if mode == ClockMode::LowPower {
            self.state.mode = mode;
        }
        self.set_register(Register::SmplPrd, u16::from(config.smpl_prd())).await?;
        self.state.mode = mode;

        // A clock at DIO4 needs the line as an input.
        if matches!(config.sample_clock(), SampleClock::External) {
            self.update_register(Register::GpioCtrl, DIO4_IS_OUTPUT, 0).await?;
        }

        // SENS_AVG: the upper byte (range) goes first, since it can change the lower one, the filter (data sheet Rev.
        // B, page 14).
        let before = self.read(Register::SensAvg).await;
        // The configuration is stored before the write: after an interruption the part more likely has the new range.
        self.state.config = config;
        self.update_from(Register::SensAvg, before, u16::MAX, config.sens_avg(), WriteOrder::HighByteFirst).await?;
        self.state.configured = true;
        Ok(())
    }

    pub(crate) async fn set_sample_period(&mut self, period: SamplePeriod) -> Result<(), ProtocolError> {
        self.configure(self.state.config.with_sample_period(period)).await
    }

    pub(crate) async fn set_sample_rate(&mut self, hz: f64) -> Result<f64, ProtocolError> {
        let period = SamplePeriod::nearest(hz)?;
        self.set_sample_period(period).await?;
        Ok(period.hz())
    }

    pub(crate) async fn set_range(&mut self, range: GyroRange) -> Result<(), ProtocolError> {
        let config = self.state.config.with_range(range)?;
        self.configure(config).await
    }

    pub(crate) async fn set_filter_taps_log2(&mut self, filter_taps_log2: u8) -> Result<(), ProtocolError> {
        let config = self.state.config.with_filter_taps_log2(filter_taps_log2)?;
        self.configure(config).await
    }

    async fn command(&self, command: u16, silence_us: u32) {
        self.write_low(Register::GlobCmd, command).await;
        self.pause(silence_us).await;
    }

    pub(crate) async fn software_reset(&mut self) -> Result<Product, ProtocolError> {
        self.state.assume_low_power_until_read();
        self.write_low(Register::GlobCmd, SOFTWARE_RESET).await;
        self.state.mark_registers_unknown();
        self.pause(self.state.timing.reset_us).await;
        self.init().await
    }

    pub(crate) async fn auto_null(&mut self) -> Result<GyroBias, ProtocolError> {
        self.run_auto_null(AUTO_NULL, self.state.timing.auto_null_us).await
    }

    pub(crate) async fn precision_auto_null(&mut self) -> Result<GyroBias, ProtocolError> {
        self.run_auto_null(PRECISION_AUTO_NULL, self.state.timing.precision_auto_null_us).await
    }

    /// Runs an auto-null; a negative offset of x becomes the host-side bias.
    async fn run_auto_null(&mut self, command: u16, silence_us: u32) -> Result<GyroBias, ProtocolError> {
        self.write_low(Register::GlobCmd, command).await;
        // Set before the pause, in case the procedure is interrupted: XGYRO_OFF may become negative.
        self.state.host_bias_x = 0;
        self.state.x_sign_at_risk = true;
        self.pause(silence_us).await;
        self.identity().await?;
        self.keep_negative_x_bias_on_host().await
    }

    pub(crate) async fn factory_restore(&mut self) -> Result<FactoryRestore, ProtocolError> {
        let lost = FactoryRestore {
            gyro: self.gyro_offsets().await?,
            accl: self.accl_offsets().await?,
            hard_iron: self.hard_iron().await?,
        };
        self.command(FACTORY_RESTORE, self.state.timing.factory_restore_us).await;
        self.state.host_bias_x = 0;
        self.init().await?;
        Ok(lost)
    }

    pub(crate) async fn flash_writes(&self) -> Result<u16, ProtocolError> {
        Ok(self.read(Register::FlashCnt).await)
    }

    pub(crate) async fn flash_update(&mut self) -> Result<FlashUpdate, ProtocolError> {
        // A failure of an earlier update may still be flagged.
        let before = self.diagnosis().await?;
        let writes_before = self.flash_writes().await?;
        self.command(FLASH_UPDATE, self.state.timing.flash_update_us).await;
        let diagnosis = self.diagnosis().await?;
        let writes = self.flash_writes().await?;
        let outcome = FlashUpdate { before, writes_before, writes, diagnosis };
        if diagnosis.contains(Diagnosis::FLASH_UPDATE) || writes == writes_before {
            return Err(Error::FlashUpdate(outcome));
        }
        Ok(outcome)
    }

    pub(crate) async fn sleep(&self, sleep: Sleep) -> Result<(), ProtocolError> {
        match sleep {
            Sleep::HalfSeconds(count) => self.write_low(Register::SlpCnt, u16::from(count.get())).await,
            Sleep::Indefinite => self.write_high(Register::SlpCnt, SLEEP_INDEFINITELY).await,
        }
        Ok(())
    }

    pub(crate) async fn wake(&self) -> Result<Product, ProtocolError> {
        self.chip_select_pulse(self.state.timing.wake_pulse_ns).await;
        self.pause(self.state.timing.wake_us.get(self.state.mode)).await;
        self.identity().await
    }
}
