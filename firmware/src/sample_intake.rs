//! The path of samples: data-ready monitor, validation, statistics, counters.
//!
//! | word | meaning |
//! |---|---|
//! | unusable burst | the transfer failed, or a fault refuses all inertial channels |
//! | refused sample | arrived and not used, in one channel or in all: a fault, or a gross error |
//! | suspect sensor | may have been reset or disconnected; its samples are not used before a probe |
//! | spurious edge | of data ready, at no multiple of the sample period |

use crate::acquisition::{DataReadyMonitor, TimedBurst};
use crate::channels::ChannelSet;
use crate::counters::add;
use crate::gross_error_gate::{FIRST_BLOCK, GrossErrorGate};
use crate::scale::ReportScale;
use crate::statistics::{CHANNELS, ChannelEstimator, ChannelSums, SampleLosses, Statistics};
use crate::transmit::{RawStream, TransmitQueue};
use adis16405_driver::{Burst, BurstValidator, ChannelMask, Config, Faults, Validity};
use heapless::spsc;
use link::{Health, MessageRef};

/// Unusable bursts after which the sensor is in trouble; a usable burst cancels half of one.
const UNUSABLE_BURSTS: u32 = 16;

/// Number of filter lengths for which a frozen sensor's bursts are equal; chance gives fewer.
const FROZEN_FILTER_LENGTHS: u32 = 4;
const FROZEN_BURSTS: u32 = 16;

/// Used bursts after which the sensor counts as working; twice as many as a frozen one can give behind a long filter.
const SETTLED_BURSTS: u32 = 100;

/// Settling time of the analogue channel, µs: 12.7 times the 0.48 ms of two poles at 330 Hz (data sheet Rev. B, Table
/// 1).
const ANALOGUE_SETTLING_US: u64 = 6_200;

/// Samples after a probe that depend on earlier ones: 2N of the filter's 2N + 1 taps (Fig. 15; N = 2^M), and the
/// analogue part.
fn settling_samples(config: Config) -> u32 {
    let analogue = (ANALOGUE_SETTLING_US as f64 * 1e-6 * config.sample_period().hz()) as u32 + 1;
    (2 << config.filter_taps_log2()) + analogue
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(all(target_os = "none", feature = "microcontroller"), derive(defmt::Format))]
pub(crate) enum SensorTrouble {
    /// No edge has come for several periods.
    NoEdges,
    EdgeRate,
    Unusable(&'static str),
}

/// State that a probe of the sensor resets.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct SinceProbe {
    /// Score of +2 per unusable and −1 per usable burst.
    unusable: u32,
    unusable_cause: &'static str,
    /// Bursts until the filter has settled, and then until the gate has learned.
    settling: u32,
    learning: u32,
    pub(crate) used: u32,
    pub(crate) error_flag: bool,
}

/// The estimators of all channels. A lost sample is missing in all of them, a refused one in its channel.
pub struct Estimators<'m> {
    config: Config,
    statistics: &'m mut Statistics,
    finished_losses: SampleLosses,
    validator: BurstValidator,
    gate: GrossErrorGate,
    pub(crate) monitor: DataReadyMonitor,
    /// Counters without the validator's, which are added on reading.
    health: Health,
    pub(crate) since_probe: SinceProbe,
    repeated: u32,
    processed: u32,
    next_sample: u64,
    pub(crate) raw_stream: RawStream,
}

impl<'m> Estimators<'m> {
    /// Estimators that continue from `statistics`.
    pub fn new(statistics: &'m mut Statistics, config: Config) -> Self {
        Self {
            config,
            statistics,
            validator: BurstValidator::default(),
            gate: GrossErrorGate::new(),
            monitor: DataReadyMonitor::new(config.sample_period()),
            finished_losses: SampleLosses::NONE,
            health: Health::default(),
            since_probe: SinceProbe::default(),
            repeated: 0,
            processed: 0,
            next_sample: 0,
            raw_stream: RawStream::off(),
        }
    }

    /// Processes the burst of one edge, with `waiting` more in the queue. True if a raw message is full.
    pub fn process(&mut self, timed: TimedBurst, waiting: usize) -> bool {
        self.processed = self.processed.wrapping_add(1);
        let health = &mut self.health;
        health.queue_peak = health.queue_peak.max(u32::try_from(waiting).unwrap_or(u32::MAX).saturating_add(1));
        add(&mut health.queue_full, timed.dropped);
        let Some(periods) = self.monitor.edge(timed.at_us) else {
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

    /// True if the sensor must be probed before its samples are used again.
    #[must_use]
    pub fn is_suspect(&self) -> bool {
        self.monitor.is_suspect() || self.since_probe.unusable >= 2 * UNUSABLE_BURSTS
    }

    /// The reason for a probe at `now_us`, if any.
    pub(crate) fn trouble(&self, now_us: u64) -> Option<SensorTrouble> {
        if self.monitor.is_silent_at(now_us) {
            Some(SensorTrouble::NoEdges)
        } else if self.monitor.is_suspect() {
            Some(SensorTrouble::EdgeRate)
        } else {
            self.is_suspect().then_some(SensorTrouble::Unusable(self.since_probe.unusable_cause))
        }
    }

    pub(crate) fn is_settled(&self) -> bool {
        self.since_probe.used >= SETTLED_BURSTS.max(2 * self.frozen_after())
    }

    /// Number of bursts taken from the queue, modulo 2³².
    pub fn processed(&self) -> u32 {
        self.processed
    }

    /// Accepts samples after a probe at `now_us`, once the filter has settled.
    pub fn accept_samples_after_settling(&mut self, now_us: u64) {
        self.monitor.restart_at(now_us);
        let learning = if self.gate.is_learning() { FIRST_BLOCK } else { 0 };
        self.since_probe = SinceProbe { settling: settling_samples(self.config), learning, ..SinceProbe::default() };
    }

    /// Starts again with the configuration `config`; the raw stream stays as it is.
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

    /// Ends the epoch: the next sample begins another one. Counters go on.
    pub(crate) fn end_epoch(&mut self, take: impl FnOnce(&Statistics)) {
        take(self.statistics);
        self.finished_losses = self.statistics.losses;
        self.statistics.reset();
    }

    /// Resets statistics and counters, but not the data-ready monitor and the sample numbers.
    pub fn reset(&mut self) {
        self.statistics.reset();
        self.finished_losses = SampleLosses::NONE;
        self.validator = BurstValidator::default();
        self.health = Health::default();
    }

    /// Starts or stops the raw stream; unsent bursts are dropped.
    pub fn set_raw_stream(&mut self, on: bool) {
        self.raw_stream.set(on, self.config.sens_avg());
    }

    /// The estimator of [`CHANNELS`]`[index]`.
    pub fn channel(&self, index: usize) -> Option<&ChannelEstimator> {
        self.statistics.estimators.get(index)
    }

    /// Continues a channel from its sums before a restart, which the sums over pairs do not include.
    pub fn restore(&mut self, index: usize, sums: &ChannelSums) {
        if let Some(estimator) = self.statistics.estimators.get_mut(index) {
            sums.restore(estimator);
            self.statistics.cross_sums.incomplete = true;
        }
    }

    pub(crate) fn losses(&self, finished: bool) -> SampleLosses {
        if finished { self.finished_losses } else { self.statistics.losses }
    }

    /// The configuration that the sensor is assumed to have.
    pub fn config(&self) -> Config {
        self.config
    }

    /// Sample rate in Hz, measured with the microcontroller's clock; `None` before 64 sample periods.
    pub fn measured_hz(&self) -> Option<f64> {
        self.monitor.measured_hz()
    }

    /// The scale of counts and samples.
    pub fn scale(&self) -> ReportScale {
        ReportScale::new(self.config, self.measured_hz())
    }

    /// The counters of sampling and estimating; those of the application and the board are 0.
    pub fn health(&self) -> Health {
        let (counters, mut health) = (self.validator.counters(), self.health);
        health.bursts = counters.bursts;
        for (fault, name) in Faults::CAUSES {
            if let Some(counter) = health.counter_mut(name) {
                add(counter, counters.get(fault));
            }
        }
        health
    }

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
        if self.since_probe.settling + self.since_probe.learning > 0 && is_frame_sound(burst) {
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
        self.since_probe.unusable = self.since_probe.unusable.saturating_sub(1);
        self.since_probe.used = self.since_probe.used.saturating_add(1);
        self.since_probe.error_flag = faults.contains(Faults::ERROR_ALARM);
        let health = &mut self.health;
        add(&mut health.used, 1);
        add(&mut health.gross_errors, u32::from(!gross.is_empty()));
        add(&mut health.partly_used, u32::from(!refused.union(gross).is_empty()));
        add(&mut health.marked, u32::from(faults.intersects(Faults::SUPPLY | Faults::ERROR_ALARM)));
    }

    /// Handles a burst that is not used. It is rare, and so not inlined.
    #[inline(never)]
    fn settle(&mut self, burst: &Burst) {
        let counts = estimated_counts(burst);
        if self.since_probe.settling > 0 {
            self.since_probe.settling -= 1;
            self.gate.follow(&counts);
        } else {
            self.since_probe.learning -= 1;
            self.gate.find(&counts, ChannelSet::EMPTY);
        }
        add(&mut self.health.settling, 1);
        // There is no gap before the first sample.
        if self.statistics.has_samples() {
            self.statistics.push([0; CHANNELS.len()], ChannelSet::ALL);
        }
    }

    /// The number of equal bursts of a frozen sensor: the filter averages 2^M samples twice.
    fn frozen_after(&self) -> u32 {
        (FROZEN_FILTER_LENGTHS << (self.config.filter_taps_log2() + 1)).max(FROZEN_BURSTS)
    }

    fn mark_unusable(&mut self, cause: &'static str) {
        self.since_probe.unusable = self.since_probe.unusable.saturating_add(2);
        self.since_probe.unusable_cause = cause;
    }
}

/// True unless a fault concerns the whole burst.
fn is_frame_sound(burst: &Burst) -> bool {
    (Faults::WARNINGS | Faults::OF_CHANNELS).contains(burst.faults())
}

fn refused_channels(validity: Validity) -> ChannelSet {
    let mut refused = ChannelSet::EMPTY;
    if !validity.is_usable() {
        for (index, channel) in CHANNELS.into_iter().enumerate() {
            refused.insert_if(index, validity.refused.contains(channel));
        }
    }
    refused
}

fn estimated_counts(burst: &Burst) -> [i32; CHANNELS.len()] {
    let counts = burst.counts();
    CHANNELS.map(|channel| i32::from(counts.get(channel)))
}

/// Processes queued bursts and sends full raw messages, at a priority between sampling and the main loop.
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
