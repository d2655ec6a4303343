//! A finished epoch: sums, regression on covariates, compensated curves.
//!
//! The compensated stream `y − Σ βᵢ·(cᵢ − rᵢ)` uses the epoch before; `σ²(y − βc) = σ²(y) − 2β·cov(y, c) + β²·σ²(c)`
//! needs no second estimator.

use crate::sample_intake::Estimators;
use crate::scale::ReportScale;
use crate::statistics::{
    AllanCovariances, CHANNELS, CROSS_OCTAVES, ChannelMeans, ChannelSums, FIRST_CROSS_OCTAVE, GYROS, OCTAVES,
};
use adis16405_driver::{Channel, Config};
use allan_core::confidence::NORMAL_975;
use allan_core::regression::{Covariate, CovariateRegression, Sensitivity};
use allan_core::{AllanPoint, Curve};
use heapless::Vec;
use link::{MAX_COVARIATES, ReportedShift};
use serde::{Deserialize, Serialize};

/// The statistics of a finished epoch.
#[derive(Debug, Clone, PartialEq)]
pub struct FinishedEpoch {
    /// Epochs finished before it.
    pub number: u32,
    /// Measured sample rate in Hz; `None` if too few samples have come.
    pub measured_hz: Option<f64>,
    pub(crate) sums: [ChannelSums; CHANNELS.len()],
    pub(crate) covariances: AllanCovariances,
}

impl FinishedEpoch {
    /// An epoch of no samples.
    pub const EMPTY: Self = Self {
        number: 0,
        measured_hz: None,
        sums: [const { ChannelSums::EMPTY }; CHANNELS.len()],
        covariances: AllanCovariances::EMPTY,
    };

    /// Ends the running epoch of `estimators` and overwrites this value with its statistics.
    pub fn fill(&mut self, estimators: &mut Estimators<'_>) {
        self.measured_hz = estimators.measured_hz();
        estimators.end_epoch(|statistics| {
            for (sums, estimator) in self.sums.iter_mut().zip(&statistics.estimators) {
                *sums = ChannelSums::from_estimator(estimator);
            }
            self.covariances.fill(&statistics.cross_sums);
        });
    }

    /// The scale of the samples, which were taken with this configuration.
    pub fn scale(&self, config: Config) -> ReportScale {
        ReportScale::new(config, self.measured_hz)
    }

    /// The sums of [`CHANNELS`]`[index]`; `None` if there is no such channel.
    pub fn sums(&self, index: usize) -> Option<&ChannelSums> {
        self.sums.get(index)
    }

    /// The Allan covariances; `None` if samples are missing in them, as after a restart.
    pub fn covariances(&self) -> Option<&AllanCovariances> {
        self.covariances.complete.then_some(&self.covariances)
    }
}

/// A covariate with a significant sensitivity.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Regressor {
    /// Index of the covariate in [`CHANNELS`].
    pub covariate: usize,
    /// Sensitivity in the channel's unit over the covariate's.
    pub value: f64,
    /// Standard error of the sensitivity: value ± 1.96·error holds 95 %.
    pub error: f64,
    /// Value of the covariate at which the correction is 0, in its unit: the mean of the learned epoch.
    pub reference: f64,
}

impl Regressor {
    /// The 95 % bounds of the sensitivity.
    pub(crate) fn bounds(&self) -> (f64, f64) {
        let half_width = NORMAL_975 * self.error;
        (self.value - half_width, self.value + half_width)
    }
}

/// The regressors of one channel.
pub type Regressors = Vec<Regressor, MAX_COVARIATES>;

type Candidates = Vec<usize, MAX_COVARIATES>;

/// A channel of a finished epoch.
#[derive(Debug, Clone, Copy)]
pub struct EpochChannel<'e> {
    /// The epoch.
    pub epoch: &'e FinishedEpoch,
    /// Index of the channel in [`CHANNELS`].
    pub index: usize,
    /// The [scale](FinishedEpoch::scale) of the epoch.
    pub scale: ReportScale,
}

impl EpochChannel<'_> {
    fn other(self, index: usize) -> Self {
        Self { index, ..self }
    }

    fn lsb(self) -> f64 {
        self.scale.lsb(CHANNELS[self.index])
    }

    /// The Allan variance curve in the channel's unit.
    pub(crate) fn curve(self) -> Curve<OCTAVES> {
        self.epoch.sums[self.index].curve(CHANNELS[self.index], self.scale)
    }

    /// Allan covariance with another channel, in the product of both units.
    fn covariance(self, other: usize, n: u64) -> Option<f64> {
        let covariance = self.epoch.covariances()?.covariance(self.index, other, n)?;
        Some(covariance * self.lsb() * self.other(other).lsb())
    }

    /// The covariance of the channel, or of a candidate, with a candidate.
    fn covariance_of(self, candidates: &[usize], with: Option<usize>, covariate: usize, n: u64) -> Option<f64> {
        self.other(with.map_or(self.index, |other| candidates[other])).covariance(candidates[covariate], n)
    }

    /// A covariate at the octaves of the cross sums. Its own noise is modelled for an estimate, or taken as measured
    /// for a subtraction.
    fn covariate(self, index: usize, modelled: bool) -> Covariate<CROSS_OCTAVES> {
        let covariate = self.other(index);
        if modelled {
            Covariate::new(&covariate.curve(), covariate.lsb(), 1 << FIRST_CROSS_OCTAVE)
        } else {
            Covariate::as_measured(&covariate.curve(), 1 << FIRST_CROSS_OCTAVE)
        }
    }

    /// Estimates significant sensitivities; there are none without [covariances](FinishedEpoch::covariances). `None` if `keep_on`, which is
    /// called before every fit, returned false.
    #[must_use]
    pub fn estimate_regressors(self, keep_on: &mut dyn FnMut() -> bool) -> Option<Regressors> {
        let Some(AllanCovariances { means, .. }) = self.epoch.covariances() else { return Some(Regressors::new()) };
        let mut candidates: Candidates = candidates(self.index).collect();
        let channel = self.curve();
        let mut covariates: Vec<Covariate<CROSS_OCTAVES>, MAX_COVARIATES> = Vec::new();
        for &candidate in &candidates {
            if !keep_on() {
                return None;
            }
            // The list has room for all candidates.
            let _ = covariates.push(self.covariate(candidate, true));
        }
        let sensitivities = loop {
            let covariance = |with, covariate, n| self.covariance_of(&candidates, with, covariate, n);
            let regression =
                CovariateRegression { channel: &channel, covariates: &covariates, covariance: &covariance };
            let sensitivities = regression.sensitivities_while(keep_on)?;
            let degrades = || self.degrades(&candidates, &sensitivities, &regression);
            // Sensitivities are sorted by falling significance: the last is the weakest.
            let Some(weakest) = sensitivities.last().filter(|_| degrades()) else { break sensitivities };
            candidates.remove(weakest.covariate);
            covariates.remove(weakest.covariate);
        };
        let with_reference = |sensitivity: &Sensitivity| {
            let covariate = candidates[sensitivity.covariate];
            let reference = means[covariate] * self.other(covariate).lsb() + CHANNELS[covariate].offset();
            Regressor { covariate, value: sensitivity.value, error: sensitivity.error, reference }
        };
        Some(sensitivities.iter().map(with_reference).take(MAX_COVARIATES).collect())
    }

    /// Compensates the channel's `curve` from 2⁸ samples on; `None`, and no change, without
    /// [covariances](FinishedEpoch::covariances).
    pub(crate) fn compensate(self, curve: &mut Curve<OCTAVES>, regressors: &[Regressor]) -> Option<()> {
        if regressors.is_empty() {
            return Some(());
        }
        self.epoch.covariances()?;
        let candidates: Candidates = regressors.iter().map(|regressor| regressor.covariate).collect();
        let mut covariates: Vec<Covariate<CROSS_OCTAVES>, MAX_COVARIATES> = Vec::new();
        for &candidate in &candidates {
            let _ = covariates.push(self.covariate(candidate, false));
        }
        let exact = |(covariate, regressor): (usize, &Regressor)| Sensitivity::exact(covariate, regressor.value);
        let sensitivities: Vec<Sensitivity, MAX_COVARIATES> = regressors.iter().enumerate().map(exact).collect();
        let covariance = |with, covariate, n| self.covariance_of(&candidates, with, covariate, n);
        let (channel, covariance) = (&curve.clone(), &covariance);
        CovariateRegression { channel, covariates: &covariates, covariance }.subtract_from(curve, &sensitivities);
        Some(())
    }

    /// Change of the means of the stream and of the compensated stream since the means `before` (counts), in the
    /// channel's unit.
    pub(crate) fn mean_shift(self, regressors: &[Regressor], before: &ChannelMeans) -> Option<ReportedShift> {
        let means = &self.epoch.covariances()?.means;
        let change = |index: usize| (means[index] - before[index]) * self.other(index).lsb();
        let raw = change(self.index);
        let correction = regressors.iter().map(|regressor| regressor.value * change(regressor.covariate)).sum::<f64>();
        Some(ReportedShift { raw, compensated: raw - correction })
    }

    /// True if the subtraction raises the Allan variance of any octave by more than twice the standard error of the
    /// rise. For `s = Σ βᵢ·cᵢ` and `u = y − s/2` the rise is `−2·cov(u, s)`, with the variance `4·σ²(u)·σ²(s)/edf`.
    fn degrades(
        self,
        candidates: &Candidates,
        sensitivities: &[Sensitivity],
        regression: &CovariateRegression<'_, OCTAVES, CROSS_OCTAVES>,
    ) -> bool {
        let mut added = [0.0; OCTAVES];
        for sensitivity in sensitivities {
            let covariate = self.other(candidates[sensitivity.covariate]).curve();
            for (added, point) in added.iter_mut().zip(covariate.points()).take(FIRST_CROSS_OCTAVE) {
                *added += sensitivity.value * sensitivity.value * point.avar;
            }
        }
        let of_covariates = |with: Option<usize>, covariate: usize, n: u64| match with {
            Some(_) => (regression.covariance)(with, covariate, n),
            None => Some(0.0),
        };
        let share = CovariateRegression { covariance: &of_covariates, ..*regression };
        let worse = |(raw, added): (&AllanPoint, f64)| {
            let mut without = *raw;
            without.avar = 0.0;
            let (Some(subtracted), Some(share)) =
                (regression.subtracted_at(raw, sensitivities), share.subtracted_at(&without, sensitivities))
            else {
                return added > raw.avar * 2.0 * libm::sqrt(2.0 / raw.edf);
            };
            let halfway = ((raw.avar + subtracted) / 2.0 - share / 4.0).max(0.0);
            subtracted - raw.avar > 2.0 * 2.0 * libm::sqrt(halfway * share / raw.edf)
        };
        regression.channel.points().iter().zip(added).any(worse)
    }
}

/// The candidate covariates: temperature and supply, and for a gyro the accelerations.
fn candidates(index: usize) -> impl Iterator<Item = usize> {
    let position = |channel: Channel| CHANNELS.iter().position(move |&other| other == channel);
    let environment = [Channel::Temp, Channel::Supply].into_iter();
    let motion = [Channel::AcclX, Channel::AcclY, Channel::AcclZ].into_iter().filter(move |_| index < GYROS);
    environment.chain(motion).filter_map(position)
}
