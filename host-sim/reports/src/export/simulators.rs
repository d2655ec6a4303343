//! MATLAB and Gazebo: numbers for each axis, without terms that are not significant.

use super::exported_file::{Export, ExportError, rate, scientific};
use super::inertial_noise::{AxisNoise, Coefficient, Sensor, gauss_markov};
use crate::saved_report::SavedReport;
use std::fmt::Write;

pub(super) fn matlab(report: &SavedReport) -> Result<Export, ExportError> {
    let mut text = String::from(
        "% Noise of the continuous process for imuSensor: two-sided densities, which is the default NoiseType.\n\
         % BiasInstability is B of IEEE Std 952: the Allan deviation of the flat part is 0.664 times as much.\n\
         % A term that the record does not show is 0.\n",
    );
    let mut missing = Vec::new();
    let mut any = false;
    for (sensor, variable, class, unit) in
        [(Sensor::Gyroscope, "gyro", "gyroparams", "rad/s"), (Sensor::Accelerometer, "accel", "accelparams", "m/s^2")]
    {
        if sensor.axes(report).is_empty() {
            let _ = writeln!(text, "% {variable}: no {} in the report", sensor.name());
            missing.push(class.to_owned());
            continue;
        }
        any = true;
        let axes = sensor.three_axes(report)?;
        let vector = |of: fn(&AxisNoise<'_>) -> Option<Coefficient>| {
            let [x, y, z] = axes.each_ref().map(|axis| scientific(of(axis).map_or(0.0, |of| of.estimate)));
            format!("[{x} {y} {z}]")
        };
        let _ = writeln!(
            text,
            "{variable} = {class}( ... % axes x, y, z\n\
             \x20   'NoiseDensity', {}, ... % ({unit})/sqrt(Hz)\n\
             \x20   'BiasInstability', {}, ... % {unit}\n\
             \x20   'RandomWalk', {}); % ({unit})*sqrt(Hz)",
            vector(|axis| axis.white),
            vector(|axis| axis.bias_instability),
            vector(|axis| axis.walk),
        );
    }
    if !any {
        return Err(ExportError::NoInertialChannel);
    }
    let _ = writeln!(
        text,
        "imu = imuSensor('accel-gyro', 'SampleRate', {}{}{});",
        rate(report.sample_rate_hz),
        if text.contains("gyro = ") { ", 'Gyroscope', gyro" } else { "" },
        if text.contains("accel = ") { ", 'Accelerometer', accel" } else { "" },
    );
    Ok(Export { text, missing })
}

/// A model with one link and an IMU on it.
///
/// Gazebo's bias obeys `b ← e^(−Δt/T)·b + N(0, σ_d²)` with `σ_d² = −σ_b²·T/2·(e^(−2Δt/T) − 1)`: `dynamic_bias_stddev`
/// σ_b is `s·√(2/T)` for a process of deviation s.
pub(super) fn gazebo(report: &SavedReport) -> Result<Export, ExportError> {
    let rate = rate(report.sample_rate_hz);
    let mut text = format!(
        "<?xml version=\"1.0\"?>\n\
         <!-- stddev is discrete: the deviation of samples at update_rate; change both together (stddev grows with the root of the rate).\n\
         \x20    dynamic_bias_stddev is continuous: the density of the noise that drives the bias, whose deviation is\n\
         \x20    dynamic_bias_stddev*sqrt(dynamic_bias_correlation_time/2). It replaces bias instability and random walk. -->\n\
         <sdf version=\"1.7\">\n  <model name=\"imu\">\n    <link name=\"link\">\n      <sensor name=\"imu\" type=\"imu\">\n\
         \x20       <update_rate>{rate}</update_rate>\n        <imu>\n"
    );
    let mut missing = Vec::new();
    for (sensor, element) in [(Sensor::Gyroscope, "angular_velocity"), (Sensor::Accelerometer, "linear_acceleration")] {
        let axes = sensor.axes(report);
        if axes.is_empty() {
            missing.push(element.to_owned());
            continue;
        }
        let _ = writeln!(text, "          <{element}>");
        for axis in &axes {
            axis_noise(axis, report, &mut text);
        }
        let _ = writeln!(text, "          </{element}>");
    }
    if missing.len() == 2 {
        return Err(ExportError::NoInertialChannel);
    }
    text.push_str("        </imu>\n      </sensor>\n    </link>\n  </model>\n</sdf>\n");
    Ok(Export { text, missing })
}

fn axis_noise(axis: &AxisNoise<'_>, report: &SavedReport, text: &mut String) {
    let letter = axis.channel.name.rsplit('_').next().unwrap_or_default();
    let white = axis.white.map_or(0.0, |white| white.estimate) * report.sample_rate_hz.sqrt();
    let _ = write!(
        text,
        "            <{letter}>\n              <noise type=\"gaussian\">\n                <mean>0</mean>\n\
         \x20               <stddev>{}</stddev>\n",
        scientific(white)
    );
    let slow = gauss_markov(std::slice::from_ref(axis), report);
    if let Some((slow, deviation)) = slow.as_ref().and_then(|slow| Some((slow, slow.deviations.first()?))) {
        let _ = write!(
            text,
            "                <!-- Allan deviation within a factor of {:.2} of the fitted model's -->\n\
             \x20               <dynamic_bias_stddev>{}</dynamic_bias_stddev>\n\
             \x20               <dynamic_bias_correlation_time>{}</dynamic_bias_correlation_time>\n",
            slow.worst_ratio,
            scientific(deviation * (2.0 / slow.time_constant).sqrt()),
            scientific(slow.time_constant),
        );
    }
    let _ = write!(text, "              </noise>\n            </{letter}>\n");
}
