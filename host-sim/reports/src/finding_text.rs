//! Each finding in words: one sentence of physics and one of advice, made of its parameters. `docs/findings.md` explains every
//! sentence.

#[cfg(test)]
mod examples;

use crate::evidence::{EvidenceText, NumberStyle};
use crate::formatting::words;
use crate::rounding::{bounded_quantity, plain, quantity, rounded_quantity, significant, span};
use noise_analysis::bounds::{BoundedEstimate, ChannelEstimate};
use noise_analysis::effects::{Effect, Unexplained, UnexplainedPlace};
use noise_analysis::report::{Finding, Parameter, Validation};
use std::f64::consts::SQRT_2;

/// Frequency of a line below which nothing that turns or hums makes it, Hz.
const SLOW_HZ: f64 = 0.2;
/// Advice for such a line.
const CYCLING: &str =
    "Look for what cycles at this period, such as a thermostat, an air conditioner or a load on the supply";

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
    /// The first of that, as a sentence; `None` where nothing is left to do.
    pub step: Option<String>,
    /// How much of the variance it makes, and whether the second half confirms it; where neither is known, the evidence in short.
    pub weight: String,
    /// Whether the weight is not the evidence.
    pub is_weighed: bool,
}

/// What to do about a finding.
struct Advice {
    /// Without a full stop.
    first: &'static str,
    /// With the sign that ends the first.
    rest: String,
    /// Whether the analysis or the part has done it.
    is_done: bool,
}

impl Advice {
    fn new(first: &'static str, rest: impl Into<String>) -> Self {
        Self { first, rest: rest.into(), is_done: false }
    }

    fn done(first: &'static str, rest: &str) -> Self {
        Self { first, rest: rest.to_owned(), is_done: true }
    }
}

/// The words for `finding`.
#[must_use]
pub fn describe(finding: &Finding) -> FindingText {
    let (physics, advice) = sentences(finding, &bounded_quantity, &reaches(finding));
    let (brief, _) = sentences(finding, &rounded_quantity, "");
    let weighed = weight(finding);
    let is_weighed = weighed.is_some();
    FindingText {
        channels: channel_list(&finding.channels),
        physics,
        brief,
        step: (!advice.is_done).then(|| format!("{}.", advice.first)),
        advice: format!("{}{}", advice.first, advice.rest),
        weight: weighed.unwrap_or_else(|| evidence_in_short(finding)),
        is_weighed,
    }
}

/// The largest share of the variance, and what the second half says; `None` where neither is known.
fn weight(finding: &Finding) -> Option<String> {
    let largest = finding.share_percent.values().copied().filter(|share| share.is_finite()).fold(0.0, f64::max);
    let share = (largest >= 0.5).then(|| format!("up to {} % of σ²", significant(largest.min(100.0), 2)));
    let held = match finding.validated {
        Validation::Yes => Some("the second half confirms it".to_owned()),
        Validation::No => Some("the second half does not confirm it".to_owned()),
        Validation::Untestable => None,
    };
    let told = share.into_iter().chain(held).collect::<Vec<_>>().join("; ");
    (!told.is_empty()).then_some(told)
}

/// Characters of the evidence that a line has room for.
const CLAUSE: usize = 70;

/// What was measured, or as much of it as there is room for.
fn evidence_in_short(finding: &Finding) -> String {
    let EvidenceText { measured, .. } = EvidenceText::of_finding(finding, NumberStyle::Prefixed);
    if measured.chars().count() <= CLAUSE {
        return measured;
    }
    let cut: String = measured.chars().take(CLAUSE).collect();
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

/// The sentence of physics and the advice; `amount` writes a parameter, and `reaches` comes after what reaches the channels from
/// outside.
fn sentences(finding: &Finding, amount: &dyn Fn(&Parameter) -> String, reaches: &str) -> (String, Advice) {
    let off = || {
        gain(finding)
            .map_or_else(String::new, |percent| format!(" It would take {percent} % off σ where it is largest."))
    };
    let size = |of: ChannelEstimate| amount(&of.parameter());
    let per = |of: ChannelEstimate, unit: &str| amount(&of.parameter_per(unit));
    let hertz = |of: BoundedEstimate| amount(&of.parameter("Hz"));
    let seconds = |of: BoundedEstimate| amount(&of.parameter("s"));
    let period = |frequency_hz: BoundedEstimate| span(1.0 / frequency_hz.value);
    // Between commas.
    let reaching = || if reaches.is_empty() { String::new() } else { format!(",{reaches}") };
    match &finding.effect {
        Effect::OutputFilter(of) if (of.decimation.value - 1.0).abs() > 1e-9 => (
            format!(
                "The part's low-pass filter of {} taps, read every {} of its samples.",
                plain(of.taps.value, 3),
                amount(&of.decimation.parameter(""))
            ),
            Advice::done(
                "Nothing to repair",
                "; N holds below the corner of the filter, and a model for a Kalman filter at this rate is white.",
            ),
        ),
        Effect::OutputFilter(of) => (
            format!("The part's low-pass filter of {} taps smooths neighbouring samples.", plain(of.taps.value, 3)),
            Advice::done(
                "Nothing to repair",
                "; take N from averaging times longer than the filter, or use fewer taps for more bandwidth.",
            ),
        ),
        Effect::FirstOrderFilter(of) => (
            format!("A low-pass filter with a bandwidth of {}.", hertz(of.bandwidth_hz)),
            Advice::done(
                "Nothing to repair",
                "; N holds below the bandwidth, and the samples are correlated above it.",
            ),
        ),
        Effect::SinusoidalLine(of) if of.frequency_hz.value < SLOW_HZ => (
            format!(
                "A periodic change at {}, every {}{reaches}: an amplitude of {}.",
                hertz(of.frequency_hz),
                period(of.frequency_hz),
                size(of.amplitude)
            ),
            Advice::new(CYCLING, format!(".{}", off())),
        ),
        Effect::SinusoidalLine(of) if of.is_at_half_rate() => (
            format!(
                "Every second sample is off by {}: a line at half of the sample rate, {}.",
                // The deviation of the line is half of the offset.
                size(of.amplitude.scaled(SQRT_2)),
                hertz(of.frequency_hz)
            ),
            Advice::new(
                "Look for two converters or two readers that take turns",
                format!("; the mean of two samples has none of it.{}", off()),
            ),
        ),
        Effect::SinusoidalLine(of) => (
            format!(
                "A vibration or hum at {}{reaches}: a narrow line of {}.",
                hertz(of.frequency_hz),
                size(of.amplitude)
            ),
            Advice::new("Look for a fan, a motor or the mains", format!("; a notch there would help.{}", off())),
        ),
        Effect::ResonantLine(of) if of.frequency_hz.value < SLOW_HZ => (
            format!(
                "A fluctuation around {}, every {} or so{}: {} (1 σ).",
                hertz(of.frequency_hz),
                period(of.frequency_hz),
                reaching(),
                size(of.deviation)
            ),
            Advice::new(CYCLING, format!(".{}", off())),
        ),
        Effect::ResonantLine(of) => (
            format!(
                "A vibration around {}, {} wide{}: {} (1 σ).",
                hertz(of.frequency_hz),
                quantity(of.bandwidth_hz.value, "Hz"),
                reaching(),
                size(of.deviation)
            ),
            Advice::new(
                "Look for a fan whose speed wanders or a loose mount",
                format!("; stiffen the mount or notch the band.{}", off()),
            ),
        ),
        Effect::ModulatedLine(of) => {
            let (changes, depth) = if of.of_phase {
                ("phase goes to and fro", of.depth.parameter("rad"))
            } else {
                ("amplitude swells and fades", of.depth.scaled(100.0).parameter("%"))
            };
            (
                format!(
                    "A vibration or hum at {}{reaches}: a line of {} whose {changes} by {} every {}.",
                    hertz(of.frequency_hz),
                    size(of.amplitude),
                    amount(&depth),
                    seconds(of.period_s)
                ),
                Advice::new(
                    "Look for a machine whose load changes at this period, or for two that run at nearly one speed",
                    format!(".{}", off()),
                ),
            )
        }
        Effect::Chirp(of) => (
            format!(
                "A line whose frequency runs from {} to {}, by {}{reaches}: an amplitude of {}.",
                hertz(of.start_hz),
                hertz(of.end_hz),
                amount(&of.rate_hz_per_s.parameter("Hz/s")),
                size(of.amplitude)
            ),
            Advice::new("Look for a motor whose speed changes over the record", format!(".{}", off())),
        ),
        Effect::Periodic(of) => (
            format!(
                "A change that repeats every {} and is no sinusoid{reaches}: a fundamental at {} with an amplitude of {}.",
                span(1.0 / of.frequency_hz.value),
                hertz(of.frequency_hz),
                size(of.amplitude)
            ),
            Advice::new(CYCLING, format!(".{}", off())),
        ),
        Effect::SquareWave(of) => (
            format!("A square wave of {} with an amplitude of {}.", hertz(of.frequency_hz), size(of.amplitude)),
            Advice::new("Look for a load on the supply or a heater that switches at this rate", format!(".{}", off())),
        ),
        Effect::TelegraphNoise(of) => (
            // Between two jumps of a symmetrical telegraph signal lie two correlation times on average.
            format!(
                "The bias jumps between two levels {} apart, on average every {}: a time constant of {}.",
                size(of.amplitude),
                span(2.0 * of.time_constant_s.value),
                seconds(of.time_constant_s)
            ),
            Advice::new(
                "Random telegraph noise lies in the part",
                "; try another part, or model it as a Markov process of this time constant.",
            ),
        ),
        Effect::ShotNoise(of) => (
            format!(
                "Disturbances of {} begin at once and decay with a time constant of {}, {}.",
                size(of.size),
                seconds(of.time_constant_s),
                amount(&of.rate_per_hour.parameter("1/h"))
            ),
            Advice::new(
                "Look for what strikes the part or draws from its supply at random times",
                format!("; a Gauss-Markov state of this time constant has the same spectrum.{}", off()),
            ),
        ),
        Effect::MarkovProcess(of) => (
            format!(
                "A noise with a memory of {} and a size of {} (1 σ).",
                seconds(of.time_constant_s),
                size(of.deviation)
            ),
            Advice::new("Give the filter a first-order Gauss-Markov state of this time constant and size", "."),
        ),
        Effect::CommonMode(of) => (
            format!("A slow drift of {} in common, which nothing recorded explains.", size(of.deviation)),
            Advice::new(RECORD_CONDITIONS, "; look for a slow change in the room or the mount."),
        ),
        Effect::SharedDrift(of) => (
            format!(
                "A slow drift in common with {}, {} of it, which nothing recorded explains.",
                channel_list(&[of.with.to_owned()]),
                per(of.ratio, of.per)
            ),
            Advice::new(RECORD_CONDITIONS, "; look for a slow change in the room or the mount."),
        ),
        Effect::LinearDrift(of) => (
            format!("The bias drifts in a straight line by {}.", amount(&of.slope_parameter())),
            Advice::new(
                "Let the part warm up before recording, or discard the beginning",
                "; correct the bias more often than this drift allows.",
            ),
        ),
        Effect::LevelStep(of) => (
            format!("The bias stepped by {} at {}.", size(of.size), span(of.time_s.value)),
            Advice::new(
                "Look for a shock, a changed supply or a touched cable at that time",
                "; cut the record there.",
            ),
        ),
        Effect::LevelChange(of) => (
            format!(
                "From {} on the noise is {} times as large as before.",
                span(of.time_s.value),
                amount(&of.ratio.parameter(""))
            ),
            Advice::new(
                "Look for what was switched on or off at that time",
                "; N is that of both levels together: cut the record there.",
            ),
        ),
        Effect::TemperatureSensitivity(of) => (
            format!("The bias follows the temperature with {}.", per(of.sensitivity, "degC")),
            Advice::new("Subtract this sensitivity times the change of temperature", format!(".{}", off())),
        ),
        Effect::TemperatureCurvature(of) => (
            format!(
                "The bias follows the temperature by a parabola: {} and {}.",
                per(of.sensitivity, "degC"),
                per(of.curvature, "degC^2")
            ),
            Advice::new(
                "Compensate with the second-order law, or calibrate over the whole range of temperature",
                format!(".{}", off()),
            ),
        ),
        Effect::TurnOnTransient(of) => (
            format!(
                "The bias begins {} off and settles with a time constant of {}.",
                size(of.size),
                seconds(of.time_constant_s)
            ),
            Advice::new(
                "Let the part warm up before it is recorded or used",
                format!(": after {} a hundredth of this is left.", span(4.6 * of.time_constant_s.value)),
            ),
        ),
        Effect::ThermalLag(of) => (
            format!(
                "The bias follows the temperature with {} through a lag of {}.",
                per(of.sensitivity, "degC"),
                seconds(of.time_constant_s)
            ),
            Advice::new(
                "Compensate with the temperature behind a low-pass filter of this time constant",
                format!(".{}", off()),
            ),
        ),
        Effect::SupplySensitivity(of) => (
            format!("The bias follows the supply voltage with {}.", per(of.sensitivity, "V")),
            Advice::new("Regulate the supply, or subtract this sensitivity times its change", format!(".{}", off())),
        ),
        Effect::AccelerationSensitivity(of) => {
            let axes: Vec<String> = of.axes().map(|(axis, of)| format!("{} ({axis})", per(of, "g"))).collect();
            (
                format!("The rate follows the specific force: {}.", axes.join(", ")),
                Advice::new(
                    "Subtract these sensitivities times the accelerometers, or mount the part more stiffly",
                    format!(".{}", off()),
                ),
            )
        }
        Effect::VibrationRectification(of) => (
            format!(
                "The bias follows the strength of the vibration with {}.",
                per(of.sensitivity, &format!("{}^2", of.per))
            ),
            Advice::new("Isolate the part from vibration, or compensate with the variance of the acceleration", "."),
        ),
        Effect::AngleQuantization(of) => (
            format!("Rounding shows: a quantization noise of {}.", amount(&of.coefficient_parameter())),
            Advice::new(FINER, "; short averaging times are dominated by rounding."),
        ),
        Effect::EffectiveLsb(of) => (
            format!("Rounding shows: only every value {} apart occurs.", size(of.step)),
            Advice::new(FINER, "; short averaging times are dominated by rounding."),
        ),
        Effect::NoiseBelowCount(_) => (
            "The noise is smaller than a count: the samples repeat one value and hide what is below it.".to_owned(),
            Advice::new("Take no coefficient from the short averaging times", "; use a smaller range, or add dither."),
        ),
        Effect::MissingCodes(of) => (
            format!("The converter never gives {} of its codes, which are {} apart.", of.codes, size(of.spacing)),
            Advice::new(
                "Compare with another part",
                "; the codes beside the missing ones hold their samples, an error of half a count.",
            ),
        ),
        Effect::Spikes(of) => (
            format!("Single samples stand out by {}, {}.", size(of.size), amount(&of.rate_per_hour.parameter("1/h"))),
            Advice::new("Check the wiring and the bus for interference", "; a filter should reject such samples."),
        ),
        Effect::NoisyInterval(of) => (
            format!(
                "The part was knocked at {} for {}: the noise is {} times that beside it.",
                span(of.from_s.value),
                span(of.to_s.value - of.from_s.value),
                significant(of.level.value, 2)
            ),
            Advice::done("These samples are left out", "; keep hands and machines off the bench while recording."),
        ),
        Effect::MotionInterval(of) => (
            format!("The platform moved from {} to {}.", span(of.from_s.value), span(of.to_s.value)),
            Advice::new(
                "The models were fitted to these samples too, and noise needs a part at rest: record it again on a firm support",
                ".",
            ),
        ),
        Effect::Saturation(of) => (
            format!("The channel reached the end of its range in {} of the samples.", part_in_percent(of.fraction)),
            Advice::new("Use a larger range", "; what was cut off makes the noise look too small."),
        ),
        Effect::StuckOutput(of) => (
            format!("The output stayed at one value in {} of the samples.", part_in_percent(of.fraction)),
            Advice::new("Look for a reader or a filter that repeats its last value", "; these samples are left out."),
        ),
        Effect::DroppedSamples(of) => (
            format!("{} of the samples never arrived.", part_in_percent(of.fraction)),
            Advice::new(
                "Check the reader's load and its queue",
                "; the curve bridges the gaps and says where it does.",
            ),
        ),
        Effect::RepeatedSamples(of) => (
            format!("{} of the samples are copies of the one before.", part_in_percent(of.fraction)),
            Advice::new("Read the part at its data-ready signal", "; copies make white noise look correlated."),
        ),
        Effect::ClockDeviation(of) => match of.change {
            None => (
                format!("The clock of the samples runs at {}.", hertz(of.rate_hz)),
                Advice::new("State this rate: every averaging time and N scale with it", "."),
            ),
            Some(change) => (
                format!(
                    "The clock of the samples changes its rate from {} to {} after {}.",
                    hertz(change.before_hz),
                    hertz(change.after_hz),
                    span(change.time_s.value)
                ),
                Advice::new(
                    "Look for what reset or set the part or the reader at this time",
                    "; the averaging times are those of the mean rate.",
                ),
            ),
        },
        Effect::Unexplained(of) => {
            let (place, percent) = (unexplained_place(of), of.excess_percent.map(|of| of.value));
            let told = percent.map_or_else(
                || format!("What is measured {place}"),
                |percent| format!("{} {place}", signed_percent(&[percent])),
            );
            (
                format!("{told} fits no known effect."),
                Advice::new(
                    "Look at the channel's figures at that place",
                    "; a longer record, or temperature and supply beside it, may tell the cause.",
                ),
            )
        }
    }
}

/// Advice for a drift that channels have in common.
const RECORD_CONDITIONS: &str = "Record temperature and supply beside the channels";
/// Advice for rounding.
const FINER: &str = "Read the part with more bits or in a smaller range";

/// A part of the samples in percent.
fn part_in_percent(fraction: BoundedEstimate) -> String {
    format!("{} %", significant(100.0 * fraction.value, 2))
}

/// Where something is unexplained.
pub(crate) fn unexplained_place(of: &Unexplained) -> String {
    match of.place {
        UnexplainedPlace::LineOfCurve { tau_s, frequency_hz } => format!(
            "at averaging times around {}, as by a line at {}",
            span(tau_s.value),
            quantity(frequency_hz.value, "Hz")
        ),
        UnexplainedPlace::AveragingTime(tau_s) => format!("at averaging times around {}", span(tau_s.value)),
        UnexplainedPlace::Frequency(frequency_hz) => format!("around {}", quantity(frequency_hz.value, "Hz")),
    }
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
    use super::examples::{examples, line};
    use super::*;
    use crate::formatting::capital;
    use noise_analysis::effects::{
        LevelStep, LineEvidence, LineSource, Multiples, SharedDrift, SinusoidalLine, SpectrumEvidence, SquareWave,
        TelegraphEvidence, TelegraphNoise,
    };

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
        }
    }

    /// The page with single spaces in the place of line breaks.
    fn documentation() -> String {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/findings.md");
        let page = std::fs::read_to_string(path).expect("docs/findings.md");
        page.split_whitespace().collect::<Vec<_>>().join(" ")
    }

    /// The words of a text between its numbers, units and names: what does not depend on the parameters.
    fn fixed_words(text: &str) -> Vec<String> {
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

    /// A finding as it is, in several channels with a share, and with what the second half says.
    fn variants(effect: &Effect) -> [Finding; 3] {
        let alone = finding(effect.clone());
        let mut shared = alone.clone();
        shared.channels.push("accl_x".to_owned());
        shared.share_percent.insert("gyro_z".to_owned(), 60.0);
        shared.validated = Validation::Yes;
        let refuted = Finding { validated: Validation::No, ..shared.clone() };
        [alone, shared, refuted]
    }

    #[test]
    fn every_sentence_of_every_kind_is_in_the_documentation() {
        let page = documentation();
        let general = page.split("## The findings").nth(1).and_then(|rest| rest.split("### `").next()).expect("a part");
        let examples = examples();
        for name in Effect::NAMES {
            assert!(examples.iter().any(|effect| effect.name() == *name), "{name} has no example");
        }
        for effect in &examples {
            let kind = effect.name();
            let section =
                page.split(&format!("### `{kind}` ")).nth(1).unwrap_or_else(|| panic!("{kind} has no section"));
            let section = section.split(" ### `").next().unwrap_or_default();
            for finding in variants(effect) {
                let text = describe(&finding);
                assert!(text.physics.ends_with('.') && text.advice.ends_with('.'), "{kind}: {text:?}");
                for words in [&text.physics, &text.brief, &text.advice].into_iter().flat_map(|text| fixed_words(text)) {
                    // The gain is explained once for all kinds.
                    let is_known = section.contains(&words) || general.contains(&words);
                    assert!(is_known, "{kind}: the page lacks \"{words}\" of {text:?}");
                }
                if text.is_weighed {
                    let words = fixed_words(&capital(&text.weight));
                    assert!(words.iter().all(|words| general.contains(&capital(words))), "{kind}: {}", text.weight);
                }
            }
        }
    }

    #[test]
    fn sizes_in_words_are_those_of_their_definitions() {
        // A symmetrical telegraph signal with the covariance (A/2)²·exp(−t/T) jumps every 2 T on average.
        let telegraph = TelegraphNoise {
            time_constant_s: BoundedEstimate::new(20.0, 15.0, 27.0),
            amplitude: BoundedEstimate::new(0.3, 0.29, 0.31).in_unit("deg/s"),
            evidence: TelegraphEvidence::Levels { jumps: 80.0, gain: 20.0 },
        };
        let physics = describe(&finding(telegraph)).physics;
        assert!(physics.contains("0.300 ± 0.010 °/s apart, on average every 40 s: a time constant of 20"), "{physics}");
        // The amplitude of a square wave is half the distance of its levels.
        let square = SquareWave {
            frequency_hz: BoundedEstimate::exact(0.5),
            amplitude: BoundedEstimate::new(9e-4, 8e-4, 1e-3).in_unit("g"),
            multiples: Multiples { harmonics: vec![1, 3], sidebands: 0 },
            line: line(20.5).evidence,
        };
        let physics = describe(&finding(square)).physics;
        assert!(physics.ends_with("with an amplitude of 900 ± 100 µg."), "{physics}");
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
        let physics = describe(&finding(drift)).physics;
        let expected = "A slow drift in common with accel x, 2.9 ± 0.6 °/s/g of it, which nothing recorded explains.";
        assert_eq!(physics, expected);
    }

    #[test]
    fn the_part_of_the_samples_that_is_cut_off_is_told() {
        let saturation = examples().into_iter().find(|effect| matches!(effect, Effect::Saturation(_))).expect("one");
        let physics = describe(&finding(saturation)).physics;
        assert_eq!(physics, "The channel reached the end of its range in 0.30 % of the samples.");
    }

    #[test]
    fn the_evidence_is_printed_with_prefixes_and_bounds() {
        let line = line(20.5);
        let LineSource::Spectrum(spectrum) = line.evidence.source else { panic!("{line:?}") };
        let source = LineSource::Spectrum(SpectrumEvidence { p_value: 0.0, ..spectrum });
        let line = SinusoidalLine { evidence: LineEvidence { source, ..line.evidence }, ..line };
        let [plain, prefixed] = [NumberStyle::Plain, NumberStyle::Prefixed]
            .map(|style| EvidenceText::of_finding(&finding(line.clone()), style).measured);
        let beginning =
            "line at 20.5000 Hz in the spectrum, no wider than the record resolves, 220 sigma, by chance anywhere";
        assert_eq!(plain, format!("{beginning} 0e0"));
        assert_eq!(prefixed, format!("{beginning} below 0.001"));
        let step = LevelStep {
            time_s: BoundedEstimate::exact(333.0),
            size: BoundedEstimate::exact(-3.1e-5).in_unit("g"),
            p_value: 3e-9,
        };
        let of_step = |style| EvidenceText::of_finding(&finding(step), style).sentence();
        let rest = |chance: &str| {
            format!(
                "at 333.0 s and stays, by chance anywhere {chance} in white, flicker and walking noise of any mixture; a mechanical or \
                 thermal shock, or a fault that begins"
            )
        };
        assert_eq!(of_step(NumberStyle::Plain), format!("the level changes by -3.100e-5 g {}", rest("3e-9")));
        assert_eq!(of_step(NumberStyle::Prefixed), format!("the level changes by −31.0 µg {}", rest("below 0.001")));
        // Where nothing else is known, the weight is what was measured, as far as there is room.
        let text = describe(&finding(step));
        assert_eq!(
            (text.is_weighed, text.weight.as_str()),
            (false, "the level changes by −31.0 µg at 333.0 s and stays, by chance …")
        );
        let mut in_two = finding(step);
        in_two.channels.insert(0, "accl_x".to_owned());
        in_two.clearest = 1;
        let sentence = EvidenceText::of_finding(&in_two, NumberStyle::Plain).sentence();
        assert!(
            sentence.starts_with("gyro_z: the level") && sentence.ends_with("; one cause in 2 channels"),
            "{sentence}"
        );
    }

    #[test]
    fn a_share_becomes_a_gain_in_sigma() {
        let mut line = finding(line(20.5));
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
