//! Numbers as integer counts: multiples of a step keep it as LSB, others get a power of two that adds at most
//! [`MAX_COST`] of the noise's variance, LSB²/12.

/// For the noise's variance.
const MAX_COST: f64 = 1e-4;
/// Differences fit into 32 bits.
const MAX_COUNT: f64 = (1u32 << 30) as f64;
const EXAMINED: usize = 4096;
const MIN_DISTINCT: usize = 3;
const ON_STEP: f64 = 0.02;
/// Exact in double precision.
const EXACT: f64 = (1u64 << 51) as f64;
/// Beyond the largest count; more raise the LSB.
const MAX_BEYOND: f64 = 1e-3;
/// Sums of fourth powers need room.
const MOST_NOISE_COUNTS: f64 = (1u32 << 17) as f64;
pub(crate) const MEDIAN_OF_NORMAL: f64 = 0.674_5;

/// How the numbers of a column become counts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ColumnQuantizer {
    /// In the file's unit.
    pub lsb: f64,
    /// Count 0; less than one LSB.
    offset: f64,
    /// Relative to the noise's variance; `None` for multiples.
    pub cost: Option<f64>,
}

impl ColumnQuantizer {
    pub const COUNTS: Self = Self { lsb: 1.0, offset: 0.0, cost: None };

    /// For finite `values`.
    pub fn new(values: &[f64]) -> Self {
        let noise = difference_noise(values);
        match step(values).filter(|(lsb, _)| noise <= MOST_NOISE_COUNTS * lsb) {
            Some((lsb, offset)) => Self { lsb, offset, cost: None },
            None => Self::without_step(values),
        }
    }

    /// The quantizer of `values` that are no multiples of a step.
    pub fn without_step(values: &[f64]) -> Self {
        let finite = || values.iter().copied().filter(|value| value.is_finite());
        let largest = finite().map(f64::abs).fold(0.0, f64::max);
        let noise = difference_noise(values);
        // A constant.
        let scale = if noise > 0.0 { noise * (12.0 * MAX_COST).sqrt() } else { largest };
        let mut lsb = if scale > 0.0 { scale.log2().floor().exp2() } else { 1.0 };
        let beyond = finite().filter(|value| value.abs() > MAX_COUNT * lsb).count();
        if !lsb.is_normal() || beyond as f64 > MAX_BEYOND * values.len() as f64 {
            lsb = (largest / MAX_COUNT).log2().ceil().exp2().max(f64::MIN_POSITIVE);
        }
        let cost = if noise > 0.0 { lsb * lsb / 12.0 / (noise * noise) } else { 0.0 };
        Self { lsb, offset: 0.0, cost: Some(cost) }
    }

    /// `None` out of range.
    pub fn count(&self, value: f64) -> Option<i32> {
        self.count_on_step(value).0
    }

    /// And true for a multiple, or if they are none.
    pub fn count_on_step(&self, value: f64) -> (Option<i32>, bool) {
        let steps = (value - self.offset) / self.lsb;
        let count = steps.round();
        let is_on_step = self.cost.is_some() || !value.is_finite() || (steps - count).abs() <= ON_STEP;
        ((count.abs() <= MAX_COUNT).then_some(count as i32), is_on_step)
    }
}

/// Common step and offset below it, by the smallest distance or the common divisor; `None` without one.
pub(crate) fn step(values: &[f64]) -> Option<(f64, f64)> {
    let largest = values.iter().copied().filter(|value| value.is_finite()).map(f64::abs).fold(0.0, f64::max);
    let stride = values.len().div_ceil(EXAMINED).max(1);
    let mut examined: Vec<f64> = values.iter().copied().step_by(stride).filter(|value| value.is_finite()).collect();
    examined.sort_by(f64::total_cmp);
    // Half a unit in the last place, single or double; whole numbers are exact.
    let is_single = examined.iter().all(|&value| f64::from(value as f32) == value);
    let is_whole = largest <= EXACT && examined.iter().all(|value| value.fract() == 0.0);
    let precision = if is_single { f64::from(f32::EPSILON) } else { 2.0 * f64::EPSILON };
    let rounding = if is_whole { 0.0 } else { 0.5 * largest * precision };
    examined.dedup_by(|one, other| (*one - *other).abs() <= 4.0 * rounding);
    if examined.len() < MIN_DISTINCT {
        return None;
    }
    let mut between: Vec<f64> = examined.windows(2).map(|pair| pair[1] - pair[0]).collect();
    between.sort_by(f64::total_cmp);
    let origin = examined[examined.len() / 2];
    let mut distances: Vec<f64> = examined.iter().map(|value| (value - origin).abs()).filter(|d| *d > 0.0).collect();
    distances.sort_by(f64::total_cmp);
    let is_multiple = |step: f64, offset: f64| {
        let is_on_step = |value: f64| {
            let steps = (value - offset) / step;
            (steps - steps.round()).abs() <= ON_STEP
        };
        let is_resolved = 2.0 * rounding < ON_STEP * step && largest / step < MAX_COUNT;
        is_resolved && values.iter().all(|&value| !value.is_finite() || is_on_step(value))
    };
    let smallest = *between.first()?;
    let coarse = [1.0, 2.0, 3.0].into_iter().map(|parts| smallest / parts);
    coarse.chain(common_divisor(&between, 2.0 * rounding)).find_map(|step| {
        let step = refined(step, &distances)?;
        // Distances from 0 are more precise.
        let (squares, products) = examined.iter().fold((0.0, 0.0), |(squares, products), &value| {
            let steps = (value / step).round();
            (squares + steps * steps, products + steps * value)
        });
        let without_offset = products / squares;
        if without_offset > 0.0 && is_multiple(without_offset, 0.0) {
            return Some((without_offset, 0.0));
        }
        let offset = origin - (origin / step).round() * step;
        is_multiple(step, offset).then_some((step, offset))
    })
}

/// For ascending `distances`, each within `error` (Euclid); `None` within the errors.
fn common_divisor(distances: &[f64], error: f64) -> Option<f64> {
    let mut divisor = *distances.first()?;
    let mut of_divisor = error;
    let mut at = 0;
    while let Some(&distance) = distances.get(at) {
        let times = (distance / divisor).round();
        let rest = (distance - times * divisor).abs();
        let of_rest = error + times * of_divisor;
        if of_rest > ON_STEP * divisor {
            break;
        }
        if rest > 2.0 * of_rest {
            (divisor, of_divisor, at) = (rest, of_rest, 0);
            continue;
        }
        if error < times * of_divisor {
            (divisor, of_divisor) = (distance / times, error / times);
        }
        at += 1;
    }
    (of_divisor < ON_STEP * divisor).then_some(divisor)
}

/// Near `step`, for ascending `distances`.
fn refined(mut step: f64, distances: &[f64]) -> Option<f64> {
    for &distance in distances {
        let steps = (distance / step).round();
        if steps < 1.0 || (distance / step - steps).abs() > 4.0 * ON_STEP {
            return None;
        }
        step = distance / steps;
    }
    Some(step)
}

/// By the median difference, which outliers do not move; by all if most are 0.
pub(crate) fn difference_noise(values: &[f64]) -> f64 {
    noise_at_lag(values, 1)
}

pub(crate) fn noise_at_lag(values: &[f64], lag: usize) -> f64 {
    let stride = values.len().div_ceil(1 << 17).max(1);
    let pairs = values.windows(lag + 1).step_by(stride).map(|pair| pair[lag] - pair[0]);
    let pairs = pairs.filter(|difference| difference.is_finite());
    let mut differences: Vec<f64> = pairs.map(f64::abs).collect();
    if differences.is_empty() {
        return 0.0;
    }
    let count = differences.len();
    let median = *differences.select_nth_unstable_by(count / 2, f64::total_cmp).1;
    let difference = if median > 0.0 {
        median / MEDIAN_OF_NORMAL
    } else {
        (differences.iter().map(|difference| difference * difference).sum::<f64>() / count as f64).sqrt()
    };
    difference / std::f64::consts::SQRT_2
}

#[cfg(test)]
mod tests {
    use super::{ColumnQuantizer, MAX_COST, step};
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Sum of twelve uniform numbers.
    fn noise(seed: u64, samples: usize) -> Vec<f64> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        (0..samples).map(|_| (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0).collect()
    }

    #[test]
    fn multiples_of_a_step_keep_it_and_their_counts() {
        let noise = noise(1, 20_000);
        // ±2000 deg/s in rad/s, ±8 g in m/s²; a fine step; even counts.
        for (step, mean, deviation, single) in [
            (1.0 / 16.4 * std::f64::consts::PI / 180.0, 0.0, 3.0, false),
            (1.0 / 16.4 * std::f64::consts::PI / 180.0, 12.0, 3.0, true),
            (9.80665 / 4096.0, 4096.0, 2.0, true),
            (9.80665 / 4096.0, 4096.0, 2.0, false),
            (1e-6, 500.0, 300.0, false),
            (2.0, 0.0, 40.0, false),
            // Single precision.
            (1.0, 1e7, 3.0, false),
            (1.0, 5e8, 3.0, false),
        ] {
            let counts: Vec<i32> = noise.iter().map(|x| (mean + deviation * x).round() as i32).collect();
            let written = |count: &i32| {
                let value = f64::from(*count) * step;
                if single { f64::from(value as f32) } else { value }
            };
            let values: Vec<f64> = counts.iter().map(written).collect();
            let quantizer = ColumnQuantizer::new(&values);
            assert_eq!(quantizer.cost, None, "{step} {single}");
            assert!((quantizer.lsb / step - 1.0).abs() < 1e-6, "{} for {step}", quantizer.lsb);
            let found: Vec<i32> = values.iter().map(|&value| quantizer.count(value).expect("in range")).collect();
            assert_eq!(found, counts, "{step} {single}");
        }
    }

    #[test]
    fn a_bias_that_was_taken_off_is_no_hindrance() {
        let counts: Vec<i32> = noise(2, 20_000).iter().map(|x| (5.0 * x).round() as i32).collect();
        let values: Vec<f64> = counts.iter().map(|&count| f64::from(count) * 0.125 - 1.2345).collect();
        let quantizer = ColumnQuantizer::new(&values);
        assert_eq!(quantizer.cost, None);
        let found: Vec<i32> = values.iter().map(|&value| quantizer.count(value).expect("in range")).collect();
        let shift = found[0] - counts[0];
        assert!(found.iter().zip(&counts).all(|(found, count)| found - count == shift));
    }

    /// 2·LSB/√12·σ/√n: 6·10⁻⁵ for a cost of 10⁻⁴.
    #[test]
    fn other_numbers_cost_at_most_what_is_stated() {
        let values: Vec<f64> = noise(3, 100_000).iter().map(|x| 9.81 + 1.7e-3 * x).collect();
        let quantizer = ColumnQuantizer::new(&values);
        let cost = quantizer.cost.expect("no step");
        assert!(cost > MAX_COST / 5.0 && cost <= 1.05 * MAX_COST, "{cost}");
        let rounded: Vec<f64> =
            values.iter().map(|&value| f64::from(quantizer.count(value).expect("in range")) * quantizer.lsb).collect();
        let variance = |values: &[f64]| {
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / values.len() as f64
        };
        let added = variance(&rounded) / variance(&values) - 1.0;
        assert!((added - cost).abs() < 5.0 * 6e-5, "{added} for {cost}");
    }

    /// 0.1 rad/s, six decimals: neighbours 10⁵ steps apart.
    #[test]
    fn the_step_of_a_vibrating_channel_is_that_of_its_numbers() {
        let noise = noise(6, 20_000);
        for deviation in [30.0, 1e4, 1e5] {
            let vibration = |at: usize| 1e5 * (1.57 * at as f64).sin();
            let counts: Vec<i32> =
                noise.iter().enumerate().map(|(at, x)| (deviation * x + vibration(at)).round() as i32).collect();
            let values: Vec<f64> = counts.iter().map(|&count| f64::from(count) * 1e-6).collect();
            let quantizer = ColumnQuantizer::new(&values);
            assert_eq!(quantizer.cost, None, "{deviation}: {quantizer:?}");
            let found: Vec<i32> = values.iter().map(|&value| quantizer.count(value).expect("in range")).collect();
            assert_eq!(found, counts, "{deviation}");
        }
    }

    #[test]
    fn a_step_that_no_two_neighbours_have_is_found() {
        let values: Vec<f64> =
            noise(7, 20_000).iter().map(|x| (6.0 * x).round() * 6.0 + if *x > 0.0 { 2.0 } else { 5.0 }).collect();
        assert_eq!(step(&values), Some((3.0, -1.0)));
    }

    /// Nine decimals of 0.09 would be 9e7 counts.
    #[test]
    fn the_digits_of_a_text_are_no_counts() {
        let values: Vec<f64> = noise(5, 20_000).iter().map(|x| (9e7 * x).round() * 1e-9).collect();
        let (step, _) = step(&values).expect("nine decimals");
        assert!((step / 1e-9 - 1.0).abs() < 1e-6, "{step}");
        let quantizer = ColumnQuantizer::new(&values);
        assert!(quantizer.lsb > 1e-3 && quantizer.cost.is_some(), "{quantizer:?}");
    }

    #[test]
    fn whole_numbers_beyond_double_precision_have_no_common_divisor() {
        let times = [1_700_000_000_000_072_828_i64, -1, -7_908_400_996_633_745_333, -415_939_286_374_804_831];
        assert_eq!(step(&times.map(|time| time as f64)), None);
    }

    #[test]
    fn odd_columns_do_no_harm() {
        for values in
            [vec![], vec![f64::NAN; 4], vec![0.0; 4], vec![3.7; 9], vec![1e308, -1e308, 1e308], vec![1e-320, 0.0]]
        {
            let quantizer = ColumnQuantizer::new(&values);
            assert!(quantizer.lsb > 0.0 && quantizer.lsb.is_finite(), "{values:?}: {quantizer:?}");
            assert!(values.iter().all(|&value| value.is_nan() || quantizer.count(value).is_some()), "{values:?}");
        }
        let mut values = noise(4, 20_000);
        values[777] = 1e30;
        let quantizer = ColumnQuantizer::new(&values);
        assert!(quantizer.cost.is_some_and(|cost| cost <= 1.05 * MAX_COST));
        assert_eq!(quantizer.count(1e30), None);
        assert_eq!(quantizer.count(f64::INFINITY), None);
    }
}
