//! The paper's equations 7 to 9: three coefficients from three stretches of the curve.

use allan_core::AllanPoint;
use std::f64::consts::{LN_2, PI};
use std::ops::RangeInclusive;

/// Where the paper sees the slopes −½, 0 and +½, in s.
pub const INTERVALS: [RangeInclusive<f64>; 3] = [0.125..=2.0, 32.0..=128.0, 120.0..=230.0];

/// N, B and K: the −½ line at 1 s, the flat part over 0.664, the +½ line at 3 s, each through the geometric mean of the
/// octaves in its interval; `None` for an interval without an octave.
#[must_use]
pub fn read_off(points: impl Iterator<Item = (f64, f64)> + Clone) -> [Option<f64>; 3] {
    // What the Allan deviation at τ is multiplied with.
    let rules: [fn(f64) -> f64; 3] = [f64::sqrt, |_| (PI / (2.0 * LN_2)).sqrt(), |tau| (3.0 / tau).sqrt()];
    let mut rules = rules.into_iter();
    INTERVALS.map(|interval| {
        let rule = rules.next()?;
        let inside = points.clone().filter(|(tau, _)| interval.contains(tau));
        let (sum, count) =
            inside.fold((0.0, 0), |(sum, count), (tau, deviation)| (sum + (rule(tau) * deviation).ln(), count + 1));
        (count > 0).then(|| (sum / f64::from(count)).exp())
    })
}

/// Averaging time and Allan deviation of each point.
pub(super) fn deviations(points: &[AllanPoint]) -> impl Iterator<Item = (f64, f64)> + Clone + '_ {
    points.iter().map(|point| (point.tau, point.avar.sqrt()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pure_slopes_give_their_coefficients() {
        let taus = || (0..18).map(|octave| 2f64.powi(octave) / 204.8);
        let [n, ..] = read_off(taus().map(|tau| (tau, 0.5 / tau.sqrt())));
        let [_, b, _] = read_off(taus().map(|tau| (tau, 0.5 * 0.664)));
        let [.., k] = read_off(taus().map(|tau| (tau, 0.5 * (tau / 3.0).sqrt())));
        for (found, within) in [(n, 1e-12), (b, 1e-3), (k, 1e-12)] {
            assert!((found.expect("octaves") / 0.5 - 1.0).abs() < within, "{found:?}");
        }
        assert_eq!(read_off([(1000.0, 1.0)].into_iter()), [None; 3]);
    }
}
