//! White rate noise after a digital low-pass filter of moving averages.

use super::process::Process;
use crate::math::{abs, cos, floor};
use core::f64::consts::PI;

/// One or two cascaded moving averages whose output is read at the same or at a lower rate. Two equal averages have a
/// triangular (Bartlett) impulse response.
///
/// At averaging times below the length of the filter the Allan variance rises like that of a random walk. If the output is
/// read at intervals near that length, only a correlation of neighbouring samples remains. The coefficient is that of the
/// white noise at frequencies far below both rates.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct MovingAverageFilter {
    /// Number of cascaded moving averages, 1 or 2.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "crate::serialized::stages"))]
    pub stages: u8,
    /// L: number of values that each averages, 1 to 128.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "crate::serialized::taps"))]
    pub taps: u16,
    /// Filter values per sample that is read, 1 or more. Not an integer where the filter and the reader have independent
    /// clocks.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "crate::serialized::at_least_one"))]
    pub decimation: f64,
}

impl MovingAverageFilter {
    /// Two moving averages over `taps` values each, every value of which is read.
    #[must_use]
    pub const fn bartlett(taps: u16) -> Self {
        Self { stages: 2, taps, decimation: 1.0 }
    }

    /// The longest lag, in samples, at which two samples are correlated.
    fn reach(&self) -> u32 {
        let lags = f64::from(self.stages) * f64::from(self.taps);
        floor(lags / self.decimation) as u32
    }

    /// Autocorrelation at a lag of `samples`, linear between whole filter values: reading at a random phase of the filter's
    /// clock.
    fn autocorrelation(&self, samples: f64) -> f64 {
        let position = samples * self.decimation;
        let (below, above) = (floor(position), position - floor(position));
        if above == 0.0 {
            return self.value_autocorrelation(below as i64);
        }
        (1.0 - above) * self.value_autocorrelation(below as i64) + above * self.value_autocorrelation(below as i64 + 1)
    }

    /// Autocorrelation of the impulse response at a lag of `j` filter values; it sums to 1 over all lags.
    ///
    /// It is the convolution of two box functions for one average and of four for two averages: a finite difference of
    /// binomial coefficients.
    fn value_autocorrelation(&self, j: i64) -> f64 {
        let taps = i64::from(self.taps);
        let boxes = 2 * i64::from(self.stages);
        let position = boxes / 2 * (taps - 1) - j.abs();
        let (mut sum, mut sign_choose) = (0, 1);
        for i in 0..=boxes {
            let k = position - i * taps;
            if k < 0 {
                break;
            }
            // C(k + boxes − 1, boxes − 1)
            sum += sign_choose * if boxes == 2 { k + 1 } else { (k + 1) * (k + 2) * (k + 3) / 6 };
            sign_choose = -sign_choose * (boxes - i) / (i + 1);
        }
        let area = taps as f64;
        sum as f64 / (if boxes == 2 { area * area } else { area * area * area * area })
    }

    /// Sum of the autocorrelation over all lags in samples: the gain at low frequencies.
    fn sum(&self) -> f64 {
        self.autocorrelation(0.0) + 2.0 * (1..=self.reach()).map(|j| self.autocorrelation(f64::from(j))).sum::<f64>()
    }
}

impl Process for MovingAverageFilter {
    fn sum_variance(&self, m: f64, sample_period: f64) -> f64 {
        let lags = (m as u32).saturating_sub(1).min(self.reach());
        let pairs: f64 = (1..=lags).map(|j| (m - f64::from(j)) * self.autocorrelation(f64::from(j))).sum();
        (m * self.autocorrelation(0.0) + 2.0 * pairs) / (self.sum() * sample_period)
    }

    /// As the provided method, with one pass over the lags.
    fn avar(&self, n: u64, sample_period: f64) -> f64 {
        let n = n as f64;
        let at_zero = self.autocorrelation(0.0);
        let (mut sum, mut pairs) = (at_zero, n * at_zero);
        for lag in (1..=self.reach()).map(f64::from) {
            let both_sides = 2.0 * self.autocorrelation(lag);
            sum += both_sides;
            pairs += both_sides * (2.0 * (n - lag).max(0.0) - 0.5 * (2.0 * n - lag).max(0.0));
        }
        pairs / (n * n * sum * sample_period)
    }

    fn density(&self, frequency: f64, sample_period: f64) -> f64 {
        let angle = 2.0 * PI * abs(frequency) * sample_period;
        let at_zero = self.autocorrelation(0.0);
        let (sum, waves) = (1..=self.reach()).map(f64::from).fold((at_zero, at_zero), |(sum, waves), j| {
            let both_sides = 2.0 * self.autocorrelation(j);
            (sum + both_sides, waves + both_sides * cos(j * angle))
        });
        waves / sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A filter with the provided Allan variance.
    struct Provided(MovingAverageFilter);

    impl Process for Provided {
        fn sum_variance(&self, m: f64, sample_period: f64) -> f64 {
            self.0.sum_variance(m, sample_period)
        }

        fn density(&self, frequency: f64, sample_period: f64) -> f64 {
            self.0.density(frequency, sample_period)
        }
    }

    #[test]
    fn one_pass_over_the_lags_gives_the_allan_variance_of_the_sums() {
        for (stages, taps, decimation) in
            [(1, 4, 1.0), (2, 8, 1.0), (2, 8, 8.92), (2, 64, 3.7), (1, 1, 1.0), (2, 2, 40.0)]
        {
            let filter = MovingAverageFilter { stages, taps, decimation };
            for n in [1, 2, 3, 8, 64, 1 << 20] {
                let (own, provided) = (filter.avar(n, 0.01), Provided(filter).avar(n, 0.01));
                // The provided method takes a small difference of two sums.
                assert!((own / provided - 1.0).abs() < 1e-9, "{filter:?} {n}: {own} {provided}");
            }
        }
    }
}
