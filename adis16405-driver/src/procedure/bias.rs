//! Corrections that the part applies: offsets, hard and soft iron. And where the bias of gyro x goes.

use crate::error::Error;
use crate::offset::GyroBias;
use crate::register::Register;
use crate::session::{Refusal, Session};

pub(crate) const GYRO_OFF: [Register; 3] = [Register::XgyroOff, Register::YgyroOff, Register::ZgyroOff];
const ACCL_OFF: [Register; 3] = [Register::XacclOff, Register::YacclOff, Register::ZacclOff];
const HARD_IRON: [Register; 3] = [Register::XmagnHif, Register::YmagnHif, Register::ZmagnHif];
const SOFT_IRON: [Register; 3] = [Register::XmagnSif, Register::YmagnSif, Register::ZmagnSif];

/// The register's value as a signed number; what lies above its width is ignored.
fn signed(register: Register, word: u16) -> i16 {
    let shift = 16 - register.bits();
    ((word << shift) as i16) >> shift
}

fn check(register: Register, value: i16) -> Result<(), Refusal> {
    if signed(register, value as u16) == value {
        Ok(())
    } else {
        Err(Error::Value { register, value: i32::from(value) })
    }
}

impl Session<'_> {
    async fn signed_triple(&self, registers: [Register; 3]) -> [i16; 3] {
        let words = self.read_all(registers).await;
        let mut values = [0; 3];
        for (value, (register, word)) in values.iter_mut().zip(registers.into_iter().zip(words)) {
            *value = signed(register, word);
        }
        values
    }

    async fn set_signed_triple(&self, registers: [Register; 3], values: [i16; 3]) -> Result<(), Refusal> {
        for (register, value) in registers.into_iter().zip(values) {
            check(register, value)?;
        }
        for (register, value) in registers.into_iter().zip(values) {
            self.set(register, value as u16).await?;
        }
        Ok(())
    }

    pub(crate) async fn gyro_offsets(&mut self) -> Result<GyroBias, Refusal> {
        let part = self.signed_triple(GYRO_OFF).await;
        self.state.sign_at_risk = part[0] < 0;
        Ok(GyroBias { part, host_x: self.state.host_bias_x })
    }

    pub(crate) async fn set_gyro_offsets(&mut self, offsets: [i16; 3]) -> Result<GyroBias, Refusal> {
        check(Register::XgyroOff, offsets[0])?;
        let [x, y, z] = offsets;
        let part = [x.max(0), y, z];
        self.set_signed_triple(GYRO_OFF, part).await?;
        self.state.host_bias_x = x.min(0);
        self.state.sign_at_risk = false;
        Ok(GyroBias { part, host_x: self.state.host_bias_x })
    }

    pub(crate) async fn keep_negative_x_bias_on_host(&mut self) -> Result<GyroBias, Refusal> {
        let GyroBias { mut part, host_x } = self.gyro_offsets().await?;
        if part[0] < 0 {
            self.set(Register::XgyroOff, 0).await?;
            self.state.host_bias_x = host_x.saturating_add(part[0]);
            self.state.sign_at_risk = false;
            part[0] = 0;
        }
        Ok(GyroBias { part, host_x: self.state.host_bias_x })
    }

    pub(crate) async fn accl_offsets(&self) -> Result<[i16; 3], Refusal> {
        Ok(self.signed_triple(ACCL_OFF).await)
    }

    pub(crate) async fn set_accl_offsets(&self, offsets: [i16; 3]) -> Result<(), Refusal> {
        self.set_signed_triple(ACCL_OFF, offsets).await
    }

    pub(crate) async fn hard_iron(&self) -> Result<[i16; 3], Refusal> {
        Ok(self.signed_triple(HARD_IRON).await)
    }

    pub(crate) async fn set_hard_iron(&self, offsets: [i16; 3]) -> Result<(), Refusal> {
        self.set_signed_triple(HARD_IRON, offsets).await
    }

    pub(crate) async fn soft_iron(&self) -> Result<[u16; 3], Refusal> {
        Ok(self.read_all(SOFT_IRON).await.map(|word| word & Register::XmagnSif.mask()))
    }

    pub(crate) async fn set_soft_iron(&self, factors: [u16; 3]) -> Result<(), Refusal> {
        for (register, factor) in SOFT_IRON.into_iter().zip(factors) {
            if factor > register.mask() {
                return Err(Error::Value { register, value: i32::from(factor) });
            }
        }
        for (register, factor) in SOFT_IRON.into_iter().zip(factors) {
            self.set(register, factor).await?;
        }
        Ok(())
    }
}
