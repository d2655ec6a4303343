//! The picture of a finding's evidence: line, time, covariate, histogram, or residual.

use super::axis::Axis;
use super::channel::{allan_deviation_plot, spectrum_plot, time_unit};
use super::plot::{LEFT, Line, Look, Panel, Place, Plot, RIGHT, below_legend, frames, heights, places};
use crate::finding_text::{channel_list, channel_name, shown_effects};
use crate::formatting::words;
use crate::rounding::{bounded_quantity, quantity_digits, span, unit};
use noise_analysis::effects::{
    Effect, LevelChange, LevelStep, ModulatedLine, MotionInterval, NoisyInterval, Periodic, ResonantLine,
    SinusoidalLine, SquareWave, StuckOutput, UnexplainedPlace,
};
use noise_analysis::report::{ChannelReport, Finding, Report};

/// Frequencies around a line, from this part of its own to the inverse.
const AROUND: f64 = 0.5;
/// Looks of the channels of one unit.
const LOOKS: [Look; 3] = [Look::Measured, Look::SecondAxis, Look::ThirdAxis];
const BARS: usize = 40;

/// The picture of the finding at `index`, called `number`; `None` if the report has no data for it.
pub(crate) fn evidence(report: &Report, index: usize, number: usize) -> Option<Plot> {
    let finding = report.findings.get(index)?;
    let clearest = finding.channels.get(finding.clearest)?;
    let channel = report.channels.iter().find(|channel| channel.name == *clearest)?;
    let plot = match &finding.effect {
        Effect::SinusoidalLine(SinusoidalLine { frequency_hz, .. })
        | Effect::ResonantLine(ResonantLine { frequency_hz, .. })
        | Effect::ModulatedLine(ModulatedLine { frequency_hz, .. })
        | Effect::Periodic(Periodic { frequency_hz, .. })
        | Effect::SquareWave(SquareWave { frequency_hz, .. }) => line_in_spectrum(report, channel, frequency_hz.value),
        Effect::Chirp(_) | Effect::OutputFilter(_) | Effect::LowPassFilter(_) | Effect::ClockDeviation(_) => {
            spectrum_plot(report, channel)
        }
        Effect::LevelStep(LevelStep { time_s, .. }) | Effect::LevelChange(LevelChange { time_s, .. }) => {
            let at = time_s.value;
            in_time(report, channel, finding, Some(TimePlace { label: span(at), from_s: at, to_s: at }))
        }
        Effect::NoisyInterval(NoisyInterval { from_s, to_s, .. })
        | Effect::StuckOutput(StuckOutput { from_s, to_s, .. })
        | Effect::MotionInterval(MotionInterval { from_s, to_s, .. }) => {
            let (from_s, to_s) = (from_s.value, to_s.value);
            let label = format!("{} … {}", span(from_s), span(to_s));
            in_time(report, channel, finding, Some(TimePlace { label, from_s, to_s }))
        }
        Effect::ShotNoise(_)
        | Effect::WanderingLevel(_)
        | Effect::LinearDrift(_)
        | Effect::TurnOnTransient(_)
        | Effect::CommonMode(_)
        | Effect::SharedDrift(_)
        | Effect::VibrationRectification(_) => in_time(report, channel, finding, None),
        Effect::TemperatureSensitivity(_) | Effect::TemperatureCurvature(_) | Effect::ThermalLag(_) => {
            beside(report, channel, index, &Covariate { name: "temp", sensitivity: "sensitivity" })
        }
        Effect::SupplySensitivity(_) => {
            beside(report, channel, index, &Covariate { name: "supply", sensitivity: "sensitivity" })
        }
        Effect::AccelerationSensitivity(of) => of.axes().next().and_then(|(axis, _)| {
            let (name, sensitivity) = (format!("accl_{axis}"), format!("sensitivity_{axis}"));
            beside(report, channel, index, &Covariate { name: &name, sensitivity: &sensitivity })
        }),
        Effect::TelegraphNoise(_) => histogram(channel),
        Effect::Unexplained(of) => match of.place {
            UnexplainedPlace::Frequency(frequency_hz) => line_in_spectrum(report, channel, frequency_hz.value),
            // A line of the curve alone is not in the spectrum.
            UnexplainedPlace::AveragingTime(_) | UnexplainedPlace::LineOfCurve { .. } => {
                Some(residual(report, channel))
            }
        },
        Effect::MarkovProcess(_)
        | Effect::AngleQuantization(_)
        | Effect::EffectiveLsb(_)
        | Effect::NoiseBelowCount(_)
        | Effect::MissingCodes(_)
        | Effect::Spikes(_)
        | Effect::Saturation(_)
        | Effect::DroppedSamples(_)
        | Effect::RepeatedSamples(_) => Some(residual(report, channel)),
    }?;
    let title = format!("Evidence {number}: {} in {}", words(finding.effect.name()), channel_list(&finding.channels));
    Some(Plot { id: format!("finding-{number}"), title, ..plot })
}

fn line_in_spectrum(report: &Report, channel: &ChannelReport, frequency: f64) -> Option<Plot> {
    let whole = spectrum_plot(report, channel)?;
    let panel = whole.panels.first()?;
    let cut = |line: &Line| {
        let near = |at: &f64| (AROUND * frequency..=frequency / AROUND).contains(at);
        let kept: Vec<usize> = (0..line.points.len()).filter(|&at| near(&line.points[at].0)).collect();
        // The band with the line is drawn at the line.
        let mut points: Vec<(f64, f64)> = kept.iter().map(|&at| line.points[at]).collect();
        let distance = |at: f64| (at / frequency).ln().abs();
        if let Some(nearest) = points.iter_mut().min_by(|a, b| distance(a.0).total_cmp(&distance(b.0))) {
            nearest.0 = frequency;
        }
        Line { points, bounds: kept.iter().filter_map(|&at| line.bounds.get(at).copied()).collect(), ..line.clone() }
    };
    let lines: Vec<Line> = panel.lines.iter().map(cut).collect();
    if lines.iter().all(|line| line.points.len() < 2) {
        return None;
    }
    let [frame] = frames([220.0]);
    let across = Axis::logarithmic("frequency, Hz", lines.iter().flat_map(places), [LEFT, RIGHT]);
    let up = Axis::logarithmic(&panel.up.label, lines.iter().flat_map(heights), frame);
    let place = Place { label: quantity_digits(frequency, "Hz", 3), from: frequency, to: frequency };
    Some(Plot {
        description: format!(
            "The spectrum of {} around {}.",
            channel_name(channel),
            quantity_digits(frequency, "Hz", 3)
        ),
        panels: vec![Panel { places: vec![place], ..Panel::new(across, up, lines) }],
        ..whole
    })
}

/// s from the first sample.
struct TimePlace {
    label: String,
    from_s: f64,
    to_s: f64,
}

fn in_time(report: &Report, channel: &ChannelReport, finding: &Finding, at: Option<TimePlace>) -> Option<Plot> {
    let same_unit =
        report.channels.iter().filter(|other| other.unit == channel.unit && finding.channels.contains(&other.name));
    let mut length = 0.0_f64;
    let series: Vec<(&ChannelReport, &noise_analysis::report::BiasOverTime)> = same_unit
        .filter_map(|other| Some((other, other.figure_data.bias_over_time.as_ref()?)))
        .inspect(|(_, bias)| length = length.max(bias.time_s.last().copied().unwrap_or(0.0)))
        .collect();
    let (scale, per) = time_unit(length);
    let lines: Vec<Line> = series
        .iter()
        .zip(LOOKS.into_iter().cycle())
        .map(|((other, bias), look)| {
            let points = bias.time_s.iter().map(|time| time / scale).zip(bias.mean.iter().copied()).collect();
            Line::new(channel_name(other), look, points)
        })
        .collect();
    let first = lines.first()?;
    let across = Axis::linear(&format!("time, {per}"), places(first).into_iter(), [LEFT, RIGHT]);
    let [frame] = frames([200.0]);
    let up = Axis::linear(&format!("bias, {}", unit(&channel.unit)), lines.iter().flat_map(heights), frame);
    let place = at.map(|TimePlace { label, from_s, to_s }| Place { label, from: from_s / scale, to: to_s / scale });
    Some(Plot {
        id: String::new(),
        title: String::new(),
        description: place.as_ref().map_or_else(
            || "The bias over time.".to_owned(),
            |place| format!("The bias over time, with the place at {}.", place.label),
        ),
        panels: vec![Panel { places: place.into_iter().collect(), ..Panel::new(across, up, lines) }],
    })
}

struct Covariate<'a> {
    name: &'a str,
    /// Parameter of the sensitivity to it.
    sensitivity: &'a str,
}

/// Block means of the channels in the unit of `clearest` over a covariate, with each channel's sensitivity.
fn beside(report: &Report, clearest: &ChannelReport, index: usize, covariate: &Covariate) -> Option<Plot> {
    let other = report.channels.iter().find(|other| other.name == covariate.name)?;
    let along = other.figure_data.bias_over_time.as_ref()?;
    let at = |time: &f64| along.time_s.iter().position(|of| of == time).map(|index| along.mean[index]);
    let shown = shown_effects(report, index);
    let is_shown = |channel: &&ChannelReport| {
        let is_one = shown.iter().any(|shown| shown.channel == channel.name);
        channel.unit == clearest.unit && (is_one || channel.name == clearest.name)
    };
    let (mut lines, mut followed) = (Vec::new(), Vec::new());
    for (channel, look) in report.channels.iter().filter(is_shown).zip(LOOKS.into_iter().cycle()) {
        let Some(bias) = &channel.figure_data.bias_over_time else { continue };
        let pairs: Vec<(usize, f64)> =
            bias.time_s.iter().enumerate().filter_map(|(index, time)| Some((index, at(time)?))).collect();
        let own = shown.iter().find(|shown| shown.channel == channel.name);
        let own = own.and_then(|shown| shown.effect.parameters().remove(covariate.sensitivity));
        let name = own.map_or_else(
            || channel_name(channel),
            |own| format!("{} {}", channel_name(channel), bounded_quantity(&own)),
        );
        let measured = pairs.iter().map(|&(index, x)| (x, bias.mean[index])).collect();
        lines.push(Line::new(name, look, measured).with_dots().unjoined());
        if bias.followed.len() == bias.mean.len() {
            followed.extend(pairs.iter().map(|&(index, x)| (x, bias.followed[index])));
        }
    }
    if lines.is_empty() {
        return None;
    }
    if !followed.is_empty() {
        followed.sort_by(|a, b| a.0.total_cmp(&b.0));
        lines.push(Line::new("what the findings explain", Look::Followed, followed).with_dots().unjoined());
    }
    let name = if covariate.name == "temp" { "temperature".to_owned() } else { channel_name(other) };
    let [frame] = frames([240.0]);
    let label = format!("{name} less its mean, {}", unit(&other.unit));
    let across = Axis::linear(&label, lines.iter().flat_map(places), [LEFT, RIGHT]);
    let frame = below_legend(frame, &lines);
    let up = Axis::linear(&format!("bias, {}", unit(&clearest.unit)), lines.iter().flat_map(heights), frame);
    Some(Plot {
        id: String::new(),
        title: String::new(),
        description: format!("The bias over the {name}, in means of {}.", span(along.block_s)),
        panels: vec![Panel::new(across, up, lines)],
    })
}

fn histogram(channel: &ChannelReport) -> Option<Plot> {
    let bias = channel.figure_data.bias_over_time.as_ref()?;
    let (low, high) = bias.mean.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &of| (a.min(of), b.max(of)));
    let width = (high - low) / BARS as f64;
    if width <= 0.0 || !width.is_finite() {
        return None;
    }
    let mut counts = [0.0; BARS];
    for value in &bias.mean {
        counts[(((value - low) / width) as usize).min(BARS - 1)] += 1.0;
    }
    let outline: Vec<(f64, f64)> = counts
        .iter()
        .enumerate()
        .flat_map(|(bar, &count)| [(low + bar as f64 * width, count), (low + (bar + 1) as f64 * width, count)])
        .collect();
    let lines = vec![Line::new(format!("blocks of {}", span(bias.block_s)), Look::Measured, outline)];
    let [frame] = frames([200.0]);
    let label = format!("bias, {}", unit(&channel.unit));
    let across = Axis::linear(&label, lines.iter().flat_map(places), [LEFT, RIGHT]);
    let up = Axis::linear("blocks", lines.iter().flat_map(heights).chain([0.0]), frame);
    Some(Plot {
        id: String::new(),
        title: String::new(),
        description: format!("How often each mean of {} occurs.", span(bias.block_s)),
        panels: vec![Panel::new(across, up, lines)],
    })
}

fn residual(report: &Report, channel: &ChannelReport) -> Plot {
    allan_deviation_plot(report, channel)
}
