//! A line at half of the sample rate: an offset of every second sample, as of two converters that take turns.
//!
//! There a periodogram has one degree of freedom instead of two, and a sinusoid no phase. The coefficient is the mean of the halved
//! differences of two samples in a row, `½(x₀ − x₁), ½(x₂ − x₃), …`; its error is that of the means of blocks of them, whatever the
//! spectrum of the noise is there.

use super::whitened_spectrum::SpectralLine;
use crate::bounds::MeasuredValue;
use crate::distributions::student_tail;
use crate::effects::findings::SIGNIFICANCE;
use crate::samples::rounding::Rounding;
use crate::samples::uniform_series::UniformSeries;

/// Differences of a block.
const BLOCK: u32 = 64;
/// Fewest blocks, whose scatter tells the error to 9 %.
const FEWEST_BLOCKS: u64 = 64;

/// The mean of the differences between samples with even and with odd numbers.
#[derive(Debug, Clone, Default)]
pub(super) struct Alternation {
    /// The latest sample with an even number.
    even: Option<(u64, f64)>,
    /// Sum and number of the differences of the block.
    block: (f64, u32),
    blocks: u64,
    mean: f64,
    /// Sum of the squared distances of the means of the blocks from their mean.
    squares: f64,
}

impl Alternation {
    /// Of all samples of a series.
    pub(super) fn of(series: &UniformSeries) -> Self {
        let mut of = Self::default();
        let samples = (0..).zip(series.values()).filter(|(_, value)| value.is_finite());
        samples.for_each(|(number, value)| of.push(number, *value));
        of
    }

    /// Takes the sample of this number; one that is missing is passed over.
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

    /// The line, if the mean is larger than chance makes it in all but [`SIGNIFICANCE`] of the records. `duration` and `sample_period`
    /// are in s; samples that scatter less than their `rounding` show nothing.
    pub(super) fn line(&self, duration: f64, sample_period: f64, rounding: &Rounding) -> Option<SpectralLine> {
        let blocks = self.blocks as f64;
        // Of white noise the one-sided density is 2σ²τ₀, and the variance of the mean of n differences of two samples σ²/(2n).
        let of_rounding = rounding.density(0.5 / sample_period) / (2.0 * duration);
        let error = (self.squares / (blocks * (blocks - 1.0))).max(of_rounding).sqrt();
        let sigmas = self.mean.abs() / error;
        let p_value = 2.0 * student_tail(sigmas, blocks - 1.0);
        (self.blocks >= FEWEST_BLOCKS && error > 0.0 && p_value < SIGNIFICANCE).then(|| SpectralLine {
            // Within half a resolution on either side.
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

    /// 200 s at 100 Hz: a walk and white noise of deviation 1 through a mean of two with a part of each difference, and every second
    /// sample less by twice the `offset`; one sample in fifty is missing.
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
        // The noise has the deviation 0.7 − 0.3 at half of the sample rate, and the mean of 20,000 of it 0.0028, without a fiftieth of them
        // a hundredth more.
        let (offset, error) = (0.03, 0.0028);
        let mut sum = 0.0;
        for seed in 0..20 {
            let found = line(seed, offset).expect("eleven times its error");
            assert_eq!(found.frequency.value, 50.0);
            // The scatter of 156 blocks tells the error to 6 %; four times that.
            assert!((found.deviation.error / error - 1.0).abs() < 0.25, "{seed}: {found:?}");
            sum += ((found.deviation.value - offset) / error).powi(2);
        }
        // χ² of 20: beyond 45.3 with a probability of 0.001.
        assert!(sum < 45.3, "{sum}");
    }

    /// Of 2,000 records without an offset 0.04 are expected to show one; two or more have a probability of 8·10⁻⁴.
    #[test]
    fn noise_has_none() {
        let found = (0..2000).filter(|seed| line(*seed, 0.0).is_some()).count();
        assert!(found < 2, "{found}");
    }
}
