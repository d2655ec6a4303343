//! Units by gravity and common gyroscopes.

use crate::inspection::column_facts::ColumnFacts;
use std::f64::consts::PI;
use time_base::quantile;

/// Bias and scale of a cheap sensor.
const GRAVITY_TOLERANCE: f64 = 0.05;
const GRAVITY: [(f64, &str); 3] = [(9.806_65, "m/s^2"), (1.0, "g"), (1000.0, "mg")];
/// 16 bits at 2 to 16 g, fewer bits, mm/s².
#[rustfmt::skip]
const GRAVITY_IN_COUNTS: [(f64, &str); 7] = [
    (16_384.0, "g/16384"), (8192.0, "g/8192"), (4096.0, "g/4096"), (2048.0, "g/2048"), (1024.0, "g/1024"), (256.0, "g/256"),
    (9806.65, "m/s^2/1000"),
];

/// LSB per deg/s: InvenSense MPU and ICM, Bosch BMI and BMG.
const LSB_PER_DEG_S: [f64; 10] = [262.4, 262.144, 131.0, 131.072, 65.5, 65.536, 32.8, 32.768, 16.4, 16.384];
/// deg/s per LSB: ST L3G and LSM6.
const DEG_S_PER_LSB: [f64; 5] = [4.375e-3, 8.75e-3, 17.5e-3, 35e-3, 70e-3];
const SAME_STEP: f64 = 1e-3;
/// 3 deg/s: above any gyroscope at rest.
const NO_RAD_S_ABOVE: f64 = 0.05;
/// 0.6 deg/s. Cheap gyroscopes have 0.015 to 1 deg/s, or 0.00026 to 0.017 rad/s.
const LIKELY_RAD_S_BELOW: f64 = 0.01;

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct UnitGuess {
    pub(crate) unit: &'static str,
    pub(crate) reason: String,
    pub(crate) is_safe: bool,
}

/// Block means: may be turned between rests.
pub(crate) fn usual_length(axes: &[&ColumnFacts]) -> f64 {
    let blocks = axes.iter().map(|axis| axis.blocks.len()).min().unwrap_or(0);
    let length = |block: usize| axes.iter().map(|axis| axis.blocks[block].powi(2)).sum::<f64>().sqrt();
    let mut lengths: Vec<f64> = (0..blocks).map(length).filter(|length| length.is_finite()).collect();
    quantile(&mut lengths, 1, 2)
}

pub(crate) fn force_unit(axes: &[&ColumnFacts]) -> Option<UnitGuess> {
    let length = usual_length(axes);
    let are_whole = axes.iter().all(|axis| axis.is_whole());
    let known = GRAVITY.iter().chain(GRAVITY_IN_COUNTS.iter().filter(|_| are_whole));
    let (_, unit) =
        known.filter(|_| axes.len() == 3).find(|(size, _)| (length / size - 1.0).abs() < GRAVITY_TOLERANCE)?;
    Some(UnitGuess {
        unit,
        reason: format!("the three are {length:.4} long together, which is gravity in {unit}"),
        is_safe: true,
    })
}

/// By step, noise, or the forces' unit.
pub(crate) fn rate_unit(axes: &[&ColumnFacts], force: Option<&str>) -> UnitGuess {
    const UNITS: [(&str, f64); 2] = [("deg/s", 1.0), ("rad/s", PI / 180.0)];
    let sensitivities = || LSB_PER_DEG_S.iter().map(|lsb| lsb.recip()).chain(DEG_S_PER_LSB);
    let is_known = |step: f64, factor: f64| {
        sensitivities().any(|sensitivity| (step / (sensitivity * factor) - 1.0).abs() < SAME_STEP)
    };
    for step in axes.iter().filter_map(|axis| axis.step) {
        if let Some((unit, factor)) = UNITS.into_iter().find(|(_, factor)| is_known(step, *factor)) {
            let lsb = factor / step;
            let reason = format!("the step {step:.6e} is {lsb:.1} LSB per deg/s in {unit}");
            return UnitGuess { unit, reason, is_safe: true };
        }
    }
    if axes.iter().any(|axis| axis.is_whole()) {
        let reason = "whole numbers, counts of an unknown size: 1 is taken as 1 deg/s; if 131 counts are 1 deg/s, write deg/s/131";
        return UnitGuess { unit: "deg/s", reason: reason.to_owned(), is_safe: false };
    }
    let noise = axes.iter().map(|axis| axis.noise).fold(0.0, f64::max);
    if noise > NO_RAD_S_ABOVE {
        let reason = format!("a noise of {noise:.2e} rad/s would be that of no gyroscope");
        return UnitGuess { unit: "deg/s", reason, is_safe: true };
    }
    match force {
        Some("m/s^2") => {
            let reason = format!("the forces are in SI units, and the noise is {noise:.2e}");
            UnitGuess { unit: "rad/s", reason, is_safe: true }
        }
        _ if noise < LIKELY_RAD_S_BELOW && force.is_none() => UnitGuess {
            unit: "rad/s",
            reason: format!("the noise is {noise:.2e}, which may be deg/s too"),
            is_safe: false,
        },
        _ => UnitGuess {
            unit: "deg/s",
            reason: format!("the noise is {noise:.2e}, which may be rad/s too"),
            is_safe: false,
        },
    }
}
