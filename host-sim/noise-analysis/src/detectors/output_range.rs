//! Limits of a channel's output: samples cut off at an end, noise below a count, missing codes.

use crate::bounds::BoundedEstimate;
use crate::detectors::effective_lsb::greatest_common_divisor;
use crate::distributions::poisson_bounds;
use crate::effects::findings::{Detection, SIGNIFICANCE};
use crate::effects::{MissingCodes, NoiseBelowCount, Saturation};
use crate::samples::gapped_cascade::GappedCascade;
use crate::samples::rounding::{DITHERED_OCTAVES, dithered_avar};
use crate::samples::series::Series;
use measurement::ChannelProfile;

/// Fewest samples at an end; chance makes 20 where 7 are expected with a probability of 4·10⁻⁵.
const FEWEST_AT_AN_END: u64 = 20;
/// Least ratio of an end to any other value; a sinusoid has 1/(√2 − 1) = 2.4.
const PILED: u64 = 3;
/// Fewest other values; with few values, none is an end of a range.
const FEWEST_VALUES: usize = 10;
/// Most bins: the codes of a converter of 14 bits.
const MOST_BINS: i64 = 1 << 14;
/// Fewest missing codes; a single one may separate two levels of a telegraph signal.
const FEWEST_MISSING: usize = 2;
const FEWEST_SAMPLES: usize = 100;

/// Histogram of a channel's values in bounded memory: bins widen with their range.
#[derive(Default)]
pub(crate) struct ValueCounts {
    bins: Vec<u64>,
    /// Number of the first bin; bin `b` has the counts from `b·2^width_log2` on.
    first: i64,
    width_log2: u32,
    extremes: Option<(i32, i32)>,
    samples: u64,
}

impl ValueCounts {
    pub(crate) fn push(&mut self, value: i32) {
        let (least, largest) = self.extremes.get_or_insert((value, value));
        (*least, *largest) = (value.min(*least), value.max(*largest));
        self.samples += 1;
        loop {
            let bin = i64::from(value) >> self.width_log2;
            if let Some(count) = usize::try_from(bin - self.first).ok().and_then(|at| self.bins.get_mut(at)) {
                *count += 1;
                return;
            }
            if self.bins.is_empty() {
                self.first = bin;
            }
            let end = self.first + self.bins.len() as i64;
            let (from, to) = (bin.min(self.first), (bin + 1).max(end));
            if to - from > MOST_BINS {
                self.widen();
            } else {
                self.bins.splice(0..0, std::iter::repeat_n(0, (self.first - from) as usize));
                self.bins.resize((to - from) as usize, 0);
                self.first = from;
            }
        }
    }

    fn widen(&mut self) {
        let first = self.first >> 1;
        let mut wider = vec![0; self.bins.len() / 2 + 1];
        for (bin, count) in (self.first..).zip(&self.bins) {
            wider[((bin >> 1) - first) as usize] += count;
        }
        (self.bins, self.first, self.width_log2) = (wider, first, self.width_log2 + 1);
    }

    /// Samples cut off at the ends of the channel's range or at another level; `resolution` in the channel's unit.
    pub(crate) fn saturation(&self, channel: &ChannelProfile, resolution: f64) -> Option<Detection> {
        let (least, largest) = self.extremes?;
        let occurring: Vec<u64> = self.bins.iter().copied().filter(|count| *count > 0).collect();
        let (&[at_least, ref others @ .., at_largest], true) =
            (occurring.as_slice(), occurring.len() >= FEWEST_VALUES + 2)
        else {
            return None;
        };
        let most_of_others = others.iter().copied().max().unwrap_or(0);
        let is_end_of_range = |level: f64| channel.range.is_some_and(|range| level.abs() > range - 0.5 * resolution);
        let is_cut_off = |&(level, count): &(f64, u64)| {
            count >= FEWEST_AT_AN_END && (count > PILED * most_of_others || is_end_of_range(level))
        };
        let ends =
            [(least, at_least), (largest, at_largest)].map(|(value, count)| (f64::from(value) * channel.lsb, count));
        let cut_off: Vec<(f64, u64)> = ends.into_iter().filter(is_cut_off).collect();
        let &(level, _) = cut_off.iter().max_by_key(|(_, count)| *count)?;
        let (samples, all) = (cut_off.iter().map(|(_, count)| count).sum::<u64>() as f64, self.samples as f64);
        let (low, high) = poisson_bounds(samples);
        let saturation = Saturation {
            fraction: BoundedEstimate::new(samples / all, low / all, (high / all).min(1.0)),
            level: BoundedEstimate::exact(level).in_unit(channel.unit),
            is_end_of_range: is_end_of_range(level),
            cut_off: samples,
            samples: all,
            most_of_others,
        };
        Some(Detection { effect: saturation.into(), correction: None })
    }

    /// Codes that never occur, each between two that occur often; `resolution` is their distance in `unit`.
    ///
    /// A unimodal density leaves a code empty with a probability below `e^−n` for n samples of the rarer neighbour.
    /// Codes missing at carries have one spacing of two counts or more. Scaled noise lacks codes only in its tails.
    pub(crate) fn missing_codes(&self, resolution: f64, unit: &'static str) -> Option<Detection> {
        if self.width_log2 > 0 {
            return None;
        }
        let enough = (self.bins.len() as f64 / SIGNIFICANCE).ln();
        let missing: Vec<(u64, f64)> = (0..)
            .zip(self.bins.windows(3))
            .filter(|(_, codes)| codes[1] == 0)
            .map(|(at, codes)| (at, codes[0].min(codes[2]) as f64))
            .filter(|&(_, rarer)| rarer > enough)
            .collect();
        let (&[(first, _), .., _], true) = (missing.as_slice(), missing.len() >= FEWEST_MISSING) else { return None };
        let spacing = missing.iter().map(|(at, _)| at - first).fold(0, greatest_common_divisor);
        let last = missing.last().map_or(first, |(at, _)| *at);
        let is_given = |at: u64| self.bins[at as usize + 1] > 0;
        if spacing < 2 || (first..=last).step_by(spacing as usize).any(is_given) {
            return None;
        }
        let found = MissingCodes {
            codes: missing.len() as u32,
            spacing: BoundedEstimate::exact(spacing as f64 * resolution).in_unit(unit),
            expected: missing.iter().map(|(_, rarer)| rarer).sum(),
        };
        Some(Detection { effect: found.into(), correction: None })
    }
}

/// Noise below a count: a first Allan variance below that of [dithered](dithered_avar) samples.
#[must_use]
pub(crate) fn find_noise_below_count(series: &Series, dithered_avar_counts2: f64) -> Option<Detection> {
    if series.values.len() < FEWEST_SAMPLES {
        return None;
    }
    let curve = GappedCascade::of_series(series, 0..series.values.len()).curve(series.period_s);
    let octaves = curve.points().iter().take(DITHERED_OCTAVES);
    let deviations = octaves.map(|point| (point.avar.sqrt(), dithered_avar(dithered_avar_counts2, point.n).sqrt()));
    let (counts, dithered_counts) = deviations.max_by(|a, b| (a.0 / a.1).total_cmp(&(b.0 / b.1)))?;
    if counts > dithered_counts {
        return None;
    }
    // Before the rounding, any value up to the limit.
    let [deviation, limit] = [counts, dithered_counts].map(|counts| counts * series.resolution);
    let noise = NoiseBelowCount {
        deviation: BoundedEstimate::new(deviation, 0.0, limit).in_unit(series.unit),
        counts,
        dithered_counts,
    };
    Some(Detection { effect: noise.into(), correction: None })
}

#[cfg(test)]
mod tests {
    use super::{MOST_BINS, ValueCounts};
    use crate::distributions::upper_tail;
    use crate::effects::Effect;
    use measurement::adis16405::profile;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    fn counted(deviation: f64, limit: i32) -> ValueCounts {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let mut counts = ValueCounts::default();
        for _ in 0..200_000 {
            counts.push(((deviation * random.sample::<f64, _>(StandardNormal)).round() as i32).min(limit));
        }
        counts
    }

    #[test]
    fn values_that_are_cut_off_are_told_from_rare_ones() {
        let channel = profile(0.05).channel("gyro_x").expect("a gyro");
        // Cut off at half a standard deviation; the second noise spreads over ten times as many counts as bins.
        for deviation in [10.0, MOST_BINS as f64] {
            let limit = (0.5 * deviation) as i32;
            let found = counted(deviation, limit).saturation(&channel, channel.lsb).expect("cut off");
            let Effect::Saturation(found) = found.effect else { panic!("{found:?}") };
            let expected = upper_tail((f64::from(limit) - 0.5) / deviation);
            // Four standard deviations of a share of 200,000 samples.
            let scatter = (expected * (1.0 - expected) / 200_000.0).sqrt();
            assert!((found.fraction.value - expected).abs() < 4.0 * scatter, "{deviation}: {found:?}");
            assert_eq!(found.level.value, f64::from(limit) * channel.lsb);
            assert_eq!(counted(deviation, i32::MAX).saturation(&channel, channel.lsb), None);
        }
    }

    #[test]
    fn codes_that_never_occur_between_others_are_missing() {
        let mut random = ChaCha8Rng::seed_from_u64(4);
        let mut walk = 0.0;
        let mut of = |step: f64, modulus: i32| {
            let mut counts = ValueCounts::default();
            for _ in 0..200_000 {
                walk += step * random.sample::<f64, _>(StandardNormal);
                let value = (walk + 10.0 * random.sample::<f64, _>(StandardNormal)).round() as i32;
                counts.push(if value.rem_euclid(modulus) == modulus - 1 { value + 1 } else { value });
            }
            counts.missing_codes(0.05, "deg/s").map(|found| found.effect)
        };
        let Some(Effect::MissingCodes(found)) = of(0.0, 8) else { panic!("none is found") };
        assert!((8..=10).contains(&found.codes), "{found:?}");
        assert!((found.spacing.value - 0.4).abs() < 1e-12);
        for step in [0.0, 0.1] {
            assert_eq!(of(step, i32::MAX), None, "{step}");
        }
    }

    #[test]
    fn codes_that_scaled_noise_lacks_in_its_tails_are_not_missing() {
        let mut random = ChaCha8Rng::seed_from_u64(6);
        let mut counts = ValueCounts::default();
        for at in 0..100_000 {
            let value = (10.0 * random.sample::<f64, _>(StandardNormal)).round() as i32;
            counts.push(if at < 50_000 { value } else { 2 * value });
        }
        assert_eq!(counts.missing_codes(0.05, "deg/s"), None);
    }

    /// Each level spreads over three codes; the one between them is empty.
    #[test]
    fn a_gap_between_two_levels_is_no_missing_code() {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let mut counts = ValueCounts::default();
        for at in 0..200_000 {
            let level = f64::from((at / 100 % 2) * 4);
            counts.push((level + 0.3 * random.sample::<f64, _>(StandardNormal)).round() as i32);
        }
        assert_eq!(counts.missing_codes(0.05, "deg/s"), None);
    }
}
