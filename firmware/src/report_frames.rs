//! The report in frames: device and settings, channels, health; at an epoch's end also validation and learned models.

use crate::board::Board;
use crate::device::DeviceState;
use crate::report_messages::model_error;
use crate::scale::ReportScale;
use crate::statistics::{CHANNELS, ChannelSums, INERTIAL};
use adis16405_driver::GyroRange;
use link::{Hello, MessageRef};

const VERSION: (u8, u8, u8) = (
    decimal(env!("CARGO_PKG_VERSION_MAJOR")),
    decimal(env!("CARGO_PKG_VERSION_MINOR")),
    decimal(env!("CARGO_PKG_VERSION_PATCH")),
);

/// Parses a number; one above 255 fails the compilation.
const fn decimal(digits: &str) -> u8 {
    match u8::from_str_radix(digits, 10) {
        Ok(number) => number,
        Err(_) => panic!("a version number above 255"),
    }
}

impl DeviceState {
    /// Sends device and settings; sets the measured rate of the whole report.
    pub(crate) fn send_hello(&mut self, ends_epoch: bool, board: &mut impl Board) {
        let finished = self.learner.finished.as_deref().filter(|_| ends_epoch);
        let (number, finished_hz) =
            finished.map_or((self.settings.epoch, None), |epoch| (epoch.number, epoch.measured_hz));
        let measured_hz =
            if ends_epoch { finished_hz } else { board.estimators(|estimators| estimators.measured_hz()) };
        self.report_scale = ReportScale::new(self.config, measured_hz);
        let hello = Hello {
            firmware: VERSION,
            product_id: self.product_id,
            gyro_full_scale: match self.config.range() {
                GyroRange::Dps300 => 300,
                GyroRange::Dps150 => 150,
                GyroRange::Dps75 => 75,
            },
            filter_taps_log2: self.config.filter_taps_log2(),
            sample_rate_hz: self.config.sample_period().hz(),
            measured_rate_hz: measured_hz,
            spi_clock_hz: self.spi_clock_hz,
            uptime_us: board.now_us(),
            sampling: self.is_sampled(),
            epoch: number,
            epoch_s: self.settings.user.epoch_s,
            boot: self.boot.clone(),
        };
        send(board, MessageRef::Hello(&hello));
    }

    pub(crate) fn send_health(&self, board: &mut impl Board) {
        let health = self.health(board);
        send(board, MessageRef::Health(&health));
    }

    pub(crate) fn send_channel(&self, index: usize, ends_epoch: bool, board: &mut impl Board) {
        let (channel, sums) = (CHANNELS[index], &self.reported_sums(index, ends_epoch, board));
        let model = self.learner.models.get(index);
        let learned = model.and_then(|model| model.baseline(self.report_scale));
        let unseen_error = learned.and_then(|model| model_error(&model, &sums.curve(channel, self.report_scale)));
        let baseline = model.map(|_| sums.fit_baseline(channel, self.report_scale));
        let losses = board.estimators(|estimators| estimators.losses(ends_epoch));
        let mut report = sums.report(channel, baseline.as_ref(), unseen_error);
        (report.lost, report.refused) = (losses.lost, losses.refused[index]);
        report.self_test_failed = self.recovery.failed_test.contains(index);
        send(board, MessageRef::Channel(&report));
    }

    fn reported_sums(&self, index: usize, ends_epoch: bool, board: &mut impl Board) -> ChannelSums {
        match self.learner.finished.as_deref().filter(|_| ends_epoch) {
            Some(epoch) => epoch.sums(index).cloned().unwrap_or(ChannelSums::EMPTY),
            None => running_sums(board, index),
        }
    }

    pub(crate) fn send_validation(&mut self, index: usize, board: &mut impl Board) {
        if let Some(message) = self.learner.validate(index, self.config) {
            send(board, MessageRef::Validation(&message));
        }
    }
}

pub(crate) fn running_sums(board: &mut impl Board, index: usize) -> ChannelSums {
    board.estimators(|estimators| estimators.channel(index).map_or(ChannelSums::EMPTY, ChannelSums::from_estimator))
}

/// Queues a message. Without room the message is dropped and counted as missing.
pub(crate) fn send(board: &mut impl Board, message: MessageRef<'_>) {
    board.transmit_queue(|queue| queue.send(message));
}

#[derive(Clone, Copy)]
pub(crate) enum ReportPart {
    Hello,
    Channel(usize),
    Validation(usize),
    Learned(usize),
    Health,
}

#[derive(Default)]
pub(crate) struct ReportProgress {
    /// Index of the next message; `None` without a report.
    next: Option<usize>,
    /// True if the report is on the sums of the finished epoch.
    ends_epoch: bool,
}

impl ReportProgress {
    /// Starts a report of the running epoch; has no effect during a report.
    pub(crate) fn start(&mut self) {
        self.next.get_or_insert(0);
    }

    pub(crate) fn start_epoch_end(&mut self) {
        *self = Self { next: Some(0), ends_epoch: true };
    }

    pub(crate) fn is_active(&self) -> bool {
        self.next.is_some()
    }

    pub(crate) fn ends_epoch(&self) -> bool {
        self.ends_epoch
    }

    /// The next part; `None` without a report, or at its end.
    pub(crate) fn part(&mut self) -> Option<ReportPart> {
        let learners = if self.ends_epoch { INERTIAL } else { 0 };
        let channels = 1 + CHANNELS.len();
        Some(match self.next? {
            0 => ReportPart::Hello,
            index if index < channels => ReportPart::Channel(index - 1),
            index if index < channels + learners => ReportPart::Validation(index - channels),
            index if index < channels + 2 * learners => ReportPart::Learned(index - channels - learners),
            index if index == channels + 2 * learners => ReportPart::Health,
            _ => {
                *self = Self::default();
                return None;
            }
        })
    }

    /// Advances unless the report was replaced meanwhile; `ended_epoch` tells which kind of report the message belongs
    /// to.
    pub(crate) fn advance(&mut self, ended_epoch: bool) {
        if self.ends_epoch == ended_epoch {
            self.next = self.next.map(|next| next + 1);
        }
    }
}
