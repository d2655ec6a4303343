//! What it takes to get from a curve to coefficients, and to the terms that are missing: instructions and stack, said
//! over semihosting, a line each.
#![no_std]
#![no_main]

#[path = "../end.rs"]
mod end;
mod stack;
#[path = "../timer.rs"]
mod timer;

use allan_core::fit::{fit, goodness};
use allan_core::trace::{Lines, trace};
use allan_core::{Cascade, Curve, Kind};
use core::hint::black_box;
use cortex_m_rt::entry;
use cortex_m_semihosting::hprintln;

const OCTAVES: usize = 24;
/// An hour and a half at 204.8 samples a second: 20 points.
const SAMPLES: u32 = 1 << 20;
const SAMPLE_PERIOD: f64 = 1.0 / 204.8;

/// A gyro at rest: white noise and a random walk, and, if asked for, a square wave of half a second.
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
    timer::start();
    let quiet = black_box(record(0));
    let toned = black_box(record(100));
    measure("fit", || drop(black_box(fit(&quiet, &Kind::DECLARED))));
    let model = fit(&quiet, &Kind::DECLARED);
    measure("goodness", || _ = black_box(goodness(&quiet, &model)));
    measure("trace_nothing", || drop(black_box(trace(&quiet, Lines::InTheCurve))));
    let mut found = 0;
    measure("trace_tone", || found = black_box(trace(&toned, Lines::InTheCurve)).found.len());
    hprintln!("count found_tone {}", found);
    end::success()
}

fn measure(name: &str, work: impl FnOnce()) {
    let mut count = 0;
    let stack = stack::deepest(|| count = timer::instructions(work));
    hprintln!("count {} {}", name, count);
    hprintln!("bytes {}_stack {}", name, stack);
}
