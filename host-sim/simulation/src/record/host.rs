//! The host that reads the part: when it hears of a sample, by its own clock, and whether it hears at all.

use super::seconds;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::Exp1;
use virtual_sensor::effect::probability;

/// Random streams below this one belong to the part.
const STREAM: u64 = 1 << 32;

/// What a host makes of the data-ready pulses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Host {
    /// Mean of the exponentially distributed time from a pulse to its time stamp, s.
    pub latency_s: f64,
    /// Seconds that the host counts in a true second.
    pub clock_ratio: f64,
}

impl Default for Host {
    /// Reads the true time at once.
    fn default() -> Self {
        Self { latency_s: 0.0, clock_ratio: 1.0 }
    }
}

/// A host at work.
#[derive(Debug, Clone)]
pub(super) struct Reader {
    host: Host,
    missed_fraction: f64,
    random: ChaCha8Rng,
    latest_s: f64,
}

impl Reader {
    pub(super) fn new(host: Host, missed_fraction: f64, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(STREAM);
        Self { host, missed_fraction: probability(missed_fraction), random, latest_s: 0.0 }
    }

    /// The time stamp of the sample that was ready at `ready_ns`, s; `None` if the host misses it.
    pub(super) fn stamp(&mut self, ready_ns: u64) -> Option<f64> {
        if self.random.random_bool(self.missed_fraction) {
            return None;
        }
        let latency_s = if self.host.latency_s == 0.0 {
            0.0
        } else {
            let latency: f64 = self.random.sample(Exp1);
            self.host.latency_s * latency
        };
        let stamp_s = (seconds(ready_ns) + latency_s) * self.host.clock_ratio;
        // Samples queue: none overtakes the one before.
        self.latest_s = self.latest_s.max(stamp_s);
        Some(self.latest_s)
    }
}
