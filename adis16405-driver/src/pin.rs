//! The part's pins: data-ready and alarm lines, general-purpose lines, the analog output.

/// A pin that can carry a signal of the part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Line {
    /// DIO1.
    #[default]
    Dio1,
    /// DIO2.
    Dio2,
}

/// The level that means "yes".
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

/// Where and how a signal appears. The default is how data ready comes out of a reset: on DIO1, active high.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Signal {
    /// The pin.
    pub line: Line,
    /// The active level.
    pub polarity: Polarity,
}

/// Enable, polarity and line have the same places in MSC_CTRL (data ready) and in ALM_CTRL (alarm output).
pub(crate) const SIGNAL_MASK: u16 = 0b111;

impl Signal {
    pub(crate) const fn bits(signal: Option<Self>) -> u16 {
        match signal {
            None => 0,
            Some(Signal { line, polarity }) => {
                1 << 2 | (matches!(polarity, Polarity::ActiveHigh) as u16) << 1 | matches!(line, Line::Dio2) as u16
            }
        }
    }

    pub(crate) const fn from_bits(bits: u16) -> Option<Self> {
        if bits & 1 << 2 == 0 {
            return None;
        }
        let polarity = if bits & 1 << 1 != 0 { Polarity::ActiveHigh } else { Polarity::ActiveLow };
        let line = if bits & 1 != 0 { Line::Dio2 } else { Line::Dio1 };
        Some(Signal { line, polarity })
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

/// GPIO_CTRL: direction and level of the general-purpose lines. Data ready and alarm output take a line over whatever is
/// set here (not confirmed by any source at hand).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Gpio {
    /// Lines that the part drives; the others are inputs.
    pub outputs: Dio,
    /// Lines that are high. Of inputs it is only read.
    pub high: Dio,
}

/// A level of the auxiliary analog output, 12 bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "u16", into = "u16"))]
pub struct DacLevel(u16);

impl DacLevel {
    /// From the value of AUX_DAC; `None` above 4095.
    pub const fn from_counts(counts: u16) -> Option<Self> {
        if counts <= 0x0FFF { Some(Self(counts)) } else { None }
    }

    /// The level nearest to a voltage in mV; `None` above 3300 mV. The scale, 0.8059 mV a count, is not confirmed by any
    /// source at hand: use [`from_counts`](Self::from_counts) where yours differs.
    pub const fn from_millivolts(millivolts: u16) -> Option<Self> {
        if millivolts > 3300 {
            return None;
        }
        // 3300 mV are 4094.8 counts.
        Some(Self(((millivolts as u32 * 10_000 + 4_029) / 8_059) as u16))
    }

    /// The value of AUX_DAC.
    pub const fn counts(self) -> u16 {
        self.0
    }
}
