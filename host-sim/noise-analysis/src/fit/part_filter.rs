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
//!
//! Where the samples are kept, their likelihood chooses among the filters that the curves allow, and finds the decimation. A part of which no
//! filter is stated may have a low-pass filter of the second order in the place of moving averages.

mod channel_deviance;
mod decimation;
mod hypothesis;
mod joint_samples;
mod low_pass;
mod screen;

pub(crate) use channel_deviance::FilteredChannel;

use crate::OCTAVES;
use crate::bounds::BoundedEstimate;
use crate::effects::findings::{REFUTED, SIGNIFICANCE};
use crate::parallel::{self, in_parallel};
use allan_core::term::MovingAverageFilter;
use allan_core::{Curve, NoiseTerm};
use channel_deviance::{ChannelDeviance, without_rounding};
use decimation::{decimations, slowest};
use hypothesis::{BOUNDED, Hypothesis, Identified, birge_ratio, chi_squared_quantile, simplest};
use joint_samples::AllowedFilter;

/// From so many channels on, at least half of them must show a filter.
const CHANNELS_FOR_MAJORITY: usize = 3;

/// The filter of a sensor.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PartFilter {
    /// White noise behind it.
    pub term: NoiseTerm,
    /// What is adjusted of it, with 95 % bounds. Of moving averages the values of the sensor's clock from one sample to the next, exactly 1
    /// where every value is recorded; of a low-pass filter its frequency, Hz.
    pub adjusted: BoundedEstimate,
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

/// The common filter of `channels`, of which the sensor may have `filters`, and `may_be_low_pass`; its clock runs at about
/// `nominal_decimation` values per sample.
pub(crate) fn estimate(
    channels: &[FilteredChannel],
    (filters, may_be_low_pass): (&[MovingAverageFilter], bool),
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
    let filters = filters.iter().flat_map(|&filter| [Some(filter), slowest(filter, |read| total(&mut joint, read))]);
    let filters: Vec<MovingAverageFilter> = filters.flatten().collect();
    let tried: Vec<Hypothesis> = filters.into_iter().map(|filter| hypothesis(&mut joint, filter)).collect();
    let Some(best) = tried.iter().min_by(|a, b| a.total().total_cmp(&b.total())) else {
        return Err(Unidentified::NotCorrelated);
    };
    // A scatter is at least 1, and is not needed where the deviances themselves fall by too little.
    if unfiltered.iter().sum::<f64>() - best.total() <= required {
        return Err(Unidentified::NotCorrelated);
    }
    let scatters = in_parallel(&joint, |channel| channel.scatter(best.filter));
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
    let scatter = scatter * birge_ratio(&contradictions(&mut joint, best, &scatters, &shown).rises);
    let showing_channels = dithered.iter().zip(&shown).filter(|(_, shown)| **shown).map(|((channel, _), _)| *channel);
    let showing_channels: Vec<&FilteredChannel> = showing_channels.collect();
    let (least, nominal) = (best.total(), nominal_decimation);
    // The samples know more of each filter that the curves allow, as far as they do.
    let by_samples =
        joint_samples::identified(&showing_channels, &allowed(&mut joint, &tried, (least, scatter)), nominal);
    let identified = by_samples.or_else(|| by_curves(&mut joint, &tried, (least, scatter), nominal));
    let Some(Identified { filter, decimation, other_taps }) = identified else {
        return Err(Unidentified::NotCorrelated);
    };
    let common = hypothesis(&mut joint, filter);
    let contradicting = contradictions(&mut joint, &common, &scatters, &shown).channels;
    let averages = PartFilter {
        term: NoiseTerm::Filtered(filter),
        adjusted: decimation,
        shown: (showing, joint.len()),
        contradicting,
        other_taps,
    };
    let low_pass = may_be_low_pass.then(|| low_pass::in_place_of(filter, &mut joint, required)).flatten();
    Ok(match low_pass {
        Some((low_pass, frequency)) => PartFilter {
            term: NoiseTerm::LowPass(low_pass),
            adjusted: frequency,
            contradicting: Vec::new(),
            other_taps: Vec::new(),
            ..averages
        },
        None => averages,
    })
}

/// Those of `tried` whose deviance is above `least`, in units of its `scatter`, by no more than chance, with the decimations of which that
/// holds.
fn allowed(joint: &mut [ChannelDeviance], tried: &[Hypothesis], (least, scatter): (f64, f64)) -> Vec<AllowedFilter> {
    let limit = least + scatter * chi_squared_quantile(1.0 - REFUTED, 1.0);
    let filters = tried.iter().filter(|of| of.total() <= limit).map(|of| of.filter);
    filters.map(|filter| (filter, decimation::allowed(filter, limit, |read| total(joint, read)))).collect()
}

/// The simplest of `tried` that is as good as the one with the deviance `least`, with the bounds of its decimation.
fn by_curves(
    joint: &mut [ChannelDeviance],
    tried: &[Hypothesis],
    (least, scatter): (f64, f64),
    nominal_decimation: f64,
) -> Option<Identified> {
    let rise = scatter * chi_squared_quantile(BOUNDED, 1.0);
    let (chosen, other_taps) = simplest(tried, least + rise, nominal_decimation)?;
    let Hypothesis { filter, .. } = tried[chosen];
    let bounds = decimation::allowed(filter, tried[chosen].total() + rise, |read| total(joint, read));
    Some(Identified::new(filter, bounds, other_taps))
}

/// A filter with the deviances of all channels.
fn hypothesis(joint: &mut [ChannelDeviance], filter: MovingAverageFilter) -> Hypothesis {
    Hypothesis { filter, deviances: joint.iter_mut().map(|channel| channel.deviance(filter)).collect() }
}

/// Sum of the deviances of all channels.
fn total(joint: &mut [ChannelDeviance], filter: MovingAverageFilter) -> f64 {
    joint.iter_mut().map(|channel| channel.deviance(filter)).sum()
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
    let required = chi_squared_quantile(1.0 - REFUTED, 1.0);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::OVERLAP;
    use crate::fit::sample_coefficients::SamplesOfCurve;
    use crate::samples::rounding::Rounding;
    use crate::samples::uniform_series::UniformSeries;
    use crate::simulated_part::{RecordedChannel, read};
    use allan_core::Cascade;
    use allan_core::term::LowPass;
    use allan_core::trace::{LineCandidates, trace};
    use measurement::SensorProfile;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;
    use std::f64::consts::PI;

    const CLOCK_HZ: f64 = 819.2;

    /// What the filter is estimated from.
    #[derive(Debug, Clone, Copy)]
    enum Evidence {
        Curves,
        Samples,
    }

    /// Three channels of a part with a Bartlett window of `taps` values, read at `rate_hz`: with 2.5, 5 and 20 counts, so that
    /// rounding is 1.3 % of the variance of the first and nothing in the last. 2¹⁷ samples.
    fn estimated(taps: usize, rate_hz: f64, seed: u64, evidence: Evidence) -> Result<PartFilter, Unidentified> {
        let profile = measurement::adis16405::profile(0.05);
        let decimation = CLOCK_HZ / rate_hz;
        let recorded = [2.5, 5.0, 20.0].map(|deviation| {
            // The filter takes the variance of a sample down by about its length in samples.
            let deviation = deviation * (1.0_f64).max(1.5 * taps as f64 / decimation).sqrt();
            let seed = 1_000 * seed + deviation.to_bits() % 997;
            read(&RecordedChannel { taps, decimation, deviation, samples: 1 << 17, seed })
        });
        estimated_from(&recorded, (&profile, rate_hz), evidence)
    }

    /// Of three channels that were recorded at `rate_hz`.
    fn estimated_from(
        recorded: &[Vec<i32>; 3],
        (profile, rate_hz): (&SensorProfile, f64),
        evidence: Evidence,
    ) -> Result<PartFilter, Unidentified> {
        let (period, decimation) = (1.0 / rate_hz, profile.internal_rate_hz / rate_hz);
        let curves = recorded.each_ref().map(|counts| {
            let mut cascade = Cascade::<OCTAVES, OVERLAP>::new();
            counts.iter().for_each(|count| cascade.push(*count));
            cascade.curve(period)
        });
        let series = recorded.each_ref().map(|counts| {
            let values = counts.iter().map(|count| f64::from(*count)).collect();
            UniformSeries::new(period, values).with_rounding(Rounding::white(1.0, period))
        });
        let filters = profile.filters_read_at(rate_hz);
        let models = curves.each_ref().map(|curve| trace(curve, LineCandidates::Spectrum(&[]), &filters).after);
        let recorded = curves.iter().zip(&models).zip(&series);
        let channels = recorded.map(|((curve, model), rest)| FilteredChannel {
            name: "",
            curve,
            model,
            rounding: rest.rounding(),
            is_dithered: true,
            samples: match evidence {
                Evidence::Curves => None,
                Evidence::Samples => Some((SamplesOfCurve { rest, spectrum: None }, Vec::new())),
            },
        });
        let channels: Vec<FilteredChannel> = channels.collect();
        estimate(&channels, (&profile.filters, profile.may_be_low_pass), decimation)
    }

    /// Three channels with 2.5, 5 and 20 counts of white noise behind two equal stages of the first order with a corner of `frequency_hz`, in steps
    /// of a fortieth of a sample, read at 250 Hz.
    fn behind_two_stages(frequency_hz: f64, seed: u64) -> [Vec<i32>; 3] {
        const STEPS: usize = 40;
        let kept = (-2.0 * PI * frequency_hz / (250.0 * STEPS as f64)).exp();
        [2.5, 5.0, 20.0_f64].map(|deviation| {
            let mut random = ChaCha8Rng::seed_from_u64(seed ^ deviation.to_bits());
            // A stage has (1 − kept)/(1 + kept) of the variance of white noise, and the second one half of that.
            let size = deviation * (4.0 / (1.0 - kept)).sqrt();
            let (mut first, mut second) = (0.0, 0.0);
            let mut next = || {
                for _ in 0..STEPS {
                    first = kept * first + (1.0 - kept) * size * random.sample::<f64, _>(StandardNormal);
                    second = kept * second + (1.0 - kept) * first;
                }
                second.round() as i32
            };
            (0..1 << 15).map(|_| next()).collect()
        })
    }

    /// Of eight intervals of 95 % six or more hold in 99.4 % of cases. Bartlett windows and white noise of a sensor that may have a low-pass
    /// filter have none.
    #[test]
    fn two_stages_are_told_from_moving_averages() {
        let profile = SensorProfile::generic();
        let mut held = 0;
        for (frequency_hz, seed) in
            [(25.0, 1), (25.0, 2), (60.0, 3), (60.0, 4), (60.0, 5), (40.0, 6), (40.0, 7), (40.0, 8)]
        {
            let recorded = behind_two_stages(frequency_hz, seed);
            let found = estimated_from(&recorded, (&profile, 250.0), Evidence::Samples).expect("a filter");
            let BoundedEstimate { value, low, high } = found.adjusted;
            println!("{frequency_hz}: {value:.2} [{low:.2}, {high:.2}]");
            assert_eq!(found.term, NoiseTerm::LowPass(LowPass::two_stages(value)), "{found:?}");
            held += usize::from((low..=high).contains(&frequency_hz));
        }
        assert!(held >= 6, "{held}");
        for taps in [2, 4, 16] {
            let deviation = 5.0 * (1.5 * f64::from(taps as u32)).sqrt();
            let averaged = [1, 2, 3]
                .map(|seed| read(&RecordedChannel { taps, decimation: 1.0, deviation, samples: 1 << 15, seed }));
            let found = estimated_from(&averaged, (&profile, 250.0), Evidence::Samples).expect("a filter");
            assert_eq!(usize::from(averages(&found).taps), taps, "{found:?}");
        }
    }

    fn averages(found: &PartFilter) -> MovingAverageFilter {
        let NoiseTerm::Filtered(filter) = found.term else { panic!("{found:?}") };
        filter
    }

    /// Estimates the decimation of each of `parts` (taps, rate in Hz) for four seeds. Of 20 intervals of 95 %, 19 ± 1 hold; at three
    /// standard deviations less 16. Returns their widths as parts of the decimations.
    fn held_intervals(parts: [(usize, f64); 5], evidence: Evidence) -> Vec<f64> {
        let (mut held, mut widths) = (0, Vec::new());
        for (taps, rate_hz) in parts {
            for seed in 1..=4 {
                let found = estimated(taps, rate_hz, seed, evidence).expect("a filter");
                let truth = CLOCK_HZ / rate_hz;
                assert_eq!(usize::from(averages(&found).taps), taps, "read at {rate_hz} Hz: {found:?}");
                assert!(found.contradicting.is_empty(), "read at {rate_hz} Hz: {found:?}");
                let BoundedEstimate { value, low, high } = found.adjusted;
                println!("{taps} taps, {truth:.4}: {value:.4} [{low:.4}, {high:.4}]");
                widths.push((high - low) / value);
                held += usize::from((low..=high).contains(&truth));
            }
        }
        assert!(held >= 16, "{held} of 20 by {evidence:?}");
        widths
    }

    /// 819.2 Hz read at odd rates, with filters that reach over one to many samples.
    #[test]
    fn joint_intervals_hold_the_true_decimation() {
        let parts = [(8, 91.8), (8, 100.0), (16, 137.0), (16, 211.3), (64, 100.0)];
        let by_curves = held_intervals(parts, Evidence::Curves);
        // Known well enough to be of use.
        assert!(by_curves.iter().all(|width| *width < 0.05), "{by_curves:?}");
        let by_samples = held_intervals(parts, Evidence::Samples);
        let narrower = by_curves.iter().zip(&by_samples).filter(|(curves, samples)| samples < curves).count();
        assert!(narrower >= 18, "{by_curves:?}, {by_samples:?}");
    }

    /// A reader that counts the values of the part reads every second or ninth, and the phase between their clocks stays.
    #[test]
    fn joint_intervals_hold_whole_decimations() {
        let parts = [(8, 2.0), (16, 2.0), (16, 4.0), (16, 9.0), (64, 9.0)];
        held_intervals(parts.map(|(taps, every)| (taps, CLOCK_HZ / every)), Evidence::Samples);
    }

    #[test]
    fn a_filter_whose_every_value_is_recorded_is_told_from_one_that_is_read_slowly() {
        for taps in [2, 4, 16] {
            for evidence in [Evidence::Curves, Evidence::Samples] {
                let found = estimated(taps, CLOCK_HZ, 7, evidence).expect("a filter");
                let filter = averages(&found);
                assert_eq!((usize::from(filter.taps), filter.decimation), (taps, 1.0), "{found:?}");
            }
        }
    }

    /// Without a filter, or behind one that is shorter than the sample period, nothing tells the clock.
    #[test]
    fn white_noise_identifies_no_filter() {
        for seed in 1..=4 {
            assert_eq!(estimated(1, CLOCK_HZ, seed, Evidence::Samples), Err(Unidentified::NotCorrelated));
            assert_eq!(estimated(4, 91.8, seed, Evidence::Samples), Err(Unidentified::NotCorrelated));
        }
        assert_eq!(estimate(&[], (&[], true), 1.0), Err(Unidentified::NotDithered));
    }
}
