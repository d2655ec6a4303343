//! Recovery of a sensor that is in trouble: which step comes next, from reading its registers again to a restart of the
//! microcontroller.

/// Failed steps in a row after which the microcontroller is restarted. They come once a second.
pub(crate) const FAILURES_BEFORE_RESTART: u32 = 30;

/// A step of recovery, by rising effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(all(target_os = "none", feature = "microcontroller"), derive(defmt::Format))]
pub(crate) enum RecoveryStep {
    /// Read identity and configuration, and set what differs.
    Reread,
    /// Reset the microcontroller's SPI and end an unfinished frame by a pulse on chip select; then probe.
    BusReset,
    /// The same, with longer times on the bus from then on: [`BusTiming::SLOW`](crate::BusTiming::SLOW).
    SlowBus,
    /// Reset the sensor by its command, then probe.
    SoftwareReset,
    /// Reset the sensor by its RST line, if that is connected, else by its command; then probe.
    ResetLine,
    /// Restart the microcontroller. The statistics are kept.
    Restart,
}

impl RecoveryStep {
    /// What is being done, for a log.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Reread => "probing it",
            Self::BusReset => "resetting the bus",
            Self::SlowBus => "slow timing of the bus",
            Self::SoftwareReset => "resetting it",
            Self::ResetLine => "resetting it by RST",
            Self::Restart => "restarting the microcontroller",
        }
    }
}

/// Chooses the steps. The sequence starts anew only after the sensor has [settled](Self::settle), so that one that passes
/// every probe and then fails again is reset too.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct RecoveryLadder {
    /// Steps taken since the sensor has settled.
    taken: u32,
    /// The sensor has settled since the last restart: one that is absent restarts the microcontroller once at most.
    has_settled: bool,
}

impl RecoveryLadder {
    /// The step to take now.
    pub(crate) fn next_step(&mut self) -> RecoveryStep {
        let taken = self.taken;
        self.taken = taken.saturating_add(1);
        if taken >= FAILURES_BEFORE_RESTART && core::mem::take(&mut self.has_settled) {
            return RecoveryStep::Restart;
        }
        match (taken, taken % 3) {
            (0, _) => RecoveryStep::Reread,
            (4, _) => RecoveryStep::SlowBus,
            (_, 1) => RecoveryStep::BusReset,
            (_, 2) => RecoveryStep::SoftwareReset,
            _ => RecoveryStep::ResetLine,
        }
    }

    /// The sensor has delivered so many usable bursts since the latest step that it is known to work.
    pub(crate) fn settle(&mut self) {
        *self = Self { taken: 0, has_settled: true };
    }

    /// Whether the latest step is to be logged: each of the first eight, then one of 32.
    pub(crate) const fn is_logged(&self) -> bool {
        self.taken <= 8 || self.taken.is_multiple_of(32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use RecoveryStep::{BusReset, Reread, ResetLine, Restart, SlowBus, SoftwareReset};

    #[test]
    fn the_steps_rise_and_start_anew_after_the_sensor_has_settled() {
        let mut ladder = RecoveryLadder::default();
        let mut next = |count: usize| -> [RecoveryStep; 5] {
            assert_eq!(count, 5);
            core::array::from_fn(|_| ladder.next_step())
        };
        assert_eq!(next(5), [Reread, BusReset, SoftwareReset, ResetLine, SlowBus]);
        ladder.settle();
        assert_eq!(ladder.next_step(), Reread);
    }

    /// The microcontroller is restarted after 30 failures, once for each loss, and never for a sensor that was absent from
    /// the start.
    #[test]
    fn the_microcontroller_is_restarted_once() {
        let mut ladder = RecoveryLadder::default();
        let restarts = |ladder: &mut RecoveryLadder| (0..1000).filter(|_| ladder.next_step() == Restart).count();
        assert_eq!(restarts(&mut ladder), 0);
        ladder.settle();
        assert_eq!((0..100).position(|_| ladder.next_step() == Restart), Some(30));
        assert_eq!(restarts(&mut ladder), 0);
    }
}
