//! A rate ramp: the level moves at a constant pace from the first sample to the last.
//!
//! On the Allan curve a ramp shows at the longest averaging times only, where nothing is certain. Here it is judged on
//! means of stretches of the record, as a [step](super::bias_step) is: by the likelihood ratio under noise whose mixture
//! is free with the ramp and without, and against every other cause.

use super::bias_step;
use super::block::{BLOCKS, Blocks, Whitening, residual, size};
use super::normal::{NORMAL_975, upper_tail};
use super::{Finding, Repair, SIGNIFICANCE, Series, effect, parameter};

/// What the free mixture of the noise may gain from a ramp that is none, in −2 ln likelihood.
pub(super) const NOISE_GAIN: f64 = 8.0;

/// Looks for a ramp in one channel. `causes` are other channels, of the same samples, that may move this one, and `known`
/// are courses that do: a cause, or a step.
#[must_use]
pub fn find(series: &Series, causes: &[&Series], known: &[&Series]) -> Option<Finding> {
    let blocks = Blocks::of(series)?;
    if blocks.numbers.len() < BLOCKS / 4 || blocks.means.iter().all(|mean| *mean == blocks.means[0]) {
        return None;
    }
    let noises = blocks.noises();
    let deviance = |noise: &Whitening, shapes: &[Vec<f64>]| noise.deviance(residual(noise, &blocks.means, shapes));
    let least = |shapes: &[Vec<f64>]| noises.iter().map(|noise| deviance(noise, shapes)).fold(f64::INFINITY, f64::min);
    let known: Option<Vec<Vec<f64>>> = known.iter().map(|course| Some(Blocks::of(course)?.means)).collect();
    let known = known?;
    let beside = |shape: Vec<f64>| known.iter().cloned().chain([shape]).collect::<Vec<_>>();
    let plain = least(&known);
    let slope: Vec<f64> = blocks.numbers.iter().map(|&number| number as f64).collect();
    let ramp = beside(slope.clone());
    let noise = noises.iter().min_by(|a, b| deviance(a, &ramp).total_cmp(&deviance(b, &ramp)))?;
    let gain = plain - deviance(noise, &ramp);
    let z = (gain - NOISE_GAIN).max(0.0).sqrt();
    let p_value = 2.0 * upper_tail(z);
    if p_value > SIGNIFICANCE {
        return None;
    }
    let same = causes.iter().filter(|cause| cause.slots == series.slots);
    let other = same.filter_map(|cause| Some(plain - least(&beside(Blocks::of(cause)?.means)))).fold(0.0, f64::max);
    // Where a step is known, another is not looked for.
    let step = if known.is_empty() { bias_step::gain(&blocks, &noises, plain) } else { 0.0 };
    if gain < other.max(step) {
        return None;
    }
    let (size, error) = size(&noises, &blocks.means, &slope, &known);
    let block_s = blocks.width as f64 * series.period_s;
    let (slope, half) = (size / block_s, NORMAL_975 * error / block_s);
    let evidence = format!(
        "the level moves by {slope:.3e} {}/s throughout, {z:.1} σ beyond what white, flicker and walking noise do; \
         warm-up that no sensor shows, or aging",
        series.unit,
    );
    let unit = format!("{}/s", series.unit);
    Some(Finding {
        effect: effect("rate_ramp", [("slope", parameter(slope, slope - half, slope + half, &unit))], evidence),
        deviance: gain,
        p_value,
        repair: Repair::Slope(slope * series.period_s),
    })
}
