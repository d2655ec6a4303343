//! The facts that the time stamps of a recording show and do not show.

use crate::aligned_stamps::RateEstimate;
use crate::indexed_clock::{ClockStep, IndexedClock};
use crate::lateness_track::{COARSE, LostStretch};

/// The facts that the time stamps of a recording show and do not show.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StampQuality {
    /// The rate by the clock that stamped the samples, whatever rate was stated.
    pub rate: Option<RateEstimate>,
    /// Tick of that clock, s: the step that all stamps are multiples of. `None` where it is less than a twentieth of a period.
    pub tick_s: Option<f64>,
    /// Width of the lateness of ordinary samples, sample periods: the tick and the jitter. 0 where the samples have an index.
    pub width: f64,
    /// Losses that the stamps show, refused samples included; none where the samples have an index.
    pub losses: Vec<LostStretch>,
    /// Samples in losses that something else may explain.
    pub uncertain: u64,
    /// True if losses of single samples are told from the rounding of the stamps.
    pub resolved: bool,
    /// The shortest loss that is told from late delivery, samples: more than 1 where samples come in bursts that differ by as much.
    pub least_loss: u64,
    /// True if the rate changes in the course of the record; the interval of [`rate`](Self::rate) is then the range that it takes.
    pub is_rate_changing: bool,
    /// True if a loop wrote them that asks for samples when it has time: its periods are as long as it takes.
    pub is_of_loop: bool,
    /// Samples that were read at least a period later than the others.
    pub late: u64,
    /// Places where the index and the stamps contradict each other.
    pub clock_steps: Vec<ClockStep>,
}

/// Note on a rate that changes.
fn changing_rate(rate: RateEstimate) -> String {
    format!(
        "the rate of the samples, or of the clock that stamped them, changes from {:.4} to {:.4} Hz; {:.4} Hz is the mean",
        rate.low_hz, rate.high_hz, rate.hz
    )
}

impl StampQuality {
    /// Quality of samples that have an index and time stamps, s.
    pub(crate) fn of_index(indices: &[u64], times: &[f64]) -> Self {
        let IndexedClock { rate, steps } = IndexedClock::new(indices, times);
        Self { rate, clock_steps: steps, resolved: true, least_loss: 1, ..Self::default() }
    }

    /// Warnings that a report counts, by cause; those that do not occur are absent.
    pub fn warnings(&self) -> impl Iterator<Item = (&'static str, u64)> {
        let counts = [
            ("late_delivery", self.late),
            ("uncertain_loss", self.uncertain_losses()),
            ("clock_step", self.clock_steps.len() as u64),
        ];
        counts.into_iter().filter(|(_, count)| *count > 0)
    }

    /// Notes for a reader of the analysis, one sentence each; none for stamps that leave no doubt.
    pub fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if let (Some(rate), true) = (self.rate, self.width >= COARSE) {
            let tick = self.tick_s.map_or_else(String::new, |tick| format!(", ticks of {:.4} ms", 1e3 * tick));
            notes.push(format!(
                "the time stamps are coarser than the sample period ({:.2} periods{tick}): {:.4} Hz ({:.4} to {:.4}); a loss \
                 is located to {:.0} samples",
                self.width, rate.hz, rate.low_hz, rate.high_hz, self.width.ceil(),
            ));
        }
        let uncertain: u64 = self.uncertain_losses();
        if uncertain > 0 {
            notes.push(format!(
                "{uncertain} lost samples are uncertain: the rounding of the time stamps may show the same"
            ));
        }
        if let (Some(rate), true) = (self.rate, self.is_of_loop) {
            notes.push(format!(
                "no clock takes the samples: a loop asks for them when it has time, {:.4} to {:.4} times a second, {:.4} on average; where no \
                 interval is long, none is lost",
                rate.low_hz, rate.high_hz, rate.hz
            ));
        }
        notes.extend(self.rate.filter(|_| self.is_rate_changing && !self.is_of_loop).map(changing_rate));
        if let (Some(rate), true) = (self.rate, self.least_loss > 1) {
            notes.push(format!(
                "samples come in bursts: losses of fewer than {} samples cannot be told from late delivery, and none is counted; the \
                 rate is {:.4} Hz without such losses and {:.4} Hz at most",
                self.least_loss, rate.hz, rate.high_hz
            ));
        } else if !self.resolved {
            notes.push("losses of single samples cannot be told from the rounding of the time stamps".to_owned());
        }
        if let Some(step) = self.clock_steps.first() {
            notes.push(format!(
                "index and time contradict each other at {} places, first before sample {} by {:+.3} s; the index is believed",
                self.clock_steps.len(),
                step.before,
                step.seconds
            ));
        }
        notes
    }

    /// Samples in losses that something else may explain.
    pub fn uncertain_losses(&self) -> u64 {
        self.uncertain
    }
}
