//! The path of every sample: data-ready monitor, burst validation, statistics; and the counters of samples not used.

use crate::acquisition::{DataReadyMonitor, DrdyEdge, TimedBurst};
use crate::channel_validity::{is_frame_sound, is_marked, refused_channels};
use crate::channels::ChannelSet;
use crate::gross_error_gate::{FIRST_BLOCK, GrossErrorGate};
use crate::scale::ReportScale;
use crate::statistics::{CHANNELS, ChannelEstimator, ChannelSums, SampleLosses, Statistics};
use crate::transmit::{RawStream, TransmitQueue};
use adis16405_driver::{Burst, BurstValidator, ChannelMask, Config, Faults};
use heapless::spsc;
use link::{Health, MessageRef};

/// Unusable bursts in a row from which on the sensor is in trouble. Every usable burst makes up for half an unusable one.
const UNUSABLE_BURSTS: u32 = 16;

/// Bursts in a row with equal inertial words, in lengths of the sensor's filter, from which on it is frozen. Neighbours behind
/// the filter are often equal by chance, but not for so long.
const FROZEN_FILTER_LENGTHS: u32 = 4;
/// The same in bursts, where that is more.
const FROZEN_BURSTS: u32 = 16;

/// Bursts used since the sensor was probed from which on it is known to work; behind a long filter twice as many as a frozen
/// sensor delivers before it is found out.
const SETTLED_BURSTS: u32 = 100;

/// Time for which the analogue part of a sensor's channel remembers what it saw, in µs. Its two poles at 330 Hz (data sheet
/// Rev. B, Table 1, taken as two, the slower reading) have a time constant of 0.48 ms; a step by the whole range of ±6,000 counts
/// has decayed to half a count after x = 12.7 of them, (1 + x)·exp(−x) = 0.5 / 12,000.
const ANALOGUE_SETTLING_US: u64 = 6_200;

/// Samples after a probe that hold something of what was before: of a self-test, which displaces the outputs (data sheet
/// Rev. B, page 15), of the time before a reset, or of another range or filter. The filter of 2N + 1 taps mixes 2N samples of
/// before with its newest one (Fig. 15; N = 2^M), and the channel before it settles meanwhile.
fn settling_samples(config: Config) -> u32 {
    let analogue = (ANALOGUE_SETTLING_US as f64 * 1e-6 * config.sample_period().hz()) as u32 + 1;
    (2 << config.filter_taps_log2()) + analogue
}

/// Why the sensor must be probed before its samples are used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(all(target_os = "none", feature = "microcontroller"), derive(defmt::Format))]
pub(crate) enum SensorTrouble {
    /// No data-ready edge has come for several periods.
    NoEdges,
    /// There was such a silence, or the edges come at another rate.
    EdgeRate,
    /// Burst after burst was unusable, the latest one for this cause.
    Unusable(&'static str),
}

/// The estimators of all channels. A sample that never arrived is missing in all of them, one that was refused in a channel
/// in that channel alone.
///
/// The [`Statistics`] are borrowed, so that a board can place them in memory that is zero at the start.
pub struct Estimators<'m> {
    config: Config,
    statistics: &'m mut Statistics,
    /// Losses of the epoch that was finished last.
    finished_losses: SampleLosses,
    validator: BurstValidator,
    gate: GrossErrorGate,
    monitor: DataReadyMonitor,
    /// Counters of sampling and estimating; those of the validator are added when they are read.
    health: Health,
    /// Rises by 2 with every unusable burst, falls by 1 with every usable one.
    unusable: u32,
    /// Cause of the latest unusable burst.
    unusable_cause: &'static str,
    /// Bursts in a row whose inertial words equal those of the burst before.
    repeated: u32,
    /// Bursts still to come that the sensor's filter mixes with what was before the probe.
    settling: u32,
    /// Bursts still to come from which the gate learns the noise before any is used.
    learning: u32,
    /// Bursts used since the sensor was probed.
    used_since_probe: u32,
    /// The latest burst that a sensor can have sent had its error flag set.
    error_flag: bool,
    /// Bursts taken from the queue; wraps.
    processed: u32,
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
            gate: GrossErrorGate::new(),
            monitor: DataReadyMonitor::new(config.sample_period()),
            finished_losses: SampleLosses::NONE,
            health: Health::default(),
            unusable: 0,
            unusable_cause: "",
            repeated: 0,
            settling: 0,
            learning: 0,
            used_since_probe: 0,
            error_flag: false,
            processed: 0,
            next_sample: 0,
            raw_stream: RawStream::off(),
        }
    }

    /// Processes the burst of one data-ready edge; `waiting` is the number of further bursts in the queue. Returns true if a
    /// message of the raw stream is full now.
    pub fn process(&mut self, timed: TimedBurst, waiting: usize) -> bool {
        self.processed = self.processed.wrapping_add(1);
        let health = &mut self.health;
        health.queue_peak = health.queue_peak.max(u32::try_from(waiting).unwrap_or(u32::MAX).saturating_add(1));
        add(&mut health.queue_full, timed.dropped);
        let DrdyEdge::Periods(periods) = self.monitor.edge(timed.at_us) else {
            add(&mut health.spurious_edges, 1);
            return false;
        };
        let missing = periods.saturating_sub(1);
        add(&mut health.lost_edges, missing.saturating_sub(timed.dropped));
        self.statistics.lose(missing);
        self.next_sample += u64::from(missing) + 1;
        let full =
            timed.burst.as_ref().is_some_and(|burst| self.raw_stream.push(burst, self.next_sample - 1, timed.at_us));
        self.add_burst(timed.burst.as_ref());
        full
    }

    /// Whether the sensor must be probed before its samples are used again.
    #[must_use]
    pub fn is_suspect(&self) -> bool {
        self.monitor.is_suspect() || self.unusable >= 2 * UNUSABLE_BURSTS
    }

    /// Whether what samples are divided by is as no damage to the memory leaves it.
    pub(crate) fn is_intact(&self) -> bool {
        self.monitor.has_period()
    }

    /// Why the sensor must be probed at `now_us`; `None` if it need not be.
    pub(crate) fn trouble(&self, now_us: u64) -> Option<SensorTrouble> {
        if self.monitor.is_silent_at(now_us) {
            Some(SensorTrouble::NoEdges)
        } else if self.monitor.is_suspect() {
            Some(SensorTrouble::EdgeRate)
        } else {
            self.is_suspect().then_some(SensorTrouble::Unusable(self.unusable_cause))
        }
    }

    /// Time of the latest data-ready edge, µs; `None` before the first.
    pub(crate) fn last_edge_us(&self) -> Option<u64> {
        self.monitor.last_edge_us()
    }

    /// Whether the sensor has its error flag set.
    pub(crate) fn has_error_flag(&self) -> bool {
        self.error_flag
    }

    /// DIAG_STAT was read, which clears the error flag until its cause comes back.
    pub(crate) fn clear_error_flag(&mut self) {
        self.error_flag = false;
    }

    /// Bursts used since the sensor was probed.
    pub(crate) fn used_since_probe(&self) -> u32 {
        self.used_since_probe
    }

    /// Whether so many bursts were used since the sensor was probed that it is known to work.
    pub(crate) fn is_settled(&self) -> bool {
        self.used_since_probe >= SETTLED_BURSTS.max(2 * self.frozen_after())
    }

    /// Number of bursts taken from the queue, modulo 2³².
    #[must_use]
    pub fn processed(&self) -> u32 {
        self.processed
    }

    /// Clears the suspicion, so that samples are used again as soon as the sensor's filter has settled: the sensor was probed
    /// and configured at `now_us`.
    pub fn accept_samples_after_settling(&mut self, now_us: u64) {
        self.monitor.restart_at(now_us);
        self.unusable = 0;
        self.settling = settling_samples(self.config);
        self.learning = if self.gate.is_learning() { FIRST_BLOCK } else { 0 };
        self.used_since_probe = 0;
        self.error_flag = false;
    }

    /// Sampling goes on at `now_us` after a pause of the device's own: what the sensor gave meanwhile is lost, and it is not
    /// suspect.
    pub(crate) fn restart_rate_check(&mut self, now_us: u64) {
        self.monitor.restart_at(now_us);
    }

    /// Starts again without samples, for a sensor that has the configuration `config` from now on. The raw stream stays on
    /// or off.
    pub fn restart(&mut self, config: Config) {
        self.reset();
        self.config = config;
        self.gate = GrossErrorGate::new();
        self.monitor = DataReadyMonitor::new(config.sample_period());
        self.next_sample = 0;
        if self.raw_stream.is_on() {
            self.set_raw_stream(true);
        }
    }

    /// Passes the statistics of the epoch to `take` and starts the next epoch with the next sample; the counters go on.
    pub(crate) fn end_epoch(&mut self, take: impl FnOnce(&Statistics)) {
        take(self.statistics);
        self.finished_losses = self.statistics.losses;
        self.statistics.reset();
    }

    /// Resets statistics and counters. The data-ready monitor and the sample numbers go on.
    pub fn reset(&mut self) {
        self.statistics.reset();
        self.finished_losses = SampleLosses::NONE;
        self.validator = BurstValidator::default();
        self.health = Health::default();
    }

    /// Starts or stops the raw stream. Bursts that were not sent yet are dropped.
    pub fn set_raw_stream(&mut self, on: bool) {
        self.raw_stream.set(on, self.config.sens_avg());
    }

    /// Whether the raw stream is on.
    pub(crate) fn has_raw_stream(&self) -> bool {
        self.raw_stream.is_on()
    }

    /// The estimator of [`CHANNELS`]`[index]`.
    #[must_use]
    pub fn channel(&self, index: usize) -> Option<&ChannelEstimator> {
        self.statistics.estimators.get(index)
    }

    /// Has the estimator of [`CHANNELS`]`[index]` continue from sums of before a restart.
    pub fn restore(&mut self, index: usize, sums: &ChannelSums) {
        self.statistics.restore(index, sums);
    }

    /// Samples lost and refused in the running epoch, or in the finished one.
    pub(crate) fn losses(&self, finished: bool) -> SampleLosses {
        if finished { self.finished_losses } else { self.statistics.losses }
    }

    /// The configuration that the sensor is assumed to have.
    #[must_use]
    pub fn config(&self) -> Config {
        self.config
    }

    /// Sample rate in Hz, measured with the microcontroller's clock; `None` before 64 sample periods.
    #[must_use]
    pub fn measured_hz(&self) -> Option<f64> {
        self.monitor.measured_hz()
    }

    /// What turns counts and numbers of samples into units.
    #[must_use]
    pub fn scale(&self) -> ReportScale {
        ReportScale::new(self.config, self.measured_hz())
    }

    /// The counters of sampling and estimating; those of the application and the board are 0.
    #[must_use]
    pub fn health(&self) -> Health {
        let counters = self.validator.counters();
        Health {
            bursts: counters.bursts,
            no_new_data: counters.get(Faults::NO_NEW_DATA),
            error_alarm: counters.get(Faults::ERROR_ALARM),
            supply: counters.get(Faults::SUPPLY),
            stuck_low: counters.get(Faults::STUCK_LOW),
            stuck_high: counters.get(Faults::STUCK_HIGH),
            shifted: counters.get(Faults::SHIFTED),
            frozen: counters.get(Faults::FROZEN).saturating_add(self.health.frozen),
            impossible_rate: counters.get(Faults::IMPOSSIBLE_RATE),
            x_sign: counters.get(Faults::X_SIGN),
            repeated: counters.get(Faults::REPEATED),
            implausible_supply: counters.get(Faults::IMPLAUSIBLE_SUPPLY),
            mixed_alarm: counters.get(Faults::MIXED_ALARM),
            ..self.health
        }
    }

    /// Validates a burst and adds its channels to the statistics, except those that are refused.
    fn add_burst(&mut self, burst: Option<&Burst>) {
        let Some(burst) = burst else {
            add(&mut self.health.bus_errors, 1);
            self.statistics.lose(1);
            return self.mark_unusable("bus error");
        };
        if self.is_suspect() {
            add(&mut self.health.suspect, 1);
            self.statistics.push([0; CHANNELS.len()], ChannelSet::ALL);
            return;
        }
        if self.settling + self.learning > 0 && is_frame_sound(burst) {
            return self.settle(burst);
        }
        let mut validity = self.validator.validate(burst);
        let faults = &mut validity.faults;
        self.repeated = if faults.contains(Faults::REPEATED) { self.repeated.saturating_add(1) } else { 0 };
        if self.repeated >= self.frozen_after() && !faults.contains(Faults::FROZEN) {
            *faults |= Faults::FROZEN;
            validity.refused = ChannelMask::ALL;
            add(&mut self.health.frozen, 1);
        }
        let (faults, refused) = (validity.faults, refused_channels(validity));
        let counts = estimated_counts(burst);
        let gross = self.gate.find(&counts, refused);
        self.statistics.push(counts, refused.union(gross));
        if refused.has_all_inertial() {
            return self.mark_unusable(faults.cause().unwrap_or_default());
        }
        self.unusable = self.unusable.saturating_sub(1);
        self.used_since_probe = self.used_since_probe.saturating_add(1);
        self.error_flag = faults.contains(Faults::ERROR_ALARM);
        let health = &mut self.health;
        add(&mut health.used, 1);
        add(&mut health.gross_errors, u32::from(!gross.is_empty()));
        add(&mut health.partly_used, u32::from(!refused.union(gross).is_empty()));
        add(&mut health.marked, u32::from(is_marked(faults)));
    }

    /// Takes a burst that is not used: the sensor's filter settles, or the gate learns the noise. Not inlined: they are few.
    #[inline(never)]
    fn settle(&mut self, burst: &Burst) {
        let counts = estimated_counts(burst);
        if self.settling > 0 {
            self.settling -= 1;
            self.gate.follow(&counts);
        } else {
            self.learning -= 1;
            self.gate.find(&counts, ChannelSet::EMPTY);
        }
        add(&mut self.health.settling, 1);
        // Before the first sample there is no gap.
        if self.statistics.has_samples() {
            self.statistics.push([0; CHANNELS.len()], ChannelSet::ALL);
        }
    }

    /// Repetitions from which on the sensor is frozen. The filter is two averages of 2^M samples.
    fn frozen_after(&self) -> u32 {
        (FROZEN_FILTER_LENGTHS << (self.config.filter_taps_log2() + 1)).max(FROZEN_BURSTS)
    }

    fn mark_unusable(&mut self, cause: &'static str) {
        self.unusable = self.unusable.saturating_add(2);
        self.unusable_cause = cause;
    }
}

fn estimated_counts(burst: &Burst) -> [i32; CHANNELS.len()] {
    let counts = burst.counts();
    CHANNELS.map(|channel| i32::from(counts.get(channel)))
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
