//! Slow drift of a channel: a random walk that the data sheet excludes, and drift that several channels have in common.

use crate::OCTAVES;
use crate::spectra::common_mode::{CommonModeDrift, CrossSpectra};
use crate::uniform_series::UniformSeries;
use allan_core::Curve;
use allan_core::fit::{fit_shapes, goodness};
use allan_core::model::FittedTerm;
use allan_core::term::{Markov, NoiseTerm};
use allan_core::trace::Trace;
use measurement::ChannelProfile;

const HOUR_S: f64 = 3600.0;
/// First correlation time that is tried, as a part of the longest averaging time.
const FIRST_CORRELATION_TIME: f64 = 0.25;
/// By how much the deviance of the Markov process may be larger than that of the random walk.
const MAX_DEVIANCE_RISE: f64 = 4.0;
/// Smallest gain in ln likelihood of a common-mode drift. Three channels can share a drift in 10 ways, each with a few
/// distinct correlation times; a gain of 9 in one of them leaves a probability of about 1 in 500 by chance.
const MIN_GAIN: f64 = 9.0;

/// A Markov process in the place of a random walk that goes too far.
pub(crate) struct BoundedDrift {
    /// The random walk: K in the channel's unit.
    pub walk: FittedTerm,
    /// The Markov process in its place.
    pub process: FittedTerm,
    /// How far the walk's lower bound takes the bias in an hour, in initial bias errors.
    pub bias_errors_per_hour: f64,
}

/// Fits a Markov process in the place of the random walk of a channel, if that walk goes farther in an hour than the
/// initial biases of two parts differ by the data sheet.
///
/// Over a few correlation times a strong Markov process has the Allan variance of a random walk, so the curve cannot tell
/// them apart. `None` as well where the profile has no bias error, or the process fits worse.
pub(crate) fn bounded_drift(curve: &Curve<OCTAVES>, trace: &Trace, channel: ChannelProfile) -> Option<BoundedDrift> {
    let model = &trace.after;
    let walk = *model.terms().iter().find(|term| term.kind == NoiseTerm::RateRandomWalk)?;
    let bias_errors_per_hour = walk.low * HOUR_S.sqrt() / channel.initial_bias_error?;
    if bias_errors_per_hour <= 1.0 {
        return None;
    }
    let time_constant = FIRST_CORRELATION_TIME * curve.points().last()?.tau;
    let others = model.terms().iter().map(|term| term.kind).filter(|kind| *kind != NoiseTerm::RateRandomWalk);
    let kinds: Vec<NoiseTerm> = others.chain([NoiseTerm::Markov(Markov { time_constant })]).collect();
    let bounded = fit_shapes(curve, &kinds);
    if goodness(curve, &bounded).deviance > trace.after_goodness.deviance + MAX_DEVIANCE_RISE {
        return None;
    }
    let process = *bounded.terms().last()?;
    Some(BoundedDrift { walk, process, bias_errors_per_hour })
}

/// Drift that several channels of one quantity have in common, without a measured cause.
pub(crate) struct ChannelsInCommon {
    pub channels: Vec<ChannelProfile>,
    /// Increase of the ln likelihood of the spectra.
    pub gain: f64,
    pub drift: CommonModeDrift,
}

/// The drift that `channels` of one quantity have in common; `samples` are those of each less its covariates.
pub(crate) fn common_mode(channels: &[ChannelProfile], samples: &[UniformSeries]) -> Option<ChannelsInCommon> {
    let transforms = CrossSpectra::new(samples)?;
    let (members, gain) = transforms.most_likely_set().filter(|(_, gain)| *gain > MIN_GAIN)?;
    let drift = transforms.fit_markov(&members)?;
    Some(ChannelsInCommon { channels: members.iter().map(|&member| channels[member]).collect(), gain, drift })
}

#[cfg(test)]
mod tests {
    use super::{BoundedDrift, bounded_drift};
    use crate::{OCTAVES, OVERLAP};
    use allan_core::Cascade;
    use allan_core::term::{Markov, NoiseTerm};
    use allan_core::trace::{LineCandidates, trace};
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    const PERIOD_S: f64 = 0.01;

    /// Of white noise of 1 deg/s a sample and a Markov process with correlation time `time_s` and K = `walk` deg/s^1.5.
    fn found(walk: f64, time_s: f64) -> Option<BoundedDrift> {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let mut cascade = Cascade::<OCTAVES, OVERLAP>::new();
        let (mut state, kept) = (0.0, (-PERIOD_S / time_s).exp());
        for _ in 0..40_000 {
            let mut normal = || random.sample::<f64, _>(StandardNormal);
            state = kept * state + walk * PERIOD_S.sqrt() * normal();
            cascade.push((1000.0 * (state + normal())) as i32);
        }
        let curve = cascade.curve(PERIOD_S).scaled(1e-3);
        bounded_drift(
            &curve,
            &trace(&curve, LineCandidates::Spectrum(&[]), &measurement::adis16405::profile(0.05).filters),
            measurement::adis16405::profile(0.05).channel("gyro_z").unwrap(),
        )
    }

    #[test]
    fn a_walk_beyond_the_bias_error_of_the_data_sheet_is_bounded() {
        let found_there = found(2.0, 60.0).unwrap();
        assert!((found_there.walk.value / 2.0 - 1.0).abs() < 0.2, "{:?}", found_there.walk);
        assert!(
            (20.0..41.0).contains(&found_there.bias_errors_per_hour),
            "2·√3600/3 = 40, less the interval: {}",
            found_there.bias_errors_per_hour
        );
        // The curve determines σ²·2/τ = K² alone, not the correlation time.
        let NoiseTerm::Markov(Markov { time_constant }) = found_there.process.kind else { panic!() };
        let walk = found_there.process.value * (2.0 / time_constant).sqrt();
        assert!((walk / 2.0 - 1.0).abs() < 0.2, "{:?}", found_there.process);
        assert!(found(0.02, 1e9).is_none(), "1.2 deg/s in an hour");
    }
}
