//! A report in frames: who speaks, every channel, health. Made one message at a time.

use super::epoch::INERTIAL;
use super::{App, Sensor};
use crate::board::Board;
use crate::estimators::CHANNELS;
use crate::lesson::Lesson;
use crate::summary::{channel_model, channel_report, unseen_error};
use crate::sums::Sums;
use adis16405_driver::{Channel, GyroRange};
use allan_core::Model;
use link::{Health, Hello, MessageRef, ModelError};

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

/// A message of a report.
#[derive(Clone, Copy)]
enum Part {
    Hello,
    /// A channel.
    Channel(usize),
    /// What the epoch says to what was learnt of an inertial channel.
    Checked(usize),
    /// What the epoch teaches of an inertial channel.
    Learnt(usize),
    Health,
}

impl Part {
    /// The part that is in this place. That of a report that ends an epoch is longer.
    fn at(index: usize, closing: bool) -> Option<Self> {
        let pupils = if closing { INERTIAL } else { 0 };
        let channels = 1 + CHANNELS.len();
        Some(match index {
            0 => Self::Hello,
            _ if index < channels => Self::Channel(index - 1),
            _ if index < channels + pupils => Self::Checked(index - channels),
            _ if index < channels + 2 * pupils => Self::Learnt(index - channels - pupils),
            _ if index == channels + 2 * pupils => Self::Health,
            _ => return None,
        })
    }
}

/// How far the report under way has come.
#[derive(Default)]
pub(super) struct Report {
    next: Option<usize>,
    /// Whether it ends an epoch: then it is of that epoch, whose statistics have made room for the next one's.
    closing: bool,
}

impl Report {
    /// Starts a report. One that is under way is finished first and counts as this one.
    pub(super) fn start(&mut self) {
        self.next.get_or_insert(0);
    }

    /// Starts the report that ends an epoch, in the place of one that is under way.
    pub(super) fn close(&mut self) {
        *self = Self { next: Some(0), closing: true };
    }

    pub(super) fn is_under_way(&self) -> bool {
        self.next.is_some()
    }

    pub(super) fn is_closing(&self) -> bool {
        self.closing
    }
}

/// The sums of [`CHANNELS`]`[index]` as they stand.
#[inline(never)]
pub(super) fn sums(board: &mut impl Board, index: usize) -> Sums {
    board.estimators(|estimators| estimators.get(index).map_or(Sums::NONE, Sums::of))
}

#[inline(never)]
fn say(board: &mut impl Board, channel: Channel, sums: &Sums, model: Option<&Model>, unseen: Option<ModelError>) {
    let report = channel_report(channel, sums, model, unseen);
    send(board, MessageRef::Channel(&report));
}

/// Sends a message; there must be room for it.
#[inline(never)]
pub(super) fn send(board: &mut impl Board, message: MessageRef<'_>) {
    board.outbox(|outbox| outbox.send(message));
}

impl App {
    /// Makes and sends the next message of the report under way; there must be room for it.
    #[inline(never)] // so that its stack is not everybody's
    pub(super) fn report(&mut self, board: &mut impl Board) {
        let Report { next: Some(index), closing } = self.report else { return };
        let Some(part) = Part::at(index, closing) else {
            self.report = Report::default();
            return;
        };
        match part {
            Part::Hello => self.say_hello(board),
            Part::Channel(k) => self.channel(board, k),
            Part::Checked(k) => self.check(board, k),
            Part::Learnt(k) => self.study(board, k),
            Part::Health => self.say_health(board),
        }
        if self.report.closing == closing {
            // Otherwise the statistics were forgotten meanwhile.
            self.report.next = Some(index + 1);
        }
    }

    #[inline(never)] // here and below: so that no message is on the stack but the one that is made
    fn say_hello(&self, board: &mut impl Board) {
        let hello = self.hello(board);
        send(board, MessageRef::Hello(&hello));
    }

    #[inline(never)]
    fn say_health(&self, board: &mut impl Board) {
        let health = self.health(board);
        send(board, MessageRef::Health(&health));
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
            stack_size: meters.stack_size,
            ..board.estimators(|estimators| estimators.health())
        }
    }

    /// The sums that the report is of.
    #[inline(never)]
    fn reported(&self, board: &mut impl Board, k: usize) -> Sums {
        match self.school.finished().filter(|_| self.report.closing) {
            Some(epoch) => epoch.sums(k),
            None => sums(board, k),
        }
    }

    #[inline(never)]
    fn channel(&self, board: &mut impl Board, k: usize) {
        let (channel, sums) = (CHANNELS[k], &self.reported(board, k));
        let lesson = self.school.lessons.get(k);
        let unseen = lesson.and_then(|lesson| self.unseen(lesson, channel, sums));
        let model = lesson.map(|_| channel_model(channel, sums, self.config));
        say(board, channel, sums, model.as_ref(), unseen);
    }

    /// How wrong what was learnt before is on the sums.
    #[inline(never)]
    fn unseen(&self, lesson: &Lesson, channel: Channel, sums: &Sums) -> Option<ModelError> {
        unseen_error(channel, sums, self.config, &lesson.declared(self.config)?)
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
            spi_clock_hz: self.spi_clock_hz,
            uptime_us: board.now_us(),
            sampling: matches!(self.sensor, Sensor::Sampled { .. }),
            epoch: self
                .school
                .finished()
                .filter(|_| self.report.closing)
                .map_or(self.settings.epoch, |epoch| epoch.number),
            epoch_s: self.settings.epoch_s,
            boot: self.boot.clone(),
        }
    }
}
