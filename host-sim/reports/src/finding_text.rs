//! Each finding in words, a sentence of physics and one of advice (`docs/findings.md`).

mod amounts;
mod channel_names;
#[cfg(test)]
mod examples;
mod shown_effect;

use crate::formatting::{capital, moment};
use crate::rounding::{plain, quantity, quantity_digits, signed, significant, span};
use amounts::{Amounts, Label};
pub use channel_names::channel_list;
pub(crate) use channel_names::{ALL_CHANNELS, SENSED, channel_name};
use noise_analysis::bounds::{BoundedEstimate, Parameter};
use noise_analysis::effects::{Effect, Observation, Unexplained, UnexplainedPlace};
use noise_analysis::report::{Finding, Report, Validation};
pub use shown_effect::{ShownEffect, shown_effects};
use std::collections::BTreeMap;
use std::f64::consts::SQRT_2;

/// Hz; below it nothing that turns or hums makes a line.
const SLOW_HZ: f64 = 0.2;
const CYCLING: &str =
    "Look for what cycles at this period, such as a thermostat, an air conditioner or a load on the supply";

/// A finding in words.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FindingText {
    /// The channels that show it, such as `gyro z` or `accel x y`.
    pub channels: String,
    pub channel_count: usize,
    /// The cause, with the size in each channel.
    pub physics: String,
    /// For one line of a narrow screen, without intervals and details.
    pub brief: String,
    /// Remedy, or what to look for.
    pub advice: String,
    /// First step of the advice; `None` if nothing is left to do.
    pub step: Option<String>,
    /// Share of the variance, and confirmation by the second half; empty if unknown.
    pub weight: String,
}

struct Advice {
    first: &'static str,
    /// With the sign that ends the first.
    rest: String,
    kind: AdviceKind,
}

#[derive(PartialEq)]
enum AdviceKind {
    /// Done by the analysis or the sensor.
    Done,
    /// Something to find or to change.
    Look,
    /// Subtraction of the finding's numbers, if the second half confirms them.
    Compensate,
}

impl Advice {
    fn new(first: &'static str, rest: impl Into<String>) -> Self {
        Self { first, rest: rest.into(), kind: AdviceKind::Look }
    }

    fn done(first: &'static str, rest: &str) -> Self {
        Self { kind: AdviceKind::Done, ..Self::new(first, rest) }
    }

    fn compensate(first: &'static str, rest: impl Into<String>) -> Self {
        Self { kind: AdviceKind::Compensate, ..Self::new(first, rest) }
    }

    /// Replaces a subtraction that the second half contradicts.
    fn checked(self, validated: Validation) -> Self {
        if self.kind == AdviceKind::Compensate && validated == Validation::No {
            return Self::new(
                "Record it again before anything is subtracted",
                ": the second half does not confirm the numbers.",
            );
        }
        self
    }
}

/// The finding at `index` of `report`; `None` without one.
#[must_use]
pub fn describe_in(report: &Report, index: usize) -> Option<FindingText> {
    Some(describe(report.findings.get(index)?, &shown_effects(report, index)))
}

/// `shown` has each channel's numbers; without it, those of the clearest channel are used.
#[must_use]
pub fn describe(finding: &Finding, shown: &[ShownEffect]) -> FindingText {
    let clearest = finding.channels.get(finding.clearest).map_or("", String::as_str);
    let alone = [ShownEffect { channel: clearest, effect: &finding.effect }];
    let shown = if shown.is_empty() { &alone } else { shown };
    let label = Label::new(&finding.channels);
    let [(physics, advice), (brief, _)] =
        [false, true].map(|is_brief| sentences(finding, &Amounts { shown, label, is_brief }));
    let advice = advice.checked(finding.validated);
    FindingText {
        channels: channel_list(&finding.channels),
        channel_count: finding.channels.len(),
        physics: physics.replace(DETAIL, ""),
        brief: brief.split(DETAIL).step_by(2).collect(),
        step: (advice.kind != AdviceKind::Done).then(|| format!("{}.", advice.first)),
        advice: format!("{}{}", advice.first, advice.rest),
        weight: weight(finding),
    }
}

/// The largest of a finding's shares by channel, percent; 0 without one.
pub(crate) fn largest(shares: &BTreeMap<String, f64>) -> f64 {
    shares.values().copied().fold(0.0, f64::max)
}

/// Largest share of the variance, that around a minute, and the second half's confirmation; empty if unknown.
fn weight(finding: &Finding) -> String {
    let percent = |share: f64| (share >= 0.5).then(|| significant(share, 2));
    let minute = percent(largest(&finding.minute_percent)).map(|share| format!(", {share} % around τ = 1 min"));
    let share = percent(largest(&finding.share_percent))
        .map(|share| format!("up to {share} % of σ²{}", minute.unwrap_or_default()));
    let held = match finding.validated {
        Validation::Yes => Some("the second half confirms it".to_owned()),
        Validation::No => Some("the second half does not confirm it".to_owned()),
        Validation::Untestable => None,
    };
    share.into_iter().chain(held).collect::<Vec<_>>().join("; ")
}

/// Reduction of σ, %, in the channel with the largest share; `None` if unknown.
fn gain(finding: &Finding) -> Option<String> {
    let share = largest(&finding.share_percent) / 100.0;
    (share > 0.0 && share < 1.0).then(|| significant(100.0 * (1.0 - (1.0 - share).sqrt()), 2))
}

/// Encloses what the brief form leaves out.
const DETAIL: char = '|';

/// The sentence of physics, with details between two [`DETAIL`]s, and the advice; common values are the clearest's.
fn sentences(finding: &Finding, amounts: &Amounts) -> (String, Advice) {
    let off = || {
        gain(finding)
            .map_or_else(String::new, |percent| format!(" It would take {percent} % off σ where it is largest."))
    };
    let each = |name: &'static str| amounts.each(name);
    let percent = |name: &'static str| amounts.each_as(name, "%", 100.0);
    let amount = |of: &Parameter| amounts.one(of);
    let hertz = |of: BoundedEstimate| amounts.one(&of.parameter("Hz"));
    let seconds = |of: BoundedEstimate| amounts.one(&of.parameter("s"));
    let period = |frequency_hz: BoundedEstimate| span(1.0 / frequency_hz.value);
    let is_several = finding.channels.len() > 1;
    let one_or_each = |one: &'static str, each: &'static str| if is_several { each } else { one };
    match &finding.effect {
        Effect::OutputFilter(of) if (of.decimation.value - 1.0).abs() > 1e-9 => (
            format!(
                "The part's low-pass filter of {} taps|, read every {} of its samples|.",
                plain(of.taps.value, 3),
                amount(&of.decimation.parameter(""))
            ),
            Advice::done(
                "Nothing to repair",
                "; N holds below the corner of the filter, and a model for a Kalman filter at this rate is white.",
            ),
        ),
        Effect::OutputFilter(of) => (
            format!("The part's low-pass filter of {} taps| smooths neighbouring samples|.", plain(of.taps.value, 3)),
            Advice::done(
                "Nothing to repair",
                "; take N from averaging times longer than the filter, or use fewer taps for more bandwidth.",
            ),
        ),
        Effect::LowPassFilter(_) => (
            format!("A low-pass filter with a bandwidth of {}.", each("bandwidth")),
            Advice::done(
                "Nothing to repair",
                "; N holds below the bandwidth, and the samples are correlated above it.",
            ),
        ),
        Effect::SinusoidalLine(of) if of.frequency_hz.value < SLOW_HZ => (
            format!(
                "A periodic change at {}|, every {}|: amplitude {}.",
                hertz(of.frequency_hz),
                period(of.frequency_hz),
                each("amplitude")
            ),
            Advice::new(CYCLING, format!(".{}", off())),
        ),
        Effect::SinusoidalLine(of) if of.is_at_half_rate() => (
            format!(
                "Every second sample is off by {}|: a line at half of the sample rate, {}|.",
                // Half of the offset.
                amounts.each_scaled("amplitude", SQRT_2),
                hertz(of.frequency_hz)
            ),
            Advice::new(
                "Look for two converters or two readers that take turns",
                format!("; the mean of two samples has none of it.{}", off()),
            ),
        ),
        Effect::SinusoidalLine(of) => (
            format!(
                "A vibration or hum at {}|, a narrow line|: |amplitude |{}.",
                hertz(of.frequency_hz),
                each("amplitude")
            ),
            Advice::new("Look for a fan, a motor or the mains", format!("; a notch there would help.{}", off())),
        ),
        Effect::ResonantLine(of) if of.frequency_hz.value < SLOW_HZ => (
            format!(
                "A fluctuation around {}|, every {} or so|: {}| (1 σ)|.",
                hertz(of.frequency_hz),
                period(of.frequency_hz),
                each("deviation")
            ),
            Advice::new(CYCLING, format!(".{}", off())),
        ),
        Effect::ResonantLine(of) => (
            format!(
                "A vibration around {}|, {} wide|: {}| (1 σ)|.",
                hertz(of.frequency_hz),
                quantity(of.bandwidth_hz.value, "Hz"),
                each("deviation")
            ),
            Advice::new(
                "Look for a fan whose speed wanders or a loose mount",
                format!("; stiffen the mount or notch the band.{}", off()),
            ),
        ),
        Effect::ModulatedLine(of) => {
            let (what, depth) =
                if of.of_phase { ("phase", each("phase_deviation")) } else { ("amplitude", percent("depth")) };
            (
                format!(
                    "A vibration or hum at {}|, a line of changing {what}|: {}|; its {what} changes by {depth} every {}|.",
                    hertz(of.frequency_hz),
                    each("amplitude"),
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
                "A line whose frequency runs from {} to {}|, by {}: amplitude {}|.",
                hertz(of.start_hz),
                hertz(of.end_hz),
                amount(&of.rate_hz_per_s.parameter("Hz/s")),
                each("amplitude")
            ),
            Advice::new("Look for a motor whose speed changes over the record", format!(".{}", off())),
        ),
        Effect::Periodic(of) => (
            format!(
                "A change every {}| that is no sinusoid, with a fundamental at {}|: amplitude {}.",
                period(of.frequency_hz),
                hertz(of.frequency_hz),
                each("amplitude")
            ),
            Advice::new(CYCLING, format!(".{}", off())),
        ),
        Effect::SquareWave(of) => (
            format!("A square wave of {}: amplitude {}.", hertz(of.frequency_hz), each("amplitude")),
            Advice::new("Look for a load on the supply or a heater that switches at this rate", format!(".{}", off())),
        ),
        Effect::TelegraphNoise(of) => (
            // Two correlation times between jumps.
            format!(
                "The bias jumps between two levels {} apart|, on average every {}: a time constant of {}|.",
                each("amplitude"),
                span(2.0 * of.time_constant_s.value),
                seconds(of.time_constant_s)
            ),
            Advice::new(
                "Try another part, or model this as a Markov process of this time constant",
                "; this is random telegraph noise of the part.",
            ),
        ),
        Effect::ShotNoise(of) => (
            format!(
                "Shocks of {}, {} an hour|, each of which begins at once and decays with a time constant of {}|.",
                each("size"),
                amount(&of.rate_per_hour.parameter("")),
                seconds(of.time_constant_s)
            ),
            Advice::new(
                "Look for what strikes the part or draws from its supply at random times",
                format!("; a Gauss-Markov state of this time constant has the same spectrum.{}", off()),
            ),
        ),
        Effect::MarkovProcess(of) => (
            format!(
                "A noise with a memory of {} and a size of {}| (1 σ)|.",
                seconds(of.time_constant_s),
                each("deviation")
            ),
            Advice::new("Give the filter a first-order Gauss-Markov state of this time constant and size", "."),
        ),
        Effect::CommonMode(_) => (
            format!("A slow drift in common|, which nothing recorded explains|: {}| (1 σ)|.", each("deviation")),
            Advice::new(RECORD_CONDITIONS, "; look for a slow change in the room or the mount."),
        ),
        Effect::SharedDrift(of) => {
            let mut others = vec![of.with.to_owned()];
            for shown in amounts.shown {
                match shown.effect {
                    Effect::SharedDrift(of) if !others.iter().any(|other| other == of.with) => {
                        others.push(of.with.to_owned())
                    }
                    _ => {}
                }
            }
            (
                format!(
                    "A slow drift in common with {}|, which nothing recorded explains|: {}| of it|.",
                    channel_list(&others),
                    each("ratio")
                ),
                Advice::new(RECORD_CONDITIONS, "; look for a slow change in the room or the mount."),
            )
        }
        Effect::LinearDrift(_) => (
            format!("The bias drifts in a straight line: {}.", each("slope")),
            Advice::new(
                "Let the part warm up before recording, or discard the beginning",
                "; correct the bias more often than this drift allows.",
            ),
        ),
        Effect::LevelStep(of) => (
            format!("The bias stepped at {}: {}.", moment(of.time_s.value), each("size")),
            Advice::new(
                "Look for a shock, a changed supply or a touched cable at that time",
                "; cut the record there.",
            ),
        ),
        Effect::LevelChange(of) => (
            format!("From {} on the noise is {} times as large| as before|.", moment(of.time_s.value), each("ratio")),
            Advice::new(
                "Look for what was switched on or off at that time",
                "; N is that of both levels together: cut the record there.",
            ),
        ),
        Effect::WanderingLevel(of) => (
            format!(
                "The noise grows and falls by {}| (1 σ)|, within {}.",
                each("deviation"),
                seconds(of.time_constant_s)
            ),
            Advice::new(
                "Look for what shakes the part, or changes its supply or temperature",
                "; N is that of the mean level.",
            ),
        ),
        Effect::TemperatureSensitivity(_) => (
            format!("The bias follows the temperature: {}.", each("sensitivity")),
            Advice::compensate(
                one_or_each(
                    "Subtract this sensitivity times the change of temperature",
                    "Subtract each channel's sensitivity times the change of temperature",
                ),
                format!(".{}{}", bounds_alone(amounts, "sensitivity"), off()),
            ),
        ),
        Effect::TemperatureCurvature(_) => (
            format!(
                "The bias follows the temperature| by a parabola|: {}| and {}|.",
                each("sensitivity"),
                each("curvature")
            ),
            Advice::compensate(
                "Compensate with the second-order law, or calibrate over the whole range of temperature",
                format!(".{}", off()),
            ),
        ),
        Effect::TurnOnTransient(of) => (
            format!(
                "The bias starts off by {} and settles| with a time constant of {}|.",
                each("size"),
                each("time_constant")
            ),
            Advice::new(
                "Let the part warm up before it is recorded or used",
                format!(
                    ": after {} a hundredth of this is left.",
                    span(4.6 * amounts.largest("time_constant", of.time_constant_s.value))
                ),
            ),
        ),
        Effect::ThermalLag(_) => (
            format!(
                "The bias follows the temperature with a lag: {}|; time constant {}|.",
                each("sensitivity"),
                each("time_constant")
            ),
            Advice::compensate(
                one_or_each(
                    "Compensate with the temperature behind a low-pass filter of this time constant",
                    "Compensate each channel with the temperature behind a low-pass filter of its time constant",
                ),
                format!(".{}{}", bounds_alone(amounts, "sensitivity"), off()),
            ),
        ),
        Effect::SupplySensitivity(_) => (
            format!("The bias follows the supply voltage: {}.", each("sensitivity")),
            Advice::compensate(
                one_or_each(
                    "Regulate the supply, or subtract this sensitivity times its change",
                    "Regulate the supply, or subtract each channel's sensitivity times its change",
                ),
                format!(".{}{}", bounds_alone(amounts, "sensitivity"), off()),
            ),
        ),
        Effect::AccelerationSensitivity(_) => {
            let along = |(axis, name): (&str, &'static str)| {
                let each = each(name);
                (!each.is_empty()).then(|| format!("along {axis} {each}"))
            };
            let axes = [("x", "sensitivity_x"), ("y", "sensitivity_y"), ("z", "sensitivity_z")];
            let axes: Vec<String> = axes.into_iter().filter_map(along).collect();
            let axes =
                axes.iter().enumerate().map(|(at, axis)| if at == 0 { axis.clone() } else { format!("|; {axis}|") });
            (
                format!("The rate follows the specific force: {}.", axes.collect::<String>()),
                Advice::compensate(
                    one_or_each(
                        "Subtract these sensitivities times the accelerometers, or mount the part more stiffly",
                        "Subtract each channel's sensitivities times the accelerometers, or mount the part more stiffly",
                    ),
                    format!(".{}", off()),
                ),
            )
        }
        Effect::VibrationRectification(_) => (
            format!("The bias follows the |strength of the |vibration: {}.", each("sensitivity")),
            Advice::compensate(
                "Isolate the part from vibration, or compensate with the variance of the acceleration",
                format!(".{}", bounds_alone(amounts, "sensitivity")),
            ),
        ),
        Effect::AngleQuantization(_) => (
            format!("Rounding shows: a quantization noise of {}.", each("value")),
            Advice::new(FINER, "; short averaging times are dominated by rounding."),
        ),
        Effect::EffectiveLsb(_) => (
            format!("Rounding shows: only every value {} apart occurs.", each("step")),
            Advice::new(FINER, "; short averaging times are dominated by rounding."),
        ),
        Effect::NoiseBelowCount(_) => (
            "The noise is smaller than a count|: the samples repeat one value and hide what is below it|.".to_owned(),
            Advice::new("Take no coefficient from the short averaging times", "; use a smaller range, or add dither."),
        ),
        Effect::MissingCodes(of) => (
            format!("The converter never gives {} of its codes|, which are {} apart|.", of.codes, each("spacing")),
            Advice::new(
                "Compare with another part",
                "; the codes beside the missing ones hold their samples, an error of half a count.",
            ),
        ),
        Effect::Spikes(of) => (
            format!(
                "Single samples stand out by {}, {} an hour.",
                each("size"),
                amount(&of.rate_per_hour.parameter(""))
            ),
            Advice::new("Check the wiring and the bus for interference", "; a filter should reject such samples."),
        ),
        Effect::NoisyInterval(of) => (
            format!(
                "The part was knocked at {} for {}|: the noise is {} times that beside it|.",
                moment(of.from_s.value),
                span(of.to_s.value - of.from_s.value),
                significant(of.level.value, 2)
            ),
            Advice::done("These samples are left out", "; keep hands and machines off the bench while recording."),
        ),
        Effect::MotionInterval(of) => (
            match of.stretches {
                0 | 1 => {
                    let length_s = of.to_s.value - of.from_s.value;
                    format!("The platform moved at {} for up to {}.", moment(of.from_s.value), span(length_s))
                }
                times => format!(
                    "The platform moved {times} times between {} and {}|, for up to {} together|.",
                    moment(of.from_s.value),
                    moment(of.to_s.value),
                    span(of.moved_s as f64)
                ),
            },
            Advice::new(
                "Noise needs a part at rest: analyse only that, or record it again on a firm support",
                "; the models here were fitted to the motion too.",
            ),
        ),
        Effect::Saturation(_) => (
            format!("{} of the samples are at the end of the channel's range.", percent("share")),
            Advice::new("Use a larger range", "; what was cut off makes the noise look too small."),
        ),
        Effect::StuckOutput(_) => (
            format!("The output stayed at one value in {} of the samples.", percent("share")),
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
                format!(
                    "The sample clock runs at {} instead of| the nominal| {}| ({})|.",
                    hertz(of.rate_hz),
                    quantity_digits(of.nominal_hz, "Hz", 4),
                    relative(of.rate_hz.value / of.nominal_hz - 1.0)
                ),
                Advice::new("Use this rate instead of the nominal one", "; every averaging time and N scale with it."),
            ),
            Some(change) => (
                format!(
                    "The sample clock changes its rate| from {} to {}| after {}.",
                    hertz(change.before_hz),
                    hertz(change.after_hz),
                    moment(change.time_s.value)
                ),
                Advice::new(
                    "Look for what reset or set the part or the reader at this time",
                    "; the averaging times are those of the mean rate.",
                ),
            ),
        },
        Effect::Unexplained(of) => {
            let percent: Vec<f64> = amounts.values("excess_percent");
            (
                format!("{}, which no known effect explains.", capital(&departure(of, &percent))),
                Advice::new(
                    "Look at the channel's figures at that place",
                    "; a longer record, or temperature and supply beside it, may tell the cause.",
                ),
            )
        }
    }
}

/// A remark on sizes of which only a bound is known.
fn bounds_alone(amounts: &Amounts, name: &'static str) -> String {
    let bounded = amounts.with_bound_alone(name);
    if bounded.is_empty() {
        return String::new();
    }
    format!(" Subtract nothing in {}: the record gives a limit only.", channel_list(&bounded))
}

const RECORD_CONDITIONS: &str = "Record temperature and supply beside the channels";
const FINER: &str = "Read the part with more bits or in a smaller range";

fn part_in_percent(fraction: BoundedEstimate) -> String {
    format!("{} %", significant(100.0 * fraction.value, 2))
}

/// Amount and place of a departure from every model; `percent` is the excess of σ per channel.
pub(crate) fn departure(of: &Unexplained, percent: &[f64]) -> String {
    let place = match of.place {
        UnexplainedPlace::LineOfCurve { tau_s, frequency_hz } => {
            format!("around τ = {}, as by a line at {}", span(tau_s.value), quantity(frequency_hz.value, "Hz"))
        }
        UnexplainedPlace::AveragingTime(tau_s) => format!("around τ = {}", span(tau_s.value)),
        UnexplainedPlace::Frequency(frequency_hz) => format!("around {}", quantity(frequency_hz.value, "Hz")),
    };
    let (low, high) =
        percent.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &of| (low.min(of), high.max(of)));
    let range = |low: String, high: String| if low == high { high } else { format!("{low} to {high}") };
    let size = |of: f64| significant(of.abs(), 2);
    match (percent, &of.observation) {
        ([], _) => format!("the data departs from the model {place}"),
        (_, Observation::LevelByTemperature { .. }) => {
            format!("the noise changes with the temperature, by {} %", range(signed(low, 2), signed(high, 2)))
        }
        _ if low >= 0.0 => format!("σ is {} % above the model {place}", range(size(low), size(high))),
        _ if high < 0.0 => format!("σ is {} % below the model {place}", range(size(high), size(low))),
        _ => format!("σ is up to {} % below and {} % above the model {place}", size(low), size(high)),
    }
}

/// Percent, or ppm below 0.01 %.
fn relative(difference: f64) -> String {
    if difference.abs() < 1e-4 {
        format!("{} ppm", signed(1e6 * difference, 2))
    } else {
        format!("{} %", signed(100.0 * difference, 2))
    }
}

#[cfg(test)]
mod tests {
    use super::examples::{examples, line};
    use super::*;
    use crate::evidence::EvidenceText;
    use noise_analysis::effects::{
        LevelStep, LineEvidence, LineSource, MotionInterval, MotionScale, Multiples, SharedDrift, SinusoidalLine,
        SpectrumEvidence, SquareWave, StuckOutput, TelegraphEvidence, TelegraphNoise,
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
            minute_percent: Default::default(),
        }
    }

    /// One row for each piece of advice.
    fn rows_of(kind: &str, examples: &[Effect]) -> String {
        let texts = examples
            .iter()
            .filter(|effect| effect.name() == kind)
            .map(|effect| describe(&finding(effect.clone()), &[]));
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

    #[test]
    fn every_text_of_every_kind_is_a_sentence() {
        for effect in &examples() {
            let text = describe(&finding(effect.clone()), &[]);
            assert!(text.physics.ends_with('.') && text.advice.ends_with('.'), "{}: {text:?}", effect.name());
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
        let measured = EvidenceText::of_finding(&finding(line)).measured;
        let beginning =
            "line at 20.5000 Hz in the spectrum, no wider than the record resolves, 220 σ, by chance anywhere";
        assert_eq!(measured, format!("{beginning} below 0.001"));
        let step = LevelStep {
            time_s: BoundedEstimate::exact(333.0),
            size: BoundedEstimate::exact(-3.1e-5).in_unit("g"),
            p_value: 3e-9,
        };
        let of_step = EvidenceText::of_finding(&finding(step)).sentence();
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
        let sentence = EvidenceText::of_finding(&in_two).sentence();
        assert!(
            sentence.starts_with("gyro z: the level") && sentence.ends_with("; one cause in 2 channels"),
            "{sentence}"
        );
    }

    /// No names of the JSON, and no "1 runs".
    #[test]
    fn the_evidence_of_the_page_has_names_symbols_and_numbers_as_its_readers_write_them() {
        for effect in &examples() {
            let text = EvidenceText::of_effect(effect).sentence();
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
        let text = EvidenceText::of_effect(&stuck.into()).measured;
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
