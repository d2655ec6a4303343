//! The gate against gross errors: single samples that the noise of their channel does not explain, such as those with a flipped
//! bit. The sensor sends no checksum, and one flipped bit in a million raises the variance of a gyro's noise by a fifth.
//!
//! A sample is refused if it differs from the one before by more than seven times the rms of such differences, and if the last
//! sixteen did not. The next sample is compared with the one before the refused one, and used in any case: a step costs one
//! sample, and motion, which goes on, no more than one in seventeen.
//!
//! **False alarms.** The rms is that of about 1,792 differences (blocks of 256, a quarter of the weight to the newest), which in
//! white noise are correlated by −1/2 with their neighbours, so that its square has ν = 1,792/1.5 = 1,195 degrees of freedom. A
//! difference over its estimated rms then has Student's distribution: beyond ±7 it has a probability of 4·10⁻¹², one sample of
//! eight channels at 819.2 samples a second in a year. Noise behind the sensor's filter has fewer degrees of freedom, ν = 1,792/N
//! at least, and rounding to counts, for which the limit is three counts wider.
//!
//! **What passes.** Of the flips of single bits those by less than the limit: with a noise of 10 counts the lower 7 of 14 bits, whose
//! flips add (4⁷ − 1)/3·10⁻⁶ = 0.005 counts² to a variance of 110 at a bit error rate of 10⁻⁶. Any passes in the first block, before the
//! noise is known, and in the sixteen samples that are not judged.

use crate::channels::{CHANNELS, ChannelSet};

/// Samples between two estimates of the noise. With 256 the sum of squares of a block is its mean in 1/256 counts².
const BLOCK: u64 = 256;
/// Limit in rms differences.
const WIDTH: u32 = 7;
/// What the limit is wider by, in counts: two samples are rounded by half a count each, and so is the limit.
const ROUNDING: u32 = 3;
/// A limit above every difference of counts, which have 14 bits.
const NO_LIMIT: i32 = 1 << 20;
/// Samples after one beyond the limit in which none is refused.
const CALM: u64 = 16;

/// The gate of one channel.
#[derive(Debug, Clone, Copy)]
struct ChannelGate {
    /// The last sample that was used.
    last: i32,
    /// Largest difference that noise explains, in counts.
    limit: i32,
    /// Sum of the squared differences of this block, counts².
    sum: u32,
    /// Mean squared difference in 1/256 counts²; `None` before the first block has ended.
    noise: Option<u32>,
    /// Number of the sample from which on one may be refused.
    armed_at: u64,
}

/// The gates of all channels. With another width than that of the device the rate of false alarms can be measured.
#[derive(Debug, Clone, Copy)]
pub(crate) struct GrossErrorGate<const W: u32 = WIDTH> {
    channels: [ChannelGate; CHANNELS.len()],
    samples: u64,
}

impl<const W: u32> GrossErrorGate<W> {
    /// A gate that knows nothing of the noise, and refuses nothing before the second block.
    pub(crate) const fn new() -> Self {
        let channel = ChannelGate { last: 0, limit: NO_LIMIT, sum: 0, noise: None, armed_at: BLOCK };
        Self { channels: [channel; CHANNELS.len()], samples: 0 }
    }

    /// The next samples may differ from those before for any reason.
    pub(crate) fn disarm(&mut self) {
        for channel in &mut self.channels {
            channel.armed_at = self.samples + CALM;
        }
    }

    /// The channels whose sample is a gross error; those that are `refused` anyway are left out.
    pub(crate) fn find(&mut self, counts: &[i32; CHANNELS.len()], refused: ChannelSet) -> ChannelSet {
        let mut gross = ChannelSet::EMPTY;
        self.samples += 1;
        let any_refused = !refused.is_empty();
        for (index, (channel, &count)) in self.channels.iter_mut().zip(counts).enumerate() {
            if any_refused && refused.contains(index) {
                continue;
            }
            let difference = count - channel.last;
            // Outside ±limit, in one comparison.
            if (difference + channel.limit) as u32 > 2 * channel.limit as u32 && channel.is_gross(self.samples) {
                gross.insert_if(index, true);
                continue;
            }
            channel.last = count;
            // At most (2¹⁴)², as counts have 14 bits.
            channel.sum = channel.sum.saturating_add((difference * difference) as u32);
        }
        if self.samples.is_multiple_of(BLOCK) {
            self.channels.iter_mut().for_each(ChannelGate::end_block::<W>);
        }
        gross
    }
}

impl ChannelGate {
    /// Whether a sample beyond the limit is to be refused. Not inlined: they are rare.
    #[inline(never)]
    fn is_gross(&mut self, now: u64) -> bool {
        let armed = now > self.armed_at;
        self.armed_at = now + CALM;
        armed
    }

    /// Estimates the noise anew. Not inlined: it is needed once in a block.
    #[inline(never)]
    fn end_block<const W: u32>(&mut self) {
        let newest = core::mem::take(&mut self.sum);
        let noise = self.noise.map_or(newest, |noise| noise - noise / 4 + newest / 4);
        self.noise = Some(noise);
        // The root is in 1/16 counts.
        self.limit = ((W * noise.isqrt()).div_ceil(16) + ROUNDING) as i32;
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use std::f64::consts::TAU;

    /// Normal random numbers by Box and Muller, from a linear congruential generator (Knuth's MMIX constants).
    struct Normal(u64);

    impl Normal {
        fn uniform(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((self.0 >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
        }

        fn next(&mut self) -> f64 {
            let radius = (-2.0 * self.uniform().ln()).sqrt();
            radius * (TAU * self.uniform()).cos()
        }
    }

    /// Refused samples of `samples` of white noise in every channel.
    fn refused<const W: u32>(samples: u32, sigma: f64) -> u32 {
        let (mut gate, mut normal, mut refused) = (GrossErrorGate::<W>::new(), Normal(1), 0);
        for _ in 0..samples {
            let counts = core::array::from_fn(|_| (sigma * normal.next()).round() as i32);
            refused += gate.find(&counts, ChannelSet::EMPTY).0.count_ones();
        }
        refused
    }

    /// Four rms differences have a probability of 6.7e-5 by Student's distribution with 1,195 degrees of freedom (6.33e-5 in the
    /// limit of many). The limit of 4·√2·100 counts is wider by at most 4 counts, 0.7 %, which takes up to 11 %; after a refused
    /// sample 16 are not, 0.1 %. Neighbouring differences share a sample, so a bound of four standard deviations is taken.
    #[test]
    fn false_alarms_come_at_the_derived_rate() {
        let samples = 500_000;
        let expected = 6.7e-5 * f64::from(samples) * CHANNELS.len() as f64;
        let found = f64::from(refused::<4>(samples, 100.0));
        let bound = 4.0 * expected.sqrt();
        assert!((0.89 * expected - bound..expected + bound).contains(&found), "{found} of {expected}");
    }

    /// Of four million samples 2e-5 false alarms are expected, whatever the noise, below one count too.
    #[test]
    fn no_sample_of_noise_is_refused() {
        for sigma in [0.1, 0.4, 3.0, 10.5, 300.0] {
            assert_eq!(refused::<WIDTH>(100_000, sigma), 0, "{sigma} counts");
        }
    }

    /// A single sample is refused, and a level that stays costs one sample.
    #[test]
    fn a_step_costs_one_sample_and_a_single_sample_is_refused() {
        let (mut gate, mut normal) = (GrossErrorGate::<WIDTH>::new(), Normal(2));
        let mut find = |level: f64| {
            let counts = core::array::from_fn(|_| (level + 10.0 * normal.next()).round() as i32);
            gate.find(&counts, ChannelSet::EMPTY)
        };
        assert!((0..1000).all(|_| find(0.0) == ChannelSet::EMPTY));
        assert_eq!(find(-4096.0), ChannelSet::ALL);
        assert!((0..100).all(|_| find(0.0) == ChannelSet::EMPTY));
        assert_eq!(find(1000.0), ChannelSet::ALL);
        assert!((0..100).all(|_| find(1000.0) == ChannelSet::EMPTY));
    }

    /// A part that is turned by hand, 100 deg/s at 1 Hz, and shaken, 300 deg/s at 20 Hz, both beginning at once: at most one sample in
    /// seventeen is refused, and after five seconds none.
    #[test]
    fn motion_costs_few_samples() {
        for (amplitude, frequency) in [(2000.0, 1.0), (6000.0, 20.0)] {
            let (mut gate, mut normal, mut first, mut later) = (GrossErrorGate::<WIDTH>::new(), Normal(3), 0, 0);
            for k in 0..20_000_u32 {
                let time_s = (f64::from(k) - 4000.0) / 204.8;
                let rate = if time_s > 0.0 { amplitude * (TAU * frequency * time_s).sin() } else { 0.0 };
                let counts = core::array::from_fn(|_| (rate + 10.0 * normal.next()).round() as i32);
                let refused = gate.find(&counts, ChannelSet::EMPTY).0.count_ones();
                if time_s < 5.0 { first += refused } else { later += refused }
            }
            assert!(first <= 8 * 1024 / 17 && later == 0, "{frequency} Hz: {first} and {later} refused");
        }
    }
}
