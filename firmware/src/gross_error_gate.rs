//! The gate against gross errors, such as flipped bits. One error in a million samples raises a gyro's variance by a
//! fifth.
//!
//! A sample is refused if it differs from the last used one by more than seven times the rms difference, unless it
//! agrees with two refused ones (a step). After eight refusals only one sample in sixteen can be refused. The first 32
//! samples are not used: the 28 smallest of 32 squared normal numbers hold half of their sum (0.498).

use crate::channels::{CHANNELS, ChannelSet};

pub(crate) const FIRST_BLOCK: u32 = 32;
/// Samples between estimates; a sum of 256 squares is their mean in 1/256 counts².
const BLOCK: u32 = 256;
/// Largest number of gross errors in the first block.
const LEFT_OUT: usize = 4;
/// Ratio of a sum of squares to the sum without the largest [`LEFT_OUT`], in a normal distribution.
const NORMAL_SHARE: u32 = 2;
const WIDTH: u32 = 7;
/// Largest rounding of two samples and of the limit, counts.
const ROUNDING: u32 = 3;
/// Refused samples that must agree with a step; with one, two consecutive damaged bursts would confirm each other.
const AGREEING: u32 = 2;
const SPACING: u64 = 16;
const REFUSALS: u64 = 8;

#[derive(Debug, Clone, Copy, Default)]
struct ChannelGate {
    last: i32,
    limit: i32,
    sum: u32,
    /// Mean squared difference, 1/256 counts².
    noise: u32,
    /// Latest sample beyond the limit, and its number.
    beyond: (i32, u64),
    agreeing: u32,
    full_at: u64,
    /// The largest squared differences of the first block, largest first, counts².
    left_out: [u32; LEFT_OUT],
}

/// The gates of all channels. Other widths than [`WIDTH`] serve to measure false alarms.
#[derive(Debug, Clone, Copy)]
pub(crate) struct GrossErrorGate<const W: u32 = WIDTH> {
    channels: [ChannelGate; CHANNELS.len()],
    samples: u64,
    /// Length of the running block; `left` is its rest.
    block: u32,
    left: u32,
}

impl<const W: u32> GrossErrorGate<W> {
    /// A gate without a known noise: it [learns](Self::is_learning) first.
    pub(crate) fn new() -> Self {
        Self { channels: Default::default(), samples: 0, block: FIRST_BLOCK, left: FIRST_BLOCK }
    }

    /// True in the first block, whose samples are never refused.
    pub(crate) const fn is_learning(&self) -> bool {
        self.block == FIRST_BLOCK
    }

    /// Takes the level of unused samples for the next comparison, and restarts a first block.
    pub(crate) fn follow(&mut self, counts: &[i32; CHANNELS.len()]) {
        if self.is_learning() {
            *self = Self::new();
        }
        for (channel, &count) in self.channels.iter_mut().zip(counts) {
            channel.last = count;
        }
    }

    /// The channels with a gross error, without those already `refused`.
    pub(crate) fn find(&mut self, counts: &[i32; CHANNELS.len()], refused: ChannelSet) -> ChannelSet {
        let mut gross = ChannelSet::EMPTY;
        self.samples += 1;
        if self.is_learning() {
            self.learn(counts);
        } else {
            let any_refused = !refused.is_empty();
            for (index, (channel, &count)) in self.channels.iter_mut().zip(counts).enumerate() {
                if any_refused && refused.contains(index) {
                    continue;
                }
                let difference = count - channel.last;
                // One comparison finds differences outside ±limit.
                if (difference + channel.limit) as u32 > 2 * channel.limit as u32 {
                    gross.insert_if(index, channel.is_gross(count, self.samples));
                    continue;
                }
                channel.last = count;
                // A square is at most (2¹⁴)².
                channel.sum = channel.sum.saturating_add((difference * difference) as u32);
            }
        }
        self.left -= 1;
        if self.left == 0 {
            self.end_block();
        }
        gross
    }

    /// Learns from a sample. It is rare, and so not inlined.
    #[inline(never)]
    fn learn(&mut self, counts: &[i32; CHANNELS.len()]) {
        self.channels.iter_mut().zip(counts).for_each(|(channel, &count)| channel.learn(count));
    }

    #[inline(never)]
    fn end_block(&mut self) {
        let (is_first, is_known) = (self.is_learning(), self.block == BLOCK);
        let to_mean = if is_first { NORMAL_SHARE } else { 1 } * (BLOCK / self.block.max(1)); // a block is never 0
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
    //! False alarms: 1,792 differences have ν = 1,195 in white noise, and Student's probability beyond ±7 is 4·10⁻¹².
    //! This is one sample of eight channels at 819.2 Hz in a year; filtered noise has ν ≥ 1,792/N. One start in 100,000
    //! loses a sample (ν = 43: 9·10⁻⁹). Not detected: bit flips below the limit, larger errors that repeat, and a ninth
    //! error within 128 samples.

    extern crate std;

    use super::*;
    use std::f64::consts::TAU;

    /// Normal numbers by Box and Muller, from a linear congruential generator (Knuth's MMIX).
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

    fn refused<const W: u32>(samples: u32, sigma: f64) -> u32 {
        let (mut gate, mut normal, mut refused) = (GrossErrorGate::<W>::new(), Normal(1), 0);
        for _ in 0..samples {
            let counts = core::array::from_fn(|_| (sigma * normal.next()).round() as i32);
            refused += gate.find(&counts, ChannelSet::EMPTY).0.count_ones();
        }
        refused
    }

    /// Student's distribution has 6.7e-5 beyond four rms. Rounding takes up to 11 %; the bounds are four standard
    /// deviations.
    #[test]
    fn false_alarms_come_at_the_derived_rate() {
        let samples = 500_000;
        let expected = 6.7e-5 * f64::from(samples) * CHANNELS.len() as f64;
        let found = f64::from(refused::<4>(samples, 100.0));
        let bound = 4.0 * expected.sqrt();
        assert!((0.89 * expected - bound..expected + bound).contains(&found), "{found} of {expected}");
    }

    /// The limit is twice as wide. 300,000 simulated first blocks (NumPy) gave 6.35e-4; the bounds are four standard
    /// deviations.
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

    #[test]
    fn errors_in_the_first_block_do_not_widen_the_limit() {
        let (mut gate, mut normal) = (GrossErrorGate::<WIDTH>::new(), Normal(7));
        let mut noise = |level: i32| core::array::from_fn(|_| level + (10.0 * normal.next()).round() as i32);
        gate.follow(&noise(0));
        for k in 0..FIRST_BLOCK {
            gate.find(&noise(if k == 5 || k == 20 { 4096 } else { 0 }), ChannelSet::EMPTY);
        }
        // The limits are 14 rms: 198 counts for an rms of 14 counts, and twice that for 28.
        assert!(gate.channels.iter().all(|channel| (80..400).contains(&channel.limit)), "{gate:?}");
        assert_eq!(gate.find(&noise(512), ChannelSet::EMPTY), ChannelSet::ALL);
    }

    /// The expected number is 2e-5 in four million samples, also for noise below one count.
    #[test]
    fn no_sample_of_noise_is_refused() {
        for sigma in [0.1, 0.4, 3.0, 10.5, 300.0] {
            assert_eq!(refused::<WIDTH>(100_000, sigma), 0, "{sigma} counts");
        }
    }

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

    /// The sensor turns by 100 deg/s at 1 Hz and shakes by 300 deg/s at 20 Hz: at most one sample in seventeen is
    /// refused, none after five seconds.
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
