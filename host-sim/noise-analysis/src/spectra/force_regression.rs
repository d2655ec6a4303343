//! Sensitivity of a gyroscope to the specific force, by cosine transforms of its rate and of the forces.
//!
//! At each order the rate is `Σ βᵢ·cᵢ + e` with weight 1/var(e) around it, so lines and drift take few orders away. The
//! sensitivity is tested as a vector. It is equal for slow and fast motion; a rotation that tilts the sensor is not.

use crate::detectors::bias::BiasSensitivity;
use crate::distributions::{DESCRIBED, NORMAL_975, chi_squared_tail};
use crate::effects::findings::SIGNIFICANCE;
use crate::samples::series::Series;
use crate::samples::uniform_series::UniformSeries;
use crate::spectra::transforms::cosine_transform;
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// Most values of a transform; a longer record has means of samples.
const MOST_VALUES: usize = 1 << 16;
const FEWEST_VALUES: usize = 256;
/// Fewest orders of equal share of motion along an axis; fewer are drift.
const FEWEST_ORDERS: f64 = 20.0;
/// Orders on either side for a local variance: a quarter of the order, within these bounds.
const AROUND: (usize, usize) = (8, 16);
/// Least force variance of an order of motion, over the accelerometer's white noise.
const MOTION: f64 = 2.0;
/// Stretches of a spectrum; the least variance among them is the white noise.
const STRETCHES: usize = 16;
/// Alternations between weights and sensitivities.
const TURNS: usize = 3;
/// Groups of orders, slow to fast, that have to agree.
const GROUPS: usize = 4;

/// The forces of a record that move, transformed once for all of its gyroscopes.
pub(crate) struct Forces(Vec<Force>);

struct ForceRegression<'a> {
    rate: Vec<f64>,
    forces: Vec<&'a Force>,
}

struct Force {
    /// Position among the given forces.
    place: usize,
    /// 0 at orders without motion.
    motion: Vec<f64>,
    /// Variance of the accelerometer's white noise per order.
    noise: f64,
}

struct Equations {
    /// Without the accelerometers' noise, which would bias the sensitivities.
    matrix: DMatrix<f64>,
    right: DVector<f64>,
    /// Covariance of the right side, with that noise.
    scatter: DMatrix<f64>,
}

struct Solution {
    sensitivities: DVector<f64>,
    information: DMatrix<f64>,
}

impl Forces {
    pub(crate) fn new(forces: &[&Series]) -> Self {
        let force = |(place, series): (usize, &&Series)| Force::new(place, transformed(series)?);
        Self(forces.iter().enumerate().filter_map(force).collect())
    }

    /// The sensitivities of `rate`, in its unit per g, to those of the forces that it follows, by their positions.
    pub(crate) fn sensitivities_of(&self, rate: &Series) -> Vec<(usize, BiasSensitivity)> {
        let Some(regression) = ForceRegression::new(rate, self) else { return Vec::new() };
        regression.sensitivities().unwrap_or_default()
    }
}

impl<'a> ForceRegression<'a> {
    /// `None` for too few samples, a gap, or no motion.
    fn new(rate: &Series, Forces(forces): &'a Forces) -> Option<Self> {
        let rate = if forces.is_empty() { None } else { transformed(rate) }?;
        let variances = around(&rate);
        let moves = |of: &&Force| of.motion.len() == rate.len() && of.orders(&variances) >= FEWEST_ORDERS;
        let forces: Vec<&Force> = forces.iter().filter(moves).collect();
        (!forces.is_empty()).then_some(Self { rate, forces })
    }

    fn sensitivities(&self) -> Option<Vec<(usize, BiasSensitivity)>> {
        let orders = || 1..self.rate.len();
        let axes = self.forces.len() as f64;
        let before = around(&self.rate);
        let mut variances = before.clone();
        let mut found = self.equations(&variances, orders()).solve()?;
        for _ in 1..TURNS {
            variances = around(&self.without(&found.sensitivities));
            found = self.equations(&variances, orders()).solve()?;
        }
        variances = around(&self.without(&found.sensitivities));
        // Twice the gain in ln likelihood: χ² of as many axes.
        let gain: f64 =
            orders().filter(|&order| variances[order] > 0.0).map(|at| (before[at] / variances[at]).ln()).sum();
        if chi_squared_tail(gain, axes) >= SIGNIFICANCE {
            return None;
        }
        let statistic = |apart: &DVector<f64>, information: &DMatrix<f64>| apart.dot(&(information * apart));
        let of_group = |orders: Range<usize>| {
            let own = self.equations(&variances, orders).solve()?;
            Some(statistic(&(own.sensitivities - &found.sensitivities), &own.information))
        };
        let of_groups: Vec<f64> = self.groups(&variances).filter_map(of_group).collect();
        let others = axes * (of_groups.len() as f64 - 1.0);
        if chi_squared_tail(of_groups.iter().sum(), others) < DESCRIBED {
            return None;
        }
        let freedom = self.forces.iter().map(|of| of.orders(&variances)).fold(f64::INFINITY, f64::min);
        let covariance = found.information.try_inverse()?;
        let of_axis = |(at, force): (usize, &&Force)| {
            let (sensitivity, error) = (found.sensitivities[at], covariance[(at, at)].sqrt());
            let is_shown = sensitivity.abs() > NORMAL_975 * error;
            is_shown.then_some((
                force.place,
                BiasSensitivity { sensitivity, error, degrees_of_freedom: freedom, smoothed_over_s: 0.0 },
            ))
        };
        Some(self.forces.iter().enumerate().filter_map(of_axis).collect())
    }

    /// The transform of the rate without the forces' part.
    fn without(&self, sensitivities: &DVector<f64>) -> Vec<f64> {
        let followed = |order: usize| {
            self.forces.iter().zip(sensitivities.iter()).map(|(of, by)| by * of.motion[order]).sum::<f64>()
        };
        self.rate.iter().enumerate().map(|(order, rate)| rate - followed(order)).collect()
    }

    fn equations(&self, variances: &[f64], orders: Range<usize>) -> Equations {
        let axes = self.forces.len();
        let mut matrix = DMatrix::zeros(axes, axes);
        let mut right = DVector::zeros(axes);
        let mut noise = DMatrix::zeros(axes, axes);
        for order in orders.filter(|&order| variances[order] > 0.0) {
            let weight = variances[order].recip();
            for (i, force) in self.forces.iter().enumerate().filter(|(_, force)| force.motion[order] != 0.0) {
                right[i] += weight * force.motion[order] * self.rate[order];
                noise[(i, i)] += weight * force.noise;
                for (j, other) in self.forces.iter().enumerate() {
                    matrix[(i, j)] += weight * force.motion[order] * other.motion[order];
                }
            }
        }
        Equations { matrix: &matrix - noise, right, scatter: matrix }
    }

    /// Consecutive orders with equal parts of the information.
    fn groups(&self, variances: &[f64]) -> impl Iterator<Item = Range<usize>> {
        let mut sums = vec![0.0];
        sums.extend((1..self.rate.len()).scan(0.0, |sum, order| {
            *sum += self.forces.iter().map(|of| of.share(variances, order)).sum::<f64>();
            Some(*sum)
        }));
        let end = move |group: usize| {
            let part = sums[sums.len() - 1] * group as f64 / GROUPS as f64;
            sums.partition_point(|sum| *sum < part).max(1)
        };
        let orders = self.rate.len();
        (0..GROUPS).map(move |group| end(group)..if group + 1 == GROUPS { orders } else { end(group + 1) })
    }
}

impl Force {
    fn new(place: usize, mut motion: Vec<f64>) -> Option<Self> {
        let variances = around(&motion);
        let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len() as f64;
        let noise = variances[1..].chunks(variances.len() / STRETCHES).map(mean).fold(f64::INFINITY, f64::min);
        for (motion, variance) in motion.iter_mut().zip(&variances) {
            if *variance <= MOTION * noise {
                *motion = 0.0;
            }
        }
        motion.iter().any(|of| *of != 0.0).then_some(Self { place, motion, noise })
    }

    /// Share of an order in the normal equations.
    fn share(&self, variances: &[f64], order: usize) -> f64 {
        let square = self.motion[order].powi(2);
        if square > 0.0 && variances[order] > 0.0 { square / variances[order] } else { 0.0 }
    }

    /// Effective number of orders of equal share.
    fn orders(&self, variances: &[f64]) -> f64 {
        let shares = (1..self.motion.len()).map(|order| self.share(variances, order));
        let (sum, squares) = shares.fold((0.0, 0.0), |(sum, squares), of| (sum + of, squares + of * of));
        if squares > 0.0 { sum * sum / squares } else { 0.0 }
    }
}

impl Equations {
    fn solve(&self) -> Option<Solution> {
        let sensitivities = self.matrix.clone().cholesky()?.solve(&self.right);
        let information = &self.matrix * self.scatter.clone().cholesky()?.solve(&self.matrix);
        Some(Solution { sensitivities, information })
    }
}

/// Cosine transform of means of samples about their straight line, 0 if missing; `None` with a long gap.
fn transformed(series: &Series) -> Option<Vec<f64>> {
    let size = (series.span.end - series.span.start).div_ceil(MOST_VALUES as u64).max(1) as usize;
    let uniform = UniformSeries::from_series(series);
    let is_whole = uniform.values().len() as u64 == series.span.end - series.span.start;
    if !is_whole || uniform.values().len() < FEWEST_VALUES * size {
        return None;
    }
    let values = uniform.averaged(size).detrended();
    Some(cosine_transform(values.values().iter().map(|value| if value.is_finite() { *value } else { 0.0 })))
}

/// Mean square around each order; 0 at order 0.
fn around(transform: &[f64]) -> Vec<f64> {
    let mut sums = vec![0.0];
    sums.extend(transform.iter().skip(1).scan(0.0, |sum, value| {
        *sum += value * value;
        Some(*sum)
    }));
    let variance = |order: usize| {
        let reach = (order / 4).clamp(AROUND.0, AROUND.1);
        let (from, to) = (order.saturating_sub(reach + 1), (order + reach).min(transform.len() - 1));
        (sums[to] - sums[from]) / (to - from) as f64
    };
    std::iter::once(0.0).chain((1..transform.len()).map(variance)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;
    use std::f64::consts::TAU;

    const SAMPLES: usize = 16_384;
    const PERIOD_S: f64 = 0.01;
    /// Per g along x, y, z, for white noise of deviation 1.
    const SENSITIVITY: [f64; 3] = [3.0, 0.0, -2.0];

    fn series(values: Vec<f64>, unit: &'static str) -> Series {
        let slots = 0..values.len() as u64;
        let values = values.into();
        Series { slots: slots.clone().collect(), values, span: slots, period_s: PERIOD_S, resolution: 1e-6, unit }
    }

    fn normal(random: &mut ChaCha8Rng) -> f64 {
        random.sample(StandardNormal)
    }

    fn noise(random: &mut ChaCha8Rng, white: f64, step: f64) -> Vec<f64> {
        let mut walk = 0.0;
        let value = |_| {
            walk += step * normal(random);
            walk + white * normal(random)
        };
        (0..SAMPLES).map(value).collect()
    }

    /// A motion of 0.05 g with a correlation time of 1 s.
    fn motion(random: &mut ChaCha8Rng) -> Vec<f64> {
        let kept = f64::exp(-0.01);
        let mut force = 0.05 * normal(random);
        let value = |_| {
            force = kept * force + 0.05 * (1.0 - kept * kept).sqrt() * normal(random);
            force
        };
        (0..SAMPLES).map(value).collect()
    }

    fn sum(one: &[f64], factor: f64, other: &[f64]) -> Vec<f64> {
        one.iter().zip(other).map(|(one, other)| one + factor * other).collect()
    }

    /// Beside a sinusoid of 1 Hz, the rate follows `followed` of three motions.
    fn found(seed: u64, followed: impl Fn(&[Vec<f64>; 3]) -> Vec<f64>) -> Vec<(usize, BiasSensitivity)> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let motions = [(); 3].map(|()| motion(&mut random));
        let forces = motions.each_ref().map(|of| series(sum(of, 1.0, &noise(&mut random, 0.01, 0.0)), "g"));
        let line: Vec<f64> = (0..SAMPLES).map(|at| 3.0 * (TAU * at as f64 * PERIOD_S).sin()).collect();
        let rate = sum(&sum(&noise(&mut random, 1.0, 0.002), 1.0, &line), 1.0, &followed(&motions));
        Forces::new(&forces.each_ref()).sensitivities_of(&series(rate, "deg/s"))
    }

    #[test]
    fn a_sensitivity_beside_a_sinusoid_is_measured() {
        let (mut covered, mut shown) = (0, 0);
        for seed in 0..20 {
            let follow = |of: &[Vec<f64>; 3]| sum(&sum(&vec![0.0; SAMPLES], 3.0, &of[0]), -2.0, &of[2]);
            for (place, of) in found(seed, follow) {
                shown += 1;
                covered += u32::from((of.sensitivity - SENSITIVITY[place]).abs() <= NORMAL_975 * of.error);
            }
        }
        // Two axes of 20 records, one more by chance; 34 or fewer of 40 intervals hold with a probability of 1 %.
        assert!((40..=44).contains(&shown) && covered >= 35, "{covered} of {shown}");
    }

    #[test]
    fn drift_and_motion_are_no_sensitivity() {
        for seed in 0..20 {
            assert_eq!(found(seed, |of| vec![0.0; of[0].len()]), []);
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let forces = [0.001, 0.01, 0.1].map(|step| series(noise(&mut random, 0.01, step), "g"));
            let rate = series(noise(&mut random, 1.0, 0.1), "deg/s");
            assert_eq!(Forces::new(&forces.each_ref()).sensitivities_of(&rate), []);
        }
    }

    #[test]
    fn short_and_constant_channels_have_no_sensitivity() {
        for values in [Vec::new(), vec![1.0], vec![0.0; SAMPLES]] {
            let channel = series(values, "g");
            assert_eq!(Forces::new(&[&channel, &channel]).sensitivities_of(&channel), []);
        }
    }

    /// The tilt measures gravity by the integral of the rate.
    #[test]
    fn a_rotation_that_tilts_the_sensor_is_no_sensitivity() {
        for seed in 0..20 {
            let differences = |of: &[Vec<f64>; 3]| {
                let rates = of[0].windows(2).map(|pair| (pair[1] - pair[0]).to_degrees() / PERIOD_S);
                std::iter::once(0.0).chain(rates).collect()
            };
            assert_eq!(found(seed, differences), []);
        }
    }
}
