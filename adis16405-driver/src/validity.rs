//! Validity of a burst: which faults it shows, whether its data are usable, and how often each fault has occurred.
//!
//! The part has no checksum and no sample counter, so the checks use the flags of the words, their plausibility and
//! their change from burst to burst.

use crate::burst::{Burst, OutputWord};
use crate::channel::Channel;

bitflags::bitflags! {
    /// The faults that a burst can show.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
    #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
    pub struct Faults: u16 {
        /// The new-data flag of at least one inertial word (gyroscopes and accelerometers) is clear: the word was read
        /// before. The flags of the other words are not used, since no source at hand confirms that supply,
        /// magnetometers, temperature and auxiliary input are refreshed with every sample.
        const NO_NEW_DATA = 1 << 0;
        /// The error/alarm flag of at least one word is set; DIAG_STAT holds the reason.
        const ERROR_ALARM = 1 << 1;
        /// Supply outside 4.75…5.25 V, the limits of DIAG_STAT bits 0 and 1.
        const SUPPLY = 1 << 2;
        /// All words are 0x0000: the data line is held low, or no part is connected.
        const STUCK_LOW = 1 << 3;
        /// All words are 0xFFFF: the data line is held high, or no part is connected.
        const STUCK_HIGH = 1 << 4;
        /// The six inertial words equal those of the previous burst. A warning only: where the noise is below one count
        /// or the filter is long, consecutive samples are often equal by chance (45 of 49,425 bursts of a real part; 37
        /// of the 45 differed in a magnetometer or supply word). The new-data flags tell whether a sample is new.
        const REPEATED = 1 << 5;
        /// The words are those of a valid burst, shifted by 1 to 15 bits: an SCK edge was lost or counted twice.
        const SHIFTED = 1 << 6;
        /// A gyro beyond ±7000 counts, where full scale is ±6000: a damaged word or a lost sign bit.
        const IMPOSSIBLE_RATE = 1 << 7;
        /// All twelve words have been equal for [`BurstValidator::FROZEN_AFTER`] bursts, which is over four times the
        /// length of the longest filter.
        const FROZEN = 1 << 8;
        /// The x rate may be a negative one that lost its sign bit: XGYRO_OFF is negative and the count is 1192 or
        /// more, which is what the sign erratum makes of −7000 and more. Detected only with
        /// [`BurstValidator::with_x_sign_at_risk`].
        const X_SIGN = 1 << 9;
    }
}

impl Faults {
    /// Largest gyro count, of either sign, that is not an [`IMPOSSIBLE_RATE`](Self::IMPOSSIBLE_RATE): full scale is ±6000 in
    /// every range, and a part may exceed it somewhat.
    pub const LARGEST_RATE: i16 = 7000;

    /// Every fault with its name in reports. Where several are present, the one nearest to the root cause comes first.
    pub const CAUSES: [(Faults, &'static str); 10] = [
        (Faults::STUCK_LOW, "stuck_low"),
        (Faults::STUCK_HIGH, "stuck_high"),
        (Faults::SHIFTED, "shifted"),
        (Faults::NO_NEW_DATA, "no_new_data"),
        (Faults::FROZEN, "frozen"),
        (Faults::IMPOSSIBLE_RATE, "impossible_rate"),
        (Faults::X_SIGN, "x_sign"),
        (Faults::REPEATED, "repeated"),
        (Faults::ERROR_ALARM, "error_alarm"),
        (Faults::SUPPLY, "supply"),
    ];

    /// The name of the first fault present in the order of [`CAUSES`](Self::CAUSES); `None` without a fault. A burst of
    /// zeros, for example, also lacks new data and shows no supply, but its cause is `stuck_low`.
    pub fn cause(self) -> Option<&'static str> {
        self.causes().next()
    }

    /// The names of all faults present, in the order of [`CAUSES`](Self::CAUSES).
    pub fn causes(self) -> impl Iterator<Item = &'static str> {
        Self::CAUSES.into_iter().filter(move |(fault, _)| self.contains(*fault)).map(|(_, name)| name)
    }

    /// True if none but [`REPEATED`](Self::REPEATED) is present.
    fn leave_data_usable(self) -> bool {
        Self::REPEATED.contains(self)
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for Faults {
    fn format(&self, formatter: defmt::Formatter<'_>) {
        defmt::write!(formatter, "Faults({=u16:#x})", self.bits());
    }
}

/// Supply counts of 2.418 mV inside 4.75…5.25 V.
const SUPPLY_COUNTS: core::ops::RangeInclusive<i16> = 1965..=2171;

impl Burst {
    /// The faults that this burst shows without knowledge of others. [`Faults::REPEATED`], [`Faults::FROZEN`] and
    /// [`Faults::X_SIGN`] need a [`BurstValidator`].
    pub fn faults(&self) -> Faults {
        let words = &self.words;
        let all = words.iter().fold(u16::MAX, |all, word| all & word.0);
        let any = words.iter().fold(0, |any, word| any | word.0);
        let inertial = words[INERTIAL_WORDS].iter().fold(u16::MAX, |all, word| all & word.0);
        let possible =
            |channel| (-Faults::LARGEST_RATE..=Faults::LARGEST_RATE).contains(&words[channel as usize].counts(channel));
        let rates_are_possible = possible(Channel::GyroX) && possible(Channel::GyroY) && possible(Channel::GyroZ);

        let mut faults = Faults::empty();
        faults.set(Faults::NO_NEW_DATA, !OutputWord(inertial).new_data());
        faults.set(Faults::ERROR_ALARM, OutputWord(any).error_alarm());
        faults.set(Faults::SUPPLY, !supply_in_range(words[Channel::Supply as usize]));
        faults.set(Faults::STUCK_LOW, any == 0x0000);
        faults.set(Faults::STUCK_HIGH, all == 0xFFFF);
        faults.set(Faults::IMPOSSIBLE_RATE, !rates_are_possible);
        // A shifted burst also has an implausible supply and, in any of its words, a clear new-data flag.
        let stuck = faults.intersects(Faults::STUCK_LOW | Faults::STUCK_HIGH);
        if faults.contains(Faults::SUPPLY) && !OutputWord(all).new_data() && !stuck {
            faults.set(Faults::SHIFTED, is_shifted(words));
        }
        faults
    }
}

fn supply_in_range(word: OutputWord) -> bool {
    SUPPLY_COUNTS.contains(&word.counts(Channel::Supply))
}

/// Searches for a shift by which the inertial words get a set new-data flag, and eleven words equal error/alarm flags,
/// since the part sets that flag in all words or in none. Where the words came up to a byte late, the first shifted word
/// is the supply and must be in range. Where they came early, it is the x rate, of which any value is accepted; the
/// supply, partly lost, is not checked.
fn is_shifted(words: &[OutputWord; 12]) -> bool {
    let new = |words: &[OutputWord]| words.iter().all(|word| word.new_data());
    (1..16).any(|bits| {
        let moved: [OutputWord; 11] =
            core::array::from_fn(|n| OutputWord(words[n].0 << bits | words[n + 1].0 >> (16 - bits)));
        let late = bits <= 8 && supply_in_range(moved[0]) && new(&moved[1..7]);
        let early = bits >= 8 && new(&moved[..6]);
        (late || early) && moved.iter().all(|word| word.error_alarm() == moved[0].error_alarm())
    })
}

/// True for an x rate that may be a negative one without its sign bit, 2¹³.
fn may_have_lost_its_sign(x: i16) -> bool {
    x >= (1 << 13) - Faults::LARGEST_RATE
}

/// Whether the data of a burst are usable, and the faults that it shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Validity {
    /// The faults found.
    pub faults: Faults,
    /// True if there is no fault other than [`Faults::REPEATED`]: leaving out equal neighbours would bias the noise
    /// estimate upwards.
    pub usable: bool,
}

/// Number of bursts that showed each fault. All counts saturate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FaultCounters {
    /// Bursts validated.
    pub bursts: u32,
    /// Bursts that were not [usable](Validity::usable).
    pub unusable: u32,
    by_cause: [u32; Faults::CAUSES.len()],
}

impl FaultCounters {
    /// Number of bursts with each fault, by its name; one burst may count under several.
    pub fn by_cause(&self) -> impl Iterator<Item = (&'static str, u32)> {
        Faults::CAUSES.into_iter().zip(self.by_cause).map(|((_, name), count)| (name, count))
    }

    /// Number of bursts with the fault; for several flags, the sum of their numbers.
    pub fn get(&self, faults: Faults) -> u32 {
        Faults::CAUSES
            .into_iter()
            .zip(self.by_cause)
            .filter(|((fault, _), _)| faults.contains(*fault))
            .fold(0, |sum: u32, (_, count)| sum.saturating_add(count))
    }

    fn add(&mut self, faults: Faults) {
        self.bursts = self.bursts.saturating_add(1);
        self.unusable = self.unusable.saturating_add(u32::from(!faults.leave_data_usable()));
        if !faults.is_empty() {
            for ((fault, _), count) in Faults::CAUSES.into_iter().zip(&mut self.by_cause) {
                *count = count.saturating_add(u32::from(faults.contains(fault)));
            }
        }
    }
}

/// The positions of the inertial words in a burst.
const INERTIAL_WORDS: core::ops::RangeInclusive<usize> = Channel::GyroX as usize..=Channel::AcclZ as usize;
/// The 14 bits of an output word below its flags.
const DATA: u16 = 0x3FFF;
/// Gyroscopes and accelerometers, bit n for channel n.
const INERTIAL: u16 = 0b0000_0111_1110;
/// All channels, bit n for channel n.
const ALL: u16 = 0b1111_1111_1111;

/// Validates the bursts of one part in the order in which they were read, and counts their faults.
#[derive(Clone, Copy, Debug, Default)]
pub struct BurstValidator {
    previous: Option<[OutputWord; 12]>,
    /// Number of consecutive earlier bursts that equal the latest one.
    equal: u16,
    x_sign_at_risk: bool,
    counters: FaultCounters,
}

impl BurstValidator {
    /// Number of bursts equal to their predecessor after which [`Faults::FROZEN`] is raised.
    pub const FROZEN_AFTER: u16 = 512;

    /// Sets whether x rates can lose their sign bit ([`Adis16405::x_sign_at_risk`](crate::Adis16405::x_sign_at_risk)).
    /// If so, rates that may have lost it are marked as [`Faults::X_SIGN`]. The default is false.
    #[must_use]
    pub const fn with_x_sign_at_risk(mut self, at_risk: bool) -> Self {
        self.x_sign_at_risk = at_risk;
        self
    }

    /// Validates the next burst and adds its faults to the counters. The first burst cannot be a repetition.
    pub fn validate(&mut self, burst: &Burst) -> Validity {
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
        faults.set(Faults::FROZEN, self.equal >= Self::FROZEN_AFTER);
        let x = burst.words[Channel::GyroX as usize].counts(Channel::GyroX);
        faults.set(Faults::X_SIGN, self.x_sign_at_risk && may_have_lost_its_sign(x));
        self.counters.add(faults);
        Validity { faults, usable: faults.leave_data_usable() }
    }

    /// The number of bursts validated so far, and of their faults.
    pub const fn counters(&self) -> &FaultCounters {
        &self.counters
    }
}
