//! What the times of the data-ready edges tell: the true sample rate, lost edges, and a sensor that is not what it was.

use adis16405_driver::SamplePeriod;

/// One tick of the sensor's sample clock, 1/1638.4 s, in 1/256 µs: exact.
const TICK_Q8: u64 = 156_250;
/// Silence after which the sensor may have been reset; its shortest recovery is far longer.
const SILENCE_US: u64 = 25_000;
/// The same in periods, for slow rates.
const SILENT_PERIODS: u64 = 4;
/// Periods from which on their mean is a better measure of the interval than the programmed one.
const SETTLED_PERIODS: u64 = 64;
/// Doubts from which on the sensor is to be checked.
const MOST_DOUBT: u32 = 8;

/// How an edge fits those before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// So many periods after the one before; 1 if no edge was lost, and for the first edge.
    Periods(u32),
    /// At no multiple of the period: not the edge of a sample that was asked for.
    Stray,
}

/// Follows the data-ready edges of one programmed sample period.
#[derive(Debug, Clone, Copy)]
pub struct Cadence {
    period_q8: u64,
    last_us: Option<u64>,
    /// Since when the sensor is known to be in order.
    trusted_us: u64,
    /// Periods between edges that were seen, and the time they took.
    periods: u64,
    elapsed_us: u64,
    /// Rises with every edge that is lost or out of step, falls with every one in step.
    doubt: u32,
    silent: bool,
    /// The next edge begins a new train: a sensor that was configured does not keep its phase.
    restarted: bool,
}

impl Cadence {
    /// Expects edges at `period`, within a quarter of it.
    #[must_use]
    pub const fn new(period: SamplePeriod) -> Self {
        let period_q8 = period.ticks() as u64 * TICK_Q8;
        Self {
            period_q8,
            last_us: None,
            trusted_us: 0,
            periods: 0,
            elapsed_us: 0,
            doubt: 0,
            silent: false,
            restarted: false,
        }
    }

    /// Takes the time of an edge, in microseconds; times must not run backwards.
    pub fn edge(&mut self, at_us: u64) -> Step {
        self.silent |= self.is_silent_at(at_us);
        let Some(last_us) = self.last_us else {
            self.last_us = Some(at_us);
            return Step::Periods(1);
        };
        let interval_us = at_us.saturating_sub(last_us);
        let (interval, period) = (interval_us << 8, self.mean_period_q8());
        let periods = (interval + period / 2) / period;
        let off = interval.abs_diff(periods * period);
        if core::mem::take(&mut self.restarted) {
            self.last_us = Some(at_us);
            return Step::Periods(u32::try_from(periods.max(1)).unwrap_or(u32::MAX));
        }
        if periods == 0 || off > period / 4 {
            self.doubt = (self.doubt + 3).min(2 * MOST_DOUBT);
            return Step::Stray;
        }
        self.last_us = Some(at_us);
        if periods <= SILENT_PERIODS {
            self.periods += periods;
            self.elapsed_us += interval_us;
        }
        self.doubt = if periods == 1 { self.doubt.saturating_sub(1) } else { (self.doubt + 2).min(2 * MOST_DOUBT) };
        Step::Periods(u32::try_from(periods).unwrap_or(u32::MAX))
    }

    /// Whether the sensor must be checked before its samples can be used: it was silent for so long that it may have
    /// been reset, or its edges come at another rate.
    #[must_use]
    pub const fn is_doubtful(&self) -> bool {
        self.silent || self.doubt >= MOST_DOUBT
    }

    /// Whether the line has been silent at `now_us` for so long that the sensor may be gone.
    #[must_use]
    pub fn is_silent_at(&self, now_us: u64) -> bool {
        let heard_us = self.last_us.unwrap_or(0).max(self.trusted_us);
        now_us.saturating_sub(heard_us) > self.silence_us()
    }

    /// The sensor was found to be in order, or put in order, at `now_us`.
    pub fn trust(&mut self, now_us: u64) {
        self.trusted_us = now_us;
        self.restarted = true;
        self.silent = false;
        self.doubt = 0;
    }

    /// The mean sample rate in Hz; `None` before the second edge.
    #[must_use]
    pub fn measured_hz(&self) -> Option<f64> {
        (self.elapsed_us > 0).then(|| self.periods as f64 * 1e6 / self.elapsed_us as f64)
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

    fn cadence() -> Cadence {
        Cadence::new(SamplePeriod::from_divisor(TimeBase::Fast, 8).unwrap())
    }

    #[test]
    fn after_a_long_loss_the_next_edge_raises_no_doubt() {
        let mut cadence = cadence();
        follow(&mut cadence, [0.0, 1.0, 2.0], 1.0);
        cadence.trust((10_000.0 * PERIOD_US) as u64);
        assert_eq!(follow(&mut cadence, [10_001.4, 10_002.4], 1.0), [1, 9_998, 0], "at another phase");
        assert!(!cadence.is_doubtful());
    }

    /// Edges at these multiples of the period, by a clock that is `fast` times too fast.
    fn follow(cadence: &mut Cadence, at: impl IntoIterator<Item = f64>, fast: f64) -> [u32; 3] {
        let [mut single, mut lost, mut stray] = [0; 3];
        for periods in at {
            match cadence.edge((periods * PERIOD_US * fast) as u64) {
                Step::Periods(1) => single += 1,
                Step::Periods(n) => lost += n - 1,
                Step::Stray => stray += 1,
            }
        }
        [single, lost, stray]
    }

    #[test]
    fn the_rate_is_measured_against_the_clock() {
        for fast in [0.97, 1.0, 1.03] {
            let mut cadence = cadence();
            assert_eq!(cadence.measured_hz(), None);
            assert_eq!(follow(&mut cadence, (0..10_000).map(f64::from), fast), [10_000, 0, 0]);
            let measured = cadence.measured_hz().unwrap();
            // Times are cut to microseconds: 1 µs in 10 000 periods of 4.9 ms.
            assert!((measured * fast / 204.8 - 1.0).abs() < 1.0 / (9_999.0 * PERIOD_US * fast), "{measured}");
            assert!(!cadence.is_doubtful());
        }
    }

    /// With a clock 3 % off, 100 lost edges are counted right once the rate is known.
    #[test]
    fn lost_edges_are_counted_exactly() {
        let mut cadence = cadence();
        let at = (0..1000).chain(1003..1500).chain(1600..2000).map(f64::from);
        assert_eq!(follow(&mut cadence, at, 1.03), [1895, 103, 0]);
        let measured = cadence.measured_hz().unwrap();
        assert!((measured * 1.03 - 204.8).abs() < 1e-3, "{measured}");
        assert!(cadence.is_doubtful(), "100 periods of silence are enough for a reset");
        cadence.trust(2000 * 5000);
        assert!(!cadence.is_doubtful());
    }

    #[test]
    fn a_few_lost_edges_raise_no_doubt() {
        let mut cadence = cadence();
        let at = (0..1000).filter(|k| k % 50 != 7).map(f64::from);
        assert_eq!(follow(&mut cadence, at, 1.0), [960, 20, 0]);
        assert!(!cadence.is_doubtful());
    }

    #[test]
    fn a_stray_edge_is_told_from_a_sample() {
        let mut cadence = cadence();
        let at = [0.0, 1.0, 1.3, 2.0, 3.0, 3.6, 4.0, 5.0, 6.0];
        assert_eq!(follow(&mut cadence, at, 1.0), [7, 0, 2]);
        assert!(!cadence.is_doubtful());
    }

    /// A reset puts the part back to 819.2 samples a second; or it was told a slower rate by somebody else.
    #[test]
    fn another_rate_raises_doubt_within_a_few_edges() {
        for ratio in [0.25, 0.3, 0.5, 1.4, 2.0, 4.0] {
            let mut cadence = cadence();
            follow(&mut cadence, (0..100).map(f64::from), 1.0);
            follow(&mut cadence, (1..16).map(|k| 99.0 + ratio * f64::from(k)), 1.0);
            assert!(cadence.is_doubtful(), "{ratio}");
        }
    }

    #[test]
    fn silence_is_noticed_without_an_edge() {
        let mut cadence = cadence();
        cadence.trust(500_000);
        assert!(!cadence.is_silent_at(525_000));
        assert!(cadence.is_silent_at(525_001), "no edge since the sensor was put in order");
        cadence.trust(990_000);
        cadence.edge(1_000_000);
        assert!(!cadence.is_silent_at(1_025_000));
        assert!(cadence.is_silent_at(1_025_001));
    }
}
