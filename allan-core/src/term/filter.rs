//! A digital low-pass filter of moving averages: white rate noise behind it, and slower noise that passes it.

use super::exponential::Markov;
use super::process::Process;
use crate::math::{abs, cos, expm1, floor, ln, sin, sqrt};
use core::f64::consts::PI;

/// One or two cascaded moving averages whose output is read at the same or a lower rate; two have a triangular
/// (Bartlett) response.
///
/// Below the length of the filter the Allan variance rises like that of a random walk. The coefficient is that of the
/// white noise far below both rates.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct MovingAverageFilter {
    /// Number of cascaded moving averages, 1 or 2.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "crate::serialized::stages"))]
    pub stages: u8,
    /// L: number of values that each averages, 1 to 128.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "crate::serialized::taps"))]
    pub taps: u16,
    /// Filter values per sample that is read, 1 or more, not always an integer.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "crate::serialized::at_least_one"))]
    pub decimation: f64,
}

impl MovingAverageFilter {
    /// Two moving averages over `taps` values each, every value of which is read.
    #[must_use]
    pub const fn bartlett(taps: u16) -> Self {
        Self { stages: 2, taps, decimation: 1.0 }
    }

    /// The longest lag, in samples, at which two samples are correlated.
    fn reach(&self) -> u32 {
        let lags = f64::from(self.stages) * f64::from(self.taps);
        floor(lags / self.decimation) as u32
    }

    /// Autocorrelation at a lag of `samples`, linear between whole filter values.
    fn autocorrelation(&self, samples: f64) -> f64 {
        let position = samples * self.decimation;
        let below = position as i64;
        let above = position - below as f64;
        if above == 0.0 {
            return self.value_autocorrelation(below);
        }
        (1.0 - above) * self.value_autocorrelation(below) + above * self.value_autocorrelation(below + 1)
    }

    /// Autocorrelation of the impulse response at a lag of `j` filter values; it sums to 1.
    fn value_autocorrelation(&self, j: i64) -> f64 {
        let taps = i64::from(self.taps);
        let area = (taps * taps) as f64;
        if self.stages == 1 {
            return (taps - j.abs()).max(0) as f64 / area;
        }
        // C(k + 3, 3), of which 1 − 4 are needed on either side of the middle.
        let choose = |k: i64| if k < 0 { 0 } else { (k + 1) * (k + 2) * (k + 3) / 6 };
        let position = 2 * (taps - 1) - j.abs();
        (choose(position) - 4 * choose(position - taps)) as f64 / (area * area)
    }

    /// Length in s of each of two equal averages whose impulse response has the same variance.
    pub(crate) fn smoothing(&self, sample_period: f64) -> f64 {
        f64::from(self.taps) / self.decimation * sample_period * sqrt(f64::from(self.stages) / 2.0)
    }

    /// Power gain, 0 to 1, at `frequency` in Hz: `(sin(L·x)/(L·sin x))²` per stage, with `x = π·f·sample_period/decimation`
    /// and `L` taps. `sample_period` is that of the samples that are read, s.
    #[must_use]
    pub fn gain(&self, frequency: f64, sample_period: f64) -> f64 {
        let half = PI * frequency * sample_period / self.decimation;
        let taps = f64::from(self.taps);
        let below = taps * sin(half);
        if below == 0.0 {
            return 1.0;
        }
        let ratio = sin(taps * half) / below;
        let square = ratio * ratio;
        if self.stages == 1 { square } else { square * square }
    }

    /// True if averages over `n` samples are long against the filter: 1/2,000 of a random walk, 1/700 of flicker noise.
    pub(super) fn is_short_against(&self, n: u64) -> bool {
        n as f64 * self.decimation > LONG * f64::from(self.taps)
    }

    /// Allan variance at averaging factor `n` of a random walk that has passed the filter, for K = 1.
    pub(super) fn avar_of_walk(&self, n: u64, sample_period: f64) -> f64 {
        let linear = (1.0 + 1.0 / (self.decimation * self.decimation)) / 12.0;
        sample_period * self.avar_of_passed(n, f64::INFINITY, &|m| m * (linear - m * m / 6.0))
    }

    /// Allan variance at averaging factor `n` of a Gauss–Markov process of variance 1 that has passed the filter.
    pub(super) fn avar_of_markov(&self, n: u64, markov: &Markov, sample_period: f64) -> f64 {
        let steps = markov.time_constant / sample_period;
        if n as f64 * self.decimation > LONG_AGAINST_WHITE * f64::from(self.taps) {
            return markov.avar(n, sample_period);
        }
        if self.reach_of_differences(n) < WALKS * steps {
            return 2.0 / markov.time_constant * self.avar_of_walk(n, sample_period);
        }
        let between = (1.0 - 1.0 / (self.decimation * self.decimation)) / (6.0 * steps);
        let (line, bend) = markov.line_and_bend(sample_period);
        self.avar_of_passed(n, steps, &|m| (line - between) * m + bend * expm1(-m / steps))
    }

    /// The longest lag, in samples, between values on which a second difference of averages over `n` samples depends.
    fn reach_of_differences(&self, n: u64) -> f64 {
        2.0 * n as f64 + f64::from(self.stages) * f64::from(self.taps) / self.decimation
    }

    /// Allan variance at averaging factor `n` of flicker noise that has passed the filter, for B = 1.
    pub(super) fn avar_of_flicker(&self, n: u64) -> f64 {
        let between = (1.0 - 1.0 / (self.decimation * self.decimation)) / 12.0;
        self.avar_of_passed(n, f64::INFINITY, &|m| {
            let (log, square) = (if m > 0.0 { ln(m) } else { 0.0 }, m * m);
            // The second difference of m² ln m, and its first terms for a distant m.
            let second = match m {
                _ if between == 0.0 => 0.0,
                _ if m < 2.0 => square_log(m - 1.0) + square_log(m + 1.0) - 2.0 * square * log,
                _ => 2.0 * log + 3.0 - 1.0 / (6.0 * square),
            };
            (between * second - square * log) / PI
        })
    }

    /// Allan variance at averaging factor `n` of noise behind the filter, from the `sum_variance` of the noise before
    /// it and the autocorrelation of the impulse response.
    ///
    /// For a filter that is read slowly, `sum_variance` must be lower by a twelfth of its second difference (Euler and
    /// Maclaurin); a thirtieth is missing at `n = 1` and a decimation by the number of taps. `sum_variance` may bend
    /// over `smooth` samples.
    fn avar_of_passed(&self, n: u64, smooth: f64, sum_variance: &dyn Fn(f64) -> f64) -> f64 {
        let (n, taps) = (n as f64, f64::from(self.taps));
        if self.stages == 2 && self.decimation == 1.0 && n < taps {
            // The autocorrelation and the fourth difference, products of the same four factors, change places.
            let changed = Self { taps: n as u16, ..*self };
            return n / taps * n / taps * changed.avar_of_passed(self.taps.into(), smooth, sum_variance);
        }
        let reach = usize::from(self.stages) * usize::from(self.taps);
        let most = reach as f64 / self.decimation;
        let pair: &dyn Fn(f64, f64) -> f64 = &|m, lag| sum_variance(abs(lag - m)) + sum_variance(abs(lag + m));
        // Far from 0 a pair is a parabola over the lags: its value at 0, and its curvature.
        let parabola = |m: f64| (pair(m, 0.0), (pair(m, most) - pair(m, 0.0)) / (most * most));
        let parabolas = (n > 2.0 * most).then(|| [n, 2.0 * n].map(parabola));
        let stride = ((taps.min(n.min(smooth) * self.decimation) / STEPS_IN_AVERAGE) as usize).max(1);
        let (mut sum, mut weights) = (0.0, 0.0);
        for j in (0..reach).step_by(stride) {
            let lag = j as f64 / self.decimation;
            let [once, twice] = match parabolas {
                Some(both) => both.map(|(at_zero, curvature)| at_zero + curvature * lag * lag),
                None => [pair(n, lag), pair(2.0 * n, lag)],
            };
            let fourth = 6.0 * sum_variance(lag) - 4.0 * once + twice;
            let both_sides = if j == 0 { 1.0 } else { 2.0 };
            let weight = both_sides * self.value_autocorrelation(j as i64);
            weights += weight;
            sum -= weight * fourth;
        }
        sum / (weights * 4.0 * n * n)
    }
}

/// Each entry of a table with its number of samples, in strides of `stride` samples.
fn sums(stride: f64, table: &mut [f64]) -> impl Iterator<Item = (f64, &mut f64)> {
    table.iter_mut().enumerate().map(move |(at, entry)| (at as f64 * stride, entry))
}

/// `m² ln |m|`.
fn square_log(m: f64) -> f64 {
    if m == 0.0 { 0.0 } else { m * m * ln(abs(m)) }
}

/// Lags at which the autocorrelation of a long filter is evaluated, for each average: it is smooth.
const STEPS_IN_AVERAGE: f64 = 4.0;
/// Averaging factor over the number of taps from which on the filter does not matter to slow noise.
const LONG: f64 = 32.0;
/// [`LONG`] for noise that is white over many samples.
const LONG_AGAINST_WHITE: f64 = 1024.0;
/// Lag over the time constant up to which a Gauss–Markov process is a random walk.
const WALKS: f64 = 1e-3;

impl Process for MovingAverageFilter {
    fn sum_variance(&self, m: f64, sample_period: f64) -> f64 {
        let mut at_0_and_m = [0.0; 2];
        self.sum_variances(m, sample_period, &mut at_0_and_m);
        at_0_and_m[1]
    }

    fn sum_variances(&self, stride: f64, sample_period: f64, table: &mut [f64]) {
        let at_zero = self.autocorrelation(0.0);
        let mut others = 0.0;
        table.fill(0.0);
        for lag in 1..=self.reach() {
            let correlation = self.autocorrelation(f64::from(lag));
            others += correlation;
            for (m, pairs) in sums(stride, table).filter(|(m, _)| lag < *m as u32) {
                *pairs += (m - f64::from(lag)) * correlation;
            }
        }
        // Over the sum of the autocorrelation over all lags: the gain at low frequencies.
        let scale = (at_zero + 2.0 * others) * sample_period;
        sums(stride, table).for_each(|(m, pairs)| *pairs = (m * at_zero + 2.0 * *pairs) / scale);
    }

    fn avar(&self, n: u64, sample_period: f64) -> f64 {
        let n = n as f64;
        let at_zero = self.autocorrelation(0.0);
        let (mut sum, mut pairs) = (at_zero, n * at_zero);
        for lag in (1..=self.reach()).map(f64::from) {
            let both_sides = 2.0 * self.autocorrelation(lag);
            sum += both_sides;
            pairs += both_sides * (2.0 * (n - lag).max(0.0) - 0.5 * (2.0 * n - lag).max(0.0));
        }
        pairs / (n * n * sum * sample_period)
    }

    fn density(&self, frequency: f64, sample_period: f64) -> f64 {
        let angle = 2.0 * PI * abs(frequency) * sample_period;
        let at_zero = self.autocorrelation(0.0);
        let (sum, waves) = (1..=self.reach()).map(f64::from).fold((at_zero, at_zero), |(sum, waves), j| {
            let both_sides = 2.0 * self.autocorrelation(j);
            (sum + both_sides, waves + both_sides * cos(j * angle))
        });
        waves / sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Provided(MovingAverageFilter);

    impl Process for Provided {
        fn sum_variance(&self, m: f64, sample_period: f64) -> f64 {
            self.0.sum_variance(m, sample_period)
        }

        fn density(&self, frequency: f64, sample_period: f64) -> f64 {
            self.0.density(frequency, sample_period)
        }
    }

    #[test]
    fn one_pass_over_the_lags_gives_the_allan_variance_of_the_sums() {
        for (stages, taps, decimation) in
            [(1, 4, 1.0), (2, 8, 1.0), (2, 8, 8.92), (2, 64, 3.7), (1, 1, 1.0), (2, 2, 40.0)]
        {
            let filter = MovingAverageFilter { stages, taps, decimation };
            for n in [1, 2, 3, 8, 64, 1 << 20] {
                let (own, provided) = (filter.avar(n, 0.01), Provided(filter).avar(n, 0.01));
                // The provided method takes a small difference of two sums.
                assert!((own / provided - 1.0).abs() < 1e-9, "{filter:?} {n}: {own} {provided}");
            }
        }
    }
}
