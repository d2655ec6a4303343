//! Quality of a recording's time stamps.

use crate::indexed_clock::{ClockStep, IndexedClock};
use crate::lateness_track::{COARSE, LostStretch, RateEstimate};

pub(crate) struct AlignedStamps {
    /// From the first; grows by at least one.
    pub(crate) periods: Vec<u64>,
    pub(crate) quality: StampQuality,
}

/// Evidence and doubts of the time stamps.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StampQuality {
    pub rate: Option<RateEstimate>,
    /// Common step of the stamps, s; `None` below a twentieth of a period.
    pub tick_s: Option<f64>,
    /// Lateness of ordinary samples (tick and jitter), periods; 0 with an index.
    pub width: f64,
    /// Including refused samples; empty with an index.
    pub losses: Vec<LostStretch>,
    /// Samples in losses with another possible explanation.
    pub uncertain: u64,
    /// True if single losses are told from rounding.
    pub resolved: bool,
    /// Samples; above 1 if samples come in bursts.
    pub least_loss: u64,
    /// True if the rate changes; [`rate`](Self::rate) then has its range.
    pub is_rate_changing: bool,
    /// True for a polling loop, whose periods vary.
    pub is_of_loop: bool,
    /// A period or more behind the others.
    pub late: u64,
    /// Contradictions between index and stamps.
    pub clock_steps: Vec<ClockStep>,
}

fn changing_rate(rate: RateEstimate) -> String {
    format!(
        "the rate of the samples, or of the clock that stamped them, changes from {:.4} to {:.4} Hz; {:.4} Hz is the mean",
        rate.low_hz, rate.high_hz, rate.hz
    )
}

impl StampQuality {
    /// Times in s.
    pub(crate) fn of_index(indices: &[u64], times: &[f64]) -> Self {
        let IndexedClock { rate, steps } = IndexedClock::new(indices, times);
        Self { rate, clock_steps: steps, resolved: true, least_loss: 1, ..Self::default() }
    }

    /// By cause, if any.
    pub fn warnings(&self) -> impl Iterator<Item = (&'static str, u64)> {
        let counts = [
            ("late_delivery", self.late),
            ("uncertain_loss", self.uncertain),
            ("clock_step", self.clock_steps.len() as u64),
        ];
        counts.into_iter().filter(|(_, count)| *count > 0)
    }

    /// One sentence each; none without doubt.
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
        if self.uncertain > 0 {
            notes.push(format!(
                "{} lost samples are uncertain: the rounding of the time stamps may show the same",
                self.uncertain
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
}
