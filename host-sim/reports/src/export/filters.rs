//! GTSAM, Basalt and KF-GINS: numbers for each axis.

use super::exported_file::{Export, ExportError, rate, scientific};
use super::inertial_noise::{AxisNoise, Coefficient, Sensor, gauss_markov};
use crate::saved_report::SavedReport;
use noise_analysis::fit::gauss_markov::GaussMarkovFit;
use std::fmt::Write;

/// Milligal in m/s².
const MILLIGAL: f64 = 1e-5;

pub(super) fn gtsam(report: &SavedReport) -> Result<Export, ExportError> {
    let [gyroscope, accelerometer] = both(report)?;
    let mut text = String::from(
        "\"\"\"Noise of an IMU for GTSAM: continuous-time densities, as PreintegrationCombinedParams wants them.\"\"\"\n\
         import gtsam\nimport numpy as np\n\n",
    );
    for (name, axes, of, unit) in [
        ("ACCELEROMETER_NOISE_DENSITY", &accelerometer, WHITE, "m/s^2/sqrt(Hz)"),
        ("GYROSCOPE_NOISE_DENSITY", &gyroscope, WHITE, "rad/s/sqrt(Hz)"),
        ("ACCELEROMETER_RANDOM_WALK", &accelerometer, WALK, "m/s^3/sqrt(Hz)"),
        ("GYROSCOPE_RANDOM_WALK", &gyroscope, WALK, "rad/s^2/sqrt(Hz)"),
    ] {
        let values = axes.each_ref().map(of);
        let [x, y, z] = values.map(|of| scientific(of.value));
        let bounds = bounds(axes, &values);
        let _ = writeln!(text, "{name} = np.array([{x}, {y}, {z}])  # {unit}, axes x, y, z{bounds}");
    }
    text.push_str(
        "\n\ndef preintegration_params(gravity=9.80665, integration_covariance=1e-8):\n\
         \x20   \"\"\"Parameters in a frame with z up. Both arguments are no noise of the sensor: GTSAM's examples have 1e-8, in m^2/s.\"\"\"\n\
         \x20   params = gtsam.PreintegrationCombinedParams.MakeSharedU(gravity)\n\
         \x20   params.setAccelerometerCovariance(np.diag(ACCELEROMETER_NOISE_DENSITY**2))\n\
         \x20   params.setGyroscopeCovariance(np.diag(GYROSCOPE_NOISE_DENSITY**2))\n\
         \x20   params.setBiasAccCovariance(np.diag(ACCELEROMETER_RANDOM_WALK**2))\n\
         \x20   params.setBiasOmegaCovariance(np.diag(GYROSCOPE_RANDOM_WALK**2))\n\
         \x20   params.setIntegrationCovariance(integration_covariance * np.eye(3))\n\
         \x20   return params\n",
    );
    Ok(Export { text, missing: Vec::new() })
}

pub(super) fn basalt(report: &SavedReport) -> Result<Export, ExportError> {
    let [gyroscope, accelerometer] = both(report)?;
    let mut text = String::from("{\n    \"value0\": {\n");
    let mut about = String::from(
        "continuous: Basalt multiplies the noise by sqrt(imu_update_rate); rad/s and m/s^2, s; axes x, y, z",
    );
    let mut entries = String::new();
    for (name, axes, of) in [
        ("accel_noise_std", &accelerometer, WHITE),
        ("gyro_noise_std", &gyroscope, WHITE),
        ("accel_bias_std", &accelerometer, WALK),
        ("gyro_bias_std", &gyroscope, WALK),
    ] {
        let values = axes.each_ref().map(of);
        let [x, y, z] = values.map(|of| scientific(of.value));
        about += &bounds(axes, &values);
        let _ = write!(entries, ",\n        \"{name}\": [{x}, {y}, {z}]");
    }
    let rate = rate(report.sample_rate_hz);
    let _ =
        write!(text, "        \"comment\": \"{about}\",\n        \"imu_update_rate\": {rate:?}{entries}\n    }}\n}}\n");
    Ok(Export { text, missing: Vec::new() })
}

/// The block `imunoise`; one correlation time for all axes.
pub(super) fn kf_gins(report: &SavedReport) -> Result<Export, ExportError> {
    let [gyroscope, accelerometer] = both(report)?;
    let slow = gauss_markov(&six_axes(&gyroscope, &accelerometer), report);
    let Some(GaussMarkovFit { time_constant, deviations, worst_ratio }) = slow else {
        return Err(ExportError::NoSlowNoise("gyroscopes and accelerometer"));
    };
    let triple = |values: [f64; 3]| {
        let [x, y, z] = values.map(scientific);
        format!("[{x}, {y}, {z}]")
    };
    let deviation = |from: usize, unit: f64| std::array::from_fn(|axis| deviations[from + axis] / unit);
    let (degree, hour) = (std::f64::consts::PI / 180.0, 3600.0_f64);
    let white = |axes: &[AxisNoise<'_>; 3], unit: f64| axes.each_ref().map(|axis| WHITE(axis).value / unit);
    let mut text = String::new();
    let _ = write!(
        text,
        "# The IMU's noise for KF-GINS, axes x, y, z as recorded: bring them to forward, right, down.\n\
         # Continuous: arw and vrw are densities; gbstd and abstd the standard deviations of Gauss-Markov processes with one\n\
         # correlation time, which replace bias instability and random walk. Their Allan deviation is within a factor of {worst_ratio:.2}\n\
         # of the fitted models' at every averaging time of the record.\n\
         # gsstd and asstd, errors of the scale factors, do not show in a recording at rest: 0 leaves them out of the filter.\n\
         imunoise:\n\
         \x20 arw: {}  # deg/sqrt(hr){}\n\
         \x20 vrw: {}  # m/s/sqrt(hr){}\n\
         \x20 gbstd: {}  # deg/hr\n\
         \x20 abstd: {}  # mGal\n\
         \x20 gsstd: [0.0, 0.0, 0.0]  # ppm\n\
         \x20 asstd: [0.0, 0.0, 0.0]  # ppm\n\
         \x20 corrtime: {}  # hr\n",
        triple(white(&gyroscope, degree / hour.sqrt())),
        bounds(&gyroscope, &gyroscope.each_ref().map(WHITE)),
        triple(white(&accelerometer, 1.0 / hour.sqrt())),
        bounds(&accelerometer, &accelerometer.each_ref().map(WHITE)),
        triple(deviation(0, degree / hour)),
        triple(deviation(3, MILLIGAL)),
        scientific(time_constant / hour),
    );
    Ok(Export { text, missing: Vec::new() })
}

const NOTHING: Coefficient = Coefficient { value: 0.0, is_bound: false, estimate: 0.0 };
const WHITE: fn(&AxisNoise<'_>) -> Coefficient = |axis| axis.white.unwrap_or(NOTHING);
const WALK: fn(&AxisNoise<'_>) -> Coefficient = |axis| axis.walk.unwrap_or(NOTHING);

fn both(report: &SavedReport) -> Result<[[AxisNoise<'_>; 3]; 2], ExportError> {
    let sensors = [Sensor::Gyroscope, Sensor::Accelerometer];
    if sensors.iter().all(|sensor| sensor.axes(report).is_empty()) {
        return Err(ExportError::NoInertialChannel);
    }
    Ok([Sensor::Gyroscope.three_axes(report)?, Sensor::Accelerometer.three_axes(report)?])
}

fn six_axes<'a>(gyroscope: &[AxisNoise<'a>; 3], accelerometer: &[AxisNoise<'a>; 3]) -> Vec<AxisNoise<'a>> {
    gyroscope.iter().chain(accelerometer).cloned().collect()
}

fn bounds(axes: &[AxisNoise<'_>; 3], values: &[Coefficient; 3]) -> String {
    let bounded = axes.iter().zip(values).filter(|(_, of)| of.is_bound);
    let names: Vec<&str> = bounded.map(|(axis, _)| axis.channel.name.as_str()).collect();
    if names.is_empty() { String::new() } else { format!("; an upper bound: {}", names.join(", ")) }
}
