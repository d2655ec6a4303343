//! From the times at which samples were delivered to the periods in which they were taken.

/// Longest interval inside a flush, in periods: queued samples come back to back.
const FLUSH: f64 = 0.5;

/// Deliveries, each with the period in which its sample was taken.
pub(super) struct Deliveries {
    /// Period of each sample, counted from the first; grows by at least one a sample.
    pub(super) slots: Vec<u64>,
    /// Whether the sample was delivered in its own period, so that its time says when it was taken.
    on_time: Vec<bool>,
}

impl Deliveries {
    /// Takes the median interval for the period. `None` if that is 0 or overflows.
    pub(super) fn of(times: &[f64]) -> Option<Self> {
        let mut intervals: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
        if intervals.is_empty() {
            return None;
        }
        let middle = intervals.len() / 2;
        let (_, median, _) = intervals.select_nth_unstable_by(middle, f64::total_cmp);
        let period = *median;
        (period > 0.0 && period.is_finite()).then(|| Self::with_period(times, period))
    }

    /// Lays `times` (s, not decreasing) along periods of `period` s.
    ///
    /// A stall (an interval that rounds to more than one period) opens a block: the intervals of the flush after it, and
    /// the one that completes the last period, belong to the block. What the whole block lasts beyond one period a
    /// sample is a gap, and it lies before the samples of the block, where the queue would have overflowed.
    pub(super) fn with_period(times: &[f64], period: f64) -> Self {
        let interval = |at: usize| (times[at] - times[at - 1]) / period;
        let mut slots: Vec<u64> = Vec::with_capacity(times.len());
        let mut on_time = Vec::with_capacity(times.len());
        if !times.is_empty() {
            slots.push(0);
            on_time.push(true);
        }
        let mut at = 1;
        while at < times.len() {
            let mut excess = interval(at) - 1.0;
            let mut next = at + 1;
            if excess >= 0.5 {
                while next < times.len() && excess >= 0.5 && interval(next) < FLUSH {
                    excess += interval(next) - 1.0;
                    next += 1;
                }
                if next < times.len() && interval(next) < 1.0 {
                    excess += interval(next) - 1.0;
                    next += 1;
                }
            }
            // A float beyond u64 saturates.
            let missing = excess.round().max(0.0) as u64;
            let mut slot = slots[at - 1].saturating_add(missing);
            for late in at..next {
                slot = slot.saturating_add(1);
                slots.push(slot);
                on_time.push(late + 1 == next);
            }
            at = next;
        }
        Self { slots, on_time }
    }

    /// Sample rate in Hz, from the samples that were delivered on time.
    pub(super) fn rate(&self, times: &[f64]) -> Option<f64> {
        rate(&self.slots, times, |at| self.on_time[at])
    }
}

/// Sample rate in Hz: one over the slope of the least-squares line of time over period, for the samples that `counts`
/// admits. `None` if they span no time.
pub(super) fn rate(slots: &[u64], times: &[f64], counts: impl Fn(usize) -> bool) -> Option<f64> {
    let (&first_slot, &first_time) = (slots.first()?, times.first()?);
    // Relative to the first, so that a late origin costs no digits.
    let points = || {
        slots
            .iter()
            .zip(times)
            .enumerate()
            .filter(|(at, _)| counts(*at))
            .map(|(_, (slot, time))| ((slot - first_slot) as f64, time - first_time))
    };
    let n = points().count() as f64;
    let (sum_x, sum_y) = points().fold((0.0, 0.0), |(x, y), (slot, time)| (x + slot, y + time));
    let (mean_x, mean_y) = (sum_x / n, sum_y / n);
    let (xx, xy) = points().fold((0.0, 0.0), |(xx, xy), (slot, time)| {
        let x = slot - mean_x;
        (xx + x * x, xy + x * (time - mean_y))
    });
    let rate = xx / xy;
    (rate.is_finite() && rate > 0.0).then_some(rate)
}
