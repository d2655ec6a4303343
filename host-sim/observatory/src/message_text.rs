//! The messages of a device as text.

use adis16405_driver::{Channel, GyroRange, OutputWord};
use link::{
    ChannelMessage, ClockSource, DecoderCounters, Health, Hello, LearnedMessage, Message, RawBurst, RawMessage,
    Received, ReportedAddedTerm, ReportedModelError, ReportedParameter, ReportedRegressor, ReportedTerm,
    ValidationMessage,
};
use std::collections::BTreeMap;
use std::time::Duration;

/// Silence after which a note is shown, since a device reports every ten seconds.
pub const LONG_SILENCE: Duration = Duration::from_secs(15);

/// Probable causes of a long silence.
pub const SILENCE: &str = "another port or baud rate, no image on the board, or its reports are off; try `bench`";

/// The numbers of received, missing and damaged messages, in one line.
#[must_use]
pub fn summary(counters: &DecoderCounters) -> String {
    let DecoderCounters { frames, lines, bad_frames, other_version, missing, discarded_bytes } = counters;
    format!(
        "{frames} messages, {missing} missing by their numbers, {lines} lines, {bad_frames} damaged, \
         {other_version} of another version, {discarded_bytes} bytes of noise"
    )
}

/// Turns messages into text, and keeps what later messages need.
#[derive(Debug, Default)]
pub struct MessageFormatter {
    sample_rate_hz: Option<f64>,
    epoch: u32,
    /// The latest covariate regression of each channel, by the channel's position in the burst.
    regressions: BTreeMap<u8, Vec<ReportedRegressor>>,
}

impl MessageFormatter {
    /// The lines of a message, or a line of plain text.
    pub fn lines(&mut self, received: &Received) -> Vec<String> {
        let message = match received {
            Received::Text(line) => return vec![line.as_str().to_owned()],
            Received::Message { message, .. } => message,
        };
        match message {
            Message::Hello(report) => {
                if report.epoch < self.epoch {
                    self.regressions.clear(); // the device restarted without its regressions
                }
                self.sample_rate_hz = Some(report.measured_rate_hz.unwrap_or(report.sample_rate_hz));
                self.epoch = report.epoch;
                hello(report)
            }
            Message::Channel(report) => vec![channel(report)],
            Message::Health(report) => vec![format!("   {}", health_text(report))],
            Message::Log(line) => vec![line.as_str().to_owned()],
            Message::Raw(raw) => vec![self.raw(raw)],
            Message::Validation(report) => vec![checked(report, self.sample_rate_hz)],
            Message::Learned(report) => {
                self.regressions.insert(report.channel, report.regressors.to_vec());
                learned(report)
            }
        }
    }

    /// The number of bursts, and the last sample of every compensated channel as measured and compensated.
    fn raw(&self, raw: &RawMessage) -> String {
        let mut text = format!("raw: {} bursts from number {}", raw.bursts.len(), raw.first);
        let range = GyroRange::from_sens_avg(raw.sens_avg);
        let Some((burst, range)) = raw.bursts.last().zip(range) else { return text };
        for (&position, causes) in &self.regressions {
            let Some((channel, measured)) = sample(burst, position, range).filter(|_| !causes.is_empty()) else {
                continue;
            };
            let term = |cause: &ReportedRegressor| {
                let (_, covariate) = sample(burst, cause.covariate, range)?;
                Some(cause.value * (covariate - cause.reference))
            };
            let compensated = measured - causes.iter().filter_map(term).sum::<f64>();
            text += &format!(", {} {measured:.4} -> {compensated:.4} {}", channel.name(), channel.unit());
        }
        text
    }
}

/// The channel at `position` in the burst, and its value in its unit; `None` if the position has no channel.
fn sample(burst: &RawBurst, position: u8, range: GyroRange) -> Option<(Channel, f64)> {
    let channel = *Channel::ALL.get(usize::from(position))?;
    let word = OutputWord(u16::from_be_bytes(burst.words[usize::from(position)]));
    Some((channel, f64::from(word.counts(channel)) * channel.lsb(range) + channel.offset()))
}

fn hello(report: &Hello) -> Vec<String> {
    let (major, minor, patch) = report.firmware;
    let measured = report.measured_rate_hz.map_or_else(|| "not yet".to_owned(), |hz| format!("{hz:.4} Hz"));
    let epoch = if report.epoch_s == 0 { "without end".to_owned() } else { format!("of {} s", report.epoch_s) };
    let mut lines = vec![
        format!(
            "-- firmware {major}.{minor}.{patch}, up {:.1} s, started {} (start {}, {} channels restored)",
            report.uptime_us as f64 * 1e-6,
            report.boot.cause.text(),
            report.boot.starts,
            report.boot.restored_channels
        ),
        format!(
            "   ADIS{}, {}, ±{} deg/s, filter 2^{}, {:.1} SPS, measured {measured}, SCK {} Hz; epoch {} {epoch}",
            report.product_id,
            if report.sampling { "sampled" } else { "probed" },
            report.gyro_full_scale,
            report.filter_taps_log2,
            report.sample_rate_hz,
            report.spi_clock_hz,
            report.epoch,
        ),
    ];
    if report.boot.clock == ClockSource::Internal {
        lines.push("   the crystal did not start: times and rates are those of the internal oscillator".to_owned());
    }
    if !report.boot.crash_record.is_empty() {
        lines.push(format!("   crash record: {}", report.boot.crash_record));
    }
    lines
}

fn channel(report: &ChannelMessage) -> String {
    let name = name(report.channel);
    let mut text = format!("   {name}: {} samples, {} missing", report.samples, report.missing);
    if report.missing > 0 {
        let ChannelMessage { lost, refused, replaced, .. } = report;
        text += &format!(" ({lost} lost, {refused} refused; {replaced} replaced in the curve)");
    }
    if report.self_test_failed {
        text += ", failed its self-test";
    }
    for coefficient in &report.coefficients {
        let (value, low, high) = (coefficient.value, coefficient.low, coefficient.high);
        text += &format!(", {} {value:.3e} ({low:.3e} to {high:.3e})", symbol(coefficient.term));
    }
    if let Some(error) = &report.unseen_error {
        text += &format!(", model of the epoch before {:.1} % off", error.rms_percent);
    }
    text
}

/// Name of the channel at this position in a burst.
fn name(channel: u8) -> &'static str {
    Channel::ALL.get(usize::from(channel)).map_or("unknown channel", |channel| channel.name())
}

/// The use of the bursts, every counter that is not 0, and the load of the processor, in one line.
#[must_use]
pub fn health_text(health: &Health) -> String {
    let counters = [
        ("no new data", health.no_new_data),
        ("error or alarm", health.error_alarm),
        ("supply", health.supply),
        ("stuck low", health.stuck_low),
        ("stuck high", health.stuck_high),
        ("shifted", health.shifted),
        ("frozen", health.frozen),
        ("impossible rate", health.impossible_rate),
        ("x sign", health.x_sign),
        ("repeated", health.repeated),
        ("bus errors", health.bus_errors),
        ("queue full", health.queue_full),
        ("lost DRDY edges", health.lost_edges),
        ("spurious DRDY edges", health.spurious_edges),
        ("suspect", health.suspect),
        ("implausible supply", health.implausible_supply),
        ("error flag in some words", health.mixed_alarm),
        ("refused in a channel", health.partly_used),
        ("used with a warning", health.marked),
        ("reads of DIAG_STAT", health.diag_reads),
        ("supply low", health.diag_supply_low),
        ("supply high", health.diag_supply_high),
        ("flash update failed", health.diag_flash_update),
        ("SPI error", health.diag_spi),
        ("over-range", health.diag_over_range),
        ("self-test failed", health.diag_self_test),
        ("flash checksum", health.diag_flash_checksum),
        ("alarm", health.diag_alarm),
        ("recoveries", health.recoveries),
        ("configurations read again", health.rereads),
        ("bus resets", health.bus_resets),
        ("software resets", health.sensor_resets),
        ("pulses on RST", health.reset_lines),
        ("raw messages dropped", health.raw_dropped),
        ("serial overruns", health.serial_overruns),
        ("bad commands", health.bad_commands),
    ];
    let mut text = format!("{} of {} bursts used", health.used, health.bursts);
    for (name, count) in counters.into_iter().filter(|(_, count)| *count > 0) {
        text += &format!(", {name} {count}");
    }
    text + &format!("; awake {:.1} %", f64::from(health.awake_permille) / 10.0)
}

/// Name of a term's coefficient.
fn symbol(term: ReportedTerm) -> &'static str {
    match term {
        ReportedTerm::AngleRandomWalk => "N",
        ReportedTerm::BiasInstability => "B",
        ReportedTerm::RateRandomWalk => "K",
        ReportedTerm::Quantization => "Q",
        ReportedTerm::RateRamp => "R",
        ReportedTerm::Filtered => "N behind a filter",
        ReportedTerm::Markov => "Markov noise",
        ReportedTerm::Resonance => "resonance",
        ReportedTerm::Sinusoid => "line",
    }
}

/// Names and units of the parameters of a term's shape.
fn shape(term: ReportedTerm) -> [(&'static str, &'static str); 2] {
    match term {
        ReportedTerm::Filtered => [("taps", ""), ("decimation", "")],
        ReportedTerm::Markov => [("time constant", " s"), ("", "")],
        ReportedTerm::Resonance => [("at", " Hz"), ("bandwidth", " Hz")],
        ReportedTerm::Sinusoid => [("at", " Hz"), ("", "")],
        _ => [("", ""); 2],
    }
}

/// The covariate regression of a channel over an epoch, and the terms that N, B and K lack.
fn learned(report: &LearnedMessage) -> Vec<String> {
    let prefix = format!("   {}, epoch {}:", name(report.channel), report.epoch);
    let mut lines: Vec<String> = report
        .regressors
        .iter()
        .map(|cause| {
            let ReportedRegressor { covariate, value, low, high, reference } = *cause;
            let of = name(covariate);
            format!(
                "{prefix} sensitivity to {of} {value:.3e} ({low:.3e} to {high:.3e}), subtracted from {reference:.3}"
            )
        })
        .collect();
    if lines.is_empty() {
        lines.push(format!("{prefix} no significant covariate, nothing is subtracted"));
    }
    if report.added_terms.is_empty() {
        lines.push(format!("{prefix} N, B and K are enough, p = {:.3}", report.p_before));
    }
    lines.extend(report.added_terms.iter().map(|added| format!("{prefix} lacks {}", effect(added))));
    lines
}

fn effect(effect: &ReportedAddedTerm) -> String {
    let coefficient = &effect.coefficient;
    let (value, low, high) = (coefficient.value, coefficient.low, coefficient.high);
    let mut text = format!("{} {value:.3e} ({low:.3e} to {high:.3e})", symbol(coefficient.term));
    for ((name, unit), ReportedParameter { value, low, high }) in shape(coefficient.term).into_iter().zip(&effect.shape)
    {
        text += &format!(", {name} {value:.4}{unit} ({low:.4} to {high:.4})");
    }
    let (percent, sigmas, n) = (100.0 * effect.excess, effect.sigmas, effect.n);
    text + &format!("; {percent:+.1} % at n = {n} ({sigmas:.0} sigma), score {:.0}", effect.score)
}

/// Errors on this epoch, without and with the model and the regression of the previous epoch.
fn checked(report: &ValidationMessage, sample_rate_hz: Option<f64>) -> String {
    let mut text = format!("   {}, epoch {}, unseen:", name(report.channel), report.epoch);
    let points = |error: Option<ReportedModelError>| {
        error.map_or_else(|| "unknown".to_owned(), |error| format!("{:.2}", error.deviance_per_point))
    };
    text += &format!(" deviance per point {} -> {}", points(report.before), points(report.after));
    if let Some(shift) = report.shift {
        text += &format!(", mean moved by {:.3e} -> {:.3e}", shift.raw, shift.compensated);
    }
    for drift in &report.drift {
        let at =
            sample_rate_hz.map_or_else(|| format!("{} samples", drift.n), |hz| format!("{:.1} s", drift.n as f64 / hz));
        text += &format!(", deviation at {at} {:.3e} -> {:.3e}", drift.raw, drift.compensated);
    }
    text
}
