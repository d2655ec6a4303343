//! The gate against gross errors: single samples that the noise of their channel does not explain, such as those with a flipped
//! bit. The sensor sends no checksum, and one flipped bit in a million raises the variance of a gyro's noise by a fifth.
//!
//! A sample is refused if it differs from the last one used by more than seven times the rms of such differences, unless it agrees
//! with two that were refused just before: a step costs two samples. A channel has eight refusals at once and then one in sixteen
//! samples, so that motion, which goes on, does not end the sampling. What exceeds the limit and is used for lack of a refusal
//! counts as noise, and the limit follows.
//!
//! **The first block.** From 32 samples, of which none is used, the gate learns the noise: the 28 smallest of 32 squared normal
//! numbers hold half of their sum (0.498), and the four largest have room for two gross errors, as each makes two differences.
//! Blocks of 64 and 128 judged samples replace this estimate, and those of 256 take a quarter of the weight each.
//!
//! The probability of false alarms, and what passes, are derived at the tests.

use crate::channels::{CHANNELS, ChannelSet};

/// Samples from which the gate learns the noise before it judges any.
pub(crate) const FIRST_BLOCK: u32 = 32;
/// Samples between two estimates of the noise once it is known. With 256 the sum of squares of a block is its mean in 1/256
/// counts².
const BLOCK: u32 = 256;
/// Differences of the first block that are left out of its estimate, as they may be those of gross errors.
const LEFT_OUT: usize = 4;
/// The sum of squares of the first block over that without those left out, for a normal distribution.
const NORMAL_SHARE: u32 = 2;
/// Limit in rms differences.
const WIDTH: u32 = 7;
/// What the limit is wider by, in counts: two samples are rounded by half a count each, and so is the limit.
const ROUNDING: u32 = 3;
/// Refused samples in a row that agree, after which the next one that agrees is used: a step. With one, two damaged bursts in a row, 75 in an hour
/// where one in a hundred is damaged, would confirm each other.
const AGREEING: u32 = 2;
/// Samples that give a channel one more refusal.
const SPACING: u64 = 16;
/// Refusals that a channel has at once.
const REFUSALS: u64 = 8;

/// The gate of one channel.
#[derive(Debug, Clone, Copy)]
struct ChannelGate {
    /// The last sample that was used.
    last: i32,
    /// Largest difference that noise explains, in counts.
    limit: i32,
    /// Sum of the squared differences of this block, counts².
    sum: u32,
    /// Mean squared difference in 1/256 counts².
    noise: u32,
    /// The latest sample beyond the limit, and its number.
    beyond: (i32, u64),
    /// Samples in a row up to this one that agree.
    agreeing: u32,
    /// Number of the sample at which all refusals are available again.
    full_at: u64,
    /// Largest squared differences of the first block, the largest first, counts².
    left_out: [u32; LEFT_OUT],
}

/// The gates of all channels. With another width than that of the device the rate of false alarms can be measured.
#[derive(Debug, Clone, Copy)]
pub(crate) struct GrossErrorGate<const W: u32 = WIDTH> {
    channels: [ChannelGate; CHANNELS.len()],
    samples: u64,
    /// Length of the running block, and what is left of it.
    block: u32,
    left: u32,
}

impl<const W: u32> GrossErrorGate<W> {
    /// A gate that knows nothing of the noise: it [learns](Self::is_learning) from the first block.
    pub(crate) const fn new() -> Self {
        let channel = ChannelGate {
            last: 0,
            limit: 0,
            sum: 0,
            noise: 0,
            beyond: (0, 0),
            agreeing: 0,
            full_at: 0,
            left_out: [0; LEFT_OUT],
        };
        Self { channels: [channel; CHANNELS.len()], samples: 0, block: FIRST_BLOCK, left: FIRST_BLOCK }
    }

    /// Whether the next samples belong to the first block, of which none is refused.
    pub(crate) const fn is_learning(&self) -> bool {
        self.block == FIRST_BLOCK
    }

    /// Takes the level of samples that are not to be used: what comes next is compared with it. A first block begins anew.
    pub(crate) fn follow(&mut self, counts: &[i32; CHANNELS.len()]) {
        if self.is_learning() {
            *self = Self::new();
        }
        for (channel, &count) in self.channels.iter_mut().zip(counts) {
            channel.last = count;
        }
    }

    /// The channels whose sample is a gross error; those that are `refused` anyway are left out.
    pub(crate) fn find(&mut self, counts: &[i32; CHANNELS.len()], refused: ChannelSet) -> ChannelSet {
        let mut gross = ChannelSet::EMPTY;
        self.samples += 1;
        if self.is_learning() {
            self.learn(counts);
            return gross;
        }
        let any_refused = !refused.is_empty();
        for (index, (channel, &count)) in self.channels.iter_mut().zip(counts).enumerate() {
            if any_refused && refused.contains(index) {
                continue;
            }
            let difference = count - channel.last;
            // Outside ±limit, in one comparison.
            if (difference + channel.limit) as u32 > 2 * channel.limit as u32 {
                gross.insert_if(index, channel.is_gross(count, self.samples));
                continue;
            }
            channel.last = count;
            // At most (2¹⁴)², as counts have 14 bits.
            channel.sum = channel.sum.saturating_add((difference * difference) as u32);
        }
        self.left -= 1;
        if self.left == 0 {
            self.end_block();
        }
        gross
    }

    /// Takes a sample of the first block. Not inlined: they are few.
    #[inline(never)]
    fn learn(&mut self, counts: &[i32; CHANNELS.len()]) {
        for (channel, &count) in self.channels.iter_mut().zip(counts) {
            channel.learn(count);
        }
        self.left -= 1;
        if self.left == 0 {
            self.end_block();
        }
    }

    /// Estimates the noise anew. Not inlined: it is needed once in a block.
    #[inline(never)]
    fn end_block(&mut self) {
        let (is_first, is_known) = (self.is_learning(), self.block == BLOCK);
        let to_mean = if is_first { NORMAL_SHARE } else { 1 } * (BLOCK / self.block.max(1)); // which cannot be 0
        let width = if is_first { 2 * W } else { W };
        for channel in &mut self.channels {
            let newest = core::mem::take(&mut channel.sum).saturating_mul(to_mean);
            channel.noise = if is_known { channel.noise - channel.noise / 4 + newest / 4 } else { newest };
            // The root is in 1/16 counts.
            channel.limit = ((width * channel.noise.isqrt()).div_ceil(16) + ROUNDING) as i32;
        }
        self.block = (2 * self.block).min(BLOCK);
        self.left = self.block;
    }
}

impl ChannelGate {
    fn learn(&mut self, count: i32) {
        let difference = count - core::mem::replace(&mut self.last, count);
        let mut square = (difference * difference) as u32;
        for left_out in &mut self.left_out {
            if square > *left_out {
                core::mem::swap(left_out, &mut square);
            }
        }
        self.sum = self.sum.saturating_add(square);
    }

    /// Whether a sample beyond the limit is to be refused. Not inlined: they are rare.
    #[inline(never)]
    fn is_gross(&mut self, count: i32, now: u64) -> bool {
        let (before, number) = core::mem::replace(&mut self.beyond, (count, now));
        let agrees = number + 1 == now && (count - before).abs() <= self.limit;
        self.agreeing = if agrees { self.agreeing.saturating_add(1) } else { 1 };
        let is_step = self.agreeing > AGREEING;
        if !is_step && self.full_at <= now + (REFUSALS - 1) * SPACING {
            self.full_at = self.full_at.max(now) + SPACING;
            return true;
        }
        let difference = count - core::mem::replace(&mut self.last, count);
        if !is_step {
            self.sum = self.sum.saturating_add((difference * difference) as u32);
        }
        false
    }
}

#[cfg(test)]
mod tests {
    //! **False alarms.** The rms is that of about 1,792 differences, which in white noise are correlated by −1/2 with their neighbours, so that
    //! its square has ν = 1,792/1.5 = 1,195 degrees of freedom. A difference over its estimated rms then has Student's distribution: beyond ±7
    //! it has a probability of 4·10⁻¹², one sample of eight channels at 819.2 samples a second in a year. Noise behind the sensor's filter has
    //! fewer degrees of freedom, ν = 1,792/N at least, and rounding to counts, for which the limit is three counts wider. The first estimate
    //! has ν = 17, and a limit twice as wide, beyond which are 3·10⁻¹² of the samples; the second has ν = 43, and beyond ±7 are 9·10⁻⁹, 10⁻⁵ of
    //! the 128 samples of eight channels that it judges. So one start in 100,000 costs a sample.
    //!
    //! **What passes.** Bit flips smaller than the limit are not detected: with a noise of 10 counts the lower 7 of 14 bits, whose flips add
    //! (4⁷ − 1)/3·10⁻⁶ = 0.005 counts² to a variance of 110 at a bit error rate of 10⁻⁶; one bit more in the 64 samples after the first
    //! block. A larger error passes if it repeats that of the sample before within the limit, or if it is the ninth within 128 samples.

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

    /// In the 64 samples after the first block the limit is twice as many rms differences, here four. Over 300,000 simulated first
    /// blocks (NumPy) the mean probability of a difference beyond it is 6.35e-4, and 5.9e-4 if the limit of 4·√2·100 counts is wider
    /// by 4 counts; the spacing of refusals takes 2 %. Four standard deviations.
    #[test]
    fn false_alarms_after_a_start_come_at_the_derived_rate() {
        let (starts, mut normal, mut found) = (2000, Normal(4), 0);
        for _ in 0..starts {
            let mut gate = GrossErrorGate::<2>::new();
            let mut noise = || core::array::from_fn(|_| (100.0 * normal.next()).round() as i32);
            gate.follow(&noise());
            for _ in 0..FIRST_BLOCK + 64 {
                found += gate.find(&noise(), ChannelSet::EMPTY).0.count_ones();
            }
        }
        let expected = 6.35e-4 * 64.0 * (starts * CHANNELS.len()) as f64;
        let bound = 4.0 * expected.sqrt();
        let found = f64::from(found);
        assert!((0.91 * expected - bound..expected + bound).contains(&found), "{found} of {expected}");
    }

    /// Eight errors at once, all different, are refused, and a ninth is used; later there is one refusal in sixteen samples.
    #[test]
    fn errors_in_a_row_are_refused_up_to_the_limit() {
        let (mut gate, mut normal) = (GrossErrorGate::<WIDTH>::new(), Normal(6));
        let mut find = |level: f64| {
            let counts = core::array::from_fn(|_| (level + 10.0 * normal.next()).round() as i32);
            gate.find(&counts, ChannelSet::EMPTY)
        };
        assert!((0..1000).all(|_| find(0.0) == ChannelSet::EMPTY));
        assert!((1..9).all(|k| find(500.0 * f64::from(k)) == ChannelSet::ALL));
        assert_eq!(find(-4000.0), ChannelSet::EMPTY, "no refusal is left");
        assert_eq!(find(0.0), ChannelSet::EMPTY, "back from it");
        assert!((0..200).all(|_| find(0.0) == ChannelSet::EMPTY));
        assert_eq!(find(500.0), ChannelSet::ALL);
        assert!((0..16).all(|_| find(0.0) == ChannelSet::EMPTY));
        assert_eq!(find(4000.0), ChannelSet::ALL);
    }

    /// Two gross errors of the first block are left out of its estimate: what it judges next is judged by the noise alone.
    #[test]
    fn errors_in_the_first_block_do_not_widen_the_limit() {
        let (mut gate, mut normal) = (GrossErrorGate::<WIDTH>::new(), Normal(7));
        let mut noise = |level: i32| core::array::from_fn(|_| level + (10.0 * normal.next()).round() as i32);
        gate.follow(&noise(0));
        for k in 0..FIRST_BLOCK {
            gate.find(&noise(if k == 5 || k == 20 { 4096 } else { 0 }), ChannelSet::EMPTY);
        }
        // 14 rms of 14 counts are 198; without the four left out of 32 the estimate is that of 28 of 28.
        assert!(gate.channels.iter().all(|channel| (80..400).contains(&channel.limit)), "{gate:?}");
        assert_eq!(gate.find(&noise(512), ChannelSet::EMPTY), ChannelSet::ALL);
    }

    /// Of four million samples 2e-5 false alarms are expected, whatever the noise, below one count too.
    #[test]
    fn no_sample_of_noise_is_refused() {
        for sigma in [0.1, 0.4, 3.0, 10.5, 300.0] {
            assert_eq!(refused::<WIDTH>(100_000, sigma), 0, "{sigma} counts");
        }
    }

    /// One sample is refused, and so are two that agree; a level that stays costs two samples.
    #[test]
    fn a_step_costs_two_samples_and_two_samples_are_refused() {
        let (mut gate, mut normal) = (GrossErrorGate::<WIDTH>::new(), Normal(2));
        let mut find = |level: f64| {
            let counts = core::array::from_fn(|_| (level + 10.0 * normal.next()).round() as i32);
            gate.find(&counts, ChannelSet::EMPTY)
        };
        assert!((0..1000).all(|_| find(0.0) == ChannelSet::EMPTY));
        for errors in [1, 2] {
            assert!((0..errors).all(|_| find(-4096.0) == ChannelSet::ALL));
            assert!((0..100).all(|_| find(0.0) == ChannelSet::EMPTY));
        }
        assert!((0..2).all(|_| find(1000.0) == ChannelSet::ALL));
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
