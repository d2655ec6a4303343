//! The sentences of every kind of effect.

use super::*;
use crate::evidence;
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

fn line(frequency_hz: f64) -> SinusoidalLine {
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

/// Every kind and form.
fn examples() -> Vec<Effect> {
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

fn names(list: &[&str]) -> Vec<String> {
    list.iter().map(|name| (*name).to_owned()).collect()
}

fn finding(effect: impl Into<Effect>) -> Finding {
    Finding {
        effect: effect.into(),
        channels: vec!["gyro_z".to_owned()],
        clearest: 0,
        validated: Validation::Untestable,
        share_percent: Default::default(),
        minute_percent: Default::default(),
    }
}

/// One row for each piece of advice.
fn rows_of(kind: &str, examples: &[Effect]) -> String {
    let texts =
        examples.iter().filter(|effect| effect.name() == kind).map(|effect| describe(&finding(effect.clone()), &[]));
    let mut by_advice: Vec<(String, Vec<String>)> = Vec::new();
    for FindingText { physics, advice, .. } in texts {
        match by_advice.iter_mut().find(|(known, _)| *known == advice) {
            Some((_, sentences)) => sentences.push(physics),
            None => by_advice.push((advice, vec![physics])),
        }
    }
    let rows = by_advice.iter().enumerate().map(|(at, (advice, sentences))| {
        let name = if at == 0 { format!("`{kind}`") } else { String::new() };
        format!("| {name} | {} | {advice} |\n", sentences.join(" *or* "))
    });
    rows.collect()
}

#[test]
fn the_sentences_of_every_kind_are_in_the_docs() {
    let examples = examples();
    let rows = Effect::NAMES.iter().map(|kind| {
        let rows = rows_of(kind, &examples);
        assert!(!rows.is_empty(), "{kind} has no example");
        rows
    });
    let mut rows: Vec<String> = rows.collect();
    // The noise model and the samples share kinds.
    rows.dedup();
    let table = format!("| kind | the report says | what to do |\n|---|---|---|\n{}", rows.concat());
    system_tests::generated("docs/findings.md", "kinds", &table);
}

/// Its table is written by hand: the names come from functions, which a schema of the types does not know.
#[test]
fn the_parameters_of_every_kind_are_in_the_description_of_the_json() {
    let page = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/json-schema.md");
    let page = std::fs::read_to_string(page).expect("the page");
    for effect in examples() {
        let kind = format!("`{}`", effect.name());
        let is_of_kind = |line: &&str| line.split('|').nth(1).is_some_and(|kinds| kinds.contains(&kind));
        let rows: String = page.lines().filter(is_of_kind).collect();
        for name in effect.parameters().into_keys() {
            assert!(rows.contains(&format!("`{name}`")), "{kind}: {name}");
        }
    }
}

#[test]
fn every_text_of_every_kind_is_a_sentence() {
    for effect in &examples() {
        let text = describe(&finding(effect.clone()), &[]);
        assert!(text.physics.ends_with('.') && text.advice.ends_with('.'), "{}: {text:?}", effect.name());
        // A place without a parameter.
        assert!(!format!("{}{}", text.physics, text.advice).contains(['{', '}', '–']), "{}: {text:?}", effect.name());
    }
}

/// 80 columns leave 63.
#[test]
fn a_brief_sentence_fits_a_line_of_the_narrowest_screen() {
    for effect in &examples() {
        let FindingText { brief, physics, .. } = describe(&finding(effect.clone()), &[]);
        let is_short = brief.chars().count() <= 63 || matches!(effect, Effect::Unexplained(_));
        assert!(is_short && brief.ends_with('.'), "{} columns: {brief}", brief.chars().count());
        assert!(![&brief, &physics].iter().any(|text| text.contains(DETAIL)), "{physics}");
    }
}

#[test]
fn a_motion_is_told_by_when_it_began_and_how_long_it_was() {
    let motion = |from_s: f64, to_s: f64, stretches| {
        let of = MotionInterval {
            from_s: BoundedEstimate::exact(from_s),
            to_s: BoundedEstimate::exact(to_s),
            size: BoundedEstimate::exact(40.0).in_unit("deg/s"),
            scale: MotionScale::BiasError(3.0),
            stretches,
            moved_s: 12,
        };
        describe(&finding(of), &[]).physics
    };
    assert_eq!(motion(1000.0, 1020.0, 1), "The platform moved at 16 min 40 s for up to 20 s.");
    let several = "The platform moved 2 times between 7.0 s and 16 min 40 s, for up to 12 s together.";
    assert_eq!(motion(7.0, 1000.0, 2), several);
}

#[test]
fn sizes_in_words_are_those_of_their_definitions() {
    // The covariance (A/2)²·exp(−t/T): a jump every 2 T.
    let telegraph = TelegraphNoise {
        time_constant_s: BoundedEstimate::new(20.0, 15.0, 27.0),
        amplitude: BoundedEstimate::new(0.3, 0.29, 0.31).in_unit("deg/s"),
        evidence: TelegraphEvidence::Levels { jumps: 80.0, gain: 20.0 },
    };
    let physics = describe(&finding(telegraph), &[]).physics;
    assert!(physics.contains("0.300 ± 0.010 °/s apart, on average every 40 s: a time constant of 20"), "{physics}");
    // Half the distance of the levels.
    let square = SquareWave {
        frequency_hz: BoundedEstimate::exact(0.5),
        amplitude: BoundedEstimate::new(9e-4, 8e-4, 1e-3).in_unit("g"),
        multiples: Multiples { harmonics: vec![1, 3], sidebands: 0 },
        line: line(20.5).evidence,
    };
    let physics = describe(&finding(square), &[]).physics;
    assert!(physics.ends_with("Hz: amplitude 900 ± 100 µg."), "{physics}");
}

#[test]
fn a_drift_in_common_with_a_channel_says_how_much_of_it() {
    let drift = SharedDrift {
        ratio: BoundedEstimate::new(2.9, 2.3, 3.5).in_unit("deg/s"),
        per: "g",
        with: "accl_x",
        sigmas: 9.0,
        largest_multiple: 31.6,
    };
    let physics = describe(&finding(drift), &[]).physics;
    let expected = "A slow drift in common with accel x, which nothing recorded explains: 2.9 ± 0.6 °/s/g of it.";
    assert_eq!(physics, expected);
}

#[test]
fn the_part_of_the_samples_that_is_cut_off_is_told() {
    let saturation = examples().into_iter().find(|effect| matches!(effect, Effect::Saturation(_))).expect("one");
    let physics = describe(&finding(saturation), &[]).physics;
    assert_eq!(physics, "0.3 % of the samples are at the end of the channel's range.");
}

#[test]
fn the_evidence_is_printed_with_prefixes_and_bounds() {
    let line = line(20.5);
    let LineSource::Spectrum(spectrum) = line.evidence.source else { panic!("{line:?}") };
    let source = LineSource::Spectrum(SpectrumEvidence { p_value: 0.0, ..spectrum });
    let line = SinusoidalLine { evidence: LineEvidence { source, ..line.evidence }, ..line };
    let sentence = evidence::of_finding(&finding(line));
    let beginning = "line at 20.5000 Hz in the spectrum, no wider than the record resolves, 220 σ, by chance anywhere";
    assert!(sentence.starts_with(&format!("{beginning} below 0.001; ")), "{sentence}");
    let step = LevelStep {
        time_s: BoundedEstimate::exact(333.0),
        size: BoundedEstimate::exact(-3.1e-5).in_unit("g"),
        p_value: 3e-9,
    };
    let of_step = evidence::of_finding(&finding(step));
    let rest = |chance: &str| {
        format!(
            "at 333.0 s and stays, by chance anywhere {chance} in white, flicker and walking noise of any mixture; a mechanical or \
             thermal shock, or a fault that begins"
        )
    };
    assert_eq!(of_step, format!("the level changes by −31.0 µg {}", rest("below 0.001")));
    assert_eq!(describe(&finding(step), &[]).weight, "");
    let mut in_two = finding(step);
    in_two.channels.insert(0, "accl_x".to_owned());
    in_two.clearest = 1;
    let sentence = evidence::of_finding(&in_two);
    assert!(sentence.starts_with("gyro z: the level") && sentence.ends_with("; one cause in 2 channels"), "{sentence}");
}

/// No names of the JSON, and no "1 runs".
#[test]
fn the_evidence_of_the_page_has_names_symbols_and_numbers_as_its_readers_write_them() {
    for effect in &examples() {
        let text = evidence::of_effect(effect);
        let of_json = ["gyro_", "accl_", "tau", "sigma", " -"];
        assert!(!of_json.iter().any(|name| text.contains(name)), "{text}");
    }
    let stuck = StuckOutput {
        fraction: BoundedEstimate::exact(0.003),
        from_s: BoundedEstimate::exact(1.0),
        to_s: BoundedEstimate::exact(2.0),
        runs: 1,
        stuck: 5,
        samples: 12_000,
    };
    let text = evidence::of_effect(&stuck.into());
    assert!(text.starts_with("5 of 12000 samples are in 1 run of equal values"), "{text}");
}

#[test]
fn a_finding_in_several_channels_says_so_and_what_the_second_half_says_of_it() {
    let mut line = finding(line(20.5));
    line.channels.push("accl_x".to_owned());
    for (validated, weight) in [
        (Validation::Yes, "the second half confirms it"),
        (Validation::No, "the second half does not confirm it"),
        (Validation::Untestable, ""),
    ] {
        line.validated = validated;
        let text = describe(&line, &[]);
        let expected = "A vibration or hum at 20.50 ± 0.10 Hz, a narrow line: amplitude gyro z 0.200 ± 0.010 °/s.";
        assert_eq!(text.physics, expected);
        assert_eq!(text.weight, weight);
    }
}

#[test]
fn a_share_becomes_a_gain_in_sigma() {
    let mut line = finding(line(20.5));
    line.share_percent.insert("gyro_z".to_owned(), 75.0);
    let text = describe(&line, &[]);
    // 1 − √(1 − 0.75) = 50 %.
    assert!(text.advice.ends_with("It would take 50 % off σ where it is largest."), "{}", text.advice);
    assert_eq!(text.weight, "up to 75 % of σ²");
    for (minute, weight) in [(30.0, "up to 75 % of σ², 30 % around τ = 1 min"), (75.0, "75 % of σ² around τ = 1 min")]
    {
        line.minute_percent.insert("gyro_z".to_owned(), minute);
        assert_eq!(describe(&line, &[]).weight, weight);
    }
}

/// Nobody has to look up the time, and one remedy of several findings is one step.
#[test]
fn advice_names_its_time_and_is_the_same_for_every_kind_of_rounding() {
    let step = |effect: Effect| describe(&finding(effect), &[]).step.expect("a step");
    let change = LevelStep { time_s: MOMENT, size: rate(0.2, 0.1), p_value: 1e-9 };
    assert_eq!(step(change.into()), "Look for a shock, a changed supply or a touched cable at 12 min 20 s.");
    let is_rounding = |effect: &Effect| matches!(effect.name(), "quantization" | "noise_below_count");
    let steps: Vec<String> = examples().into_iter().filter(is_rounding).map(step).collect();
    assert!(steps.len() >= 3 && steps.iter().all(|step| *step == steps[0]), "{steps:?}");
}

#[test]
fn channels_are_listed_in_few_words() {
    for (list, text) in [
        (&["gyro_z"][..], "gyro z"),
        (&["gyro_x", "gyro_y", "gyro_z"], "gyros"),
        (&["gyro_z", "accl_x", "accl_y"], "gyro z, accel x y"),
        (&["gyro_x", "gyro_y", "gyro_z", "accl_x", "accl_y", "accl_z"], "all channels"),
        (&["supply"], "supply"),
    ] {
        assert_eq!(channel_list(names(list)), text);
    }
}
