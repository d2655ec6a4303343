//! Words of a finished epoch in retained RAM: a restart while learning does not lose it.

use crate::channels::{CHANNELS, OCTAVES};
use crate::cross_sums::{CROSS_OCTAVES, PAIRS};
use crate::epoch::FinishedEpoch;
use crate::slot::{Words, halves};
use crate::statistics::ChannelSums;
use allan_core::Interpolation;

const OCTAVE_WORDS: usize = 10;
/// Samples, missing ones; per octave a sum of 96 and a count of 64 bits, and the bridged gaps.
pub(crate) const SUMS_WORDS: usize = 4 + OCTAVES * OCTAVE_WORDS;
pub(crate) const MAX_SUM: u128 = (1 << 96) - 1;
/// Number, completeness, rate, sums, means and pairs of 64 bits.
pub(crate) const EPOCH_WORDS: usize =
    4 + CHANNELS.len() * SUMS_WORDS + 2 * (CHANNELS.len() + PAIRS.len() * CROSS_OCTAVES);

/// Sums of squares stay below 2⁹⁴: differences within ±2¹⁴·n, 2⁴³/n of them in 2⁴⁰ samples.
pub(crate) fn sums_words(sums: &ChannelSums) -> impl Iterator<Item = u32> {
    let sum = |wide: u128| {
        let wide = wide.min(MAX_SUM);
        [wide as u32, (wide >> 32) as u32, (wide >> 64) as u32]
    };
    let octave = move |(&(squares, count), gaps): (&(u128, u64), &Interpolation)| {
        let numbers = [gaps.replaced(), gaps.tested()];
        sum(squares).into_iter().chain(halves(count)).chain(numbers).chain(sum(gaps.squared_error()))
    };
    let octaves = sums.octaves.iter().zip(&sums.gaps).flat_map(octave);
    [sums.samples, sums.missing].into_iter().flat_map(halves).chain(octaves)
}

pub(crate) fn sums_from_words(words: &mut Words<impl Iterator<Item = u32>>) -> ChannelSums {
    let mut sums = ChannelSums { samples: words.wide(), missing: words.wide(), ..ChannelSums::EMPTY };
    for (octave, gaps) in sums.octaves.iter_mut().zip(&mut sums.gaps) {
        *octave = (words.sum(), words.wide());
        let (replaced, tested) = (words.word(), words.word());
        *gaps = Interpolation::new(replaced, tested, words.sum());
    }
    sums
}

pub(crate) fn epoch_words(epoch: &FinishedEpoch) -> impl Iterator<Item = u32> {
    let covariances = &epoch.covariances;
    let floats = covariances.means.iter().chain(covariances.pairs.as_flattened()).map(|value| value.to_bits());
    let head = [epoch.number, u32::from(covariances.complete)];
    let rate = halves(epoch.measured_hz.unwrap_or(0.0).to_bits());
    head.into_iter().chain(rate).chain(epoch.sums.iter().flat_map(sums_words)).chain(floats.flat_map(halves))
}

pub(crate) fn epoch_from_words(epoch: &mut FinishedEpoch, words: &mut Words<impl Iterator<Item = u32>>) {
    epoch.number = words.word();
    let covariances = &mut epoch.covariances;
    covariances.complete = words.word() == 1;
    let rate_hz = words.float();
    epoch.measured_hz = (rate_hz > 0.0).then_some(rate_hz);
    epoch.sums.iter_mut().for_each(|sums| *sums = sums_from_words(words));
    covariances.means.fill_with(|| words.float());
    covariances.pairs.as_flattened_mut().fill_with(|| words.float());
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cross_sums::AllanCovariances;

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
        let written = epoch();
        assert_eq!(epoch_words(&written).count(), EPOCH_WORDS);
        let mut read = FinishedEpoch::EMPTY;
        epoch_from_words(&mut read, &mut Words(epoch_words(&written)));
        assert_eq!(read, written);
    }
}
