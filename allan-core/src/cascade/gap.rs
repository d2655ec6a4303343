//! Missing samples: bridged by octaves that are long against the gap, left out by the others.

use super::{Cascade, Octave, second_difference};

/// A bridged gap has at most `1/REACH` of the averaging time of the octaves that keep their differences over it.
const REACH: u64 = 8;

/// The quotient rounded down; 0 for a divisor of 0, without the code for a panic.
fn quotient(dividend: i64, divisor: i64) -> i64 {
    dividend.checked_div_euclid(divisor).unwrap_or(0)
}

/// A gap that is being closed by replacing its samples with their expected mean.
struct Bridge {
    /// Time of the last sample before the gap and of the last replaced one.
    start: u64,
    end: u64,
    sum: i64,
    replaced: i64,
    /// Part of each replaced sample in the running sum, rounded down; the last one adds the rest.
    each: i64,
}

impl Bridge {
    fn sum_at(&self, time: u64) -> i64 {
        let along = if time < self.end { self.each * (time - self.start) as i64 } else { self.replaced };
        self.sum.wrapping_add(along)
    }
}

impl<const OCTAVES: usize, const OVERLAP: usize> Cascade<OCTAVES, OVERLAP> {
    /// The shortest octave that bridges a gap of one sample. A bridged gap has at most one difference within it.
    pub(crate) const SHORTEST_BRIDGING: usize =
        if OVERLAP as u64 > REACH { OVERLAP.trailing_zeros() as usize } else { REACH.trailing_zeros() as usize };

    /// Records that `missing` samples were lost before the next one; see [the gaps of a cascade](Self#gaps).
    ///
    /// Calls add up until the next sample. A gap of 0 samples has no effect.
    ///
    /// # Cost
    /// | `Cascade::gap` | Cortex-M4F | Cortex-M0+ |
    /// |---|---|---|
    /// | instructions | 19 | 31 |
    /// | instructions of the next sample, 1 missing | 4,691 | 13,297 |
    /// | instructions of the next sample, 100 missing | 9,142 | 20,340 |
    /// | instructions of the next sample, 2²⁰ missing | 18,527 | 34,779 |
    /// | stack, bytes | 292 | 564 |
    /// | flash, bytes | 4,930 | — |
    ///
    /// See [`guide::costs`](crate::guide::costs) for how they are counted.
    pub fn gap(&mut self, missing: u32) {
        if missing > 0 {
            self.pending += u64::from(missing);
            self.settling = self.elapsed as u32;
        }
    }

    /// Closes the pending gap before `next`. It is kept out of line: its locals would take registers from every sample.
    #[cold]
    #[inline(never)]
    pub(super) fn close_gap(&mut self, next: i32) {
        let missing = core::mem::take(&mut self.pending);
        let (start, end) = (self.elapsed, self.elapsed + missing);
        // The octave from which on a gap of this length is bridged; all octaves cut it out if nothing precedes it.
        let bridging = Self::SHORTEST_BRIDGING + (u64::BITS - (missing - 1).leading_zeros()) as usize;
        let bridging = if start > self.resumed { bridging.min(OCTAVES) } else { OCTAVES };
        for (k, octave) in self.octaves.iter_mut().enumerate().take(bridging) {
            let open = Self::open_differences(start, k, octave.resumed);
            octave.differences = octave.differences.saturating_add(open);
            octave.resumed = end;
        }
        if bridging < OCTAVES {
            // At most 2²⁷ samples are bridged.
            self.test_interpolation(missing as u32, bridging);
            let replaced = self.interpolated(missing, next);
            let each = if missing > 1 { quotient(replaced, missing as i64) } else { replaced };
            self.bridge(&Bridge { start, end, sum: self.sum, replaced, each }, bridging);
        } else {
            self.sum = 0;
            self.recent.fill(0);
            self.octaves.iter_mut().for_each(|octave| (octave.oldest, octave.line) = (0, [0; OVERLAP]));
        }
        self.absent += missing;
        (self.elapsed, self.resumed) = (end, end);
        self.settling = self.settling_time();
    }

    /// Computes [`settling`](Cascade::settling) from the gaps of the octaves below
    /// [`ROUNDED`](crate::moments::ROUNDED).
    pub(super) fn settling_time(&self) -> u32 {
        let complete = |(k, octave): (usize, &Octave<OVERLAP>)| octave.resumed + (2 << k);
        let settled = self.octaves[..Self::FINE + Self::SHORT].iter().enumerate().map(complete).max();
        let settling = settled.unwrap_or(0).saturating_sub(Self::WARM);
        (if self.pending > 0 { self.elapsed } else { settling }) as u32
    }

    /// Expected sum of the missing samples: their number times the mean of the samples around them.
    fn interpolated(&self, missing: u64, next: i32) -> i64 {
        let before = (2 * missing - 1).min(self.elapsed - self.resumed);
        let level = (u64::BITS - (before / (2 * OVERLAP as u64)).leading_zeros()) as usize;
        let step = (self.elapsed - before + (1 << level) - 1) >> level;
        let samples = (self.elapsed - (step << level) + 1) as i64;
        let sum = self.sum.wrapping_sub(self.sum_at(level, step)).wrapping_add(i64::from(next));
        let missing = missing as i64;
        if samples == 2 * missing {
            return sum >> 1;
        }
        let mean = quotient(sum, samples);
        let rest = sum.wrapping_sub(mean.wrapping_mul(samples));
        mean * missing + quotient(rest * missing, samples)
    }

    /// Replaces about as many known samples before the gap as are missing, and adds the squared error.
    fn test_interpolation(&mut self, missing: u32, bridging: usize) {
        if let Some(octave) = self.octaves.get_mut(bridging) {
            octave.interpolation.add_gap(missing);
        }
        // The lines reach back 2·OVERLAP strides, of which the mean and the samples to replace take three parts.
        let widest = (2 * OVERLAP as u32 - 1) / 3;
        let strides = |level: usize| (missing + (1 << level >> 1)) >> level;
        let Some(level) = (0..Self::LEVELS).find(|&level| strides(level) <= widest) else { return };
        let (width, newest) = (u64::from(strides(level)), self.elapsed >> level);
        let known = newest.checked_sub(3 * width).is_some_and(|first| first << level >= self.resumed);
        if !known || width == 0 {
            return;
        }
        // At level 0 the newest sample stands for the one after the gap.
        let end = if level == 0 { newest - 1 } else { newest };
        let [first, start, end] = [newest - 3 * width, end - width, end].map(|step| self.sum_at(level, step));
        let after = if level == 0 { self.sum.wrapping_sub(end) } else { 0 };
        let around = start.wrapping_sub(first).wrapping_add(after);
        let error = (around >> 1).wrapping_sub(end.wrapping_sub(start));
        if let Some(octave) = self.octaves.get_mut(bridging) {
            octave.interpolation.add_test((width as u32) << level, error);
        }
    }

    /// Fills the delay lines with the running sums of the gap, and adds the differences that end in it.
    fn bridge(&mut self, gap: &Bridge, bridging: usize) {
        // `ilog2` would link the code of its panic, although a gap is never empty.
        let highest = (u64::BITS - 1).saturating_sub((gap.start ^ gap.end).leading_zeros()) as usize;
        // The coarsest line is filled first, since each line takes its sums from finer ones.
        for level in (0..=highest.min(Self::LEVELS - 1)).rev() {
            let (last, newest) = (gap.start >> level, gap.end >> level);
            let Some(entered) = newest.checked_sub(OVERLAP as u64) else { continue };
            let entering = (last + 1).saturating_sub(OVERLAP as u64).max(newest.saturating_sub(2 * OVERLAP as u64));
            let mut middle = 0;
            for step in entering..=entered {
                let time = step << level;
                middle = if time > gap.start { gap.sum_at(time) } else { self.sum_at(level, step) };
                if let Some(octave) = self.octaves.get_mut(level + Self::FINE) {
                    octave.exchange(step, middle);
                }
            }
            let (k, time) = (level + Self::FINE, newest << level);
            let Some(octave) = self.octaves.get_mut(k) else { continue };
            if k >= bridging && time - octave.resumed >= 2 << k {
                octave.moments.add(k, second_difference(gap.sum_at(time), middle, octave.oldest));
            }
        }
        for time in (gap.start + 1).max((gap.end + 1).saturating_sub(OVERLAP as u64))..=gap.end {
            self.recent[Self::slot(time)] = gap.sum_at(time);
        }
        self.sum = gap.sum_at(gap.end);
    }

    /// The running sum at `step` of `level`, no more than `2·OVERLAP` strides before now.
    fn sum_at(&self, level: usize, step: u64) -> i64 {
        let (mut level, mut step) = (level, step);
        loop {
            let back = (self.elapsed >> level) - step;
            if back >= OVERLAP as u64 {
                let Some(octave) = self.octaves.get(level + Self::FINE) else { return 0 };
                return if back >= 2 * OVERLAP as u64 { octave.oldest } else { octave.line[Self::slot(step)] };
            }
            if level == 0 {
                return self.recent[Self::slot(step)];
            }
            (level, step) = (level - 1, 2 * step);
        }
    }
}
