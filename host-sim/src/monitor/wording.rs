//! Messages in words.

use super::compensation::{Compensated, Compensation};
use super::lesson;
use adis16405_driver::Channel;
use link::{BootCause, ChannelMessage, Health, Hello, Message, RawMessage, Received};

/// Says in words what is received, and remembers what later messages need to be understood.
#[derive(Default)]
pub struct Narrator {
    sample_rate_hz: Option<f64>,
    epoch: u32,
    compensation: Compensation,
}

impl Narrator {
    /// What a message or line says to a person.
    pub fn lines(&mut self, received: &Received) -> Vec<String> {
        let message = match received {
            Received::Text(line) => return vec![line.as_str().to_owned()],
            Received::Message { message, .. } => message,
        };
        match message {
            Message::Hello(report) => {
                if report.epoch < self.epoch {
                    self.compensation = Compensation::default(); // it has forgotten what it had learnt
                }
                (self.sample_rate_hz, self.epoch) = (Some(report.sample_rate_hz), report.epoch);
                hello(report)
            }
            Message::Channel(report) => channel(report),
            Message::Health(report) => vec![health(report)],
            Message::Log(line) => vec![line.as_str().to_owned()],
            Message::Raw(raw) => vec![self.raw(raw)],
            Message::Validation(checked) => vec![lesson::checked(checked, self.sample_rate_hz)],
            Message::Learned(learnt) => {
                self.compensation.learn(learnt);
                lesson::learnt(learnt)
            }
        }
    }

    /// The last burst is shown as it is and compensated, where anything is.
    fn raw(&self, raw: &RawMessage) -> String {
        let mut text = format!("raw: {} bursts from number {}", raw.bursts.len(), raw.first);
        let values = raw.bursts.last().map(|burst| self.compensation.of(burst, raw.sens_avg));
        for Compensated { channel, raw, compensated } in values.into_iter().flatten() {
            text += &format!(", {} {raw:.4} -> {compensated:.4} {}", channel.name(), channel.unit());
        }
        text
    }
}

fn hello(report: &Hello) -> Vec<String> {
    let (major, minor, patch) = report.firmware;
    let measured = report.measured_rate_hz.map_or_else(|| "not yet".to_owned(), |hz| format!("{hz:.4} Hz"));
    let epoch = if report.epoch_s == 0 { "without end".to_owned() } else { format!("of {} s", report.epoch_s) };
    let cause = match report.boot.cause {
        BootCause::Unknown => "for no known reason",
        BootCause::PowerOn => "after power-on",
        BootCause::BrownOut => "after a brown-out",
        BootCause::Pin => "by the reset pin",
        BootCause::Software => "by itself",
        BootCause::Watchdog => "by the watchdog",
    };
    let mut lines = vec![
        format!(
            "-- firmware {major}.{minor}.{patch}, up {:.1} s, started {cause} (start {}, {} channels restored)",
            report.uptime_us as f64 * 1e-6,
            report.boot.starts,
            report.boot.restored_channels
        ),
        format!(
            "   ADIS{}, {}, ±{} deg/s, filter 2^{}, {:.1} SPS, measured {measured}, SCK {} Hz; epoch {} {epoch}",
            report.product_id,
            if report.sampling { "sampled" } else { "being probed" },
            report.gyro_full_scale,
            report.filter_taps_log2,
            report.sample_rate_hz,
            report.spi_clock_hz,
            report.epoch,
        ),
    ];
    if !report.boot.crash_record.is_empty() {
        lines.push(format!("   crash record: {}", report.boot.crash_record));
    }
    lines
}

fn channel(report: &ChannelMessage) -> Vec<String> {
    let name = name(report.channel);
    let mut text = format!("   {name}: {} samples, {} missing", report.samples, report.missing);
    for coefficient in &report.coefficients {
        let (value, low, high) = (coefficient.value, coefficient.low, coefficient.high);
        text += &format!(", {} {value:.3e} ({low:.3e} to {high:.3e})", lesson::symbol(coefficient.term));
    }
    if let Some(error) = &report.unseen_error {
        text += &format!(", model of the epoch before {:.1} % off", error.rms_percent);
    }
    vec![text]
}

/// Name of the channel in this place of a burst.
pub(super) fn name(channel: u8) -> &'static str {
    Channel::ALL.get(usize::from(channel)).map_or("unknown channel", |channel| channel.name())
}

fn health(health: &Health) -> String {
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
        ("lost edges", health.lost_edges),
        ("spurious edges", health.spurious_edges),
        ("unchecked", health.unchecked),
        ("recoveries", health.recoveries),
        ("raw messages dropped", health.raw_dropped),
        ("serial overruns", health.serial_overruns),
        ("bad commands", health.bad_commands),
    ];
    let mut text = format!("   {} of {} bursts used", health.used, health.bursts);
    for (name, count) in counters.into_iter().filter(|(_, count)| *count > 0) {
        text += &format!(", {name} {count}");
    }
    text + &format!("; awake {:.1} %", f64::from(health.awake_permille) / 10.0)
}
