//! The sine of least squares at a frequency between the ordinates, under the periodogram's taper.

use super::periodogram::taper;
use crate::grid::Grid;
use std::f64::consts::TAU;

/// A rotating phasor loses about one bit in a thousand steps; it is set anew this often.
const STEPS: usize = 512;

/// `cosine·cos(2πft) + sine·sin(2πft)`, with `t` from the first sample.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sine {
    pub frequency: f64,
    cosine: f64,
    sine: f64,
    /// `|Σwye^(−2πift)|²/Σw²`
    power: f64,
}

impl Sine {
    /// The best sine near `frequency`, in Hz, which is off by at most half of `spacing`.
    pub(super) fn near(grid: &Grid, frequency: f64, spacing: f64) -> Self {
        let mut best = Self::at(grid, frequency);
        // The summit of the parabola through three points, ever closer together.
        for step in [0.3 * spacing, 0.1 * spacing, 0.03 * spacing] {
            let [left, right] = [-step, step].map(|offset| Self::at(grid, best.frequency + offset).power);
            let curvature = 2.0 * best.power - left - right;
            let shift =
                if curvature > 0.0 { (0.5 * step * (right - left) / curvature).clamp(-step, step) } else { 0.0 };
            let summit = Self::at(grid, best.frequency + shift);
            if summit.power > best.power {
                best = summit;
            }
        }
        best
    }

    /// The sine of least squares at a frequency.
    fn at(grid: &Grid, frequency: f64) -> Self {
        let (mut cc, mut ss, mut cs, mut yc, mut ys, mut weights) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        let length = grid.values().len();
        each(grid, frequency, |at, value, cosine, sine| {
            if value.is_finite() {
                let weight = taper(at, length);
                cc += weight * cosine * cosine;
                ss += weight * sine * sine;
                cs += weight * cosine * sine;
                yc += weight * value * cosine;
                ys += weight * value * sine;
                weights += weight * weight;
            }
        });
        let determinant = cc * ss - cs * cs;
        if determinant <= 0.0 {
            return Self { frequency, cosine: 0.0, sine: 0.0, power: 0.0 };
        }
        let (cosine, sine) = ((yc * ss - ys * cs) / determinant, (ys * cc - yc * cs) / determinant);
        Self { frequency, cosine, sine, power: (yc * yc + ys * ys) / weights }
    }

    pub(super) fn amplitude(&self) -> f64 {
        self.cosine.hypot(self.sine)
    }

    /// As the ordinate of a periodogram at the sine's own frequency, unit²/Hz.
    pub(super) fn density(&self, grid: &Grid) -> f64 {
        2.0 * self.power * grid.sample_period()
    }

    /// The grid without the sine.
    pub(super) fn taken_from(&self, grid: &Grid) -> Grid {
        let mut values = Vec::with_capacity(grid.values().len());
        each(grid, self.frequency, |_, value, cosine, sine| {
            values.push(value - self.cosine * cosine - self.sine * sine);
        });
        Grid::new(grid.sample_period(), values)
    }
}

fn each(grid: &Grid, frequency: f64, mut visit: impl FnMut(usize, f64, f64, f64)) {
    let turn = frequency * grid.sample_period();
    let (step_sine, step_cosine) = (TAU * turn).sin_cos();
    for (block, values) in grid.values().chunks(STEPS).enumerate() {
        // The whole turns are dropped first: the rest keeps its digits.
        let (mut sine, mut cosine) = (TAU * (turn * (block * STEPS) as f64).fract()).sin_cos();
        for (at, value) in values.iter().enumerate() {
            visit(block * STEPS + at, *value, cosine, sine);
            (cosine, sine) = (cosine * step_cosine - sine * step_sine, sine * step_cosine + cosine * step_sine);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sine_between_two_ordinates_is_found_and_taken_away() {
        let values =
            (0..10_000).map(|at| if at % 11 == 5 { f64::NAN } else { 3.0 * (TAU * 0.123_456 * f64::from(at)).cos() });
        let grid = Grid::new(1.0, values.collect());
        let sine = Sine::near(&grid, 0.123_475, 5e-5);
        assert!((sine.frequency - 0.123_456).abs() < 1e-8, "{}", sine.frequency);
        assert!((sine.amplitude() - 3.0).abs() < 1e-4);
        let rest = sine.taken_from(&grid);
        assert!(rest.values().iter().filter(|value| value.is_finite()).all(|value| value.abs() < 1e-3));
        // An ordinate of M samples without a taper is A²·M·dt/2; a Tukey window over a tenth keeps (1 − 0.05)²/(1 − 0.0625).
        let ordinate = 9.0 * grid.present() as f64 / 2.0 * 0.95 * 0.95 / 0.9375;
        assert!((sine.density(&grid) / ordinate - 1.0).abs() < 1e-3);
    }
}
