//! Common-mode drift: the part of each channel that the others explain, and the hold-out gain of subtracting it.
//!
//! Each channel is regressed on all others by the Allan covariances of the first half at one octave; the weights hold for the second half.

use crate::parallel::in_parallel;
use crate::record::estimators::CoupledEstimators;
use crate::{OCTAVES, OVERLAP};
use allan_core::PowerLaw;
use measurement::{ChannelId, MeasuredChannel, Measurement};
use nalgebra::{DMatrix, DVector};
use serde::Serialize;
use std::ops::Range;

/// Least degrees of freedom of an octave per weight estimated from it.
const DEGREES_OF_FREEDOM_PER_WEIGHT: f64 = 10.0;

/// The share of the common mode at one averaging time of the first half.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OctaveShares {
    pub tau_s: f64,
    /// Degrees of freedom of the variance of flicker noise.
    pub edf: f64,
    /// By channel: the part of its variance that the others explain, adjusted for the number of weights (adjusted R²).
    pub share: Vec<f64>,
}

/// The gain of subtracting the common mode at one averaging time of the second half.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HoldOutGain {
    pub tau_s: f64,
    /// By channel: Allan deviation after over before; above 1 the channel is worse after it.
    pub ratio: Vec<f64>,
}

/// The regression of each channel on the others.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CommonModeRegression {
    /// Names, in the order of all lists by channel.
    pub channels: Vec<String>,
    /// Averaging time at which the weights were estimated, s: the longest one with enough degrees of freedom.
    pub weights_tau_s: f64,
    /// By channel: true if weights of the first quarter reduce the second quarter's variance at `weights_tau_s`; else they are not used.
    pub trusted: Vec<bool>,
    /// Octave by octave, in the first half.
    pub shares: Vec<OctaveShares>,
    /// Octave by octave up to an eighth of the half, in the second half.
    pub gains: Vec<HoldOutGain>,
}

impl CommonModeRegression {
    /// The regression of `channels`; `None` for fewer than two, or too few samples.
    #[must_use]
    pub fn estimate(measurement: &Measurement, channels: &[ChannelId]) -> Option<Self> {
        let others = channels.len().checked_sub(1).filter(|&others| others > 0)?;
        let period = measurement.period_s();
        let [first, second, unseen] = quarters_and_second_half(measurement, channels);
        let fitted = first.clone().followed_by(&second);
        let longest = fitted.cascade(0).cascade().len() / 8;
        let covariances = |part: &CoupledEstimators, n: u64| part.covariances(n.ilog2() as usize);
        let edf = |n: u64| {
            let (_, count) = fitted.cascade(0).cascade().sum_of_squares(n.ilog2() as usize).unwrap_or_default();
            allan_core::confidence::edf(
                n,
                count,
                (OVERLAP as u64).min(n) as u32,
                PowerLaw::Flicker.variance_fractions(),
            )
        };
        let octaves = || (0..OCTAVES).map(|octave| 1_u64 << octave).take_while(|&n| n <= longest);
        let weights_at = octaves().filter(|&n| edf(n) >= DEGREES_OF_FREEDOM_PER_WEIGHT * others as f64).last()?;
        let at_weights = covariances(&fitted, weights_at)?;
        let early = covariances(&first, weights_at)?;
        let late = covariances(&second, weights_at)?;
        let by_channel = || 0..channels.len();
        let shares = octaves().filter_map(|n| {
            let covariances = covariances(&fitted, n)?;
            let edf = edf(n);
            let adjustment = (edf - 1.0) / (edf - 1.0 - others as f64);
            let share = by_channel().map(|of| {
                let left = remaining_variance(&covariances, of, &weights(&covariances, of)?)?;
                Some((1.0 - left * adjustment).max(0.0))
            });
            (edf > 2.0 + others as f64).then_some(())?;
            Some(OctaveShares { tau_s: n as f64 * period, edf, share: share.collect::<Option<_>>()? })
        });
        let gains = octaves().filter_map(|n| {
            let covariances = covariances(&unseen, n)?;
            let ratio =
                by_channel().map(|of| Some(remaining_variance(&covariances, of, &weights(&at_weights, of)?)?.sqrt()));
            Some(HoldOutGain { tau_s: n as f64 * period, ratio: ratio.collect::<Option<_>>()? })
        });
        let trusted = by_channel().map(|of| Some(remaining_variance(&late, of, &weights(&early, of)?)? < 1.0));
        Some(Self {
            channels: channels.iter().map(|&channel| measurement[channel].profile.name.to_owned()).collect(),
            weights_tau_s: weights_at as f64 * period,
            trusted: trusted.collect::<Option<_>>()?,
            shares: shares.collect(),
            gains: gains.collect(),
        })
    }
}

fn quarters_and_second_half(measurement: &Measurement, channels: &[ChannelId]) -> [CoupledEstimators; 3] {
    let recorded: Vec<&MeasuredChannel> = channels.iter().map(|&channel| &measurement[channel]).collect();
    let positions_of_all: Vec<usize> = (0..channels.len()).collect();
    let quarter = |number: usize| (number * measurement.len()).div_ceil(4);
    let part = |positions: &Range<usize>| {
        let mut part = CoupledEstimators::new(channels.len(), &positions_of_all);
        for position in positions.clone() {
            part.gap(measurement.missing_before(position));
            part.push(recorded.iter().map(|of| (!of.is_refused(position)).then(|| of.counts[position])));
        }
        part
    };
    // The longest one first: the others are computed beside it.
    let parts = [quarter(2)..measurement.len(), 0..quarter(1), quarter(1)..quarter(2)];
    let mut parts = in_parallel(&parts, part).into_iter();
    let [second_half, first, second] =
        std::array::from_fn(|_| parts.next().unwrap_or_else(|| CoupledEstimators::new(0, &[])));
    [first, second, second_half]
}

/// Weight of every channel in the prediction of channel `of` (0 for itself); `None` if the covariances are singular.
fn weights(covariances: &DMatrix<f64>, of: usize) -> Option<DVector<f64>> {
    let others = covariances.clone().remove_row(of).remove_column(of);
    let with_others = covariances.column(of).into_owned().remove_row(of);
    Some(others.cholesky()?.solve(&with_others).insert_row(of, 0.0))
}

/// Part of the variance of channel `of` that its prediction leaves; `None` without variance.
fn remaining_variance(covariances: &DMatrix<f64>, of: usize, weights: &DVector<f64>) -> Option<f64> {
    let mut combination = -weights;
    combination[of] = 1.0;
    let left = (combination.transpose() * covariances * &combination)[0] / covariances[(of, of)];
    left.is_finite().then_some(left.max(0.0))
}

#[cfg(test)]
mod tests {
    use super::CommonModeRegression;
    use measurement::{MeasuredChannel, Measurement, adis16405};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};
    use std::collections::BTreeMap;

    fn measurement(columns: Vec<(&str, Vec<i32>)>) -> Measurement {
        let profile = adis16405::profile(0.05);
        let samples = columns[0].1.len() as u64;
        let channel = |(name, counts)| MeasuredChannel::new(profile.channel(name).expect("a channel"), counts);
        Measurement {
            sample_rate_hz: 100.0,
            stated_rate_hz: Some(100.0),
            slots: (0..samples).collect(),
            times_s: None,
            channels: columns.into_iter().map(channel).collect(),
            dropped: BTreeMap::new(),
            flagged: BTreeMap::new(),
            profile,
        }
    }

    #[test]
    fn a_common_walk_is_explained_by_its_share_of_the_variance_and_removed() {
        /// White noise of every channel, and step of the walk, counts.
        const WHITE: f64 = 20.0;
        const STEP: f64 = 1.0;
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let mut walk = 0.0;
        let mut columns = [("gyro_x", vec![]), ("accl_x", vec![]), ("accl_y", vec![])];
        for _ in 0..1 << 16 {
            let [step, a, b, c]: [f64; 4] = [(); 4].map(|()| StandardNormal.sample(&mut random));
            walk += STEP * step;
            let values = [WHITE * a, WHITE * b + walk, WHITE * c + walk];
            columns.iter_mut().zip(values).for_each(|((_, counts), value)| counts.push(value.round() as i32));
        }
        let measurement = measurement(columns.to_vec());
        let found = CommonModeRegression::estimate(&measurement, &measurement.ids().collect::<Vec<_>>())
            .expect("three channels");
        // Allan variances of a sampled random walk and of white noise.
        let (walk, white) = (|n: f64| STEP * STEP * (2.0 * n * n + 1.0) / (6.0 * n), |n: f64| WHITE * WHITE / n);
        for octave in found.shares.iter().filter(|octave| octave.edf > 100.0) {
            let n = octave.tau_s / measurement.period_s();
            let part = walk(n) / (walk(n) + white(n));
            // R² of two channels that share this part of their variance is its square; its deviation is below 2/√edf.
            for share in &octave.share[1..] {
                assert!((share - part * part).abs() < 6.0 / octave.edf.sqrt(), "n {n}: {share} for {}", part * part);
            }
            assert!(octave.share[0] < 6.0 / octave.edf.sqrt(), "n {n}: {}", octave.share[0]);
        }
        assert_eq!(found.trusted[1..], [true, true]);
        let at_weights = found
            .gains
            .iter()
            .find(|octave| octave.tau_s == found.weights_tau_s)
            .expect("the octave at which the weights were estimated");
        assert!(at_weights.ratio[1] < 0.5 && at_weights.ratio[2] < 0.5, "{at_weights:?}");
        // At short averaging times the other channel adds its white noise.
        assert!((found.gains[0].ratio[1] - 2f64.sqrt()).abs() < 0.1, "{:?}", found.gains[0]);
    }

    #[test]
    fn a_single_channel_has_no_common_mode() {
        let measurement = measurement(vec![("gyro_x", (0..100).map(|at| at % 7).collect())]);
        assert_eq!(CommonModeRegression::estimate(&measurement, &measurement.ids().collect::<Vec<_>>()), None);
    }
}
