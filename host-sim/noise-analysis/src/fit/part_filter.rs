//! The low-pass filter that a sensor has once for all its channels: its taps, and how many values of its own clock pass from
//! one recorded sample to the next, estimated from all inertial channels together.
//!
//! The deviances of the channels' curves are added, each channel with noise terms of its own beside the common filter. White
//! noise of the rounding to counts, `q²/12` of a count `q`, is known and taken off first: it enters after the filter, so that a
//! channel with small noise would otherwise show less correlation than the others.
//!
//! A channel whose curve no filter describes, such as an accelerometer on a platform that sways, has a large deviance with every
//! one of them, and differences between these that say nothing of the filter. Its deviances are divided by its smallest one per
//! degree of freedom, as those of overdispersed observations are (P. McCullagh and J. Nelder, "Generalized Linear Models",
//! chapter 9).

mod channel_deviance;
mod screen;

pub(crate) use channel_deviance::FilteredChannel;

use crate::OCTAVES;
use crate::bounds::BoundedEstimate;
use crate::effects::findings::SIGNIFICANCE;
use crate::parallel;
use allan_core::Curve;
use allan_core::term::MovingAverageFilter;
use channel_deviance::{
    ChannelDeviance, LEAST_DECIMATION, SEARCH_STEPS, decimations, longest_decimation, slowest_deviance,
    without_rounding,
};
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::collections::BTreeSet;

/// Rise of a deviance at the 95 % bounds of one parameter: the 95 % quantile of χ² with one degree of freedom.
const RISE_AT_BOUNDS: f64 = 3.841_458_820_694_124;
/// From so many channels on, at least half of them must show a filter.
const CHANNELS_FOR_MAJORITY: usize = 3;

/// The filter of a sensor.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PartFilter {
    /// With the common decimation.
    pub filter: MovingAverageFilter,
    /// Values of the sensor's clock from one sample to the next, with 95 % bounds; exactly 1 where every value is recorded.
    pub decimation: BoundedEstimate,
    /// Number of dithered channels that show it, of all dithered ones.
    pub shown: (usize, usize),
    /// Channels that contradict it, with the decimation that each has alone.
    pub contradicting: Vec<(&'static str, f64)>,
    /// Other taps with which the channels agree as well, at a decimation in proportion.
    pub other_taps: Vec<u16>,
}

/// Why a record does not identify the filter.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Unidentified {
    /// No inertial channel is dithered.
    NotDithered,
    /// Neighbouring samples are not correlated.
    NotCorrelated,
    /// Only these of three channels or more are correlated.
    Minority(Vec<&'static str>),
    /// The samples were not used.
    NotSought,
}

/// The common filter of `channels`, of which the sensor may have `filters`; its clock runs at about `nominal_decimation` values
/// per sample.
pub(crate) fn estimate(
    channels: &[FilteredChannel],
    filters: &[MovingAverageFilter],
    nominal_decimation: f64,
) -> Result<PartFilter, Unidentified> {
    // Where more than half of the samples of an octave were replaced from their neighbours, these correlate by that.
    let is_measured = |curve: &Curve<OCTAVES>| curve.points().iter().all(|point| point.replaced < 0.5);
    let dithered = || channels.iter().filter(|channel| channel.is_dithered && is_measured(channel.curve));
    let curves: Vec<Curve<OCTAVES>> = dithered().map(without_rounding).collect();
    if curves.is_empty() {
        return Err(Unidentified::NotDithered);
    }
    let dithered: Vec<(&FilteredChannel, &Curve<OCTAVES>)> = dithered().zip(&curves).collect();
    // By chance one of the hypotheses, each with an amplitude and a decimation, falls as much in one of 1/SIGNIFICANCE records.
    let read_slowly = filters.iter().filter(|filter| decimations(**filter).next().is_some());
    let hypotheses = (filters.len() + read_slowly.count()).max(1);
    let required = chi_squared_quantile(1.0 - SIGNIFICANCE / hypotheses as f64, 2.0);
    if screen::largest_fall(&dithered, filters) <= required {
        return Err(Unidentified::NotCorrelated);
    }
    let mut joint: Vec<ChannelDeviance> =
        dithered.iter().map(|(channel, curve)| ChannelDeviance::new(channel, curve)).collect();
    parallel::for_each(&mut joint, |channel| channel.fit_alone(filters));
    let unfiltered: Vec<f64> = joint.iter_mut().map(|channel| channel.unfiltered()).collect();
    let tried = filters.iter().flat_map(|&filter| [Some(filter), slowest_deviance(&mut joint, filter)]).flatten();
    let tried: Vec<Hypothesis> =
        tried.collect::<Vec<_>>().into_iter().map(|filter| Hypothesis::new(&mut joint, filter)).collect();
    let Some(best) = tried.iter().min_by(|a, b| a.total().total_cmp(&b.total())) else {
        return Err(Unidentified::NotCorrelated);
    };
    // A scatter is at least 1, and is not needed where the deviances themselves fall by too little.
    if unfiltered.iter().sum::<f64>() - best.total() <= required {
        return Err(Unidentified::NotCorrelated);
    }
    let scatters: Vec<f64> = joint.iter().map(|channel| channel.scatter(best.filter)).collect();
    let falls = |of: &Hypothesis| -> Vec<f64> {
        let standardised = unfiltered.iter().zip(&of.deviances).zip(&scatters);
        standardised.map(|((before, after), scatter)| (before - after) / scatter).collect()
    };
    let shown: Vec<bool> = falls(best).iter().map(|fall| *fall > required).collect();
    let showing = shown.iter().filter(|shown| **shown).count();
    if falls(best).iter().sum::<f64>() <= required {
        return Err(Unidentified::NotCorrelated);
    }
    if joint.len() >= CHANNELS_FOR_MAJORITY && 2 * showing < joint.len() {
        let names = joint.iter().zip(&shown).filter(|(_, shown)| **shown).map(|(channel, _)| channel.name);
        return Err(Unidentified::Minority(names.collect()));
    }
    // The curve knows the length of the filter in samples, taps over decimation, far better than each of the two.
    let scatter = scatters.iter().sum::<f64>() / scatters.len() as f64;
    // Where the channels differ among themselves by more than chance, a common filter is known so much less.
    let of_best = contradictions(&mut joint, best, &scatters, &shown);
    let disagreement = birge_ratio(&of_best.rises);
    let is_as_good = |of: &&Hypothesis| of.total() - best.total() <= RISE_AT_BOUNDS * scatter * disagreement;
    let from_nominal = |of: &&Hypothesis| (of.filter.decimation / nominal_decimation).ln().abs();
    let as_good: Vec<&Hypothesis> = tried.iter().filter(is_as_good).collect();
    // The simpler of two that fit alike: every value recorded.
    let own_rate = as_good.iter().copied().filter(|of| of.filter.decimation == 1.0);
    let own_rate = own_rate.min_by(|a, b| a.total().total_cmp(&b.total()));
    let slow = as_good.iter().copied().min_by(|a, b| from_nominal(a).total_cmp(&from_nominal(b)));
    let chosen = own_rate.or(slow).unwrap_or(best);
    let filter = chosen.filter;
    let others: BTreeSet<u16> = as_good.iter().map(|of| of.filter.taps).filter(|taps| *taps != filter.taps).collect();
    let other_taps = others.into_iter().collect();
    let is_best = filter == best.filter;
    let contradicting = if is_best { of_best } else { contradictions(&mut joint, chosen, &scatters, &shown) };
    let decimation = bounds(&mut joint, filter, &contradicting.rises, scatter);
    let contradicting = contradicting.channels;
    Ok(PartFilter { filter, decimation, shown: (showing, joint.len()), contradicting, other_taps })
}

/// A filter and the deviance of each channel with it.
struct Hypothesis {
    filter: MovingAverageFilter,
    deviances: Vec<f64>,
}

impl Hypothesis {
    fn new(joint: &mut [ChannelDeviance], filter: MovingAverageFilter) -> Self {
        Self { filter, deviances: joint.iter_mut().map(|channel| channel.deviance(filter)).collect() }
    }

    fn total(&self) -> f64 {
        self.deviances.iter().sum()
    }
}

/// How the channels differ from the common filter.
struct Contradictions {
    /// Rise of each channel's deviance over that with a decimation of its own, in units of its scatter.
    rises: Vec<f64>,
    /// Channels whose rise chance does not explain, with their own decimation.
    channels: Vec<(&'static str, f64)>,
}

/// Compares the channels that `shown` the filter with `common`.
fn contradictions(
    joint: &mut [ChannelDeviance],
    common: &Hypothesis,
    scatters: &[f64],
    shown: &[bool],
) -> Contradictions {
    let filter = common.filter;
    let mut found = Contradictions { rises: Vec::new(), channels: Vec::new() };
    if filter.decimation == 1.0 {
        return found;
    }
    let required = chi_squared_quantile(1.0 - SIGNIFICANCE, 1.0);
    let fits = joint.iter_mut().zip(&common.deviances).zip(scatters).zip(shown).filter(|(_, shown)| **shown);
    for (((channel, deviance), scatter), _) in fits {
        let is_same = |of: &&MovingAverageFilter| (of.stages, of.taps) == (filter.stages, filter.taps);
        let Some(&own) = channel.slowest.iter().find(is_same) else { continue };
        let rise = ((deviance - channel.deviance(own)) / scatter).max(0.0);
        found.rises.push(rise);
        if rise > required {
            found.channels.push((channel.name, own.decimation));
        }
    }
    found
}

/// By how much the channels differ among themselves: the sum of the `rises` of their deviances over its expectation, at least 1
/// (R. Birge, Phys. Rev. 40, 1932).
fn birge_ratio(rises: &[f64]) -> f64 {
    (rises.iter().sum::<f64>() / (rises.len() as f64 - 1.0).max(1.0)).max(1.0)
}

/// 95 % bounds of the common decimation by its profile likelihood: where the sum of the deviances rises by 3.84 times its
/// scatter. If the channels differ among themselves by more than chance, so much wider.
fn bounds(joint: &mut [ChannelDeviance], filter: MovingAverageFilter, rises: &[f64], scatter: f64) -> BoundedEstimate {
    let value = filter.decimation;
    if value == 1.0 {
        return BoundedEstimate { value, low: value, high: value };
    }
    let birge = birge_ratio(rises);
    let mut total = |decimation: f64| -> f64 {
        let read = MovingAverageFilter { decimation, ..filter };
        joint.iter_mut().map(|channel| channel.deviance(read)).sum()
    };
    let limit = total(value) + RISE_AT_BOUNDS * scatter * birge;
    let mut bound = |outside: f64| {
        let (mut inside, mut outside) = (value.ln(), outside.ln());
        if total(outside.exp()) <= limit {
            return outside.exp();
        }
        for _ in 0..SEARCH_STEPS {
            let middle = 0.5 * (inside + outside);
            if total(middle.exp()) > limit { outside = middle } else { inside = middle }
        }
        (0.5 * (inside + outside)).exp()
    };
    let longest = longest_decimation(filter);
    BoundedEstimate { value, low: bound(LEAST_DECIMATION.min(value)), high: bound(longest.max(value)) }
}

fn chi_squared_quantile(probability: f64, degrees_of_freedom: f64) -> f64 {
    // Both arguments are constants of this file in the range of the distribution.
    ChiSquared::new(degrees_of_freedom).map_or(f64::INFINITY, |of| of.inverse_cdf(probability))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::OVERLAP;
    use crate::simulated_part::{RecordedChannel, read};
    use allan_core::Cascade;
    use allan_core::trace::{LineCandidates, trace};

    const CLOCK_HZ: f64 = 819.2;

    /// Three channels of a part with a Bartlett window of `taps` values, read at `rate_hz`: with 2.5, 5 and 20 counts, so that
    /// rounding is 1.3 % of the variance of the first and nothing in the last. 2¹⁷ samples.
    fn estimated(taps: usize, rate_hz: f64, seed: u64) -> Result<PartFilter, Unidentified> {
        let profile = measurement::adis16405::profile(0.05);
        let curves = [2.5, 5.0, 20.0].map(|deviation| {
            let decimation = CLOCK_HZ / rate_hz;
            // The filter takes the variance of a sample down by about its length in samples.
            let deviation = deviation * (1.0_f64).max(1.5 * taps as f64 / decimation).sqrt();
            let seed = 1_000 * seed + deviation.to_bits() % 997;
            let mut cascade = Cascade::<OCTAVES, OVERLAP>::new();
            let channel = RecordedChannel { taps, decimation, deviation, samples: 1 << 17, seed };
            read(&channel).into_iter().for_each(|count| cascade.push(count));
            cascade.curve(1.0 / rate_hz)
        });
        let filters = profile.filters_read_at(rate_hz);
        let models = curves.each_ref().map(|curve| trace(curve, LineCandidates::Spectrum(&[]), &filters).after);
        let channel =
            |(curve, model)| FilteredChannel { name: "", curve, model, white_rounding: 1.0 / 12.0, is_dithered: true };
        let channels: Vec<FilteredChannel> = curves.iter().zip(&models).map(channel).collect();
        estimate(&channels, &profile.filters, CLOCK_HZ / rate_hz)
    }

    /// 819.2 Hz read at odd rates, with filters that reach over one to many samples. Of 20 intervals of 95 %, 19 ± 1 hold; at three
    /// standard deviations less 16.
    #[test]
    fn joint_intervals_hold_the_true_decimation() {
        let mut held = 0;
        let parts = [(8, 91.8), (8, 100.0), (16, 137.0), (16, 211.3), (64, 100.0)];
        for (taps, rate_hz) in parts {
            for seed in 1..=4 {
                let found = estimated(taps, rate_hz, seed).expect("a filter");
                let truth = CLOCK_HZ / rate_hz;
                assert_eq!(usize::from(found.filter.taps), taps, "read at {rate_hz} Hz: {found:?}");
                assert!(found.contradicting.is_empty(), "read at {rate_hz} Hz: {found:?}");
                let BoundedEstimate { value, low, high } = found.decimation;
                println!("{taps} taps, {truth:.4}: {value:.4} [{low:.4}, {high:.4}]");
                // Known well enough to be of use.
                assert!(high - low < 0.05 * value, "{found:?}");
                held += usize::from((low..=high).contains(&truth));
            }
        }
        assert!(held >= 16, "{held} of 20");
    }

    #[test]
    fn a_filter_whose_every_value_is_recorded_is_told_from_one_that_is_read_slowly() {
        for taps in [2, 4, 16] {
            let found = estimated(taps, CLOCK_HZ, 7).expect("a filter");
            assert_eq!((usize::from(found.filter.taps), found.filter.decimation), (taps, 1.0), "{found:?}");
        }
    }

    /// Without a filter, or behind one that is shorter than the sample period, nothing tells the clock.
    #[test]
    fn white_noise_identifies_no_filter() {
        for seed in 1..=4 {
            assert_eq!(estimated(1, CLOCK_HZ, seed), Err(Unidentified::NotCorrelated));
            assert_eq!(estimated(4, 91.8, seed), Err(Unidentified::NotCorrelated));
        }
        assert_eq!(estimate(&[], &[], 1.0), Err(Unidentified::NotDithered));
    }
}
