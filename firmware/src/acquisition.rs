//! Acquisition: [`Sampler`] queues [`TimedBurst`]s in the two sampling interrupts (data-ready edge, end of the
//! transfer); behind the queue [`DataReadyMonitor`] finds sample rate, lost and spurious edges, and a suspect sensor.

use adis16405_driver::{BURST_BYTES, Burst, SamplePeriod};
use heapless::spsc;

/// Slots of the burst queue, one of which stays empty: room for 38 ms at 819.2 samples a second.
pub const QUEUE_SLOTS: usize = 32;

/// One tick of the sensor's sample clock, 1/1638.4 s, in 1/256 µs; this is exact.
const TICK_Q8: u64 = 156_250;
/// Time without an edge after which the sensor may have been reset; its shortest start-up takes longer.
const SILENCE_US: u64 = 25_000;
/// [`SILENCE_US`] in sample periods; the longer of the two applies.
const SILENT_PERIODS: u64 = 4;
/// Periods from which on the measured mean period replaces the programmed one.
const SETTLED_PERIODS: u64 = 64;
/// Suspicion from which on the sensor is to be probed.
const SUSPECT: u32 = 8;

/// The queue from the sampling interrupts to the estimators.
pub type BurstQueue = spsc::Queue<TimedBurst, QUEUE_SLOTS>;

/// The burst that was read at one data-ready edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TimedBurst {
    /// Time of the edge in microseconds since the start.
    pub at_us: u64,
    /// Number of bursts before this one that were dropped because the queue was full.
    pub dropped: u32,
    /// The burst, or `None` if the bus transfer failed.
    pub burst: Option<Burst>,
}

/// Number of edges within [`OSCILLATION_US`] that mask the data-ready line; a sensor gives at most 1.2 edges per ms.
const OSCILLATION_EDGES: u32 = 16;
/// Time in which edges are counted, µs.
const OSCILLATION_US: u64 = 1_000;

/// The action that a data-ready edge requires.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EdgeAction {
    /// Nothing: sampling is disabled, or a burst is being transferred.
    Ignore,
    /// Start the transfer of a burst.
    StartBurst,
    /// Ignore further edges until sampling is enabled again: the line oscillates.
    Mask,
}

/// Transfers of bursts, counted modulo 2³².
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct SamplingActivity {
    /// Transfers started.
    pub started: u32,
    /// Transfers ended, whether the burst was queued or dropped.
    pub ended: u32,
    /// Times that the data-ready line was masked because it oscillated.
    pub masked: u32,
    /// True if the line is masked now.
    pub is_masked: bool,
}

/// Decides at each data-ready edge whether a burst is read, and queues the bursts; never blocks.
pub struct Sampler<'q> {
    queue: spsc::Producer<'q, TimedBurst>,
    enabled: bool,
    reading: Option<u64>,
    dropped: u32,
    activity: SamplingActivity,
    /// Number of edges since a time, and that time in µs.
    edges: (u32, u64),
}

impl<'q> Sampler<'q> {
    /// A sampler that ignores edges until it is [enabled](Self::set_enabled).
    pub fn new(queue: spsc::Producer<'q, TimedBurst>) -> Self {
        Self { queue, enabled: false, reading: None, dropped: 0, activity: SamplingActivity::default(), edges: (0, 0) }
    }

    /// Enables or disables sampling; a transfer in progress is completed and queued.
    pub fn set_enabled(&mut self, enabled: bool) {
        self.enabled = enabled;
        if enabled {
            self.activity.is_masked = false;
        }
    }

    /// True if a burst is being transferred.
    pub fn is_reading(&self) -> bool {
        self.reading.is_some()
    }

    /// Transfers so far.
    pub fn activity(&self) -> SamplingActivity {
        self.activity
    }

    /// Takes a data-ready edge and returns the required action. It must be called at every edge; a sample during a
    /// transfer is lost.
    #[must_use]
    pub fn data_ready(&mut self, at_us: u64) -> EdgeAction {
        let (edges, since_us) = &mut self.edges;
        if at_us.saturating_sub(*since_us) > OSCILLATION_US {
            (*edges, *since_us) = (0, at_us);
        }
        *edges += 1;
        if *edges >= OSCILLATION_EDGES {
            *edges = 0;
            self.activity.masked = self.activity.masked.wrapping_add(1);
            self.activity.is_masked = true;
            return EdgeAction::Mask;
        }
        if !self.enabled || self.reading.is_some() {
            return EdgeAction::Ignore;
        }
        self.reading = Some(at_us);
        self.activity.started = self.activity.started.wrapping_add(1);
        EdgeAction::StartBurst
    }

    /// Takes the end of a transfer with the bytes received, or `None` if it failed.
    pub fn transfer_ended(&mut self, received: Option<&[u8; BURST_BYTES]>) {
        let Some(at_us) = self.reading.take() else { return };
        self.activity.ended = self.activity.ended.wrapping_add(1);
        let timed = TimedBurst { at_us, dropped: self.dropped, burst: received.map(Burst::from_bytes) };
        match self.queue.enqueue(timed) {
            Ok(()) => self.dropped = 0,
            Err(_full) => self.dropped = self.dropped.saturating_add(1),
        }
    }
}

/// Monitors the data-ready edges of a sensor with one programmed sample period.
#[derive(Debug, Clone, Copy, Default)]
pub struct DataReadyMonitor {
    /// Programmed period in 1/256 µs; above 0.
    period_q8: u64,
    last_us: Option<u64>,
    probed_us: u64,
    /// Periods between edges so far, and their total time.
    periods: u64,
    elapsed_us: u64,
    /// Rises with every irregular edge, falls with every regular one.
    suspicion: u32,
    silent: bool,
    /// The next edge may come at any phase: configuring restarts the sample clock.
    new_phase: bool,
}

impl DataReadyMonitor {
    /// A monitor for edges at multiples of `period`, each within a quarter of it.
    pub fn new(period: SamplePeriod) -> Self {
        Self { period_q8: u64::from(period.ticks()) * TICK_Q8, ..Self::default() }
    }

    /// Takes the time of an edge in microseconds; times must not decrease. Returns the sample periods since the edge
    /// before, 1 if no edge was lost, and for the first edge; `None` if the edge is at no multiple of the period.
    pub fn edge(&mut self, at_us: u64) -> Option<u32> {
        self.silent |= self.is_silent_at(at_us);
        let Some(last_us) = self.last_us else {
            self.last_us = Some(at_us);
            return Some(1);
        };
        let interval_us = at_us.saturating_sub(last_us);
        let (interval, period) = (interval_us << 8, self.mean_period_q8());
        // A period of 0 means damaged memory: the main loop restarts the device.
        let periods = (interval + period / 2).checked_div(period)?;
        let deviation = interval.abs_diff(periods * period);
        if core::mem::take(&mut self.new_phase) {
            self.last_us = Some(at_us);
            return Some(u32::try_from(periods.max(1)).unwrap_or(u32::MAX));
        }
        if periods == 0 || deviation > period / 4 {
            self.suspicion = (self.suspicion + 3).min(2 * SUSPECT);
            return None;
        }
        self.last_us = Some(at_us);
        if periods <= SILENT_PERIODS {
            self.periods += periods;
            self.elapsed_us += interval_us;
        }
        self.suspicion =
            if periods == 1 { self.suspicion.saturating_sub(1) } else { (self.suspicion + 2).min(2 * SUSPECT) };
        Some(u32::try_from(periods).unwrap_or(u32::MAX))
    }

    /// True if the sensor must be probed before its samples are used: after a silence, or at another edge rate.
    #[must_use]
    pub const fn is_suspect(&self) -> bool {
        self.silent || self.suspicion >= SUSPECT
    }

    /// Time of the latest edge at a multiple of the period, µs; `None` before the first.
    pub fn last_edge_us(&self) -> Option<u64> {
        self.last_us
    }

    /// True if no edge has come for so long that the sensor may be disconnected or reset.
    pub fn is_silent_at(&self, now_us: u64) -> bool {
        let last_sign_us = self.last_us.unwrap_or(0).max(self.probed_us);
        now_us.saturating_sub(last_sign_us) > self.silence_us()
    }

    /// True unless memory is damaged.
    pub(crate) const fn has_period(&self) -> bool {
        self.period_q8 > 0
    }

    /// Clears the suspicion at `now_us`, after a probe or a pause of sampling by the device.
    pub fn restart_at(&mut self, now_us: u64) {
        self.probed_us = now_us;
        self.new_phase = true;
        self.silent = false;
        self.suspicion = 0;
    }

    /// Mean sample rate in Hz; `None` before 64 periods. The error is below 10⁻⁴ at 819.2 Hz, and falls with time.
    pub fn measured_hz(&self) -> Option<f64> {
        (self.periods >= SETTLED_PERIODS).then(|| self.periods as f64 * 1e6 / self.elapsed_us as f64)
    }

    fn mean_period_q8(&self) -> u64 {
        if self.periods < SETTLED_PERIODS { self.period_q8 } else { (self.elapsed_us << 8) / self.periods }
    }

    fn silence_us(&self) -> u64 {
        SILENCE_US.max((SILENT_PERIODS * self.period_q8) >> 8)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use adis16405_driver::TimeBase;

    const PERIOD_US: f64 = 1e6 / 204.8;

    fn monitor() -> DataReadyMonitor {
        DataReadyMonitor::new(SamplePeriod::from_divisor(TimeBase::Fast, 8).unwrap())
    }

    #[test]
    fn after_a_long_loss_the_next_edge_raises_no_suspicion() {
        let mut monitor = monitor();
        feed(&mut monitor, [0.0, 1.0, 2.0], 1.0);
        monitor.restart_at((10_000.0 * PERIOD_US) as u64);
        assert_eq!(feed(&mut monitor, [10_001.4, 10_002.4], 1.0), [1, 9_998, 0], "at another phase");
        assert!(!monitor.is_suspect());
    }

    /// Feeds edges at multiples of the period by a clock `fast` times too fast; counts regular, lost and spurious ones.
    fn feed(monitor: &mut DataReadyMonitor, at: impl IntoIterator<Item = f64>, fast: f64) -> [u32; 3] {
        let [mut single, mut lost, mut spurious] = [0; 3];
        for periods in at {
            match monitor.edge((periods * PERIOD_US * fast) as u64) {
                Some(1) => single += 1,
                Some(n) => lost += n - 1,
                None => spurious += 1,
            }
        }
        [single, lost, spurious]
    }

    #[test]
    fn the_rate_is_measured_against_the_clock() {
        for fast in [0.97, 1.0, 1.03] {
            let mut monitor = monitor();
            assert_eq!(monitor.measured_hz(), None);
            assert_eq!(feed(&mut monitor, (0..10_000).map(f64::from), fast), [10_000, 0, 0]);
            let measured = monitor.measured_hz().unwrap();
            // Times are truncated to µs: 1 µs in 10,000 periods.
            assert!((measured * fast / 204.8 - 1.0).abs() < 1.0 / (9_999.0 * PERIOD_US * fast), "{measured}");
            assert!(!monitor.is_suspect());
        }
    }

    #[test]
    fn lost_edges_are_counted_exactly() {
        let mut monitor = monitor();
        let at = (0..1000).chain(1003..1500).chain(1600..2000).map(f64::from);
        assert_eq!(feed(&mut monitor, at, 1.03), [1895, 103, 0]);
        let measured = monitor.measured_hz().unwrap();
        assert!((measured * 1.03 - 204.8).abs() < 1e-3, "{measured}");
        assert!(monitor.is_suspect(), "the sensor may have been reset within 100 periods");
        monitor.restart_at(2000 * 5000);
        assert!(!monitor.is_suspect());
    }

    #[test]
    fn a_few_lost_edges_raise_no_suspicion() {
        let mut monitor = monitor();
        let at = (0..1000).filter(|k| k % 50 != 7).map(f64::from);
        assert_eq!(feed(&mut monitor, at, 1.0), [960, 20, 0]);
        assert!(!monitor.is_suspect());
    }

    #[test]
    fn a_spurious_edge_is_recognised() {
        let mut monitor = monitor();
        let at = [0.0, 1.0, 1.3, 2.0, 3.0, 3.6, 4.0, 5.0, 6.0];
        assert_eq!(feed(&mut monitor, at, 1.0), [7, 0, 2]);
        assert!(!monitor.is_suspect());
    }

    #[test]
    fn another_rate_raises_suspicion_within_a_few_edges() {
        for ratio in [0.25, 0.3, 0.5, 1.4, 2.0, 4.0] {
            let mut monitor = monitor();
            feed(&mut monitor, (0..100).map(f64::from), 1.0);
            feed(&mut monitor, (1..16).map(|k| 99.0 + ratio * f64::from(k)), 1.0);
            assert!(monitor.is_suspect(), "{ratio}");
        }
    }

    #[test]
    fn silence_is_detected_without_an_edge() {
        let mut monitor = monitor();
        monitor.restart_at(500_000);
        assert!(!monitor.is_silent_at(525_000));
        assert!(monitor.is_silent_at(525_001), "no edge since the sensor was probed");
        monitor.restart_at(990_000);
        monitor.edge(1_000_000);
        assert!(!monitor.is_silent_at(1_025_000));
        assert!(monitor.is_silent_at(1_025_001));
    }
}
