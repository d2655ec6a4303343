//! The picture of a finding's evidence: line, time, covariate, histogram, or residual.

use super::axis::Axis;
use super::channel::{allan_deviation_plot, spectrum_plot, time_unit};
use super::plot::{LOOKS, Line, Look, Panel, Place, Plot, below_legend, frames, heights};
use crate::finding_text::{channel_list, channel_name, shown_effects};
use crate::formatting::words;
use crate::rounding::{bounded_quantity, extremes, span, unit};
use noise_analysis::effects::{
    Effect, LevelChange, LevelStep, ModulatedLine, MotionInterval, NoisyInterval, Periodic, ResonantLine,
    SinusoidalLine, SquareWave, StuckOutput, UnexplainedPlace,
};
use noise_analysis::report::{BiasOverTime, ChannelReport, Finding, Report};

/// Frequencies around a line, from this part of its own to the inverse.
const AROUND: f64 = 0.5;
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
            in_time(report, channel, finding, Some(Place { label: span(at), from: at, to: at }))
        }
        Effect::NoisyInterval(NoisyInterval { from_s, to_s, .. })
        | Effect::StuckOutput(StuckOutput { from_s, to_s, .. })
        | Effect::MotionInterval(MotionInterval { from_s, to_s, .. }) => {
            let (from, to) = (from_s.value, to_s.value);
            let label = format!("{} … {}", span(from), span(to));
            in_time(report, channel, finding, Some(Place { label, from, to }))
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
                Some(allan_deviation_plot(report, channel))
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
        | Effect::RepeatedSamples(_) => Some(allan_deviation_plot(report, channel)),
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
    let place = Place::at_frequency(frequency);
    let description = format!("The spectrum of {} around {}.", channel_name(channel), place.label);
    let panel = Panel::logarithmic("frequency, Hz", &panel.up.label, lines, frames([220.0])[0]);
    Some(untitled(description, panel.with_places(vec![place])))
}

fn untitled(description: String, panel: Panel) -> Plot {
    Plot::new("", "", description, [panel])
}

fn bias_label(channel: &ChannelReport) -> String {
    format!("bias, {}", unit(&channel.unit))
}

/// `place` is in s from the first sample.
fn in_time(report: &Report, channel: &ChannelReport, finding: &Finding, place: Option<Place>) -> Option<Plot> {
    let same_unit =
        report.channels.iter().filter(|other| other.unit == channel.unit && finding.channels.contains(&other.name));
    let series: Vec<(&ChannelReport, &BiasOverTime)> =
        same_unit.filter_map(|other| Some((other, other.figure_data.bias_over_time.as_ref()?))).collect();
    let ends = series.iter().filter_map(|(_, bias)| bias.time_s.last());
    let (scale, per) = time_unit(ends.copied().fold(0.0, f64::max));
    let lines: Vec<Line> = series
        .iter()
        .zip(LOOKS.into_iter().cycle())
        .map(|((other, bias), look)| {
            let points = bias.time_s.iter().map(|time| time / scale).zip(bias.mean.iter().copied()).collect();
            Line::new(channel_name(other), look, points)
        })
        .collect();
    lines.first()?;
    let place = place.map(|Place { label, from, to }| Place { label, from: from / scale, to: to / scale });
    let at = place.as_ref().map_or_else(String::new, |place| format!(", with the place at {}", place.label));
    let panel = Panel::linear(&format!("time, {per}"), &bias_label(channel), lines, frames([200.0])[0]);
    Some(untitled(format!("The bias over time{at}."), panel.with_places(place.into_iter().collect())))
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
        let own = own.map_or_else(String::new, |own| format!(" {}", bounded_quantity(&own)));
        let name = format!("{}{own}", channel_name(channel));
        let measured = pairs.iter().map(|&(index, x)| (x, bias.mean[index])).collect();
        lines.push(Line::new(name, look, measured).dotted());
        if bias.followed.len() == bias.mean.len() {
            followed.extend(pairs.iter().map(|&(index, x)| (x, bias.followed[index])));
        }
    }
    if lines.is_empty() {
        return None;
    }
    if !followed.is_empty() {
        followed.sort_by(|a, b| a.0.total_cmp(&b.0));
        lines.push(Line::new("what the findings explain", Look::Followed, followed).dotted());
    }
    let name = if covariate.name == "temp" { "temperature".to_owned() } else { channel_name(other) };
    let label = format!("{name} less its mean, {}", unit(&other.unit));
    let frame = below_legend(frames([240.0])[0], &lines);
    let description = format!("The bias over the {name}, in means of {}.", span(along.block_s));
    Some(untitled(description, Panel::linear(&label, &bias_label(clearest), lines, frame)))
}

fn histogram(channel: &ChannelReport) -> Option<Plot> {
    let bias = channel.figure_data.bias_over_time.as_ref()?;
    let (low, high) = extremes(bias.mean.iter().copied());
    let width = (high - low) / BARS as f64;
    if width <= 0.0 || !width.is_finite() {
        return None;
    }
    let mut counts = [0.0; BARS];
    for value in &bias.mean {
        counts[(((value - low) / width) as usize).min(BARS - 1)] += 1.0;
    }
    let top = |(bar, &count): (usize, &f64)| [bar, bar + 1].map(|edge| (low + edge as f64 * width, count));
    let outline = counts.iter().enumerate().flat_map(top).collect();
    let line = Line::new(format!("blocks of {}", span(bias.block_s)), Look::Measured, outline);
    let up = Axis::linear("blocks", heights(&line).into_iter().chain([0.0]), frames([200.0])[0]);
    let panel = Panel::linear(&bias_label(channel), "", vec![line], frames([200.0])[0]);
    Some(untitled(format!("How often each mean of {} occurs.", span(bias.block_s)), Panel { up, ..panel }))
}
