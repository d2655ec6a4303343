//! Corrections of the sensor outputs: gyro and accelerometer bias, hard and soft iron, on-chip compensation.

use crate::error::Error;
use crate::protocol::{Protocol, ProtocolError};
use crate::register::Register;

/// The gyros' bias correction in counts of 0.0125 °/s, added to the outputs by the part or the driver.
///
/// Erratum: while XGYRO_OFF is negative, burst reads drop the sign of negative x rates, also for following single
/// reads. The driver keeps a negative correction of x itself and adds it to each [`ImuSample`](crate::ImuSample), not
/// to the counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct GyroBias {
    /// Applied by the part: XGYRO_OFF, YGYRO_OFF and ZGYRO_OFF.
    pub part: [i16; 3],
    /// Applied to the x rate by the driver.
    pub host_x: i16,
}

impl GyroBias {
    /// The sum of both corrections about x, y and z.
    pub fn total(&self) -> [i16; 3] {
        let [x, y, z] = self.part;
        [x.saturating_add(self.host_x), y, z]
    }
}

/// The corrections that a factory restore set to 0 (data sheet Rev. B, Tables 10 to 12, page 13). It does not change
/// the soft-iron factors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct FactoryRestore {
    /// Bias correction of the gyros, 0.0125 °/s per count.
    pub gyro: GyroBias,
    /// Bias correction of the accelerometers x, y, z, 3.33 mg per count.
    pub accl: [i16; 3],
    /// Hard-iron correction x, y, z, 0.5 mgauss per count.
    pub hard_iron: [i16; 3],
}

/// Corrections between sensors that the part can apply, MSC_CTRL bits 7 and 6.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct OnChipCompensation {
    /// Removes the effect of linear acceleration from the bias of the gyros.
    pub linear_acceleration: bool,
    /// Refers the three accelerometers to one point of the package.
    pub origin_alignment: bool,
}

const LINEAR_ACCELERATION: u16 = 1 << 7;
const ORIGIN_ALIGNMENT: u16 = 1 << 6;
const GYRO_OFF: [Register; 3] = [Register::XgyroOff, Register::YgyroOff, Register::ZgyroOff];
const ACCL_OFF: [Register; 3] = [Register::XacclOff, Register::YacclOff, Register::ZacclOff];
const HARD_IRON: [Register; 3] = [Register::XmagnHif, Register::YmagnHif, Register::ZmagnHif];
const SOFT_IRON: [Register; 3] = [Register::XmagnSif, Register::YmagnSif, Register::ZmagnSif];

/// The value of a register as a two's complement number of its width. Bits above the width are ignored.
fn sign_extended(register: Register, word: u16) -> i16 {
    let shift = 16 - register.bits();
    ((word << shift) as i16) >> shift
}

/// Checks that a signed value fits the width of a register.
fn check(register: Register, value: i16) -> Result<(), ProtocolError> {
    if sign_extended(register, value as u16) == value {
        Ok(())
    } else {
        Err(Error::Value { register, value: i32::from(value) })
    }
}

impl Protocol<'_> {
    async fn read_signed_triple(&self, registers: [Register; 3]) -> [i16; 3] {
        let words = self.read_all(registers).await;
        let mut values = [0; 3];
        for (value, (register, word)) in values.iter_mut().zip(registers.into_iter().zip(words)) {
            *value = sign_extended(register, word);
        }
        values
    }

    /// Writes three signed registers, none if one of the values does not fit.
    async fn set_signed_triple(&self, registers: [Register; 3], values: [i16; 3]) -> Result<(), ProtocolError> {
        for (register, value) in registers.into_iter().zip(values) {
            check(register, value)?;
        }
        for (register, value) in registers.into_iter().zip(values) {
            self.set_register(register, value as u16).await?;
        }
        Ok(())
    }

    pub(crate) async fn gyro_offsets(&mut self) -> Result<GyroBias, ProtocolError> {
        let part = self.read_signed_triple(GYRO_OFF).await;
        self.state.x_sign_at_risk = part[0] < 0;
        Ok(GyroBias { part, host_x: self.state.host_bias_x })
    }

    pub(crate) async fn set_gyro_offsets(&mut self, offsets: [i16; 3]) -> Result<GyroBias, ProtocolError> {
        check(Register::XgyroOff, offsets[0])?;
        let [x, y, z] = offsets;
        let part = [x.max(0), y, z];
        self.set_signed_triple(GYRO_OFF, part).await?;
        self.state.host_bias_x = x.min(0);
        self.state.x_sign_at_risk = false;
        Ok(GyroBias { part, host_x: self.state.host_bias_x })
    }

    pub(crate) async fn keep_negative_x_bias_on_host(&mut self) -> Result<GyroBias, ProtocolError> {
        let GyroBias { mut part, .. } = self.gyro_offsets().await?;
        let [x, ..] = part;
        if x < 0 {
            self.set_register(Register::XgyroOff, 0).await?;
            self.state.x_sign_at_risk = false;
            part[0] = 0;
        }
        // A nonzero XGYRO_OFF, from auto-null or flash, replaces the driver's correction: it is the whole one.
        if x != 0 {
            self.state.host_bias_x = x.min(0);
        }
        Ok(GyroBias { part, host_x: self.state.host_bias_x })
    }

    pub(crate) async fn accl_offsets(&self) -> Result<[i16; 3], ProtocolError> {
        Ok(self.read_signed_triple(ACCL_OFF).await)
    }

    pub(crate) async fn set_accl_offsets(&self, offsets: [i16; 3]) -> Result<(), ProtocolError> {
        self.set_signed_triple(ACCL_OFF, offsets).await
    }

    pub(crate) async fn hard_iron(&self) -> Result<[i16; 3], ProtocolError> {
        Ok(self.read_signed_triple(HARD_IRON).await)
    }

    pub(crate) async fn set_hard_iron(&self, offsets: [i16; 3]) -> Result<(), ProtocolError> {
        self.set_signed_triple(HARD_IRON, offsets).await
    }

    pub(crate) async fn soft_iron(&self) -> Result<[u16; 3], ProtocolError> {
        Ok(self.read_all(SOFT_IRON).await.map(|word| word & Register::XmagnSif.mask()))
    }

    pub(crate) async fn set_soft_iron(&self, factors: [u16; 3]) -> Result<(), ProtocolError> {
        for (register, factor) in SOFT_IRON.into_iter().zip(factors) {
            if factor > register.mask() {
                return Err(Error::Value { register, value: i32::from(factor) });
            }
        }
        for (register, factor) in SOFT_IRON.into_iter().zip(factors) {
            self.set_register(register, factor).await?;
        }
        Ok(())
    }

    pub(crate) async fn compensation(&self) -> Result<OnChipCompensation, ProtocolError> {
        let control = self.read(Register::MscCtrl).await;
        Ok(OnChipCompensation {
            linear_acceleration: control & LINEAR_ACCELERATION != 0,
            origin_alignment: control & ORIGIN_ALIGNMENT != 0,
        })
    }

    pub(crate) async fn set_compensation(&self, compensation: OnChipCompensation) -> Result<(), ProtocolError> {
        let OnChipCompensation { linear_acceleration, origin_alignment } = compensation;
        let flag = |set, bit| if set { bit } else { 0 };
        let bits = flag(linear_acceleration, LINEAR_ACCELERATION) | flag(origin_alignment, ORIGIN_ALIGNMENT);
        self.update_register(Register::MscCtrl, LINEAR_ACCELERATION | ORIGIN_ALIGNMENT, bits).await
    }
}
