//! A line at half of the sample rate: an offset of every second sample, as by two converters in turn.
//!
//! A periodogram has one degree of freedom there. The coefficient is the mean of `½(x₀ − x₁), ½(x₂ − x₃), …`; its error
//! is that of the means of blocks.

use super::spectral_line::SpectralLine;
use crate::bounds::MeasuredValue;
use crate::distributions::student_tail;
use crate::effects::findings::SIGNIFICANCE;
use crate::samples::rounding::Rounding;
use crate::samples::uniform_series::UniformSeries;

const BLOCK: u32 = 64;
/// Fewest blocks; their scatter tells the error to 9 %.
const FEWEST_BLOCKS: u64 = 64;

/// Mean difference between samples with even and with odd numbers.
#[derive(Debug, Clone, Default)]
pub(super) struct Alternation {
    even: Option<(u64, f64)>,
    /// Sum and number of the block's differences.
    block: (f64, u32),
    blocks: u64,
    mean: f64,
    /// Sum of squared distances of the block means from their mean.
    squares: f64,
}

impl Alternation {
    pub(super) fn of(series: &UniformSeries) -> Self {
        let mut of = Self::default();
        let samples = (0..).zip(series.values()).filter(|(_, value)| value.is_finite());
        samples.for_each(|(number, value)| of.push(number, *value));
        of
    }

    /// Takes the sample of this number; a missing one is skipped.
    pub(super) fn push(&mut self, number: u64, value: f64) {
        if number.is_multiple_of(2) {
            self.even = Some((number, value));
        } else if let Some((_, even)) = self.even.take().filter(|(of, _)| of + 1 == number) {
            self.block = (self.block.0 + 0.5 * (even - value), self.block.1 + 1);
            if self.block.1 == BLOCK {
                self.end_block();
            }
        }
    }

    fn end_block(&mut self) {
        let (sum, count) = std::mem::take(&mut self.block);
        self.blocks += 1;
        let distance = sum / f64::from(count) - self.mean;
        self.mean += distance / self.blocks as f64;
        self.squares += distance * (sum / f64::from(count) - self.mean);
    }

    /// The line, if significant by [`SIGNIFICANCE`] and above the `rounding`; `duration` and `sample_period` in s.
    pub(super) fn line(&self, duration: f64, sample_period: f64, rounding: &Rounding) -> Option<SpectralLine> {
        let blocks = self.blocks as f64;
        // White noise: one-sided density 2σ²τ₀, and variance σ²/(2n) of the mean of n differences.
        let of_rounding = rounding.density(0.5 / sample_period) / (2.0 * duration);
        let error = (self.squares / (blocks * (blocks - 1.0))).max(of_rounding).sqrt();
        let sigmas = self.mean.abs() / error;
        let p_value = 2.0 * student_tail(sigmas, blocks - 1.0);
        (self.blocks >= FEWEST_BLOCKS && error > 0.0 && p_value < SIGNIFICANCE).then(|| SpectralLine {
            // Half a resolution on either side.
            frequency: MeasuredValue { value: 0.5 / sample_period, error: 1.0 / (12.0_f64.sqrt() * duration) },
            deviation: MeasuredValue { value: self.mean.abs(), error },
            width: None,
            statistic: sigmas * sigmas,
            p_value,
            shape_p_value: 1.0,
            modulation: None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::Alternation;
    use crate::samples::rounding::Rounding;
    use crate::samples::uniform_series::UniformSeries;
    use crate::spectra::SpectralLine;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    /// 200 s at 100 Hz: a walk, white noise behind a filter, an alternating `offset`; one sample in fifty is missing.
    fn line(seed: u64, offset: f64) -> Option<SpectralLine> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let (mut walk, mut last) = (0.0, 0.0);
        let value = |at: u32| {
            walk += 0.1 * random.sample::<f64, _>(StandardNormal);
            let noise: f64 = random.sample(StandardNormal);
            let value = walk + 0.7 * noise + 0.3 * last + if at.is_multiple_of(2) { offset } else { -offset };
            last = noise;
            if at % 50 == 7 { f64::NAN } else { value }
        };
        let series = UniformSeries::new(0.01, (0..20_000).map(value).collect());
        Alternation::of(&series).line(series.duration(), series.sample_period(), &Rounding::default())
    }

    #[test]
    fn an_offset_of_every_second_sample_is_a_line_at_half_the_rate() {
        // Deviation 0.4 at half of the sample rate: 0.0028 for the mean of 20,000.
        let (offset, error) = (0.03, 0.0028);
        let mut sum = 0.0;
        for seed in 0..20 {
            let found = line(seed, offset).expect("eleven times its error");
            assert_eq!(found.frequency.value, 50.0);
            // 156 blocks tell the error to 6 %; four times that.
            assert!((found.deviation.error / error - 1.0).abs() < 0.25, "{seed}: {found:?}");
            sum += ((found.deviation.value - offset) / error).powi(2);
        }
        // χ² of 20: beyond 45.3 with a probability of 0.001.
        assert!(sum < 45.3, "{sum}");
    }

    /// For 2,000 records, two or more have a probability of 8·10⁻⁴.
    #[test]
    fn noise_has_none() {
        let found = (0..2000).filter(|seed| line(*seed, 0.0).is_some()).count();
        assert!(found < 2, "{found}");
    }
}
