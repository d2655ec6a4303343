//! The low-pass filter that a sensor has once for all its channels: its taps, and how many values of its own clock pass from
//! one recorded sample to the next, estimated from the spectra of all inertial channels together.
//!
//! ```text
//! spectra of the samples ─► deviances behind each filter ─► channels that show one ─► likeliest filter, bounds
//! ```
//!
//! The deviances of the channels' spectra are added, each channel with noise terms of its own beside the common filter. Those of a channel
//! whose spectrum no filter describes, such as that of an accelerometer on a platform that sways, are divided by the smallest of them per band, as
//! those of overdispersed observations are (P. McCullagh and J. Nelder, "Generalized Linear Models", chapter 9); where a filter describes
//! other channels, this one does not choose it.
//!
//! A part of which no filter is stated may have a low-pass filter of the second order in the place of moving averages.

mod channel_spectrum;
mod family;
mod hypothesis;

pub(crate) use channel_spectrum::FilteredChannel;

use crate::OCTAVES;
use crate::bounds::BoundedEstimate;
use crate::distributions::{DESCRIBED, chi_squared_quantile, chi_squared_tail};
use crate::effects::findings::{REFUTED, SIGNIFICANCE};
use crate::parallel::in_parallel;
use allan_core::term::MovingAverageFilter;
use allan_core::{Curve, NoiseTerm};
use channel_spectrum::ChannelSpectrum;
use family::Family;
use hypothesis::{Hypothesis, TriedFamily, simplest};

/// Probability with which bounds hold a decimation or a frequency.
const BOUNDED: f64 = 0.95;
/// From so many channels on, at least half of them must show a filter.
const CHANNELS_FOR_MAJORITY: usize = 3;

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PartFilter {
    /// White noise behind it.
    pub term: NoiseTerm,
    /// Its adjusted parameter, with 95 % bounds. Moving averages: the values of the sensor's clock from one sample to the next, exactly 1
    /// if every value is recorded. A low-pass filter: its frequency, Hz.
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
    NotDithered,
    NotCorrelated,
    /// Only these of three channels or more are correlated.
    Minority(Vec<&'static str>),
    /// The samples were not used.
    NotSought,
}

/// The common filter of `channels`, one of `filters` or maybe a low-pass one; the clock has about `nominal_decimation` values per sample.
pub(crate) fn estimate(
    channels: &[FilteredChannel],
    (filters, may_be_low_pass): (&[MovingAverageFilter], bool),
    nominal_decimation: f64,
) -> Result<PartFilter, Unidentified> {
    // Samples that were replaced from their neighbours are correlated: half of them or more hide the filter.
    let is_measured = |curve: &Curve<OCTAVES>| curve.points().iter().all(|point| point.replaced < 0.5);
    let dithered = channels.iter().filter(|channel| channel.is_dithered && is_measured(channel.curve));
    let dithered: Vec<&FilteredChannel> = dithered.collect();
    let Some(rate_hz) = dithered.first().map(|channel| 1.0 / channel.curve.sample_period()) else {
        return Err(Unidentified::NotDithered);
    };
    let spectra = in_parallel(&dithered, |channel| ChannelSpectrum::new(channel));
    let spectra: Vec<ChannelSpectrum> = spectra.into_iter().flatten().collect();
    let averages = TriedFamily::all(&Family::averages(filters), &spectra, rate_hz);
    let joint = JointSpectra::that_show_one(&spectra, &averages)?;
    let tried = in_parallel(&averages, |family| family.likeliest(&joint.weights));
    let simplest = simplest(&tried, |of| joint.total(of), joint.rise, nominal_decimation);
    let (chosen, other_taps) = simplest.ok_or(Unidentified::NotCorrelated)?;
    let low_passes = if may_be_low_pass { &Family::low_passes()[..] } else { &[] };
    let low_passes = TriedFamily::all(low_passes, &spectra, rate_hz);
    Ok(joint
        .low_pass_in_place_of(&tried[chosen], &low_passes)
        .unwrap_or_else(|| joint.averages(&averages[chosen], &tried[chosen], other_taps)))
}

struct JointSpectra<'a> {
    spectra: &'a [ChannelSpectrum],
    /// The lowest deviance of each.
    lowest: Vec<f64>,
    shown: Vec<bool>,
    /// Weights of the deviances; 0 of the channels that do not choose the filter.
    weights: Vec<f64>,
    /// Fall of a deviance that shows a filter, and its rise up to the bounds.
    required: f64,
    rise: f64,
}

impl<'a> JointSpectra<'a> {
    /// Channels whose deviances fall with moving averages, together and in the majority, by more than chance explains.
    fn that_show_one(spectra: &'a [ChannelSpectrum], averages: &[TriedFamily]) -> Result<Self, Unidentified> {
        // Chance lets one of the hypotheses, each with an amplitude and a decimation, fall as much in one of 1/SIGNIFICANCE records.
        let required = chi_squared_quantile(1.0 - SIGNIFICANCE / averages.len().max(1) as f64, 2.0);
        let unfiltered = in_parallel(spectra, ChannelSpectrum::unfiltered);
        let tried = averages.iter().flat_map(TriedFamily::deviances).fold(unfiltered.clone(), lesser);
        let tried_weights = weights(spectra, &tried);
        let likeliest = in_parallel(averages, |family| family.likeliest(&tried_weights));
        let lowest = likeliest.iter().map(|of| of.deviances.as_slice()).fold(unfiltered.clone(), lesser);
        let mut weights = weights(spectra, &lowest);
        let best = likeliest.iter().min_by(|a, b| a.total(&weights).total_cmp(&b.total(&weights)));
        let best = best.ok_or(Unidentified::NotCorrelated)?;
        let falls = unfiltered.iter().zip(&best.deviances).zip(&weights);
        let falls: Vec<f64> = falls.map(|((before, after), weight)| weight * (before - after)).collect();
        if falls.iter().sum::<f64>() <= required {
            return Err(Unidentified::NotCorrelated);
        }
        let shown: Vec<bool> = falls.iter().map(|fall| *fall > required).collect();
        let showing = shown.iter().filter(|shown| **shown).count();
        if spectra.len() >= CHANNELS_FOR_MAJORITY && 2 * showing < spectra.len() {
            let names = spectra.iter().zip(&shown).filter(|(_, shown)| **shown).map(|(channel, _)| channel.name);
            return Err(Unidentified::Minority(names.collect()));
        }
        // If a filter describes the spectra of some channels, the others say nothing of it.
        let is_showing = |at: usize| showing == 0 || shown[at];
        let is_described = |at: usize| is_showing(at) && chi_squared_tail(lowest[at], spectra[at].bands()) >= DESCRIBED;
        let one_is_described = (0..spectra.len()).any(is_described);
        let is_used = |at: usize| if one_is_described { is_described(at) } else { is_showing(at) };
        weights.iter_mut().enumerate().filter(|(at, _)| !is_used(*at)).for_each(|(_, weight)| *weight = 0.0);
        Ok(Self { spectra, lowest, shown, weights, required, rise: chi_squared_quantile(BOUNDED, 1.0) })
    }

    fn total(&self, of: &Hypothesis) -> f64 {
        of.total(&self.weights)
    }

    /// Channels that show a filter, of all.
    fn shown(&self) -> (usize, usize) {
        (self.shown.iter().filter(|shown| **shown).count(), self.shown.len())
    }

    /// A low-pass filter with which the deviances are less than with moving averages by more than chance explains.
    fn low_pass_in_place_of(&self, averages: &Hypothesis, low_passes: &[TriedFamily]) -> Option<PartFilter> {
        let likeliest = low_passes.iter().map(|family| (family, family.likeliest(&self.weights)));
        let (family, low_pass) = likeliest.min_by(|(_, a), (_, b)| self.total(a).total_cmp(&self.total(b)))?;
        // A spectrum that neither of them describes scatters both deviances.
        let weights = weights(self.spectra, &lesser(self.lowest.clone(), &low_pass.deviances));
        let weights = weights.into_iter().zip(&self.weights).map(|(new, old)| if *old > 0.0 { new } else { 0.0 });
        let weights: Vec<f64> = weights.collect();
        (averages.total(&weights) - low_pass.total(&weights) > self.required).then(|| PartFilter {
            term: low_pass.term(),
            adjusted: family.bounded(&low_pass, &weights, self.rise),
            shown: self.shown(),
            contradicting: Vec::new(),
            other_taps: Vec::new(),
        })
    }

    /// The moving averages `common` of a family, with how far the channels differ from them.
    fn averages(&self, family: &TriedFamily, common: &Hypothesis, other_taps: Vec<u16>) -> PartFilter {
        let all: Vec<usize> = (0..self.spectra.len()).collect();
        let all_weights = weights(self.spectra, &self.lowest);
        let own = in_parallel(&all, |&at| {
            let own =
                family.likeliest(&all.iter().map(|other| f64::from(u8::from(*other == at))).collect::<Vec<f64>>());
            (own.adjusted, (all_weights[at] * (common.deviances[at] - own.deviances[at])).max(0.0))
        });
        let contradicted = chi_squared_quantile(1.0 - REFUTED, 1.0);
        let contradicting = self.spectra.iter().zip(&own).zip(&self.shown);
        let contradicting = contradicting.filter(|((_, (_, rise)), shown)| **shown && *rise > contradicted);
        // A common filter is known less by as much as the channels differ among themselves beyond chance.
        let used = own.iter().zip(&self.weights).filter(|(_, weight)| **weight > 0.0);
        let rises: Vec<f64> = used.map(|((_, rise), _)| *rise).collect();
        PartFilter {
            term: common.term(),
            adjusted: family.bounded(common, &self.weights, self.rise * birge_ratio(&rises)),
            shown: self.shown(),
            contradicting: contradicting.map(|((channel, (decimation, _)), _)| (channel.name, *decimation)).collect(),
            other_taps,
        }
    }
}

fn lesser(mut deviances: Vec<f64>, others: &[f64]) -> Vec<f64> {
    deviances.iter_mut().zip(others).for_each(|(deviance, other)| *deviance = deviance.min(*other));
    deviances
}

/// One over how much the `lowest` deviance of each channel exceeds that of a spectrum which a filter describes, at most 1.
fn weights(spectra: &[ChannelSpectrum], lowest: &[f64]) -> Vec<f64> {
    spectra.iter().zip(lowest).map(|(channel, lowest)| (channel.bands() / lowest).min(1.0)).collect()
}

/// Disagreement of the channels: the sum of the `rises` of their deviances over its expectation, at least 1 (Birge, Phys. Rev. 40, 1932).
fn birge_ratio(rises: &[f64]) -> f64 {
    (rises.iter().sum::<f64>() / (rises.len() as f64 - 1.0).max(1.0)).max(1.0)
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

    /// Three channels of a part with a Bartlett window of `taps` values, read at `rate_hz`: with 2.5, 5 and 20 counts, so that
    /// rounding is 1.3 % of the variance of the first and nothing in the last. 2¹⁷ samples.
    fn estimated(taps: usize, rate_hz: f64, seed: u64) -> Result<PartFilter, Unidentified> {
        let profile = measurement::adis16405::profile(0.05);
        let decimation = CLOCK_HZ / rate_hz;
        let recorded = [2.5, 5.0, 20.0].map(|deviation| {
            // The filter takes the variance of a sample down by about its length in samples.
            let deviation = deviation * (1.0_f64).max(1.5 * taps as f64 / decimation).sqrt();
            let seed = 1_000 * seed + deviation.to_bits() % 997;
            read(&RecordedChannel { taps, decimation, deviation, samples: 1 << 17, seed })
        });
        estimated_from(&recorded, (&profile, rate_hz))
    }

    fn estimated_from(
        recorded: &[Vec<i32>; 3],
        (profile, rate_hz): (&SensorProfile, f64),
    ) -> Result<PartFilter, Unidentified> {
        estimated_with_losses(recorded, (profile, rate_hz), |_| false)
    }

    fn estimated_with_losses(
        recorded: &[Vec<i32>; 3],
        (profile, rate_hz): (&SensorProfile, f64),
        is_lost: impl Fn(usize) -> bool,
    ) -> Result<PartFilter, Unidentified> {
        let (period, decimation) = (1.0 / rate_hz, profile.internal_rate_hz / rate_hz);
        let curves = recorded.each_ref().map(|counts| {
            let mut cascade = Cascade::<OCTAVES, OVERLAP>::new();
            counts.iter().for_each(|count| cascade.push(*count));
            cascade.curve(period)
        });
        let series = recorded.each_ref().map(|counts| {
            let value = |(at, count): (usize, &i32)| if is_lost(at) { f64::NAN } else { f64::from(*count) };
            let values = counts.iter().enumerate().map(value).collect();
            UniformSeries::new(period, values).with_rounding(Rounding::white(1.0, period))
        });
        let filters = profile.filters_read_at(rate_hz);
        let models = curves.each_ref().map(|curve| trace(curve, LineCandidates::Spectrum(&[]), &filters).after);
        let recorded = curves.iter().zip(&models).zip(&series);
        let channels = recorded.map(|((curve, model), rest)| FilteredChannel {
            name: "",
            curve,
            model,
            is_dithered: true,
            samples: SamplesOfCurve { rest, spectrum: None },
            lines: Vec::new(),
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

    /// Six or more of eight 95 % intervals hold in 99.4 % of cases. Bartlett windows and white noise have no low-pass filter.
    #[test]
    fn two_stages_are_told_from_moving_averages() {
        let profile = SensorProfile::generic();
        let mut held = 0;
        for (frequency_hz, seed) in
            [(25.0, 1), (25.0, 2), (60.0, 3), (60.0, 4), (60.0, 5), (40.0, 6), (40.0, 7), (40.0, 8)]
        {
            let recorded = behind_two_stages(frequency_hz, seed);
            let found = estimated_from(&recorded, (&profile, 250.0)).expect("a filter");
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
            let found = estimated_from(&averaged, (&profile, 250.0)).expect("a filter");
            assert_eq!(usize::from(averages(&found).taps), taps, "{found:?}");
        }
    }

    fn averages(found: &PartFilter) -> MovingAverageFilter {
        let NoiseTerm::Filtered(filter) = found.term else { panic!("{found:?}") };
        filter
    }

    /// Estimates the decimation of each of `parts` (taps, rate in Hz) for four seeds. Of 20 intervals of 95 %, 19 ± 1 hold; at three
    /// standard deviations less 16. Returns their widths as parts of the decimations.
    fn held_intervals(parts: [(usize, f64); 5]) -> Vec<f64> {
        let (mut held, mut widths) = (0, Vec::new());
        for (taps, rate_hz) in parts {
            for seed in 1..=4 {
                let found = estimated(taps, rate_hz, seed).expect("a filter");
                let truth = CLOCK_HZ / rate_hz;
                assert_eq!(usize::from(averages(&found).taps), taps, "read at {rate_hz} Hz: {found:?}");
                assert!(found.contradicting.is_empty(), "read at {rate_hz} Hz: {found:?}");
                let BoundedEstimate { value, low, high } = found.adjusted;
                println!("{taps} taps, {truth:.4}: {value:.4} [{low:.4}, {high:.4}]");
                widths.push((high - low) / value);
                held += usize::from((low..=high).contains(&truth));
            }
        }
        assert!(held >= 16, "{held} of 20");
        widths
    }

    /// 819.2 Hz read at odd rates, with filters that reach over one to many samples.
    #[test]
    fn joint_intervals_hold_the_true_decimation() {
        let parts = [(8, 91.8), (8, 100.0), (16, 137.0), (16, 211.3), (64, 100.0)];
        // Known well enough to be of use.
        let widths = held_intervals(parts);
        assert!(widths.iter().all(|width| *width < 0.05), "{widths:?}");
    }

    /// One of 20 samples, and an outage of a tenth of the record, are missing; the third channel has a band of a deviation of 12 counts, which is no
    /// part of its model. Of three intervals of 95 % two or more hold in 99.3 % of cases.
    #[test]
    fn a_filter_is_found_beside_losses_and_a_band() {
        let (profile, rate_hz) = (measurement::adis16405::profile(0.05), 91.8);
        let mut held = 0;
        for seed in 1..=3 {
            let mut recorded = [5.0, 10.0, 20.0_f64].map(|deviation| {
                let seed = 100 * seed + deviation.to_bits() % 97;
                read(&RecordedChannel { taps: 8, decimation: CLOCK_HZ / rate_hz, deviation, samples: 1 << 16, seed })
            });
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let (mut last, mut before) = (0.0, 0.0);
            for count in &mut recorded[2] {
                let next = 1.2 * last - 0.9 * before + 4.0 * random.sample::<f64, _>(StandardNormal);
                (before, last) = (last, next);
                *count += next.round() as i32;
            }
            let is_lost = |at: usize| at % 20 == 7 || (20_000..26_000).contains(&at);
            let found = estimated_with_losses(&recorded, (&profile, rate_hz), is_lost).expect("a filter");
            assert_eq!(averages(&found).taps, 8, "{found:?}");
            let BoundedEstimate { value, low, high } = found.adjusted;
            println!("{value:.4} [{low:.4}, {high:.4}]");
            assert!(high - low < 0.1 * value, "{found:?}");
            held += usize::from((low..=high).contains(&(CLOCK_HZ / rate_hz)));
        }
        assert!(held >= 2, "{held}");
    }

    /// A reader that counts the values of the part reads every second or ninth, and the phase between their clocks stays.
    #[test]
    fn joint_intervals_hold_whole_decimations() {
        let parts = [(8, 2.0), (16, 2.0), (16, 4.0), (16, 9.0), (64, 9.0)];
        held_intervals(parts.map(|(taps, every)| (taps, CLOCK_HZ / every)));
    }

    #[test]
    fn a_filter_whose_every_value_is_recorded_is_told_from_one_that_is_read_slowly() {
        for taps in [2, 4, 16] {
            let found = estimated(taps, CLOCK_HZ, 7).expect("a filter");
            let filter = averages(&found);
            assert_eq!((usize::from(filter.taps), filter.decimation), (taps, 1.0), "{found:?}");
        }
    }

    /// Without a filter, or behind one that is shorter than the sample period, nothing tells the clock.
    #[test]
    fn white_noise_identifies_no_filter() {
        for seed in 1..=4 {
            assert_eq!(estimated(1, CLOCK_HZ, seed), Err(Unidentified::NotCorrelated));
            assert_eq!(estimated(4, 91.8, seed), Err(Unidentified::NotCorrelated));
        }
        assert_eq!(estimate(&[], (&[], true), 1.0), Err(Unidentified::NotDithered));
    }
}
