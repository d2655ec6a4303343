//! The two alarms of the part (ALM_MAG, ALM_SMPL, ALM_CTRL).

use crate::burst::OutputWord;
use crate::channel::Channel;
use crate::error::Error;
use crate::pins::{DioSignal, SIGNAL_MASK};
use crate::protocol::{Protocol, ProtocolError};
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

/// The threshold of an alarm in counts, and the side of it on which the alarm is raised.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum AlarmThreshold {
    /// Raised while the value is above this count.
    Above(i16),
    /// Raised while the value is below this count.
    Below(i16),
}

/// The quantity that an alarm compares with its threshold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum AlarmWatch {
    /// The value of the channel.
    Level,
    /// Change over this number of samples (ALM_SMPL); 0 and 1 mean one (data sheet Rev. B, Table 26).
    RateOfChange(u8),
}

/// The setting of an alarm (data sheet Rev. B, Tables 24 to 26). Raised, it sets bit 8 or 9 of DIAG_STAT and the
/// error/alarm flag of every output word.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Alarm {
    /// The channel that is compared.
    pub source: Channel,
    /// The quantity that is compared: value or rate of change.
    pub watch: AlarmWatch,
    /// The threshold, in counts of the channel.
    pub threshold: AlarmThreshold,
}

/// The bit of ALM_MAG that selects [`AlarmThreshold::Above`].
const ABOVE: u16 = 1 << 15;

impl AlarmNumber {
    const fn magnitude(self) -> Register {
        match self {
            AlarmNumber::One => Register::AlmMag1,
            AlarmNumber::Two => Register::AlmMag2,
        }
    }

    const fn samples(self) -> Register {
        match self {
            AlarmNumber::One => Register::AlmSmpl1,
            AlarmNumber::Two => Register::AlmSmpl2,
        }
    }

    /// Position of the four source bits in ALM_CTRL.
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
    const fn control_mask(self) -> u16 {
        0xF << self.source_shift() | self.rate_of_change()
    }
}

impl Alarm {
    /// The bits of ALM_CTRL for this alarm. Sources are numbered from 1 in burst order; 0 is no source.
    fn control(&self, number: AlarmNumber) -> u16 {
        let rate_of_change = match self.watch {
            AlarmWatch::Level => 0,
            AlarmWatch::RateOfChange(_) => number.rate_of_change(),
        };
        (self.source as u16 + 1) << number.source_shift() | rate_of_change
    }

    fn threshold_counts(&self) -> i16 {
        match self.threshold {
            AlarmThreshold::Above(counts) | AlarmThreshold::Below(counts) => counts,
        }
    }

    /// The value of ALM_MAG: bit 15 for the side, below it the threshold in the format of the channel.
    fn magnitude(&self) -> u16 {
        let field = OutputWord::from_counts(self.source, self.threshold_counts()).field(self.source);
        match self.threshold {
            AlarmThreshold::Above(_) => ABOVE | field,
            AlarmThreshold::Below(_) => field,
        }
    }

    fn samples(&self) -> u16 {
        match self.watch {
            AlarmWatch::Level => 0,
            AlarmWatch::RateOfChange(samples) => u16::from(samples),
        }
    }

    /// The alarm in ALM_CTRL, ALM_MAG and ALM_SMPL; `None` if it has no source.
    fn from_registers(number: AlarmNumber, control: u16, magnitude: u16, samples: u16) -> Option<Self> {
        let code = control >> number.source_shift() & 0xF;
        let source = *Channel::ALL.get(usize::from(code).checked_sub(1)?)?;
        let counts = OutputWord(magnitude).counts(source);
        Some(Self {
            source,
            watch: match control & number.rate_of_change() {
                0 => AlarmWatch::Level,
                _ => AlarmWatch::RateOfChange(samples as u8),
            },
            threshold: if magnitude & ABOVE != 0 {
                AlarmThreshold::Above(counts)
            } else {
                AlarmThreshold::Below(counts)
            },
        })
    }
}

/// The bit of ALM_CTRL by which alarms compare filtered data.
const COMPARE_FILTERED: u16 = 1 << 4;

impl Protocol<'_> {
    pub(crate) async fn alarm(&self, number: AlarmNumber) -> Result<Option<Alarm>, ProtocolError> {
        let [control, magnitude, samples] =
            self.read_all([Register::AlmCtrl, number.magnitude(), number.samples()]).await;
        Ok(Alarm::from_registers(number, control, magnitude, samples))
    }

    pub(crate) async fn set_alarm(&self, number: AlarmNumber, alarm: Option<Alarm>) -> Result<(), ProtocolError> {
        let mask = number.control_mask();
        if let Some(alarm) = alarm {
            let (low, high) = alarm.source.limits();
            let value = alarm.threshold_counts();
            if !(low..=high).contains(&value) {
                return Err(Error::Value { register: number.magnitude(), value: i32::from(value) });
            }
        }
        // The alarm is off while its registers change: a half-written setting could raise it.
        self.update_register(Register::AlmCtrl, mask, 0).await?;
        if let Some(alarm) = alarm {
            self.set_register(number.magnitude(), alarm.magnitude()).await?;
            self.set_register(number.samples(), alarm.samples()).await?;
            self.update_register(Register::AlmCtrl, mask, alarm.control(number)).await?;
        }
        Ok(())
    }

    pub(crate) async fn set_alarm_output(&self, signal: Option<DioSignal>) -> Result<(), ProtocolError> {
        self.update_register(Register::AlmCtrl, SIGNAL_MASK, DioSignal::bits(signal)).await
    }

    pub(crate) async fn set_alarm_filtering(&self, filtered: bool) -> Result<(), ProtocolError> {
        self.update_register(Register::AlmCtrl, COMPARE_FILTERED, if filtered { COMPARE_FILTERED } else { 0 }).await
    }
}
