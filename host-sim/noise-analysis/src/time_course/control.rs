//! What prediction by epochs is worth by itself, without knowing any effect: the controls of [`tracking`](super::tracking).

use super::Parts;
use super::deviance_per_point;
use super::moving::{Free, Moving};
use super::tracking::track;
use allan_core::Model;

/// Shortest part of an epoch, samples, whose variance is taken over as it was measured: an epoch has 64 of them.
pub const LONGEST_TAKEN_OVER: u64 = 64;

/// Deviance per point on the unseen half of two predictions that know no effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Controls {
    /// The declared model with its white level followed: what following alone explains.
    pub declared_followed: f64,
    /// The raw curve of the epoch before, and the declared model where that is too short: what persistence explains.
    pub persistence: f64,
}

impl Controls {
    /// `declared` is the declared model, fitted to the first half.
    #[must_use]
    pub fn of(parts: &Parts, declared: &Model) -> Self {
        let still = Moving::still(declared.clone());
        let followed = track(&still, Free::Level, [&parts.fitted_epochs, &parts.unseen_epochs], &parts.unseen);
        let count = parts.unseen_epochs.len();
        let persistent = |n: u64| {
            if n * LONGEST_TAKEN_OVER > parts.epoch as u64 {
                return declared.avar(n);
            }
            let before = parts.fitted_epochs.last().into_iter().chain(&parts.unseen_epochs).take(count);
            let points = before.flat_map(|epoch| epoch.points().iter().filter(|point| point.n == n));
            points.map(|point| point.avar).sum::<f64>() / count as f64
        };
        Self { declared_followed: followed.pooled, persistence: deviance_per_point(&parts.unseen, persistent) }
    }
}
