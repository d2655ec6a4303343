//! White noise behind a filter of the first order: N is the density below its corner, which the noise had before the filter.

use measurement::adis16405::profile;
use measurement::{MeasuredChannel, Measurement};
use noise_analysis::analysis::analyze;
use noise_analysis::bounds::BoundedEstimate;
use noise_analysis::report::assessment::sum_of_white_noise;
use noise_analysis::report::{ChannelReport, TermReport};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::collections::BTreeMap;

const RATE_HZ: f64 = 100.0;
/// Ten minutes.
const SAMPLES: usize = 60_000;
/// °/s a count.
const LSB: f64 = 0.05;
/// Deviation of the noise before the filter, counts: above any rounding behind it.
const NOISE: f64 = 200.0;

/// The channel of white noise behind `y += a·(x − y)`.
fn filtered(seed: u64, a: f64) -> ChannelReport {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut output = 0.0;
    let mut next = || {
        output += a * (NOISE * random.sample::<f64, _>(StandardNormal) - output);
        output.round() as i32
    };
    let profile = profile(LSB);
    let gyro = profile.channel("gyro_x").expect("a channel of the part");
    let measurement = Measurement {
        profile,
        sample_rate_hz: RATE_HZ,
        stated_rate_hz: Some(RATE_HZ),
        slots: (0..SAMPLES as u64).collect(),
        times_s: None,
        channels: vec![MeasuredChannel::new(gyro, (0..SAMPLES).map(|_| next()).collect())],
        dropped: BTreeMap::new(),
        flagged: BTreeMap::new(),
    };
    analyze(&measurement).channels.remove(0)
}

/// At frequencies far below its corner the filter passes all: N is that of the noise before it. Below a corner of 0.16 Hz ten minutes have 190
/// independent ordinates, which tell N to 3.6 %, and below one of 0.8 Hz 960, 1.6 %; a term that is fitted with it, such as B, may take several
/// times that.
#[test]
fn n_is_the_density_below_the_corner() {
    let truth = LSB * NOISE / RATE_HZ.sqrt();
    let mut held = 0;
    for (a, seeds, within) in [(0.5, 0..3, 0.1), (0.1, 10..13, 0.1), (0.05, 20..23, 0.1), (0.01, 30..33, 0.25)] {
        for seed in seeds {
            let channel = filtered(seed, a);
            let terms = channel.refitted.terms.iter().filter_map(TermReport::angle_random_walk);
            let parts = terms.map(|of| BoundedEstimate { value: of.value, low: of.low, high: of.high });
            let n = sum_of_white_noise(&parts.collect::<Vec<_>>());
            assert!((n.value / truth - 1.0).abs() < within, "{a}, seed {seed}: {n:?}, true {truth}");
            held += usize::from((n.low..=n.high).contains(&truth));
            let printed = &channel.assessment.coefficients[0];
            assert_eq!((printed.kind.as_str(), printed.value.value), ("angle_random_walk", n.value));
        }
    }
    // Fewer than nine of twelve 95 % intervals hold in one of 500 cases.
    assert!(held >= 9, "{held}");
}
