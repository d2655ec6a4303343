//! Reasons to doubt a burst, and those that it shows by itself.

use crate::channel::Channel;
use crate::frame::{Burst, OutputWord};

bitflags::bitflags! {
    /// Reasons to doubt a burst.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
    #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
    pub struct Faults: u16 {
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
        /// Moved by one to fifteen bits the words are those of a good burst: a clock was lost or counted twice.
        const SHIFTED = 1 << 6;
        /// A gyro beyond ±7000 counts, where ±6000 is full scale: no motion, but a damaged word or a lost sign.
        const IMPOSSIBLE_RATE = 1 << 7;
        /// All twelve words have been equal for [`FROZEN_AFTER`] bursts: far longer than four times the longest filter.
        const FROZEN = 1 << 8;
        /// The x rate may be a negative one without its sign: XGYRO_OFF is negative and the count is 1192 or more, which is
        /// what the sign erratum makes of −7000 and more. Only seen by a judge
        /// [that was told](crate::Judge::with_x_sign_at_risk).
        const X_SIGN = 1 << 9;
    }
}

/// Equal bursts after which [`Faults::FROZEN`] is raised.
pub const FROZEN_AFTER: u16 = 512;

impl Faults {
    /// Every fault with its name in reports, the most fundamental first.
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
/// Beyond full scale (±6000 counts in every range) by as much as a part may be.
const GREATEST_RATE: i16 = 7000;

pub(crate) fn burst_faults(burst: &Burst) -> Faults {
    let words = &burst.words;
    let all = words.iter().fold(u16::MAX, |all, word| all & word.0);
    let any = words.iter().fold(0, |any, word| any | word.0);
    let possible = |channel| (-GREATEST_RATE..=GREATEST_RATE).contains(&words[channel as usize].counts(channel));
    let rates_are_possible = possible(Channel::GyroX) && possible(Channel::GyroY) && possible(Channel::GyroZ);

    let mut faults = Faults::empty();
    faults.set(Faults::NO_NEW_DATA, !OutputWord(all).new_data());
    faults.set(Faults::ERROR_ALARM, OutputWord(any).error_alarm());
    faults.set(Faults::SUPPLY, !supply_is_right(words[Channel::Supply as usize]));
    faults.set(Faults::STUCK_LOW, any == 0x0000);
    faults.set(Faults::STUCK_HIGH, all == 0xFFFF);
    faults.set(Faults::IMPOSSIBLE_RATE, !rates_are_possible);
    // A shift spoils the supply and, of twelve words, some new-data bit.
    let stuck = faults.intersects(Faults::STUCK_LOW | Faults::STUCK_HIGH);
    if faults.contains(Faults::NO_NEW_DATA | Faults::SUPPLY) && !stuck {
        faults.set(Faults::SHIFTED, is_shifted(words));
    }
    faults
}

/// True for an x rate that a negative one may have become by the loss of its sign bit, 2¹³.
pub(crate) fn may_have_lost_its_sign(x: i16) -> bool {
    x >= (1 << 13) - GREATEST_RATE
}

fn supply_is_right(word: OutputWord) -> bool {
    SUPPLY_COUNTS.contains(&word.counts(Channel::Supply))
}

/// Looks for a shift that gives eleven words with new data. If the words came late, by up to a byte, the first of them is
/// the supply and must be right; if they came early, it is the x rate and says nothing, and the part of the supply that is
/// lost is not looked at.
fn is_shifted(words: &[OutputWord; 12]) -> bool {
    (1..16).any(|bits| {
        let mut moved = words.windows(2).map(|pair| OutputWord(pair[0].0 << bits | pair[1].0 >> (16 - bits)));
        let late = bits <= 8 && moved.clone().next().is_some_and(supply_is_right);
        (late || bits >= 8) && moved.all(OutputWord::new_data)
    })
}
