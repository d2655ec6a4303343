//! What a point is worth under a mixture of terms: its equivalent degrees of freedom.
//!
//! By the sums of Greenhall and Riley over the second differences' covariances. A deterministic term repeats in every
//! record, so it blurs an estimate only together with the noise; a narrow resonance remembers its amplitude, so it
//! blurs it more than its share says.

use crate::math::clamp;
use crate::term::correlation::{MAX_LAGS, MAX_OVERLAP};
use crate::{Kind, Point};

/// Degrees of freedom of a point of which terms make up such shares, and the same without the memory of narrow terms
/// beyond two averaging times.
///
/// As large as is sensible where nothing random is modelled at all.
#[inline(never)] // so that its stack is not everybody's
pub(crate) fn degrees_of_freedom(
    parts: &[(Kind, f64)],
    point: &Point,
    sample_period: f64,
    flicker: &Flicker,
) -> (f64, f64) {
    let overlap = point.overlap.min(MAX_OVERLAP);
    let count = point.count as f64 * f64::from(overlap) / f64::from(point.overlap);
    let reach = |times: u32| (u64::from(times * overlap).min(point.count.saturating_sub(1))) as usize + 1;
    let (mut noise, mut certain) = ([0.0_f32; MAX_LAGS], [0.0_f32; MAX_LAGS]);
    let mut far = 0.0;
    for (kind, share) in parts {
        let sums = match kind {
            Kind::BiasInstability => &mut noise[..reach(4)],
            kind if kind.is_deterministic() => &mut certain[..reach(4)],
            // What comes later is none, or far.
            _ => &mut noise[..reach(2)],
        };
        match kind {
            Kind::BiasInstability => flicker.add(*share as f32, overlap, sums),
            kind => kind.add_correlations(*share as f32, point.n, overlap, sample_period, sums),
        }
        let stride = point.n as f64 / f64::from(overlap);
        far += 2.0 * share * share * kind.memory_beyond(point.n, stride, sample_period);
    }
    let pairs = noise.iter().zip(&certain).map(|(noise, certain)| f64::from(noise * (noise + 2.0 * certain)));
    let weight = |lag: usize| if lag == 0 { 1.0 } else { 2.0 * (1.0 - lag as f64 / count) };
    let near: f64 = pairs.enumerate().map(|(lag, pair)| if pair == 0.0 { 0.0 } else { weight(lag) * pair }).sum();
    let of = |blur: f64| clamp(count / blur, 1.0_f64.min(count), 1e18);
    (of(near + far), of(near))
}

/// Correlations of flicker noise, worked out once for all points: they depend on the distance in averaging times alone.
pub(crate) struct Flicker {
    /// Strides to an averaging time.
    overlap: u32,
    table: [f32; MAX_LAGS],
}

impl Flicker {
    /// Nothing worked out yet.
    pub(crate) const NONE: Self = Self { overlap: 0, table: [0.0; MAX_LAGS] };

    /// Works them out for points of this overlap and of those that divide it.
    pub(crate) fn take(&mut self, overlap: u32) {
        let overlap = overlap.min(MAX_OVERLAP);
        (self.overlap, self.table) = (overlap, [0.0; MAX_LAGS]);
        work_out(1.0, overlap, &mut self.table);
    }

    fn add(&self, share: f32, overlap: u32, sums: &mut [f32]) {
        let per_lag = if self.overlap.is_multiple_of(overlap) { (self.overlap / overlap) as usize } else { 0 };
        if per_lag == 0 || (sums.len() - 1) * per_lag >= MAX_LAGS {
            return work_out(share, overlap, sums);
        }
        for (sum, known) in sums.iter_mut().zip(self.table.iter().step_by(per_lag)) {
            *sum += share * known;
        }
    }
}

/// At an averaging factor as large as the overlap: it does not matter.
fn work_out(share: f32, overlap: u32, sums: &mut [f32]) {
    Kind::BiasInstability.add_correlations(share, u64::from(overlap), overlap, 1.0, sums);
}
