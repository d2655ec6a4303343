//! The path of every sample: data-ready monitor, burst validation, statistics; and the counters of samples not used.

use crate::acquisition::{DataReadyMonitor, DrdyEdge, TimedBurst};
use crate::statistics::{CHANNELS, ChannelEstimator, ChannelSums, Statistics};
use crate::transmit::{RawStream, TransmitQueue};
use adis16405_driver::{Burst, BurstValidator, Config, Faults};
use heapless::spsc;
use link::{Health, MessageRef};

/// Consecutive bursts of only zeros or only ones from which on the sensor is suspect.
const STUCK_BURSTS: u32 = 16;

/// The estimators of all channels, which take the same samples and have the same gaps.
///
/// The [`Statistics`] are borrowed, so that a board can place them in memory that is zero at the start.
pub struct Estimators<'m> {
    config: Config,
    statistics: &'m mut Statistics,
    validator: BurstValidator,
    monitor: DataReadyMonitor,
    /// Counters of sampling and estimating; those of the validator are added when they are read.
    health: Health,
    /// Consecutive bursts of only zeros or only ones.
    stuck: u32,
    /// Number of the next sample since sampling began at this rate.
    next_sample: u64,
    raw_stream: RawStream,
}

impl<'m> Estimators<'m> {
    /// Estimators for a sensor with this configuration; they continue from `statistics`.
    pub fn new(statistics: &'m mut Statistics, config: Config) -> Self {
        Self {
            config,
            statistics,
            validator: BurstValidator::default(),
            monitor: DataReadyMonitor::new(config.sample_period()),
            health: Health::default(),
            stuck: 0,
            next_sample: 0,
            raw_stream: RawStream::off(),
        }
    }

    /// Processes the burst of one data-ready edge; `waiting` is the number of further bursts in the queue. Returns true if a
    /// message of the raw stream is full now.
    pub fn process(&mut self, timed: TimedBurst, waiting: usize) -> bool {
        let health = &mut self.health;
        health.queue_peak = health.queue_peak.max(u32::try_from(waiting).unwrap_or(u32::MAX).saturating_add(1));
        add(&mut health.queue_full, timed.dropped);
        let DrdyEdge::Periods(periods) = self.monitor.edge(timed.at_us) else {
            add(&mut health.spurious_edges, 1);
            return false;
        };
        let missing = periods.saturating_sub(1);
        add(&mut health.lost_edges, missing.saturating_sub(timed.dropped));
        self.gap(missing);
        self.next_sample += u64::from(missing) + 1;
        let full =
            timed.burst.as_ref().is_some_and(|burst| self.raw_stream.push(burst, self.next_sample - 1, timed.at_us));
        self.add_burst(timed.burst.as_ref());
        full
    }

    /// Whether the sensor must be probed before its samples are used again.
    #[must_use]
    pub fn is_suspect(&self) -> bool {
        self.monitor.is_suspect() || self.stuck >= STUCK_BURSTS
    }

    /// Whether no data-ready edge has come for so long before `now_us` that the sensor may be disconnected or reset.
    #[must_use]
    pub fn is_silent_at(&self, now_us: u64) -> bool {
        self.monitor.is_silent_at(now_us)
    }

    /// Clears the suspicion, so that samples are used again: the sensor was probed and configured at `now_us`.
    pub fn mark_probed(&mut self, now_us: u64) {
        self.monitor.mark_probed(now_us);
        self.stuck = 0;
    }

    /// Starts again without samples, for a sensor that has the configuration `config` from now on. The raw stream stays on
    /// or off.
    pub fn restart(&mut self, config: Config) {
        self.reset();
        self.config = config;
        self.monitor = DataReadyMonitor::new(config.sample_period());
        self.next_sample = 0;
        if self.raw_stream.is_on() {
            self.set_raw_stream(true);
        }
    }

    /// Passes the statistics of the epoch to `take` and starts the next epoch with the next sample; the counters go on.
    pub(crate) fn end_epoch(&mut self, take: impl FnOnce(&Statistics)) {
        take(self.statistics);
        self.statistics.reset();
    }

    /// Resets statistics and counters. The data-ready monitor and the sample numbers go on.
    pub fn reset(&mut self) {
        self.statistics.reset();
        self.validator = BurstValidator::default();
        self.health = Health::default();
    }

    /// Starts or stops the raw stream. Bursts that were not sent yet are dropped.
    pub fn set_raw_stream(&mut self, on: bool) {
        self.raw_stream.set(on, self.config.sens_avg());
    }

    /// The estimator of [`CHANNELS`]`[index]`.
    #[must_use]
    pub fn channel(&self, index: usize) -> Option<&ChannelEstimator> {
        self.statistics.estimators.get(index)
    }

    /// Has the estimator of [`CHANNELS`]`[index]` continue from sums of before a restart.
    pub fn restore(&mut self, index: usize, sums: &ChannelSums) {
        if let Some(estimator) = self.statistics.estimators.get_mut(index) {
            sums.restore(estimator);
        }
    }

    /// The configuration that the sensor is assumed to have.
    #[must_use]
    pub fn config(&self) -> Config {
        self.config
    }

    /// Sample rate in Hz, measured with the microcontroller's clock.
    #[must_use]
    pub fn measured_hz(&self) -> Option<f64> {
        self.monitor.measured_hz()
    }

    /// The counters of sampling and estimating; those of the application and the board are 0.
    #[must_use]
    pub fn health(&self) -> Health {
        let counters = self.validator.counters();
        Health {
            bursts: counters.bursts,
            used: counters.bursts - counters.unusable,
            no_new_data: counters.get(Faults::NO_NEW_DATA),
            error_alarm: counters.get(Faults::ERROR_ALARM),
            supply: counters.get(Faults::SUPPLY),
            stuck_low: counters.get(Faults::STUCK_LOW),
            stuck_high: counters.get(Faults::STUCK_HIGH),
            shifted: counters.get(Faults::SHIFTED),
            frozen: counters.get(Faults::FROZEN),
            impossible_rate: counters.get(Faults::IMPOSSIBLE_RATE),
            x_sign: counters.get(Faults::X_SIGN),
            repeated: counters.get(Faults::REPEATED),
            ..self.health
        }
    }

    /// Validates a burst and adds it to the statistics; a burst that is not used is a gap of one sample.
    fn add_burst(&mut self, burst: Option<&Burst>) {
        let Some(burst) = burst else {
            add(&mut self.health.bus_errors, 1);
            self.gap(1);
            return;
        };
        if self.is_suspect() {
            add(&mut self.health.suspect, 1);
            self.gap(1);
            return;
        }
        let validity = self.validator.validate(burst);
        let stuck = validity.faults.intersects(Faults::STUCK_LOW | Faults::STUCK_HIGH);
        self.stuck = if stuck { self.stuck + 1 } else { 0 };
        if !validity.usable {
            self.gap(1);
            return;
        }
        let counts = burst.counts();
        self.statistics.push(CHANNELS.map(|channel| i32::from(counts.get(channel))));
    }

    fn gap(&mut self, missing: u32) {
        for estimator in &mut self.statistics.estimators {
            estimator.gap(missing);
        }
    }
}

fn add(counter: &mut u32, more: u32) {
    *counter = counter.saturating_add(more);
}

/// Processes all queued bursts and sends full messages of the raw stream.
///
/// To be called at a priority below sampling and above the main loop.
pub fn estimate(
    estimators: &mut Estimators<'_>,
    transmit_queue: &mut TransmitQueue<'_>,
    bursts: &mut spsc::Consumer<'_, TimedBurst>,
) {
    while let Some(timed) = bursts.dequeue() {
        let full = estimators.process(timed, bursts.len());
        let full = estimators.raw_stream.message().filter(|_| full);
        if full.is_some_and(|message| !transmit_queue.send(MessageRef::Raw(message))) {
            add(&mut estimators.health.raw_dropped, 1);
        }
    }
}
