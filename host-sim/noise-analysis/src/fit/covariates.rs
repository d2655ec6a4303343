//! Regression of a channel on its covariates: temperature, supply, and for a gyroscope the specific force.

use crate::OCTAVES;
use crate::detectors::bias::BiasSensitivity;
use crate::detectors::thermal_response::smoothed;
use crate::record::estimators::RecordPart;
use crate::samples::rounding::Rounding;
use crate::samples::series::Series;
use allan_core::Curve;
use allan_core::regression::{CovarianceCurve, Covariate, CovariateRegression, Sensitivity};
use measurement::{ChannelId, PerChannel, Quantity};

/// The curves of a channel and of its covariates in one part of a recording, and their covariances.
struct RegressionData {
    /// Without correlated rounding errors.
    channel: Curve<OCTAVES>,
    rounding: Rounding,
    channels: Vec<ChannelId>,
    covariates: Vec<Covariate<OCTAVES>>,
    with_channel: Vec<CovarianceCurve<OCTAVES>>,
    /// Covariance of covariate `i` with covariate `j < i`, at index `i·(i−1)/2 + j`.
    mutual: Vec<CovarianceCurve<OCTAVES>>,
}

/// The sensitivities of a channel to its covariates, estimated in one part of a recording.
pub(crate) struct CovariateFit {
    data: RegressionData,
    /// `covariate` of each counts as in [`RegressionData`].
    sensitivities: Vec<Sensitivity>,
    /// Time constant, s, over which the samples of each covariate are smoothed; 0 as measured.
    smoothed_over_s: Vec<f64>,
    /// The channel's curve less the share of the covariates, and less correlated rounding errors.
    pub curve: Curve<OCTAVES>,
}

impl RegressionData {
    /// With `known`, the measurement noise of the covariates is taken from there instead of being estimated.
    fn new(part: &RecordPart, channel: ChannelId, known: Option<&Self>) -> Self {
        let channels: Vec<ChannelId> = regressors(channel, part).collect();
        let covariate = |(index, &of): (usize, &ChannelId)| match known {
            Some(known) => known.covariates[index].continued(&part.curve(of), part.coupled_from()),
            None => Covariate::new(&part.curve(of), part.resolution(of), part.coupled_from()),
        };
        let pairs = channels.iter().enumerate().flat_map(|(i, &a)| channels[..i].iter().map(move |&b| (a, b)));
        let rounding = part.rounding(channel);
        Self {
            channel: rounding.subtracted_from(part.curve(channel)),
            rounding,
            covariates: channels.iter().enumerate().map(covariate).collect(),
            with_channel: channels.iter().map(|&of| part.covariance(channel, of)).collect(),
            mutual: pairs.map(|(a, b)| part.covariance(a, b)).collect(),
            channels,
        }
    }

    fn regress<T>(&self, work: impl FnOnce(&CovariateRegression<OCTAVES>) -> T) -> T {
        let covariance = |with: Option<usize>, covariate: usize, n: u64| {
            let curve = match with {
                None => &self.with_channel[covariate],
                Some(other) => {
                    let (high, low) = (covariate.max(other), covariate.min(other));
                    &self.mutual[high * (high - 1) / 2 + low]
                }
            };
            curve.iter().find(|point| point.n == n).map(|point| point.covariance)
        };
        work(&CovariateRegression { channel: &self.channel, covariates: &self.covariates, covariance: &covariance })
    }
}

impl CovariateFit {
    /// Estimates the sensitivities of `channel` from second differences in `part`, or takes those of `by_samples` with a smaller error.
    ///
    /// With a ramp (`has_ramp`) the sensitivities to temperature and supply come from the samples alone: the second
    /// differences of a ramp correlate with those of anything else that drifts.
    pub(crate) fn estimate(
        part: &RecordPart,
        channel: ChannelId,
        has_ramp: bool,
        by_samples: impl Fn(ChannelId) -> Option<BiasSensitivity>,
    ) -> Self {
        let data = RegressionData::new(part, channel, None);
        let mut sensitivities: Vec<Sensitivity> =
            data.regress(|regression| regression.sensitivities()).into_iter().collect();
        let mut smoothed_over_s = vec![0.0; data.channels.len()];
        for (covariate, &regressor) in data.channels.iter().enumerate() {
            let Some(BiasSensitivity { sensitivity: value, error, degrees_of_freedom, smoothed_over_s: smoothed }) =
                by_samples(regressor)
            else {
                let is_dropped = has_ramp && part.channels[regressor].quantity.is_environment();
                sensitivities.retain(|known| known.covariate != covariate || !is_dropped);
                continue;
            };
            smoothed_over_s[covariate] = smoothed;
            let sensitivity = Sensitivity { covariate, value, error, degrees_of_freedom };
            match sensitivities.iter_mut().find(|known| known.covariate == covariate) {
                Some(known) if known.error <= error => {}
                Some(known) => *known = sensitivity,
                None => sensitivities.push(sensitivity),
            }
        }
        let curve = data.regress(|regression| regression.compensated(&sensitivities));
        Self { data, sensitivities, smoothed_over_s, curve }
    }

    pub(crate) fn rounding(&self) -> &Rounding {
        &self.data.rounding
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.sensitivities.is_empty()
    }

    /// The curve of the same channel in another part, compensated with the sensitivities of this one.
    pub(crate) fn compensated(&self, part: &RecordPart, channel: ChannelId) -> Curve<OCTAVES> {
        RegressionData::new(part, channel, Some(&self.data))
            .regress(|regression| regression.compensated(&self.sensitivities))
    }

    /// The part of the channel's Allan variance that the covariates add at each of the ascending `factors`, by the covariances in `part`.
    ///
    /// Longer averaging times than those at which the covariances are known, as of a record in two halves, have the last
    /// share that is known, times the ratio of what the covariates themselves vary at the two times. For that, `avar` is the
    /// Allan variance of a covariate at an averaging factor in the whole record.
    pub(crate) fn shares(
        &self,
        part: &RecordPart,
        channel: ChannelId,
        factors: impl Iterator<Item = u64>,
        avar: impl Fn(ChannelId, u64) -> Option<f64>,
    ) -> Vec<f64> {
        let data = RegressionData::new(part, channel, Some(&self.data));
        let rest = data.regress(|regression| regression.compensated(&self.sensitivities));
        let at = |curve: &Curve<OCTAVES>, n: u64| curve.points().iter().find(|of| of.n == n).map(|of| of.avar);
        let is_coupled = |n: u64| {
            let of = |known: &Sensitivity| data.with_channel[known.covariate].iter().any(|point| point.n == n);
            self.sensitivities.iter().all(of)
        };
        let variation = |n: u64| -> Option<f64> {
            let of =
                |(covariate, known): (ChannelId, &Sensitivity)| Some(known.value * known.value * avar(covariate, n)?);
            self.sensitivities().map(of).sum()
        };
        let mut last: Option<(f64, f64)> = None;
        let share = |n: u64| {
            if let Some((raw, rest)) = at(&data.channel, n).zip(at(&rest, n)).filter(|_| is_coupled(n)) {
                let share = (raw - rest).max(0.0);
                last = variation(n).filter(|varied| *varied > 0.0).map(|varied| (share, varied));
                return share;
            }
            last.zip(variation(n)).map_or(0.0, |((share, before), now)| share * now / before)
        };
        factors.map(share).collect()
    }

    pub(crate) fn sensitivities(&self) -> impl Iterator<Item = (ChannelId, &Sensitivity)> {
        self.sensitivities.iter().map(|sensitivity| (self.data.channels[sensitivity.covariate], sensitivity))
    }

    /// `series` less the covariates times their sensitivities; `of_part` are the series of the same part's channels.
    ///
    /// The noise of covariates that are not smoothed is added by this. Samples that a covariate lacks are missing in the result.
    /// No sample before the sample period `middle` depends on a later one. `None` where the channel depends on no covariate.
    pub(crate) fn compensated_series(
        &self,
        series: &Series,
        of_part: &PerChannel<Series>,
        middle: u64,
    ) -> Option<Series> {
        let mut rest = series.clone();
        for (covariate, sensitivity) in self.sensitivities() {
            let (measured, over_s) = (&of_part[covariate], self.smoothed_over_s[sensitivity.covariate]);
            let smoothed = (over_s > 0.0).then(|| smoothed(measured, over_s, middle));
            let covariate = smoothed.as_ref().unwrap_or(measured);
            if covariate.slots == rest.slots {
                subtract(&mut rest, sensitivity.value, covariate);
            } else {
                rest = rest.in_common(&[covariate]);
                let common = covariate.clone().in_common(&[&rest]);
                subtract(&mut rest, sensitivity.value, &common);
            }
        }
        (!self.is_empty()).then_some(rest)
    }
}

/// Subtracts `sensitivity` times the change of `covariate`, which has the same samples, since its first: nothing depends on a later one.
fn subtract(series: &mut Series, sensitivity: f64, covariate: &Series) {
    let first = covariate.values.first().copied().unwrap_or(0.0);
    for (value, covariate) in series.values_mut().iter_mut().zip(covariate.values.iter()) {
        *value -= sensitivity * (covariate - first);
    }
}

fn regressors(channel: ChannelId, part: &RecordPart) -> impl Iterator<Item = ChannelId> {
    let quantities: &[Quantity] = match part.channels[channel].quantity {
        Quantity::AngularRate => &[Quantity::Temperature, Quantity::SupplyVoltage, Quantity::SpecificForce],
        Quantity::SpecificForce => &[Quantity::Temperature, Quantity::SupplyVoltage],
        _ => &[],
    };
    let of = move |&quantity: &Quantity| {
        part.coupled_with(channel).filter(move |&other| part.channels[other].quantity == quantity)
    };
    quantities.iter().flat_map(of)
}
