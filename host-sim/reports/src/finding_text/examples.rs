//! Effects of every kind and form, for `docs/findings.md`.

use noise_analysis::bounds::{BoundedEstimate, ChannelEstimate};
use noise_analysis::effects::*;

const fn exact(value: f64) -> BoundedEstimate {
    BoundedEstimate::exact(value)
}

fn about(value: f64, distance: f64) -> BoundedEstimate {
    BoundedEstimate::new(value, value - distance, value + distance)
}

fn rate(value: f64, distance: f64) -> ChannelEstimate {
    about(value, distance).in_unit("deg/s")
}

fn acceleration(value: f64, distance: f64) -> ChannelEstimate {
    about(value, distance).in_unit("g")
}

/// A time in the record, s.
const MOMENT: BoundedEstimate = exact(740.0);

const CURVE: CurveEvidence = CurveEvidence { excess: 0.1, tau_s: 1.0, sigmas: 9.0, gain_sigmas: 9.0 };

fn line_of(frequency_hz: BoundedEstimate, amplitude: ChannelEstimate) -> SinusoidalLine {
    let spectrum = SpectrumEvidence {
        frequency_hz: frequency_hz.value,
        is_at_half_rate: false,
        width_hz: None,
        sigmas: 220.0,
        p_value: 1e-30,
    };
    let evidence = LineEvidence { has_width: false, source: LineSource::Spectrum(spectrum) };
    SinusoidalLine { frequency_hz, amplitude, multiples: None, evidence }
}

pub(super) fn line(frequency_hz: f64) -> SinusoidalLine {
    line_of(about(frequency_hz, 0.1), rate(0.2, 0.01))
}

/// An offset of every second sample.
fn alternating() -> SinusoidalLine {
    let line = line_of(about(102.4, 0.3), acceleration(0.2, 0.03));
    let LineSource::Spectrum(spectrum) = line.evidence.source else { return line };
    let source = LineSource::Spectrum(SpectrumEvidence { is_at_half_rate: true, ..spectrum });
    SinusoidalLine { evidence: LineEvidence { source, ..line.evidence }, ..line }
}

fn resonance(frequency_hz: BoundedEstimate, bandwidth_hz: f64, deviation: ChannelEstimate) -> ResonantLine {
    let SinusoidalLine { frequency_hz, evidence, .. } = line_of(frequency_hz, deviation);
    let evidence = LineEvidence { has_width: true, ..evidence };
    ResonantLine { frequency_hz, bandwidth_hz: exact(bandwidth_hz), deviation, multiples: None, evidence }
}

fn filter(taps: f64, decimation: BoundedEstimate) -> OutputFilter {
    OutputFilter {
        taps: exact(taps),
        decimation,
        white_noise: rate(0.5, 0.01),
        stages: 2,
        internal_rate_hz: 819.2,
        evidence: CURVE,
    }
}

fn modulated(depth: BoundedEstimate, of_phase: bool) -> ModulatedLine {
    ModulatedLine {
        frequency_hz: about(7.3, 0.002),
        amplitude: acceleration(0.3, 0.02),
        depth,
        period_s: about(75.5, 1.1),
        of_phase,
        evidence: ModulationEvidence::Envelope { sigmas: 9.0 },
    }
}

fn motion(to_s: f64, scale: MotionScale, stretches: usize, moved_s: usize) -> MotionInterval {
    MotionInterval { from_s: MOMENT, to_s: exact(to_s), size: rate(40.0, 1.0), scale, stretches, moved_s }
}

fn unexplained(place: UnexplainedPlace, excess_percent: Option<BoundedEstimate>) -> Unexplained {
    Unexplained { place, excess_percent, observation: Observation::PointOfCurve { p_value: 1e-9 } }
}

pub(super) fn examples() -> Vec<Effect> {
    let tau = UnexplainedPlace::AveragingTime(exact(80.0));
    let line_of_curve = UnexplainedPlace::LineOfCurve { tau_s: exact(80.0), frequency_hz: exact(0.005) };
    let band = UnexplainedPlace::Frequency(exact(20.0));
    let excess = about(9.0, 2.0);
    let response = ResponseVariance::default;
    vec![
        filter(8.0, about(8.95, 0.02)).into(),
        filter(4.0, exact(1.0)).into(),
        LowPassFilter { bandwidth_hz: about(50.0, 3.0), design: LowPassDesign::Butterworth, evidence: CURVE }.into(),
        line(20.5).into(),
        line_of(about(0.012, 0.0004), acceleration(250e-6, 30e-6)).into(),
        alternating().into(),
        resonance(about(22.1, 0.2), 0.72, acceleration(660e-6, 90e-6)).into(),
        resonance(about(0.012, 0.0004), 0.001, acceleration(250e-6, 30e-6)).into(),
        modulated(about(0.5, 0.1), false).into(),
        modulated(about(0.5, 0.1), true).into(),
        Chirp {
            start_hz: about(4.1, 0.08),
            end_hz: about(8.02, 0.08),
            rate_hz_per_s: about(0.0098, 0.0004),
            amplitude: acceleration(0.15, 0.012),
            excess: 1.0,
            p_value: 1e-9,
        }
        .into(),
        Periodic {
            frequency_hz: about(0.025, 0.0003),
            amplitude: acceleration(0.095, 0.009),
            harmonics_percent: about(50.0, 5.0),
            harmonics: vec![0.1; 7],
            sum: 100.0,
            p_value: 1e-9,
        }
        .into(),
        SquareWave {
            frequency_hz: about(0.54, 0.002),
            amplitude: acceleration(900e-6, 50e-6),
            multiples: Multiples { harmonics: vec![1, 3], sidebands: 2 },
            line: line(0.54).evidence,
        }
        .into(),
        TelegraphNoise {
            time_constant_s: BoundedEstimate::new(3.0, 2.1, 4.4),
            amplitude: rate(0.02, 0.002),
            evidence: TelegraphEvidence::Levels { jumps: 80.0, gain: 20.0 },
        }
        .into(),
        ShotNoise {
            rate_per_hour: BoundedEstimate::new(180.0, 90.0, 360.0),
            size: acceleration(0.03, 0.006),
            time_constant_s: about(1.5, 0.2),
            deviation: acceleration(0.01, 0.001),
            sum: 9.0,
            reversed: 1.0,
            p_value: 1e-9,
        }
        .into(),
        MarkovProcess {
            deviation: rate(0.127, 0.018),
            time_constant_s: BoundedEstimate::new(0.022, 0.017, 0.029),
            evidence: MarkovEvidence::Curve(CURVE),
        }
        .into(),
        CommonMode {
            deviation: rate(0.01, 0.001),
            time_constant_s: about(100.0, 20.0),
            others: vec!["gyro_x"],
            gain: 20.0,
        }
        .into(),
        SharedDrift { ratio: rate(2.9, 0.6), per: "g", with: "accl_x", sigmas: 9.0, largest_multiple: 10.0 }.into(),
        LinearDrift { slope: rate(1.2e-6, 0.1e-6), evidence: LinearDriftEvidence::Curve(CURVE) }.into(),
        LevelStep { time_s: MOMENT, size: rate(0.05, 0.004), p_value: 1e-9 }.into(),
        TemperatureSensitivity { sensitivity: rate(0.048, 0.006), sigmas: 9.0 }.into(),
        TemperatureCurvature {
            sensitivity: rate(0.048, 0.006),
            curvature: rate(0.003, 0.0004),
            reference_degc: 30.0,
            p_value: 1e-9,
            response: response(),
        }
        .into(),
        TurnOnTransient {
            size: acceleration(0.012, 0.003),
            time_constant_s: about(40.0, 5.0),
            p_value: 1e-9,
            response: response(),
        }
        .into(),
        ThermalLag {
            sensitivity: rate(0.048, 0.006),
            time_constant_s: about(200.0, 30.0),
            p_value: 1e-9,
            response: response(),
        }
        .into(),
        SupplySensitivity { sensitivity: rate(0.2, 0.02), sigmas: 9.0 }.into(),
        AccelerationSensitivity { sensitivity: [Some(rate(0.05, 0.004)), Some(rate(0.04, 0.004)), None], sigmas: 9.0 }
            .into(),
        VibrationRectification {
            sensitivity: rate(0.002, 0.0003),
            per: "g",
            accelerometer: "accl_x",
            strongest: 0.1,
            p_value: 1e-9,
            response: response(),
        }
        .into(),
        AngleQuantization { coefficient: rate(3e-6, 0.2e-6), evidence: CURVE }.into(),
        EffectiveLsb { step: exact(0.004).in_unit("g"), counts: 4, values: 1000, changes: 900 }.into(),
        NoiseBelowCount { deviation: acceleration(0.0003, 0.00003), counts: 0.1, dithered_counts: 0.3 }.into(),
        MissingCodes { codes: 9, spacing: exact(0.004).in_unit("g"), expected: 25_000.0 }.into(),
        Spikes {
            rate_per_hour: about(12.0, 3.0),
            size: rate(2.0, 0.3),
            count: 12,
            threshold_sigmas: 5.0,
            largest_sigmas: 9.0,
        }
        .into(),
        NoisyInterval {
            from_s: MOMENT,
            to_s: exact(780.0),
            level: about(4.0, 0.2),
            tau_s: 1.0,
            p_value: 1e-9,
            channels: vec!["gyro_x"],
        }
        .into(),
        motion(780.0, MotionScale::BiasError(3.0), 1, 40).into(),
        motion(1020.0, MotionScale::Scatter(0.3), 2, 60).into(),
        Saturation {
            fraction: exact(0.003),
            level: exact(75.0).in_unit("deg/s"),
            is_end_of_range: true,
            cut_off: 300.0,
            samples: 1e5,
            most_of_others: 20,
        }
        .into(),
        LevelChange { time_s: MOMENT, ratio: about(2.0, 0.1), explained: 0.9, p_value: 1e-9 }.into(),
        WanderingLevel { deviation: about(0.3, 0.04), time_constant_s: about(60.0, 9.0), p_value: 1e-9 }.into(),
        StuckOutput {
            fraction: exact(0.003),
            from_s: MOMENT,
            to_s: exact(780.0),
            runs: 2,
            stuck: 300,
            samples: 100_000,
        }
        .into(),
        DroppedSamples { fraction: exact(0.0003), missing: 30.0, samples: 1e5, gaps: 3 }.into(),
        RepeatedSamples { fraction: exact(0.003), equal: 300, samples: 1e5, by_chance: 0.1, channels: 6 }.into(),
        ClockDeviation { rate_hz: about(816.43, 0.04), nominal_hz: 819.2, sigmas: 9.0, change: None }.into(),
        ClockDeviation {
            rate_hz: about(204.69, 0.01),
            nominal_hz: 204.8,
            sigmas: 9.0,
            change: Some(RateChange {
                time_s: MOMENT,
                before_hz: about(204.8, 0.01),
                after_hz: about(204.58, 0.01),
                sigmas: 9.0,
            }),
        }
        .into(),
        unexplained(tau, Some(excess)).into(),
        unexplained(tau, Some(BoundedEstimate::new(-9.0, -11.0, -7.0))).into(),
        unexplained(tau, None).into(),
        unexplained(line_of_curve, Some(excess)).into(),
        unexplained(band, Some(excess)).into(),
        unexplained(band, None).into(),
        Unexplained {
            observation: Observation::LevelByTemperature { range_degc: [20.0, 30.0], explained: 0.9 },
            ..unexplained(tau, Some(about(20.0, 3.0)))
        }
        .into(),
    ]
}
