//! A random walk that no part could have.
//!
//! Over a few correlation times a strong Markov process is a random walk: no curve tells them apart. The data sheet does:
//! a walk that in an hour goes farther than the bias of one part differs from that of another is bounded by something.

use crate::OCTAVES;
use allan_core::Curve;
use allan_core::fit::{fit_shapes, goodness};
use allan_core::model::FittedTerm;
use allan_core::term::{Markov, NoiseTerm};
use allan_core::trace::Trace;
use measurement::ChannelProfile;

const HOUR_S: f64 = 3600.0;
/// Part of the longest averaging time at which a correlation time is looked for first.
const FIRST: f64 = 0.25;
/// By how much the curve may be less like a process than like a walk, in −2 ln likelihood.
const AS_GOOD: f64 = 4.0;

/// A walk that goes too far.
pub(super) struct Unbounded {
    /// K, in the channel's unit.
    pub walk: FittedTerm,
    /// The process in its place.
    pub process: FittedTerm,
    /// How far K would take the bias in an hour, in initial bias errors.
    pub too_far: f64,
}

/// The process that is in the place of a walk in `channel`, if that walk goes too far.
pub(super) fn unbounded(curve: &Curve<OCTAVES>, trace: &Trace, channel: ChannelProfile) -> Option<Unbounded> {
    let model = &trace.after;
    let walk = *model.terms().iter().find(|term| term.kind == NoiseTerm::RateRandomWalk)?;
    let bias = channel.initial_bias_error?;
    let too_far = walk.low * HOUR_S.sqrt() / bias;
    if too_far <= 1.0 {
        return None;
    }
    let time_constant = FIRST * curve.points().last()?.tau;
    let others = model.terms().iter().map(|term| term.kind).filter(|kind| *kind != NoiseTerm::RateRandomWalk);
    let kinds: Vec<NoiseTerm> = others.chain([NoiseTerm::Markov(Markov { time_constant })]).collect();
    let bounded = fit_shapes(curve, &kinds);
    if goodness(curve, &bounded).deviance > trace.after_goodness.deviance + AS_GOOD {
        return None;
    }
    let process = *bounded.terms().last()?;
    Some(Unbounded { walk, process, too_far })
}

#[cfg(test)]
mod tests {
    use super::*;
    use allan_core::Cascade;
    use allan_core::trace::{LineCandidates, trace};
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    const PERIOD_S: f64 = 0.01;

    /// White noise of 1 deg/s and a process that forgets over `time_s` with steps of K = `walk` deg/s^1.5.
    fn found(walk: f64, time_s: f64) -> Option<Unbounded> {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let mut cascade = Cascade::<OCTAVES, { crate::OVERLAP }>::new();
        let (mut state, kept) = (0.0, (-PERIOD_S / time_s).exp());
        for _ in 0..40_000 {
            let mut normal = || random.sample::<f64, _>(StandardNormal);
            state = kept * state + walk * PERIOD_S.sqrt() * normal();
            cascade.push((1000.0 * (state + normal())) as i32);
        }
        let curve = cascade.curve(PERIOD_S).scaled(1e-3);
        unbounded(
            &curve,
            &trace(&curve, LineCandidates::Spectrum(&[]), &measurement::adis16405::profile(0.05).filters),
            measurement::adis16405::profile(0.05).channel("gyro_z").unwrap(),
        )
    }

    #[test]
    fn a_walk_is_bounded_where_the_data_sheet_says_so() {
        let found_there = found(2.0, 60.0).unwrap();
        assert!((found_there.walk.value / 2.0 - 1.0).abs() < 0.2, "{:?}", found_there.walk);
        assert!(
            (20.0..41.0).contains(&found_there.too_far),
            "2·√3600/3 = 40, less the interval: {}",
            found_there.too_far
        );
        // Any correlation time that is as long: σ²·2/τ = K² is all that the curve knows.
        let NoiseTerm::Markov(Markov { time_constant }) = found_there.process.kind else { panic!() };
        let walk = found_there.process.value * (2.0 / time_constant).sqrt();
        assert!((walk / 2.0 - 1.0).abs() < 0.2, "{:?}", found_there.process);
        assert!(found(0.02, 1e9).is_none(), "1.2 deg/s in an hour");
    }
}
