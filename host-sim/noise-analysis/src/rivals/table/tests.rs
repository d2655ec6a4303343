//! Each row of the table decides a case of its own.

use super::*;
use crate::bounds::MeasuredValue;
use crate::effects::*;
use crate::rivals::signals::proposal;
use crate::spectra::SpectralLine;
use crate::spectra::spectral_lines::{MergedLine, merged};
use allan_core::term::{Markov, Resonance, Sinusoid};

/// Claims to one variance, in a case that one row decides.
enum Claims {
    Line { line: MergedLine, faster: Vec<MergedLine>, left: Option<Vec<MergedLine>>, gain: f64 },
    Spectrum(Box<SpectrumProposals>),
    Channel(ChannelFacts, Vec<Proposal>),
    Cause { effect: Effect, shown_by: Option<usize>, periodic: Vec<Cause> },
}

impl Claims {
    fn standing(&self, rows: &[&Rivalry]) -> Vec<&'static str> {
        match self {
            Self::Line { line, faster, left, gain } => {
                let claim = LineClaim { faster, left: left.as_deref(), gain: *gain, ..LineClaim::new(line, 1.0) };
                if rows.iter().any(|row| row.applies_to_line(&claim)) { Vec::new() } else { vec!["line"] }
            }
            Self::Spectrum(of) => {
                let of = rows.iter().fold(SpectrumProposals::clone(of), |of, row| row.applied_to_spectrum(of));
                let (lines, signals) = of.into_lines_and_signals();
                let signals = signals.iter().map(|signal| match signal {
                    Signal::Periodic(_) => "periodic",
                    Signal::Chirp(_) => "chirp",
                    Signal::Decays(_) => "shot_noise",
                });
                lines.iter().map(|_| "line").chain(signals).collect()
            }
            Self::Channel(facts, proposals) => {
                let standing = rows.iter().fold(proposals.clone(), |of, row| row.applied_to_channel(of, facts));
                standing.iter().map(|proposal| proposal.effect.name()).collect()
            }
            Self::Cause { effect, shown_by, periodic } => {
                let claim = CauseClaim { effect, channel: 0, shown_by: *shown_by, periodic };
                let loses = rows.iter().any(|row| row.applies_to_cause(&claim));
                if loses { Vec::new() } else { vec![effect.name()] }
            }
        }
    }
}

/// A channel of 1000 s at 100 Hz with much noise against its resolution, whose ends differ as a ramp of 1 a second makes them.
const DITHERED: ChannelFacts = ChannelFacts {
    avar: 1.0,
    resolution: 1e-3,
    period_s: 0.01,
    duration_s: 1000.0,
    is_dithered: true,
    is_dithered_at_once: true,
    slope_of_ends: Some(1.0),
};
/// The same with noise that exceeds the resolution at longer averaging times alone: its rounding error is correlated over 0.4 s.
const DITHERED_LATER: ChannelFacts = ChannelFacts { is_dithered_at_once: false, ..DITHERED };
const CURVE: CurveEvidence = CurveEvidence { excess: 0.5, tau_s: 1.0, sigmas: 9.0, gain_sigmas: 9.0 };
const SOURCE: LineSource = LineSource::Curve(CURVE);

fn known(value: f64) -> BoundedEstimate {
    BoundedEstimate::new(value, 0.9 * value, 1.1 * value)
}

fn size(value: f64) -> crate::bounds::ChannelEstimate {
    known(value).in_unit("g")
}

fn quantization() -> Effect {
    AngleQuantization { coefficient: size(1.0), evidence: CURVE }.into()
}

fn markov(time_constant_s: f64) -> Effect {
    let evidence = MarkovEvidence::Curve(CURVE);
    MarkovProcess { deviation: size(1.0), time_constant_s: known(time_constant_s), evidence }.into()
}

fn levels(time_constant_s: f64, amplitude: f64) -> Effect {
    likely_levels(time_constant_s, amplitude, 20.0)
}

fn likely_levels(time_constant_s: f64, amplitude: f64, gain: f64) -> Effect {
    let evidence = TelegraphEvidence::Levels { jumps: 50.0, gain };
    TelegraphNoise { time_constant_s: known(time_constant_s), amplitude: size(amplitude), evidence }.into()
}

fn sinusoid(frequency_hz: f64, amplitude: BoundedEstimate) -> Effect {
    let (amplitude, evidence) = (amplitude.in_unit("g"), LineEvidence { has_width: false, source: SOURCE });
    SinusoidalLine { frequency_hz: known(frequency_hz), amplitude, multiples: None, evidence }.into()
}

fn resonance(frequency_hz: f64) -> Effect {
    let (deviation, evidence) = (size(1.0), LineEvidence { has_width: true, source: SOURCE });
    let (frequency_hz, bandwidth_hz) = (known(frequency_hz), known(0.1 * frequency_hz));
    ResonantLine { frequency_hz, bandwidth_hz, deviation, multiples: None, evidence }.into()
}

fn drift(slope: f64) -> Effect {
    LinearDrift { slope: size(slope), evidence: LinearDriftEvidence::Curve(CURVE) }.into()
}

fn common_mode(time_constant_s: f64) -> Effect {
    CommonMode { deviation: size(1.0), time_constant_s: known(time_constant_s), others: vec!["gyro_y"], gain: 20.0 }
        .into()
}

fn spikes() -> Effect {
    let (threshold_sigmas, largest_sigmas) = (5.0, 6.0);
    Spikes { rate_per_hour: known(10.0), size: size(1.0), count: 3, threshold_sigmas, largest_sigmas }.into()
}

fn wandering_level() -> Effect {
    WanderingLevel { deviation: known(0.3), time_constant_s: known(60.0), p_value: 1e-9 }.into()
}

fn motion(size_g: f64) -> Effect {
    let (from_s, to_s) = (BoundedEstimate::exact(40.0), BoundedEstimate::exact(50.0));
    MotionInterval { from_s, to_s, size: size(size_g), scale: MotionScale::BiasError(0.05), stretches: 1, moved_s: 10 }
        .into()
}

fn temperature() -> Effect {
    TemperatureSensitivity { sensitivity: size(1.0), sigmas: 9.0 }.into()
}

fn shared_drift() -> Effect {
    SharedDrift { ratio: size(1.0), per: "degC", with: "temperature", sigmas: 9.0, largest_multiple: 10.0 }.into()
}

fn unexplained(tau_s: f64, observation: Observation) -> Effect {
    let place = UnexplainedPlace::AveragingTime(known(tau_s));
    Unexplained { place, excess_percent: Some(known(50.0)), observation }.into()
}

fn refuted(by: Refutation) -> Effect {
    unexplained(1.0, Observation::RefutedTerm { curve: CURVE, by })
}

fn refuted_line(frequency_hz: f64, by: Refutation) -> Effect {
    let place = UnexplainedPlace::LineOfCurve { tau_s: known(1.0), frequency_hz: known(frequency_hz) };
    let observation = Observation::RefutedTerm { curve: CURVE, by };
    Unexplained { place, excess_percent: Some(known(50.0)), observation }.into()
}

const OTHER_SPECTRUM: Refutation = Refutation::ShapeOfSpectrum { p_value: 1e-6 };
const IRREVERSIBLE: Refutation = Refutation::Irreversible { time_constant_s: 1.0 };
const RARE: Refutation = Refutation::RareDisturbances { time_constant_s: 1.0, kurtosis: [3.0, 0.1] };
const UNDECIDED: Refutation = Refutation::UndecidedLevels { time_constant_s: 1.0, kurtosis: [0.4, 0.3] };

const fn of_markov(number: usize, time_constant: f64) -> Origin {
    Origin::Term { number, kind: NoiseTerm::Markov(Markov { time_constant }) }
}

const fn of_sinusoid(frequency: f64) -> Origin {
    Origin::Term { number: 0, kind: NoiseTerm::Sinusoid(Sinusoid { frequency }) }
}

const fn of_resonance(frequency: f64) -> Origin {
    Origin::Term { number: 0, kind: NoiseTerm::Resonance(Resonance { frequency, bandwidth: 0.1 * frequency }) }
}

const OF_RAMP: Origin = Origin::Term { number: 0, kind: NoiseTerm::RateRamp };
const OF_QUANTIZATION: Origin = Origin::Term { number: 1, kind: NoiseTerm::Quantization };
const OF_LINE: Origin = Origin::Line { is_slow: false };
const OF_LEVELS: Origin = Origin::Levels { is_reversible: true };

fn periodic() -> PeriodicSignal {
    let (frequency, harmonics_percent) = (BoundedEstimate::exact(0.025), known(50.0));
    PeriodicSignal {
        frequency,
        amplitude: known(0.1),
        harmonics_percent,
        harmonics: vec![0.02; 7],
        sum: 100.0,
        p_value: 1e-9,
    }
}

/// From 4 to 8 Hz.
fn track() -> FrequencyTrack {
    FrequencyTrack {
        frequencies: [4.0, 8.0],
        error: 0.1,
        excess: 1.0,
        excess_error: 0.1,
        duration_s: 1000.0,
        amplitude: known(0.1),
        segments: 64.0,
        energy: 100.0,
        p_value: 1e-9,
    }
}

fn decays() -> DecayingDisturbances {
    DecayingDisturbances {
        time_constant: known(5.0),
        size: known(0.1),
        rate_hz: known(0.02),
        deviation: known(0.02),
        sum: 8.0,
        reversed: 1.0,
        p_value: 1e-9,
    }
}

fn signal(signal: &Signal) -> Proposal {
    proposal(signal, "g")
}

fn spectral_line(frequency_hz: f64, width_hz: Option<f64>, statistic: f64) -> MergedLine {
    let exact = |value: f64| MeasuredValue { value, error: 1e-6 };
    let peak = SpectralLine {
        frequency: exact(frequency_hz),
        deviation: exact(0.1),
        width: width_hz.map(exact),
        statistic,
        p_value: 1e-9,
        shape_p_value: 1.0,
        modulation: None,
    };
    merged(vec![peak], 1000.0, 1000.0, 0.0)[0]
}

fn spectrum(lines: Vec<MergedLine>) -> SpectrumProposals {
    SpectrumProposals {
        lines,
        periodic: None,
        track: None,
        decays: None,
        bands_of_curve: Vec::new(),
        resolution_hz: 1e-3,
    }
}

fn of(effect: Effect, origin: Origin) -> Proposal {
    Proposal { effect, origin }
}

fn channel(proposals: impl IntoIterator<Item = Proposal>) -> Claims {
    Claims::Channel(DITHERED, proposals.into_iter().collect())
}

fn in_spectrum(of: SpectrumProposals) -> Claims {
    Claims::Spectrum(Box::new(of))
}

fn later(effect: Effect, origin: Origin) -> Claims {
    Claims::Channel(DITHERED_LATER, vec![of(effect, origin)])
}

/// A periodic signal of the first channel.
fn of_period(frequency_hz: f64) -> Cause {
    let effect = Effect::from(Periodic {
        frequency_hz: known(frequency_hz),
        amplitude: size(0.1),
        harmonics_percent: known(80.0),
        harmonics: vec![0.08],
        sum: 100.0,
        p_value: 1e-9,
    });
    Cause { shown: vec![Shown { channel: 0, parts: vec![effect.clone()], effect }] }
}

/// For each row, by what stands and in the place of what: a case, and what stands in it by the whole table.
#[rustfmt::skip]
fn cases() -> Vec<([&'static str; 2], Claims, Vec<&'static str>)> {
    let line = |frequency_hz: f64| sinusoid(frequency_hz, known(1.0));
    let plausible = |is_plausible| Origin::Covariate { is_plausible };
    let not_in_spectrum = Refutation::NotInSpectrum { frequency_hz: 10.0 };
    let alone = |is_sudden| Origin::Motion { is_shared: false, is_sudden };
    let response = ResponseVariance::from_means(&[0.0, 1.0, 0.0, 1.0], 1, 1.0);
    let lag = ThermalLag { sensitivity: size(1.0), time_constant_s: known(100.0), p_value: 1e-9, response };
    let point = |tau_s: f64| unexplained(tau_s, Observation::PointOfCurve { p_value: 1e-9 });
    let by_temperature = |explained| unexplained(0.01, Observation::LevelByTemperature { range_degc: [20.0, 30.0], explained });
    let level_change = |explained| -> Effect {
        LevelChange { time_s: known(500.0), ratio: known(2.0), explained, p_value: 1e-9 }.into()
    };
    let two_stages =
        LowPassFilter { bandwidth_hz: known(1.0), design: LowPassDesign::TwoStages, evidence: CURVE };
    let low_pass = LowPassFilter {
        bandwidth_hz: known(1.0),
        design: LowPassDesign::OneStage { time_constant_s: 0.16 },
        evidence: CURVE,
    };
    let step = LevelStep { time_s: known(500.0), size: size(0.2), p_value: 1e-9 };
    let shown = |channel: usize| Shown { channel, effect: line(0.01), parts: Vec::new() };
    let by_kurtosis = TelegraphEvidence::Kurtosis { ratio: 1.0, error: 0.1, curve: CURVE };
    let two_levels = TelegraphNoise { time_constant_s: known(1.0), amplitude: size(1.0), evidence: by_kurtosis };
    let [of_periodic, of_track, of_decays] =
        [Signal::Periodic(periodic()), Signal::Chirp(track()), Signal::Decays(decays())].map(|of| signal(&of));
    let few_periods = [of(line(0.005), of_sinusoid(0.005)), of(refuted_line(0.005, Refutation::FewPeriods), of_sinusoid(0.005))];
    let absent = || [of(line(10.0), of_sinusoid(10.0)), of(refuted_line(10.0, not_in_spectrum), of_sinusoid(10.0))];
    let of_term = |number: usize, effect: Effect| of(effect, of_markov(number, 1.0));
    let narrow = spectral_line(0.3, None, 50.0);
    vec![
        (["line above half the rate of the means", "line of the means"],
            Claims::Line { line: narrow, faster: vec![spectral_line(0.7, None, 50.0)], left: None, gain: 1.0 }, vec![]),
        (["covariate", "line of the spectrum"],
            Claims::Line { line: narrow, faster: Vec::new(), left: Some(Vec::new()), gain: 1.0 }, vec![]),
        (["filter", "band of the spectrum"],
            Claims::Line { line: spectral_line(0.3, Some(0.1), 50.0), faster: Vec::new(), left: None, gain: 0.05 }, vec![]),
        (["slow periodic signal", "line of the spectrum"],
            in_spectrum(SpectrumProposals { periodic: Some(periodic()), ..spectrum(vec![spectral_line(0.05, None, 50.0)]) }),
            vec!["periodic"]),
        (["band", "chirp"],
            in_spectrum(SpectrumProposals { track: Some(track()), ..spectrum(vec![spectral_line(6.0, Some(0.5), 1000.0)]) }),
            vec!["line"]),
        (["chirp", "line of the spectrum"],
            in_spectrum(SpectrumProposals { track: Some(track()), ..spectrum(vec![spectral_line(6.0, None, 100.0)]) }),
            vec!["chirp"]),
        (["slow periodic signal", "shot noise"],
            in_spectrum(SpectrumProposals { periodic: Some(periodic()), decays: Some(decays()), ..spectrum(Vec::new()) }),
            vec!["periodic"]),
        (["irreversible changes", "telegraph noise of the samples"],
            channel([of(levels(1.0, 1.0), Origin::Levels { is_reversible: false })]), vec![]),
        (["drift of the bias", "motion"], channel([of(motion(0.7), alone(false))]), vec![]),
        (["telegraph noise of the samples", "motion"],
            channel([of(motion(0.7), alone(true)), of(levels(1.0, 1.0), OF_LEVELS)]), vec!["telegraph"]),
        (["sensitivity", "shared drift"],
            channel([of(temperature(), plausible(true)), of(shared_drift(), plausible(true))]), vec!["temperature"]),
        (["shared drift", "sensitivity"],
            channel([of(temperature(), plausible(false)), of(shared_drift(), plausible(false))]), vec!["shared_drift"]),
        (["chance", "line of the spectrum"],
            channel([of(sinusoid(10.0, BoundedEstimate::new(0.1, 0.0, 0.3)), OF_LINE)]), vec![]),
        (["rounding to counts", "telegraph noise of the samples"], later(levels(1.0, 1e-3), OF_LEVELS), vec![]),
        (["rounding to counts", "every term of the curve but a filter"],
            Claims::Channel(ChannelFacts { is_dithered: false, ..DITHERED }, vec![of(drift(1.0), OF_RAMP)]), vec![]),
        (["line of the spectrum", "line of the curve"],
            channel([of(line(10.0), of_sinusoid(10.0)), of(line(10.5), OF_LINE)]), vec!["sinusoid"]),
        (["unexplained octave of few periods", "line of the curve"], channel(few_periods), vec!["unexplained"]),
        (["harmonic of a line of the spectrum", "line of the curve"],
            channel(absent().into_iter().chain([of(line(3.0), OF_LINE)])), vec!["sinusoid"]),
        (["unexplained octave without a line", "line of the curve"], channel(absent()), vec!["unexplained"]),
        (["unexplained octave of another spectrum", "quantization"],
            channel([of_term(0, refuted(OTHER_SPECTRUM)), of_term(0, quantization())]), vec!["unexplained"]),
        (["telegraph noise of the samples", "shot noise"],
            channel([of(likely_levels(5.0, 1.0, 33.0), OF_LEVELS), of_decays.clone()]), vec!["telegraph"]),
        (["telegraph noise of the samples", "Markov process or ramp of the curve"],
            channel([of_term(0, markov(1.0)), of(levels(1.0, 1.0), OF_LEVELS)]), vec!["telegraph"]),
        (["drift in common", "Markov process or ramp of the curve"],
            channel([of_term(0, markov(1.0)), of(common_mode(1.0), Origin::CrossSpectra)]), vec!["common_mode"]),
        (["first-order filter", "Markov process of the curve"],
            channel([of_term(0, low_pass.into()), of_term(0, markov(1.0))]), vec!["filter_bandwidth"]),
        (["low-pass filter of the second order", "quantization, or unexplained line of the curve"],
            channel([of_term(0, two_stages.into()), of(quantization(), OF_QUANTIZATION)]), vec!["filter_bandwidth"]),
        (["unexplained octave of irreversible changes", "Markov process of the curve"],
            channel([of_term(0, refuted(IRREVERSIBLE)), of_term(0, markov(1.0))]), vec!["unexplained"]),
        (["telegraph noise by the kurtosis of a stronger term", "telegraph noise or an unexplained octave by the kurtosis of a Markov process"],
            channel([of_term(0, markov(1.0)), of_term(0, two_levels.into()), of_term(1, markov(1.0)), of_term(1, refuted(RARE))]),
            vec!["telegraph", "markov"]),
        (["telegraph noise or an unexplained octave by the kurtosis", "Markov process of the curve"],
            channel([of_term(0, markov(1.0)), of_term(0, refuted(UNDECIDED))]), vec!["unexplained"]),
        (["first unexplained octave", "further ones"],
            channel([of_term(0, refuted(UNDECIDED)), of_term(1, refuted(UNDECIDED))]), vec!["unexplained"]),
        (["chance", "sensitivity, term of the curve but a filter, telegraph noise, drift in common"],
            channel([of(common_mode(2000.0), Origin::CrossSpectra)]), vec![]),
        (["lag or curvature of the temperature", "sensitivity to temperature"],
            channel([of(lag.into(), Origin::Samples), of(temperature(), plausible(true))]), vec!["thermal_lag"]),
        (["ramp of the samples", "ramp of the curve"],
            channel([of(drift(1.0), Origin::Samples), of(drift(1.0), OF_RAMP)]), vec!["rate_ramp"]),
        (["line of the spectrum", "ramp of the curve"],
            channel([of(drift(1.0), OF_RAMP), of(line(0.004), Origin::Line { is_slow: true })]), vec!["sinusoid"]),
        (["slow oscillation", "ramp of the curve"], channel([of(drift(2.5), OF_RAMP)]), vec![]),
        (["unexplained point of the curve", "Markov process"],
            channel([of_term(0, markov(10.0)), of(point(18.9), Origin::Residual)]), vec!["unexplained"]),
        (["slow periodic signal", "Markov process, telegraph noise"],
            channel([of_term(0, markov(9.0)), of_periodic.clone()]), vec!["periodic"]),
        (["chirp", "Markov process, telegraph noise"], channel([of_term(0, markov(0.05)), of_track.clone()]), vec!["chirp"]),
        (["shot noise", "Markov process, telegraph noise, unexplained octave"],
            channel([of_term(0, markov(5.0)), of(point(9.0), Origin::Residual), of_decays]), vec!["shot_noise"]),
        (["slow periodic signal", "line of the curve"],
            channel([of(resonance(0.05), of_resonance(0.05)), of_periodic.clone()]), vec!["periodic"]),
        (["chirp", "line of the curve"], channel([of(resonance(6.0), of_resonance(6.0)), of_track]), vec!["chirp"]),
        (["slow periodic signal", "ramp, step"], channel([of(step.into(), Origin::Samples), of_periodic]), vec!["periodic"]),
        (["level of the noise by temperature", "change of the level of the noise"],
            channel([of(level_change(0.8), Origin::Level), of(by_temperature(0.9), Origin::Level)]), vec!["unexplained"]),
        (["change of the level of the noise", "level of the noise by temperature"],
            channel([of(level_change(0.9), Origin::Level), of(by_temperature(0.8), Origin::Level)]), vec!["level_change"]),
        (["level of the noise by temperature, motion", "wandering level of the noise"],
            channel([of(wandering_level(), Origin::Level), of(by_temperature(0.9), Origin::Level)]), vec!["unexplained"]),
        (["lines and signals", "wandering level of the noise"],
            channel([of(wandering_level(), Origin::Level), of(sinusoid(40.0, known(1.2)), OF_LINE)]), vec!["sinusoid"]),
        (["rounding to counts", "wandering level of the noise"], later(wandering_level(), Origin::Level), vec![]),
        (["level of the noise that changes", "spikes"],
            channel([of(spikes(), Origin::Samples), of(level_change(0.9), Origin::Level)]), vec!["level_change"]),
        (["telegraph noise", "spikes"], channel([of(spikes(), Origin::Samples), of(levels(1.0, 1.0), OF_LEVELS)]), vec!["telegraph"]),
        (["line in common", "drift in common"],
            Claims::Cause { effect: common_mode(10.0), shown_by: None, periodic: vec![Cause { shown: vec![shown(0), shown(1)] }] },
            vec![]),
        (["line in common", "rest of a drift in common"],
            Claims::Cause { effect: common_mode(10.0), shown_by: Some(1), periodic: Vec::new() }, vec![]),
        (["periodic signal", "telegraph noise"],
            Claims::Cause { effect: levels(5.0, 1.0), shown_by: None, periodic: vec![of_period(0.025)] }, vec![]),
    ]
}

#[test]
fn each_row_decides_its_case() {
    let (all, cases): (Vec<&Rivalry>, _) = (RIVALRIES.iter().collect(), cases());
    assert_eq!(cases.len(), RIVALRIES.len(), "a case for each row");
    for ([stands, instead_of], claims, expected) in cases {
        assert_eq!(claims.standing(&all), expected, "{stands}, instead of {instead_of}");
        let is_own = |row: &&Rivalry| row.stands == stands && row.instead_of == instead_of;
        let without: Vec<&Rivalry> = all.iter().copied().filter(|row| !is_own(row)).collect();
        assert_eq!(without.len() + 1, all.len(), "one row: {stands}, instead of {instead_of}");
        assert_ne!(claims.standing(&without), expected, "the table without {stands}, instead of {instead_of}");
    }
}

/// A claim just beyond the condition of a row stands beside its rival.
#[test]
fn rows_do_not_reach_beyond_their_conditions() {
    let all: Vec<&Rivalry> = RIVALRIES.iter().collect();
    let [periodic, track, decays] =
        [Signal::Periodic(periodic()), Signal::Chirp(track()), Signal::Decays(decays())].map(|of| signal(&of));
    let alone = Origin::Motion { is_shared: false, is_sudden: true };
    let shared = Origin::Motion { is_shared: true, is_sudden: false };
    let beyond = [
        [of(motion(0.7), alone), of(levels(1.0, 0.3), OF_LEVELS)],
        [of(motion(0.7), shared), of(levels(1.0, 1.0), OF_LEVELS)],
        [of(markov(0.05), of_markov(0, 0.05)), periodic.clone()],
        [of(resonance(2.0), of_resonance(2.0)), periodic],
        [of(markov(5.0), of_markov(0, 5.0)), track.clone()],
        [of(resonance(12.0), of_resonance(12.0)), track],
        [of(markov(50.0), of_markov(0, 50.0)), decays.clone()],
        [of(likely_levels(50.0, 1.0, 33.0), OF_LEVELS), decays],
        [of(drift(1.9), OF_RAMP), of(sinusoid(10.0, known(1.0)), OF_LINE)],
        [of(spikes(), Origin::Samples), of(levels(2.0, 1.0), OF_LEVELS)],
        [of(spikes(), Origin::Samples), of(wandering_level(), Origin::Level)],
        [of(wandering_level(), Origin::Level), of(sinusoid(40.0, known(0.5)), OF_LINE)],
    ];
    for proposals in beyond {
        let names: Vec<&str> = proposals.iter().map(|proposal| proposal.effect.name()).collect();
        assert_eq!(channel(proposals).standing(&all), names);
    }
    // Levels that change far faster or slower than a signal of 40 s.
    for time_constant_s in [0.5, 20.0] {
        let claim =
            Claims::Cause { effect: levels(time_constant_s, 1.0), shown_by: None, periodic: vec![of_period(0.025)] };
        assert_eq!(claim.standing(&all), ["telegraph"]);
    }
}
