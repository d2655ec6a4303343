//! The application: judges bursts, feeds the estimators, reports in time and on request.

use crate::acquisition::Arrival;
use crate::summary::{OCTAVES, OVERLAP, channel_report};
use adis16405_driver::{Burst, Channel, Config, Faults, Judge};
use allan_core::Cascade;
use core::fmt::Write;
use link::{ChannelReport, Encoder, Frame, Health, Hello, Message};

/// What is fixed while the application runs.
#[derive(Debug, Clone, Copy)]
pub struct Settings {
    /// What the sensor was told.
    pub config: Config,
    /// What the sensor answered when asked for its product.
    pub product_id: u16,
    /// Serial clock that was really set, in Hz.
    pub spi_clock_hz: u32,
    /// Time between reports in microseconds; 0 for reports on request only.
    pub report_interval_us: u64,
}

/// Where frames go.
pub trait Sink {
    /// Takes the whole frame, or nothing of it if there is no room now.
    fn offer(&mut self, frame: &[u8]) -> bool;
}

/// The frame of a line for a person, cut to what a message holds.
pub fn log_frame(encoder: &mut Encoder, text: core::fmt::Arguments<'_>) -> Option<Frame> {
    let mut line = heapless::String::new();
    let _cut = line.write_fmt(text);
    encoder.encode(&Message::Log(line))
}

/// Version of the firmware, from the manifest.
const VERSION: (u8, u8, u8) = (
    decimal(env!("CARGO_PKG_VERSION_MAJOR")),
    decimal(env!("CARGO_PKG_VERSION_MINOR")),
    decimal(env!("CARGO_PKG_VERSION_PATCH")),
);

/// A number of the manifest; one that does not fit does not compile.
const fn decimal(digits: &str) -> u8 {
    match u8::from_str_radix(digits, 10) {
        Ok(number) => number,
        Err(_) => panic!("a version number above 255"),
    }
}

/// Messages of a report: who speaks, six channels, health.
const REPORT_MESSAGES: usize = Channel::INERTIAL.len() + 2;

/// The application's state: six estimators, the verdicts, and how far the report under way has come.
pub struct App {
    settings: Settings,
    estimators: [Cascade<OCTAVES, OVERLAP>; 6],
    judge: Judge,
    health: Health,
    encoder: Encoder,
    unsent: Option<Frame>,
    /// Messages of the report that are still to be made.
    report: core::ops::Range<usize>,
    next_report_us: u64,
}

impl App {
    /// An application that has seen nothing; the first report is due after one interval.
    ///
    /// `encoder` numbers its messages on from those that were sent while the sensor was sought.
    #[must_use]
    pub fn new(settings: Settings, encoder: Encoder) -> Self {
        Self {
            settings,
            estimators: [const { Cascade::new() }; 6],
            judge: Judge::default(),
            health: Health::default(),
            encoder,
            unsent: None,
            report: 0..0,
            next_report_us: settings.report_interval_us,
        }
    }

    /// Takes what the next data-ready edge brought; `waiting` is how many more the queue holds.
    pub fn take(&mut self, arrival: Arrival, waiting: usize) {
        let health = &mut self.health;
        health.queue_peak = health.queue_peak.max(u32::try_from(waiting).unwrap_or(u32::MAX).saturating_add(1));
        if arrival.dropped > 0 {
            health.queue_full = health.queue_full.saturating_add(arrival.dropped);
            self.gap(arrival.dropped);
        }
        match arrival.burst {
            Some(burst) => self.burst(&burst),
            None => {
                self.health.bus_errors = self.health.bus_errors.saturating_add(1);
                self.gap(1);
            }
        }
    }

    /// Takes a byte that a person or a program sent: `r` asks for a report. Others are ignored.
    pub fn command(&mut self, byte: u8) {
        if byte == b'r' {
            self.start_report();
        }
    }

    /// Sends at most one message to `sink`. `now_us` is the time since the start, in microseconds.
    ///
    /// True if there is more to send.
    pub fn poll(&mut self, now_us: u64, sink: &mut impl Sink) -> bool {
        if self.settings.report_interval_us > 0 && now_us >= self.next_report_us {
            let late = (now_us - self.next_report_us) / self.settings.report_interval_us;
            self.next_report_us += (late + 1) * self.settings.report_interval_us;
            self.start_report();
        }
        if self.unsent.is_none()
            && let Some(index) = self.report.next()
        {
            let message = self.message(index, now_us);
            self.unsent = self.encoder.encode(&message);
        }
        if let Some(frame) = &self.unsent
            && sink.offer(frame)
        {
            self.unsent = None;
        }
        self.unsent.is_some() || !self.report.is_empty()
    }

    /// What would be reported of one channel now; `None` if it is not an inertial one.
    #[must_use]
    pub fn channel(&self, channel: Channel) -> Option<ChannelReport> {
        let index = Channel::INERTIAL.iter().position(|&inertial| inertial == channel)?;
        Some(channel_report(channel, &self.estimators[index], self.settings.config))
    }

    /// What was lost so far.
    #[must_use]
    pub fn health(&self) -> Health {
        let counters = self.judge.counters();
        Health {
            bursts: counters.bursts,
            used: counters.bursts - counters.unusable,
            no_new_data: counters.get(Faults::NO_NEW_DATA),
            error_alarm: counters.get(Faults::ERROR_ALARM),
            supply: counters.get(Faults::SUPPLY),
            stuck_low: counters.get(Faults::STUCK_LOW),
            stuck_high: counters.get(Faults::STUCK_HIGH),
            repeated: counters.get(Faults::REPEATED),
            ..self.health
        }
    }

    fn burst(&mut self, burst: &Burst) {
        if !self.judge.judge(burst).usable {
            self.gap(1);
            return;
        }
        let counts = burst.counts();
        for (estimator, channel) in self.estimators.iter_mut().zip(Channel::INERTIAL) {
            estimator.push(i32::from(counts.get(channel)));
        }
    }

    fn gap(&mut self, missing: u32) {
        for estimator in &mut self.estimators {
            estimator.gap(missing);
        }
    }

    /// A report that is under way is finished first and counts as the one asked for.
    fn start_report(&mut self) {
        if self.report.is_empty() {
            self.report = 0..REPORT_MESSAGES;
        }
    }

    fn message(&self, index: usize, now_us: u64) -> Message {
        match index.checked_sub(1) {
            None => Message::Hello(self.hello(now_us)),
            Some(k) if k < Channel::INERTIAL.len() => {
                Message::Channel(channel_report(Channel::INERTIAL[k], &self.estimators[k], self.settings.config))
            }
            Some(_) => Message::Health(self.health()),
        }
    }

    fn hello(&self, now_us: u64) -> Hello {
        let config = self.settings.config;
        Hello {
            firmware: VERSION,
            product_id: self.settings.product_id,
            gyro_full_scale: match config.range() {
                adis16405_driver::GyroRange::Dps300 => 300,
                adis16405_driver::GyroRange::Dps150 => 150,
                adis16405_driver::GyroRange::Dps75 => 75,
            },
            filter_taps_log2: config.filter_taps_log2(),
            sample_rate_hz: config.sample_period().hz(),
            spi_clock_hz: self.settings.spi_clock_hz,
            uptime_us: now_us,
        }
    }
}
