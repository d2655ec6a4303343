//! Whether a burst can be believed: faults by cause, and how often each was seen.

use crate::channel::Channel;
use crate::frame::{Burst, OutputWord};

bitflags::bitflags! {
    /// Reasons to doubt a burst.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
    pub struct Faults: u8 {
        /// The new-data bit of some word is clear: it was read before.
        const NO_NEW_DATA = 1 << 0;
        /// The error/alarm bit of some word is set: DIAG_STAT says why.
        const ERROR_ALARM = 1 << 1;
        /// Supply outside 4.75…5.25 V (the limits of DIAG_STAT bits 0 and 1).
        const SUPPLY = 1 << 2;
        /// All words are 0x0000: data line held low, or an absent part.
        const STUCK_LOW = 1 << 3;
        /// All words are 0xFFFF: data line held high, or an absent part.
        const STUCK_HIGH = 1 << 4;
        /// The six inertial words equal those of the burst before. A warning only: where noise is small against a count
        /// or the filter is long, a new sample often equals the last by chance (of 49,425 bursts of a real part 45 did,
        /// 37 of them with other magnetometer or supply words). Whether a sample is new is told by the new-data bits.
        const REPEATED = 1 << 5;
    }
}

impl Faults {
    /// Every fault with its name in reports, the most fundamental first.
    pub const CAUSES: [(Faults, &'static str); 6] = [
        (Faults::STUCK_LOW, "stuck_low"),
        (Faults::STUCK_HIGH, "stuck_high"),
        (Faults::NO_NEW_DATA, "no_new_data"),
        (Faults::REPEATED, "repeated"),
        (Faults::ERROR_ALARM, "error_alarm"),
        (Faults::SUPPLY, "supply"),
    ];

    /// The name of the most fundamental fault present: a frame of zeros also lacks new data and shows no supply, but
    /// its cause is `stuck_low`. `None` without a fault.
    pub fn cause(self) -> Option<&'static str> {
        self.causes().next()
    }

    /// The names of all faults present, in the order of [`CAUSES`](Self::CAUSES).
    pub fn causes(self) -> impl Iterator<Item = &'static str> {
        Self::CAUSES.into_iter().filter(move |(fault, _)| self.contains(*fault)).map(|(_, name)| name)
    }
}

/// Counts of 2.418 mV inside 4.75…5.25 V.
const SUPPLY_COUNTS: core::ops::RangeInclusive<i16> = 1965..=2171;

pub(crate) fn burst_faults(burst: &Burst) -> Faults {
    let words = &burst.words;
    let supply = words[Channel::Supply as usize].counts(Channel::Supply);
    let mut faults = Faults::empty();
    faults.set(Faults::NO_NEW_DATA, words.iter().any(|word| !word.new_data()));
    faults.set(Faults::ERROR_ALARM, words.iter().any(|word| word.error_alarm()));
    faults.set(Faults::SUPPLY, !SUPPLY_COUNTS.contains(&supply));
    faults.set(Faults::STUCK_LOW, words.iter().all(|word| word.0 == 0x0000));
    faults.set(Faults::STUCK_HIGH, words.iter().all(|word| word.0 == 0xFFFF));
    faults
}

fn usable(faults: Faults) -> bool {
    Faults::REPEATED.contains(faults)
}

/// The judgement of one burst.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Verdict {
    /// What is wrong with it.
    pub faults: Faults,
    /// True if nothing is, [`Faults::REPEATED`] aside: leaving out equal neighbours would bias the noise upwards.
    pub usable: bool,
}

/// How many bursts showed each fault; all counts saturate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Bursts judged.
    pub bursts: u32,
    /// Bursts that were not [usable](Verdict::usable).
    pub unusable: u32,
    by_cause: [u32; 6],
}

impl Counters {
    /// Bursts in which each fault was present, by name; one burst may count under several.
    pub fn by_cause(&self) -> impl Iterator<Item = (&'static str, u32)> {
        Faults::CAUSES.into_iter().zip(self.by_cause).map(|((_, name), count)| (name, count))
    }

    /// In how many bursts the fault was present; for several flags, the sum.
    pub fn get(&self, faults: Faults) -> u32 {
        Faults::CAUSES
            .into_iter()
            .zip(self.by_cause)
            .filter(|((fault, _), _)| faults.contains(*fault))
            .fold(0, |sum: u32, (_, count)| sum.saturating_add(count))
    }

    fn add(&mut self, faults: Faults) {
        self.bursts = self.bursts.saturating_add(1);
        self.unusable = self.unusable.saturating_add(u32::from(!usable(faults)));
        for ((fault, _), count) in Faults::CAUSES.into_iter().zip(&mut self.by_cause) {
            *count = count.saturating_add(u32::from(faults.contains(fault)));
        }
    }
}

/// Judges bursts one after the other.
#[derive(Clone, Copy, Debug, Default)]
pub struct Judge {
    previous: Option<[OutputWord; 6]>,
    counters: Counters,
}

impl Judge {
    /// Judges the next burst. The first one cannot be a repetition.
    pub fn judge(&mut self, burst: &Burst) -> Verdict {
        let inertial = Channel::INERTIAL.map(|channel| OutputWord(burst.words[channel as usize].0 & 0x3FFF));
        let mut faults = burst.faults();
        faults.set(Faults::REPEATED, self.previous == Some(inertial));
        self.previous = Some(inertial);
        self.counters.add(faults);
        Verdict { faults, usable: usable(faults) }
    }

    /// What was seen so far.
    pub const fn counters(&self) -> &Counters {
        &self.counters
    }
}
