//! Each finding in words, a sentence of physics and one of advice (`docs/findings.md`).

mod amounts;
mod channel_names;
mod shown_effect;

use crate::formatting::{capital, moment};
use crate::rounding::{extremes, plain, quantity, quantity_digits, signed, significant, span};
use amounts::{Amounts, Label};
pub use channel_names::channel_list;
pub(crate) use channel_names::{ALL_CHANNELS, SENSED, channel_name};
use noise_analysis::bounds::Parameter;
use noise_analysis::effects::{Effect, Observation, Unexplained, UnexplainedPlace};
use noise_analysis::report::{Finding, Validation};
pub use shown_effect::{ShownEffect, shown_effects};
use std::collections::BTreeMap;
use std::f64::consts::SQRT_2;

/// Hz; below it nothing that turns or hums makes a line.
const SLOW_HZ: f64 = 0.2;
const CYCLING: &str =
    "Look for what cycles at this period, such as a thermostat, an air conditioner or a load on the supply|.{off}";
const RECORD_CONDITIONS: &str =
    "Record temperature and supply beside the channels|; look for a slow change in the room or the mount.";
const FINER: &str =
    "Read the part with more bits or in a smaller range|; short averaging times are dominated by rounding.";

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

impl FindingText {
    /// Physics and weight.
    pub(crate) fn sentences(&self) -> String {
        let weight = if self.weight.is_empty() { String::new() } else { format!(" {}.", capital(&self.weight)) };
        format!("{}{weight}", self.physics)
    }
}

/// Sentences with places for numbers; see [`filled`].
struct Template {
    /// The brief form leaves out the text between two [`DETAIL`]s.
    physics: String,
    /// The first step, [`DETAIL`], and the rest with the sign that ends the first.
    advice: String,
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

fn look(physics: impl Into<String>, advice: impl Into<String>) -> Template {
    Template { physics: physics.into(), advice: advice.into(), kind: AdviceKind::Look }
}

fn done(physics: impl Into<String>, advice: &str) -> Template {
    Template { kind: AdviceKind::Done, ..look(physics, advice) }
}

fn compensate(physics: impl Into<String>, advice: &str) -> Template {
    Template { kind: AdviceKind::Compensate, ..look(physics, advice) }
}

/// `shown` has each channel's numbers; without it, those of the clearest channel are used.
#[must_use]
pub fn describe(finding: &Finding, shown: &[ShownEffect]) -> FindingText {
    let clearest = finding.channels.get(finding.clearest).map_or("", String::as_str);
    let alone = [ShownEffect { channel: clearest, effect: &finding.effect }];
    let shown = if shown.is_empty() { &alone } else { shown };
    let label = Label::new(&finding.channels);
    let [full, brief] = [false, true].map(|is_brief| Amounts { shown, label, is_brief });
    let Template { physics, mut advice, kind } = template(finding, shown);
    if kind == AdviceKind::Compensate && finding.validated == Validation::No {
        "Record it again before anything is subtracted|: the second half does not confirm the numbers."
            .clone_into(&mut advice);
    }
    let advice = filled(&advice, finding, &full);
    let first = advice.split(DETAIL).next().unwrap_or_default();
    FindingText {
        channels: channel_list(&finding.channels),
        channel_count: finding.channels.len(),
        physics: filled(&physics, finding, &full).replace(DETAIL, ""),
        brief: filled(&physics, finding, &brief).split(DETAIL).step_by(2).collect(),
        step: (kind != AdviceKind::Done).then(|| format!("{first}.")),
        advice: advice.replace(DETAIL, ""),
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
    let [minute, share] = [&finding.minute_percent, &finding.share_percent].map(|shares| percent(largest(shares)));
    let share = share.map(|share| match minute {
        None => format!("up to {share} % of σ²"),
        Some(minute) if minute == share => format!("{share} % of σ² around τ = 1 min"),
        Some(minute) => format!("up to {share} % of σ², {minute} % around τ = 1 min"),
    });
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

/// `template` with the parameters of a finding by their names: `{size}` of the clearest channel, `{size:each}` of each channel. `{one/several}`
/// is the one text or the other by the number of channels.
fn filled(template: &str, finding: &Finding, amounts: &Amounts) -> String {
    let parameters = finding.effect.parameters();
    let place = |place: &str| {
        if let Some((one, several)) = place.split_once('/') {
            return (if finding.channels.len() > 1 { several } else { one }).to_owned();
        }
        let (name, form) = place.split_once(':').unwrap_or((place, ""));
        let clearest = || parameters.get(name).cloned().unwrap_or_else(|| Parameter::new(f64::NAN, 0.0, 0.0, ""));
        match (name, form) {
            ("off", _) => gain(finding)
                .map_or_else(String::new, |percent| format!(" It would take {percent} % off σ where it is largest.")),
            ("limits", _) => bounds_alone(amounts, "sensitivity"),
            (_, "each") => amounts.each(name),
            (_, "each %") => amounts.each_as(name, Some("%"), 100.0),
            (_, "each √2") => amounts.each_as(name, None, SQRT_2),
            (_, "%") => format!("{} %", significant(100.0 * clearest().value, 2)),
            (_, "moment") => moment(clearest().value),
            (_, "no unit") => amounts.one(&clearest().estimate().parameter("")),
            (_, "period") => span(1.0 / clearest().value),
            (_, "plain") => plain(clearest().value, 3),
            (_, "rounded") => quantity(clearest().value, &clearest().unit),
            _ => amounts.one(&clearest()),
        }
    };
    let mut pieces = template.split('{');
    let first = pieces.next().unwrap_or_default().to_owned();
    let filled = |piece: &str| piece.split_once('}').map(|(name, text)| place(name) + text);
    first + &pieces.filter_map(filled).collect::<String>()
}

fn template(finding: &Finding, shown: &[ShownEffect]) -> Template {
    match &finding.effect {
        Effect::OutputFilter(of) if (of.decimation.value - 1.0).abs() > 1e-9 => done(
            "The part's low-pass filter of {taps:plain} taps|, read every {decimation} of its samples|.",
            "Nothing to repair|; N holds below the corner of the filter, and a model for a Kalman filter at this rate is white.",
        ),
        Effect::OutputFilter(_) => done(
            "The part's low-pass filter of {taps:plain} taps| smooths neighbouring samples|.",
            "Nothing to repair|; take N from averaging times longer than the filter, or use fewer taps for more bandwidth.",
        ),
        Effect::LowPassFilter(_) => done(
            "A low-pass filter with a bandwidth of {bandwidth:each}.",
            "Nothing to repair|; N holds below the bandwidth, and the samples are correlated above it.",
        ),
        Effect::SinusoidalLine(of) if of.frequency_hz.value < SLOW_HZ => {
            look("A periodic change at {frequency}|, every {frequency:period}|: amplitude {amplitude:each}.", CYCLING)
        }
        // Half of the offset is the amplitude of the line.
        Effect::SinusoidalLine(of) if of.is_at_half_rate() => look(
            "Every second sample is off by {amplitude:each √2}|: a line at half of the sample rate, {frequency}|.",
            "Look for two converters or two readers that take turns|; the mean of two samples has none of it.{off}",
        ),
        Effect::SinusoidalLine(_) => look(
            "A vibration or hum at {frequency}|, a narrow line|: |amplitude |{amplitude:each}.",
            "Look for a fan, a motor or the mains|; a notch there would help.{off}",
        ),
        Effect::ResonantLine(of) if of.frequency_hz.value < SLOW_HZ => look(
            "A fluctuation around {frequency}|, every {frequency:period} or so|: {deviation:each}| (1 σ)|.",
            CYCLING,
        ),
        Effect::ResonantLine(_) => look(
            "A vibration around {frequency}|, {bandwidth:rounded} wide|: {deviation:each}| (1 σ)|.",
            "Look for a fan whose speed wanders or a loose mount|; stiffen the mount or notch the band.{off}",
        ),
        Effect::ModulatedLine(of) => {
            let (what, depth) =
                if of.of_phase { ("phase", "{phase_deviation:each}") } else { ("amplitude", "{depth:each %}") };
            let physics = format!("{{frequency}}|, a line of changing {what}|: {{amplitude:each}}|; its {what}");
            look(
                format!("A vibration or hum at {physics} changes by {depth} every {{period}}|."),
                "Look for a machine whose load changes at this period, or for two that run at nearly one speed|.{off}",
            )
        }
        Effect::Chirp(_) => look(
            "A line whose frequency runs from {start} to {end}|, by {rate}: amplitude {amplitude:each}|.",
            "Look for a motor whose speed changes over the record|.{off}",
        ),
        Effect::Periodic(_) => look(
            "A change every {frequency:period}| that is no sinusoid, with a fundamental at {frequency}|: amplitude {amplitude:each}.",
            CYCLING,
        ),
        Effect::SquareWave(_) => look(
            "A square wave of {frequency}: amplitude {amplitude:each}.",
            "Look for a load on the supply or a heater that switches at this rate|.{off}",
        ),
        Effect::TelegraphNoise(of) => {
            // Two correlation times between jumps.
            let every = span(2.0 * of.time_constant_s.value);
            look(
                format!(
                    "The bias jumps between two levels {{amplitude:each}} apart|, on average every {every}: a time constant of {{time_constant}}|."
                ),
                "Try another part, or model this as a Markov process of this time constant|; this is random telegraph noise of the part.",
            )
        }
        Effect::ShotNoise(_) => look(
            "Shocks of {size:each}, {rate:no unit} an hour|, each of which begins at once and decays with a time constant of {time_constant}|.",
            "Look for what strikes the part or draws from its supply at random times|; a Gauss-Markov state of this time constant has the \
             same spectrum.{off}",
        ),
        Effect::MarkovProcess(_) => look(
            "A noise with a memory of {time_constant} and a size of {deviation:each}| (1 σ)|.",
            "Give the filter a first-order Gauss-Markov state of this time constant and size|.",
        ),
        Effect::CommonMode(_) => look(
            "A slow drift in common|, which nothing recorded explains|: {deviation:each}| (1 σ)|.",
            RECORD_CONDITIONS,
        ),
        Effect::SharedDrift(of) => {
            let mut others = vec![of.with];
            for shown in shown {
                if let Effect::SharedDrift(of) = shown.effect
                    && !others.contains(&of.with)
                {
                    others.push(of.with);
                }
            }
            let others = channel_list(&others);
            look(
                format!(
                    "A slow drift in common with {others}|, which nothing recorded explains|: {{ratio:each}}| of it|."
                ),
                RECORD_CONDITIONS,
            )
        }
        Effect::LinearDrift(_) => look(
            "The bias drifts in a straight line: {slope:each}.",
            "Let the part warm up before recording, or discard the beginning|; correct the bias more often than this drift allows.",
        ),
        Effect::LevelStep(_) => look(
            "The bias stepped at {time:moment}: {size:each}.",
            "Look for a shock, a changed supply or a touched cable at {time:moment}|; cut the record there.",
        ),
        Effect::LevelChange(_) => look(
            "From {time:moment} on the noise is {ratio:each} times as large| as before|.",
            "Look for what was switched on or off at {time:moment}|; N is that of both levels together: cut the record there.",
        ),
        Effect::WanderingLevel(_) => look(
            "The noise grows and falls by {deviation:each}| (1 σ)|, within {time_constant}.",
            "Look for what shakes the part, or changes its supply or temperature|; N is that of the mean level.",
        ),
        Effect::TemperatureSensitivity(_) => compensate(
            "The bias follows the temperature: {sensitivity:each}.",
            "Subtract {this/each channel's} sensitivity times the change of temperature|.{limits}{off}",
        ),
        Effect::TemperatureCurvature(_) => compensate(
            "The bias follows the temperature| by a parabola|: {sensitivity:each}| and {curvature:each}|.",
            "Compensate with the second-order law, or calibrate over the whole range of temperature|.{off}",
        ),
        Effect::TurnOnTransient(of) => {
            let (name, own) = ("time_constant", of.time_constant_s.value);
            let longest = Amounts { shown, label: Label::Nothing, is_brief: false }.largest(name, own);
            let settled = span(4.6 * longest);
            look(
                "The bias starts off by {size:each} and settles| with a time constant of {time_constant:each}|.",
                format!(
                    "Let the part warm up before it is recorded or used|: after {settled} a hundredth of this is left."
                ),
            )
        }
        Effect::ThermalLag(_) => compensate(
            "The bias follows the temperature with a lag: {sensitivity:each}|; time constant {time_constant:each}|.",
            "Compensate {/each channel }with the temperature behind a low-pass filter of {this/its} time constant|.{limits}{off}",
        ),
        Effect::SupplySensitivity(_) => compensate(
            "The bias follows the supply voltage: {sensitivity:each}.",
            "Regulate the supply, or subtract {this/each channel's} sensitivity times its change|.{limits}{off}",
        ),
        Effect::AccelerationSensitivity(_) => {
            let names = [("x", "sensitivity_x"), ("y", "sensitivity_y"), ("z", "sensitivity_z")].into_iter();
            let axes = names.filter(|(_, name)| shown.iter().any(|of| of.effect.parameters().contains_key(name)));
            let axes: Vec<String> = axes.map(|(axis, name)| format!("along {axis} {{{name}:each}}")).collect();
            let others = axes.iter().skip(1).map(|axis| format!("|; {axis}|"));
            let axes: String = axes.first().cloned().into_iter().chain(others).collect();
            compensate(
                format!("The rate follows the specific force: {axes}."),
                "Subtract {these/each channel's} sensitivities times the accelerometers, or mount the part more stiffly|.{off}",
            )
        }
        Effect::VibrationRectification(_) => compensate(
            "The bias follows the |strength of the |vibration: {sensitivity:each}.",
            "Isolate the part from vibration, or compensate with the variance of the acceleration|.{limits}",
        ),
        Effect::AngleQuantization(_) => look("Rounding shows: a quantization noise of {value:each}.", FINER),
        Effect::EffectiveLsb(_) => look("Rounding shows: the values are {step:each} apart.", FINER),
        Effect::NoiseBelowCount(_) => look(
            "The noise is smaller than a count|: the samples repeat one value and hide what is below it|.",
            "Read the part with more bits or in a smaller range|, or add dither; N is partly that of the rounding.",
        ),
        Effect::MissingCodes(of) => look(
            format!("The converter never gives {} of its codes|, which are {{spacing:each}} apart|.", of.codes),
            "Compare with another part|; the codes beside the missing ones hold their samples, an error of half a count.",
        ),
        Effect::Spikes(_) => look(
            "Single samples stand out by {size:each}, {rate:no unit} an hour.",
            "Check the wiring and the bus for interference|; a filter should reject such samples.",
        ),
        Effect::NoisyInterval(of) => {
            let (length, times) = (span(of.to_s.value - of.from_s.value), significant(of.level.value, 2));
            done(
                format!(
                    "The part was knocked at {{from:moment}} for {length}|: the noise is {times} times that beside it|."
                ),
                "These samples are left out|; keep hands and machines off the bench while recording.",
            )
        }
        Effect::MotionInterval(of) => {
            let length = span(of.to_s.value - of.from_s.value);
            let (times, together) = (of.stretches, span(of.moved_s as f64));
            look(
                if times > 1 {
                    format!(
                        "The platform moved {times} times between {{from:moment}} and {{to:moment}}|, for up to {together} together|."
                    )
                } else {
                    format!("The platform moved at {{from:moment}} for up to {length}.")
                },
                "Noise needs a part at rest: analyse only that, or record it again on a firm support|; the models here were fitted to the \
                 motion too.",
            )
        }
        Effect::Saturation(_) => look(
            "{share:each %} of the samples are at the end of the channel's range.",
            "Use a larger range|; what was cut off makes the noise look too small.",
        ),
        Effect::StuckOutput(_) => look(
            "The output stayed at one value in {share:each %} of the samples.",
            "Look for a reader or a filter that repeats its last value|; these samples are left out.",
        ),
        Effect::DroppedSamples(_) => look(
            "{fraction:%} of the samples never arrived.",
            "Check the reader's load and its queue|; the curve bridges the gaps and says where it does.",
        ),
        Effect::RepeatedSamples(_) => look(
            "{fraction:%} of the samples are copies of the one before.",
            "Read the part at its data-ready signal|; copies make white noise look correlated.",
        ),
        Effect::ClockDeviation(of) if of.change.is_some() => look(
            "The sample clock changes its rate| from {rate_before_hz} to {rate_after_hz}| after {change_time:moment}.",
            "Look for what reset or set the part or the reader at {change_time:moment}|; the averaging times are those of the mean rate.",
        ),
        Effect::ClockDeviation(of) => {
            let nominal = quantity_digits(of.nominal_hz, "Hz", 4);
            let difference = relative(of.rate_hz.value / of.nominal_hz - 1.0);
            look(
                format!("The sample clock runs at {{rate_hz}} instead of| the nominal| {nominal}| ({difference})|."),
                "Use this rate instead of the nominal one|; every averaging time and N scale with it.",
            )
        }
        Effect::Unexplained(of) => look(
            format!("{}, which no known effect explains.", capital(&departure(of, &excess_percent(shown)))),
            "Look at the channel's figures at that place|; a longer record, or temperature and supply beside it, may tell the cause.",
        ),
    }
}

/// The excess of σ in each channel.
pub(crate) fn excess_percent(shown: &[ShownEffect]) -> Vec<f64> {
    let excesses = shown.iter().filter_map(|shown| shown.effect.parameters().remove("excess_percent"));
    excesses.map(|of| of.value).collect()
}

/// A remark on sizes of which only a bound is known.
fn bounds_alone(amounts: &Amounts, name: &str) -> String {
    let bounded = amounts.with_bound_alone(name);
    if bounded.is_empty() {
        return String::new();
    }
    format!(" Subtract nothing in {}: the record gives a limit only.", channel_list(&bounded))
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
    let (low, high) = extremes(percent.iter().copied());
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
mod tests;
