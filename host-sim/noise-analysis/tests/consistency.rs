//! Nothing in a report contradicts anything else in it: every figure that a report gives twice is compared, within the joint
//! scatter of the two.

use adis16405_driver::GyroRange;
use measurement::Measurement;
use noise_analysis::analysis::analyze;
use noise_analysis::effects::Effect;
use noise_analysis::report::{ChannelReport, CurvePoint, ModelReport, Parameter, Report, TermReport};
use recordings::count_table;
use recordings::time_base::measurement;
use simulation::Simulation;
use std::f64::consts::{LN_2, PI};

/// A 95 % interval is 1.96 standard deviations to either side.
const NORMAL_975: f64 = 1.96;
/// Standard deviations of a difference that are no contradiction. Of some 2,000 independent pairs one exceeds four by chance
/// with a probability of 12 %; the simulations are seeded, so the outcome is the same every time.
const CONTRADICTION: f64 = 4.0;
/// Kinds of terms whose Allan variance is a power of the averaging time.
const POWERS: [&str; 5] = ["angle_random_walk", "bias_instability", "rate_random_walk", "quantization", "rate_ramp"];

/// Kinds of effects by which the bias drifts.
const DRIFTS: [&str; 5] = ["temperature", "supply", "temperature_squared", "thermal_lag", "rate_ramp"];
/// Terms of a model at most.
const MAX_TERMS: usize = 8;

fn deviation(of: &Parameter) -> f64 {
    (of.high - of.low) / (2.0 * NORMAL_975)
}

/// True if two estimates differ by more than both scatter.
fn contradict(a: &Parameter, b: &Parameter) -> bool {
    let scatter = deviation(a).hypot(deviation(b));
    // A number that is known to a part in 10⁹ is printed with fewer digits.
    (a.value - b.value).abs() > CONTRADICTION * scatter + 1e-9 * a.value.abs()
}

fn value(model: &ModelReport, kind: &str) -> Option<Parameter> {
    model.terms.iter().find(|term| term.kind() == kind).map(TermReport::coefficient)
}

/// N of a model: the white noise behind its filter and that which entered after it.
fn angle_random_walk(model: &ModelReport) -> Option<Parameter> {
    let both = |a: Parameter, b: Parameter| Parameter {
        value: a.value.hypot(b.value),
        low: a.low.hypot(b.low),
        high: a.high.hypot(b.high),
        ..a
    };
    ["filter_bandwidth", "angle_random_walk"].iter().filter_map(|kind| value(model, kind)).reduce(both)
}

/// Allan variance of a term at the averaging time `tau_s` by its formula in IEEE Std 952, for the terms of [`POWERS`].
fn variance(term: &TermReport, tau_s: f64) -> f64 {
    let of = |name: &str| term.parameters().get(name).map_or(0.0, |parameter| parameter.value.powi(2));
    match term.kind() {
        "angle_random_walk" => of("value") / tau_s,
        "bias_instability" => of("value") * 2.0 * LN_2 / PI,
        "rate_random_walk" => of("value") * tau_s / 3.0,
        "quantization" => 3.0 * of("value") / (tau_s * tau_s),
        _ => of("slope") * tau_s * tau_s / 2.0,
    }
}

/// The contradictions in a report, a line each.
fn contradictions(report: &Report) -> Vec<String> {
    let mut found = Vec::new();
    for channel in &report.channels {
        let mut add = |what: String| found.push(format!("{}: {what}", channel.name));
        white_noise(channel, &mut add);
        curve_of_terms(channel, &mut add);
        curve_by_spectrum(channel, &mut add);
        effects_and_terms(channel, &mut add);
        effects_and_findings(report, channel, &mut add);
        terms_in_findings(channel, &mut add);
        lines_in_model(channel, &mut add);
        spectrum_of_the_picture(channel, &mut add);
        filter_of_the_part(report, channel, &mut add);
    }
    found
}

/// N of the model of the whole record, in the coefficients.
fn white_noise(channel: &ChannelReport, add: &mut impl FnMut(String)) {
    let Some(fitted) = angle_random_walk(&channel.refitted) else { return };
    let practice = &channel.assessment;
    let same_unit = |of: &&noise_analysis::report::assessment::Coefficient| {
        of.kind == "angle_random_walk" && !of.discrete && of.value.unit == fitted.unit
    };
    if let Some(of) = practice.coefficients.iter().find(same_unit)
        && contradict(&fitted, &of.value)
    {
        add(format!("N of the coefficients {:?}, of the model {fitted:?}", of.value));
    }
}

/// The model's curve from its terms, where all of them have a formula. Sampled flicker noise and quantization differ from the
/// formulas at a few samples.
fn curve_of_terms(channel: &ChannelReport, add: &mut impl FnMut(String)) {
    let has_covariates =
        channel.effects.iter().any(|of| ["temperature", "supply", "acceleration"].contains(&of.effect.name()));
    for (name, model) in [("before", &channel.before), ("final", &channel.refitted)] {
        if (name == "final" && has_covariates) || model.terms.iter().any(|term| !POWERS.contains(&term.kind())) {
            continue;
        }
        for (point, adev) in channel.curve.iter().zip(&model.adev).filter(|(point, _)| point.n >= 16) {
            let of_terms: f64 = model.terms.iter().map(|term| variance(term, point.tau_s)).sum();
            let of_terms = (of_terms + point.rounding.powi(2)).sqrt();
            if (of_terms - adev).abs() > 0.02 * adev {
                add(format!("{name}: {adev} at {} s, its terms {of_terms}", point.tau_s));
            }
        }
    }
}

/// The measured curve and equation (5), of a channel whose noise is the same throughout. Under Welch's windows the ends of a record
/// weigh less, so that noise that changes has another average; so has the rounding of a temperature or supply that crosses the
/// edge of a count now and then. A bias that follows a covariate or a ramp is no stationary process: the window takes the ends off a
/// ramp of slope R, of whose R²·τ²/2 hardly anything is left, so that from 1 s on nothing is compared where the bias is known to drift.
fn curve_by_spectrum(channel: &ChannelReport, add: &mut impl FnMut(String)) {
    let quarters = channel.nonstationarity.as_ref().and_then(|of| of.quarters);
    if ["temp", "supply"].contains(&channel.name.as_str()) || quarters.is_some_and(|of| of.is_nonstationary()) {
        return;
    }
    let drifts = channel.effects.iter().any(|shown| DRIFTS.contains(&shown.effect.name()));
    for &CurvePoint { tau_s, adev, edf, adev_by_spectrum, replaced_percent, .. } in &channel.curve {
        let is_compared = adev > 0.0 && replaced_percent == 0.0 && (tau_s < 1.0 || !drifts);
        let Some(by_spectrum) = adev_by_spectrum.filter(|_| is_compared) else { continue };
        // Both are estimates from the same samples; the spectrum has about as many degrees of freedom.
        let scatter = (1.0 / edf).sqrt();
        if (by_spectrum / adev).ln().abs() > CONTRADICTION * scatter + 0.02 {
            add(format!("{adev} at {tau_s} s, by the spectrum {by_spectrum} ({edf:.1} degrees of freedom)"));
        }
    }
}

/// True if two frequencies are of one line, or one of them is absent. Octaves tell a frequency to some tenths.
fn is_one_line(a: Option<f64>, b: Option<f64>) -> bool {
    a.zip(b).is_none_or(|(a, b)| (a / b).ln().abs() < 0.25)
}

fn frequency_of(term: &TermReport) -> Option<f64> {
    term.parameters().get("frequency").map(|frequency| frequency.value)
}

fn frequency(effect: &Effect) -> Option<f64> {
    effect.frequency_hz().map(|frequency_hz| frequency_hz.value)
}

/// A parameter of an effect and that of the model's term of the same kind.
fn effects_and_terms(channel: &ChannelReport, add: &mut impl FnMut(String)) {
    let effects = || channel.effects.iter().map(|shown| &shown.effect);
    for effect in effects() {
        // A term is the line whose frequency is nearest, which may be one that has no name.
        let is_nearest = |of: Option<f64>| {
            let distance = |other: &Effect| frequency(other).zip(of).map_or(f64::INFINITY, |(a, b)| (a / b).ln().abs());
            effects().all(|other| distance(effect) <= distance(other))
        };
        let is_same =
            |name: &str, of: Option<f64>| name == effect.name() && is_one_line(of, frequency(effect)) && is_nearest(of);
        let terms = channel.refitted.terms.iter().filter(|term| is_same(term.kind(), frequency_of(term)));
        let [term] = terms.collect::<Vec<_>>()[..] else { continue };
        if effects().filter(|other| is_same(other.name(), frequency(other))).count() > 1 {
            continue;
        }
        for (name, parameter) in effect.parameters() {
            if let Some(of) = term.parameters().get(name)
                && contradict(&parameter, of)
            {
                add(format!("effect {} {name} {parameter:?}, its term {of:?}", effect.name()));
            }
        }
    }
}

/// Each effect and the finding that it refers to.
fn effects_and_findings(report: &Report, channel: &ChannelReport, add: &mut impl FnMut(String)) {
    for shown in &channel.effects {
        let name = shown.effect.name();
        match report.findings.get(shown.finding) {
            None => add(format!("{name} refers to finding {}, which is absent", shown.finding)),
            Some(finding) => {
                // A channel in which a line is weak may not resolve the width that others show.
                let of_finding = finding.effect.name();
                let is_same = of_finding == name || (of_finding == "resonance" && name == "sinusoid");
                if !is_same || !finding.channels.contains(&channel.name) {
                    add(format!("{name} refers to the finding {of_finding} of {:?}", finding.channels));
                }
            }
        }
    }
}

/// Each term of the model of the whole record beyond the baseline, and an effect of the channel: of its kind, or of a kind whose
/// curve is that of the term. White noise beside a filter is that of rounding.
fn terms_in_findings(channel: &ChannelReport, add: &mut impl FnMut(String)) {
    let baseline = ["angle_random_walk", "bias_instability", "rate_random_walk"];
    // Terms stand for the rounding if it hides the noise.
    let is_rounding = |kind: &str| kind == "noise_below_count" || kind == "quantization";
    let effects = || channel.effects.iter().map(|shown| &shown.effect);
    if effects().any(|effect| is_rounding(effect.name())) {
        return;
    }
    // A term that the whole record no longer shows may have the size 0.
    let may_be_nothing = |term: &TermReport| {
        ["amplitude", "deviation"].iter().any(|of| term.parameters().get(*of).is_some_and(|of| of.low <= 0.0))
    };
    let added = |term: &&TermReport| !baseline.contains(&term.kind()) && !may_be_nothing(term);
    for term in channel.refitted.terms.iter().filter(added) {
        let of_term = frequency_of(term);
        let is_of = |kind: &str| effects().any(|effect| effect.name() == kind);
        // Disturbances of which the curve shows a line have the averaging time at which that is largest, 0.371/f, within an octave on
        // either side and the tenths to which octaves tell a frequency.
        let is_octave = |effect: &Effect| {
            let tau_s = match effect {
                Effect::Unexplained(unexplained) => unexplained.tau_s().map(|tau_s| tau_s.value),
                // The Allan deviation of exponential decays, as of a Markov process, is largest at 1.89 time constants.
                Effect::ShotNoise(decays) => Some(1.89 * decays.time_constant_s.value),
                _ => None,
            };
            tau_s.zip(of_term).is_some_and(|(tau_s, frequency)| (tau_s * frequency / 0.371).ln().abs() < 3f64.ln())
        };
        let is_told = match term.kind() {
            "sinusoid" | "resonance" => effects().any(|effect| {
                // Octaves tell a frequency to some tenths. A vibration has lines at multiples of its frequency, the lowest of which the
                // spectrum lists alone.
                frequency(effect).zip(of_term).is_some_and(|(of, frequency)| {
                    let multiple = (frequency / of).round().max(1.0);
                    (frequency / of / multiple).ln().abs() < 0.25
                }) || is_octave(effect)
            }),
            // Terms of the curve that a detector in the samples or in several channels names.
            "markov" => ["markov", "telegraph", "common_mode", "filter_bandwidth", "unexplained", "thermal_lag"]
                .iter()
                .any(|kind| is_of(kind)),
            "rate_ramp" => {
                ["rate_ramp", "telegraph", "common_mode", "unexplained", "sinusoid"].iter().any(|kind| is_of(kind))
            }
            kind => is_of(kind),
        };
        if !is_told {
            let effects: Vec<&str> = effects().map(Effect::name).collect();
            add(format!("the model has {} {:?}, and no effect of {effects:?} is it", term.kind(), term.parameters()));
        }
    }
}

/// Each line that is named, and the model: without it N would have its power. The Allan variance of a sinusoid of amplitude A is
/// largest where sin⁴x/x² is, at τ = 0.371/f, 0.525·A² (IEEE Std 952); a deviation of a resonance is that of the sinusoid over √2.
fn lines_in_model(channel: &ChannelReport, add: &mut impl FnMut(String)) {
    let model = &channel.refitted;
    for effect in channel.effects.iter().map(|shown| &shown.effect) {
        let parameters = effect.parameters();
        let of = |name: &str| parameters.get(name).map(|parameter| parameter.value);
        let (Some(frequency), Some(amplitude)) =
            (of("frequency"), of("amplitude").or_else(|| Some(2f64.sqrt() * of("deviation")?)))
        else {
            continue;
        };
        if !["sinusoid", "resonance"].contains(&effect.name()) || model.terms.len() == MAX_TERMS {
            continue;
        }
        let is_it = |term: &TermReport| is_one_line(frequency_of(term), Some(frequency)) && term.kind() != "markov";
        let has_it = model.terms.iter().filter(|term| term.parameters().contains_key("frequency")).any(is_it);
        let share = |point: &CurvePoint| {
            let x = PI * frequency * point.tau_s;
            (amplitude * x.sin().powi(2) / x).powi(2)
        };
        let is_visible =
            |point: &CurvePoint| share(point) * (0.5 * point.edf).sqrt() > CONTRADICTION * point.adev.powi(2);
        if !has_it && channel.curve.iter().any(is_visible) {
            add(format!("{} {parameters:?} is not in the model", effect.name()));
        }
    }
}

/// The model in the picture of the spectrum, and N in the table: where the model is white noise alone, its one-sided density is 2N².
fn spectrum_of_the_picture(channel: &ChannelReport, add: &mut impl FnMut(String)) {
    let Some(spectrum) = &channel.figure_data.spectrum else { return };
    let terms = &channel.refitted.terms;
    if terms.iter().any(|term| !["angle_random_walk", "bias_instability", "rate_random_walk"].contains(&term.kind())) {
        return;
    }
    let of = |kind: &str| value(&channel.refitted, kind).map_or(0.0, |of| of.value);
    let (n, b, k) = (of("angle_random_walk"), of("bias_instability"), of("rate_random_walk"));
    for (&frequency, &modelled) in spectrum.frequency_hz.iter().zip(&spectrum.model) {
        let omega = 2.0 * PI * frequency;
        // The one-sided densities of IEEE Std 952: N², B²/(2πf), K²/(2πf)². Near half the sample rate the sampled walk has up to (π/2)² times as much.
        let density = (2.0 * (n * n + b * b / omega + (k / omega).powi(2))).sqrt();
        if n > 0.0 && omega * n > 30.0 * k && (modelled / density).ln().abs() > 0.02 {
            add(format!("the picture's model has {modelled} at {frequency} Hz, its terms {density}"));
        }
    }
}

/// The filter of a channel's model and that of the part.
fn filter_of_the_part(report: &Report, channel: &ChannelReport, add: &mut impl FnMut(String)) {
    let Some(term) = channel.refitted.terms.iter().find(|term| term.kind() == "filter_bandwidth") else { return };
    let pairs = [("taps", &report.part.taps), ("decimation", &report.part.decimation)];
    for (name, of_part) in pairs {
        if let (Some(of_channel), Some(of_part)) = (term.parameters().get(name), of_part)
            && contradict(of_channel, of_part)
        {
            add(format!("filter {name} {of_channel:?}, of the part {of_part:?}"));
        }
    }
    if report.part.filter.as_deref() == Some("none") {
        add("a filter, where the part has none".to_owned());
    }
}

fn simulated(seconds: f64, seed: u64) -> Measurement {
    let simulation = if seed.is_multiple_of(2) {
        Simulation::paper(seconds, seed)
    } else {
        Simulation::demonstration(seconds, seed)
    };
    measurement(&simulation.run(|_| ()).expect("a simulation"), None).expect("a time base")
}

/// The contradictions in the reports of simulated recordings of these seeds, on all cores.
fn of_simulated(seconds: f64, seeds: std::ops::Range<u64>) -> Vec<String> {
    let workers = std::thread::available_parallelism().map_or(1, |count| count.get() as u64);
    let of_worker = &|worker: u64| {
        let own = seeds.clone().filter(move |seed| seed % workers == worker);
        let of_seed = |seed: u64| {
            let found = contradictions(&analyze(&simulated(seconds, seed)));
            found.into_iter().map(move |of| format!("{seed}: {of}"))
        };
        own.flat_map(of_seed).collect::<Vec<String>>()
    };
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..workers).map(|worker| scope.spawn(move || of_worker(worker))).collect();
        threads.into_iter().flat_map(|thread| thread.join().expect("an analysis")).collect()
    })
}

#[test]
fn reports_of_simulated_recordings_do_not_contradict_themselves() {
    let found = of_simulated(300.0, 0..4);
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
#[ignore = "long: a hundred simulated recordings"]
fn reports_of_a_hundred_simulated_recordings_do_not_contradict_themselves() {
    let found = of_simulated(900.0, 0..100);
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn reports_of_measured_recordings_do_not_contradict_themselves() {
    let test = "reports_of_measured_recordings_do_not_contradict_themselves";
    // The static recordings have no time stamps; their authors give the rate.
    let files = [
        ("adis16405-static/run1.csv.gz", Some(100.0)),
        ("adis16405-static/run2.csv.gz", Some(100.0)),
        ("adis16405-static/run3.csv.gz", Some(100.0)),
        ("adis16405-burst/launch10.csv.gz", None),
    ];
    let mut found = Vec::new();
    for (file, rate_hz) in files {
        let Some(path) = system_tests::recording(test, file) else { return };
        let recording = count_table::read(&path, GyroRange::Dps300).expect("a recording");
        let report = analyze(&measurement(&recording, rate_hz).expect("a time base"));
        found.extend(contradictions(&report).into_iter().map(|of| format!("{file}: {of}")));
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}
