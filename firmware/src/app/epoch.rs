//! From one epoch to the next: its statistics are handed over, what was learnt before is checked on them, and they teach.

use super::App;
use super::report::{Report, send};
use crate::board::Board;
use crate::compensation::{Causes, learn};
use crate::couplings::Means;
use crate::epoch::Epoch;
use crate::estimators::CHANNELS;
use crate::lesson::{Lesson, Taught, check};
use adis16405_driver::Channel;
use link::{Checked, Drift, MessageRef};

/// Channels that are taught.
pub(super) const INERTIAL: usize = Channel::INERTIAL.len();

/// What was learnt, and from what.
pub(super) struct School {
    /// The last epoch that is over; `None` while it teaches.
    finished: Option<&'static mut Epoch>,
    pub(super) lessons: [Lesson; INERTIAL],
    /// Means of the epoch that taught them.
    means: Option<Means>,
    /// What the last epoch said to the lessons of the one before.
    pub(super) verdicts: [Option<Verdict>; INERTIAL],
}

/// The errors and the bias drift of an epoch, before and after.
#[derive(Clone, Copy)]
pub(super) struct Verdict {
    /// Deviance per point.
    pub(super) errors: (f64, f64),
    /// At the longest averaging time of which the epoch holds eight.
    pub(super) drift: Drift,
}

impl Verdict {
    fn of(checked: &Checked, samples: u64) -> Option<Self> {
        let errors = (checked.before?.deviance_per_point, checked.after?.deviance_per_point);
        let drift = *checked.drift.iter().rfind(|drift| drift.n <= samples / 8)?;
        Some(Self { errors, drift })
    }
}

impl School {
    pub(super) fn new(finished: &'static mut Epoch) -> Self {
        Self {
            finished: Some(finished),
            lessons: [const { Lesson::NOTHING }; INERTIAL],
            means: None,
            verdicts: [const { None }; INERTIAL],
        }
    }

    /// The last epoch that is over.
    pub(super) fn finished(&self) -> Option<&Epoch> {
        self.finished.as_deref()
    }
}

impl App {
    /// The statistics begin again, and with them the count of epochs; nothing that was learnt is kept.
    pub(super) fn forget(&mut self, board: &mut impl Board) {
        board.estimators(|estimators| estimators.forget());
        self.settings.epoch = 0;
        self.school.lessons = [const { Lesson::NOTHING }; INERTIAL];
        self.school.verdicts = [const { None }; INERTIAL];
        self.school.means = None;
        self.report = Report::default();
        self.begin_epoch(board);
    }

    /// The next epoch begins with the next sample, and the report on this one is due. As long as the one before is still
    /// teaching, this one goes on.
    pub(super) fn finish_epoch(&mut self, board: &mut impl Board) {
        let Some(finished) = self.school.finished.as_deref_mut().filter(|_| !self.report.is_closing()) else { return };
        let retained = &mut self.retained;
        board.estimators(|estimators| estimators.finish_epoch(retained, finished));
        finished.number = self.settings.epoch;
        self.settings.epoch = self.settings.epoch.saturating_add(1);
        self.report.close();
        self.begin_epoch(board);
    }

    fn begin_epoch(&mut self, board: &mut impl Board) {
        self.epoch_began_us = board.now_us();
        self.retained.keep_settings(self.settings, true);
    }

    /// The finished epoch against what was learnt of a channel in the one before.
    #[inline(never)] // here and below: so that its stack is not everybody's
    pub(super) fn check(&mut self, board: &mut impl Board, index: usize) {
        let Some(epoch) = self.school.finished() else { return };
        let means = self.school.means.as_ref();
        let checked = check(&self.school.lessons[index], means, epoch, index, self.config);
        self.school.verdicts[index] = checked.as_ref().and_then(|checked| Verdict::of(checked, epoch.samples(index)));
        if let Some(checked) = &checked {
            send(board, MessageRef::Checked(checked));
        }
    }

    /// Learns what the finished epoch teaches of a channel, and goes on with everything else meanwhile.
    pub(super) fn study(&mut self, board: &mut impl Board, index: usize) {
        let Some(epoch) = self.school.finished.take() else { return };
        let config = self.config;
        if let Some(causes) = learn(epoch, index, config, &mut || self.goes_on(board)) {
            self.trace(board, epoch, index, causes);
        }
        self.school.finished = Some(epoch);
    }

    #[inline(never)]
    fn trace(&mut self, board: &mut impl Board, epoch: &Epoch, index: usize, causes: Causes) {
        let config = self.config;
        let mut taught = Taught::of(causes);
        if !taught.study(epoch, index, config, &mut || self.goes_on(board)) {
            return;
        }
        if index + 1 == INERTIAL {
            self.school.means = epoch.covariances().map(|covariances| covariances.means);
        }
        self.school.lessons[index] = taught.lesson();
        say(board, &taught, index, epoch.number);
    }

    /// Everything else, while an epoch teaches. False if what it teaches is not wanted any more.
    fn goes_on(&mut self, board: &mut impl Board) -> bool {
        self.attend(board);
        if self.speak_up(board) {
            self.answer_briefly(board);
        }
        self.report.is_closing()
    }
}

#[inline(never)]
fn say(board: &mut impl Board, taught: &Taught, index: usize, epoch: u32) {
    let learnt = taught.message(index, epoch);
    send(board, MessageRef::Learnt(&learnt));
}

const _: () = assert!(CHANNELS.len() >= INERTIAL);
