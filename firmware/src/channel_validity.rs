//! Which channels of a burst are used: a fault of one channel refuses that channel alone, one of the frame all of them.

use crate::channels::{CHANNELS, ChannelSet, GYROS, INERTIAL};
use adis16405_driver::{Burst, Channel, Faults};

/// Faults with which the samples are used: neighbours that are equal by chance, a supply outside its window, and flags in
/// DIAG_STAT, which stay set until the register is read.
const WARNINGS: Faults = Faults::REPEATED.union(Faults::SUPPLY).union(Faults::ERROR_ALARM);
/// Faults of single inertial channels.
const OF_CHANNELS: Faults = Faults::NO_NEW_DATA.union(Faults::IMPOSSIBLE_RATE).union(Faults::X_SIGN);
/// Supply in counts of 2.418 mV from 3.0 V to 6.0 V. The sensor does not run with less, and 6.0 V is its absolute maximum
/// rating: a word beyond these limits was not sent by a sensor.
const PLAUSIBLE_SUPPLY: core::ops::RangeInclusive<i16> = 1241..=2481;

/// Whether the supply word is one that a running sensor can send.
pub(crate) fn supply_is_plausible(burst: &Burst) -> bool {
    let word = burst.words[Channel::Supply as usize];
    PLAUSIBLE_SUPPLY.contains(&word.counts(Channel::Supply))
}

/// The channels of a burst that are refused, by the faults that the validator has found.
///
/// Temperature and supply are refused only if no inertial word is new: no source confirms that they are refreshed with every
/// sample.
pub(crate) fn refused_channels(burst: &Burst, faults: Faults) -> ChannelSet {
    let implausible = faults.contains(Faults::SUPPLY) && !supply_is_plausible(burst);
    if implausible || !(WARNINGS | OF_CHANNELS).contains(faults) {
        return ChannelSet::ALL;
    }
    let mut refused = ChannelSet::EMPTY;
    if WARNINGS.contains(faults) {
        return refused;
    }
    for (index, channel) in CHANNELS.into_iter().enumerate().take(INERTIAL) {
        let word = burst.words[channel as usize];
        let impossible =
            index < GYROS && !(-Faults::LARGEST_RATE..=Faults::LARGEST_RATE).contains(&word.counts(channel));
        let sign_lost = channel == Channel::GyroX && faults.contains(Faults::X_SIGN);
        refused.insert_if(index, !word.new_data() || impossible || sign_lost);
    }
    // A fault of channels that no channel shows, and a burst without a new sample, refuse everything.
    if refused.is_empty() || refused.has_all_inertial() { ChannelSet::ALL } else { refused }
}

/// Whether the samples of a burst with these faults are marked: used, with a warning.
pub(crate) fn is_marked(faults: Faults) -> bool {
    faults.intersects(Faults::SUPPLY | Faults::ERROR_ALARM)
}

#[cfg(test)]
mod tests {
    use super::*;
    use adis16405_driver::{Counts, OutputWord};

    /// A burst at 5.00 V with small counts.
    fn burst() -> Burst {
        Burst::from_counts(&Counts::new([2068, 1, 2, 3, 4, 5, 300, 7, 8, 9, 10, 11]))
    }

    fn refused(change: impl FnOnce(&mut Burst)) -> u8 {
        let mut burst = burst();
        change(&mut burst);
        refused_channels(&burst, burst.faults()).0
    }

    fn set_supply(burst: &mut Burst, counts: i16) {
        burst.words[0] = OutputWord::from_counts(Channel::Supply, counts);
    }

    #[test]
    fn a_fault_of_one_channel_refuses_that_channel() {
        assert_eq!(refused(|_| ()), 0);
        assert_eq!(refused(|burst| burst.words[2] = OutputWord::from_counts(Channel::GyroY, -7001)), 0b10);
        assert_eq!(refused(|burst| burst.words[5].0 &= 0x7FFF), 0b1_0000, "accelerometer y was not refreshed");
        assert_eq!(refused(|burst| burst.words[10].0 &= 0x7FFF), 0, "the temperature may be refreshed slowly");
        assert_eq!(refused_channels(&burst(), Faults::X_SIGN).0, 0b1);
    }

    #[test]
    fn a_fault_of_the_frame_refuses_every_channel() {
        assert_eq!(refused(|burst| burst.words = [OutputWord(0); 12]), 0xFF);
        assert_eq!(refused(|burst| burst.words = [OutputWord(0xFFFF); 12]), 0xFF);
        assert_eq!(refused(|burst| burst.words.iter_mut().for_each(|word| word.0 &= 0x7FFF)), 0xFF, "an old sample");
        for frame in [Faults::SHIFTED, Faults::FROZEN] {
            assert_eq!(refused_channels(&burst(), frame).0, 0xFF);
        }
        let all_flags = |burst: &mut Burst| burst.words.iter_mut().for_each(|word| word.0 |= 0x4000);
        assert_eq!(refused(all_flags), 0, "an error flag is a warning");
    }

    /// 4.70 V, as from a USB port, and 5.40 V are warnings; 1 V and 8 V were not sent by a sensor.
    #[test]
    fn a_supply_outside_its_window_is_a_warning() {
        for (volts, expected) in [(4.70, 0), (5.40, 0), (4.3, 0), (1.0, 0xFF), (8.0, 0xFF), (0.0, 0xFF)] {
            let counts = (volts / 2.418e-3_f64) as i16;
            assert_eq!(refused(|burst| set_supply(burst, counts)), expected, "{volts} V");
        }
    }
}
