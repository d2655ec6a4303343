//! A recording with hidden effects, drawn at random.
//!
//! Every recording has its own noise, a temperature and a supply that change, a host with a clock of its own, and now
//! and then a motion: what an estimator must not take for an effect, or take for the cause of one.

use super::kind::Kind;
use super::limit::spectrum::Record;
use super::place::Scene;
use super::size::hide;
use noise_analysis::trace::sample_clock::HOST_CLOCK;
use rand::seq::IndexedRandom;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use simulation::{HostClock, SAMPLE_RATE_HZ, Simulation};
use virtual_sensor::{Environment, NoiseModel, OutputRegister, SensorScenario};
use virtual_sensor::{Motion, SupplyProfile, TemperatureProfile};

/// Strength of a single effect: from undetectable to gross.
const STRENGTH: (f64, f64) = (0.3, 30.0);
/// Strength of each effect of a pair: all are to be found.
const STRENGTH_OF_PAIR: (f64, f64) = (2.0, 30.0);
/// Recordings with a motion that no effect needs, of all.
const MOVED: f64 = 0.2;
/// Mean delay of a host's time stamps, s.
const LATENCY_S: f64 = 50e-6;

/// A recording to be made, and the truth about it.
#[derive(Debug, Clone, PartialEq)]
pub struct Case {
    /// From which everything follows.
    pub seed: u64,
    /// What is hidden, in the order of the simulation's effects.
    pub kinds: Vec<Kind>,
    /// Size over the smallest that any test could see, effect by effect; see [`limit`](super::limit).
    pub strengths: Vec<f64>,
    /// What makes the recording.
    pub simulation: Simulation,
}

impl Case {
    /// Hides effects of `kinds` in a recording of `seconds` seconds.
    #[must_use]
    pub fn draw(kinds: &[Kind], seconds: f64, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(u64::MAX);
        let noise = noise(&mut random);
        let surroundings = surroundings(&mut random, kinds.contains(&Kind::Acceleration));
        let host =
            HostClock { latency_s: LATENCY_S, clock_ratio: 1.0 + HOST_CLOCK * random.sample::<f64, _>(StandardNormal) };
        let scene =
            Scene { noise: &noise, surroundings, record: Record { seconds, period_s: 1.0 / SAMPLE_RATE_HZ }, seed };
        // An accelerometer that moves shows nothing else.
        let channels = if surroundings.motion.deviation_g > 0.0 {
            &OutputRegister::INERTIAL[..3]
        } else {
            &OutputRegister::INERTIAL
        };
        let channel = |random: &mut ChaCha8Rng| channels.choose(random).copied().unwrap_or(OutputRegister::GyroX);
        // Two effects meet in one channel as often as not.
        let shared = random.random_bool(0.5).then(|| channel(&mut random));
        let channel = |random: &mut ChaCha8Rng| shared.unwrap_or_else(|| channel(random));
        let (range, at_least) = if kinds.len() > 1 { (STRENGTH_OF_PAIR, STRENGTH_OF_PAIR.0) } else { (STRENGTH, 0.0) };
        let (effects, strengths) = hide(kinds, range, at_least, &scene, channel, &mut random);
        let hidden = SensorScenario { environment: surroundings, effects };
        Self {
            seed,
            kinds: kinds.to_vec(),
            strengths,
            simulation: Simulation { seconds, seed, noise, scenario: hidden, host },
        }
    }

    /// Two different kinds.
    #[must_use]
    pub fn pair(seed: u64) -> [Kind; 2] {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(u64::MAX - 1);
        let first = random.random_range(0..Kind::ALL.len());
        let second = (first + random.random_range(1..Kind::ALL.len())) % Kind::ALL.len();
        [Kind::ALL[first], Kind::ALL[second]]
    }
}

/// Between `low` and `high`, each factor as likely as any other.
pub(super) fn log_uniform(random: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    low * (random.random::<f64>() * (high / low).ln()).exp()
}

/// The paper's noise, each coefficient of each channel between half of it and twice.
fn noise(random: &mut ChaCha8Rng) -> NoiseModel {
    let mut noise = NoiseModel::paper();
    for channel in OutputRegister::INERTIAL {
        let noise = noise.channel_mut(channel);
        noise.angle_random_walk *= log_uniform(random, 0.5, 2.0);
        noise.bias_instability *= log_uniform(random, 0.5, 2.0);
        noise.rate_random_walk *= log_uniform(random, 0.5, 2.0);
    }
    noise
}

fn surroundings(random: &mut ChaCha8Rng, moved: bool) -> Environment {
    let temperature = TemperatureProfile {
        rise_c: log_uniform(random, 2.0, 12.0),
        time_constant_s: log_uniform(random, 200.0, 1200.0),
        cycle_c: log_uniform(random, 0.3, 2.0),
        period_s: log_uniform(random, 400.0, 1500.0),
    };
    let supply = SupplyProfile {
        load_v: log_uniform(random, 0.02, 0.1),
        load_time_s: log_uniform(random, 10.0, 60.0),
        cycle_v: log_uniform(random, 0.01, 0.05),
        period_s: log_uniform(random, 200.0, 1500.0),
    };
    let moves = random.random_bool(MOVED) || moved;
    let motion = Motion {
        deviation_g: if moves { log_uniform(random, 0.03, 0.3) } else { 0.0 },
        time_constant_s: log_uniform(random, 1.0, 20.0),
    };
    Environment { temperature, supply, motion }
}
