//! Rounding to counts that is no white noise.
//!
//! Behind a long filter of which every value is read, neighbouring samples differ by a small part of a count, and their rounding errors
//! by as little. For normal differences with a mean square of D(k) counts² at lag k, and a mean that is anywhere between two
//! counts, the errors have a covariance of
//!
//! ```text
//! r(k) = Σ exp(−2π²m²·D(k))/(2π²m²) counts², m = 1, 2, …
//! ```
//!
//! and are uncorrelated with the noise (A. B. Sripad, D. L. Snyder, IEEE Trans. ASSP 25, 1977). D(k) is found from the curve, an octave
//! after the other, as that with which the rounded samples have the measured Allan variance.

use crate::OCTAVES;
use crate::distributions::ROUNDING;
use allan_core::Curve;
use std::f64::consts::PI;

/// A channel is dithered if its Allan deviation exceeds the limit of the profile at any of the first octaves, this many.
/// Behind a filter neighbouring samples are correlated, so that the limit is exceeded only at longer averaging times.
pub(crate) const DITHERED_OCTAVES: usize = 7;
/// Least correlation of neighbouring rounding errors that is taken for one.
const CORRELATED: f64 = 0.1;
/// Mean square of a difference, counts², beyond which its rounding errors are uncorrelated to 0.2 %.
const UNCORRELATED: f64 = 0.3;
/// Mean square of a difference, counts², below which it reaches over more than one count once in 10¹² times.
const WITHIN_A_COUNT: f64 = 0.02;
/// Terms of the sum: the next one is below 10⁻⁷ counts² where differences are larger than that.
const HARMONICS: u32 = 5;
/// Frequencies at which the density is known; between them it is a straight line, to 0.2 % of errors that are correlated over 20 samples.
const DENSITIES: usize = 1025;
/// Mean squares between which a solution is sought, counts².
const SOUGHT: [f64; 2] = [1e-9, 1e3];
/// Halvings of that interval: to 10⁻⁹ of the value.
const HALVINGS: usize = 40;

/// Rounding errors that are correlated, or none.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct CorrelatedRounding {
    /// Covariances at lags of 1, 2, … samples, counts²; 0 beyond. Empty without correlated errors.
    covariances: Vec<f64>,
    /// Size of a count.
    resolution: f64,
    /// Two-sided densities at [`DENSITIES`] frequencies from 0 to half the sample rate, and seconds between samples.
    densities: Vec<f64>,
    period: f64,
}

/// The rounding errors of a series.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Rounding {
    /// Of this one-sided density, unit²/Hz; 0 where the values are not known to be rounded.
    White(f64),
    Correlated(CorrelatedRounding),
}

impl Rounding {
    /// One-sided density at a frequency in Hz, unit²/Hz.
    pub(crate) fn density(&self, frequency: f64) -> f64 {
        match self {
            Self::White(density) => *density,
            Self::Correlated(errors) => 2.0 * errors.density(frequency),
        }
    }
}

impl CorrelatedRounding {
    /// By a curve with counts of `resolution`. None where the errors of neighbouring samples are not correlated, and where those of samples
    /// far apart are: there the noise does not reach from one count to the next.
    pub(crate) fn of_curve(curve: &Curve<OCTAVES>, resolution: f64) -> Self {
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
            if n == 1 && covariance(solution) < CORRELATED * ROUNDING {
                break;
            }
            if solution > UNCORRELATED {
                return Self::new(squares.into_iter().map(covariance).collect(), resolution, curve.sample_period());
            }
        }
        Self::default()
    }

    /// With these covariances, of samples every `period` seconds.
    fn new(covariances: Vec<f64>, resolution: f64, period: f64) -> Self {
        let density = |at: usize| {
            let phase = PI * at as f64 / (DENSITIES - 1) as f64;
            let of_lag = |(lag, of): (i32, &f64)| 2.0 * of * (f64::from(lag) * phase).cos();
            period * resolution.powi(2) * (ROUNDING + (1..).zip(&covariances).map(of_lag).sum::<f64>())
        };
        let densities = (0..DENSITIES).map(density).collect();
        Self { covariances, resolution, densities, period }
    }

    /// Two-sided density at a frequency in Hz.
    fn density(&self, frequency: f64) -> f64 {
        let turns = frequency * self.period;
        let at = 2.0 * (turns - turns.round()).abs() * (DENSITIES - 1) as f64;
        let (below, part) = ((at as usize).min(DENSITIES - 2), at.fract());
        self.densities[below] + part * (self.densities[below + 1] - self.densities[below])
    }

    /// Whether there are none.
    pub(crate) fn is_none(&self) -> bool {
        self.covariances.is_empty()
    }

    /// A curve without these errors.
    pub(crate) fn subtracted_from(&self, mut curve: Curve<OCTAVES>) -> Curve<OCTAVES> {
        if !self.is_none() {
            curve.subtract_rounding(|n| self.avar(n));
        }
        curve
    }

    /// What correlated rounding adds to the Allan variance at the averaging factor `n`.
    pub(crate) fn avar(&self, n: u64) -> f64 {
        let correlated = (1..2 * n).zip(&self.covariances).map(|(lag, covariance)| 2.0 * share(n, lag) * covariance);
        self.resolution.powi(2) * (ROUNDING / n as f64 - correlated.sum::<f64>()).max(0.0)
    }
}

/// The mean square at `lag`, by a power law from `last`, that at lag `known`, to `square` at lag 2n − 1.
fn power_law(known: usize, last: Option<f64>, n: u64, square: f64, lag: usize) -> f64 {
    let Some(last) = last else { return square };
    let along = (lag as f64 / known as f64).ln() / ((2 * n - 1) as f64 / known as f64).ln();
    last * (square / last).powf(along)
}

/// Share of a lag below 2n in the Allan variance at the averaging factor `n`, which is the sum over all lags of this times the mean
/// square of the differences at that lag.
fn share(n: u64, lag: u64) -> f64 {
    let (n, lag) = (n as f64, lag as f64);
    let products = if lag < n { 3.0 * lag - 2.0 * n } else { 2.0 * n - lag };
    0.5 * products / (n * n)
}

/// What rounding adds to differences of this mean square, counts²: the mean distance where they cross at most one border of two
/// counts, which changes the rounded value by one count each time.
fn added(square: f64) -> f64 {
    if square < WITHIN_A_COUNT { (2.0 * square / PI).sqrt() - square } else { 2.0 * (ROUNDING - covariance(square)) }
}

/// Covariance of the rounding errors of two samples whose difference has this mean square, counts².
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

    /// White noise of `deviation` counts behind two averages over `taps` values, in 256ths of a count.
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

    /// The same noise with and without rounding, of 2.1, 0.9 and 0.8 counts behind the averages. What rounding adds to a measured curve
    /// is its variance and twice its covariance with the noise, whose expectation is 0: with as many independent
    /// differences as there are twice the averaging times, and no more than there are of 8 samples, over which the errors are correlated,
    /// four standard deviations of that are the tolerance, and 2 % for the power law between the octaves. At one sample,
    /// where the rounded noise has up to thirteen times the variance of the unrounded one, that is found to 5 %.
    #[test]
    fn the_rounding_of_slow_noise_is_that_of_the_same_noise_unrounded() {
        for (taps, deviation) in [(64, 21.0), (32, 6.0), (16, 4.0)] {
            let fine = filtered(taps, deviation, 1);
            let exact = curve(fine.iter().copied(), 1.0 / 256.0);
            let rounded = curve(fine.iter().map(|value| (value + 128) >> 8), 1.0);
            let rounding = CorrelatedRounding::of_curve(&rounded, 1.0);
            assert!(!rounding.is_none(), "{taps} taps");
            for (exact, rounded) in exact.points().iter().zip(rounded.points()).take(9) {
                let (added, found) = (rounded.avar - exact.avar, rounding.avar(exact.n));
                let independent = SAMPLES as f64 / (2.0 * exact.n.max(8) as f64);
                let tolerance = 4.0 * 2.0 * (found * exact.avar / independent).sqrt() + 0.02 * found;
                assert!((added - found).abs() < tolerance, "{taps} taps, {}: {added}, {found}", exact.n);
                let left = (rounded.avar - found) / exact.avar - 1.0;
                assert!(exact.n > 1 || left.abs() < 0.05, "{taps} taps: {left}");
            }
        }
    }

    /// White noise of a count, which no filter makes slow, has no such errors; and none are told of noise below a count.
    #[test]
    fn white_noise_and_noise_below_a_count_have_none() {
        for deviation in [1.0, 0.1] {
            let rounded = curve(filtered(1, deviation, 1).into_iter().map(|value| (value + 128) >> 8), 1.0);
            assert!(CorrelatedRounding::of_curve(&rounded, 1.0).is_none(), "{deviation} counts");
        }
    }

    /// At long averaging times the Allan variance of a process with a short memory is its density at low frequencies over the averaging
    /// time, and the density of all frequencies together is the variance of the errors.
    #[test]
    fn the_density_is_that_of_the_allan_variance_and_of_the_variance() {
        let period = 0.01;
        let fine = filtered(32, 6.0, 1);
        let rounded = curve(fine.iter().map(|value| (value + 128) >> 8), 1.0);
        let covariances = CorrelatedRounding::of_curve(&rounded, 1.0).covariances;
        let errors = CorrelatedRounding::new(covariances, 0.5, period);
        let (long, low) = (errors.avar(1 << 16) * f64::from(1 << 16), errors.density(0.0) / period);
        assert!((long / low - 1.0).abs() < 2e-3, "{long} {low}");
        let mean = (0..1000).map(|at| errors.density((f64::from(at) + 0.5) * 0.05)).sum::<f64>() / 1000.0 / period;
        assert!((mean / (0.25 / 12.0) - 1.0).abs() < 1e-3, "{mean}");
    }

    /// Both forms are those of one sum: where they meet they agree.
    #[test]
    fn the_forms_of_the_covariance_meet() {
        let (below, above) = (covariance(WITHIN_A_COUNT * (1.0 - 1e-9)), covariance(WITHIN_A_COUNT));
        assert!((below - above).abs() < 1e-6, "{below} {above}");
        // Errors at no distance are the same error, that of a uniform distribution.
        assert!((covariance(0.0) - 1.0 / 12.0).abs() < 1e-12);
    }
}
