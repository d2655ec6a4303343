//! An effect of a given strength: its size over the limit of its shape.

use super::draw::log_uniform;
use super::kind::Kind;
use super::limit::smallest;
use super::place::Scene;
use super::shape::{self, scaled, size};
use rand_chacha::ChaCha8Rng;
use virtual_sensor::{InjectedEffect, OutputRegister};

/// Largest quantum of an angle, in white angle steps of a sample: with coarser ones the error is not white.
const COARSEST: f64 = 1.0;
/// Largest part of the samples that is lost or repeated.
const MOST: f64 = 0.02;
/// Farthest that a clock is off.
const FARTHEST: f64 = 0.01;
/// Draws after which a set of effects is taken as it is.
const DRAWS: usize = 100;

/// Effects of these kinds, each in the channel that `channel` says, and their strengths: each over the smallest that
/// could be seen beside the others. They lie within `range` where a kind can be made as weak and as strong; with
/// `at_least`, effects that hide each other below that are drawn again.
pub(super) fn hide(
    kinds: &[Kind],
    range: (f64, f64),
    at_least: f64,
    scene: &Scene<'_>,
    channel: impl Fn(&mut ChaCha8Rng) -> OutputRegister,
    random: &mut ChaCha8Rng,
) -> (Vec<InjectedEffect>, Vec<f64>) {
    let mut hidden = (Vec::new(), Vec::new());
    for _ in 0..DRAWS {
        let mut effects: Vec<InjectedEffect> = Vec::new();
        for &kind in kinds {
            let channel = channel(random);
            let strength = log_uniform(random, range.0, range.1);
            let shape = shape::draw(kind, channel, scene, random);
            let limit = smallest(&shape, scene, &effects);
            effects.push(of_strength(shape, strength, limit, scene));
        }
        let strengths = (0..effects.len()).map(|at| strength(&effects, at, scene)).collect();
        hidden = (effects, strengths);
        if hidden.1.iter().all(|strength| *strength >= at_least) {
            break;
        }
    }
    hidden
}

/// Of the effect `at`, beside the others.
fn strength(effects: &[InjectedEffect], at: usize, scene: &Scene<'_>) -> f64 {
    let others: Vec<InjectedEffect> =
        effects.iter().enumerate().filter(|(other, _)| *other != at).map(|(_, effect)| effect.clone()).collect();
    size(&effects[at]) / smallest(&effects[at], scene, &others)
}

fn of_strength(shape: InjectedEffect, strength: f64, limit: f64, scene: &Scene<'_>) -> InjectedEffect {
    // Numbers of events scatter by their root: twice the sigmas is four times the number.
    let squared = strength * strength * limit;
    let size = match shape {
        InjectedEffect::Quantization { channel, .. } => {
            let white = scene.noise.channel(channel).angle_random_walk * scene.record.period_s.sqrt();
            (strength * limit).min(COARSEST * white / 12f64.sqrt())
        }
        InjectedEffect::DroppedSamples { .. } | InjectedEffect::RepeatedSamples { .. } => squared.min(MOST),
        InjectedEffect::SampleClock { .. } => squared.min(FARTHEST),
        _ => strength * limit,
    };
    scaled(shape, size)
}
