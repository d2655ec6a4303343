//! Minimum of a window ahead or behind.

use std::collections::VecDeque;

/// For each value and the `window − 1` after it.
pub(crate) fn minimum_ahead(values: &[f64], window: usize) -> Vec<f64> {
    let mut least = vec![0.0; values.len()];
    // Increasing positions; the back is the minimum.
    let mut candidates: VecDeque<usize> = VecDeque::with_capacity(window.min(values.len()));
    for at in (0..values.len()).rev() {
        while candidates.front().is_some_and(|&ahead| values[ahead] >= values[at]) {
            candidates.pop_front();
        }
        candidates.push_front(at);
        while candidates.back().is_some_and(|&ahead| ahead >= at + window) {
            candidates.pop_back();
        }
        least[at] = candidates.back().map_or(values[at], |&ahead| values[ahead]);
    }
    least
}

pub(crate) struct MinimumBehind {
    window: usize,
    pushed: usize,
    /// Increasing, with numbers; the front is the minimum.
    candidates: VecDeque<(usize, f64)>,
}

impl MinimumBehind {
    /// `window` is at least 1.
    pub(crate) fn new(window: usize) -> Self {
        Self { window, pushed: 0, candidates: VecDeque::new() }
    }

    pub(crate) fn push(&mut self, value: f64) {
        while self.candidates.back().is_some_and(|&(_, newest)| newest >= value) {
            self.candidates.pop_back();
        }
        self.candidates.push_back((self.pushed, value));
        self.pushed += 1;
        while self.candidates.front().is_some_and(|&(number, _)| number + self.window < self.pushed) {
            self.candidates.pop_front();
        }
    }

    /// The minimum; `None` before the first value.
    pub(crate) fn minimum(&self) -> Option<f64> {
        self.candidates.front().map(|&(_, least)| least)
    }
}
