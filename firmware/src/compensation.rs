//! What an inertial channel follows, learnt from one epoch, and the next epoch's stream without it.
//!
//! The compensated stream is `y − Σ βᵢ·(cᵢ − rᵢ)`, sample by sample, with sensitivities `β` and references `r` of the epoch
//! before. Its Allan variance follows from the curves and couplings of the epoch: no second estimator is needed.

use crate::couplings::{COUPLED, Covariances, FIRST, GYROS, Means};
use crate::epoch::Epoch;
use crate::estimators::CHANNELS;
use crate::summary::OCTAVES;
use adis16405_driver::{Channel, Config};
use allan_core::regression::{Beside, Covariate, Sensitivity};
use allan_core::{Curve, Point};
use heapless::Vec;
use link::Shift;

/// Most covariates of a channel: temperature, supply, and for a gyro the three accelerations.
pub const MAX_CAUSES: usize = link::MAX_CAUSES;

/// A covariate that a channel follows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Followed {
    /// The covariate in [`CHANNELS`].
    pub cause: usize,
    /// Sensitivity in the channel's unit over the covariate's.
    pub value: f64,
    /// Such that the value ± 1.96 of it hold 95 %.
    pub error: f64,
    /// Value of the covariate at which nothing is subtracted, in its unit: the mean of the epoch that taught.
    pub reference: f64,
}

/// Everything that a channel follows.
pub type Causes = Vec<Followed, MAX_CAUSES>;

/// What the inertial channel [`CHANNELS`]`[index]` followed in an epoch, beyond doubt. Empty also where the epoch does not
/// know what its channels have in common.
///
/// Asks before every fit whether to keep on; `None` if the answer was no.
#[must_use]
#[inline(never)] // so that its stack is not everybody's
pub fn learn(epoch: &Epoch, index: usize, config: Config, keep_on: &mut dyn FnMut() -> bool) -> Option<Causes> {
    let Some(known) = epoch.covariances() else { return Some(Causes::new()) };
    let mut members: Members = causes(index).collect();
    let mut channel = Curve::empty();
    epoch.draw(&mut channel, index, config);
    let mut covariates: Vec<Covariate<COUPLED>, MAX_CAUSES> = Vec::new();
    for &member in &members {
        if !keep_on() {
            return None;
        }
        // There is room for as many as there are members.
        let _ = covariates.push(covariate(epoch, member, config, true));
    }
    let followed = loop {
        let covariance = |with: Option<usize>, covariate: usize, n: u64| {
            shared(known, (with.map_or(index, |other| members[other]), members[covariate]), n, config)
        };
        let beside = Beside { channel: &channel, covariates: &covariates, covariance: &covariance };
        let followed = beside.followed_while(keep_on)?;
        let harm = || harms(epoch, &members, config, &followed, &beside);
        // The least clear of them is told last.
        let Some(worst) = followed.last().filter(|_| harm()) else { break followed };
        members.remove(worst.covariate);
        covariates.remove(worst.covariate);
    };
    let with_reference = |sensitivity: &Sensitivity| {
        let cause = members[sensitivity.covariate];
        let reference = known.means[cause] * lsb(cause, config) + CHANNELS[cause].offset();
        Followed { cause, value: sensitivity.value, error: sensitivity.error, reference }
    };
    Some(followed.iter().map(with_reference).take(MAX_CAUSES).collect())
}

/// Draws the curve of the compensated stream of [`CHANNELS`]`[index]` over an epoch, exact from 2⁸ samples on; below, that of
/// the stream itself. `None`, and the curve that of the stream, if the epoch does not know what its channels have in common.
pub fn compensated(
    curve: &mut Curve<OCTAVES>,
    epoch: &Epoch,
    index: usize,
    config: Config,
    causes: &[Followed],
) -> Option<()> {
    epoch.draw(curve, index, config);
    if causes.is_empty() { Some(()) } else { subtract(curve, epoch, index, config, causes) }
}

#[inline(never)]
fn subtract(
    curve: &mut Curve<OCTAVES>,
    epoch: &Epoch,
    index: usize,
    config: Config,
    causes: &[Followed],
) -> Option<()> {
    let known = epoch.covariances()?;
    let members: Members = causes.iter().map(|followed| followed.cause).collect();
    let mut covariates: Vec<Covariate<COUPLED>, MAX_CAUSES> = Vec::new();
    for &member in &members {
        let _ = covariates.push(covariate(epoch, member, config, false));
    }
    let exact = |(covariate, followed): (usize, &Followed)| Sensitivity::exact(covariate, followed.value);
    let sensitivities: Vec<Sensitivity, MAX_CAUSES> = causes.iter().enumerate().map(exact).collect();
    let covariance = |with: Option<usize>, covariate: usize, n: u64| {
        shared(known, (with.map_or(index, |other| members[other]), members[covariate]), n, config)
    };
    let channel = &curve.clone();
    Beside { channel, covariates: &covariates, covariance: &covariance }.subtract_from(curve, &sensitivities);
    Some(())
}

/// How far the mean of the stream moved from one epoch to the next, and how far that of the compensated stream, in the
/// channel's unit. `before` are the means of all channels in counts.
#[must_use]
pub fn shift(epoch: &Epoch, index: usize, config: Config, causes: &[Followed], before: &Means) -> Option<Shift> {
    let means = &epoch.covariances()?.means;
    let moved = |index: usize| (means[index] - before[index]) * CHANNELS[index].lsb(config.range());
    let raw = moved(index);
    let followed = causes.iter().map(|followed| followed.value * moved(followed.cause)).sum::<f64>();
    Some(Shift { raw, compensated: raw - followed })
}

/// What an inertial channel may follow: every one the surroundings, a gyro the acceleration too.
fn causes(index: usize) -> impl Iterator<Item = usize> {
    let position = |channel: Channel| CHANNELS.iter().position(move |&other| other == channel);
    let surroundings = [Channel::Temp, Channel::Supply].into_iter();
    let motion = [Channel::AcclX, Channel::AcclY, Channel::AcclZ].into_iter().filter(move |_| index < GYROS);
    surroundings.chain(motion).filter_map(position)
}

/// Channels that may be causes.
type Members = Vec<usize, MAX_CAUSES>;

/// What two channels have in common at averaging factor `n`, in the product of their units.
fn shared(known: &Covariances, (a, b): (usize, usize), n: u64, config: Config) -> Option<f64> {
    Some(known.covariance(a, b, n)? * lsb(a, config) * lsb(b, config))
}

/// A channel where it is coupled, its own noise `told` from the rest or not.
#[inline(never)]
fn covariate(epoch: &Epoch, index: usize, config: Config, told: bool) -> Covariate<COUPLED> {
    let mut curve = Curve::empty();
    epoch.draw(&mut curve, index, config);
    if told {
        Covariate::new(&curve, lsb(index, config), 1 << FIRST)
    } else {
        Covariate::as_measured(&curve, 1 << FIRST)
    }
}

fn lsb(index: usize, config: Config) -> f64 {
    CHANNELS[index].lsb(config.range())
}

/// Whether subtracting makes the stream worse at any octave, beyond what its uncertainty could hide.
///
/// A slow likeness by chance of what is hardly there costs a large sensitivity, and with it all the noise of the covariate.
/// Where the coupling is not known that noise is all that is expected of it.
#[inline(never)]
fn harms(
    epoch: &Epoch,
    members: &Members,
    config: Config,
    followed: &[Sensitivity],
    beside: &Beside<'_, OCTAVES, COUPLED>,
) -> bool {
    let mut added = [0.0; OCTAVES];
    let mut covariate = Curve::empty();
    for sensitivity in followed {
        epoch.draw(&mut covariate, members[sensitivity.covariate], config);
        for (added, point) in added.iter_mut().zip(covariate.points()).take(FIRST) {
            *added += sensitivity.value * sensitivity.value * point.avar;
        }
    }
    let worse = |(raw, added): (&Point, f64)| {
        let subtracted = beside.subtracted_at(raw, followed).unwrap_or(raw.avar);
        subtracted + added > raw.avar * (1.0 + 2.0 * libm::sqrt(2.0 / raw.edf))
    };
    beside.channel.points().iter().zip(added).any(worse)
}
