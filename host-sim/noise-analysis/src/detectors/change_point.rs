//! The place where the level of the noise changes, between its 95 % bounds.

use std::ops::Range;

/// Half of the 95 % quantile of χ² with one degree of freedom: ln likelihood that a place within the bounds loses.
const LIKELIHOOD_LOSS: f64 = 1.92;
/// Cap on a square over the larger level, against single samples; 0.3 % of normal ones are larger.
const LARGEST_SQUARE: f64 = 9.0;

/// ln likelihood of a change from one level to another before each of some differences, and behind the last, over that before the first.
pub(super) struct ChangeOfLevel {
    gains: Vec<f64>,
}

impl ChangeOfLevel {
    /// From `levels[0]` to `levels[1]`, by the `squares` of differences, each of which counts as `freedom` degrees of freedom. No square
    /// is larger than a normal one of the level `largest`.
    pub(super) fn new(squares: &[f64], levels: [f64; 2], largest: f64, freedom: f64) -> Self {
        let gain = |square: &f64| {
            let square = square.min(LARGEST_SQUARE * largest);
            0.5 * freedom * (square / levels[1] - square / levels[0] + (levels[1] / levels[0]).ln())
        };
        let mut gains = vec![0.0];
        for square in squares {
            let gain = if square.is_finite() { gain(square) } else { 0.0 };
            gains.push(gains[gains.len() - 1] + gain);
        }
        Self { gains }
    }

    pub(super) fn len(&self) -> usize {
        self.gains.len()
    }

    /// First, likeliest and last place of the change, all of them within `places`.
    pub(super) fn place(&self, places: Range<usize>) -> [usize; 3] {
        self.likeliest(places, |at| self.gains[at])
    }

    pub(super) fn place_of_return(&self, places: Range<usize>) -> [usize; 3] {
        self.likeliest(places, |at| -self.gains[at])
    }

    fn likeliest(&self, places: Range<usize>, gain: impl Fn(usize) -> f64) -> [usize; 3] {
        let likeliest = places.clone().max_by(|a, b| gain(*a).total_cmp(&gain(*b))).unwrap_or(places.start);
        let mut possible = places.filter(|at| gain(*at) > gain(likeliest) - LIKELIHOOD_LOSS);
        let first = possible.next().unwrap_or(likeliest);
        [first, likeliest, possible.last().unwrap_or(first)]
    }
}
