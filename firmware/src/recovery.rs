//! Recovery steps of a sensor in trouble, up to a restart of the microcontroller.

/// Failed steps, at one step a second, before the microcontroller is restarted.
pub(crate) const FAILURES_BEFORE_RESTART: u32 = 30;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(all(target_os = "none", feature = "microcontroller"), derive(defmt::Format))]
pub(crate) enum RecoveryStep {
    /// Read identity and configuration again.
    Reread,
    /// Reset the SPI, end an open frame by a pulse, then probe.
    BusReset,
    /// Use longer bus times from then on: [`BusTiming::SLOW`](crate::BusTiming::SLOW).
    SlowBus,
    SoftwareReset,
    /// Reset the sensor by RST if connected, else by command; then probe.
    ResetLine,
    /// Restart the microcontroller; statistics are kept.
    Restart,
}

impl RecoveryStep {
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

/// Chooses the steps. It starts again only after the sensor has [settled](Self::settle), not after each probe.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct RecoveryLadder {
    taken: u32,
    /// True if the sensor has settled since the last restart: an absent sensor causes one restart at most.
    has_settled: bool,
}

impl RecoveryLadder {
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

    /// To be called after enough usable bursts since the latest step.
    pub(crate) fn settle(&mut self) {
        *self = Self { taken: 0, has_settled: true };
    }

    /// True for the first eight steps, then for one of 32.
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

    /// The restart comes after 30 failures, once per loss, and never for a sensor that was absent from the start.
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
