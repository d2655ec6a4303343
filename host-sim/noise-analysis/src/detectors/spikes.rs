//! Spikes: single samples that differ from the best linear interpolation by their neighbours.
//!
//! The threshold for N samples follows from the normal tail, [a heavier one](Interpolation::least_beyond_tail), or
//! louder noise around. Behind a filter the [prediction](super::prediction) is tested first.

use super::noise_levels::{CLIP, clipped_deviation};
use super::prediction::Prediction;
use crate::bounds::BoundedEstimate;
use crate::distributions::{
    DESCRIBED, NORMAL_975, density, mean_ratio_tail, poisson_bounds, poisson_tail, quantile, upper_tail,
};
use crate::effects::Spikes;
use crate::effects::findings::{Correction, Detection, REFUTED, SIGNIFICANCE};
use crate::robust::{median, median_and_deviation};
use crate::samples::interpolation::{
    ALL_NEIGHBOURS, Autocovariance, LEAST_WHITE, Neighbours, PartialInterpolation, REACH,
};
use crate::samples::series::Series;
use nalgebra::{SMatrix, SVector};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::sync::Arc;

const FEWEST_ON_A_SIDE: u32 = REACH as u32 / 2;

/// Samples per median for clipping: over several of them drift exceeds the noise of a sample.
const CLIPPED_BLOCK: usize = 256;

/// Largest difference of the means before and after a spike, as a fraction of it; beyond it is a jump of the bias.
const SETTLED: f64 = 0.5;

/// Samples on either side that give the noise around a sample: few for fast changes, many for small ones.
const AROUND: [usize; 4] = [16, 32, 64, FARTHEST];
const FARTHEST: usize = 128;

/// Part of the deviation at which an exponential decay ends; the rest has little energy.
const DECAYED: f64 = 0.3;
/// Longest extension of a disturbance on either side, in lengths of what stands out.
const LONGEST_DECAY: f64 = 4.0;

/// Highest probability of a chance spike at the time of a knock that makes it a part of the knock.
const COINCIDENCE: f64 = 0.05;

/// Parts of normal errors beyond which the tail is examined.
const TAILS: [f64; 2] = [1e-2, 1e-3];

/// Least assumed fraction of spikes above the threshold; bounds the implied rate.
const LEAST_DETECTED: f64 = 0.05;

pub(crate) struct SpikeRule {
    interpolation: Interpolation,
    /// Present if it shows spikes in front of a filter better.
    prediction: Option<Prediction>,
    least: f64,
    /// Trimmed mean distance of neighbouring samples, in the channel's unit.
    difference: f64,
}

#[derive(Clone, Default)]
pub(crate) struct FoundSpikes {
    spikes: Vec<FoundSpike>,
    /// Candidates that are jumps of the bias.
    jumps: usize,
}

#[derive(Clone, Copy)]
struct FoundSpike {
    slot: u64,
    /// Magnitude of the error, in the channel's unit.
    size: f64,
    sigmas: f64,
    /// True if it is a filter's response to an earlier spike.
    is_response: bool,
    stands_out: bool,
}

struct FilteredSpike {
    position: usize,
    /// In the channel's unit.
    size: f64,
    sigmas: f64,
    /// True if it is a remainder of the response to a larger one.
    is_response: bool,
}

/// Outliers in a row, longer than an interpolation spans: no filtered spikes.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Disturbance {
    /// Sample periods from the first sample that stands out to the last one.
    pub certain: Range<u64>,
    /// Sample periods in which it may exceed a part of the noise.
    pub slots: Range<u64>,
    pub level: f64,
    pub count: usize,
    /// p-value of independent spikes this close together anywhere.
    pub p_value: f64,
}

impl FoundSpikes {
    fn kept(&self, kept: impl Fn(&FoundSpike) -> bool) -> Self {
        Self { spikes: self.spikes.iter().filter(|spike| kept(spike)).copied().collect(), jumps: self.jumps }
    }

    pub(crate) fn within(&self, slots: &Range<u64>) -> Self {
        self.kept(|spike| slots.contains(&spike.slot))
    }

    fn outside(&self, stretches: &[Range<u64>]) -> Self {
        self.kept(|spike| !stretches.iter().any(|of| of.contains(&spike.slot)))
    }

    /// Sample periods of the events in `slots`, if chance puts as many into a stretch of this length.
    pub(crate) fn by_chance_within(&self, slots: &Range<u64>, samples: u64) -> Vec<u64> {
        let (inside, others) = (self.within(slots), self.kept(|spike| !slots.contains(&spike.slot)));
        let events = others.events().len() as f64;
        let samples_of_event = if events > 0.0 { others.spikes.len() as f64 / events } else { 1.0 };
        let count = (inside.spikes.len() as f64 / samples_of_event).ceil() as u64;
        let stretches = samples as f64 / (slots.end - slots.start).max(1) as f64;
        let p_value = stretches * poisson_tail(count, (events + 1.0) / stretches);
        if p_value < REFUTED { Vec::new() } else { inside.slots().collect() }
    }

    /// The spikes before a sample period; `jumps` is kept.
    pub(crate) fn before(&self, slot: u64) -> Self {
        Self { jumps: 0, ..self.kept(|spike| spike.slot < slot) }
    }

    pub(crate) fn out_of_noise(&self) -> Self {
        self.kept(|spike| spike.stands_out)
    }

    pub(crate) fn extend(&mut self, later: Self) {
        self.spikes.extend(later.spikes);
        self.jumps += later.jumps;
    }

    pub(crate) fn slots(&self) -> impl Iterator<Item = u64> {
        self.spikes.iter().map(|spike| spike.slot)
    }

    pub(crate) fn samples(&self) -> impl Iterator<Item = (u64, f64)> {
        self.spikes.iter().map(|spike| (spike.slot, spike.size))
    }

    fn events(&self) -> Vec<Range<usize>> {
        let mut events: Vec<Range<usize>> = Vec::new();
        for at in 0..self.spikes.len() {
            match events.last_mut() {
                Some(event) if self.spikes[at].slot - self.spikes[at - 1].slot <= REACH as u64 => event.end = at + 1,
                _ => events.push(at..at + 1),
            }
        }
        events
    }

    /// Sizes of the independent spikes in `samples` samples; a spike spread by a filter counts once.
    fn sizes_of_events(&self, samples: u64) -> Vec<f64> {
        let events = self.events();
        let joined = (self.spikes.len() - events.len()) as u64;
        let expected = events.len() as f64 * near_by_chance(events.len(), samples);
        if poisson_tail(joined, expected) >= REFUTED {
            return self.spikes.iter().map(|spike| spike.size).collect();
        }
        events.into_iter().map(|event| self.spikes[event].iter().map(|spike| spike.size).fold(0.0, f64::max)).collect()
    }

    /// Number without filter responses.
    fn independent(&self) -> usize {
        self.spikes.iter().filter(|spike| !spike.is_response).count()
    }

    fn are_spikes(&self) -> bool {
        self.independent() > self.jumps
    }
}

impl SpikeRule {
    /// `None` with fewer than 600 samples, or if the channel never changes.
    pub(crate) fn fit(series: &Series) -> Option<Self> {
        Self::fit_for(series, series.values.len() as u64)
    }

    /// For `samples` samples, of which `series` has some.
    pub(crate) fn fit_for(series: &Series, samples: u64) -> Option<Self> {
        if series.values.len() < 100 * REACH {
            return None;
        }
        let (interpolation, prediction) = Interpolation::fit(series)?;
        let least = interpolation.least_beyond_tail(series, samples);
        Some(Self { interpolation, prediction, least, difference: typical_difference(series) })
    }

    /// Looks for spikes in the `series` that the rule was fitted to, but for stretches in which its noise is `louder` by itself. `None` if
    /// there are none, or if jumps of the bias are at least as frequent.
    pub(crate) fn detect(&self, series: &Series, louder: &[Range<u64>]) -> Option<Detection> {
        let looked_at = (series.duration_s() / 3600.0, series.values.len() as u64);
        self.detection(&self.find(series).out_of_noise().outside(louder), looked_at, series.unit)
    }

    /// Sample periods outside of `louder` noise, in ascending order; none if jumps of the bias are as frequent.
    pub(crate) fn slots(&self, series: &Series, louder: &[Range<u64>]) -> Vec<u64> {
        let found = self.find_around(series, self.interpolation.mean).out_of_noise().outside(louder);
        if found.are_spikes() { found.slots().collect() } else { Vec::new() }
    }

    /// The outliers in a part of the same channel, whose bias and noise level may differ.
    pub(crate) fn find(&self, series: &Series) -> FoundSpikes {
        self.find_around(series, series.values.iter().sum::<f64>() / series.values.len().max(1) as f64)
    }

    fn find_around(&self, series: &Series, mean: f64) -> FoundSpikes {
        if series.values.len() <= 2 * REACH {
            return FoundSpikes::default();
        }
        let interpolation = Interpolation { mean, ..self.interpolation };
        let louder = typical_difference(series) / self.difference;
        interpolation.spikes(series, self.prediction.as_ref(), self.least, louder.max(1.0))
    }

    /// Separates the outliers in `samples` samples into single spikes and disturbances, in ascending order.
    ///
    /// Outliers with at most [`REACH`] sample periods between them are one event. An event beyond chance that is longer
    /// than an interpolation spans is a disturbance.
    pub(crate) fn separate(&self, found: FoundSpikes, samples: u64) -> (FoundSpikes, Vec<Disturbance>) {
        let events = found.events();
        let near = near_by_chance(events.len(), samples);
        let disturbance = |event: &Range<usize>| {
            let certain = found.spikes[event.start].slot..found.spikes[event.end - 1].slot + 1;
            let length = certain.end - certain.start;
            let independent = found.spikes[event.clone()].iter().filter(|spike| !spike.is_response).count();
            let p_value = (events.len() as f64 * near.powi(independent as i32 - 1)).min(1.0);
            if length <= 2 * REACH as u64 || p_value >= REFUTED {
                return None;
            }
            let sizes = || found.spikes[event.clone()].iter().map(|spike| spike.sigmas);
            let times = (self.least / DECAYED).ln() / (sizes().fold(self.least, f64::max) / self.least).ln();
            let decay = (times.min(LONGEST_DECAY) * length as f64).ceil() as u64;
            Some(Disturbance {
                slots: certain.start.saturating_sub(decay)..certain.end + decay,
                level: (sizes().map(|size| size * size).sum::<f64>() / event.len() as f64).sqrt(),
                count: event.len(),
                p_value,
                certain,
            })
        };
        let mut disturbances: Vec<Disturbance> = Vec::new();
        for next in events.iter().filter_map(disturbance) {
            match disturbances.last_mut() {
                Some(last) if next.slots.start < last.slots.end => last.join(next),
                _ => disturbances.push(next),
            }
        }
        let is_single = |slot: &u64| !disturbances.iter().any(|of| of.slots.contains(slot));
        (found.kept(|spike| is_single(&spike.slot)), disturbances)
    }

    /// The parts of the `known` disturbances that `singles` show, with a chance below one in twenty.
    pub(crate) fn parts_of(&self, singles: &FoundSpikes, known: &[Range<u64>], samples: u64) -> Vec<Disturbance> {
        let around = |known: &Range<u64>| {
            let length = known.end - known.start;
            known.start.saturating_sub(length)..known.end + length
        };
        let events = singles.events();
        let is_within =
            |event: &Range<usize>, known: &Range<u64>| around(known).contains(&singles.spikes[event.start].slot);
        let others = events.iter().filter(|event| !known.iter().any(|known| is_within(event, known))).count();
        let part = |known: &Range<u64>| {
            let inside: Vec<usize> = events.iter().filter(|event| is_within(event, known)).cloned().flatten().collect();
            let (first, last) = (singles.spikes[*inside.first()?].slot, singles.spikes[*inside.last()?].slot);
            let window = around(known);
            // The rate of the others, and one more.
            let expected = (others + 1) as f64 * (window.end - window.start) as f64 / samples.max(1) as f64;
            let squares = inside.iter().map(|&at| singles.spikes[at].sigmas.powi(2));
            let count = inside.len();
            (expected < COINCIDENCE).then(|| Disturbance {
                certain: first..last + 1,
                slots: known.start.min(first.saturating_sub(REACH as u64))..known.end.max(last + 1 + REACH as u64),
                level: (squares.sum::<f64>() / count as f64).sqrt(),
                count,
                p_value: expected,
            })
        };
        known.iter().filter_map(part).collect()
    }

    /// True if chance finds as many, or one as large, in `samples` samples with less than [`SIGNIFICANCE`].
    fn is_beyond_chance(&self, found: &FoundSpikes, samples: u64) -> bool {
        let large = quantile(0.5 * SIGNIFICANCE / samples as f64);
        found.independent() > 1 || found.spikes.iter().any(|spike| spike.sigmas > large)
    }

    /// The reported spikes of a channel in `unit`, observed for `hours`; `None` without any.
    pub(crate) fn detection(
        &self,
        found: &FoundSpikes,
        (hours, samples): (f64, u64),
        unit: &'static str,
    ) -> Option<Detection> {
        if !found.are_spikes() || !self.is_beyond_chance(found, samples) {
            return None;
        }
        let sizes = &found.sizes_of_events(samples);
        let largest = found.spikes.iter().map(|spike| spike.sigmas).fold(0.0, f64::max);
        let deviation = median(&mut found.spikes.iter().map(|spike| spike.size / spike.sigmas).collect::<Vec<f64>>());
        let size = SpikeSize::estimate(sizes, self.least * deviation, deviation);
        let count = sizes.len() as f64;
        let (fewest, most) = poisson_bounds(count);
        let rate = |count: f64, detected: f64| count / detected / hours;
        let spikes = Spikes {
            rate_per_hour: BoundedEstimate::new(
                rate(count, size.detected),
                rate(fewest, size.detected_most),
                rate(most, size.detected_least),
            ),
            size: BoundedEstimate::new(size.value, size.low, size.high).in_unit(unit),
            count: sizes.len(),
            threshold_sigmas: self.least,
            largest_sigmas: largest,
        };
        Some(Detection { effect: spikes.into(), correction: Some(Correction::Exclude(found.slots().collect())) })
    }
}

impl Disturbance {
    fn join(&mut self, later: Self) {
        let (own, other) = (self.count as f64, later.count as f64);
        let squares = own * self.level.powi(2) + other * later.level.powi(2);
        self.level = (squares / (own + other)).sqrt();
        self.certain.end = later.certain.end;
        self.slots = self.slots.start.min(later.slots.start)..self.slots.end.max(later.slots.end);
        self.count += later.count;
        self.p_value = self.p_value.min(later.p_value);
    }
}

/// Probability that the next of `events` independent events follows within [`REACH`] sample periods.
fn near_by_chance(events: usize, samples: u64) -> f64 {
    -(-(events as f64 * REACH as f64) / samples.max(1) as f64).exp_m1()
}

struct Interpolation {
    weights: [f64; REACH],
    /// `None` until it is known.
    covariance: Option<Autocovariance>,
    mean: f64,
    /// Standard deviation of its error, at least half a count.
    deviation: f64,
}

impl Interpolation {
    fn fit(series: &Series) -> Option<(Self, Option<Prediction>)> {
        let mean = series.values.iter().sum::<f64>() / series.values.len() as f64;
        let mut interpolation = Self { weights: [0.5 / REACH as f64; REACH], covariance: None, mean, deviation: 0.0 };
        // First by the mean of the neighbours: gross spikes would distort the covariance.
        let errors = interpolation.errors(series, &series.values);
        let rough = clipped_deviation(&errors);
        let mut clean = series.values.clone();
        for (position, error) in errors.iter().enumerate().filter(|(_, error)| error.abs() > CLIP * rough) {
            Arc::make_mut(&mut clean)[position] -= error;
        }
        clip(Arc::make_mut(&mut clean), series.resolution);
        let covariance = covariance(series, &clean, mean);
        interpolation.weights = weights(&covariance)?;
        interpolation.covariance = Some(covariance);
        let deviation = clipped_deviation(&interpolation.errors(series, &series.values));
        interpolation.deviation = deviation.max(0.5 * series.resolution);
        let is_better =
            |by: &Prediction| by.interpolated(&interpolation.weights) / interpolation.deviation < by.deviation.recip();
        let prediction = Prediction::fit(series, &covariance, mean).filter(is_better);
        Some((interpolation, prediction))
    }

    /// Threshold in standard deviations that chance exceeds in `samples` samples with [`REFUTED`]: in normal noise, or
    /// in noise with the heavier tail of `series`.
    ///
    /// A heavy tail is the power law between the last of 100 and of 1,000 errors. If it explains the errors beyond the
    /// threshold, its own threshold or a [gap](standing_apart) in the sizes applies.
    fn least_beyond_tail(&self, series: &Series, samples: u64) -> f64 {
        let normal = quantile(0.5 * REFUTED / samples as f64);
        let errors = self.errors(series, &series.values).into_iter().map(|of| of.abs() / self.deviation).collect();
        let errors = against_louder_noise(errors, normal);
        let stands_out: BTreeSet<usize> = (0..errors.len()).filter(|&at| errors[at] > normal).collect();
        if stands_out.is_empty() {
            return normal;
        }
        // An outlier is in the errors of its neighbours too.
        let is_beside = |at: usize| {
            let around = at.saturating_sub(REACH)..at + REACH + 1;
            !stands_out.contains(&at) && has_any(&stands_out, around)
        };
        let looked_at: Vec<f64> = (0..errors.len()).filter(|&at| !is_beside(at)).map(|at| errors[at]).collect();
        let beyond = |least: f64| looked_at.iter().filter(|error| **error > least).count() as f64;
        let all = looked_at.len() as f64;
        let [hundredth, thousandth] = TAILS.map(|part| quantile(0.5 * part));
        let [of_hundredth, of_thousandth, found] = [hundredth, thousandth, normal].map(beyond);
        let between = all * (TAILS[1] - 2.0 * upper_tail(normal));
        if poisson_tail((of_thousandth - found) as u64, between) >= DESCRIBED {
            return normal;
        }
        let error = (1.0 / of_thousandth - 1.0 / of_hundredth).max(0.0).sqrt();
        let falls = (of_hundredth / of_thousandth).ln() - NORMAL_975 * error;
        let power = falls.max(0.0) / (thousandth / hundredth).ln();
        let expected = of_thousandth * (normal / thousandth).powf(-power);
        if poisson_tail(found as u64, expected) < REFUTED {
            return normal;
        }
        let in_all_samples = of_thousandth * samples as f64 / all;
        let of_power_law = thousandth * (in_all_samples / REFUTED).powf(1.0 / power);
        let mut sizes: Vec<f64> = looked_at.iter().copied().filter(|size| *size > thousandth).collect();
        sizes.sort_by(|a, b| b.total_cmp(a));
        normal.max(standing_apart(&sizes, found as usize).unwrap_or(f64::INFINITY).min(of_power_law))
    }

    fn error(&self, values: &[f64], position: usize) -> f64 {
        let pairs = self
            .weights
            .iter()
            .enumerate()
            .map(|(at, weight)| weight * (values[position - at - 1] + values[position + at + 1] - 2.0 * self.mean));
        values[position] - self.mean - pairs.sum::<f64>()
    }

    /// Interpolation errors in units of [`deviation`](Self::deviation); 0 near an end and with too few neighbours.
    fn errors(&self, series: &Series, values: &[f64]) -> Vec<f64> {
        let mut partial = BTreeMap::new();
        (0..values.len()).map(|position| self.normalised_error(series, values, position, &mut partial)).collect()
    }

    /// One of [`errors`](Self::errors); `partial` caches the interpolations for each set of neighbours.
    fn normalised_error(
        &self,
        series: &Series,
        values: &[f64],
        position: usize,
        partial: &mut BTreeMap<Neighbours, Option<PartialInterpolation>>,
    ) -> f64 {
        if !(REACH..values.len() - REACH).contains(&position) {
            return 0.0;
        }
        if series.is_gapless(position - REACH, position + REACH) {
            return self.error(values, position);
        }
        let slot = series.slots[position];
        let mut neighbours = [None; 2 * REACH];
        for other in (position - REACH..=position + REACH).filter(|&other| other != position) {
            let distance = series.slots[other].abs_diff(slot) as usize;
            if distance <= REACH {
                neighbours[distance - 1 + if other > position { REACH } else { 0 }] = Some(values[other] - self.mean);
            }
        }
        let present = neighbours
            .iter()
            .enumerate()
            .fold(0, |present: Neighbours, (bit, neighbour)| present | Neighbours::from(neighbour.is_some()) << bit);
        let sides = [present & (ALL_NEIGHBOURS >> REACH), present >> REACH];
        if sides.iter().any(|side| side.count_ones() < FEWEST_ON_A_SIDE) {
            return 0.0;
        }
        let best = partial.entry(present).or_insert_with(|| match &self.covariance {
            Some(covariance) => PartialInterpolation::best(covariance, present),
            None => Some(PartialInterpolation::mean(present)),
        });
        best.as_ref().map_or(0.0, |best| {
            let pairs = best.weights.iter().zip(&neighbours).filter_map(|(weight, value)| Some(weight * (*value)?));
            (values[position] - self.mean - pairs.sum::<f64>()) / best.scale
        })
    }

    /// The noise around a sample over that of the channel, by its `errors`; 1 if chance explains it.
    fn louder_around(&self, errors: &[(usize, f64)]) -> f64 {
        let louder = |reach: usize| {
            let near = errors.iter().filter(|(distance, error)| *distance <= reach && *error != 0.0);
            let squares = near.map(|(_, error)| (error / self.deviation).powi(2));
            let (count, sum) = squares.fold((0.0, 0.0), |(count, sum), square| (count + 1.0, sum + square));
            let is_louder = count > 0.0 && upper_tail((sum - count) / f64::sqrt(2.0 * count)) < REFUTED;
            if is_louder { f64::sqrt(sum / count) } else { 1.0 }
        };
        AROUND.map(louder).into_iter().fold(1.0, f64::max)
    }

    fn spikes(&self, series: &Series, prediction: Option<&Prediction>, least: f64, louder: f64) -> FoundSpikes {
        let mut values = series.values.clone();
        let filtered = prediction.map(|by| self.filtered_spikes(series, &mut values, by, least * louder));
        let filtered = filtered.unwrap_or_default();
        let length = prediction.map_or(0, Prediction::length);
        let positions: BTreeSet<usize> = filtered.iter().map(|of| of.position).collect();
        let is_response = |position: usize| has_any(&positions, position.saturating_sub(2 * REACH - 1)..position + 1);
        let threshold = least * self.deviation;
        let errors = self.errors(series, &values);
        let mut candidates: Vec<usize> =
            (0..errors.len()).filter(|&at| errors[at].abs() > threshold * louder).collect();
        candidates.sort_by(|a, b| errors[*b].abs().total_cmp(&errors[*a].abs()));
        let (mut spikes, mut jumps) = (Vec::<(usize, f64)>::new(), Vec::<(usize, f64)>::new());
        let (mut larger, mut responses) = (BTreeSet::new(), Vec::new());
        let mut partial = BTreeMap::new();
        for position in candidates {
            // A larger spike nearby may have been removed.
            let error = self.normalised_error(series, &values, position, &mut partial);
            if error.abs() <= threshold * louder {
                continue;
            }
            let mean = |from: usize| values[from..from + REACH].iter().sum::<f64>() / REACH as f64;
            let height = (mean(position + 1) - mean(position - REACH)).abs();
            if height > SETTLED * error.abs() {
                // A filter's response to a spike is no jump.
                let is_part = |&(spike, _): &(usize, f64)| spike.abs_diff(position) <= REACH;
                if !spikes.iter().any(is_part) && !is_response(position) {
                    jumps.push((position, height));
                }
                continue;
            }
            Arc::make_mut(&mut values)[position] -= error;
            responses.push(is_response(position) || has_any(&larger, nearer_than(position, length)));
            larger.insert(position);
            spikes.push((position, error.abs()));
        }
        // Neither responses of a filter nor jumps count as louder noise.
        let mut louder_around = |position: usize| {
            let around = position.saturating_sub(FARTHEST)..(position + FARTHEST + 1).min(values.len());
            let around = around.map(|at| (at.abs_diff(position), at)).filter(|(distance, _)| *distance > REACH);
            let error = |(distance, at)| (distance, self.normalised_error(series, &values, at, &mut partial));
            self.louder_around(&around.map(error).collect::<Vec<(usize, f64)>>())
        };
        jumps.retain(|&(position, height)| height > SETTLED * threshold * louder_around(position));
        let mut found = Vec::new();
        for ((position, size), is_response) in spikes.into_iter().zip(responses) {
            let sigmas = size / self.deviation;
            let stands_out = sigmas > least * louder_around(position);
            found.push(FoundSpike { slot: series.slots[position], size, sigmas, is_response, stands_out });
        }
        for FilteredSpike { position, size, sigmas, is_response } in filtered {
            let stands_out = sigmas > least * louder_around(position);
            let changed = prediction.into_iter().flat_map(|by| by.changed(series, position));
            found.extend(changed.map(|at| {
                let is_response = is_response || at > position;
                FoundSpike { slot: series.slots[at], size, sigmas, is_response, stands_out }
            }));
        }
        found.sort_by_key(|spike| (spike.slot, spike.is_response));
        found.dedup_by_key(|spike| spike.slot);
        FoundSpikes { spikes: found, jumps: jumps.len() }
    }

    /// Spikes in front of the filter of at least `least` standard deviations; subtracts them from `values`.
    fn filtered_spikes(
        &self,
        series: &Series,
        values: &mut Arc<[f64]>,
        prediction: &Prediction,
        least: f64,
    ) -> Vec<FilteredSpike> {
        let threshold = least * prediction.deviation;
        let errors = (0..values.len()).map(|at| (at, prediction.error(series, values, self.mean, at)));
        let mut candidates: Vec<(usize, f64)> = errors.filter(|(_, error)| error.abs() > threshold).collect();
        candidates.sort_by(|(_, a), (_, b)| b.abs().total_cmp(&a.abs()));
        let (mut found, mut larger) = (Vec::new(), BTreeSet::new());
        for (position, _) in candidates {
            let error = prediction.error(series, values, self.mean, position);
            if error.abs() > threshold && prediction.is_in_front(series, values, self.mean, position) {
                prediction.subtract(series, Arc::make_mut(values), position, error);
                let (size, sigmas) = (error.abs(), error.abs() / prediction.deviation);
                let is_response = has_any(&larger, nearer_than(position, prediction.length()));
                larger.insert(position);
                found.push(FilteredSpike { position, size, sigmas, is_response });
            }
        }
        found
    }
}

/// A size that separates at most `many` of the largest `sizes` from the rest (A. Rényi, 1953: exponential spacings).
fn standing_apart(sizes: &[f64], many: usize) -> Option<f64> {
    let distance = |at: usize| (at + 1) as f64 * (sizes[at] / sizes[at + 1]).ln();
    let count = sizes.len().checked_sub(1)?;
    let all: f64 = (0..count).map(distance).sum();
    let mut of_largest = 0.0;
    let is_apart = |&at: &usize| {
        of_largest += distance(at);
        let (above, below) = ((at + 1) as f64, (count - at - 1) as f64);
        let ratio = of_largest / above / ((all - of_largest) / below);
        mean_ratio_tail(ratio, above, below) * (many as f64) < REFUTED
    };
    let apart = (0..many.min(count.saturating_sub(1))).filter(is_apart);
    let widest = apart.max_by(|a, b| distance(*a).total_cmp(&distance(*b)))?;
    Some((sizes[widest] * sizes[widest + 1]).sqrt())
}

/// Sizes of `errors` over the relative loudness of the noise around, at most `most` each.
fn against_louder_noise(errors: Vec<f64>, most: f64) -> Vec<f64> {
    let mut sums = vec![(0.0, 0.0)];
    for error in &errors {
        let (squares, count) = sums[sums.len() - 1];
        let is_known = f64::from(u8::from(*error != 0.0));
        sums.push((squares + error.min(most).powi(2), count + is_known));
    }
    let within = |from: usize, to: usize| (sums[to].0 - sums[from].0, sums[to].1 - sums[from].1);
    let level = |at: usize| {
        let around = |reach: usize| within(at.saturating_sub(reach), (at + reach + 1).min(errors.len()));
        let ((all, count), (nearest, near)) = (around(FARTHEST), around(REACH));
        (all - nearest) / (count - near).max(1.0)
    };
    let levels: Vec<f64> = (0..errors.len()).map(level).collect();
    let typical = median(&mut levels.clone());
    let louder = |level: f64| if level > typical { (level / typical).sqrt() } else { 1.0 };
    errors.iter().zip(levels).map(|(error, level)| error / louder(level)).collect()
}

fn nearer_than(position: usize, length: usize) -> Range<usize> {
    (position + 1).saturating_sub(length)..position + length
}

fn has_any(positions: &BTreeSet<usize>, within: Range<usize>) -> bool {
    !within.is_empty() && positions.range(within).next().is_some()
}

/// Mean of the smaller three quarters of the distances of neighbouring samples, at least half a count.
fn typical_difference(series: &Series) -> f64 {
    let mut distances: Vec<f64> = series.values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
    let smaller = distances.len() * 3 / 4;
    if smaller == 0 {
        return 0.5 * series.resolution;
    }
    distances.select_nth_unstable_by(smaller, f64::total_cmp);
    (distances[..smaller].iter().sum::<f64>() / smaller as f64).max(0.5 * series.resolution)
}

/// Limits the values to [`CLIP`] typical deviations from the median of their block.
fn clip(values: &mut [f64], resolution: f64) {
    let (middles, mut deviations): (Vec<f64>, Vec<f64>) =
        values.chunks(CLIPPED_BLOCK).map(median_and_deviation).unzip();
    let most = CLIP * median(&mut deviations).max(0.5 * resolution);
    for (block, middle) in values.chunks_mut(CLIPPED_BLOCK).zip(middles) {
        block.iter_mut().for_each(|value| *value = value.clamp(middle - most, middle + most));
    }
}

fn covariance(series: &Series, values: &[f64], mean: f64) -> Autocovariance {
    std::array::from_fn(|lag| {
        let pairs = (0..values.len() - lag).filter(|&at| series.is_gapless(at, at + lag));
        let (count, sum) = pairs
            .fold((0u64, 0.0), |(count, sum), at| (count + 1, sum + (values[at] - mean) * (values[at + lag] - mean)));
        sum / count.max(1) as f64
    })
}

/// Weights `a` of the least error variance: `Σ_i a_i (r(i−j) + r(i+j)) = r(j)` with the autocovariance `r`.
fn weights(covariance: &Autocovariance) -> Option<[f64; REACH]> {
    let entry = |j: usize, i: usize| {
        // White noise keeps the equations solvable for a pure sinusoid.
        let white = if i == j { LEAST_WHITE * covariance[0] } else { 0.0 };
        covariance[i.abs_diff(j)] + covariance[i + j + 2] + white
    };
    let matrix = SMatrix::<f64, REACH, REACH>::from_fn(entry);
    let weights = matrix.cholesky()?.solve(&SVector::from_fn(|j, _| covariance[j + 1]));
    Some(weights.into())
}

/// Size of the spikes with 95 % bounds, and the fraction above the threshold for each.
struct SpikeSize {
    value: f64,
    low: f64,
    high: f64,
    detected: f64,
    detected_least: f64,
    detected_most: f64,
}

impl SpikeSize {
    /// Size from the `sizes` above `threshold`, corrected for the selection by noise unless they scatter by 1.5 σ.
    fn estimate(sizes: &[f64], threshold: f64, deviation: f64) -> Self {
        let count = sizes.len() as f64;
        let mean = sizes.iter().sum::<f64>() / count;
        let scatter = (sizes.iter().map(|size| (size - mean).powi(2)).sum::<f64>() / count).sqrt();
        let half = NORMAL_975 * scatter.max(deviation) / count.sqrt();
        if scatter > 1.5 * deviation {
            return Self {
                value: mean,
                low: mean - half,
                high: mean + half,
                detected: 1.0,
                detected_least: 1.0,
                detected_most: 1.0,
            };
        }
        let size = |mean: f64| {
            let detected_mean = |size: f64| {
                let a = (threshold - size) / deviation;
                size + deviation * density(a) / upper_tail(a)
            };
            let (mut low, mut high) = ((threshold - 5.0 * deviation).max(0.0), mean);
            for _ in 0..50 {
                let middle = 0.5 * (low + high);
                if detected_mean(middle) < mean { low = middle } else { high = middle }
            }
            0.5 * (low + high)
        };
        let detected = |size: f64| upper_tail((threshold - size) / deviation).max(LEAST_DETECTED);
        let (value, low, high) = (size(mean), size((mean - half).max(threshold)), size(mean + half));
        Self {
            value,
            low,
            high,
            detected: detected(value),
            detected_least: detected(low),
            detected_most: detected(high),
        }
    }
}
