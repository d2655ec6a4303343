//! The slow part that channels share: how much of each the others foretell, and what it buys on data not seen.
//!
//! In the second differences of an octave a channel is regressed on all others, by the covariances alone. The weights are
//! learnt in the fitted half at one octave and applied to the unseen half at all.

use crate::{OCTAVES, OVERLAP};
use allan_core::{Cascade, Coupling, PowerLaw};
use measurement::{ChannelProfile, Measurement};
use nalgebra::{DMatrix, DVector};

/// Degrees of freedom that the octave of the weights has for each of them.
const FREEDOM_PER_WEIGHT: f64 = 10.0;

/// Channels that take their samples in step, and what every pair has in common.
#[derive(Clone)]
struct Together {
    cascades: Vec<Cascade<OCTAVES, OVERLAP>>,
    /// ChannelProfile `i` with `j < i` at `i·(i−1)/2 + j`.
    couplings: Vec<Coupling<OCTAVES>>,
}

/// What the channels share at one averaging time of the fitted half.
#[derive(Debug, Clone, PartialEq)]
pub struct Shared {
    /// Averaging factor, samples.
    pub n: u64,
    /// Averaging time, s.
    pub tau: f64,
    /// Degrees of freedom of a variance of flicker noise.
    pub edf: f64,
    /// By channel: what part of its variance the others foretell, less what chance would (R², adjusted).
    pub share: Vec<f64>,
}

/// What compensation buys at one averaging time of the unseen half.
#[derive(Debug, Clone, PartialEq)]
pub struct Bought {
    /// Averaging factor, samples.
    pub n: u64,
    /// Averaging time, s.
    pub tau: f64,
    /// By channel: Allan deviation after over before. Above 1 it does harm.
    pub ratio: Vec<f64>,
}

/// The slow part of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct SlowPart {
    /// In the order of all lists by channel.
    pub channels: Vec<ChannelProfile>,
    /// Averaging factor at which the weights were learnt, samples.
    pub learnt_at: u64,
    /// By channel, whether weights learnt in the first quarter made the second quarter better at `learnt_at`: what the
    /// fitted half alone says of whether to use them.
    pub trusted: Vec<bool>,
    /// Octave by octave, in the fitted half.
    pub shared: Vec<Shared>,
    /// Octave by octave up to an eighth of the half, in the unseen half.
    pub bought: Vec<Bought>,
}

impl SlowPart {
    /// Of `channels` of a recording; `None` where there are fewer than two, or too few samples for an octave to regress at.
    #[must_use]
    pub fn of(measurement: &Measurement, channels: &[ChannelProfile]) -> Option<Self> {
        let others = channels.len().checked_sub(1).filter(|&others| others > 0)?;
        let period = measurement.period_s();
        let [first, second, unseen] = parts(measurement, channels);
        let fitted = first.clone().followed_by(&second);
        let longest = fitted.cascades.first()?.len() / 8;
        let matrices = |part: &Together, n: u64| part.covariances(n.ilog2() as usize);
        let edf = |n: u64| {
            let cascade = &fitted.cascades[0];
            let (_, count) = cascade.sum_of_squares(n.ilog2() as usize).unwrap_or_default();
            allan_core::confidence::edf(
                n,
                count,
                (OVERLAP as u64).min(n) as u32,
                PowerLaw::Flicker.variance_fractions(),
            )
        };
        let octaves = || (0..OCTAVES).map(|octave| 1_u64 << octave).take_while(|&n| n <= longest);
        let learnt_at = octaves().filter(|&n| edf(n) >= FREEDOM_PER_WEIGHT * others as f64).last()?;
        let learnt = matrices(&fitted, learnt_at)?;
        let early = matrices(&first, learnt_at)?;
        let late = matrices(&second, learnt_at)?;
        let by_channel = || 0..channels.len();
        let shared = octaves().filter_map(|n| {
            let covariances = matrices(&fitted, n)?;
            let edf = edf(n);
            let freedom = (edf - 1.0) / (edf - 1.0 - others as f64);
            let share = by_channel().map(|of| {
                let left = remaining(&covariances, of, &weights(&covariances, of)?)?;
                Some((1.0 - left * freedom).max(0.0))
            });
            (edf > 2.0 + others as f64).then_some(())?;
            Some(Shared { n, tau: n as f64 * period, edf, share: share.collect::<Option<_>>()? })
        });
        let bought = octaves().filter_map(|n| {
            let covariances = matrices(&unseen, n)?;
            let ratio = by_channel().map(|of| Some(remaining(&covariances, of, &weights(&learnt, of)?)?.sqrt()));
            Some(Bought { n, tau: n as f64 * period, ratio: ratio.collect::<Option<_>>()? })
        });
        let trusted = by_channel().map(|of| Some(remaining(&late, of, &weights(&early, of)?)? < 1.0));
        Some(Self {
            channels: channels.to_vec(),
            learnt_at,
            trusted: trusted.collect::<Option<_>>()?,
            shared: shared.collect(),
            bought: bought.collect(),
        })
    }
}

/// The quarters of the fitted half, and the unseen half.
fn parts(measurement: &Measurement, channels: &[ChannelProfile]) -> [Together; 3] {
    let counts: Vec<&[i32]> =
        channels.iter().filter_map(|channel| Some(measurement.channel(channel)?.counts.as_slice())).collect();
    let mut parts = [(); 3].map(|()| Together::new(channels.len()));
    for position in 0..measurement.len() {
        let part = &mut parts[(4 * position / measurement.len()).min(2)];
        let missing = measurement.missing_before(position);
        if missing > 0 {
            part.cascades.iter_mut().for_each(|cascade| cascade.gap(missing));
        }
        part.push(counts.iter().map(|counts| counts[position]));
    }
    parts
}

impl Together {
    fn new(channels: usize) -> Self {
        Self {
            cascades: vec![Cascade::new(); channels],
            couplings: vec![Coupling::new(); channels * (channels - 1) / 2],
        }
    }

    fn push(&mut self, counts: impl Iterator<Item = i32>) {
        self.cascades.iter_mut().zip(counts).for_each(|(cascade, count)| cascade.push(count));
        let mut couplings = self.couplings.iter_mut();
        for (at, a) in self.cascades.iter().enumerate() {
            for (b, coupling) in self.cascades[..at].iter().zip(&mut couplings) {
                coupling.observe(a, b);
            }
        }
    }

    fn followed_by(mut self, later: &Self) -> Self {
        self.cascades.iter_mut().zip(&later.cascades).for_each(|(cascade, later)| cascade.merge(later));
        self.couplings.iter_mut().zip(&later.couplings).for_each(|(coupling, later)| coupling.merge(later));
        self
    }

    /// Covariances of the second differences, but for a factor that is common to all; `None` if there are none.
    fn covariances(&self, octave: usize) -> Option<DMatrix<f64>> {
        let mut covariances = DMatrix::zeros(self.cascades.len(), self.cascades.len());
        let mut couplings = self.couplings.iter();
        for (i, cascade) in self.cascades.iter().enumerate() {
            let (squares, count) = cascade.sum_of_squares(octave).filter(|&(_, count)| count > 0)?;
            covariances[(i, i)] = squares as f64 / count as f64;
            for (j, coupling) in (0..i).zip(&mut couplings) {
                let (products, count) = coupling.sum_of_products(octave).filter(|&(_, count)| count > 0)?;
                covariances[(i, j)] = products as f64 / count as f64;
                covariances[(j, i)] = covariances[(i, j)];
            }
        }
        Some(covariances)
    }
}

/// What to take of every channel to foretell channel `of`, 0 of itself; `None` where the others do not differ.
fn weights(covariances: &DMatrix<f64>, of: usize) -> Option<DVector<f64>> {
    let others = covariances.clone().remove_row(of).remove_column(of);
    let with_others = covariances.column(of).into_owned().remove_row(of);
    Some(others.cholesky()?.solve(&with_others).insert_row(of, 0.0))
}

/// What part of the variance of channel `of` is left when the others' share is taken away; `None` if it has none.
fn remaining(covariances: &DMatrix<f64>, of: usize, weights: &DVector<f64>) -> Option<f64> {
    let mut combination = -weights;
    combination[of] = 1.0;
    let left = (combination.transpose() * covariances * &combination)[0] / covariances[(of, of)];
    left.is_finite().then_some(left.max(0.0))
}

#[cfg(test)]
mod tests {
    use super::SlowPart;
    use measurement::{ChannelProfile, MeasuredChannel, Measurement, adis16405};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};
    use std::collections::BTreeMap;

    /// `columns` of counts at 100 Hz without a gap.
    fn measurement(columns: Vec<(&str, Vec<i32>)>) -> Measurement {
        let profile = adis16405::profile(0.05);
        let samples = columns[0].1.len() as u64;
        let channel = |(name, counts)| MeasuredChannel { profile: profile.channel(name).expect("a channel"), counts };
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

    fn profiles(measurement: &Measurement) -> Vec<ChannelProfile> {
        measurement.profiles().collect()
    }

    #[test]
    fn a_common_walk_is_shared_as_much_as_its_variance_says_and_taken_away() {
        /// White noise of every channel and step of the walk, counts.
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
        let found = SlowPart::of(&measurement, &profiles(&measurement)).expect("three channels");
        // Of a sampled walk, and of white noise.
        let (walk, white) = (|n: f64| STEP * STEP * (2.0 * n * n + 1.0) / (6.0 * n), |n: f64| WHITE * WHITE / n);
        for octave in found.shared.iter().filter(|octave| octave.edf > 100.0) {
            let n = octave.n as f64;
            let part = walk(n) / (walk(n) + white(n));
            // R² of two channels that share this part of their variance is its square; its deviation is below 2/√edf.
            for share in &octave.share[1..] {
                assert!((share - part * part).abs() < 6.0 / octave.edf.sqrt(), "n {n}: {share} for {}", part * part);
            }
            assert!(octave.share[0] < 6.0 / octave.edf.sqrt(), "n {n}: {}", octave.share[0]);
        }
        assert_eq!(found.trusted[1..], [true, true]);
        let learnt = found.bought.iter().find(|octave| octave.n == found.learnt_at).expect("the octave of the weights");
        assert!(learnt.ratio[1] < 0.5 && learnt.ratio[2] < 0.5, "{learnt:?}");
        // Where white noise rules, the weights do harm: that of the other channel is added to the channel's own.
        assert!((found.bought[0].ratio[1] - 2f64.sqrt()).abs() < 0.1, "{:?}", found.bought[0]);
    }

    #[test]
    fn one_channel_shares_nothing() {
        let measurement = measurement(vec![("gyro_x", (0..100).map(|at| at % 7).collect())]);
        assert_eq!(SlowPart::of(&measurement, &profiles(&measurement)), None);
    }
}
