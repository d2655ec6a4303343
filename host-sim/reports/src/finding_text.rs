//! Each finding in words: one sentence of physics and one of advice, made of its parameters. `docs/findings.md` explains every
//! sentence.

use crate::formatting::{capital, words};
use crate::rounding::{bounded_quantity, plain, quantity, quantity_digits, rounded_quantity, significant, span};
use noise_analysis::report::{Finding, Parameter, Validation};

/// Every kind of finding that has its own sentences, in the order of `docs/findings.md`.
pub const KINDS: [&str; 26] = [
    "filter_bandwidth",
    "sinusoid",
    "resonance",
    "square_wave",
    "telegraph",
    "markov",
    "common_mode",
    "shared_drift",
    "rate_ramp",
    "bias_step",
    "temperature",
    "temperature_squared",
    "thermal_lag",
    "supply",
    "acceleration",
    "vibration_rectification",
    "quantization",
    "noise_below_count",
    "spikes",
    "knock",
    "motion",
    "saturated",
    "dropped_samples",
    "repeated_samples",
    "sample_clock",
    "unexplained",
];

/// Frequency of a line below which nothing that turns or hums makes it, Hz.
const SLOW_HZ: f64 = 0.2;
/// Advice for such a line.
const CYCLING: &str =
    "Look for what cycles at this period, such as a thermostat, an air conditioner or a load on the supply.";

/// What is said of a finding.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FindingText {
    /// The channels that show it, such as `gyro z` or `accel x y`.
    pub channels: String,
    /// What it is, with its size.
    pub physics: String,
    /// The same without intervals, for one line.
    pub brief: String,
    /// What to do about it, or what to look for.
    pub advice: String,
    /// How much of the variance it makes, and whether the second half confirms it; where neither is known, the evidence in short.
    pub weight: String,
}

/// The words for `finding`.
#[must_use]
pub fn describe(finding: &Finding) -> FindingText {
    let (physics, advice) = sentences(finding, bounded_quantity, &reaches(finding));
    let (brief, _) = sentences(finding, rounded_quantity, "");
    FindingText { channels: channel_list(&finding.channels), physics, brief, advice, weight: weight(finding) }
}

/// The largest share of the variance, and what the second half says.
fn weight(finding: &Finding) -> String {
    let largest = finding.share_percent.values().copied().filter(|share| share.is_finite()).fold(0.0, f64::max);
    let share = (largest >= 0.5).then(|| format!("up to {} % of σ²", significant(largest.min(100.0), 2)));
    let held = match finding.validated {
        Validation::Yes => Some("the second half confirms it".to_owned()),
        Validation::No => Some("the second half does not confirm it".to_owned()),
        Validation::Untestable => None,
    };
    let told = share.into_iter().chain(held).collect::<Vec<_>>().join("; ");
    if told.is_empty() { first_clause(&finding.evidence) } else { told }
}

/// Characters of the evidence that a line has room for.
const CLAUSE: usize = 70;

/// First parts of the units that evidence is in.
const UNITS: [&str; 8] = ["deg", "g", "gauss", "V", "Hz", "s", "degC", "1"];

/// The evidence of the analysis as it is printed. A probability below the smallest number is not 0, and a number with a unit has a
/// prefix in that instead of an exponent.
#[must_use]
pub(crate) fn printed_evidence(evidence: &str) -> String {
    let mut printed = Vec::new();
    let mut words = evidence.split(' ').peekable();
    while let Some(word) = words.next() {
        let value = word.contains('e').then(|| word.parse::<f64>().ok()).flatten();
        let unit = words.peek().map_or("", |next| next.trim_end_matches([',', ';', '.', ':']));
        match (value, word.strip_prefix("0e0")) {
            (Some(value), _) if unit.split('/').next().is_some_and(|first| UNITS.contains(&first)) => {
                let mark = words.next().map_or("", |next| &next[unit.len()..]);
                printed.push(format!("{}{mark}", quantity_digits(value, unit, 3)));
            }
            (_, Some(mark)) if mark.chars().all(|of| ",;.".contains(of)) => printed.push(format!("below 1e-300{mark}")),
            _ => printed.push(word.to_owned()),
        }
    }
    printed.join(" ")
}

/// The evidence of the analysis up to its first semicolon, or as much of it as there is room for.
fn first_clause(evidence: &str) -> String {
    let evidence = printed_evidence(evidence);
    let clause = evidence.split(';').next().unwrap_or_default();
    let short = clause.split(" before it was added").next().unwrap_or_default().trim_end_matches('.');
    if short.chars().count() <= CLAUSE {
        return short.to_owned();
    }
    let cut: String = short.chars().take(CLAUSE).collect();
    let whole = cut.rsplit_once(' ').map_or(cut.as_str(), |(whole, _)| whole);
    format!("{} …", whole.trim_end_matches([',', ':']))
}

/// By how much σ falls without a part of the variance, %, of the channel with the largest share; `None` where it is not known.
fn gain(finding: &Finding) -> Option<String> {
    let share = finding.share_percent.values().copied().fold(0.0, f64::max) / 100.0;
    (share > 0.0 && share < 1.0).then(|| significant(100.0 * (1.0 - (1.0 - share).sqrt()), 2))
}

fn reaches(finding: &Finding) -> String {
    let these = if finding.channels.len() > 1 { "these channels" } else { "this channel" };
    format!(" reaches {these}")
}

/// The sentence of physics and the sentence of advice; `amount` writes a parameter, and `reaches` comes after what reaches the
/// channels from outside.
fn sentences(finding: &Finding, amount: impl Fn(&Parameter) -> String, reaches: &str) -> (String, String) {
    let parameter = |name: &str| finding.parameters.get(name);
    let value = |name: &str| parameter(name).map(|parameter| parameter.value);
    // The parameter with its interval, or words where the finding lacks it.
    let sized = |name: &str| parameter(name).map_or_else(|| "unknown size".to_owned(), &amount);
    let at = |name: &str| value(name).map_or_else(|| "an unknown time".to_owned(), span);
    let off = || {
        gain(finding)
            .map_or_else(String::new, |percent| format!(" It would take {percent} % off σ where it is largest."))
    };
    let pair = |physics: String, advice: &str| (physics, advice.to_owned());
    match finding.kind.as_str() {
        "filter_bandwidth" => match (value("taps"), value("decimation")) {
            (Some(taps), Some(decimation)) if (decimation - 1.0).abs() > 1e-9 => pair(
                format!(
                    "The part's low-pass filter of {} taps, read every {} of its samples.",
                    plain(taps, 3),
                    parameter("decimation").map_or_else(String::new, &amount)
                ),
                "Nothing to repair; N holds below the corner of the filter, and a model for a Kalman filter at this rate is white.",
            ),
            (Some(taps), _) => pair(
                format!("The part's low-pass filter of {} taps smooths neighbouring samples.", plain(taps, 3)),
                "Nothing to repair; take N from averaging times longer than the filter, or use fewer taps for more bandwidth.",
            ),
            _ => pair(
                format!("A low-pass filter with a bandwidth of {}.", sized("bandwidth")),
                "Nothing to repair; N holds below the bandwidth, and the samples are correlated above it.",
            ),
        },
        "sinusoid" if value("frequency").is_some_and(|frequency| frequency < SLOW_HZ) => (
            format!(
                "A periodic change at {}, every {}{reaches}: an amplitude of {}.",
                sized("frequency"),
                value("frequency").map_or_else(|| "unknown time".to_owned(), |frequency| span(1.0 / frequency)),
                sized("amplitude")
            ),
            format!("{CYCLING}{}", off()),
        ),
        "resonance" if value("frequency").is_some_and(|frequency| frequency < SLOW_HZ) => (
            format!(
                "A fluctuation around {}, every {} or so{}: {} (1 σ).",
                sized("frequency"),
                value("frequency").map_or_else(|| "unknown time".to_owned(), |frequency| span(1.0 / frequency)),
                if reaches.is_empty() { String::new() } else { format!(",{reaches}") },
                sized("deviation")
            ),
            format!("{CYCLING}{}", off()),
        ),
        "sinusoid" => (
            format!("A vibration or hum at {}{reaches}: a narrow line of {}.", sized("frequency"), sized("amplitude")),
            format!("Look for a fan, a motor or the mains; a notch there would help.{}", off()),
        ),
        "resonance" => (
            format!(
                "A vibration around {}, {} wide{}: {} (1 σ).",
                sized("frequency"),
                value("bandwidth").map_or_else(|| "some hertz".to_owned(), |width| quantity(width, "Hz")),
                if reaches.is_empty() { String::new() } else { format!(",{reaches}") },
                sized("deviation")
            ),
            format!("Look for a fan whose speed wanders or a loose mount; stiffen the mount or notch the band.{}", off()),
        ),
        "square_wave" => (
            format!("A square wave of {} with an amplitude of {}.", sized("frequency"), sized("amplitude")),
            format!("Look for a load on the supply or a heater that switches at this rate.{}", off()),
        ),
        "telegraph" => (
            // Between two jumps of a symmetrical telegraph signal lie two correlation times on average.
            format!(
                "The bias jumps between two levels {} apart, on average every {}: a time constant of {}.",
                sized("amplitude"),
                value("time_constant").map_or_else(|| "unknown time".to_owned(), |time| span(2.0 * time)),
                parameter("time_constant").map_or_else(|| "unknown length".to_owned(), &amount)
            ),
            "Random telegraph noise lies in the part; try another part, or model it as a Markov process of this time constant."
                .to_owned(),
        ),
        "markov" => (
            format!(
                "A noise with a memory of {} and a size of {} (1 σ).",
                parameter("time_constant").map_or_else(|| "unknown length".to_owned(), &amount),
                sized("deviation")
            ),
            "Give the filter a first-order Gauss-Markov state of this time constant and size.".to_owned(),
        ),
        "common_mode" | "shared_drift" => (
            {
                let size = ["deviation", "amplitude", "size"].iter().find_map(|name| parameter(name));
                let size = size.map_or_else(String::new, |size| format!(" of {}", amount(size)));
                format!("A slow drift{size} in common, which nothing recorded explains.")
            },
            "Record temperature and supply beside the channels; look for a slow change in the room or the mount.".to_owned(),
        ),
        "rate_ramp" => (
            format!("The bias drifts in a straight line by {}.", sized("slope")),
            "Let the part warm up before recording, or discard the beginning; correct the bias more often than this drift allows."
                .to_owned(),
        ),
        "bias_step" => (
            format!("The bias stepped by {} at {}.", sized("size"), at("time")),
            "Look for a shock, a changed supply or a touched cable at that time; cut the record there.".to_owned(),
        ),
        "temperature" => (
            format!("The bias follows the temperature with {}.", sized("sensitivity")),
            format!("Subtract this sensitivity times the change of temperature.{}", off()),
        ),
        "temperature_squared" => (
            format!(
                "The bias follows the temperature by a parabola: {} and {}.",
                sized("sensitivity"),
                sized("curvature")
            ),
            format!("Compensate with the second-order law, or calibrate over the whole range of temperature.{}", off()),
        ),
        "thermal_lag" => (
            format!(
                "The bias follows the temperature with {} through a lag of {}.",
                sized("sensitivity"),
                parameter("time_constant").map_or_else(|| "unknown length".to_owned(), &amount)
            ),
            format!("Compensate with the temperature behind a low-pass filter of this time constant.{}", off()),
        ),
        "supply" => (
            format!("The bias follows the supply voltage with {}.", sized("sensitivity")),
            format!("Regulate the supply, or subtract this sensitivity times its change.{}", off()),
        ),
        "acceleration" => {
            let axes: Vec<String> = ["x", "y", "z"]
                .iter()
                .filter_map(|axis| Some(format!("{} ({axis})", amount(parameter(&format!("sensitivity_{axis}"))?))))
                .collect();
            (
                format!(
                    "The rate follows the specific force: {}.",
                    if axes.is_empty() { "unknown size".to_owned() } else { axes.join(", ") }
                ),
                format!("Subtract these sensitivities times the accelerometers, or mount the part more stiffly.{}", off()),
            )
        }
        "vibration_rectification" => (
            format!("The bias follows the strength of the vibration with {}.", sized("sensitivity")),
            "Isolate the part from vibration, or compensate with the variance of the acceleration.".to_owned(),
        ),
        "quantization" => (
            format!(
                "Rounding shows: {}.",
                parameter("step").map_or_else(
                    || format!("a quantization noise of {}", sized("value")),
                    |step| format!("only every value {} apart occurs", amount(step))
                )
            ),
            "Read the part with more bits or in a smaller range; short averaging times are dominated by rounding.".to_owned(),
        ),
        "noise_below_count" => (
            "The noise is smaller than a count: the samples repeat one value and hide what is below it.".to_owned(),
            "Take no coefficient from the short averaging times; use a smaller range, or add dither.".to_owned(),
        ),
        "spikes" => (
            format!("Single samples stand out by {}, {}.", sized("size"), sized("rate")),
            "Check the wiring and the bus for interference; a filter should reject such samples.".to_owned(),
        ),
        "knock" => (
            format!(
                "The part was knocked from {} to {}: the noise is {} times that beside it.",
                at("from"),
                at("to"),
                value("level").map_or_else(|| "many".to_owned(), |level| significant(level, 2))
            ),
            "These samples are left out; keep hands and machines off the bench while recording.".to_owned(),
        ),
        "motion" => (
            format!("The platform moved{}.", interval_words(&at, value("from").is_some())),
            "The models were fitted to these samples too, and noise needs a part at rest: record it again on a firm support.".to_owned(),
        ),
        "saturated" => (
            format!(
                "The channel reached the end of its range{}.",
                value("fraction").map_or_else(String::new, |of| format!(" in {} % of the samples", significant(100.0 * of, 2)))
            ),
            "Use a larger range; what was cut off makes the noise look too small.".to_owned(),
        ),
        "dropped_samples" => (
            format!("{} of the samples never arrived.", share(value("fraction"))),
            "Check the reader's load and its queue; the curve bridges the gaps and says where it does.".to_owned(),
        ),
        "repeated_samples" => (
            format!("{} of the samples are copies of the one before.", share(value("fraction"))),
            "Read the part at its data-ready signal; copies make white noise look correlated.".to_owned(),
        ),
        "sample_clock" => (
            format!("The clock of the samples runs at {}.", sized("rate_hz")),
            "State this rate: every averaging time and N scale with it.".to_owned(),
        ),
        "unexplained" => (format!("{} fits no known effect.", capital(&unexplained_place(finding))), "Look at the channel's figures at that place; a longer record, or temperature and supply beside it, may tell the cause.".to_owned()),
        kind => (
            format!("{}: {}.", words(kind), printed_evidence(&finding.evidence).trim_end_matches('.')),
            "This version of the report has no words for it; the evidence is that of the analysis.".to_owned(),
        ),
    }
}

/// ` from … to …`, where the times are known.
fn interval_words(at: &impl Fn(&str) -> String, known: bool) -> String {
    if known { format!(" from {} to {}", at("from"), at("to")) } else { String::new() }
}

/// A fraction in percent.
fn share(fraction: Option<f64>) -> String {
    fraction.map_or_else(|| "Some".to_owned(), |fraction| format!("{} %", significant(100.0 * fraction, 2)))
}

/// Where something is unexplained, and by how much.
#[must_use]
fn unexplained_place(finding: &Finding) -> String {
    let (place, excess) = place_and_excess(finding);
    excess
        .map_or_else(|| format!("what is measured {place}"), |excess| format!("{} {place}", signed_percent(&[excess])))
}

/// Where something is unexplained, and by how many percent.
pub(crate) fn place_and_excess(finding: &Finding) -> (String, Option<f64>) {
    let value = |name: &str| finding.parameters.get(name).map(|parameter| parameter.value);
    let place = match (value("tau"), value("frequency"), value("time")) {
        (Some(tau), Some(frequency), _) => {
            format!("at averaging times around {}, as by a line at {}", span(tau), quantity(frequency, "Hz"))
        }
        (Some(tau), None, _) => format!("at averaging times around {}", span(tau)),
        (None, Some(frequency), _) => format!("around {}", quantity(frequency, "Hz")),
        (None, None, Some(time)) => format!("at {} into the record", span(time)),
        _ => "somewhere".to_owned(),
    };
    (place, value("excess_percent"))
}

/// Percentages with their signs, as a range where there are several: `−2.1 … −3.6 %`.
pub(crate) fn signed_percent(values: &[f64]) -> String {
    let low = values.iter().copied().fold(f64::INFINITY, |low, of| if of.abs() < f64::abs(low) { of } else { low });
    let high = values.iter().copied().fold(0.0, |high, of| if of.abs() > f64::abs(high) { of } else { high });
    let text = |value: f64| format!("{}{}", if value < 0.0 { "−" } else { "+" }, significant(value.abs(), 2));
    let (low, high) = (text(low), text(high));
    if low == high { format!("{low} %") } else { format!("{low} … {high} %") }
}

/// The channels of a list in few words: `gyros` for all three, `accel x y` for two.
#[must_use]
pub fn channel_list(names: &[String]) -> String {
    let axes = |prefix: &str| -> Vec<&str> { names.iter().filter_map(|name| name.strip_prefix(prefix)).collect() };
    let (gyros, accelerometers, magnetometers) = (axes("gyro_"), axes("accl_"), axes("magn_"));
    if gyros.len() == 3 && accelerometers.len() == 3 {
        return "all channels".to_owned();
    }
    let group = |axes: &[&str], one: &str, all: &str| match axes {
        [] => None,
        axes if axes.len() == 3 => Some(all.to_owned()),
        axes => Some(format!("{one} {}", axes.join(" "))),
    };
    let groups = [
        group(&gyros, "gyro", "gyros"),
        group(&accelerometers, "accel", "accels"),
        group(&magnetometers, "magn", "magns"),
    ];
    let others = names.iter().filter(|name| ["gyro_", "accl_", "magn_"].iter().all(|prefix| !name.starts_with(prefix)));
    groups.into_iter().flatten().chain(others.map(|name| words(name))).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(list: &[&str]) -> Vec<String> {
        list.iter().map(|name| (*name).to_owned()).collect()
    }

    fn finding(kind: &str) -> Finding {
        Finding {
            kind: kind.to_owned(),
            channels: vec!["gyro_z".to_owned()],
            parameters: Default::default(),
            evidence: "of the analysis".to_owned(),
            validated: Validation::Untestable,
            share_percent: Default::default(),
        }
    }

    /// The page with single spaces in the place of line breaks.
    fn documentation() -> String {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/findings.md");
        let page = std::fs::read_to_string(path).expect("docs/findings.md");
        page.split_whitespace().collect::<Vec<_>>().join(" ")
    }

    /// What stands in the place of a parameter that a finding lacks.
    const UNKNOWN: [&str; 5] = ["unknown size", "unknown length", "an unknown time", "unknown time", "some hertz"];

    /// The words of a text between its numbers, units and names: what does not depend on the parameters.
    fn fixed_words(text: &str) -> Vec<String> {
        let text = UNKNOWN.iter().fold(text.to_owned(), |text, unknown| text.replace(unknown, "0"));
        let names = [
            "x", "y", "z", "gyro", "gyros", "accel", "accels", "g", "mg", "µg", "s", "ms", "min", "h", "d", "V", "Hz",
            "mHz",
        ];
        let mut runs = vec![Vec::new()];
        for word in text.split_whitespace() {
            let bare = word.trim_matches(|letter: char| ".,:;()!*".contains(letter));
            let is_word =
                bare.chars().all(|letter| letter.is_alphabetic() || "-'".contains(letter)) && !bare.is_empty();
            if is_word && !names.contains(&bare) {
                runs.last_mut().expect("one at least").push(bare);
            }
            if !is_word || names.contains(&bare) || bare != word {
                runs.push(Vec::new());
            }
        }
        runs.iter().filter(|run| run.len() > 1).map(|run| run.join(" ")).collect()
    }

    /// A finding of `kind` with those of all parameters that any finding has whose names `wanted` accepts.
    fn finding_with(kind: &str, wanted: impl Fn(&str) -> bool) -> Finding {
        let known = [
            ("amplitude", "deg/s"),
            ("bandwidth", "Hz"),
            ("curvature", "deg/s/degC^2"),
            ("decimation", ""),
            ("deviation", "deg/s"),
            ("excess_percent", "%"),
            ("fraction", ""),
            ("frequency", "Hz"),
            ("from", "s"),
            ("level", ""),
            ("rate", "1/h"),
            ("rate_hz", "Hz"),
            ("sensitivity", "deg/s/degC"),
            ("sensitivity_x", "deg/s/g"),
            ("sensitivity_y", "deg/s/g"),
            ("sensitivity_z", "deg/s/g"),
            ("size", "deg/s"),
            ("slope", "deg/s^2"),
            ("step", "deg/s"),
            ("taps", ""),
            ("tau", "s"),
            ("time", "s"),
            ("time_constant", "s"),
            ("to", "s"),
            ("value", "deg"),
        ];
        let mut finding = finding(kind);
        for (name, unit) in known.into_iter().filter(|(name, _)| wanted(name)) {
            finding.parameters.insert(name.to_owned(), Parameter::new(7.0, 6.0, 8.0, unit));
        }
        finding
    }

    /// Every combination of parameters that chooses between the sentences of a kind: all, none, one alone, all but one.
    fn variants(kind: &str) -> Vec<Finding> {
        let names: Vec<String> = finding_with(kind, |_| true).parameters.into_keys().collect();
        let mut variants = vec![finding_with(kind, |_| true), finding_with(kind, |_| false)];
        for name in &names {
            variants.push(finding_with(kind, |of| of == name));
            variants.push(finding_with(kind, |of| of != name));
        }
        // The filter of a part whose every sample is read.
        let mut every_sample = finding_with(kind, |_| true);
        every_sample.parameters.insert("decimation".to_owned(), Parameter::new(1.0, 1.0, 1.0, ""));
        let mut slow = finding_with(kind, |_| true);
        slow.parameters.insert("frequency".to_owned(), Parameter::new(0.012, 0.011, 0.013, "Hz"));
        // Several channels, a share, and what the second half says.
        let mut shared = finding_with(kind, |_| true);
        shared.channels.push("accl_x".to_owned());
        shared.share_percent.insert("gyro_z".to_owned(), 60.0);
        shared.validated = Validation::Yes;
        let mut refuted = shared.clone();
        refuted.validated = Validation::No;
        variants.extend([every_sample, slow, shared, refuted]);
        variants
    }

    #[test]
    fn every_sentence_of_every_kind_is_in_the_documentation() {
        let page = documentation();
        let general = page.split("## The findings").nth(1).and_then(|rest| rest.split("### `").next()).expect("a part");
        assert!(UNKNOWN.iter().all(|unknown| general.contains(unknown)), "{general}");
        for kind in KINDS {
            let section =
                page.split(&format!("### `{kind}` ")).nth(1).unwrap_or_else(|| panic!("{kind} has no section"));
            let section = section.split(" ### `").next().unwrap_or_default();
            for finding in variants(kind) {
                let text = describe(&finding);
                assert!(text.physics.ends_with('.') && text.advice.ends_with('.'), "{kind}: {text:?}");
                // Not that of a kind without words.
                assert!(!text.physics.contains("of the analysis"), "{kind}: {}", text.physics);
                for words in [&text.physics, &text.brief, &text.advice].into_iter().flat_map(|text| fixed_words(text)) {
                    // Parameters in words, and the gain, are explained once for all kinds.
                    let is_known = section.contains(&words) || general.contains(&words);
                    assert!(is_known, "{kind}: the page lacks \"{words}\" of {text:?}");
                }
                if text.weight != "of the analysis" {
                    let words = fixed_words(&capital(&text.weight));
                    assert!(words.iter().all(|words| general.contains(&capital(words))), "{kind}: {}", text.weight);
                }
            }
        }
        // A kind without words is told by its evidence.
        assert!(describe(&finding("something_new")).physics.contains("something new: of the analysis."));
    }

    #[test]
    fn sizes_in_words_are_those_of_their_definitions() {
        // A symmetrical telegraph signal with the covariance (A/2)²·exp(−t/T) jumps every 2 T on average.
        let mut telegraph = finding("telegraph");
        telegraph.parameters.insert("amplitude".to_owned(), Parameter::new(0.3, 0.29, 0.31, "deg/s"));
        telegraph.parameters.insert("time_constant".to_owned(), Parameter::new(20.0, 15.0, 27.0, "s"));
        let physics = describe(&telegraph).physics;
        assert!(physics.contains("0.300 ± 0.010 °/s apart, on average every 40 s: a time constant of 20"), "{physics}");
        // The amplitude of a square wave is half the distance of its levels.
        let mut square = finding("square_wave");
        square.parameters.insert("amplitude".to_owned(), Parameter::new(9e-4, 8e-4, 1e-3, "g"));
        assert!(
            describe(&square).physics.ends_with("with an amplitude of 900 ± 100 µg."),
            "{}",
            describe(&square).physics
        );
    }

    #[test]
    fn a_probability_that_underflows_is_bounded() {
        let line = "line at 20.5 Hz, 220 sigma, by chance anywhere 0e0; a steady line of 10e0 and 0e0x";
        let printed = "line at 20.5 Hz, 220 sigma, by chance anywhere below 1e-300; a steady line of 10e0 and 0e0x";
        assert_eq!(printed_evidence(line), printed);
        let line = "moves with accl_x at 2.92e0 deg/s/g, 5 sigma; -3.1e-5 g, by chance 3e-9; 1e-12 of it";
        let printed = "moves with accl_x at 2.92 °/s/g, 5 sigma; −31.0 µg, by chance 3e-9; 1e-12 of it";
        assert_eq!(printed_evidence(line), printed);
    }

    #[test]
    fn a_share_becomes_a_gain_in_sigma() {
        let mut line = finding("sinusoid");
        line.parameters.insert("frequency".to_owned(), Parameter::new(20.5, 20.4, 20.6, "Hz"));
        line.share_percent.insert("gyro_z".to_owned(), 75.0);
        let text = describe(&line);
        assert!(
            text.physics.starts_with("A vibration or hum at 20.50 ± 0.10 Hz reaches this channel"),
            "{}",
            text.physics
        );
        // 1 − √(1 − 0.75) = 50 %.
        assert!(text.advice.ends_with("It would take 50 % off σ where it is largest."), "{}", text.advice);
        assert_eq!(text.weight, "up to 75 % of σ²");
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
            assert_eq!(channel_list(&names(list)), text);
        }
    }
}
