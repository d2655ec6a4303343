//! A report in frames: who speaks, every channel, health. Made one message at a time.

use super::{App, Sensor};
use crate::board::Board;
use crate::estimators::CHANNELS;
use crate::summary::{channel_model, channel_report};
use adis16405_driver::{Channel, GyroRange};
use core::ops::Range;
use link::{Health, Hello, Message};

/// Messages of a report.
const MESSAGES: usize = CHANNELS.len() + 2;

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

/// How far the report under way has come.
#[derive(Default)]
pub(super) struct Report {
    left: Range<usize>,
    /// Whether it ends an epoch: what it fits is what the epoch has learnt.
    closing: bool,
}

impl Report {
    /// Starts a report; `closing` if it ends an epoch. One that is under way is finished first and counts as this one.
    pub(super) fn start(&mut self, closing: bool) {
        if self.left.is_empty() || closing && !self.closing {
            self.left = 0..MESSAGES;
        }
        self.closing |= closing;
    }

    pub(super) fn is_under_way(&self) -> bool {
        !self.left.is_empty()
    }
}

impl App {
    /// Makes and sends the next message of the report under way; there must be room for it.
    #[inline(never)] // so that its stack is not everybody's
    pub(super) fn report(&mut self, board: &mut impl Board) {
        let Some(index) = self.report.left.next() else { return };
        let message = match index.checked_sub(1) {
            None => Message::Hello(self.hello(board)),
            Some(k) => match CHANNELS.get(k) {
                Some(&channel) => match self.channel(board, k, channel) {
                    Some(message) => message,
                    None => return,
                },
                None => Message::Health(self.health(board)),
            },
        };
        board.outbox(|outbox| outbox.send(&message));
        if !self.report.is_under_way() && core::mem::take(&mut self.report.closing) {
            // What has arrived since each channel was reported belongs to no epoch.
            self.begin_epoch(board, self.settings.epoch.saturating_add(1));
        }
    }

    /// What was lost so far, with what the board measures of itself.
    pub(super) fn health(&self, board: &mut impl Board) -> Health {
        let (meters, now_us) = (board.meters(), board.now_us());
        let asleep_permille = (1000 * meters.asleep_us).checked_div(now_us).unwrap_or(0);
        Health {
            recoveries: self.recoveries,
            bad_commands: self.bad_commands,
            serial_overruns: meters.serial_overruns,
            awake_permille: 1000_u32.saturating_sub(asleep_permille as u32),
            sampling_cycles: meters.sampling_cycles,
            estimator_cycles: meters.estimator_cycles,
            stack_bytes: meters.stack_bytes,
            ..board.estimators(|estimators| estimators.health())
        }
    }

    #[inline(never)]
    fn channel(&mut self, board: &mut impl Board, k: usize, channel: Channel) -> Option<Message> {
        let estimator = board.estimators(|estimators| estimators.get(k).cloned())?;
        let inertial = k < Channel::INERTIAL.len();
        let model = inertial.then(|| channel_model(channel, &estimator, self.config));
        let previous = self.learnt.get(k).and_then(Option::as_ref);
        let report = channel_report(channel, &estimator, self.config, model.as_ref(), previous);
        if let Some(learnt) = self.learnt.get_mut(k).filter(|_| self.report.closing) {
            *learnt = model;
        }
        Some(Message::Channel(report))
    }

    fn hello(&self, board: &mut impl Board) -> Hello {
        Hello {
            firmware: VERSION,
            product_id: self.product_id,
            gyro_full_scale: match self.config.range() {
                GyroRange::Dps300 => 300,
                GyroRange::Dps150 => 150,
                GyroRange::Dps75 => 75,
            },
            filter_taps_log2: self.config.filter_taps_log2(),
            sample_rate_hz: self.config.sample_period().hz(),
            measured_rate_hz: board.estimators(|estimators| estimators.measured_hz()),
            spi_clock_hz: self.start.spi_clock_hz,
            uptime_us: board.now_us(),
            sampling: matches!(self.sensor, Sensor::Sampled { .. }),
            epoch: self.settings.epoch,
            epoch_s: self.settings.epoch_s,
            boot: self.start.boot.clone(),
        }
    }
}
