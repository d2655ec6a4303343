//! Counts the instructions and the stack of a fit of N, B and K, of a trace of missing terms and of a covariate
//! regression, and prints them over semihosting, one per line.
#![no_std]
#![no_main]

mod emulator;

use allan_core::fit::{fit, fit_power_laws, goodness};
use allan_core::regression::{Covariate, CovariateRegression};
use allan_core::term::MovingAverageFilter;
use allan_core::trace::{LineCandidates, Trace, trace_while};
use allan_core::{Cascade, Coupling, Curve, Model, NoiseTerm};
use core::hint::black_box;
use cortex_m_rt::entry;
use cortex_m_semihosting::hprintln;

const OCTAVES: usize = 24;
/// Samples of a record of an hour and a half at 204.8 samples a second, whose curve has 20 points.
const SAMPLES: u32 = 1 << 20;
const SAMPLE_PERIOD: f64 = 1.0 / 204.8;
/// The filters that the trace tries, as in the firmware.
const FILTERS: [MovingAverageFilter; 10] = [
    MovingAverageFilter::bartlett(2),
    MovingAverageFilter::bartlett(4),
    MovingAverageFilter::bartlett(8),
    MovingAverageFilter::bartlett(16),
    MovingAverageFilter::bartlett(32),
    MovingAverageFilter::bartlett(64),
    MovingAverageFilter { stages: 2, taps: 8, decimation: 6.1 },
    MovingAverageFilter { stages: 2, taps: 8, decimation: 8.1 },
    MovingAverageFilter { stages: 2, taps: 8, decimation: 10.1 },
    MovingAverageFilter { stages: 2, taps: 8, decimation: 12.1 },
];
/// The pairs of a channel and two covariates, by index.
const PAIRS: [(usize, usize); 3] = [(0, 1), (0, 2), (1, 2)];
/// The curve of a gyro at rest with white noise, a random walk, and a square wave of 0.5 s with the amplitude `tone`.
fn record(tone: i32) -> Curve<OCTAVES> {
    let mut state = 1_u64;
    let mut uniform = || {
        state = state * 16_807 % 2_147_483_647;
        (state % 41) as i32 - 20
    };
    let mut cascade = Cascade::<OCTAVES, 8>::new();
    let mut walk = 0;
    for at in 0..SAMPLES {
        walk += uniform() * 2;
        let level = if at / 51 % 2 == 0 { tone } else { -tone };
        cascade.push((uniform() + uniform() + uniform()) * 10 + walk / 10 + level);
    }
    cascade.curve(SAMPLE_PERIOD)
}

#[entry]
fn main() -> ! {
    emulator::start();
    let quiet = black_box(record(0));
    let with_tone = black_box(record(100));
    let mut model = Model::new(SAMPLE_PERIOD, []);
    measure("fit", || model = black_box(fit(&quiet, &NoiseTerm::BASELINE)));
    measure("fit_power_laws", || _ = black_box(fit_power_laws(&quiet, &NoiseTerm::BASELINE)));
    measure("goodness", || _ = black_box(goodness(&quiet, &model)));
    // The result is outside of the measured stack, as in the firmware.
    let mut result = Trace::empty();
    let mut traced = |curve| {
        result.fit_baseline(curve);
        assert!(
            trace_while(&mut result, curve, LineCandidates::Curve, &FILTERS, &mut || true),
            "a trace that is not cancelled"
        );
        result.added.len()
    };
    let mut added = [0; 2];
    measure("trace_nothing", || added[0] = black_box(traced(&quiet)));
    measure("trace_tone", || added[1] = black_box(traced(&with_tone)));
    assert!(added == [0, 2], "{added:?} terms added");
    sensitivities();
    emulator::success()
}

/// Counts the regression of a channel that follows the first of two random walks on both.
fn sensitivities() {
    let mut state = 1_u64;
    let mut uniform = || {
        state = state * 16_807 % 2_147_483_647;
        (state % 41) as i32 - 20
    };
    let mut cascades = [const { Cascade::<OCTAVES, 8>::new() }; 3];
    let mut couplings = [const { Coupling::<OCTAVES>::new() }; 3];
    let mut walks = [0; 2];
    for _ in 0..SAMPLES / 4 {
        walks.iter_mut().for_each(|walk| *walk += uniform());
        let [first, second] = walks;
        cascades[0].push((uniform() + uniform() + uniform()) * 10 + first / 4);
        cascades[1].push(first / 2);
        cascades[2].push(second / 2);
        for (coupling, (a, b)) in couplings.iter_mut().zip(PAIRS) {
            coupling.observe(&cascades[a], &cascades[b]);
        }
    }
    let [channel, first, second] = cascades.each_ref().map(|cascade| cascade.curve(SAMPLE_PERIOD));
    let covariates: [Covariate<OCTAVES>; 2] = [&first, &second].map(|curve| Covariate::new(curve, 1.0, 1));
    let points = couplings.each_ref().map(Coupling::points);
    let covariance = |with: Option<usize>, covariate: usize, n: u64| {
        let (a, b) = (with.map_or(0, |other| other + 1), covariate + 1);
        let pair = PAIRS.iter().position(|&pair| pair == (a.min(b), a.max(b)))?;
        points[pair].iter().find(|point| point.n == n).map(|point| point.covariance)
    };
    let regression = CovariateRegression { channel: &channel, covariates: &covariates, covariance: &covariance };
    let mut estimates = Default::default();
    measure("sensitivities", || estimates = black_box(regression.sensitivities()));
    assert!(estimates.iter().map(|estimate| estimate.covariate).eq([0]), "{estimates:?}");
}

fn measure(name: &str, work: impl FnOnce()) {
    let mut count = 0;
    let stack = emulator::stack_bytes(|| count = emulator::instructions(work));
    hprintln!("count {} {}", name, count);
    hprintln!("bytes {}_stack {}", name, stack);
}
