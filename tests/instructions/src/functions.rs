//! The functions of libm and micromath: instructions, and the bits of their results, which the host checks.

use crate::emulator::instructions;
use core::hint::black_box;
use cortex_m_semihosting::hprintln;
use micromath::F32Ext;

const VALUES: usize = 64;

pub(crate) fn count() {
    // The ranges are those of the arguments in the estimator, the intervals and the fit.
    let ratios = |k: f64| libm::exp2(k / 4.0 - 8.0); // 2⁻⁸ … 2⁸
    let exponents = |k: f64| k / 2.0 - 24.0; // −24 … 8
    let signed = |k: f64| k / 10.0 - 3.2; // ±3.2
    let shapes = |k: f64| 0.4 + k * k / 8.0; // 0.4 … 500
    compare("sqrt", ratios, libm::sqrt, Some(F32Ext::sqrt));
    compare("ln", ratios, libm::log, Some(F32Ext::ln));
    compare("log2", ratios, libm::log2, Some(F32Ext::log2));
    compare("exp", exponents, libm::exp, Some(F32Ext::exp));
    compare("expm1", exponents, libm::expm1, None);
    compare("floor", exponents, libm::floor, Some(F32Ext::floor));
    compare("abs", signed, libm::fabs, Some(F32Ext::abs));
    compare("ln_gamma", shapes, libm::lgamma, None);
}

/// Prints the result of each library for each argument, and the average instructions of a call.
fn compare(name: &str, argument: impl Fn(f64) -> f64, exact: fn(f64) -> f64, coarse: Option<fn(f32) -> f32>) {
    let arguments: [f64; VALUES] = core::array::from_fn(|k| argument(k as f64));
    let mut answers = arguments;
    let taken = instructions(|| answers.iter_mut().for_each(|value| *value = black_box(exact)(*value)));
    hprintln!("libm {} {}", name, taken / VALUES as u64);
    for (argument, answer) in arguments.iter().zip(answers) {
        hprintln!("libm {} {:016x} {:016x}", name, argument.to_bits(), answer.to_bits());
    }
    if let Some(coarse) = coarse {
        let mut answers = arguments.map(|value| value as f32);
        let taken = instructions(|| answers.iter_mut().for_each(|value| *value = black_box(coarse)(*value)));
        hprintln!("micromath {} {}", name, taken / VALUES as u64);
        for (argument, answer) in arguments.iter().zip(answers) {
            hprintln!("micromath {} {:016x} {:08x}", name, argument.to_bits(), answer.to_bits());
        }
    }
}
