//! Patterns of lost samples in a record.

use super::noise::RATE_HZ;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::fmt;
use std::ops::Range;

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LossPattern {
    /// Each sample is lost with this probability.
    Random(f64),
    /// 5 to 200 samples are lost every 1 to 5 minutes, uniformly distributed.
    Bursts,
}

impl LossPattern {
    pub const ALL: [Self; 5] =
        [Self::Random(0.0005), Self::Random(0.005), Self::Random(0.02), Self::Random(0.05), Self::Bursts];

    /// The lost samples; the first and the last sample of a record are kept.
    pub fn gaps(self, samples: usize, seed: u64) -> Vec<Range<usize>> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(1);
        let mut gaps: Vec<Range<usize>> = Vec::new();
        let mut at = 1;
        while at + 1 < samples {
            let (start, length) = match self {
                Self::Random(probability) => {
                    if !random.random_bool(probability) {
                        at += 1;
                        continue;
                    }
                    (at, 1)
                }
                Self::Bursts => {
                    let pause = random.random_range(60.0..300.0) * RATE_HZ;
                    (at + pause as usize, random.random_range(5..=200))
                }
            };
            if start + length >= samples {
                break;
            }
            match gaps.last_mut() {
                Some(last) if last.end == start => last.end += length,
                _ => gaps.push(start..start + length),
            }
            at = start + length;
        }
        gaps
    }
}

impl fmt::Display for LossPattern {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Random(probability) => write!(f, "{} % at random", 100.0 * probability),
            Self::Bursts => write!(f, "5 to 200 every 1 to 5 min"),
        }
    }
}
