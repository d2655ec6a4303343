//! An effect of every kind, and of every form of it that has words of its own.

use noise_analysis::bounds::{BoundedEstimate, ChannelEstimate};
use noise_analysis::effects::*;

fn estimate() -> BoundedEstimate {
    BoundedEstimate::new(7.0, 6.0, 8.0)
}

fn size() -> ChannelEstimate {
    estimate().in_unit("deg/s")
}

const CURVE: CurveEvidence = CurveEvidence { excess: 0.1, tau_s: 1.0, sigmas: 9.0, gain_sigmas: 9.0 };

/// A steady line at this frequency, by the spectrum.
pub(super) fn line(frequency_hz: f64) -> SinusoidalLine {
    let spectrum =
        SpectrumEvidence { frequency_hz, is_at_half_rate: false, width_hz: None, sigmas: 220.0, p_value: 1e-30 };
    SinusoidalLine {
        frequency_hz: BoundedEstimate::new(frequency_hz, frequency_hz - 0.1, frequency_hz + 0.1),
        amplitude: size(),
        multiples: None,
        evidence: LineEvidence { has_width: false, source: LineSource::Spectrum(spectrum) },
    }
}

/// An offset of every second sample.
fn alternating() -> SinusoidalLine {
    let line = line(102.4);
    let LineSource::Spectrum(spectrum) = line.evidence.source else { return line };
    let source = LineSource::Spectrum(SpectrumEvidence { is_at_half_rate: true, ..spectrum });
    SinusoidalLine { evidence: LineEvidence { source, ..line.evidence }, ..line }
}

fn resonance(frequency_hz: f64) -> ResonantLine {
    let SinusoidalLine { frequency_hz, evidence, .. } = line(frequency_hz);
    let evidence = LineEvidence { has_width: true, ..evidence };
    ResonantLine { frequency_hz, bandwidth_hz: estimate(), deviation: size(), multiples: None, evidence }
}

fn filter(decimation: f64) -> OutputFilter {
    OutputFilter {
        taps: BoundedEstimate::exact(8.0),
        decimation: BoundedEstimate::exact(decimation),
        white_noise: size(),
        stages: 2,
        internal_rate_hz: 819.2,
        evidence: CURVE,
    }
}

fn modulated(of_phase: bool) -> ModulatedLine {
    ModulatedLine {
        frequency_hz: estimate(),
        amplitude: size(),
        depth: estimate(),
        period_s: estimate(),
        of_phase,
        evidence: ModulationEvidence::Envelope { sigmas: 9.0 },
    }
}

fn unexplained(place: UnexplainedPlace, excess_percent: Option<BoundedEstimate>) -> Unexplained {
    Unexplained { place, excess_percent, observation: Observation::PointOfCurve { p_value: 1e-9 } }
}

/// The effects.
pub(super) fn examples() -> Vec<Effect> {
    let tau = UnexplainedPlace::AveragingTime(estimate());
    let line_of_curve = UnexplainedPlace::LineOfCurve { tau_s: estimate(), frequency_hz: estimate() };
    vec![
        filter(1.0).into(),
        filter(8.95).into(),
        LowPassFilter { bandwidth_hz: estimate(), design: LowPassDesign::Butterworth, evidence: CURVE }.into(),
        line(20.5).into(),
        line(0.12).into(),
        alternating().into(),
        resonance(20.5).into(),
        resonance(0.12).into(),
        modulated(false).into(),
        modulated(true).into(),
        Chirp {
            start_hz: estimate(),
            end_hz: estimate(),
            rate_hz_per_s: estimate(),
            amplitude: size(),
            excess: 1.0,
            p_value: 1e-9,
        }
        .into(),
        Periodic {
            frequency_hz: estimate(),
            amplitude: size(),
            harmonics_percent: estimate(),
            harmonics: vec![0.1; 7],
            sum: 100.0,
            p_value: 1e-9,
        }
        .into(),
        SquareWave {
            frequency_hz: estimate(),
            amplitude: size(),
            multiples: Multiples { harmonics: vec![1, 3], sidebands: 2 },
            line: line(7.0).evidence,
        }
        .into(),
        TelegraphNoise {
            time_constant_s: estimate(),
            amplitude: size(),
            evidence: TelegraphEvidence::Levels { jumps: 80.0, gain: 20.0 },
        }
        .into(),
        ShotNoise {
            rate_per_hour: estimate(),
            size: size(),
            time_constant_s: estimate(),
            deviation: size(),
            sum: 9.0,
            reversed: 1.0,
            p_value: 1e-9,
        }
        .into(),
        MarkovProcess { deviation: size(), time_constant_s: estimate(), evidence: MarkovEvidence::Curve(CURVE) }.into(),
        CommonMode { deviation: size(), time_constant_s: estimate(), others: vec!["gyro_x"], gain: 20.0 }.into(),
        SharedDrift { ratio: size(), per: "g", with: "accl_x", sigmas: 9.0, largest_multiple: 10.0 }.into(),
        LinearDrift { slope: size(), evidence: LinearDriftEvidence::Curve(CURVE) }.into(),
        LevelStep { time_s: estimate(), size: size(), p_value: 1e-9 }.into(),
        TemperatureSensitivity { sensitivity: size(), sigmas: 9.0 }.into(),
        TemperatureCurvature {
            sensitivity: size(),
            curvature: size(),
            reference_degc: 30.0,
            p_value: 1e-9,
            response: ResponseVariance::default(),
        }
        .into(),
        TurnOnTransient {
            size: size(),
            time_constant_s: estimate(),
            p_value: 1e-9,
            response: ResponseVariance::default(),
        }
        .into(),
        ThermalLag {
            sensitivity: size(),
            time_constant_s: estimate(),
            p_value: 1e-9,
            response: ResponseVariance::default(),
        }
        .into(),
        SupplySensitivity { sensitivity: size(), sigmas: 9.0 }.into(),
        AccelerationSensitivity { sensitivity: [Some(size()), None, Some(size())], sigmas: 9.0 }.into(),
        VibrationRectification {
            sensitivity: size(),
            per: "g",
            accelerometer: "accl_x",
            strongest: 0.1,
            p_value: 1e-9,
            response: ResponseVariance::default(),
        }
        .into(),
        AngleQuantization { coefficient: size(), evidence: CURVE }.into(),
        EffectiveLsb { step: size(), counts: 4, values: 1000, changes: 900 }.into(),
        NoiseBelowCount { deviation: size(), counts: 0.1, dithered_counts: 0.3 }.into(),
        Spikes { rate_per_hour: estimate(), size: size(), count: 12, threshold_sigmas: 5.0, largest_sigmas: 9.0 }
            .into(),
        NoisyInterval {
            from_s: estimate(),
            to_s: estimate(),
            level: estimate(),
            tau_s: 1.0,
            p_value: 1e-9,
            channels: vec!["gyro_x"],
        }
        .into(),
        MotionInterval {
            from_s: estimate(),
            to_s: estimate(),
            size: size(),
            scale: MotionScale::BiasError(3.0),
            stretches: 2,
            moved_s: 12,
        }
        .into(),
        MotionInterval {
            from_s: estimate(),
            to_s: estimate(),
            size: size(),
            scale: MotionScale::Scatter(0.3),
            stretches: 2,
            moved_s: 12,
        }
        .into(),
        MissingCodes { codes: 9, spacing: size(), expected: 25_000.0 }.into(),
        Saturation {
            fraction: BoundedEstimate::exact(0.003),
            level: size(),
            is_end_of_range: true,
            cut_off: 300.0,
            samples: 1e5,
            most_of_others: 20,
        }
        .into(),
        LevelChange { time_s: estimate(), ratio: estimate(), explained: 0.9, p_value: 1e-9 }.into(),
        StuckOutput {
            fraction: BoundedEstimate::exact(0.003),
            from_s: estimate(),
            to_s: estimate(),
            runs: 2,
            stuck: 300,
            samples: 100_000,
        }
        .into(),
        DroppedSamples { fraction: estimate(), missing: 12.0, samples: 1e5, gaps: 3 }.into(),
        RepeatedSamples { fraction: estimate(), equal: 12, samples: 1e5, by_chance: 0.1, channels: 6 }.into(),
        ClockDeviation { rate_hz: estimate(), nominal_hz: 819.2, sigmas: 9.0, change: None }.into(),
        ClockDeviation {
            rate_hz: estimate(),
            nominal_hz: 819.2,
            sigmas: 9.0,
            change: Some(RateChange { time_s: estimate(), before_hz: estimate(), after_hz: estimate(), sigmas: 9.0 }),
        }
        .into(),
        unexplained(tau, Some(estimate())).into(),
        unexplained(tau, None).into(),
        unexplained(line_of_curve, Some(estimate())).into(),
        unexplained(UnexplainedPlace::Frequency(estimate()), Some(estimate())).into(),
        unexplained(UnexplainedPlace::Frequency(estimate()), None).into(),
    ]
}
