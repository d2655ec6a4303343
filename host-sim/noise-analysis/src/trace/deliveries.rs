//! Samples that never arrived, and samples that arrived twice as if they were new.

use crate::distributions::{poisson_bounds, poisson_tail};
use crate::findings::{Correction, Detection, Effect, Parameter, SIGNIFICANCE};
use measurement::Measurement;

/// By how much equal neighbours by chance may be more frequent than if the channels were independent.
const DEPENDENCE: f64 = 3.0;

/// Samples that the timeline misses: the indices or time stamps leave room for them.
///
/// Nothing but loss leaves such room, so one is enough.
#[must_use]
pub fn dropped(measurement: &Measurement) -> Option<Detection> {
    let (gaps, used) = (measurement.gaps(), measurement.len());
    let missing = measurement.dropped.get("gap").copied().unwrap_or(0);
    if missing == 0 {
        return None;
    }
    let all = (used as u64 + measurement.dropped.values().sum::<u64>()) as f64;
    let missing = missing as f64;
    // Losses come in gaps: the gaps are what is counted.
    let per_gap = missing / (gaps.max(1) as f64);
    let (low, high) = poisson_bounds(gaps.max(1) as f64);
    let fraction = |count: f64| (count / all).min(1.0);
    let evidence = format!(
        "{missing} of {all} samples never arrived, in {gaps} gaps; a reader that comes too late, or a full queue"
    );
    Some(Detection {
        effect: Effect::new(
            "dropped_samples",
            [("fraction", Parameter::new(fraction(missing), fraction(low * per_gap), fraction(high * per_gap), ""))],
            evidence,
        ),
        correction: None,
    })
}

/// Samples all of whose channels equal the sample before, more often than by chance.
///
/// The correction holds positions in the [`Series`](super::Series) of any channel.
#[must_use]
pub fn repeated(measurement: &Measurement) -> Option<Detection> {
    let channels = &measurement.channels;
    let mut equal = vec![0u64; channels.len()];
    let mut positions = Vec::new();
    for at in 1..measurement.len() {
        let mut all = true;
        for (channel, equal) in channels.iter().zip(&mut equal) {
            let same = channel.counts[at] == channel.counts[at - 1];
            *equal += u64::from(same);
            all &= same;
        }
        if all {
            positions.push(at);
        }
    }
    let refused = measurement.dropped.get("repeated").copied().unwrap_or(0);
    let (pairs, seen) = (measurement.len().saturating_sub(1) as f64, positions.len() as f64);
    let shares: Vec<f64> = equal.iter().map(|&equal| equal as f64 / pairs.max(1.0)).collect();
    let expected = DEPENDENCE * pairs * shares.iter().product::<f64>();
    let p_value = poisson_tail(positions.len() as u64 + refused, expected);
    if p_value > SIGNIFICANCE {
        return None;
    }
    let count = pairs * repeated_share(seen / pairs.max(1.0), &shares) + refused as f64;
    let (low, high) = poisson_bounds(count);
    let all = pairs + 1.0 + refused as f64;
    let evidence = format!(
        "{} of {all} samples equal the one before in all {} channels, {expected:.1} at most by chance; \
         a register that is read before it is renewed",
        positions.len() as u64 + refused,
        channels.len(),
    );
    Some(Detection {
        effect: Effect::new(
            "repeated_samples",
            [("fraction", Parameter::new(count / all, low / all, high / all, ""))],
            evidence,
        ),
        correction: Some(Correction::Exclude(positions)),
    })
}

/// The part f of the samples that are repeated, where the part `all` of them equals the one before in all channels and the
/// parts `shares` in each: `all = f + (1 − f)·Π (share − f)/(1 − f)`.
fn repeated_share(all: f64, shares: &[f64]) -> f64 {
    let (mut low, mut high) = (0.0, all);
    for _ in 0..50 {
        let repeated = 0.5 * (low + high);
        let by_chance: f64 = shares.iter().map(|share| ((share - repeated) / (1.0 - repeated)).max(0.0)).product();
        if repeated + (1.0 - repeated) * by_chance < all { low = repeated } else { high = repeated }
    }
    0.5 * (low + high)
}
