//! The errors of rounding to counts: white, or correlated behind a long filter whose every value is read.
//!
//! For normal differences with a mean square of D(k) counts² at lag k, their covariance is
//!
//! ```text
//! r(k) = Σ exp(−2π²m²·D(k))/(2π²m²) counts², m = 1, 2, …
//! ```
//!
//! uncorrelated with the noise (A. B. Sripad, D. L. Snyder, IEEE Trans. ASSP 25, 1977). D(k) follows from the curve, octave by octave.

use crate::OCTAVES;
use crate::distributions::ROUNDING;
use allan_core::{AllanPoint, Curve};
use std::f64::consts::PI;

/// First octaves, any of which may exceed the [limit](dithered_avar) in a dithered channel.
pub(crate) const DITHERED_OCTAVES: usize = 7;
/// Distance of two levels up to which they are neighbouring counts.
pub(crate) const NEIGHBOURING_COUNTS: f64 = 1.5;
/// Mean square of a difference, counts², beyond which errors are uncorrelated to 0.2 %.
const UNCORRELATED: f64 = 0.3;
/// Mean square of a difference, counts², that crosses more than one count once in 10¹² times.
const WITHIN_A_COUNT: f64 = 0.02;
/// Terms of the sum; the next one is below 10⁻⁷ counts².
const HARMONICS: u32 = 5;
/// Frequencies of the tabulated density; linear between them, to 0.2 %.
const DENSITIES: usize = 1025;
/// Bounds of the mean square, counts².
const SOUGHT: [f64; 2] = [1e-9, 1e3];
/// Bisections, to 10⁻⁹ of the value.
const HALVINGS: usize = 40;

#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Rounding {
    /// Size of a count; 0 if the values are not known to be rounded.
    resolution: f64,
    /// Sample period, s.
    period: f64,
    /// `None` if white.
    correlated: Option<Correlation>,
}

#[derive(Debug, Clone, PartialEq)]
struct Correlation {
    /// Covariances at lags of 1, 2, … samples, counts²; 0 beyond.
    covariances: Vec<f64>,
    /// Two-sided densities at [`DENSITIES`] frequencies from 0 to half the sample rate.
    densities: Vec<f64>,
}

impl Rounding {
    pub(crate) const fn white(resolution: f64, period: f64) -> Self {
        Self { resolution, period, correlated: None }
    }

    /// White if the errors of neighbours are uncorrelated, or if the noise stays below a count of `resolution`.
    pub(crate) fn of_curve(curve: &Curve<OCTAVES>, resolution: f64) -> Self {
        let white = Self::white(resolution, curve.sample_period());
        let correlated = squares(curve, resolution).map(|squares| {
            let covariances: Vec<f64> = squares.into_iter().map(covariance).collect();
            let densities = (0..DENSITIES).map(|at| white.two_sided(at, &covariances)).collect();
            Correlation { covariances, densities }
        });
        Self { correlated, ..white }
    }

    fn two_sided(&self, at: usize, covariances: &[f64]) -> f64 {
        let phase = PI * at as f64 / (DENSITIES - 1) as f64;
        let of_lag = |(lag, of): (i32, &f64)| 2.0 * of * (f64::from(lag) * phase).cos();
        self.period * self.resolution.powi(2) * (ROUNDING + (1..).zip(covariances).map(of_lag).sum::<f64>())
    }

    /// One-sided density, unit²/Hz, at a frequency in Hz.
    pub(crate) fn density(&self, frequency: f64) -> f64 {
        let Some(Correlation { densities, .. }) = &self.correlated else {
            return 2.0 * self.period * self.variance();
        };
        let turns = frequency * self.period;
        let at = 2.0 * (turns - turns.round()).abs() * (DENSITIES - 1) as f64;
        let (below, part) = ((at as usize).min(DENSITIES - 2), at.fract());
        2.0 * (densities[below] + part * (densities[below + 1] - densities[below]))
    }

    /// Variance, unit²; 0 if the values are not known to be rounded.
    pub(crate) fn variance(&self) -> f64 {
        ROUNDING * self.resolution.powi(2)
    }

    pub(crate) fn is_correlated(&self) -> bool {
        self.correlated.is_some()
    }

    /// A curve without correlated errors.
    pub(crate) fn subtracted_from(&self, mut curve: Curve<OCTAVES>) -> Curve<OCTAVES> {
        if self.is_correlated() {
            curve.subtract_rounding(|n| self.correlated_avar(n));
        }
        curve
    }

    /// Allan variance of correlated errors at the averaging factor `n`; 0 of white ones, which belong to white noise.
    pub(crate) fn correlated_avar(&self, n: u64) -> f64 {
        let Some(Correlation { covariances, .. }) = &self.correlated else { return 0.0 };
        let correlated = (1..2 * n).zip(covariances).map(|(lag, covariance)| 2.0 * share(n, lag) * covariance);
        self.resolution.powi(2) * (ROUNDING / n as f64 - correlated.sum::<f64>()).max(0.0)
    }
}

/// Least Allan variance, counts², of dithered means of `n` samples, if that of samples is `of_samples`.
pub(crate) fn dithered_avar(of_samples: f64, n: u64) -> f64 {
    of_samples - ROUNDING * (1.0 - 1.0 / n as f64)
}

/// True if the noise of the first `octaves` dithers counts of `resolution`; `of_samples` as in [`dithered_avar`].
pub(crate) fn is_dithered(curve: &Curve<OCTAVES>, resolution: f64, of_samples: f64, octaves: usize) -> bool {
    let exceeds = |at: &AllanPoint| at.avar > dithered_avar(of_samples, at.n) * resolution * resolution;
    curve.points().iter().take(octaves).any(exceeds)
}

/// Mean squares of differences at the lags of correlated errors, counts²; `None` if all lags are, or none.
fn squares(curve: &Curve<OCTAVES>, resolution: f64) -> Option<Vec<f64>> {
    let mut squares: Vec<f64> = Vec::new();
    let octaves = curve.points().iter().zip(0..DITHERED_OCTAVES);
    for (point, _) in octaves.take_while(|(point, octave)| point.n == 1 << octave && point.avar > 0.0) {
        let (n, known, measured) = (point.n, squares.len(), point.avar / resolution.powi(2));
        let last = squares.last().copied();
        let with = |square: f64| (known + 1..2 * n as usize).map(move |lag| power_law(known, last, n, square, lag));
        let avar = |square: f64| -> f64 {
            let all = squares.iter().copied().chain(with(square));
            (1_u64..).zip(all).map(|(lag, square)| share(n, lag) * (square + added(square))).sum()
        };
        let (mut low, mut high) = (SOUGHT[0].ln(), SOUGHT[1].ln());
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if avar(middle.exp()) < measured { low = middle } else { high = middle }
        }
        let solution = (0.5 * (low + high)).exp();
        let solved: Vec<f64> = with(solution).collect();
        squares.extend(solved);
        if solution > UNCORRELATED {
            return (n > 1).then_some(squares);
        }
    }
    None
}

/// Mean square at `lag`, on a power law from `last` at lag `known` to `square` at lag 2n − 1.
fn power_law(known: usize, last: Option<f64>, n: u64, square: f64, lag: usize) -> f64 {
    let Some(last) = last else { return square };
    let along = (lag as f64 / known as f64).ln() / ((2 * n - 1) as f64 / known as f64).ln();
    last * (square / last).powf(along)
}

/// Weight of the mean square at a lag below 2n in the Allan variance at the averaging factor `n`.
fn share(n: u64, lag: u64) -> f64 {
    let (n, lag) = (n as f64, lag as f64);
    let products = if lag < n { 3.0 * lag - 2.0 * n } else { 2.0 * n - lag };
    0.5 * products / (n * n)
}

/// Added mean square by rounding, counts², of differences that cross at most one border of two counts.
fn added(square: f64) -> f64 {
    if square < WITHIN_A_COUNT { (2.0 * square / PI).sqrt() - square } else { 2.0 * (ROUNDING - covariance(square)) }
}

/// Covariance of two rounding errors, by the mean square of the difference, counts².
fn covariance(square: f64) -> f64 {
    if square < WITHIN_A_COUNT {
        return ROUNDING - 0.5 * added(square);
    }
    let harmonic = |m: u32| {
        let exponent = 2.0 * (PI * f64::from(m)).powi(2);
        (-exponent * square).exp() / exponent
    };
    (1..=HARMONICS).map(harmonic).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::OVERLAP;
    use allan_core::Cascade;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const SAMPLES: usize = 1 << 19;

    /// White noise of `deviation` counts behind two averages over `taps` values, in 1/256 count.
    fn filtered(taps: usize, deviation: f64, seed: u64) -> Vec<i32> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = || -> f64 {
            let uniform: f64 = (0..12).map(|_| random.random::<f64>()).sum();
            uniform - 6.0
        };
        let mut values: Vec<f64> = (0..SAMPLES + 2 * taps - 2).map(|_| deviation * normal()).collect();
        for _ in 0..2 {
            values = values.windows(taps).map(|of| of.iter().sum::<f64>() / taps as f64).collect();
        }
        values.into_iter().map(|value| (256.0 * value).round() as i32).collect()
    }

    fn curve(values: impl Iterator<Item = i32>, unit: f64) -> Curve<OCTAVES> {
        let mut cascade = Cascade::<OCTAVES, OVERLAP>::new();
        values.for_each(|value| cascade.push(value));
        cascade.curve(1.0).scaled(unit)
    }

    /// Noise of 2.1, 0.9 and 0.8 counts behind the averages, with and without rounding. Tolerance: four standard deviations of twice the
    /// covariance of rounding and noise (errors correlate over 8 samples), and 2 % for the power law; 5 % at one sample.
    #[test]
    fn the_rounding_of_slow_noise_is_that_of_the_same_noise_unrounded() {
        for (taps, deviation) in [(64, 21.0), (32, 6.0), (16, 4.0)] {
            let fine = filtered(taps, deviation, 1);
            let exact = curve(fine.iter().copied(), 1.0 / 256.0);
            let rounded = curve(fine.iter().map(|value| (value + 128) >> 8), 1.0);
            let rounding = Rounding::of_curve(&rounded, 1.0);
            assert!(rounding.is_correlated(), "{taps} taps");
            for (exact, rounded) in exact.points().iter().zip(rounded.points()).take(9) {
                let (added, found) = (rounded.avar - exact.avar, rounding.correlated_avar(exact.n));
                let independent = SAMPLES as f64 / (2.0 * exact.n.max(8) as f64);
                let tolerance = 4.0 * 2.0 * (found * exact.avar / independent).sqrt() + 0.02 * found;
                assert!((added - found).abs() < tolerance, "{taps} taps, {}: {added}, {found}", exact.n);
                let left = (rounded.avar - found) / exact.avar - 1.0;
                assert!(exact.n > 1 || left.abs() < 0.05, "{taps} taps: {left}");
            }
        }
    }

    #[test]
    fn the_rounding_of_white_noise_and_of_noise_below_a_count_is_white() {
        for deviation in [1.0, 0.1] {
            let rounded = curve(filtered(1, deviation, 1).into_iter().map(|value| (value + 128) >> 8), 1.0);
            assert!(!Rounding::of_curve(&rounded, 1.0).is_correlated(), "{deviation} counts");
        }
    }

    #[test]
    fn the_density_is_that_of_the_allan_variance_and_of_the_variance() {
        let fine = filtered(32, 6.0, 1);
        let rounded = curve(fine.iter().map(|value| (value + 128) >> 8), 0.5);
        let errors = Rounding::of_curve(&rounded, 0.5);
        let (long, low) = (errors.correlated_avar(1 << 16) * f64::from(1 << 16), errors.density(0.0) / 2.0);
        assert!((long / low - 1.0).abs() < 2e-3, "{long} {low}");
        let mean = (0..1000).map(|at| errors.density((f64::from(at) + 0.5) * 5e-4)).sum::<f64>() / 1000.0 / 2.0;
        assert!((mean / (0.25 / 12.0) - 1.0).abs() < 1e-3, "{mean}");
    }

    #[test]
    fn the_forms_of_the_covariance_meet() {
        let (below, above) = (covariance(WITHIN_A_COUNT * (1.0 - 1e-9)), covariance(WITHIN_A_COUNT));
        assert!((below - above).abs() < 1e-6, "{below} {above}");
        // At distance 0: the variance of a uniform distribution.
        assert!((covariance(0.0) - 1.0 / 12.0).abs() < 1e-12);
    }
}
