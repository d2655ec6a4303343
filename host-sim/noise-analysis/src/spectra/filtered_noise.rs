//! Expected squared cosine coefficients of white noise behind a filter.

use allan_core::term::{MovingAverageFilter, Process};
use std::f64::consts::PI;

/// White noise behind a filter, in samples or in means of several.
#[derive(Clone)]
pub(super) struct FilteredNoise {
    /// Covariance at each lag times the period, for a coefficient of 1.
    covariances: Vec<f64>,
    /// Seconds between samples or means.
    period: f64,
}

impl FilteredNoise {
    pub(super) fn new(filter: &MovingAverageFilter, sample_period: f64, samples_per_mean: u64) -> Self {
        let count = samples_per_mean as f64;
        let reach = (f64::from(filter.stages) * f64::from(filter.taps) / filter.decimation / count).ceil() as u32;
        // Half the second difference of the variance of sums.
        let mut sums = vec![0.0; reach as usize + 2];
        filter.sum_variances(count, sample_period, &mut sums);
        let covariance = |lag: usize| (sums[lag + 1] - 2.0 * sums[lag] + sums[lag.abs_diff(1)]) / 2.0;
        let scale = sample_period / count;
        Self {
            covariances: (0..=reach as usize).map(|lag| scale * covariance(lag)).collect(),
            period: count * sample_period,
        }
    }

    /// Two-sided density at a frequency in Hz, for a coefficient of 1.
    pub(super) fn density(&self, frequency: f64) -> f64 {
        self.sum(2.0 * PI * frequency * self.period, |_, turned, _| turned.0)
    }

    /// Expected square of the coefficient of this order times the period: the density, and leakage into its nulls.
    pub(super) fn expected(&self, order: f64, count: usize) -> f64 {
        let of = count as f64;
        self.sum(PI * order / of, |lag, (cosine, sine), first| ((of - lag) * cosine - sine / first) / of)
    }

    /// Covariance at lag 0, and twice the others times `weight` of lag, (cos, sin) of lag·angle, and sin(angle).
    fn sum(&self, angle: f64, weight: impl Fn(f64, (f64, f64), f64) -> f64) -> f64 {
        let Some((at_zero, at_lags)) = self.covariances.split_first() else { return 0.0 };
        let (sine, cosine) = angle.sin_cos();
        let (mut sum, mut turned) = (*at_zero, (cosine, sine));
        for (lag, covariance) in (1..).zip(at_lags) {
            sum += 2.0 * covariance * weight(f64::from(lag), turned, sine);
            turned = (turned.0 * cosine - turned.1 * sine, turned.1 * cosine + turned.0 * sine);
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cosine(order: usize, at: usize, count: usize) -> f64 {
        (2.0 / count as f64).sqrt() * (PI * (order * (2 * at + 1)) as f64 / (2 * count) as f64).cos()
    }

    /// The triangle (1, 2, 3, 4, 3, 2, 1)/16 has the autocovariance 44, 40, 31, 20, 10, 4, 1 of 256.
    #[test]
    fn coefficients_of_filtered_noise_have_the_squares_of_its_covariance() {
        let covariances = [44.0, 40.0, 31.0, 20.0, 10.0, 4.0, 1.0].map(|of| of / 256.0);
        let filtered = FilteredNoise::new(&MovingAverageFilter::bartlett(4), 0.01, 1);
        let count = 40;
        for order in 1..count {
            let pair = |a: usize, b: usize| {
                covariances.get(a.abs_diff(b)).map_or(0.0, |of| of * cosine(order, a, count) * cosine(order, b, count))
            };
            let expected: f64 = (0..count).flat_map(|a| (0..count).map(move |b| (a, b))).map(|(a, b)| pair(a, b)).sum();
            let found = filtered.expected(order as f64, count);
            assert!((found - expected).abs() < 1e-9, "{order}: {found}, {expected}");
        }
    }

    /// The density of means is that of the samples times the gain of a mean, with aliases.
    #[test]
    fn the_density_of_means_is_that_of_the_samples_with_its_aliases() {
        let (filter, period) = (MovingAverageFilter { stages: 2, taps: 16, decimation: 3.7 }, 0.01);
        let (samples, means) = (FilteredNoise::new(&filter, period, 1), FilteredNoise::new(&filter, period, 8));
        for frequency in [0.3, 2.0, 6.1] {
            let alias = |order: u32| {
                let frequency = frequency + f64::from(order) / (8.0 * period);
                let half = PI * frequency * period;
                let density = samples.density(frequency);
                assert!((density - filter.density(frequency, period)).abs() < 1e-9, "{frequency}");
                density * ((8.0 * half).sin() / (8.0 * half.sin())).powi(2)
            };
            let aliases: f64 = (0..8).map(alias).sum();
            assert!((means.density(frequency) - aliases).abs() < 1e-9, "{frequency}");
        }
    }
}
