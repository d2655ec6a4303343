//! Alarms. An alarm is off while its threshold changes, so that none is raised by half a setting.

use crate::alarm::{Alarm, AlarmNumber};
use crate::error::Error;
use crate::pin::{SIGNAL_MASK, Signal};
use crate::register::Register;
use crate::session::{Refusal, Session};

const COMPARE_FILTERED: u16 = 1 << 4;

impl Session<'_> {
    pub(crate) async fn alarm(&self, number: AlarmNumber) -> Result<Option<Alarm>, Refusal> {
        let [control, magnitude, samples] =
            self.read_all([Register::AlmCtrl, number.magnitude(), number.samples()]).await;
        Ok(Alarm::from_registers(number, control, magnitude, samples))
    }

    pub(crate) async fn set_alarm(&self, number: AlarmNumber, alarm: Option<Alarm>) -> Result<(), Refusal> {
        let mask = number.control_mask();
        if let Some(alarm) = alarm {
            let (low, high) = alarm.source.limits();
            let value = alarm.threshold_counts();
            if !(low..=high).contains(&value) {
                return Err(Error::Value { register: number.magnitude(), value: i32::from(value) });
            }
        }
        self.update_register(Register::AlmCtrl, mask, 0).await?;
        if let Some(alarm) = alarm {
            self.set(number.magnitude(), alarm.magnitude()).await?;
            self.set(number.samples(), alarm.samples()).await?;
            self.update_register(Register::AlmCtrl, mask, alarm.control(number)).await?;
        }
        Ok(())
    }

    pub(crate) async fn set_alarm_output(&self, signal: Option<Signal>) -> Result<(), Refusal> {
        self.update_register(Register::AlmCtrl, SIGNAL_MASK, Signal::bits(signal)).await
    }

    pub(crate) async fn set_alarm_filtering(&self, filtered: bool) -> Result<(), Refusal> {
        self.update_register(Register::AlmCtrl, COMPARE_FILTERED, if filtered { COMPARE_FILTERED } else { 0 }).await
    }
}
