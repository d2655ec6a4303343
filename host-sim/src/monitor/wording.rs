//! Messages in words.

use adis16405_driver::Channel;
use link::{BootCause, ChannelReport, Health, Hello, Message, Received, Term};

/// What a message or line says to a person.
pub fn lines(received: &Received) -> Vec<String> {
    let message = match received {
        Received::Line(line) => return vec![line.as_str().to_owned()],
        Received::Message { message, .. } => message,
    };
    match message {
        Message::Hello(report) => hello(report),
        Message::Channel(report) => channel(report),
        Message::Health(report) => vec![health(report)],
        Message::Log(line) => vec![line.as_str().to_owned()],
        Message::Raw(raw) => vec![format!("raw: {} bursts from number {}", raw.bursts.len(), raw.first)],
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
            "-- firmware {major}.{minor}.{patch}, up {:.1} s, started {cause} (start {}, {} channels kept)",
            report.uptime_us as f64 * 1e-6,
            report.boot.starts,
            report.boot.kept_channels
        ),
        format!(
            "   ADIS{}, {}, ±{} deg/s, filter 2^{}, {:.1} SPS, measured {measured}, SCK {} Hz; epoch {} {epoch}",
            report.product_id,
            if report.sampling { "sampled" } else { "sought" },
            report.gyro_full_scale,
            report.filter_taps_log2,
            report.sample_rate_hz,
            report.spi_clock_hz,
            report.epoch,
        ),
    ];
    if !report.boot.last_words.is_empty() {
        lines.push(format!("   last words: {}", report.boot.last_words));
    }
    lines
}

fn channel(report: &ChannelReport) -> Vec<String> {
    let name = Channel::ALL.get(usize::from(report.channel)).map_or("unknown channel", |channel| channel.name());
    let mut text = format!("   {name}: {} samples, {} missing", report.samples, report.missing);
    for coefficient in &report.coefficients {
        let symbol = match coefficient.term {
            Term::AngleRandomWalk => "N",
            Term::BiasInstability => "B",
            Term::RateRandomWalk => "K",
        };
        let (value, low, high) = (coefficient.value, coefficient.low, coefficient.high);
        text += &format!(", {symbol} {value:.3e} ({low:.3e} to {high:.3e})");
    }
    if let Some(error) = &report.unseen {
        text += &format!(", model of the epoch before {:.1} % off", error.rms_percent);
    }
    vec![text]
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
        ("stray edges", health.stray_edges),
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
