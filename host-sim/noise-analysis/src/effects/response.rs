//! The Allan variance of a bias that was computed from something measured.

/// The Allan variance of a bias over a record, at averaging times that are sample periods times powers of two.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ResponseVariance {
    /// Averaging time, s, and variance.
    octaves: Vec<(f64, f64)>,
}

impl ResponseVariance {
    /// The variance of a bias by its means over stretches of `width` periods of `period_s`; below the factor `width` it hardly changes.
    pub(crate) fn from_means(means: &[f64], width: u64, period_s: f64) -> Self {
        // The sum of the bias over the first sample periods, at the ends of the stretches.
        let mut sums = vec![0.0];
        for mean in means {
            sums.push(sums[sums.len() - 1] + mean * width as f64);
        }
        let sum_at = |slot: u64| {
            let (stretch, part) = ((slot / width) as usize, (slot % width) as f64 / width as f64);
            let next = sums[(stretch + 1).min(sums.len() - 1)];
            sums[stretch] + part * (next - sums[stretch])
        };
        let length = means.len() as u64 * width;
        let avar = |n: u64| {
            let starts = (0..=length - 2 * n).step_by(width as usize);
            let square = |start: u64| (sum_at(start + 2 * n) - 2.0 * sum_at(start + n) + sum_at(start)).powi(2);
            let (sum, count) = starts.fold((0.0, 0.0), |(sum, count), start| (sum + square(start), count + 1.0));
            // For means: half the mean square of their differences.
            sum / count / (2.0 * (n as f64).powi(2))
        };
        let factors = (0..u64::BITS).map(|octave| 1_u64 << octave).skip_while(|n| *n < width);
        Self { octaves: factors.take_while(|n| 2 * n <= length).map(|n| (n as f64 * period_s, avar(n))).collect() }
    }

    /// At the octave of the averaging time `tau_s`; 0 where it is not known.
    pub(crate) fn at(&self, tau_s: f64) -> f64 {
        let is_at = |of: f64| (of / tau_s).log2().round() == 0.0;
        self.octaves.iter().find(|(of, _)| is_at(*of)).map_or(0.0, |(_, avar)| *avar)
    }
}

#[cfg(test)]
mod tests {
    use super::ResponseVariance;
    use std::f64::consts::{PI, TAU};

    /// IEEE Std 952: a ramp of slope R has R²τ²/2, a sinusoid of amplitude A has A²·sin⁴x/x² with x = πfτ.
    #[test]
    fn a_ramp_and_a_sinusoid_have_their_closed_forms() {
        const WIDTH: u64 = 12;
        const PERIOD_S: f64 = 0.02;
        let means = |bias: &dyn Fn(f64) -> f64| -> Vec<f64> {
            (0..4096).map(|at| bias((f64::from(at) + 0.5) * WIDTH as f64)).collect()
        };
        let ramp = ResponseVariance::from_means(&means(&|slot| 1e-3 * slot), WIDTH, PERIOD_S);
        for octave in 6..14 {
            // Within a stretch the bias is taken as constant: 16 of the 64² sample periods² that the sum of a ramp moves by.
            let n = 1_u64 << octave;
            let expected = (1e-3 * n as f64).powi(2) / 2.0;
            assert!(
                (ramp.at(n as f64 * PERIOD_S) / expected - 1.0).abs() < 0.02,
                "{n}: {}",
                ramp.at(n as f64 * PERIOD_S)
            );
        }
        // 48 periods of 1,024 sample periods: half a period more or less is a hundredth of the mean.
        let frequency = 1.0 / 1024.0;
        let sine = ResponseVariance::from_means(&means(&|slot| 0.2 * (TAU * frequency * slot).sin()), WIDTH, PERIOD_S);
        for octave in 6..10 {
            let n = 1_u64 << octave;
            let x = PI * frequency * n as f64;
            let expected = (0.2 * x.sin().powi(2) / x).powi(2);
            assert!(
                (sine.at(n as f64 * PERIOD_S) / expected - 1.0).abs() < 0.03,
                "{n}: {} {expected}",
                sine.at(n as f64 * PERIOD_S)
            );
        }
        assert_eq!((ramp.at(8.0 * PERIOD_S), ramp.at(f64::from(1 << 20) * PERIOD_S)), (0.0, 0.0), "not known");
    }
}
