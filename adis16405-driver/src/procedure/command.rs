//! Commands that keep the part busy: the bus is silent until they are done.

use crate::diagnosis::Diagnosis;
use crate::error::Error;
use crate::offset::{FactoryRestore, GyroBias};
use crate::register::Register;
use crate::session::{Refusal, Session};

const AUTO_NULL: u16 = 1 << 0;
const FACTORY_RESTORE: u16 = 1 << 1;
const FLASH_UPDATE: u16 = 1 << 3;
const PRECISION_AUTO_NULL: u16 = 1 << 4;

impl Session<'_> {
    /// Sends a command and leaves the bus alone.
    async fn command(&self, command: u16, silence_us: u32) {
        self.write_low(Register::GlobCmd, command).await;
        self.pause(silence_us).await;
    }

    pub(crate) async fn auto_null(&mut self) -> Result<GyroBias, Refusal> {
        self.null(AUTO_NULL, self.state.timing.auto_null_us).await
    }

    pub(crate) async fn precision_auto_null(&mut self) -> Result<GyroBias, Refusal> {
        self.null(PRECISION_AUTO_NULL, self.state.timing.precision_auto_null_us).await
    }

    /// The part sets its offsets so that the outputs become zero, with nothing added on the host; a negative one for x is
    /// then taken over.
    async fn null(&mut self, command: u16, silence_us: u32) -> Result<GyroBias, Refusal> {
        self.command(command, silence_us).await;
        self.identity().await?;
        self.state.host_bias_x = 0;
        self.keep_negative_x_bias_on_host().await
    }

    pub(crate) async fn factory_restore(&mut self) -> Result<FactoryRestore, Refusal> {
        let lost = FactoryRestore {
            gyro: self.gyro_offsets().await?,
            accl: self.accl_offsets().await?,
            hard_iron: self.hard_iron().await?,
            soft_iron: self.soft_iron().await?,
        };
        self.command(FACTORY_RESTORE, self.state.timing.factory_restore_us).await;
        self.state.host_bias_x = 0;
        self.init().await?;
        Ok(lost)
    }

    pub(crate) async fn flash_writes(&self) -> Result<u16, Refusal> {
        Ok(self.read(Register::FlashCnt).await)
    }

    pub(crate) async fn flash_update(&mut self) -> Result<u16, Refusal> {
        let before = self.flash_writes().await?;
        self.command(FLASH_UPDATE, self.state.timing.flash_update_us).await;
        let diagnosis = self.diagnosis().await?;
        let after = self.flash_writes().await?;
        if diagnosis.contains(Diagnosis::FLASH_UPDATE) || after == before {
            return Err(Error::FlashUpdate { before, after, diagnosis });
        }
        Ok(after)
    }
}
