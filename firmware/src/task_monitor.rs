//! Proof that every task is alive, without which the watchdog is not fed.

use crate::acquisition::SamplingActivity;
use crate::board::Board;
use crate::device::log;

/// Time for which a burst may take to arrive, or a queued burst to be processed. Both take less than a millisecond.
const SAMPLING_US: u64 = 2_000_000;
/// Time for which the transmit queue may be without room while something waits. It empties in 60 ms.
const REPORT_US: u64 = 10_000_000;

/// A task that has stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum StoppedTask {
    /// The transfer of a burst does not end.
    Sampling,
    /// Bursts are queued and not processed.
    Estimators,
    /// Nothing that waits is transmitted.
    Reports,
}

impl StoppedTask {
    /// Name for a log.
    const fn name(self) -> &'static str {
        match self {
            Self::Sampling => "sampling",
            Self::Estimators => "estimators",
            Self::Reports => "reports",
        }
    }
}

/// Compares counters of the tasks with those of earlier passes of the main loop.
///
/// Edges that do not come at all are not a matter of the tasks but of the sensor, which is then probed and reset.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TaskMonitor {
    activity: SamplingActivity,
    /// Since when the present transfer has not ended.
    reading_since_us: Option<u64>,
    processed: u32,
    /// Transfers ended when `processed` was seen to change.
    ended_then: u32,
    /// Since when bursts have not been processed.
    behind_since_us: Option<u64>,
    /// When the transmit queue had room, or nothing to transmit, for the last time.
    transmitted_us: u64,
    /// The task that was found stopped.
    stopped: Option<StoppedTask>,
}

impl TaskMonitor {
    /// A monitor that starts at `now_us`.
    pub(crate) const fn new(now_us: u64) -> Self {
        Self {
            activity: SamplingActivity { started: 0, ended: 0, masked: 0, is_masked: false },
            reading_since_us: None,
            processed: 0,
            ended_then: 0,
            behind_since_us: None,
            transmitted_us: now_us,
            stopped: None,
        }
    }

    /// The transmit queue has room, or nothing waits for it.
    pub(crate) fn mark_transmitted(&mut self, now_us: u64) {
        self.transmitted_us = now_us;
    }

    /// Whether sampling, estimators and reports are alive. The first one that is not is logged, once.
    pub(crate) fn are_alive(&mut self, board: &mut impl Board) -> bool {
        let (now_us, activity) = (board.now_us(), board.sampling_activity());
        let processed = board.estimators(|estimators| estimators.processed());
        let stopped = self.find_stopped(now_us, activity, processed);
        if let Some(task) = stopped.filter(|_| self.stopped != stopped) {
            log(board, format_args!("{} stopped; waiting for the watchdog", task.name()));
        }
        self.stopped = stopped;
        stopped.is_none()
    }

    /// The first task that has stopped, by what sampling has done and how many bursts the estimators have processed.
    fn find_stopped(&mut self, now_us: u64, activity: SamplingActivity, processed: u32) -> Option<StoppedTask> {
        if activity.started == activity.ended || activity.started != self.activity.started {
            self.reading_since_us = None;
        } else {
            self.reading_since_us.get_or_insert(now_us);
        }
        self.activity = activity;
        if processed != self.processed {
            (self.processed, self.ended_then, self.behind_since_us) = (processed, activity.ended, None);
        } else if activity.ended != self.ended_then {
            self.behind_since_us.get_or_insert(now_us);
        }
        let longer = |since: Option<u64>| since.is_some_and(|since| now_us.saturating_sub(since) > SAMPLING_US);
        if longer(self.reading_since_us) {
            Some(StoppedTask::Sampling)
        } else if longer(self.behind_since_us) {
            Some(StoppedTask::Estimators)
        } else {
            (now_us.saturating_sub(self.transmitted_us) > REPORT_US).then_some(StoppedTask::Reports)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1000;
    const PERIOD_US: u64 = 5 * MS;

    /// Passes of the main loop every 5 ms for 20 s, of which the closure makes activity and processed bursts. Returns the
    /// first stopped task and the time.
    fn first_stop(transmitting: bool, at: impl Fn(u32) -> (SamplingActivity, u32)) -> Option<(StoppedTask, u64)> {
        let mut monitor = TaskMonitor::new(0);
        (0..4000_u32).find_map(|pass| {
            let now_us = u64::from(pass) * PERIOD_US;
            let (activity, processed) = at(pass);
            if transmitting {
                monitor.mark_transmitted(now_us);
            }
            monitor.find_stopped(now_us, activity, processed).map(|task| (task, now_us))
        })
    }

    fn ended(count: u32) -> SamplingActivity {
        SamplingActivity { started: count, ended: count, ..SamplingActivity::default() }
    }

    #[test]
    fn living_tasks_are_not_stopped() {
        assert_eq!(first_stop(true, |pass| (ended(pass), pass)), None);
        assert_eq!(first_stop(true, |_| (ended(7), 7)), None, "no edges");
        assert_eq!(first_stop(true, |pass| (ended(u32::MAX - 5).after(pass), pass)), None, "counters wrap");
        // One burst in 10 s, found during its transfer, and after it before it is processed.
        let slow = |pass: u32| {
            let bursts = pass / 2000;
            match pass % 2000 {
                0 => (SamplingActivity { started: bursts + 1, ..ended(bursts) }, bursts),
                1 => (ended(bursts + 1), bursts),
                _ => (ended(bursts + 1), bursts + 1),
            }
        };
        assert_eq!(first_stop(true, slow), None);
    }

    impl SamplingActivity {
        fn after(self, more: u32) -> Self {
            Self { started: self.started.wrapping_add(more), ended: self.ended.wrapping_add(more), ..self }
        }
    }

    /// Each task stops after 5 s.
    #[test]
    fn a_stopped_task_is_found_within_its_time() {
        let stop = 1000;
        let within = |found: Option<(StoppedTask, u64)>, task, limit_us: u64| {
            let (stopped, at_us) = found.expect("a stopped task");
            let late_us = at_us - u64::from(stop) * PERIOD_US;
            assert_eq!(stopped, task);
            assert!((limit_us..limit_us + 4 * PERIOD_US).contains(&late_us), "{late_us} us");
        };
        let transfer = |pass: u32| {
            let bursts = pass.min(stop);
            (SamplingActivity { started: bursts + u32::from(pass > stop), ..ended(bursts) }, bursts)
        };
        within(first_stop(true, transfer), StoppedTask::Sampling, SAMPLING_US);
        within(first_stop(true, |pass| (ended(pass), pass.min(stop))), StoppedTask::Estimators, SAMPLING_US);
        let (task, at_us) = first_stop(false, |pass| (ended(pass), pass)).expect("a stopped task");
        assert_eq!((task, at_us), (StoppedTask::Reports, REPORT_US + PERIOD_US));
    }
}
