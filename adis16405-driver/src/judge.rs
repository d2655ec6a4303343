//! Whether a burst can be believed, and how often each fault was seen.

use crate::channel::Channel;
use crate::fault::{FROZEN_AFTER, Faults, may_have_lost_its_sign};
use crate::frame::{Burst, OutputWord};

fn usable(faults: Faults) -> bool {
    Faults::REPEATED.contains(faults)
}

/// The judgement of one burst.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Verdict {
    /// What is wrong with it.
    pub faults: Faults,
    /// True if nothing is, [`Faults::REPEATED`] aside: leaving out equal neighbours would bias the noise upwards.
    pub usable: bool,
}

/// How many bursts showed each fault; all counts saturate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Counters {
    /// Bursts judged.
    pub bursts: u32,
    /// Bursts that were not [usable](Verdict::usable).
    pub unusable: u32,
    by_cause: [u32; Faults::CAUSES.len()],
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
        if !faults.is_empty() {
            for ((fault, _), count) in Faults::CAUSES.into_iter().zip(&mut self.by_cause) {
                *count = count.saturating_add(u32::from(faults.contains(fault)));
            }
        }
    }
}

/// The bits of an output word below its flags.
const DATA: u16 = 0x3FFF;
/// Gyros and accelerometers, as bits.
const INERTIAL: u16 = 0b0000_0111_1110;
/// All channels, as bits.
const ALL: u16 = 0b1111_1111_1111;

/// Judges bursts one after the other.
#[derive(Clone, Copy, Debug, Default)]
pub struct Judge {
    previous: Option<[OutputWord; 12]>,
    /// Bursts before the latest that were equal to it, one after the other.
    equal: u16,
    x_sign_at_risk: bool,
    counters: Counters,
}

impl Judge {
    /// Whether the sign of x rates can be lost ([`Adis16405::x_sign_at_risk`](crate::Adis16405::x_sign_at_risk)): then
    /// rates that may have lost it are marked as [`Faults::X_SIGN`]. False unless set.
    #[must_use]
    pub const fn with_x_sign_at_risk(mut self, at_risk: bool) -> Self {
        self.x_sign_at_risk = at_risk;
        self
    }

    /// Judges the next burst. The first one cannot be a repetition.
    pub fn judge(&mut self, burst: &Burst) -> Verdict {
        let (repeated, all_equal) = match &self.previous {
            None => (false, false),
            Some(previous) => {
                // Bit n for channel n.
                let equal = |mask: u16, (n, (now, before)): (usize, (&OutputWord, &OutputWord))| {
                    mask | u16::from((now.0 ^ before.0) & DATA == 0) << n
                };
                let equal = burst.words.iter().zip(previous).enumerate().fold(0, equal);
                (equal & INERTIAL == INERTIAL, equal == ALL)
            }
        };
        self.equal = if all_equal { self.equal.saturating_add(1) } else { 0 };
        self.previous = Some(burst.words);

        let mut faults = burst.faults();
        faults.set(Faults::REPEATED, repeated);
        faults.set(Faults::FROZEN, self.equal >= FROZEN_AFTER);
        let x = burst.words[Channel::GyroX as usize].counts(Channel::GyroX);
        faults.set(Faults::X_SIGN, self.x_sign_at_risk && may_have_lost_its_sign(x));
        self.counters.add(faults);
        Verdict { faults, usable: usable(faults) }
    }

    /// What was seen so far.
    pub const fn counters(&self) -> &Counters {
        &self.counters
    }
}
