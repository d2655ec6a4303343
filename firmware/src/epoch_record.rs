//! The words of a finished epoch in retained RAM, so that a restart while learning does not lose it.

use crate::channels::{CHANNELS, OCTAVES};
use crate::cross_sums::{CROSS_OCTAVES, PAIRS};
use crate::epoch::FinishedEpoch;
use crate::slot::Words;
use crate::statistics::ChannelSums;
use allan_core::Interpolation;

const OCTAVE_WORDS: usize = 10;
/// Words of one channel's sums: samples and missing ones, and per octave a sum of 96 bits, a count of 64 bits and the
/// bridged gaps.
pub(crate) const SUMS_WORDS: usize = 4 + OCTAVES * OCTAVE_WORDS;
/// Words of an epoch: number, completeness, rate, sums, and means and pairs of 64 bits each.
pub(crate) const EPOCH_WORDS: usize =
    4 + CHANNELS.len() * SUMS_WORDS + 2 * (CHANNELS.len() + PAIRS.len() * CROSS_OCTAVES);

/// Visits the sums of a channel. Sums of squares stay below 2⁹⁴: differences within ±2¹⁴·n, 2⁴³/n of them in 2⁴⁰
/// samples.
pub(crate) fn visit_sums(sums: &mut ChannelSums, words: &mut Words<'_>) {
    words.wide(&mut sums.samples);
    words.wide(&mut sums.missing);
    for ((squares, count), gaps) in sums.octaves.iter_mut().zip(&mut sums.gaps) {
        let (mut replaced, mut tested, mut squared_error) = (gaps.replaced(), gaps.tested(), gaps.squared_error());
        words.sum(squares);
        words.wide(count);
        words.word(&mut replaced);
        words.word(&mut tested);
        words.sum(&mut squared_error);
        *gaps = Interpolation::new(replaced, tested, squared_error);
    }
}

pub(crate) fn visit_epoch(epoch: &mut FinishedEpoch, words: &mut Words<'_>) {
    let covariances = &mut epoch.covariances;
    let (mut complete, mut rate_hz) = (u32::from(covariances.complete), epoch.measured_hz.unwrap_or(0.0));
    words.word(&mut epoch.number);
    words.word(&mut complete);
    words.float(&mut rate_hz);
    (covariances.complete, epoch.measured_hz) = (complete == 1, (rate_hz > 0.0).then_some(rate_hz));
    epoch.sums.iter_mut().for_each(|sums| visit_sums(sums, words));
    let floats = covariances.means.iter_mut().chain(covariances.pairs.as_flattened_mut());
    floats.for_each(|value| words.float(value));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cross_sums::AllanCovariances;
    use crate::slot::Slot;

    fn epoch() -> FinishedEpoch {
        let mut number = 0_u64;
        let mut next = || {
            number += 0x0001_0000_0001;
            number
        };
        let mut sums = || ChannelSums {
            samples: next(),
            missing: next(),
            octaves: core::array::from_fn(|_| (u128::from(next()) << 31, next())),
            gaps: core::array::from_fn(|_| Interpolation::new(next() as u32, next() as u32, u128::from(next()) << 31)),
        };
        let sums = core::array::from_fn(|_| sums());
        let mut covariances = AllanCovariances::EMPTY;
        covariances.complete = true;
        covariances.means = covariances.means.map(|_| -(next() as f64));
        covariances.pairs.as_flattened_mut().fill_with(|| 1.0 / next() as f64);
        FinishedEpoch { number: 77, measured_hz: Some(203.9), sums, covariances }
    }

    #[test]
    fn an_epoch_is_read_as_it_was_written() {
        let (mut written, mut read) = (epoch(), FinishedEpoch::EMPTY);
        let slot = Slot::<{ EPOCH_WORDS + 1 }>::blank();
        slot.write(7, |words| {
            visit_epoch(&mut written, words);
            words.word(&mut 9);
        });
        assert_eq!(slot.words().read::<{ EPOCH_WORDS + 1 }>()[EPOCH_WORDS], 9);
        visit_epoch(&mut read, &mut slot.read(7).expect("it was written"));
        assert_eq!(read, written);
    }
}
