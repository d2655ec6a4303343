//! Rate, size and time constant of decaying disturbances, from the cumulants of a filtered record.
//!
//! A filter's response r(t) to disturbances of size A at the rate λ has `κₙ = λ·E[Aⁿ]·∫r(t)ⁿ dt` (Campbell's theorem;
//! S. Rice, Bell Syst. Tech. J. 23, 1944, section 1.5). `κ₄/κ₃` gives the size, `κ₃` the rate. `κ₃/√⟨f, f⟩` with `⟨f,
//! T⟩ = ∫r³ dt` is largest for the filter f = T (I. Schur, J. reine angew. Math. 140, 1911). Bounds by the jackknife
//! (R. Miller, Biometrika 61, 1974), with 2m/(k − 1) degrees of freedom for kurtosis k (F. Satterthwaite, Biometrics
//! Bull. 2, 1946).

use super::matched_filter::WhitenedRecord;
use super::overlaps::variance_of_ratio;
use crate::bounds::BoundedEstimate;
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Filters from 1/4 to 4 times the detecting filter's time constant, four an octave.
const OCTAVES: i32 = 2;
const STEPS: i32 = 4;
const ONSETS: usize = 4;
/// Quantile of the upper end of a 95 % interval.
const UPPER: f64 = 0.975;

pub(super) struct CampbellEstimate {
    pub time_constant: BoundedEstimate,
    /// Magnitude, in the unit of the record.
    pub size: BoundedEstimate,
    pub rate: BoundedEstimate,
    /// Standard deviation of the sum, `√(λA²T/2)`, in the unit of the record.
    pub deviation: BoundedEstimate,
}

impl CampbellEstimate {
    /// For disturbances of this `sign`, near the filter for `time` blocks; `None` if the cumulants are of others.
    pub(super) fn new(record: &WhitenedRecord, time: f64, sign: f64, samples_per_block: usize) -> Option<Self> {
        let filter = |step: i32| {
            let own = time * (f64::from(step) / f64::from(STEPS)).exp2();
            Moments::new(record, [own, time], sign, samples_per_block)
        };
        let filters = (-OCTAVES * STEPS..=OCTAVES * STEPS).map(filter).collect::<Option<Vec<Moments>>>()?;
        let stretches = filters.first()?.stretches.len();
        let whole = logarithms(&filters, None)?;
        let without = (0..stretches).map(|at| logarithms(&filters, Some(at)));
        let without = without.collect::<Option<Vec<[f64; 4]>>>()?;
        let blocks = (stretches * WhitenedRecord::stretch(time)) as f64;
        let overlaps = variance_of_ratio(&record.filtered(time, false)?.covariance, blocks)?;
        let bounded = |at: usize, least_variance: f64| {
            let values: Vec<f64> = without.iter().map(|of| of[at]).collect();
            let half = half_width(&values, least_variance)?;
            Some(BoundedEstimate::new(whole[at].exp(), (whole[at] - half).exp(), (whole[at] + half).exp()))
        };
        Some(Self {
            time_constant: bounded(0, 0.0)?,
            size: bounded(1, overlaps)?,
            rate: bounded(2, 0.0)?,
            deviation: bounded(3, 0.0)?,
        })
    }
}

/// Half of the 95 % interval, by the values `without` one stretch each.
fn half_width(without: &[f64], least_variance: f64) -> Option<f64> {
    let count = without.len() as f64;
    let mean = without.iter().sum::<f64>() / count;
    let power = |power: i32| without.iter().map(|of| (of - mean).powi(power)).sum::<f64>();
    let (squares, fourths) = (power(2), power(4));
    let freedom = (2.0 * count / (count * fourths / squares.powi(2) - 1.0)).min(count - 1.0);
    let students_t = StudentsT::new(0.0, 1.0, freedom).ok()?.inverse_cdf(UPPER);
    let variance = squares * (count - 1.0) / count;
    (variance > 0.0).then(|| students_t * variance.max(least_variance).sqrt())
}

struct Moments {
    time: f64,
    /// Mean second, third and fourth power of the output per stretch, and their sums.
    stretches: Vec<[f64; 3]>,
    sums: [f64; 3],
    /// Root of the sum of the cubed covariance.
    scale: f64,
    /// Sums of the third and fourth power of the response to height 1.
    response: [f64; 2],
}

impl Moments {
    /// Filter for a decay of `time` blocks; stretches for one of `middle` blocks.
    fn new(record: &WhitenedRecord, [time, middle]: [f64; 2], sign: f64, samples_per_block: usize) -> Option<Self> {
        let filtered = record.filtered(time, false)?;
        let inner = record.inner(&filtered.output, middle)?;
        let length = WhitenedRecord::stretch(middle);
        let mean_power =
            |of: &[f64], power: i32| of.iter().map(|z| (sign * z).powi(power)).sum::<f64>() / of.len() as f64;
        let stretches = inner.chunks_exact(length).map(|of| [2, 3, 4].map(|power| mean_power(of, power)));
        let stretches: Vec<[f64; 3]> = stretches.collect();
        let sums = stretches.iter().fold([0.0; 3], |sums, of| std::array::from_fn(|at| sums[at] + of[at]));
        let onsets = onsets(time, samples_per_block);
        let mut response = [0.0; 2];
        for onset in &onsets {
            for of in record.response(time, *onset)? {
                let cube = of.powi(3) / onsets.len() as f64;
                response = [response[0] + cube, response[1] + cube * of];
            }
        }
        let scale = filtered.covariance.iter().map(|of| of.powi(3)).sum::<f64>().sqrt();
        Some(Self { time, stretches, sums, scale, response })
    }

    /// Third and fourth cumulant without one stretch.
    fn cumulants(&self, left_out: Option<usize>) -> [f64; 2] {
        let count = (self.stretches.len() - usize::from(left_out.is_some())) as f64;
        let left_out = left_out.map_or([0.0; 3], |at| self.stretches[at]);
        let [second, third, fourth] = std::array::from_fn(|at| (self.sums[at] - left_out[at]) / count);
        // The mean of the output is 0.
        [third, fourth - 3.0 * second * second]
    }
}

/// Means of the onset block and the next one, of height 1, per onset.
fn onsets(time: f64, samples_per_block: usize) -> Vec<[f64; 2]> {
    let samples = samples_per_block as f64;
    let kept = (-1.0 / (time * samples)).exp();
    let sum = samples * (1.0 - kept);
    let onset = |number: usize| {
        let first = (2 * number + 1) * samples_per_block / (2 * ONSETS.min(samples_per_block));
        let left = kept.powf((samples_per_block - first) as f64);
        [(1.0 - left) / sum, left * (1.0 - kept.powf(samples)) / sum]
    };
    (0..ONSETS.min(samples_per_block)).map(onset).collect()
}

/// Logarithms of time constant, size, rate and deviation without one stretch; `None` if a cumulant is not positive.
fn logarithms(filters: &[Moments], left_out: Option<usize>) -> Option<[f64; 4]> {
    let cumulants: Vec<[f64; 2]> = filters.iter().map(|of| of.cumulants(left_out)).collect();
    let heights: Vec<f64> = cumulants.iter().zip(filters).map(|([third, _], of)| third / of.scale).collect();
    let largest = (1..filters.len().checked_sub(1)?).max_by(|a, b| heights[*a].total_cmp(&heights[*b]))?;
    let near = |of: &[f64]| -> Option<[f64; 3]> { of.get(largest - 1..=largest + 1)?.try_into().ok() };
    let [before, at, after] = near(&heights)?;
    let curvature = before - 2.0 * at + after;
    let vertex = if curvature < 0.0 { 0.5 * (before - after) / curvature } else { after - before };
    let vertex = vertex.clamp(-1.0, 1.0);
    let of_vertex = |values: &[f64]| {
        let [before, at, after] = near(values)?;
        let value = at + 0.5 * vertex * (after - before) + 0.5 * vertex * vertex * (before - 2.0 * at + after);
        value.is_finite().then_some(value)
    };
    let sizes = || {
        cumulants.iter().zip(filters).map(|([third, fourth], of)| {
            let [cubes, fourths] = of.response;
            (fourth / third * cubes / fourths).ln()
        })
    };
    let rates =
        sizes().zip(&cumulants).zip(filters).map(|((size, [third, _]), of)| (third / of.response[0]).ln() - 3.0 * size);
    let times: Vec<f64> = filters.iter().map(|of| of.time.ln()).collect();
    let [time, size, rate] =
        [of_vertex(&times)?, of_vertex(&sizes().collect::<Vec<f64>>())?, of_vertex(&rates.collect::<Vec<f64>>())?];
    Some([time, size, rate, size + 0.5 * (rate + time - f64::ln(2.0))])
}
