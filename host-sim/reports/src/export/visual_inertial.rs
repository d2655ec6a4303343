//! Kalibr, OpenVINS, VINS-Fusion and ORB-SLAM3: white noise and random walk, one number a sensor.

use super::exported_file::{AxisChoice, Export, ExportError, rate, scientific};
use super::inertial_noise::{AxisNoise, Coefficient, Sensor, combine};
use crate::saved_report::SavedReport;
use std::fmt::Write;

struct Field {
    key: &'static str,
    sensor: Sensor,
    of: fn(&AxisNoise<'_>) -> Option<Coefficient>,
    unit: &'static str,
    /// Factor on the coefficient of the continuous process.
    factor: f64,
}

const WHITE: fn(&AxisNoise<'_>) -> Option<Coefficient> = |axis| axis.white;
const WALK: fn(&AxisNoise<'_>) -> Option<Coefficient> = |axis| axis.walk;

/// Kalibr and OpenVINS: the continuous process.
const KALIBR: [Field; 4] = [
    field("accelerometer_noise_density", Sensor::Accelerometer, WHITE, "m/s^2/sqrt(Hz)"),
    field("accelerometer_random_walk", Sensor::Accelerometer, WALK, "m/s^3/sqrt(Hz)"),
    field("gyroscope_noise_density", Sensor::Gyroscope, WHITE, "rad/s/sqrt(Hz)"),
    field("gyroscope_random_walk", Sensor::Gyroscope, WALK, "rad/s^2/sqrt(Hz)"),
];

/// ORB-SLAM3: continuous; it multiplies white noise by sqrt(f) and divides the random walk by it.
const ORB_SLAM3: [Field; 4] = [
    field("IMU.NoiseGyro", Sensor::Gyroscope, WHITE, "rad/s/sqrt(Hz)"),
    field("IMU.NoiseAcc", Sensor::Accelerometer, WHITE, "m/s^2/sqrt(Hz)"),
    field("IMU.GyroWalk", Sensor::Gyroscope, WALK, "rad/s^2/sqrt(Hz)"),
    field("IMU.AccWalk", Sensor::Accelerometer, WALK, "m/s^3/sqrt(Hz)"),
];

const fn field(
    key: &'static str,
    sensor: Sensor,
    of: fn(&AxisNoise<'_>) -> Option<Coefficient>,
    unit: &'static str,
) -> Field {
    Field { key, sensor, of, unit, factor: 1.0 }
}

pub(super) fn kalibr(report: &SavedReport, axes: AxisChoice) -> Result<Export, ExportError> {
    let head = "# Kalibr imu.yaml. Noise of the continuous process: the discrete deviation at a rate f is density*sqrt(f), the step walk/sqrt(f).\n";
    let mut export = fields(head, &KALIBR, "", report, axes)?;
    let _ = writeln!(export.text, "update_rate: {}  # Hz\nrostopic: /imu0", rate(report.sample_rate_hz));
    Ok(export)
}

pub(super) fn openvins(report: &SavedReport, axes: AxisChoice) -> Result<Export, ExportError> {
    let head = "%YAML:1.0\n# OpenVINS kalibr_imu_chain.yaml. Noise of the continuous process.\n\
                # Not measured here: T_i_b, time_offset and the intrinsic matrices, which stand for a perfectly calibrated sensor.\n\n\
                imu0:\n  T_i_b:\n    - [1.0, 0.0, 0.0, 0.0]\n    - [0.0, 1.0, 0.0, 0.0]\n    - [0.0, 0.0, 1.0, 0.0]\n    - [0.0, 0.0, 0.0, 1.0]\n";
    let mut export = fields(head, &KALIBR, "  ", report, axes)?;
    let _ = writeln!(
        export.text,
        "  rostopic: /imu0\n  time_offset: 0.0\n  update_rate: {:?}\n  model: \"kalibr\"",
        rate(report.sample_rate_hz)
    );
    for (matrix, diagonal) in [("Tw", 1.0), ("R_IMUtoGYRO", 1.0), ("Ta", 1.0), ("R_IMUtoACC", 1.0), ("Tg", 0.0)] {
        let _ = writeln!(export.text, "  {matrix}:");
        for row in 0..3 {
            let [x, y, z] = std::array::from_fn(|column| if column == row { diagonal } else { 0.0 });
            let _ = writeln!(export.text, "    - [{x:?}, {y:?}, {z:?}]");
        }
    }
    Ok(export)
}

/// The covariance takes both times dt² a step (`V·noise·Vᵀ`), so both are deviations of samples: N·√f and K·√f.
pub(super) fn vins(report: &SavedReport, axes: AxisChoice) -> Result<Export, ExportError> {
    let rate = report.sample_rate_hz;
    let sampled = |key, sensor, of, unit| Field { factor: rate.sqrt(), ..field(key, sensor, of, unit) };
    let fields_of = [
        sampled("acc_n", Sensor::Accelerometer, WHITE, "m/s^2"),
        sampled("gyr_n", Sensor::Gyroscope, WHITE, "rad/s"),
        sampled("acc_w", Sensor::Accelerometer, WALK, "m/s^3"),
        sampled("gyr_w", Sensor::Gyroscope, WALK, "rad/s^2"),
    ];
    let head = format!(
        "%YAML:1.0\n# The IMU's part of a VINS-Mono or VINS-Fusion configuration. Discrete: deviations of samples at {rate} Hz.\n\
         # VINS multiplies both noises by the sample period, so acc_n = N*sqrt(f) and acc_w = K*sqrt(f). Write it anew for another rate.\n\n"
    );
    fields(&head, &fields_of, "", report, axes)
}

pub(super) fn orbslam3(report: &SavedReport, axes: AxisChoice) -> Result<Export, ExportError> {
    let head = "%YAML:1.0\n# The IMU's part of ORB-SLAM3's settings. Noise of the continuous process: ORB-SLAM3 multiplies and divides by sqrt(IMU.Frequency) itself.\n\n";
    let mut export = fields(head, &ORB_SLAM3, "", report, axes)?;
    let _ = writeln!(export.text, "IMU.Frequency: {}  # Hz", rate(report.sample_rate_hz));
    Ok(export)
}

/// `head` and every field, with its axes in comments; an upper bound stands for an unknown term.
fn fields(
    head: &str,
    fields: &[Field],
    indent: &str,
    report: &SavedReport,
    choice: AxisChoice,
) -> Result<Export, ExportError> {
    let [gyroscopes, accelerometers] = [Sensor::Gyroscope, Sensor::Accelerometer].map(|sensor| sensor.axes(report));
    if gyroscopes.is_empty() && accelerometers.is_empty() {
        return Err(ExportError::NoInertialChannel);
    }
    let (mut text, mut missing) = (head.to_owned(), Vec::new());
    for Field { key, sensor, of, unit, factor } in fields {
        let axes = if *sensor == Sensor::Gyroscope { &gyroscopes } else { &accelerometers };
        let shown = axes.iter().filter_map(|axis| of(axis).map(|of| (&axis.channel.name, of)));
        let Some(value) = combine(shown.clone().map(|(_, of)| of.value), choice) else {
            let _ = writeln!(text, "{indent}# {key}: no channel of the record tells it");
            missing.push((*key).to_owned());
            continue;
        };
        let how = match choice {
            AxisChoice::Rms => "root mean square",
            AxisChoice::Worst => "worst axis",
        };
        let has_bound = shown.clone().any(|(_, of)| of.is_bound);
        let at_most = if has_bound { "an upper bound, " } else { "" };
        let _ = writeln!(text, "{indent}{key}: {}  # {unit}, {at_most}{how} of", scientific(value * factor));
        for (channel, of) in shown {
            let bound = if of.is_bound { ", an upper bound" } else { "" };
            let _ = writeln!(text, "{indent}#   {channel}: {}{bound}", scientific(of.value * factor));
        }
    }
    Ok(Export { text, missing })
}
