//! The explanation of a recording as text: a sentence for each fault of its sampling, then tables.

use crate::formatting::{NONE, TextTable, count, duration, interval, number, words};
use allan_core::NoiseTerm;
use allan_core::model::FittedTerm;
use noise_analysis::nonstationarity::{
    ChannelExplanation, CommonModeRegression, Explanation, FittedPart, RelatedLine, TrackedSet,
};
use std::io::{self, Write};

/// Writes the explanation. Lines are as long as the tables need.
///
/// # Errors
/// `out` cannot be written.
pub fn write(explanation: &Explanation, out: &mut impl Write) -> io::Result<()> {
    let Explanation { sample_rate_hz, samples, time_base, channels, common_mode, .. } = explanation;
    let length = duration(*samples as f64 / sample_rate_hz);
    writeln!(out, "{} samples at {} Hz, {length}", count(*samples), number(*sample_rate_hz))?;
    for sentence in time_base {
        writeln!(out, "• {sentence}")?;
    }
    if channels.is_empty() {
        return writeln!(out, "No inertial channel has enough samples to be cut into epochs.");
    }
    writeln!(out, "\nWhat the baseline model lacks, by the first half")?;
    writeln!(out, "{}", added_term_table(channels))?;
    writeln!(out, "\nNon-stationarity of the noise: the two quarters of the first half, where they differ most")?;
    writeln!(out, "{}", stationarity_table(channels))?;
    writeln!(out, "\nDeviance per point (1: a true model on its own data)")?;
    writeln!(out, "{}", error_table(channels))?;
    writeln!(
        out,
        "N, B, K and traced: fitted to the first half. Predictive: the traced terms fitted to the part named"
    )?;
    writeln!(
        out,
        "above, to the median of its epochs if it is the later quarter. Still: the first half's curve itself taken for"
    )?;
    writeln!(
        out,
        "the second half's. Nothing of these has seen the second half. Beyond drift: the predictive model, where level"
    )?;
    writeln!(
        out,
        "and line may have gone as far as the epochs of the first half let expect, (x/σ)² being added for it. Degrees"
    )?;
    writeln!(out, "of freedom are those of the kind of noise at each octave, whatever the model.")?;
    writeln!(out, "\nThe second half predicted epoch by epoch, each from those before it")?;
    writeln!(out, "{}", tracking_table(channels))?;
    writeln!(
        out,
        "Shapes and gains by the first half; tracked parameters are corrected by each epoch after it was predicted. All"
    )?;
    writeln!(
        out,
        "epochs: the mean of what was predicted, against the curve of the second half. One epoch: the mean of"
    )?;
    writeln!(out, "every epoch's own deviance, with tracked parameters and with the predictive model as it stands.")?;
    for of in channels {
        if let Some(related) = &of.related_line {
            writeln!(out, "{}", related_line(explanation, of, related))?;
        }
    }
    writeln!(out, "\nWhite noise (change of its variance, %) and moving line (Hz), epoch by epoch")?;
    writeln!(out, "{}", profile_table(*sample_rate_hz, channels))?;
    writeln!(
        out,
        "By the curves alone: how a line moves, they show well; where it is, octaves tell to some ten percent."
    )?;
    if let Some(common_mode) = common_mode {
        writeln!(out, "\nFraction of each channel's variance that the others predict, %, first half")?;
        writeln!(out, "{}", variance_fraction_table(common_mode))?;
        let learned = number(common_mode.weights_at as f64 / sample_rate_hz);
        writeln!(out, "\nBias drift after over before, second half; weights learned in the first at τ = {learned} s")?;
        writeln!(out, "{}", gain_table(common_mode))?;
        writeln!(out, "Trusted: the weights of the first quarter reduced the variance of the second quarter.")?;
    }
    Ok(())
}

/// The added terms in the order in which they were added, with their values in the final model.
fn added_term_table(channels: &[ChannelExplanation]) -> TextTable {
    let of = |channel: &ChannelExplanation| {
        let row = |found: &allan_core::trace::AddedTerm| {
            let term = &channel.trace.after.terms()[found.term];
            vec![
                channel.channel.name.to_owned(),
                words(term.kind.name()),
                shape_parameters(term),
                format!("{} [{}]", number(term.value), interval(term.low, term.high)),
                format!("{:.0}", found.score),
                format!(
                    "{} σ at {} s",
                    number(found.residual.sigmas),
                    number(found.residual.n as f64 * channel.trace.after.sample_period())
                ),
            ]
        };
        channel.trace.added.iter().map(row).collect::<Vec<_>>()
    };
    let header = ["channel", "term", "shape", "coefficient", "score", "residual before"];
    TextTable::new(header, 3, channels.iter().flat_map(of))
}

/// Names, values and intervals of the parameters of a term's shape.
fn shape_parameters(term: &FittedTerm) -> String {
    let parameters = term.kind.shape().into_iter().zip(term.shape).filter(|((name, _), _)| !name.is_empty());
    let of = |((name, value), (low, high)): ((&str, f64), (f64, f64))| {
        let bounds = if low < high { format!(" [{}]", interval(low, high)) } else { String::new() };
        format!("{} {}{bounds}", words(name), number(value))
    };
    let stages = match term.kind {
        NoiseTerm::Filtered(filter) => Some(format!("stages {}", filter.stages)),
        _ => None,
    };
    stages.into_iter().chain(parameters.map(of)).collect::<Vec<_>>().join(", ")
}

/// The octave at which the variances of the two quarters differ most, and what the predictive model is fitted to.
fn stationarity_table(channels: &[ChannelExplanation]) -> TextTable {
    let row = |channel: &ChannelExplanation| {
        let mut row = vec![channel.channel.name.to_owned()];
        match channel.stationarity {
            Some(found) => row.extend([
                number(found.n as f64 * channel.curves.fitted.sample_period()),
                format!("{:+.2} %", 100.0 * (found.ratio - 1.0)),
                format!("{:.1e}", found.p_value),
            ]),
            None => row.extend([NONE, NONE, NONE].map(str::to_owned)),
        }
        row.push(match channel.part {
            FittedPart::FirstHalf => "the first half".to_owned(),
            FittedPart::LatestQuarter => "its later quarter".to_owned(),
        });
        row
    };
    let header = ["channel", "at τ, s", "σ² later/earlier", "chance", "predictive model from"];
    TextTable::new(header, 1, channels.iter().map(row))
}

/// Deviance per point of every model, on what it was fitted to and on the unseen half.
fn error_table(channels: &[ChannelExplanation]) -> TextTable {
    let row = |channel: &ChannelExplanation| {
        let errors = &channel.errors;
        let [baseline, traced, predictive] =
            [errors.baseline, errors.traced, errors.predictive].map(|both| both.map(deviance));
        let values = [baseline, traced, predictive].concat();
        let last = [errors.beyond_drift, errors.first_half_curve].map(deviance).to_vec();
        [vec![channel.channel.name.to_owned()], values, last].concat()
    };
    let header = [
        "channel",
        "N, B, K: fitted",
        "unseen",
        "traced: fitted",
        "unseen",
        "predictive: fitted",
        "unseen",
        "beyond drift",
        "still",
    ];
    TextTable::new(header, 1, channels.iter().map(row))
}

/// Two decimals below 100, none above.
fn deviance(value: f64) -> String {
    if value < 100.0 { format!("{value:.2}") } else { format!("{value:.0}") }
}

/// Deviance per point of predictions that follow the tracked parameters, beside two baselines.
fn tracking_table(channels: &[ChannelExplanation]) -> TextTable {
    let row = |channel: &ChannelExplanation| {
        let (tracked, controls) = (&channel.tracking, &channel.baselines);
        let what = match channel.tracked_set {
            TrackedSet::Nothing => "nothing",
            TrackedSet::Level => "level",
            TrackedSet::LevelAndLine => "level, line",
        };
        let values = [
            tracked.pooled,
            tracked.one_step,
            tracked.one_step_static,
            controls.baseline_tracked,
            controls.persistence,
        ];
        [vec![channel.channel.name.to_owned(), what.to_owned()], values.map(deviance).to_vec()].concat()
    };
    let header = [
        "channel",
        "tracked",
        "all epochs",
        "one epoch",
        "… as it stands",
        "baseline: N, B, K",
        "baseline: epoch before",
    ];
    TextTable::new(header, 2, channels.iter().map(row))
}

/// A line of another channel whose frequency is in a fixed ratio to that of the channel's line.
fn related_line(explanation: &Explanation, of: &ChannelExplanation, related: &RelatedLine) -> String {
    let (name, other) = (of.channel.name, explanation.searched[related.channel].name);
    let (mean, deviation) = related.measured_ratio;
    let ((above, below), path) = (related.ratio, [&related.line, &related.related[0], &related.related[1]]);
    let [line, seen, unseen] = path.map(|path| path.iter().map(|f| format!("{f:.2}")).collect::<Vec<_>>().join(" "));
    format!(
        "\nThe line of {name} shows in {other} at {above}/{below} of its frequency: ratio {mean:.4} ± {deviation:.4} epoch by\n\
         epoch, correlation of the steps {:.3}, chance {:.0e} (first half). Where {other} has it in the second half\n\
         predicts {name} with a deviance per point of {:.2}; {name} itself is not looked at there. Hz, by the spectra:\n\
         {name}, first half: {line}\n{other}, first half: {seen}\n{other}, second half: {unseen}",
        related.correlation, related.p_value, related.unseen,
    )
}

/// White noise and line frequency of each channel in each epoch, with standard errors.
fn profile_table(rate: f64, channels: &[ChannelExplanation]) -> TextTable {
    let mut header = vec!["half".to_owned(), "from, min".to_owned()];
    for channel in channels {
        header.push(channel.channel.name.to_owned());
        if channel.tracked_model.line_frequency().is_some() {
            header.push("Hz".to_owned());
        }
    }
    let Some(first) = channels.first() else { return TextTable::new(header, 0, Vec::new()) };
    let half = first.curves.fitted.samples() as usize;
    let starts = [half % first.curves.epoch, half];
    let rows = ["first", "second"].iter().enumerate().flat_map(|(at, name)| {
        (0..first.profile[at].len()).map(move |epoch| {
            let from = (starts[at] + epoch * first.curves.epoch) as f64 / rate / 60.0;
            let mut row = vec![(*name).to_owned(), format!("{from:.1}")];
            for channel in channels {
                let estimate = channel.profile[at][epoch];
                let [level, line] = estimate.parameters;
                row.push(format!("{:+.1} ± {:.1}", 100.0 * level.exp_m1(), 100.0 * estimate.error[0]));
                if let Some(frequency) = channel.tracked_model.line_frequency() {
                    let f = frequency * line.exp();
                    row.push(format!("{f:.2} ± {:.2}", f * estimate.error[1]));
                }
            }
            row
        })
    });
    TextTable::new(header, 1, rows)
}

/// Header of a table with a column for each channel.
fn by_channel(common_mode: &CommonModeRegression) -> Vec<String> {
    let names = common_mode.channels.iter().map(|channel| channel.name.to_owned());
    ["τ, s".to_owned()].into_iter().chain(names).collect()
}

/// Fraction of each channel's variance that the others predict, at each octave.
fn variance_fraction_table(common_mode: &CommonModeRegression) -> TextTable {
    let rows = common_mode.shares.iter().map(|octave| {
        let shares = octave.share.iter().map(|share| format!("{:.0}", 100.0 * share));
        [number(octave.tau)].into_iter().chain(shares).collect::<Vec<_>>()
    });
    TextTable::new(by_channel(common_mode), 0, rows)
}

/// Bias drift after the common-mode correction over that before, at each octave.
fn gain_table(common_mode: &CommonModeRegression) -> TextTable {
    let rows = common_mode.gains.iter().map(|octave| {
        let ratios = octave.ratio.iter().map(|ratio| format!("{ratio:.2}"));
        [number(octave.tau)].into_iter().chain(ratios).collect::<Vec<_>>()
    });
    let trusted = common_mode.trusted.iter().map(|&trusted| if trusted { "yes" } else { "no" }.to_owned());
    let last: Vec<_> = ["trusted".to_owned()].into_iter().chain(trusted).collect();
    TextTable::new(by_channel(common_mode), 0, rows.chain([last]))
}
