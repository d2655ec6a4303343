//! Rate, size and time constant of disturbances that begin at once and decay, from the third and fourth cumulant of a filtered record.
//!
//! Of disturbances at the rate λ (a Poisson process), each with a size A of its own, a filter that answers one of size 1 by r(t) makes a
//! signal whose n-th cumulant is `κₙ = λ·E[Aⁿ]·∫r(t)ⁿ dt` (Campbell's theorem; S. Rice, "Mathematical analysis of random noise", Bell
//! Syst. Tech. J. 23, 1944, section 1.5). Gaussian noise of any spectrum has no third and no fourth one. So `κ₄/κ₃` tells the size, and
//! `κ₃` the rate: those of equal disturbances, `E[A⁴]/E[A³]` where the sizes differ.
//!
//! The filters are those that are matched to a decay. With `⟨f, T⟩ = ∫r³ dt` for the filter f and the time constant T, `κ₃/√⟨f, f⟩` is
//! largest for f = T: powers of a covariance are a covariance (I. Schur, J. reine angew. Math. 140, 1911), for which Schwarz's inequality
//! holds. It is the estimate by generalised least squares too, as the covariance of two such sums in Gaussian noise is 6⟨f, g⟩ (F. Mehler).
//!
//! The bounds are by the jackknife of the logarithms, with stretches of the record left out one by one (R. Miller, "The jackknife - a
//! review", Biometrika 61, 1974). A few stretches have most of the disturbances: a variance of m values with the kurtosis k has the
//! relative variance (k − 1)/m, as one of 2m/(k − 1) degrees of freedom (F. Satterthwaite, Biometrics Bull. 2, 1946). That of the size is no
//! less than chance overlaps make it.

use super::matched_filter::WhitenedRecord;
use super::overlaps::variance_of_ratio;
use crate::bounds::BoundedEstimate;
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Filters from a fourth to four times the time constant of the one that finds the disturbances, four an octave: either end is
/// beyond what a response tells.
const OCTAVES: i32 = 2;
const STEPS: i32 = 4;
/// Times within a block at which disturbances are taken to begin.
const ONSETS: usize = 4;
/// Probability below the upper end of a 95 % interval.
const UPPER: f64 = 0.975;

/// Disturbances of a rate and a size.
pub(super) struct CampbellEstimate {
    /// Blocks.
    pub time_constant: BoundedEstimate,
    /// Of the absolute value, in the unit of the record.
    pub size: BoundedEstimate,
    /// 1/block
    pub rate: BoundedEstimate,
    /// Standard deviation of the sum of all, `√(λA²T/2)`, in the unit of the record.
    pub deviation: BoundedEstimate,
}

impl CampbellEstimate {
    /// Of disturbances upwards (`sign` 1) or downwards (−1), near the filter for `time` blocks. The blocks are means of
    /// `samples_per_block` samples. `None` if the cumulants are not those of such disturbances.
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

/// Half of the 95 % interval of an estimate, of which these are the values without one of the stretches each.
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

/// What one filter makes of the record and of a decay of its own time constant.
struct Moments {
    /// Blocks.
    time: f64,
    /// Means of the second, third and fourth power of the output in each stretch of the record, and their sums.
    stretches: Vec<[f64; 3]>,
    sums: [f64; 3],
    /// Root of the sum of the cubes of its covariance.
    scale: f64,
    /// Sums of the third and fourth power of its response to a decay of height 1.
    response: [f64; 2],
}

impl Moments {
    /// Of the filter for a decay of `time` blocks, in stretches for one of `middle` blocks.
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

    /// Third and fourth cumulant of the output, without one of the stretches.
    fn cumulants(&self, left_out: Option<usize>) -> [f64; 2] {
        let count = (self.stretches.len() - usize::from(left_out.is_some())) as f64;
        let left_out = left_out.map_or([0.0; 3], |at| self.stretches[at]);
        let [second, third, fourth] = std::array::from_fn(|at| (self.sums[at] - left_out[at]) / count);
        // The lowest orders are not passed: the mean of the output is 0.
        [third, fourth - 3.0 * second * second]
    }
}

/// Means of the block in which a decay of height 1 begins and of the next one, for each time within the block.
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

/// The logarithms of time constant, size, rate and deviation, without one of the stretches; `None` where a cumulant is not positive.
fn logarithms(filters: &[Moments], left_out: Option<usize>) -> Option<[f64; 4]> {
    let cumulants: Vec<[f64; 2]> = filters.iter().map(|of| of.cumulants(left_out)).collect();
    let heights: Vec<f64> = cumulants.iter().zip(filters).map(|([third, _], of)| third / of.scale).collect();
    let largest = (1..filters.len().checked_sub(1)?).max_by(|a, b| heights[*a].total_cmp(&heights[*b]))?;
    let near = |of: &[f64]| -> Option<[f64; 3]> { of.get(largest - 1..=largest + 1)?.try_into().ok() };
    let [before, at, after] = near(&heights)?;
    // The vertex of the parabola through three neighbours.
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
