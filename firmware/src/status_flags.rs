//! The sensor's status register, whose flags stay set until it is read: reads during sampling, counts of causes.

use crate::counters::add;
use adis16405_driver::Diagnosis;
use core::fmt;
use link::Health;

/// Least time between reads, µs; a persistent cause is set again.
const READ_US: u64 = 1_000_000;
/// Time after which a persistent cause is logged again, µs.
const LOG_US: u64 = 600_000_000;

/// Causes, with the names of their counters.
const CAUSES: [(Diagnosis, &str); 8] = [
    (Diagnosis::SUPPLY_LOW, "diag_supply_low"),
    (Diagnosis::SUPPLY_HIGH, "diag_supply_high"),
    (Diagnosis::FLASH_UPDATE, "diag_flash_update"),
    (Diagnosis::SPI, "diag_spi"),
    (Diagnosis::OVER_RANGE, "diag_over_range"),
    (Diagnosis::SELF_TEST_FAILURES, "diag_self_test"),
    (Diagnosis::FLASH_CHECKSUM, "diag_flash_checksum"),
    (Diagnosis::ALARM_1.union(Diagnosis::ALARM_2), "diag_alarm"),
];

#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct StatusFlags {
    next_read_us: u64,
    /// Causes logged since [`LOG_US`] before `forget_us`.
    logged: Diagnosis,
    forget_us: u64,
}

impl StatusFlags {
    pub(crate) const fn is_due(&self, now_us: u64) -> bool {
        now_us >= self.next_read_us
    }

    /// Takes the content read at `now_us`, if the sensor answered. Counts causes and returns those to be logged.
    pub(crate) fn add(
        &mut self,
        diagnosis: Option<Diagnosis>,
        now_us: u64,
        counters: &mut Health,
    ) -> Option<CauseList> {
        self.next_read_us = now_us + READ_US;
        let diagnosis = diagnosis?;
        add(&mut counters.diag_reads, 1);
        for (_, name) in CAUSES.iter().filter(|(cause, _)| diagnosis.intersects(*cause)) {
            counters.counter_mut(name).into_iter().for_each(|counter| add(counter, 1));
        }
        if now_us >= self.forget_us {
            (self.logged, self.forget_us) = (Diagnosis::empty(), now_us + LOG_US);
        }
        let news = !self.logged.contains(diagnosis);
        self.logged |= diagnosis;
        news.then_some(CauseList(diagnosis))
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct CauseList(Diagnosis);

impl CauseList {
    fn names(self) -> impl Iterator<Item = &'static str> {
        let causes = CAUSES.into_iter().filter(move |(cause, _)| self.0.intersects(*cause));
        causes.filter_map(|(_, name)| name.strip_prefix("diag_"))
    }
}

#[cfg(all(target_os = "none", feature = "microcontroller"))]
impl defmt::Format for CauseList {
    fn format(&self, f: defmt::Formatter<'_>) {
        self.names().for_each(|name| defmt::write!(f, "{=str} ", name));
    }
}

impl fmt::Display for CauseList {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:#06x}", self.0.bits())?;
        self.names().try_for_each(|name| write!(f, " {name}"))
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use std::string::ToString;

    const SECOND: u64 = 1_000_000;

    #[test]
    fn every_cause_is_counted_apart() {
        let (mut flags, mut health) = (StatusFlags::default(), Health::default());
        for bit in 0..16 {
            flags.add(Some(Diagnosis::from_bits_truncate(1 << bit)), 0, &mut health);
        }
        let low_bits = [health.diag_supply_low, health.diag_supply_high, health.diag_flash_update, health.diag_spi];
        assert_eq!((low_bits, health.diag_over_range, health.diag_flash_checksum), ([1; 4], 1, 1), "{health:?}");
        // Bit 5 and six sensors make 7, the alarms 2; bit 7 is undefined.
        assert_eq!((health.diag_self_test, health.diag_alarm, health.diag_reads), (7, 2, 16));
    }

    #[test]
    fn the_register_is_read_once_a_second_and_a_cause_is_logged_once_in_ten_minutes() {
        let (mut flags, mut health) = (StatusFlags::default(), Health::default());
        assert!(flags.is_due(0));
        let mut add = |flags: &mut StatusFlags, diagnosis, now_us| {
            flags.add(diagnosis, now_us, &mut health).map(|causes| causes.to_string())
        };
        let low = Some(Diagnosis::SUPPLY_LOW);
        assert_eq!(add(&mut flags, low, SECOND).as_deref(), Some("0x0001 supply_low"));
        assert!(!flags.is_due(2 * SECOND - 1) && flags.is_due(2 * SECOND));
        assert_eq!(add(&mut flags, low, 2 * SECOND), None);
        let both = add(&mut flags, Some(Diagnosis::SUPPLY_LOW | Diagnosis::OVER_RANGE), 3 * SECOND);
        assert_eq!(both.as_deref(), Some("0x0011 supply_low over_range"));
        assert_eq!(add(&mut flags, None, 4 * SECOND), None);
        assert!(add(&mut flags, low, 602 * SECOND).is_some());
    }
}
