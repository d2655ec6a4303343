//! The noise of a sensor in the file formats of other programs; `docs/exports.md` has the sources.

mod exported_file;
mod filters;
mod inertial_noise;
mod simulators;
mod visual_inertial;

pub use exported_file::{AxisChoice, Export, ExportError};

use crate::coefficients::KINDS;
use crate::saved_report::{SavedChannel, SavedReport};
use crate::summary::{HIGH_DEVIANCE, deviance_per_point, is_inertial};
use std::fmt::Write;

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum ExportFormat {
    /// `imu.yaml` of Kalibr.
    Kalibr,
    /// `kalibr_imu_chain.yaml` of OpenVINS.
    #[value(name = "openvins")]
    OpenVins,
    /// The IMU's lines in the settings of VINS-Mono and -Fusion.
    Vins,
    /// The IMU's lines in the settings of ORB-SLAM3.
    #[value(name = "orbslam3")]
    OrbSlam3,
    /// A script for MATLAB with `gyroparams` and `accelparams`.
    Matlab,
    /// The block `imunoise` in the configuration of KF-GINS.
    KfGins,
    /// A Python module: GTSAM's `PreintegrationCombinedParams`.
    Gtsam,
    /// The IMU's noise in the calibration file of Basalt.
    Basalt,
    /// A Gazebo model with an IMU sensor, in SDF.
    Gazebo,
    /// A table of all parameters of all channels with bounds.
    Csv,
}

/// Writes the noise of a report in a format.
///
/// # Errors
/// See [`ExportError`].
pub fn export(report: &SavedReport, format: ExportFormat, axes: AxisChoice) -> Result<Export, ExportError> {
    check(report)?;
    let is_of_samples =
        !matches!(format, ExportFormat::Kalibr | ExportFormat::OpenVins | ExportFormat::OrbSlam3 | ExportFormat::Csv);
    if is_of_samples && let Some(other) = report.other_rates_hz.first() {
        return Err(ExportError::SeveralRates(format!("{} and {other}", report.sample_rate_hz)));
    }
    let export = match format {
        ExportFormat::Kalibr => visual_inertial::kalibr(report, axes),
        ExportFormat::OpenVins => visual_inertial::openvins(report, axes),
        ExportFormat::Vins => visual_inertial::vins(report, axes),
        ExportFormat::OrbSlam3 => visual_inertial::orbslam3(report, axes),
        ExportFormat::Matlab => simulators::matlab(report),
        ExportFormat::Gazebo => simulators::gazebo(report),
        ExportFormat::KfGins => filters::kf_gins(report),
        ExportFormat::Gtsam => filters::gtsam(report),
        ExportFormat::Basalt => filters::basalt(report),
        ExportFormat::Csv => Ok(Export { text: table(report), missing: Vec::new() }),
    }?;
    Ok(Export { text: warned(export.text, report, format), ..export })
}

/// `text` with a comment on failing models after the first line.
fn warned(text: String, report: &SavedReport, format: ExportFormat) -> String {
    let error = |channel: &SavedChannel| channel.unseen_error.filter(|of| *of > HIGH_DEVIANCE);
    let inertial = report.channels.iter().filter(|channel| is_inertial(&channel.name));
    let failing = inertial.filter_map(|of| Some(format!("{} {}", of.name, deviance_per_point(error(of)?))));
    let failing: Vec<String> = failing.collect();
    if failing.is_empty() {
        return text;
    }
    let warning = format!(
        "WARNING: models that fail on the half of the record that they were not fitted to, with their errors (1 is that of a true model): {}",
        failing.join(", ")
    );
    let after_first_line = |comment: String| text.replacen('\n', &format!("\n{comment}\n"), 1);
    match format {
        ExportFormat::Csv => text,
        ExportFormat::Basalt => text.replacen("\"comment\": \"", &format!("\"comment\": \"{warning}; "), 1),
        ExportFormat::Gazebo => after_first_line(format!("<!-- {warning} -->")),
        ExportFormat::Matlab => after_first_line(format!("% {warning}")),
        _ => after_first_line(format!("# {warning}")),
    }
}

/// Largest coefficient; larger ones overflow in a change of units.
const MAX_COEFFICIENT: f64 = 1e30;

/// Refuses what a file of another program cannot represent.
fn check(report: &SavedReport) -> Result<(), ExportError> {
    let name = |text: &String| {
        let is_name = text.chars().all(|c| c.is_alphanumeric() || " _-./^*()[]%°".contains(c));
        if is_name { Ok(()) } else { Err(ExportError::NoName(text.clone())) }
    };
    for channel in &report.channels {
        name(&channel.name)?;
        for term in &channel.refitted.terms {
            name(&term.kind)?;
            let least = if KINDS.contains(&term.kind.as_str()) { 0.0 } else { -MAX_COEFFICIENT };
            for (parameter, of) in &term.parameters {
                name(parameter)?;
                name(&of.unit)?;
                if !(least..=MAX_COEFFICIENT).contains(&of.value) {
                    let (channel, term) = (channel.name.clone(), term.kind.clone());
                    let (parameter, value) = (parameter.clone(), format!("{:e}", of.value));
                    return Err(ExportError::NoCoefficient { channel, term, parameter, value });
                }
            }
        }
    }
    Ok(())
}

fn table(report: &SavedReport) -> String {
    let mut text = String::from("channel,term,parameter,value,low,high,unit\n");
    for channel in &report.channels {
        for term in &channel.refitted.terms {
            for (name, of) in &term.parameters {
                let _ = writeln!(
                    text,
                    "{},{},{name},{:e},{:e},{:e},{}",
                    channel.name, term.kind, of.value, of.low, of.high, of.unit
                );
            }
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::{AxisChoice, ExportError, ExportFormat, export};
    use crate::saved_report::SavedReport;
    use clap::ValueEnum;

    fn report(value: &str, name: &str) -> SavedReport {
        let term = format!(
            r#"{{"kind":"angle_random_walk","parameters":{{"value":{{"value":{value},"low":0.0,"high":null,"unit":"deg/sqrt(s)"}}}}}}"#
        );
        let channel = |name: &str, unit: &str| {
            format!(r#"{{"name":"{name}","unit":"{unit}","curve":[],"final":{{"terms":[{term}],"adev":[]}}}}"#)
        };
        let axes =
            |sensor: &str, unit: &str| ["x", "y", "z"].map(|axis| channel(&format!("{sensor}_{axis}"), unit)).join(",");
        let own = channel(name, "deg/s");
        let channels = [axes("gyro", "deg/s"), axes("accl", "g"), own].join(",");
        SavedReport::from_json(&format!(r#"{{"schema":2,"sample_rate_hz":100.0,"channels":[{channels}]}}"#))
            .expect("a report")
    }

    #[test]
    fn a_model_that_fails_is_named_in_the_file() {
        let mut failing = report("0.01", "gyro_w");
        let written = |report: &SavedReport, format| export(report, format, AxisChoice::Rms).map(|export| export.text);
        let sound = failing.clone();
        failing.channels[0].unseen_error = Some(14.2);
        failing.channels[1].unseen_error = Some(1.4);
        for format in ExportFormat::value_variants() {
            let (Ok(before), Ok(after)) = (written(&sound, *format), written(&failing, *format)) else { continue };
            assert!(!before.contains("WARNING"), "{before}");
            let is_told = after.contains("errors (1 is that of a true model): gyro_x 14");
            assert!(is_told == (*format != ExportFormat::Csv) && !after.contains("gyro_y 1"), "{after}");
            assert_eq!(before.lines().next(), after.lines().next());
        }
    }

    #[test]
    fn a_coefficient_whose_interval_begins_at_zero_is_an_upper_bound() {
        let mut known = report("0.01", "gyro_w");
        for channel in &mut known.channels {
            let of = channel.refitted.terms[0].parameters.get_mut("value").expect("a coefficient");
            (of.low, of.high) = if channel.name == "gyro_x" { (0.0, 0.05) } else { (0.009, 0.011) };
        }
        let text = export(&known, ExportFormat::Kalibr, AxisChoice::Worst).expect("a file").text;
        // 0.05 and 0.01 deg in rad.
        assert!(text.contains("gyro_x: 8.727e-4, an upper bound\n") && text.contains("gyro_y: 1.745e-4\n"), "{text}");
        assert!(
            text.contains("gyroscope_noise_density: 8.727e-4  # rad/s/sqrt(Hz), an upper bound, worst axis of"),
            "{text}"
        );
        assert!(text.contains("# m/s^2/sqrt(Hz), worst axis of"), "{text}");
    }

    /// A report may have been changed by hand.
    #[test]
    fn impossible_numbers_and_names_are_refused_by_every_format() {
        for format in ExportFormat::value_variants() {
            let written = |value: &str, name: &str| export(&report(value, name), *format, AxisChoice::Rms);
            // A format may ask for missing terms.
            let sound = written("0.01", "gyro_w");
            let is_refused = matches!(sound, Err(ExportError::NoCoefficient { .. } | ExportError::NoName(_)));
            assert!(!is_refused, "{format:?}");
            for value in ["-1e308", "1e308", "-0.01"] {
                let refused = written(value, "gyro_w");
                assert!(matches!(refused, Err(ExportError::NoCoefficient { .. })), "{format:?} of {value}");
            }
            for name in [r"gyro\u001b[31m", r"gyro\n_x", "gyro,x", r"gyro\u202e"] {
                let refused = written("0.01", name);
                assert!(matches!(refused, Err(ExportError::NoName(_))), "{format:?} of {name}");
            }
        }
    }
}
