//! A line whose frequency runs evenly over the record (chirp).
//!
//! Spectra of short segments have it on a straight line; the ordinates of all such lines are summed (J. Taylor, Astron.
//! Astrophys. Suppl. 15, 1974). The best segment length has a run of half its resolution. The phases of the segments
//! decide doubtful sums.

use super::coherent_track::CoherentTrack;
use crate::bounds::BoundedEstimate;
use crate::distributions::{NORMAL_975, chi_squared_tail, exponential_sum_tail};
use crate::effects::findings::SIGNIFICANCE;
use crate::samples::uniform_series::UniformSeries;

const SEGMENTS: [usize; 4] = [32, 64, 128, 256];
/// Fewest samples of a segment.
const FEWEST_SAMPLES: usize = 256;
/// Ordinates per resolution; a line between two loses at most 0.9 dB.
const PADDING: usize = 2;
/// Lowest frequency, resolutions of a segment, above leaking drift.
const LOWEST: usize = 4;
/// Fewest ordinates of the run; a steady line is in the mean over time.
const FEWEST_ORDINATES: usize = 8;
/// Ordinates per side whose mean is the noise of a segment, and the nearest, left out.
const NEIGHBOURS: usize = 32;
const NEAREST: usize = 4;
/// p-value above which chance explains the scatter of sums beside a line.
const SCATTER_BY_CHANCE: f64 = 0.05;
/// Cap on an ordinate over the noise, against short disturbances.
const LARGEST: f64 = 32.0;
/// Part of a line's power in a straight track's ordinates, with bounds.
const LEFT: BoundedEstimate = BoundedEstimate::new(0.7, 0.5, 1.0);
/// Most expected chance lines at which the phases are tried.
const MOST_BY_CHANCE: f64 = 3.0;

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct FrequencyTrack {
    /// At the beginning and at the end of the record, Hz.
    pub frequencies: [f64; 2],
    /// Half an ordinate of a segment, Hz.
    pub error: f64,
    /// Mean ordinate on the track over the noise, less 1, and its standard deviation.
    pub excess: f64,
    pub excess_error: f64,
    pub duration_s: f64,
    /// By the line's power over that of the noise.
    pub amplitude: BoundedEstimate,
    pub segments: f64,
    /// Least power, over the noise, of a sinusoid of the same energy in the whole record.
    pub energy: f64,
    /// Probability of such a mean anywhere by chance.
    pub p_value: f64,
}

impl FrequencyTrack {
    /// The clearest track; `None` if chance explains it.
    pub(crate) fn find(series: &UniformSeries) -> Option<Self> {
        let series = series.clone().averaged_until_dithered().detrended();
        let found = SEGMENTS.into_iter().filter_map(|segments| Self::in_segments(&series, segments));
        let found: Vec<Self> = found.collect();
        let clearest = |of: &[Self]| {
            let best = of.iter().min_by(|a, b| a.p_value.total_cmp(&b.p_value)).copied()?;
            let p_value = best.p_value * SEGMENTS.len() as f64;
            (p_value < SIGNIFICANCE).then_some(Self { p_value, ..best })
        };
        clearest(&found).or_else(|| {
            let open = found.iter().filter(|track| track.p_value < MOST_BY_CHANCE);
            clearest(&open.filter_map(|track| track.coherent(&series)).collect::<Vec<Self>>())
        })
    }

    /// By the coherent sum of all segments.
    fn coherent(&self, series: &UniformSeries) -> Option<Self> {
        let found = CoherentTrack::near(series, self.frequencies, self.segments as usize)?;
        let p_value = found.by_chance();
        Some(Self { frequencies: found.frequencies, energy: found.power, p_value, ..*self })
    }

    fn in_segments(series: &UniformSeries, segments: usize) -> Option<Self> {
        let spectrogram = Spectrogram::new(series, segments)?;
        let rising = spectrogram.rows.clone();
        let falling = spectrogram.rows.iter().rev().cloned().collect();
        let [rising, falling] = [rising, falling].map(strongest_line);
        let (is_rising, line) = if rising.sum > falling.sum { (true, rising) } else { (false, falling) };
        let columns = spectrogram.rows[0].len();
        let scatter = spectrogram.scatter_beside(&line, is_rising);
        // Rising and falling, from every ordinate, by every number of ordinates.
        let trials = (2 * columns * segments) as f64;
        let count = segments as f64;
        let low = spectrogram.frequency(line.first);
        let high = spectrogram.frequency(line.first + line.drift);
        let (excess, excess_error) = (f64::from(line.sum) / count - 1.0, 1.0 / count.sqrt());
        let half = NORMAL_975 * excess_error;
        let amplitude = |excess: f64, left: f64| spectrogram.amplitude(&line, excess) / left.sqrt();
        Some(Self {
            frequencies: if is_rising { [low, high] } else { [high, low] },
            error: 0.5 * spectrogram.spacing,
            excess,
            excess_error,
            duration_s: series.duration(),
            amplitude: BoundedEstimate::new(
                amplitude(excess, LEFT.value),
                amplitude(excess - half, LEFT.high),
                amplitude(excess + half, LEFT.low),
            ),
            segments: count,
            energy: f64::from(line.sum) - count,
            p_value: trials * exponential_sum_tail(count / scatter, f64::from(line.sum) / scatter),
        })
    }

    pub(crate) fn passes(&self, frequency: f64) -> bool {
        let [first, last] = self.frequencies;
        (first.min(last) - self.error..=first.max(last) + self.error).contains(&frequency)
    }
}

/// Segment spectra over their mean in time and over neighbouring frequencies.
struct Spectrogram {
    /// By segment, from the lowest frequency on.
    rows: Vec<Vec<f32>>,
    /// Mean over the segments, from the lowest frequency on.
    means: Vec<f32>,
    size: usize,
    /// Hz between ordinates.
    spacing: f64,
}

impl Spectrogram {
    fn new(series: &UniformSeries, segments: usize) -> Option<Self> {
        let size = series.values().len() / segments;
        if size < FEWEST_SAMPLES {
            return None;
        }
        let transform = fourier::forward(PADDING * size);
        let (mut input, mut output) = (transform.make_input_vec(), transform.make_output_vec());
        let mut rows: Vec<Vec<f32>> = Vec::with_capacity(segments);
        for values in series.values().chunks_exact(size).take(segments) {
            input.fill(0.0);
            for (slot, value) in input.iter_mut().zip(values) {
                *slot = if value.is_finite() { *value } else { 0.0 };
            }
            transform.process(&mut input, &mut output).ok()?;
            rows.push(output[PADDING * LOWEST..output.len() - 1].iter().map(|bin| bin.norm_sqr() as f32).collect());
        }
        let columns = rows.first()?.len();
        let mut by_column = vec![0.0_f32; columns];
        for row in &rows {
            by_column.iter_mut().zip(row).for_each(|(sum, power)| *sum += power / segments as f32);
        }
        for row in &mut rows {
            for (power, mean) in row.iter_mut().zip(&by_column) {
                *power = if *mean > 0.0 { *power / mean } else { 0.0 };
            }
            let levels = levels_of_neighbours(row);
            for (power, level) in row.iter_mut().zip(levels) {
                // A segment without samples has the expected noise.
                *power = if level > 0.0 { (f64::from(*power) / level).min(LARGEST) as f32 } else { 1.0 };
            }
        }
        Some(Self { rows, means: by_column, size, spacing: 1.0 / ((PADDING * size) as f64 * series.sample_period()) })
    }

    /// Variance of the sums along parallel lines, over that of independent ordinates; 1 if chance explains it.
    fn scatter_beside(&self, line: &Line, is_rising: bool) -> f64 {
        let last = self.rows.len() - 1;
        let sum = |first: usize| {
            let ordinate = |at: usize| {
                let passed = (2 * line.drift * at + last) / (2 * last);
                let row = if is_rising { at } else { last - at };
                self.rows[row].get(first + passed).copied().map(f64::from)
            };
            (0..=last).map(ordinate).sum::<Option<f64>>()
        };
        let beside = (line.first.saturating_sub(NEIGHBOURS)..=line.first + NEIGHBOURS).step_by(PADDING);
        let sums: Vec<f64> = beside.filter(|of| of.abs_diff(line.first) > NEAREST).filter_map(sum).collect();
        let freedom = sums.len() as f64 - 1.0;
        let mean = sums.iter().sum::<f64>() / sums.len() as f64;
        let scatter = sums.iter().map(|sum| (sum - mean).powi(2)).sum::<f64>() / (freedom * self.rows.len() as f64);
        let is_of_chance = chi_squared_tail(freedom * scatter, freedom) > SCATTER_BY_CHANCE;
        if is_of_chance { 1.0 } else { scatter }
    }

    /// Amplitude A of a sinusoid, `(A·size/2)²`, that exceeds the noise along a line by `excess`.
    ///
    /// The mean at a frequency includes the line itself; the median excludes crossed lines.
    fn amplitude(&self, line: &Line, excess: f64) -> f64 {
        let mut crossed = self.means[line.first..=(line.first + line.drift).min(self.means.len() - 1)].to_vec();
        crossed.sort_by(f32::total_cmp);
        let own = PADDING as f64 / (line.drift + 1) as f64;
        let excess = excess.max(0.0);
        let power = f64::from(crossed[crossed.len() / 2]) * excess / (1.0 + own * excess);
        2.0 * power.sqrt() / self.size as f64
    }

    fn frequency(&self, column: usize) -> f64 {
        (PADDING * LOWEST + column) as f64 * self.spacing
    }
}

/// Noise at each ordinate by n neighbours, times n/(n − 1) so that the ratio averages 1.
fn levels_of_neighbours(ordinates: &[f32]) -> Vec<f64> {
    let mut sums = vec![0.0];
    sums.extend(ordinates.iter().scan(0.0, |sum, power| {
        *sum += f64::from(*power);
        Some(*sum)
    }));
    let around = |at: usize, distance: usize| {
        let (from, to) = (at.saturating_sub(distance), (at + distance + 1).min(ordinates.len()));
        (sums[to] - sums[from], (to - from) as f64)
    };
    let level = |at: usize| {
        let ((sum, count), (nearest, near)) = (around(at, NEIGHBOURS), around(at, NEAREST));
        let independent = (count - near) / PADDING as f64;
        (sum - nearest) / (count - near) * independent / (independent - 1.0)
    };
    (0..ordinates.len()).map(level).collect()
}

#[derive(Debug, Clone, Copy)]
struct Line {
    first: usize,
    /// Ordinates from the first row to the last.
    drift: usize,
    sum: f32,
}

/// The line with the largest sum over a power of two of rows, rising by [`FEWEST_ORDINATES`] to one ordinate a row.
fn strongest_line(rows: Vec<Vec<f32>>) -> Line {
    let columns = rows[0].len();
    // Sums of each group of rows, by the drift over it.
    let mut groups: Vec<Vec<Vec<f32>>> = rows.into_iter().map(|row| vec![row]).collect();
    while groups.len() > 1 {
        groups = groups
            .chunks_exact(2)
            .map(|pair| {
                let drifts = 2 * pair[0].len();
                let line = |drift: usize| {
                    let (half, shift) = (drift / 2, drift.div_ceil(2));
                    let (first, second) = (&pair[0][half], &pair[1][half]);
                    // A line that leaves the spectrum has no sum.
                    let mut sums = vec![0.0; columns];
                    for (sum, (a, b)) in sums.iter_mut().zip(first.iter().zip(&second[shift.min(columns)..])) {
                        *sum = if *a > 0.0 && *b > 0.0 { a + b } else { 0.0 };
                    }
                    sums
                };
                (0..drifts).map(line).collect()
            })
            .collect();
    }
    let mut best = Line { first: 0, drift: 0, sum: 0.0 };
    for (drift, sums) in groups.iter().flatten().enumerate().skip(FEWEST_ORDINATES) {
        for (first, &sum) in sums.iter().enumerate() {
            if sum > best.sum {
                best = Line { first, drift, sum };
            }
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;
    use std::f64::consts::TAU;

    const SAMPLES: usize = 1 << 17;
    const RATE_HZ: f64 = 200.0;

    /// White noise of deviation 1, a running and a steady sinusoid.
    fn series(seed: u64, amplitude: f64, [first, last]: [f64; 2]) -> UniformSeries {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let duration_s = SAMPLES as f64 / RATE_HZ;
        let value = |at: usize| {
            let time_s = at as f64 / RATE_HZ;
            let turns = (first + 0.5 * (last - first) * time_s / duration_s) * time_s;
            amplitude * (TAU * turns).sin() + (TAU * 31.0 * time_s).sin() + random.sample::<f64, _>(StandardNormal)
        };
        UniformSeries::new(1.0 / RATE_HZ, (0..SAMPLES).map(value).collect())
    }

    #[test]
    fn a_frequency_that_runs_up_or_down_is_found() {
        for (seed, frequencies) in [(1, [5.0, 15.0]), (2, [50.0, 20.0]), (3, [3.0, 6.0])] {
            // 0.07²·SAMPLES/4 = 160 over 128 segments: an excess above 0.5, five standard deviations.
            let found = FrequencyTrack::find(&series(seed, 0.07, frequencies)).expect("clear");
            for (found_hz, expected) in found.frequencies.into_iter().zip(frequencies) {
                // Two ordinates of the longest spectra: 0.2 Hz.
                assert!((found_hz - expected).abs() < 0.5, "{found:?}");
            }
            assert!(found.passes(0.5 * (frequencies[0] + frequencies[1])) && !found.passes(90.0));
        }
    }

    #[test]
    fn a_gap_hides_no_running_frequency() {
        let mut values = series(4, 0.1, [5.0, 15.0]).values().to_vec();
        values[SAMPLES / 4..SAMPLES / 4 + SAMPLES / 16].fill(f64::NAN);
        let found = FrequencyTrack::find(&UniformSeries::new(1.0 / RATE_HZ, values)).expect("clear");
        for (found_hz, expected) in found.frequencies.into_iter().zip([5.0, 15.0]) {
            assert!((found_hz - expected).abs() < 0.5, "{found:?}");
        }
    }

    #[test]
    fn the_amplitude_is_within_its_bounds() {
        for seed in 60..80 {
            let amplitude = if seed % 2 == 0 { 0.08 } else { 0.3 };
            let found = FrequencyTrack::find(&series(seed, amplitude, [6.0, 17.0])).expect("clear").amplitude;
            assert!((found.low..=found.high).contains(&amplitude), "{seed}: {found:?}");
            assert!((found.value / amplitude - 1.0).abs() < 0.3, "{seed}: {found:?}");
        }
    }

    #[test]
    fn a_weak_line_is_found_by_its_phases() {
        // 0.05²·SAMPLES/4 = 82 over the noise; chance anywhere: 34. Over 128 segments 4.9 standard deviations, too few.
        let frequencies = [8.0, 20.0];
        let (mut found, mut by_segments) = (0, 0);
        for seed in 40..52 {
            let series = series(seed, 0.05, frequencies).detrended();
            let Some(track) = FrequencyTrack::find(&series) else { continue };
            found += 1;
            let alone = SEGMENTS.iter().filter_map(|of| FrequencyTrack::in_segments(&series, *of));
            let is_clear = alone.map(|track| 4.0 * track.p_value).any(|p_value| p_value < SIGNIFICANCE);
            by_segments += usize::from(is_clear);
            for (found_hz, expected) in track.frequencies.into_iter().zip(frequencies) {
                // An ordinate of the segments, 0.1 Hz, or some resolutions of the record.
                assert!((found_hz - expected).abs() < if is_clear { 0.5 } else { 0.01 }, "{track:?}");
            }
        }
        // Three quarters and one in six are expected.
        assert!(found >= 6 && by_segments + 3 <= found, "{found} {by_segments}");
    }

    /// Behind an average over 64 samples only rounding and leakage are left above the filter's range.
    #[test]
    fn slow_noise_that_leaks_into_a_quiet_range_is_none() {
        let (time_constant_s, taps, step) = (11.6, 64, 0.058);
        let decay = (-1.0 / (RATE_HZ * time_constant_s)).exp();
        for seed in 80..92 {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let mut process = 0.0;
            let value = |_| {
                process =
                    decay * process + 0.7 * (1.0 - decay * decay).sqrt() * random.sample::<f64, _>(StandardNormal);
                process + 0.7 * random.sample::<f64, _>(StandardNormal)
            };
            let input: Vec<f64> = (0..SAMPLES + 2 * taps).map(value).collect();
            let averaged =
                |of: &[f64]| -> Vec<f64> { of.windows(taps).map(|of| of.iter().sum::<f64>() / taps as f64).collect() };
            let filtered = averaged(&averaged(&input));
            let values = filtered.into_iter().take(SAMPLES).map(|value| (value / step).round() * step).collect();
            assert_eq!(FrequencyTrack::find(&UniformSeries::new(1.0 / RATE_HZ, values)), None, "{seed}");
        }
    }

    /// A band 3 Hz wide whose level wanders by e within 15 s leaks differently into each short segment.
    #[test]
    fn the_skirt_of_a_band_that_swells_is_none() {
        let is_found = |seed: &u64| {
            let mut random = ChaCha8Rng::seed_from_u64(*seed);
            let [narrow, slow] = [std::f64::consts::PI * 3.0, 1.0 / 15.0].map(|rate_hz| (-rate_hz / RATE_HZ).exp());
            let [mut cosine, mut sine, mut level] = [0.0; 3];
            let value = |at: usize| {
                for (state, kept) in [(&mut cosine, narrow), (&mut sine, narrow), (&mut level, slow)] {
                    *state = kept * *state + (1.0 - kept * kept).sqrt() * random.sample::<f64, _>(StandardNormal);
                }
                let (sin, cos) = (TAU * 10.0 * at as f64 / RATE_HZ).sin_cos();
                2.0 * f64::exp(level) * (cosine * cos + sine * sin) + random.sample::<f64, _>(StandardNormal)
            };
            let series = UniformSeries::new(1.0 / RATE_HZ, (0..SAMPLES).map(value).collect());
            FrequencyTrack::find(&series).is_some()
        };
        let found: Vec<u64> = (0..40).filter(is_found).collect();
        assert!(found.len() < 2, "{found:?}");
    }

    #[test]
    fn steady_lines_and_noise_are_none() {
        for seed in 10..30 {
            assert_eq!(FrequencyTrack::find(&series(seed, 0.0, [1.0, 1.0])), None, "{seed}");
        }
    }
}
