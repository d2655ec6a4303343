//! How a channel follows a covariate, and how sure that is where few degrees of freedom tell.

use crate::confidence::NORMAL_975;
use crate::math::{abs, expm1, ln, sqrt};

/// How a channel follows a covariate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sensitivity {
    /// Which covariate.
    pub covariate: usize,
    /// In the channel's unit over the covariate's.
    pub value: f64,
    /// Such that the value ± 1.96 of it hold 95 %.
    pub error: f64,
    /// Degrees of freedom behind it; infinite where the error follows the normal distribution.
    pub freedom: f64,
}

impl Sensitivity {
    /// One that is known.
    #[must_use]
    pub fn exact(covariate: usize, value: f64) -> Self {
        Self { covariate, value, error: 0.0, freedom: f64::INFINITY }
    }

    /// From the standard deviation that few degrees of freedom showed.
    pub(super) fn new(covariate: usize, value: f64, deviation: f64, freedom: f64) -> Self {
        let widening = student(NORMAL_975, freedom) / NORMAL_975;
        Self { covariate, value, error: deviation * widening, freedom }
    }

    /// 95 % bounds of the value.
    #[must_use]
    pub fn bounds(&self) -> (f64, f64) {
        let half_width = NORMAL_975 * self.error;
        (self.value - half_width, self.value + half_width)
    }

    /// Distance from 0 in standard deviations of a normal distribution that are as rarely exceeded.
    #[must_use]
    pub fn sigmas(&self) -> f64 {
        let widening = student(NORMAL_975, self.freedom) / NORMAL_975;
        let ratio = abs(self.value) * widening / self.error;
        if self.freedom.is_infinite() {
            return ratio;
        }
        sqrt(self.freedom * ln(1.0 + ratio * ratio / self.freedom)) / wallace(self.freedom)
    }
}

/// Student's t that is as rarely exceeded as a normal deviate, by Wallace's approximation (Ann. Math. Statist. 30,
/// 1959): within 1.2 % at the 0.975 quantile from 3 degrees of freedom on.
fn student(normal: f64, freedom: f64) -> f64 {
    if freedom.is_infinite() {
        return normal;
    }
    let z = normal * wallace(freedom);
    sqrt(freedom * expm1(z * z / freedom))
}

fn wallace(freedom: f64) -> f64 {
    (8.0 * freedom + 3.0) / (8.0 * freedom + 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two-sided 5 % of Student's t, and of the normal distribution, from tables.
    #[test]
    fn bounds_and_significance_are_students() {
        for (freedom, quantile) in [(3.0, 3.182), (5.0, 2.571), (10.0, 2.228), (30.0, 2.042), (f64::INFINITY, 1.960)] {
            let sensitivity = Sensitivity::new(0, quantile, 1.0, freedom);
            assert!((sensitivity.error * NORMAL_975 / quantile - 1.0).abs() < 0.015, "{sensitivity:?}");
            assert!((sensitivity.sigmas() / NORMAL_975 - 1.0).abs() < 0.015, "{sensitivity:?}");
        }
        assert!(Sensitivity::exact(0, 1.0).sigmas().is_infinite());
    }
}
