//! A report made by hand: the curve of known N, B and K, without an estimator or a fit.

use allan_core::NoiseTerm;
use allan_core::model::FittedTerm;
use allan_core::term::Sinusoid;
use noise_analysis::bounds::BoundedEstimate;
use noise_analysis::effects::{CurveEvidence, LineEvidence, LineSource, SinusoidalLine};
use noise_analysis::report::assessment::{
    Assessment, Coefficient, CoefficientsFrom, Innovations, NavigationDrift, RecordLength,
};
use noise_analysis::report::*;
use std::collections::BTreeMap;
use std::f64::consts::{LN_2, PI};

pub(crate) const RATE_HZ: f64 = 100.0;
pub(crate) const SAMPLES: u64 = 1_000_000;

/// The paper's coefficients of a gyroscope: deg/√s, deg/s, deg/s^1.5.
pub(crate) const N: f64 = 0.0368;
pub(crate) const B: f64 = 0.0093;
pub(crate) const K: f64 = 0.0013;

/// IEEE Std 952: σ² = N²/τ + (2 ln 2/π) B² + K² τ/3.
pub(crate) fn model(tau: f64) -> f64 {
    (N * N / tau + 2.0 * LN_2 / PI * B * B + K * K * tau / 3.0).sqrt()
}

/// Six inertial channels; `gyro_z` has a traced sinusoid, `accl_x` has no rate random walk.
pub(crate) fn report() -> Report {
    let channels = [
        ("gyro_x", "deg/s"),
        ("gyro_y", "deg/s"),
        ("gyro_z", "deg/s"),
        ("accl_x", "g"),
        ("accl_y", "g"),
        ("accl_z", "g"),
    ];
    let mut channels: Vec<ChannelReport> = channels.iter().map(|(name, unit)| channel(name, unit)).collect();
    channels[3].read_off.rate_random_walk = None;
    trace_sinusoid(&mut channels[2]);
    let dropped = [("gap", 212), ("no_new_data", 3)];
    Report {
        schema: SCHEMA,
        quick: false,
        sample_rate_hz: RATE_HZ,
        samples: SAMPLES,
        dropped: dropped.map(|(cause, samples)| (cause.to_owned(), samples)).into(),
        flagged: [("repeated".to_owned(), 1804)].into(),
        part: PartReport::default(),
        findings: Vec::new(),
        common_mode: None,
        longest_at_rest: None,
        channels,
    }
}

pub(crate) fn empty() -> Report {
    let mut report = report();
    report.samples = 1;
    report.dropped = BTreeMap::new();
    report.flagged = BTreeMap::new();
    report.channels.truncate(1);
    let channel = &mut report.channels[0];
    channel.samples = 1;
    channel.curve.clear();
    channel.unseen_adev.clear();
    channel.read_off = SlopeMethodReport { angle_random_walk: None, bias_instability: None, rate_random_walk: None };
    let error = ModelErrorReport::default();
    channel.before = ModelReport {
        terms: vec![],
        adev: vec![],
        fitted: error.clone(),
        unseen: error,
        unseen_excluding: None,
        events: None,
    };
    channel.after = channel.before.clone();
    channel.refitted = channel.before.clone();
    channel.assessment = Assessment::default();
    report
}

pub(crate) fn channel(name: &str, unit: &str) -> ChannelReport {
    let scale = if unit == "g" { 1e-3 } else { 1.0 };
    let curve: Vec<CurvePoint> = (0..18).map(|octave| point(octave, scale)).collect();
    let baseline = ModelReport {
        terms: [(NoiseTerm::AngleRandomWalk, N), (NoiseTerm::BiasInstability, B), (NoiseTerm::RateRandomWalk, K)]
            .map(|(kind, value)| term(kind, value * scale, unit))
            .into(),
        adev: curve.iter().map(|point| scale * model(point.tau_s)).collect(),
        fitted: error(1.042, 2.317),
        unseen: error(1.385, 3.946),
        unseen_excluding: None,
        events: None,
    };
    let value = |value: f64, per: &str, from_s: f64, to_s: f64| {
        Some(SlopeMethodValue { value: value * scale, unit: rate_unit(unit, per), from_s, to_s })
    };
    // The second half lacks the longest averaging time.
    let unseen_adev = curve[..17].iter().map(|point| 1.05 * point.adev).collect();
    ChannelReport {
        unseen_adev,
        name: name.to_owned(),
        unit: unit.to_owned(),
        samples: SAMPLES,
        missing: Default::default(),
        curve,
        read_off: SlopeMethodReport {
            angle_random_walk: value(0.037_14, "/sqrt(s)", 0.01, 2.56),
            bias_instability: value(0.014_30, "", 40.96, 81.92),
            rate_random_walk: value(0.001_217, "/s/sqrt(s)", 327.68, 1310.72),
        },
        before: baseline.clone(),
        effects: vec![],
        after: baseline.clone(),
        first_half_curve: error(1.711, 4.112),
        refitted: baseline,
        nonstationarity: None,
        at_rest: vec![],
        assessment: assessment(scale),
        figure_data: Default::default(),
    }
}

fn error(deviance: f64, rms: f64) -> ModelErrorReport {
    ModelErrorReport {
        deviance_per_point: Some(deviance),
        rms_percent: Some(rms),
        worst_sigma: Some(-1.876),
        worst_tau_s: Some(10.24),
        worst_ratio: Some(1.02),
        ..ModelErrorReport::default()
    }
}

/// Numbers that occur nowhere else.
fn assessment(scale: f64) -> Assessment {
    let parameter = |value: f64, unit: &str| Parameter {
        value: scale * value,
        low: scale * value * 0.9,
        high: scale * value * 1.1,
        unit: unit.to_owned(),
    };
    let coefficient = |discrete, value| Coefficient { kind: "angle_random_walk".to_owned(), discrete, value };
    Assessment {
        coefficients: vec![
            coefficient(false, parameter(2.208, "deg/sqrt(h)")),
            coefficient(true, parameter(0.3681, "deg/s")),
        ],
        drift: [10.0, 600.0]
            .map(|seconds| NavigationDrift {
                seconds,
                calibration_s: 60.0,
                predicted: scale * 0.017 * seconds,
                observed: (seconds < 100.0).then(|| parameter(0.0181 * seconds, "deg")),
                unit: "deg".to_owned(),
            })
            .into(),
        innovations: Some(Innovations {
            count: 14_321,
            normalised: 1.007,
            low: 0.977,
            high: 1.023,
            correlation: 0.002,
            whiteness_p: 0.4321,
        }),
        coefficients_from: CoefficientsFrom::OctavesAgainstSamples,
        record: [("bias_instability", Some(7.5)), ("rate_random_walk", None)]
            .map(|(kind, more_hours)| RecordLength { kind: kind.to_owned(), half_s: None, more_hours })
            .into(),
        ..Assessment::default()
    }
}

/// `deg/s` divided by √s is written `deg/sqrt(s)`.
fn rate_unit(unit: &str, per: &str) -> String {
    match (unit, per) {
        (unit, "") => unit.to_owned(),
        ("deg/s", "/sqrt(s)") => "deg/sqrt(s)".to_owned(),
        (unit, "/s/sqrt(s)") => format!("{unit}/sqrt(s)"),
        (unit, per) => format!("{unit}{per}").replace("sqrt(s)", "sqrt(Hz)"),
    }
}

pub(crate) fn term(kind: NoiseTerm, value: f64, unit: &str) -> TermReport {
    TermReport::new(&FittedTerm::exact(kind, value).with_bounds(value * 0.94, value * 1.07), unit)
}

/// About `1.5·N/n` degrees of freedom, and a wobble inside the interval.
fn point(octave: u32, scale: f64) -> CurvePoint {
    let n = 1u64 << octave;
    let tau_s = n as f64 / RATE_HZ;
    let edf = 1.5 * SAMPLES as f64 / n as f64;
    let spread = 1.96 / (2.0 * edf).sqrt();
    let wobble = 0.6 * spread * (f64::from(octave) * 2.4).sin();
    let adev = scale * model(tau_s) * (1.0 + wobble);
    CurvePoint {
        n,
        tau_s,
        adev,
        low: adev / (1.0 + spread),
        high: adev * (1.0 + 1.3 * spread),
        edf,
        replaced_percent: 0.0,
        adev_by_spectrum: (16 * n <= SAMPLES).then_some(1.003 * adev),
        rounding: 0.0,
        accuracy_percent: 100.0 / (2.0 * (SAMPLES as f64 / n as f64 - 1.0)).sqrt(),
    }
}

/// A line at 0.7 Hz: σ = A·sin²(πfτ)/(πfτ).
fn trace_sinusoid(channel: &mut ChannelReport) {
    const AMPLITUDE: f64 = 0.09;
    const FREQUENCY_HZ: f64 = 0.7;
    let line = |tau: f64| {
        let phase = PI * FREQUENCY_HZ * tau;
        AMPLITUDE * phase.sin().powi(2) / phase
    };
    channel.after.adev = channel.curve.iter().map(|p| model(p.tau_s).hypot(line(p.tau_s))).collect();
    for (point, after) in channel.curve.iter_mut().zip(&channel.after.adev) {
        let factor = after / model(point.tau_s);
        point.adev *= factor;
        point.low *= factor;
        point.high *= factor;
    }
    let sinusoid = term(NoiseTerm::Sinusoid(Sinusoid { frequency: FREQUENCY_HZ }), AMPLITUDE, "deg/s");
    let curve = CurveEvidence { excess: 0.41, tau_s: 0.64, sigmas: 33.0, gain_sigmas: 14.6 };
    let line = SinusoidalLine {
        frequency_hz: BoundedEstimate::exact(FREQUENCY_HZ),
        amplitude: BoundedEstimate::exact(AMPLITUDE).in_unit("deg/s"),
        multiples: None,
        evidence: LineEvidence { has_width: false, source: LineSource::Curve(curve) },
    };
    channel.effects = vec![ChannelEffect { effect: line.into(), finding: 0 }];
    channel.after.terms.push(sinusoid);
    channel.before.unseen.rms_percent = Some(21.84);
    channel.before.fitted.rms_percent = Some(22.03);
    channel.before.unseen.deviance_per_point = Some(4512.0);
    channel.before.fitted.deviance_per_point = Some(4606.0);
    channel.refitted = channel.after.clone();
}
