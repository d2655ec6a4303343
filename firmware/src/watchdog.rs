//! The watchdog: fed only while all tasks are alive and the clock runs.

use crate::acquisition::SamplingActivity;
use crate::board::Board;
use crate::bus_frame::MicrosecondCounter;
use crate::device::log;
use crate::event::event;
use core::marker::PhantomData;
use embedded_hal::delay::DelayNs;

/// Limit for a burst or its processing, µs; usually below a millisecond.
const SAMPLING_US: u64 = 2_000_000;
/// Limit for room in the transmit queue, µs; the queue empties in 60 ms.
const REPORT_US: u64 = 10_000_000;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(all(target_os = "none", feature = "microcontroller"), derive(defmt::Format))]
enum StoppedTask {
    Sampling,
    Estimators,
    Reports,
}

/// Compares task counters between passes. Missing edges are the sensor's fault and do not count.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct TaskMonitor {
    activity: SamplingActivity,
    reading_since_us: Option<u64>,
    processed: u32,
    /// Bursts that had ended when `processed` last changed.
    ended_then: u32,
    behind_since_us: Option<u64>,
    /// Last time at which the queue had room or nothing was to be sent, µs.
    transmitted_us: u64,
    stopped: Option<StoppedTask>,
}

impl TaskMonitor {
    pub(crate) fn new(now_us: u64) -> Self {
        Self { transmitted_us: now_us, ..Self::default() }
    }

    pub(crate) fn mark_transmitted(&mut self, now_us: u64) {
        self.transmitted_us = now_us;
    }

    /// True if sampling, estimators and reports are alive; logs the first stop once.
    pub(crate) fn are_alive(&mut self, board: &mut impl Board) -> bool {
        let (now_us, activity) = (board.now_us(), board.sampling_activity());
        let processed = board.estimators(|estimators| estimators.processed());
        let stopped = self.find_stopped(now_us, activity, processed);
        if let Some(task) = stopped.filter(|_| self.stopped != stopped) {
            event!(error, "{} stopped", task);
            log(board, format_args!("{task:?} stopped; waiting for the watchdog"));
        }
        self.stopped = stopped;
        stopped.is_none()
    }

    /// Finds a stopped task from the sampling activity and the number of processed bursts.
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

/// The watchdog of a microcontroller.
pub trait Watchdog: MicrosecondCounter {
    /// Restarts the watchdog's time.
    fn feed();
}

/// Feeds the watchdog only if the microsecond counter has advanced: without the counter no wait ends.
pub struct Feeder<M> {
    fed_at: u32,
    microcontroller: PhantomData<M>,
}

impl<M> Default for Feeder<M> {
    fn default() -> Self {
        Self { fed_at: 0, microcontroller: PhantomData }
    }
}

impl<M: Watchdog> Feeder<M> {
    /// Feeds the watchdog.
    pub fn feed(&mut self) {
        let now = M::counter();
        if core::mem::replace(&mut self.fed_at, now) != now {
            M::feed();
        }
    }
}

/// A delay that feeds the watchdog while it waits.
pub struct FeedingDelay<'a, M>(pub &'a mut Feeder<M>);

impl<M: Watchdog> DelayNs for FeedingDelay<'_, M> {
    fn delay_ns(&mut self, ns: u32) {
        self.delay_us(ns.div_ceil(1000));
    }

    fn delay_us(&mut self, us: u32) {
        let start = M::counter();
        while M::counter().wrapping_sub(start) <= us {
            self.0.feed();
        }
    }
}

/// Lets a periodic interrupt feed a short watchdog for some ticks after the main loop has fed it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WatchdogExtension {
    feedings: u32,
    ticks_left: u32,
}

impl WatchdogExtension {
    /// The state before the first feeding.
    pub const START: Self = Self { feedings: 0, ticks_left: 0 };

    /// To be called at each tick with the number of the main loop's feedings. True, for `ticks` after each, if the
    /// watchdog is to be fed.
    pub fn tick(&mut self, feedings: u32, ticks: u32) -> bool {
        self.ticks_left = if feedings == self.feedings { self.ticks_left.saturating_sub(1) } else { ticks };
        self.feedings = feedings;
        self.ticks_left > 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

    const MS: u64 = 1000;
    const PERIOD_US: u64 = 5 * MS;

    /// Runs a pass every 5 ms for 20 s; returns the first stopped task and the time.
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
        // One burst comes in 10 s.
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

    #[test]
    fn a_long_step_is_fed_through_and_a_hang_is_not() {
        let mut extension = WatchdogExtension::START;
        let fed = |extension: &mut WatchdogExtension, feedings, ticks| {
            (0..ticks).filter(|_| extension.tick(feedings, 480)).count()
        };
        assert_eq!(fed(&mut extension, 0, 100), 0, "nothing has been fed yet");
        assert_eq!(fed(&mut extension, 1, 400), 400, "25 s at 16 ticks a second");
        assert_eq!(fed(&mut extension, 2, 1000), 480, "the main loop hangs");
        assert_eq!(fed(&mut extension, 2, 1000), 0);
        assert_eq!(fed(&mut extension, 3, 1), 1);
    }

    struct StoppedCounter;

    const STOPPED_READINGS: u32 = 10_000;
    static READINGS: AtomicU32 = AtomicU32::new(0);
    /// Number of feedings while the counter stands still, and after.
    static FEEDINGS: [AtomicU32; 2] = [const { AtomicU32::new(0) }; 2];

    impl MicrosecondCounter for StoppedCounter {
        fn counter() -> u32 {
            READINGS.fetch_add(1, Relaxed).saturating_sub(STOPPED_READINGS)
        }
    }

    impl Watchdog for StoppedCounter {
        fn feed() {
            FEEDINGS[usize::from(READINGS.load(Relaxed) > STOPPED_READINGS + 1)].fetch_add(1, Relaxed);
        }
    }

    #[test]
    fn the_watchdog_is_not_fed_while_the_counter_stands_still() {
        FeedingDelay(&mut Feeder::<StoppedCounter>::default()).delay_us(50);
        let [stopped, running] = [0, 1].map(|index| FEEDINGS[index].load(Relaxed));
        assert_eq!(stopped, 0);
        assert!(running > 20, "{running} times in 50 us");
    }
}
