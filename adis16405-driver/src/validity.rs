//! Validity of a burst by flags, plausibility and changes: faults, refused channels, counts.

use crate::burst::{Burst, OutputWord};
use crate::channel::{Channel, ChannelMask};

bitflags::bitflags! {
    /// The faults that a burst can show.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
    #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
    pub struct Faults: u16 {
        /// The new-data flag of an inertial word is clear: it was read before.
        const NO_NEW_DATA = 1 << 0;
        /// The error/alarm flag of at least one word is set; DIAG_STAT holds the reason.
        const ERROR_ALARM = 1 << 1;
        /// Supply outside 4.75…5.25 V (DIAG_STAT bits 0 and 1, data sheet Rev. B, Table 23); the part goes on
        /// measuring.
        const SUPPLY = 1 << 2;
        /// All words are 0x0000: the data line is held low, or no part is connected.
        const STUCK_LOW = 1 << 3;
        /// Temperature and auxiliary input are 0xFFFF: line held high, no part, or a burst that ended early.
        const STUCK_HIGH = 1 << 4;
        /// The six inertial words equal the previous ones, a warning: often chance (45 of 49,425 bursts of a real
        /// part). The new-data flags tell whether a sample is new.
        const REPEATED = 1 << 5;
        /// The words are those of a valid burst, shifted by 1 to 15 bits: an SCK edge was lost or counted twice.
        const SHIFTED = 1 << 6;
        /// A gyro count is beyond ±7000, where full scale is ±6000: a damaged word or a lost sign bit.
        const IMPOSSIBLE_RATE = 1 << 7;
        /// All twelve words equal for [`BurstValidator::FROZEN_AFTER`] bursts, four times the longest filter.
        const FROZEN = 1 << 8;
        /// XGYRO_OFF is negative and the count 1192 or more, the sign erratum's image of −7000 and more. Detected only
        /// with [`BurstValidator::with_x_sign_at_risk`].
        const X_SIGN = 1 << 9;
        /// Supply below 3.0 V or above 6.0 V (data sheet Rev. B, Table 3): not sent by a running part. Not set for a
        /// stuck or shifted burst.
        const IMPLAUSIBLE_SUPPLY = 1 << 10;
        /// The error/alarm flag is set in some words only: bits are damaged. Not set for a shifted burst.
        const MIXED_ALARM = 1 << 11;
    }
}

impl Faults {
    /// Largest magnitude of a gyro count without [`IMPOSSIBLE_RATE`](Self::IMPOSSIBLE_RATE); full scale is ±6000.
    pub const LARGEST_RATE: i16 = 7000;

    /// Faults for which a sample is not refused: supply outside its window, flags in DIAG_STAT, and chance repeats,
    /// whose refusal would bias the noise.
    pub const WARNINGS: Faults = Faults::REPEATED.union(Faults::SUPPLY).union(Faults::ERROR_ALARM);

    /// Faults of single inertial words; each refuses only the channel of its word.
    pub const OF_CHANNELS: Faults = Faults::NO_NEW_DATA.union(Faults::IMPOSSIBLE_RATE).union(Faults::X_SIGN);

    /// Default refusal of [`BurstValidator::with_refused_faults`]: all but the [`WARNINGS`](Self::WARNINGS).
    pub const REFUSED: Faults = Faults::all().difference(Faults::WARNINGS);

    /// Faults with their names in reports, the nearest to the root cause first, [`WARNINGS`](Self::WARNINGS) last.
    pub const CAUSES: [(Faults, &'static str); 12] = [
        (Faults::STUCK_LOW, "stuck_low"),
        (Faults::STUCK_HIGH, "stuck_high"),
        (Faults::SHIFTED, "shifted"),
        (Faults::IMPLAUSIBLE_SUPPLY, "implausible_supply"),
        (Faults::MIXED_ALARM, "mixed_alarm"),
        (Faults::NO_NEW_DATA, "no_new_data"),
        (Faults::FROZEN, "frozen"),
        (Faults::IMPOSSIBLE_RATE, "impossible_rate"),
        (Faults::X_SIGN, "x_sign"),
        (Faults::REPEATED, "repeated"),
        (Faults::ERROR_ALARM, "error_alarm"),
        (Faults::SUPPLY, "supply"),
    ];

    /// The name of the first fault in the order of [`CAUSES`](Self::CAUSES): zeros are `stuck_low`, although their data
    /// and supply are wrong too.
    pub fn cause(self) -> Option<&'static str> {
        self.causes().next()
    }

    /// The names of all faults present, in the order of [`CAUSES`](Self::CAUSES).
    pub fn causes(self) -> impl Iterator<Item = &'static str> {
        Self::CAUSES.into_iter().filter(move |(fault, _)| self.contains(*fault)).map(|(_, name)| name)
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
/// Supply counts of 2.418 mV from 3.0 V to 6.0 V.
const PLAUSIBLE_SUPPLY_COUNTS: core::ops::RangeInclusive<i16> = 1241..=2481;

impl Burst {
    /// Faults of this burst alone; [`Faults::REPEATED`], [`Faults::FROZEN`] and [`Faults::X_SIGN`] need a
    /// [`BurstValidator`].
    pub fn faults(&self) -> Faults {
        let words = &self.words;
        let all = words.iter().fold(u16::MAX, |all, word| all & word.0);
        let any = words.iter().fold(0, |any, word| any | word.0);
        let inertial = words[INERTIAL_WORDS].iter().fold(u16::MAX, |all, word| all & word.0);
        let rates_are_possible = GYROS.into_iter().all(|channel| self.rate_is_possible(channel));

        let mut faults = Faults::empty();
        faults.set(Faults::NO_NEW_DATA, !OutputWord(inertial).new_data());
        faults.set(Faults::ERROR_ALARM, OutputWord(any).error_alarm());
        faults.set(Faults::SUPPLY, !supply_in_range(words[Channel::Supply as usize]));
        faults.set(Faults::STUCK_LOW, any == 0x0000);
        faults.set(Faults::STUCK_HIGH, words[10..].iter().all(|word| word.0 == 0xFFFF));
        faults.set(Faults::IMPOSSIBLE_RATE, !rates_are_possible);
        // A shifted burst also has an implausible supply and, in any of its words, a clear new-data flag.
        let stuck = faults.intersects(Faults::STUCK_LOW | Faults::STUCK_HIGH);
        if faults.contains(Faults::SUPPLY) && !OutputWord(all).new_data() && !stuck {
            faults.set(Faults::SHIFTED, is_shifted(words));
        }
        if faults.contains(Faults::SUPPLY) && !stuck && !faults.contains(Faults::SHIFTED) {
            let counts = words[Channel::Supply as usize].counts(Channel::Supply);
            faults.set(Faults::IMPLAUSIBLE_SUPPLY, !PLAUSIBLE_SUPPLY_COUNTS.contains(&counts));
        }
        let in_some_words = faults.contains(Faults::ERROR_ALARM) && !OutputWord(all).error_alarm();
        faults.set(Faults::MIXED_ALARM, in_some_words && !faults.contains(Faults::SHIFTED));
        faults
    }

    fn rate_is_possible(&self, gyro: Channel) -> bool {
        (-Faults::LARGEST_RATE..=Faults::LARGEST_RATE).contains(&self.words[gyro as usize].counts(gyro))
    }

    /// Channels refused by `faults`: that of the word for a word's fault, else all.
    fn refused_channels(&self, faults: Faults) -> ChannelMask {
        if faults.is_empty() {
            return ChannelMask::EMPTY;
        }
        if !Faults::OF_CHANNELS.contains(faults) {
            return ChannelMask::ALL;
        }
        let mut refused = ChannelMask::EMPTY;
        for channel in Channel::INERTIAL {
            let is_old = faults.contains(Faults::NO_NEW_DATA) && !self.words[channel as usize].new_data();
            let is_impossible =
                faults.contains(Faults::IMPOSSIBLE_RATE) && GYROS.contains(&channel) && !self.rate_is_possible(channel);
            let may_lack_sign = faults.contains(Faults::X_SIGN) && channel == Channel::GyroX;
            if is_old || is_impossible || may_lack_sign {
                refused = refused.with(channel);
            }
        }
        if refused == ChannelMask::INERTIAL { ChannelMask::ALL } else { refused }
    }
}

const GYROS: [Channel; 3] = [Channel::GyroX, Channel::GyroY, Channel::GyroZ];

fn supply_in_range(word: OutputWord) -> bool {
    SUPPLY_COUNTS.contains(&word.counts(Channel::Supply))
}

/// True if a shift exists that sets the inertial new-data flags, makes eleven error/alarm flags equal, and the supply
/// valid.
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

/// True if x may be a negative rate without its sign bit, 2¹³.
fn may_have_lost_its_sign(x: i16) -> bool {
    x >= (1 << 13) - Faults::LARGEST_RATE
}

/// Faults of a burst, and the channels that they refuse. [`read`](crate::Adis16405::read), devices and recordings share
/// this rule.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct Validity {
    /// The faults found.
    pub faults: Faults,
    /// Channels not to be used: those of single words' faults ([`Faults::OF_CHANNELS`]), or all if any other fault is
    /// not a [warning](Faults::WARNINGS).
    pub refused: ChannelMask,
}

impl Validity {
    /// True if no channel is refused.
    pub const fn is_usable(self) -> bool {
        self.refused.is_empty()
    }
}

/// Number of bursts that showed each fault. All counts saturate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct FaultCounters {
    /// Bursts validated.
    pub bursts: u32,
    /// Bursts of which at least one channel was refused.
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

    fn add(&mut self, Validity { faults, refused }: Validity) {
        self.bursts = self.bursts.saturating_add(1);
        self.unusable = self.unusable.saturating_add(u32::from(!refused.is_empty()));
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
#[derive(Clone, Copy, Debug)]
pub struct BurstValidator {
    previous: Option<[OutputWord; 12]>,
    /// Number of consecutive earlier bursts that equal the latest one.
    equal: u16,
    x_sign_at_risk: bool,
    refused_faults: Faults,
    counters: FaultCounters,
}

impl Default for BurstValidator {
    fn default() -> Self {
        Self {
            previous: None,
            equal: 0,
            x_sign_at_risk: false,
            refused_faults: Faults::REFUSED,
            counters: FaultCounters::default(),
        }
    }
}

impl BurstValidator {
    /// Number of bursts equal to their predecessor after which [`Faults::FROZEN`] is raised.
    pub const FROZEN_AFTER: u16 = 512;

    /// Marks possible [`Faults::X_SIGN`] ([`Adis16405::x_sign_at_risk`](crate::Adis16405::x_sign_at_risk)); false by
    /// default.
    #[must_use]
    pub const fn with_x_sign_at_risk(mut self, at_risk: bool) -> Self {
        self.x_sign_at_risk = at_risk;
        self
    }

    /// Sets the faults that refuse, [`Faults::REFUSED`] by default; `Faults::SUPPLY` refuses a sample at 4.7 V too.
    /// Others are only counted.
    #[must_use]
    pub const fn with_refused_faults(mut self, faults: Faults) -> Self {
        self.refused_faults = faults;
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
        let validity = Validity { faults, refused: burst.refused_channels(faults & self.refused_faults) };
        self.counters.add(validity);
        validity
    }

    /// The number of bursts validated so far, and of their faults.
    pub const fn counters(&self) -> &FaultCounters {
        &self.counters
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counters_stay_at_their_largest_value() {
        const LAST: u32 = u32::MAX - 1;
        let mut counters = FaultCounters { bursts: LAST, unusable: LAST, by_cause: [LAST; Faults::CAUSES.len()] };
        let all = Validity { faults: Faults::all(), refused: ChannelMask::ALL };
        for _ in 0..3 {
            counters.add(all);
        }
        assert_eq!((counters.bursts, counters.unusable), (u32::MAX, u32::MAX));
        assert!(counters.by_cause().all(|(_, count)| count == u32::MAX));
        assert_eq!(counters.get(Faults::all()), u32::MAX);
    }
}
