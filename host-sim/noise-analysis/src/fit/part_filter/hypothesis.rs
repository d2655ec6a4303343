//! Filters of one family, by the deviances of all channels.

use super::channel_spectrum::{ChannelBehindFilter, ChannelSpectrum, deviances};
use super::family::Family;
use crate::bounds::BoundedEstimate;
use crate::minimum::{least_within, risen};
use crate::parallel::in_parallel;
use allan_core::NoiseTerm;
use std::collections::BTreeSet;

/// Accuracy of the likeliest decimation or frequency, as a part of it: 10⁶ samples know it to some thousandths.
const ACCURACY: f64 = 1e-4;
/// Largest factor between the sensor's clock and its nominal one: beyond √2, within which one of the taps, powers of 2, has any length.
const FARTHEST_CLOCK: f64 = 1.5;

/// A family of filters with the deviance of each channel at some of its decimations or frequencies.
pub(super) struct TriedFamily<'a> {
    channels: &'a [ChannelSpectrum],
    family: Family,
    tried: Vec<(f64, Vec<f64>)>,
}

/// The likeliest filter of a family.
pub(super) struct Hypothesis {
    pub(super) family: Family,
    /// Its decimation, or its frequency in Hz.
    pub(super) adjusted: f64,
    /// Between these the deviance has no other minimum.
    range: (f64, f64),
    pub(super) deviances: Vec<f64>,
}

impl<'a> TriedFamily<'a> {
    /// Those of `families` that have something to be tried: a filter that is too short is not read slowly.
    pub(super) fn all(families: &[Family], channels: &'a [ChannelSpectrum], rate_hz: f64) -> Vec<Self> {
        let tried = in_parallel(families, |family| Self::new(*family, channels, family.tried(rate_hz)));
        tried.into_iter().flatten().collect()
    }

    fn new(family: Family, channels: &'a [ChannelSpectrum], tried: Vec<f64>) -> Option<Self> {
        let middle = family.with(*tried.get(tried.len() / 2)?);
        let behind: Vec<ChannelBehindFilter> = channels.iter().map(|channel| channel.behind(middle)).collect();
        let tried_at = |at: f64| (at, deviances(behind.iter(), family.with(at)).collect());
        Some(Self { channels, family, tried: tried.into_iter().map(tried_at).collect() })
    }

    pub(super) fn deviances(&self) -> impl Iterator<Item = &[f64]> {
        self.tried.iter().map(|(_, deviances)| deviances.as_slice())
    }

    /// The filter with the least sum of the deviances, each times its weight.
    ///
    /// A reader that counts the values of the sensor has a whole decimation, at which the least deviance is a cusp: between two values of its
    /// clock a sensor gives the one before, and which one that is changes with time.
    pub(super) fn likeliest(&self, weights: &[f64]) -> Hypothesis {
        let Self { family, tried, .. } = self;
        let sums = tried.iter().map(|(_, deviances)| weighted(deviances, weights)).enumerate();
        let best = sums.reduce(|best, next| if next.1 < best.1 { next } else { best }).map_or(0, |(at, _)| at);
        let at = |index: usize| tried[index.min(tried.len() - 1)].0;
        let range = (at(best.saturating_sub(1)), at(best + 1));
        let behind = self.behind(at(best));
        let sum = |adjusted: f64| sum_behind(&behind, weights, *family, adjusted);
        let between = least_within((range.0.ln(), range.1.ln()), ACCURACY, |log| sum(log.exp())).exp();
        let is_read_slowly = matches!(family, Family::ReadSlowly(_));
        let whole = (range.0.ceil() as u32..=range.1.floor() as u32).filter(|_| is_read_slowly);
        let likelier = |best: (f64, f64), next: (f64, f64)| if next.1 < best.1 { next } else { best };
        let whole = whole.map(f64::from).map(|of| (of, sum(of)));
        let (adjusted, _) = whole.fold((between, sum(between)), likelier);
        let deviances = deviances(behind.iter(), family.with(adjusted)).collect();
        Hypothesis { family: *family, adjusted, range, deviances }
    }

    /// The decimation or frequency of a hypothesis, between the values at which the sum has risen by so much.
    pub(super) fn bounded(&self, of: &Hypothesis, weights: &[f64], rise: f64) -> BoundedEstimate {
        let behind = self.behind(of.adjusted);
        let bound = |end: f64| {
            let sum = |log: f64| sum_behind(&behind, weights, self.family, log.exp());
            let risen = risen((of.adjusted.ln(), end.ln()), rise, sum);
            // The end of the range as it is.
            if risen == end.ln() { end } else { risen.exp() }
        };
        BoundedEstimate { value: of.adjusted, low: bound(of.range.0), high: bound(of.range.1) }
    }

    fn behind(&self, adjusted: f64) -> Vec<ChannelBehindFilter<'a>> {
        self.channels.iter().map(|channel| channel.behind(self.family.with(adjusted))).collect()
    }
}

impl Hypothesis {
    pub(super) fn term(&self) -> NoiseTerm {
        self.family.with(self.adjusted)
    }

    /// The sum of the deviances, each times its weight.
    pub(super) fn total(&self, weights: &[f64]) -> f64 {
        weighted(&self.deviances, weights)
    }
}

fn weighted(deviances: &[f64], weights: &[f64]) -> f64 {
    deviances.iter().zip(weights).map(|(deviance, weight)| deviance * weight).sum()
}

/// The sum of the deviances of the channels that have a weight.
fn sum_behind(behind: &[ChannelBehindFilter], weights: &[f64], family: Family, adjusted: f64) -> f64 {
    let (used, weights): (Vec<&ChannelBehindFilter>, Vec<f64>) =
        behind.iter().zip(weights.iter().copied()).filter(|(_, weight)| *weight > 0.0).unzip();
    deviances(used.into_iter(), family.with(adjusted)).zip(weights).map(|(deviance, weight)| weight * deviance).sum()
}

/// The position of the simplest of those of `tried` whose `total` is above the least one by at most `rise`, and the other taps of these. Every
/// value recorded is simpler than a filter that is read slowly, and of several of these the one nearest to the sensor's own clock is. Far
/// from that clock none is chosen: what limits the bandwidth before the filter resembles more taps at a multiple of it.
pub(super) fn simplest(
    tried: &[Hypothesis],
    total: impl Fn(&Hypothesis) -> f64,
    rise: f64,
    nominal_decimation: f64,
) -> Option<(usize, Vec<u16>)> {
    let distance = |of: &Hypothesis| match of.family {
        Family::EveryValue(_) => -1.0_f64,
        // Without a stated clock all are equal.
        Family::ReadSlowly(_) | Family::LowPass(_) if nominal_decimation == 0.0 => 0.0,
        Family::ReadSlowly(_) | Family::LowPass(_) => (of.adjusted / nominal_decimation).ln().abs(),
    };
    let possible = || tried.iter().filter(|of| distance(of) < FARTHEST_CLOCK.ln());
    let limit = possible().map(&total).fold(f64::INFINITY, f64::min) + rise;
    let nearer =
        |a: &Hypothesis, b: &Hypothesis| distance(a).total_cmp(&distance(b)).then(total(a).total_cmp(&total(b)));
    let as_good = || tried.iter().enumerate().filter(|(_, of)| total(of) <= limit);
    let near = as_good().filter(|(_, of)| distance(of) < FARTHEST_CLOCK.ln());
    let (at, chosen) = near.min_by(|(_, a), (_, b)| nearer(a, b))?;
    let taps = as_good().filter_map(|(_, of)| of.family.taps()).filter(|taps| Some(*taps) != chosen.family.taps());
    Some((at, taps.collect::<BTreeSet<u16>>().into_iter().collect()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use allan_core::term::MovingAverageFilter;

    /// As in 60 s of a measured part at 816 Hz, whose bandwidth of 330 Hz is before its filter of 4 taps.
    #[test]
    fn more_taps_at_twice_the_clock_are_not_chosen() {
        let of = |family, adjusted, deviance| Hypothesis {
            family,
            adjusted,
            range: (adjusted, adjusted),
            deviances: vec![deviance],
        };
        let tried = [
            of(Family::EveryValue(MovingAverageFilter::bartlett(4)), 1.0, 300.0),
            of(Family::ReadSlowly(MovingAverageFilter::bartlett(8)), 2.0, 200.0),
        ];
        let chosen = |nominal: f64| simplest(&tried, |of| of.total(&[1.0]), 4.0, nominal).map(|(at, _)| at);
        assert_eq!(chosen(1.003), Some(0));
        // Every second value is read, or the clock is not known.
        assert_eq!([chosen(2.006), chosen(0.0)], [Some(1), Some(1)]);
    }
}
