//! White rate noise behind a digital low-pass filter.

use super::Process;
use crate::math::{abs, cos, floor};
use core::f64::consts::PI;

/// One or two moving averages in a row, and the output read at a lower rate; two averages are a Bartlett window.
///
/// Where the filter is longer than a few samples the curve rises at first like a random walk's; read more slowly than
/// that, what is left of it is a correlation of neighbours. The coefficient is that of the noise far below both rates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Filter {
    /// Moving averages in a row, 1 or 2.
    pub stages: u8,
    /// L: values that each averages, 1 to 128.
    pub taps: u16,
    /// Values that the filter takes for one sample that is read, 1 or more; not a whole number where two clocks rule.
    pub decimation: f64,
}

impl Filter {
    /// A moving average over `taps` samples.
    #[must_use]
    pub const fn boxcar(taps: u16) -> Self {
        Self { stages: 1, taps, decimation: 1.0 }
    }

    /// Two moving averages over `taps` samples each.
    #[must_use]
    pub const fn bartlett(taps: u16) -> Self {
        Self { stages: 2, taps, decimation: 1.0 }
    }

    /// Samples that are correlated with one.
    fn reach(&self) -> u32 {
        let lags = f64::from(self.stages) * f64::from(self.taps);
        floor(lags / self.decimation) as u32
    }

    /// Autocorrelation at a lag of `samples`: between two values of the filter as seen at a random moment.
    fn autocorrelation(&self, samples: f64) -> f64 {
        let position = samples * self.decimation;
        let (below, above) = (floor(position), position - floor(position));
        if above == 0.0 {
            return self.of_values(below as i64);
        }
        (1.0 - above) * self.of_values(below as i64) + above * self.of_values(below as i64 + 1)
    }

    /// Autocorrelation of the impulse response at a lag of `j` values of the filter; the sum over all is 1.
    ///
    /// An average correlated with itself is a box folded with a box, two averages four of them: a spline of finite
    /// differences of binomial coefficients.
    fn of_values(&self, j: i64) -> f64 {
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

    /// The sum over all lags, which makes the coefficient that of low frequencies.
    fn sum(&self) -> f64 {
        self.autocorrelation(0.0) + 2.0 * (1..=self.reach()).map(|j| self.autocorrelation(f64::from(j))).sum::<f64>()
    }
}

impl Process for Filter {
    fn structure(&self, m: f64, sample_period: f64) -> f64 {
        let lags = (m as u32).saturating_sub(1).min(self.reach());
        let pairs: f64 = (1..=lags).map(|j| (m - f64::from(j)) * self.autocorrelation(f64::from(j))).sum();
        (m * self.autocorrelation(0.0) + 2.0 * pairs) / (self.sum() * sample_period)
    }

    fn density(&self, frequency: f64, sample_period: f64) -> f64 {
        let angle = 2.0 * PI * abs(frequency) * sample_period;
        let waves = (1..=self.reach()).map(f64::from).map(|j| self.autocorrelation(j) * cos(j * angle));
        (self.autocorrelation(0.0) + 2.0 * waves.sum::<f64>()) / self.sum()
    }

    fn record_needed(&self, sample_period: f64) -> f64 {
        100.0 * f64::from(self.taps) * sample_period
    }
}
