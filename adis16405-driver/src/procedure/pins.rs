//! Data-ready line, general-purpose lines, analog output, compensations: what MSC_CTRL, GPIO_CTRL and AUX_DAC switch.

use crate::compensation::Compensation;
use crate::pin::{DacLevel, Dio, Gpio, SIGNAL_MASK, Signal};
use crate::register::Register;
use crate::session::{Refusal, Session};

const DAC_LATCH: u16 = 1 << 2;
const LINEAR_ACCELERATION: u16 = 1 << 7;
const ORIGIN_ALIGNMENT: u16 = 1 << 6;

impl Session<'_> {
    pub(crate) async fn data_ready(&self) -> Result<Option<Signal>, Refusal> {
        Ok(Signal::from_bits(self.read(Register::MscCtrl).await))
    }

    pub(crate) async fn set_data_ready(&self, signal: Option<Signal>) -> Result<(), Refusal> {
        self.update_register(Register::MscCtrl, SIGNAL_MASK, Signal::bits(signal)).await
    }

    pub(crate) async fn compensation(&self) -> Result<Compensation, Refusal> {
        let control = self.read(Register::MscCtrl).await;
        Ok(Compensation {
            linear_acceleration: control & LINEAR_ACCELERATION != 0,
            origin_alignment: control & ORIGIN_ALIGNMENT != 0,
        })
    }

    pub(crate) async fn set_compensation(&self, compensation: Compensation) -> Result<(), Refusal> {
        let Compensation { linear_acceleration, origin_alignment } = compensation;
        let flag = |set, bit| if set { bit } else { 0 };
        let bits = flag(linear_acceleration, LINEAR_ACCELERATION) | flag(origin_alignment, ORIGIN_ALIGNMENT);
        self.update_register(Register::MscCtrl, LINEAR_ACCELERATION | ORIGIN_ALIGNMENT, bits).await
    }

    pub(crate) async fn gpio(&self) -> Result<Gpio, Refusal> {
        let [levels, directions] = self.read(Register::GpioCtrl).await.to_be_bytes();
        Ok(Gpio { outputs: Dio::from_bits_truncate(directions), high: Dio::from_bits_truncate(levels) })
    }

    pub(crate) async fn set_gpio(&self, gpio: Gpio) -> Result<(), Refusal> {
        let outputs = gpio.outputs & Dio::all();
        let value = u16::from_be_bytes([gpio.high.bits(), outputs.bits()]);
        // The levels of inputs are not ours.
        let mask = u16::from_be_bytes([outputs.bits(), Dio::all().bits()]);
        self.update_register(Register::GpioCtrl, mask, value).await
    }

    pub(crate) async fn set_aux_dac(&self, level: DacLevel) -> Result<(), Refusal> {
        self.set(Register::AuxDac, level.counts()).await?;
        self.write_low(Register::GlobCmd, DAC_LATCH).await;
        Ok(())
    }
}
