//! From simulated gyro counts to the Allan deviation, the fitted coefficients and the missing terms.
//!
//! `cargo run -p allan-core --example characterise`

use allan_core::fit::{fit, goodness};
use allan_core::trace::{LineCandidates, trace};
use allan_core::{Cascade, NoiseTerm};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Seconds between samples.
const PERIOD: f64 = 0.01;
/// deg/s per count.
const LSB: f64 = 0.001;
/// Simulated N in deg/√s and K in deg/s/√s, and a sinusoid of this amplitude in deg/s and frequency in Hz.
const N: f64 = 0.02;
const K: f64 = 0.003;
const LINE: (f64, f64) = (0.03, 1.7);

fn main() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
    let mut cascade = Cascade::<20, 8>::new();
    let mut walk = 0.0;
    for k in 0..360_000 {
        walk += K * PERIOD.sqrt() * normal();
        let line = LINE.0 * (std::f64::consts::TAU * LINE.1 * f64::from(k) * PERIOD).sin();
        let rate = N / PERIOD.sqrt() * normal() + walk + line;
        cascade.push((rate / LSB).round() as i32);
    }

    let curve = cascade.curve(PERIOD).scaled(LSB);
    println!("{} samples in an estimator of {} bytes\n", cascade.len(), Cascade::<20, 8>::memory());
    println!("{:>10} {:>12} {:>25} {:>9}", "tau, s", "sigma, deg/s", "95 % bounds", "edf");
    for point in curve.points() {
        let (low, high) = (point.low.sqrt(), point.high.sqrt());
        println!("{:>10.2} {:>12.6} {low:>12.6} {high:>12.6} {:>9.1}", point.tau, point.avar.sqrt(), point.edf);
    }

    let baseline = fit(&curve, &NoiseTerm::BASELINE);
    println!("\nN, B, K: p = {:.2e}", goodness(&curve, &baseline).p_value);
    for term in baseline.terms() {
        println!("{:>20} {:.5} ({:.5} … {:.5})", term.kind.name(), term.value, term.low, term.high);
    }

    let traced = trace(&curve, LineCandidates::Curve, &[]);
    println!("\nwith {} added: p = {:.2}", traced.added.len(), traced.after_goodness.p_value);
    for term in traced.after.terms() {
        print!("{:>20} {:.5} ({:.5} … {:.5})", term.kind.name(), term.value, term.low, term.high);
        for (name, value) in term.kind.shape().named() {
            print!(", {name} {value:.4}");
        }
        println!();
    }
}
