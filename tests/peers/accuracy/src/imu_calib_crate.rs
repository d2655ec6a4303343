//! The crate imu-calib: slopes of the non-overlapping curve, or a refusal.

use crate::case::{Coefficients, SAMPLE_PERIOD};
use imu_calib::allan::{AllanConfig, AllanEstimator, Sensor};

/// N and K; absent where the crate refuses.
pub(crate) fn coefficients(series: &[f64]) -> anyhow::Result<Coefficients> {
    let mut estimator = AllanEstimator::with_rate(AllanConfig::default(), 1.0 / SAMPLE_PERIOD)?;
    for (at, &value) in series.iter().enumerate() {
        estimator.push(at as f64 * SAMPLE_PERIOD, [0.0; 3], [value; 3]);
    }
    let result = estimator.finish()?;
    let first = |axes: anyhow::Result<[f64; 3]>| axes.ok().map(|[x, ..]| x);
    Ok([first(result.noise_density_per_axis(Sensor::Gyro)), None, first(result.random_walk_per_axis(Sensor::Gyro))])
}
