//! The coefficients in the file formats of calibration and navigation programs.

use noise_analysis::report::{ChannelReport, Parameter, Report};
use std::fmt::Write;

/// The four numbers of Kalibr's IMU model: key, prefix of the channel names, kind of coefficient, unit. All are those of
/// the continuous process.
const KALIBR: [(&str, &str, &str, &str); 4] = [
    ("accelerometer_noise_density", "accl_", "angle_random_walk", "m/s^2/sqrt(Hz)"),
    ("accelerometer_random_walk", "accl_", "rate_random_walk", "m/s^3/sqrt(Hz)"),
    ("gyroscope_noise_density", "gyro_", "angle_random_walk", "rad/s/sqrt(Hz)"),
    ("gyroscope_random_walk", "gyro_", "rate_random_walk", "rad/s^2/sqrt(Hz)"),
];

/// The IMU noise model in the YAML of Kalibr, which VINS-Fusion and others read too: of each sensor the root mean square
/// over its axes.
///
/// These programs divide by every number, so the upper bound stands for a term whose estimate is zero. A sensor without
/// channels in the report is left out, with a comment.
#[must_use]
pub fn kalibr(report: &Report) -> String {
    let mut text = String::from(
        "# Noise of the continuous process: the discrete deviation at a rate f is density·sqrt(f), the step walk/sqrt(f).\n",
    );
    // Writing to a string cannot fail.
    for (key, channels, kind, unit) in KALIBR {
        let axes: Vec<(&ChannelReport, f64, bool)> = report
            .channels
            .iter()
            .filter(|channel| channel.name.starts_with(channels))
            .filter_map(|channel| coefficient(channel, kind, unit).map(|parameter| (channel, parameter)))
            .map(|(channel, parameter)| {
                if parameter.value > 0.0 { (channel, parameter.value, true) } else { (channel, parameter.high, false) }
            })
            .collect();
        if axes.is_empty() {
            let _ = writeln!(text, "# {key}: no channel of the record tells it");
            continue;
        }
        let mean_square = axes.iter().map(|(_, value, _)| value * value).sum::<f64>() / axes.len() as f64;
        let _ = writeln!(text, "{key}: {:.6e}  # {unit}", mean_square.sqrt());
        for (channel, value, shown) in axes {
            let bound = if shown { "" } else { ", an upper bound" };
            let _ = writeln!(text, "#   {}: {value:.6e}{bound}", channel.name);
        }
    }
    let _ = writeln!(text, "update_rate: {}  # Hz\nrostopic: /imu0", report.sample_rate_hz);
    text
}

/// The coefficient of the continuous process in `unit`, unless its upper bound is zero.
fn coefficient<'a>(channel: &'a ChannelReport, kind: &str, unit: &str) -> Option<&'a Parameter> {
    let mut coefficients = channel.assessment.coefficients.iter();
    let continuous = coefficients.find(|of| of.kind == kind && !of.discrete && of.value.unit == unit)?;
    Some(&continuous.value).filter(|value| value.high > 0.0)
}
