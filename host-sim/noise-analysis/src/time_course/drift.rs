//! What a model misses beyond the drift that the fitted half lets expect.

use super::deviance_per_point;
use super::moving::{FARTHEST_LEVEL, Free, Moving, STATES, State, least};
use super::tracking::step;
use allan_core::Curve;

/// Rounds of the search, one state after the other, and its first step.
const ROUNDS: usize = 8;
const FIRST_STEP: f64 = 0.01;

/// Standard deviation of what each state is on average over `unseen` epochs less what it is over the last `learnt` of
/// the fitted ones, if it walks on as it did there.
///
/// With steps of variance `q`, the mean over `L` epochs and that over the `H` that follow differ by a variance of
/// `q·(L + H)/3`, nearly.
#[must_use]
pub fn expected<const POINTS: usize>(
    moving: &Moving,
    free: Free,
    fitted: &[Curve<POINTS>],
    learnt: usize,
    unseen: usize,
) -> State {
    let estimates: Vec<_> = fitted.iter().map(|epoch| moving.estimate(epoch, free)).collect();
    std::array::from_fn(|index| {
        let measured: Vec<(f64, f64)> = estimates.iter().map(|e| (e.state[index], e.error[index])).collect();
        (step(&measured) * (learnt + unseen) as f64 / 3.0).sqrt()
    })
}

/// Deviance per point of a model on `half`, whose states are unknown by `drift`: the least of what the model leaves in a
/// state and what that state costs, `(x/σ)²`. Without drift the plain deviance per point.
#[must_use]
pub fn beyond_drift<const POINTS: usize>(moving: &Moving, drift: State, half: &Curve<POINTS>) -> f64 {
    let points = half.points().iter().filter(|point| point.n <= half.samples() / 8).count() as f64;
    let cost = |state: State| {
        let moves = state.iter().zip(drift).filter(|(_, sigma)| *sigma > 0.0);
        let prior: f64 = moves.map(|(x, sigma)| (x / sigma).powi(2)).sum();
        let model = moving.at(state);
        deviance_per_point(half, |n| model.avar(n)) + prior / points
    };
    let mut state = [0.0; STATES];
    for _ in 0..ROUNDS {
        for index in (0..STATES).filter(|&index| drift[index] > 0.0) {
            let trial = |value: f64| {
                let mut trial = state;
                trial[index] = value;
                cost(trial)
            };
            state[index] = least(trial, state[index], FIRST_STEP, FARTHEST_LEVEL);
        }
    }
    cost(state)
}
