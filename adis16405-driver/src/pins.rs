//! The pins of the part: data-ready signal, general-purpose lines and analog output (MSC_CTRL, GPIO_CTRL, AUX_DAC).

use crate::protocol::{Protocol, ProtocolError};
use crate::register::Register;

/// A pin that can carry the data-ready or the alarm signal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum DioLine {
    /// DIO1.
    #[default]
    Dio1,
    /// DIO2.
    Dio2,
}

/// The active level of a signal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Polarity {
    /// High when active.
    #[default]
    ActiveHigh,
    /// Low when active.
    ActiveLow,
}

/// Pin and active level of data ready or alarm; the default, DIO1 active high, is data ready's after a reset.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DioSignal {
    /// The pin.
    pub line: DioLine,
    /// The active level.
    pub polarity: Polarity,
}

/// Enable (bit 2), polarity (bit 1), line (bit 0), in MSC_CTRL and ALM_CTRL alike.
pub(crate) const SIGNAL_MASK: u16 = 0b111;

impl DioSignal {
    /// The value of the bits of [`SIGNAL_MASK`]; `None` is no signal.
    pub(crate) const fn bits(signal: Option<Self>) -> u16 {
        match signal {
            None => 0,
            Some(DioSignal { line, polarity }) => {
                1 << 2 | (matches!(polarity, Polarity::ActiveHigh) as u16) << 1 | matches!(line, DioLine::Dio2) as u16
            }
        }
    }

    /// The signal that the bits of [`SIGNAL_MASK`] select.
    const fn from_bits(bits: u16) -> Option<Self> {
        if bits & 1 << 2 == 0 {
            return None;
        }
        let polarity = if bits & 1 << 1 != 0 { Polarity::ActiveHigh } else { Polarity::ActiveLow };
        let line = if bits & 1 != 0 { DioLine::Dio2 } else { DioLine::Dio1 };
        Some(DioSignal { line, polarity })
    }
}

bitflags::bitflags! {
    /// A set of the general-purpose lines.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
    #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
    pub struct Dio: u8 {
        /// DIO1.
        const DIO1 = 1 << 0;
        /// DIO2.
        const DIO2 = 1 << 1;
        /// DIO3.
        const DIO3 = 1 << 2;
        /// DIO4, also the input of an external sample clock.
        const DIO4 = 1 << 3;
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for Dio {
    fn format(&self, formatter: defmt::Formatter<'_>) {
        defmt::write!(formatter, "Dio({=u8:#x})", self.bits());
    }
}

/// General-purpose lines, GPIO_CTRL; lines with data ready or alarm ignore it (data sheet Rev. B, page 14).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Gpio {
    /// Lines that the part drives; the others are inputs.
    pub outputs: Dio,
    /// Lines that are high. For inputs this is only read, never written.
    pub high: Dio,
}

/// A level of the auxiliary analog output, 12 bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "u16", into = "u16"))]
pub struct DacLevel(u16);

impl DacLevel {
    /// The level with this value of AUX_DAC; `None` above 4095.
    pub const fn from_counts(counts: u16) -> Option<Self> {
        if counts <= 0x0FFF { Some(Self(counts)) } else { None }
    }

    /// The level nearest to a voltage in mV, at 0.8059 mV a count (data sheet Rev. B, Table 20); `None` above 3300 mV.
    pub const fn from_millivolts(millivolts: u16) -> Option<Self> {
        if millivolts > 3300 {
            return None;
        }
        // 3300 mV are 4094.8 counts, so the result fits 12 bits.
        Some(Self(((millivolts as u32 * 10_000 + 4_029) / 8_059) as u16))
    }

    /// The value of AUX_DAC.
    pub const fn counts(self) -> u16 {
        self.0
    }
}

#[cfg(feature = "serde")]
impl From<DacLevel> for u16 {
    fn from(level: DacLevel) -> Self {
        level.counts()
    }
}

#[cfg(feature = "serde")]
impl TryFrom<u16> for DacLevel {
    type Error = &'static str;

    fn try_from(counts: u16) -> Result<Self, Self::Error> {
        Self::from_counts(counts).ok_or("AUX_DAC has 12 bits")
    }
}

/// GLOB_CMD bit that moves AUX_DAC to the output.
const DAC_LATCH: u16 = 1 << 2;

impl Protocol<'_> {
    pub(crate) async fn data_ready(&self) -> Result<Option<DioSignal>, ProtocolError> {
        Ok(DioSignal::from_bits(self.read(Register::MscCtrl).await))
    }

    pub(crate) async fn set_data_ready(&self, signal: Option<DioSignal>) -> Result<(), ProtocolError> {
        self.update_register(Register::MscCtrl, SIGNAL_MASK, DioSignal::bits(signal)).await
    }

    pub(crate) async fn gpio(&self) -> Result<Gpio, ProtocolError> {
        let [levels, directions] = self.read(Register::GpioCtrl).await.to_be_bytes();
        Ok(Gpio { outputs: Dio::from_bits_truncate(directions), high: Dio::from_bits_truncate(levels) })
    }

    pub(crate) async fn set_gpio(&self, gpio: Gpio) -> Result<(), ProtocolError> {
        let outputs = gpio.outputs & Dio::all();
        let value = u16::from_be_bytes([gpio.high.bits(), outputs.bits()]);
        // The level bits of inputs show the pins and are left out.
        let mask = u16::from_be_bytes([outputs.bits(), Dio::all().bits()]);
        self.update_register(Register::GpioCtrl, mask, value).await
    }

    pub(crate) async fn set_aux_dac(&self, level: DacLevel) -> Result<(), ProtocolError> {
        self.set_register(Register::AuxDac, level.counts()).await?;
        self.write_low(Register::GlobCmd, DAC_LATCH).await;
        Ok(())
    }
}
