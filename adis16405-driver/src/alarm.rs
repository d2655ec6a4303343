//! The two alarms. Their registers' layout is that of an older part of the family; no source at hand confirms it for this
//! one, so check it against your data sheet ([`Adis16405::update_register`](crate::Adis16405::update_register) sets
//! any other).

use crate::channel::Channel;
use crate::frame::OutputWord;
use crate::register::Register;

/// One of the two alarms.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum AlarmNumber {
    /// Alarm 1.
    One,
    /// Alarm 2.
    Two,
}

/// On which side of its threshold an alarm is raised.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Threshold {
    /// When the value is above so many counts.
    Above(i16),
    /// When the value is below so many counts.
    Below(i16),
}

/// What an alarm watches.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Watch {
    /// The output itself.
    Level,
    /// Its change over so many samples (ALM_SMPL).
    RateOfChange(u8),
}

/// An alarm: when it is raised, DIAG_STAT bit 8 or 9 and the error flag of every output word say so.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Alarm {
    /// The output that is watched.
    pub source: Channel,
    /// What of it is watched.
    pub watch: Watch,
    /// The limit, in the counts of the output.
    pub threshold: Threshold,
}

const ABOVE: u16 = 1 << 15;

impl AlarmNumber {
    pub(crate) const fn magnitude(self) -> Register {
        match self {
            AlarmNumber::One => Register::AlmMag1,
            AlarmNumber::Two => Register::AlmMag2,
        }
    }

    pub(crate) const fn samples(self) -> Register {
        match self {
            AlarmNumber::One => Register::AlmSmpl1,
            AlarmNumber::Two => Register::AlmSmpl2,
        }
    }

    const fn source_shift(self) -> u32 {
        match self {
            AlarmNumber::One => 8,
            AlarmNumber::Two => 12,
        }
    }

    const fn rate_of_change(self) -> u16 {
        match self {
            AlarmNumber::One => 1 << 6,
            AlarmNumber::Two => 1 << 7,
        }
    }

    /// The bits of ALM_CTRL that belong to this alarm.
    pub(crate) const fn control_mask(self) -> u16 {
        0xF << self.source_shift() | self.rate_of_change()
    }
}

impl Alarm {
    /// Sources are numbered from 1 in the order of a burst; 0 is none.
    pub(crate) fn control(&self, number: AlarmNumber) -> u16 {
        let rate_of_change = match self.watch {
            Watch::Level => 0,
            Watch::RateOfChange(_) => number.rate_of_change(),
        };
        (self.source as u16 + 1) << number.source_shift() | rate_of_change
    }

    pub(crate) fn threshold_counts(&self) -> i16 {
        match self.threshold {
            Threshold::Above(counts) | Threshold::Below(counts) => counts,
        }
    }

    /// The value of ALM_MAG: bit 15 and the threshold in the format of the output.
    pub(crate) fn magnitude(&self) -> u16 {
        let field = OutputWord::fresh(self.source, self.threshold_counts()).field(self.source);
        match self.threshold {
            Threshold::Above(_) => ABOVE | field,
            Threshold::Below(_) => field,
        }
    }

    pub(crate) fn samples(&self) -> u16 {
        match self.watch {
            Watch::Level => 0,
            Watch::RateOfChange(samples) => u16::from(samples),
        }
    }

    /// From ALM_CTRL, ALM_MAG and ALM_SMPL; `None` if the alarm has no source.
    pub(crate) fn from_registers(number: AlarmNumber, control: u16, magnitude: u16, samples: u16) -> Option<Self> {
        let code = control >> number.source_shift() & 0xF;
        let source = *Channel::ALL.get(usize::from(code).checked_sub(1)?)?;
        let counts = OutputWord(magnitude).counts(source);
        Some(Self {
            source,
            watch: match control & number.rate_of_change() {
                0 => Watch::Level,
                _ => Watch::RateOfChange(samples as u8),
            },
            threshold: if magnitude & ABOVE != 0 { Threshold::Above(counts) } else { Threshold::Below(counts) },
        })
    }
}
