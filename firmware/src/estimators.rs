//! What every sample passes through: its place in time, the verdict, the estimators.

use crate::acquisition::Arrival;
use crate::cadence::{Cadence, Step};
use crate::couplings::Couplings;
use crate::epoch::Epoch;
use crate::outbox::Outbox;
use crate::retained::Retained;
use crate::summary::{OCTAVES, OVERLAP};
use crate::sums::Sums;
use adis16405_driver::{Burst, BurstValidator, Channel, Config, Faults};
use allan_core::Cascade;
use heapless::spsc;
use link::{Health, MessageRef, Raw, RawBurst};

/// What is estimated: the inertial channels, then the covariates temperature and supply.
pub const CHANNELS: [Channel; 8] = {
    let [a, b, c, d, e, f] = Channel::INERTIAL;
    [a, b, c, d, e, f, Channel::Temp, Channel::Supply]
};

/// One channel's estimator.
pub type Estimator = Cascade<OCTAVES, OVERLAP>;

/// Bursts of nothing but zeros or ones in a row from which on the sensor is to be checked.
const STUCK_BURSTS: u32 = 16;

/// The memory of the estimators.
#[derive(Debug)]
pub struct Statistics {
    cascades: [Estimator; CHANNELS.len()],
    couplings: Couplings,
}

impl Statistics {
    /// Of no sample.
    #[must_use]
    pub const fn new() -> Self {
        Self { cascades: [const { Estimator::new() }; CHANNELS.len()], couplings: Couplings::new() }
    }
}

impl Default for Statistics {
    fn default() -> Self {
        Self::new()
    }
}

/// The estimators of all channels, in lockstep, and the account of what they were not given.
///
/// Their [`Statistics`] are lent, so that a board can keep them where memory starts at zero.
pub struct Estimators<'m> {
    config: Config,
    statistics: &'m mut Statistics,
    validator: BurstValidator,
    cadence: Cadence,
    health: Health,
    stuck: u32,
    /// Number of the next sample since sampling began at this rate.
    next: u64,
    raw: Option<Raw>,
    last_raw: (u64, u64),
}

impl<'m> Estimators<'m> {
    /// Estimators for a sensor so configured; they go on from what `statistics` has.
    pub fn new(statistics: &'m mut Statistics, config: Config) -> Self {
        Self {
            config,
            statistics,
            validator: BurstValidator::default(),
            cadence: Cadence::new(config.sample_period()),
            health: Health::default(),
            stuck: 0,
            next: 0,
            raw: None,
            last_raw: (0, 0),
        }
    }

    /// Takes what the next data-ready edge brought; `waiting` is how many more the queue holds. True if a message of the
    /// [`raw`](Self::raw) stream is full now.
    pub fn take(&mut self, arrival: Arrival, waiting: usize) -> bool {
        let health = &mut self.health;
        health.queue_peak = health.queue_peak.max(u32::try_from(waiting).unwrap_or(u32::MAX).saturating_add(1));
        add(&mut health.queue_full, arrival.dropped);
        let Step::Periods(periods) = self.cadence.edge(arrival.at_us) else {
            add(&mut health.stray_edges, 1);
            return false;
        };
        let missing = periods.saturating_sub(1);
        add(&mut health.lost_edges, missing.saturating_sub(arrival.dropped));
        self.gap(missing);
        self.next += u64::from(missing) + 1;
        let full = arrival.burst.as_ref().is_some_and(|burst| self.stream(burst, arrival.at_us));
        self.judge(arrival.burst.as_ref());
        full
    }

    /// Whether the sensor must be checked before its samples are used again.
    #[must_use]
    pub fn is_doubtful(&self) -> bool {
        self.cadence.is_doubtful() || self.stuck >= STUCK_BURSTS
    }

    /// Whether the sensor has been silent for so long that it may be gone.
    #[must_use]
    pub fn is_silent_at(&self, now_us: u64) -> bool {
        self.cadence.is_silent_at(now_us)
    }

    /// The sensor was checked and put in order at `now_us`: its samples are used from now on.
    pub fn trust(&mut self, now_us: u64) {
        self.cadence.trust(now_us);
        self.stuck = 0;
    }

    /// Begins again with nothing, for a sensor that is configured as `config` now. The raw stream stays on or off.
    pub fn begin(&mut self, config: Config) {
        self.forget();
        self.config = config;
        self.cadence = Cadence::new(config.sample_period());
        self.next = 0;
        if self.raw.is_some() {
            self.set_raw(true);
        }
    }

    /// Hands over the statistics and begins again without losing a sample; the counters go on.
    pub fn finish_epoch(&mut self, retained: &mut Retained, finished: &mut Epoch) {
        finished.take(retained, &self.statistics.cascades, &self.statistics.couplings);
        self.begin_epoch();
    }

    fn begin_epoch(&mut self) {
        self.statistics.cascades.iter_mut().for_each(Cascade::reset);
        self.statistics.couplings.reset();
    }

    /// Forgets the statistics and the counters, and keeps step with the sensor.
    pub fn forget(&mut self) {
        self.begin_epoch();
        self.validator = BurstValidator::default();
        self.health = Health::default();
    }

    /// Starts or stops the raw stream. What was gathered and not yet sent is dropped.
    pub fn set_raw(&mut self, on: bool) {
        // In place: it is not small.
        self.raw = None;
        if on {
            let sens_avg = self.config.sens_avg();
            self.raw = Some(Raw { first: 0, at_us: 0, sens_avg, bursts: heapless::Vec::new() });
        }
    }

    /// The message of the raw stream that is being filled, if it is on. A full one makes room for the next burst.
    #[must_use]
    pub fn raw(&self) -> Option<&Raw> {
        self.raw.as_ref()
    }

    /// The raw stream found no room on the line.
    pub fn raw_was_dropped(&mut self) {
        add(&mut self.health.raw_dropped, 1);
    }

    /// The estimator of [`CHANNELS`]`[index]`.
    #[must_use]
    pub fn get(&self, index: usize) -> Option<&Estimator> {
        self.statistics.cascades.get(index)
    }

    /// Has the estimator of [`CHANNELS`]`[index]` go on from what was learnt before a restart.
    pub fn resume(&mut self, index: usize, sums: &Sums) {
        if let Some(cascade) = self.statistics.cascades.get_mut(index) {
            sums.resume(cascade);
        }
    }

    /// What the sensor is taken to be configured as.
    #[must_use]
    pub fn config(&self) -> Config {
        self.config
    }

    /// Sample rate measured against the microcontroller's clock, in Hz.
    #[must_use]
    pub fn measured_hz(&self) -> Option<f64> {
        self.cadence.measured_hz()
    }

    /// What was lost so far; the counters of the application and the board are 0.
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

    fn judge(&mut self, burst: Option<&Burst>) {
        let Some(burst) = burst else {
            add(&mut self.health.bus_errors, 1);
            self.gap(1);
            return;
        };
        if self.is_doubtful() {
            add(&mut self.health.unchecked, 1);
            self.gap(1);
            return;
        }
        let verdict = self.validator.validate(burst);
        let stuck = verdict.faults.intersects(Faults::STUCK_LOW | Faults::STUCK_HIGH);
        self.stuck = if stuck { self.stuck + 1 } else { 0 };
        if !verdict.usable {
            self.gap(1);
            return;
        }
        let counts = burst.counts();
        let counts = CHANNELS.map(|channel| i32::from(counts.get(channel)));
        let Statistics { cascades, couplings } = &mut *self.statistics;
        for (cascade, count) in cascades.iter_mut().zip(counts) {
            cascade.push(count);
        }
        couplings.observe(cascades, counts);
    }

    fn gap(&mut self, missing: u32) {
        for cascade in &mut self.statistics.cascades {
            cascade.gap(missing);
        }
    }

    /// Adds a burst to the raw stream, usable or not. True if that fills a message.
    fn stream(&mut self, burst: &Burst, at_us: u64) -> bool {
        let Some(raw) = self.raw.as_mut() else { return false };
        if raw.bursts.is_full() {
            raw.bursts.clear();
        }
        let number = self.next - 1;
        let (last_number, last_us) = self.last_raw;
        self.last_raw = (number, at_us);
        let (periods, after_us) = if raw.bursts.is_empty() {
            (raw.first, raw.at_us) = (number, at_us);
            (0, 0)
        } else {
            (number - last_number, at_us - last_us)
        };
        let saturated = |value: u64| u32::try_from(value).unwrap_or(u32::MAX);
        let words = burst.words.map(|word| word.0.to_be_bytes());
        let burst = RawBurst { after_us: saturated(after_us), periods: saturated(periods), words };
        let _never_full = raw.bursts.push(burst);
        raw.bursts.is_full()
    }
}

fn add(counter: &mut u32, more: u32) {
    *counter = counter.saturating_add(more);
}

/// Gives what has arrived to the estimators, and full messages of the raw stream to the line.
///
/// To be called below the sampling and above the main loop.
pub fn estimate(estimators: &mut Estimators<'_>, outbox: &mut Outbox<'_>, arrivals: &mut spsc::Consumer<'_, Arrival>) {
    while let Some(arrival) = arrivals.dequeue() {
        let full = estimators.take(arrival, arrivals.len());
        let full = estimators.raw().filter(|_| full);
        if full.is_some_and(|raw| !outbox.send(MessageRef::Raw(raw))) {
            estimators.raw_was_dropped();
        }
    }
}
