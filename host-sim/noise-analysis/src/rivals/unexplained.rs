//! Departures from a model beyond chance: the point of the curve that contradicts it most, and a level of the noise that changes
//! with the temperature.

use crate::bounds::BoundedEstimate;
use crate::distributions::{NORMAL_975, ROUNDING, student_tail, upper_tail};
use crate::effects::findings::REFUTED;
use crate::effects::{Observation, Unexplained, UnexplainedPlace};
use crate::fit::channel_fit::ChannelFit;
use crate::samples::rounding::DITHERED_OCTAVES;
use crate::samples::series::Series;
use allan_core::{AllanPoint, Model};
use measurement::SensorProfile;
use statrs::function::gamma::{gamma_lr, gamma_ur};

/// Smallest deviation of the Allan deviation that is reported, as a part of it: a sensor's scale factor, in which every
/// figure is given, has a tolerance of 1 % by the data sheet.
pub(super) const MIN_EXCESS: f64 = 0.01;
/// Degrees of freedom from which the χ² distribution is taken for that of the cube of a normal variable (E. Wilson and M.
/// Hilferty, PNAS 17, 1931), which is then exact to 10⁻³ of the tail beyond five standard deviations.
const MANY: f64 = 1e4;

/// Blocks of a record whose levels are compared with the temperature, and the fewest pairs of neighbouring samples in one.
const LEVEL_BLOCKS: usize = 64;
const LEAST_PAIRS: u32 = 100;
/// Least part of the changes of the level that the temperature explains, and least change of the deviation over the range of the
/// temperature, %: a supply or a vibration that changes in the course of a record has a course like that of the temperature by chance.
const LEAST_EXPLAINED: f64 = 0.5;
const LEAST_CHANGE: f64 = 5.0;

/// A point of a curve and what the model says of it.
struct Residual<'a> {
    point: &'a AllanPoint,
    /// Measured over modelled Allan variance.
    ratio: f64,
    /// Two-sided probability of a ratio as far from 1 or farther if the model is true.
    p_value: f64,
}

/// The deviation of the curve of a channel of this `resolution` from the model with its added terms that is least likely by
/// chance, if it is by less than [`REFUTED`] anywhere in the curve. `of_covariates` is the square of the resolutions of its
/// covariates, each times its sensitivity: a temperature is as good as constant between two counts, so that the rounding error of its
/// share stays the same over long averaging times.
pub(crate) fn by_curve(
    fit: &ChannelFit,
    profile: &SensorProfile,
    resolution: f64,
    of_covariates: f64,
) -> Option<Unexplained> {
    let (curve, model) = (&fit.curve, fit.after());
    // Without dither the rounding error is no white noise.
    let is_dithered = fit.is_dithered(profile, resolution, DITHERED_OCTAVES);
    let own = if is_dithered { 0.0 } else { resolution * resolution };
    let rounding = ROUNDING * (own + of_covariates);
    // Skips points that are mostly interpolated.
    let measured = curve.points().iter().filter(|point| point.replaced < 0.5);
    let residuals: Vec<Residual> = measured.filter_map(|point| residual(point, model, rounding)).collect();
    // Neighbouring octaves are nearly independent.
    let limit = REFUTED / residuals.len() as f64;
    let is_unexplained = |of: &&Residual| of.p_value < limit && (of.ratio.sqrt() - 1.0).abs() > MIN_EXCESS;
    let (at, worst) = residuals
        .iter()
        .enumerate()
        .filter(|(_, of)| is_unexplained(of))
        .min_by(|a, b| a.1.p_value.total_cmp(&b.1.p_value))?;
    // The octaves around it that deviate in the same direction, each by itself.
    let is_part = |of: &&Residual| of.p_value < REFUTED && (of.ratio > 1.0) == (worst.ratio > 1.0);
    let first = residuals[..at].iter().rev().take_while(is_part).last().unwrap_or(worst);
    let last = residuals[at..].iter().take_while(is_part).last().unwrap_or(worst);
    let percent = |avar: f64| 100.0 * ((avar / model.avar(worst.point.n)).sqrt() - 1.0);
    Some(Unexplained {
        place: UnexplainedPlace::AveragingTime(BoundedEstimate::new(worst.point.tau, first.point.tau, last.point.tau)),
        excess_percent: Some(BoundedEstimate::new(
            percent(worst.point.avar),
            percent(worst.point.low),
            percent(worst.point.high),
        )),
        observation: Observation::PointOfCurve { p_value: (worst.p_value * residuals.len() as f64).min(1.0) },
    })
}

/// A level of the noise that changes with the temperature: no effect that has a name.
///
/// The level of a block is half the mean square of the differences of neighbouring samples. Its logarithm is regressed on the mean
/// temperature of the block.
pub(crate) fn level_by_temperature(series: &Series, temperature: &Series) -> Option<Unexplained> {
    let (first, last) = (*series.slots.first()?, *series.slots.last()?);
    let block_of = |slot: u64| ((slot - first) * LEVEL_BLOCKS as u64 / (last - first + 1)) as usize;
    let mut levels = vec![(0.0, 0_u32); LEVEL_BLOCKS];
    for (slots, values) in series.slots.windows(2).zip(series.values.windows(2)) {
        if slots[1] == slots[0] + 1 {
            let (sum, count) = &mut levels[block_of(slots[1])];
            (*sum, *count) = (*sum + 0.5 * (values[1] - values[0]).powi(2), *count + 1);
        }
    }
    let mut means = vec![(0.0, 0_u32); LEVEL_BLOCKS];
    for (&slot, value) in temperature.slots.iter().zip(temperature.values.iter()) {
        if (first..=last).contains(&slot) {
            let (sum, count) = &mut means[block_of(slot)];
            (*sum, *count) = (*sum + value, *count + 1);
        }
    }
    let points: Vec<(f64, f64)> = levels
        .iter()
        .zip(&means)
        .filter(|((square, pairs), (_, count))| *square > 0.0 && *pairs >= LEAST_PAIRS && *count > 0)
        .map(|((square, pairs), (sum, count))| (sum / f64::from(*count), (square / f64::from(*pairs)).ln()))
        .collect();
    let count = points.len() as f64;
    if points.len() < LEVEL_BLOCKS / 2 {
        return None;
    }
    let mean = |of: &dyn Fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / count;
    let (middle, level) = (mean(&|point| point.0), mean(&|point| point.1));
    let (xx, yy) = (mean(&|point| (point.0 - middle).powi(2)), mean(&|point| (point.1 - level).powi(2)));
    let slope = mean(&|point| (point.0 - middle) * (point.1 - level)) / xx;
    let explained = slope * slope * xx / yy;
    let (coldest, warmest) = points
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), point| (low.min(point.0), high.max(point.0)));
    // The deviation has half the logarithm of the variance.
    let percent = |slope: f64| 100.0 * (0.5 * slope * (warmest - coldest)).exp_m1();
    let error = ((yy / xx) * (1.0 - explained) / (count - 2.0)).sqrt();
    let is_shown = explained > LEAST_EXPLAINED && 2.0 * student_tail(slope.abs() / error, count - 2.0) < REFUTED;
    if !is_shown || percent(slope.abs()) < LEAST_CHANGE {
        return None;
    }
    let (a, b) = (percent(slope - NORMAL_975 * error), percent(slope + NORMAL_975 * error));
    Some(Unexplained {
        place: UnexplainedPlace::AveragingTime(BoundedEstimate::exact(series.period_s)),
        excess_percent: Some(BoundedEstimate::new(percent(slope), a.min(b), a.max(b))),
        observation: Observation::LevelByTemperature { range_degc: [coldest, warmest], explained },
    })
}

/// The deviation of a point, less what a rounding error of this variance can add or take away.
fn residual<'a>(point: &'a AllanPoint, model: &Model, rounding: f64) -> Option<Residual<'a>> {
    let modelled = model.avar(point.n);
    let change = point.avar - modelled;
    let ratio = 1.0 + change.signum() * (change.abs() - rounding).max(0.0) / modelled;
    let edf = model.edf(point);
    let p_value = two_sided(ratio, edf);
    (modelled > 0.0 && p_value.is_finite()).then_some(Residual { point, ratio, p_value })
}

/// Probability of a χ² variable over its `edf` degrees of freedom as far from 1 as `ratio` on the same side, twice.
fn two_sided(ratio: f64, edf: f64) -> f64 {
    let tail = if edf > MANY {
        let variance = 2.0 / (9.0 * edf);
        let z = (ratio.cbrt() - (1.0 - variance)) / variance.sqrt();
        upper_tail(z.abs())
    } else {
        let half = 0.5 * edf;
        match half * ratio {
            // Both functions are defined between 0 and infinity, where a variance of 0 or one without a model has no probability.
            x if x <= 0.0 || x.is_infinite() => 0.0,
            x if ratio > 1.0 => gamma_ur(half, x),
            x => gamma_lr(half, x),
        }
    };
    (2.0 * tail).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::{level_by_temperature, two_sided};
    use crate::samples::series::Series;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;
    use std::f64::consts::TAU;

    const SAMPLES: usize = 64_000;

    fn series(value: impl FnMut(usize) -> f64) -> Series {
        let slots = 0..SAMPLES as u64;
        let values = (0..SAMPLES).map(value).collect();
        Series { slots: slots.clone().collect(), values, span: slots, period_s: 0.01, resolution: 1e-6, unit: "deg/s" }
    }

    /// Three quarters of a period between 20 and 30 degC.
    fn temperature_c(at: usize) -> f64 {
        25.0 + 5.0 * (0.75 * TAU * at as f64 / SAMPLES as f64).sin()
    }

    #[test]
    fn a_level_that_follows_the_temperature_is_found_and_others_are_not() {
        let temperature = series(temperature_c);
        let noise = |seed: u64, level: fn(usize) -> f64| {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            series(move |at| level(at) * random.sample::<f64, _>(StandardNormal))
        };
        // From 20 to 30 degC the deviation rises as exp(0.04·10): by 49 %. Of 64 blocks of 1,000 differences each, whose squares have
        // the relative variance 3/1000, the slope over the range is known to 0.5·√(3/1000/64)/0.35, which is 1 % of 1.49.
        let found =
            level_by_temperature(&noise(1, |at| (0.04 * temperature_c(at)).exp()), &temperature).expect("follows");
        let excess = found.excess_percent.expect("a size").value;
        assert!((excess - 100.0 * 0.4_f64.exp_m1()).abs() < 5.0, "{excess}");
        // A constant level, and one that goes up and down twice in the meantime.
        for seed in 2..12 {
            assert!(level_by_temperature(&noise(seed, |_| 1.0), &temperature).is_none(), "{seed}");
        }
        let twice = |at: usize| 1.0 + 0.3 * (2.0 * TAU * at as f64 / SAMPLES as f64).sin();
        assert!(level_by_temperature(&noise(12, twice), &temperature).is_none());
    }

    /// Quantiles of χ² from tables (Abramowitz and Stegun, table 26.8): 0.5 % on either side.
    #[test]
    fn tails_are_those_of_the_tables() {
        for (edf, low, high) in [(1.0, 0.000_039_3, 7.879_44), (10.0, 2.155_86, 25.188_2), (100.0, 67.327_6, 140.169)] {
            for quantile in [low, high] {
                let p_value = two_sided(quantile / edf, edf);
                assert!((p_value / 0.01 - 1.0).abs() < 1e-3, "{edf}, {quantile}: {p_value}");
            }
        }
        // Both forms at the border: the normal deviate of 5 standard deviations.
        let (below, above) =
            (two_sided(1.0 + 5.0 * (2e-4f64).sqrt(), 9_999.0), two_sided(1.0 + 5.0 * (2e-4f64).sqrt(), 10_001.0));
        assert!((below / above - 1.0).abs() < 0.01, "{below} {above}");
    }
}
