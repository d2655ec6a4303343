//! What an inertial channel follows, learnt from one epoch, and the next epoch's stream without it.
//!
//! The compensated stream is `y − Σ βᵢ·(cᵢ − rᵢ)`, sample by sample, with sensitivities `β` and references `r` of the epoch
//! before. Its Allan variance follows from the curves and couplings of the epoch: no second estimator is needed.

use crate::couplings::{FIRST, GYROS};
use crate::epoch::Epoch;
use crate::estimators::CHANNELS;
use crate::summary::OCTAVES;
use adis16405_driver::{Channel, Config};
use allan_core::Curve;
use allan_core::regression::{Beside, Covariate, Sensitivity, Shared};
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
    /// Standard deviation of the sensitivity.
    pub error: f64,
    /// Value of the covariate at which nothing is subtracted, in its unit: the mean of the epoch that taught.
    pub reference: f64,
}

/// Everything that a channel follows.
pub type Causes = Vec<Followed, MAX_CAUSES>;

/// What the inertial channel [`CHANNELS`]`[index]` followed in an epoch, beyond doubt. Empty also where the epoch does not
/// know what its channels have in common.
#[must_use]
#[inline(never)] // so that its stack is not everybody's
pub fn learn(epoch: &Epoch, index: usize, config: Config) -> Causes {
    let Some(surroundings) = Surroundings::of(epoch, index, config, Covariate::new) else {
        return Causes::new();
    };
    let followed = surroundings.beside().followed();
    let with_reference = |sensitivity: &Sensitivity| {
        let cause = surroundings.members[sensitivity.covariate];
        let mean = epoch.couplings().map_or(0.0, |couplings| couplings.mean(cause));
        let reference = mean * CHANNELS[cause].lsb(config.range()) + CHANNELS[cause].zero();
        Followed { cause, value: sensitivity.value, error: sensitivity.error, reference }
    };
    followed.iter().map(with_reference).take(MAX_CAUSES).collect()
}

/// The curve of the compensated stream of [`CHANNELS`]`[index]` over an epoch, exact from 2⁸ samples on; below, that of the
/// stream itself.
///
/// `None` if the epoch does not know what its channels have in common.
#[must_use]
#[inline(never)]
pub fn compensated(epoch: &Epoch, index: usize, config: Config, causes: &[Followed]) -> Option<Curve<OCTAVES>> {
    if causes.is_empty() {
        return Some(epoch.curve(index, config));
    }
    let surroundings = Surroundings::of(epoch, index, config, |curve, _| Covariate::as_measured(curve))?;
    let sensitivity = |followed: &Followed| {
        let covariate = surroundings.members.iter().position(|&member| member == followed.cause)?;
        Some(Sensitivity { covariate, value: followed.value, error: followed.error })
    };
    let sensitivities: Vec<Sensitivity, MAX_CAUSES> = causes.iter().filter_map(sensitivity).collect();
    Some(surroundings.beside().subtracted(&sensitivities))
}

/// How far the mean of the stream moved from one epoch to the next, and how far that of the compensated stream, in the
/// channel's unit. `before` are the means of all channels in counts.
#[must_use]
pub fn shift(epoch: &Epoch, index: usize, config: Config, causes: &[Followed], before: &Means) -> Option<Shift> {
    let couplings = epoch.couplings()?;
    let moved = |index: usize| (couplings.mean(index) - before[index]) * CHANNELS[index].lsb(config.range());
    let raw = moved(index);
    let followed = causes.iter().map(|followed| followed.value * moved(followed.cause)).sum::<f64>();
    Some(Shift { raw, compensated: raw - followed })
}

/// Mean of every channel in counts.
pub type Means = [f64; CHANNELS.len()];

/// What an inertial channel may follow: every one the surroundings, a gyro the acceleration too.
fn causes(index: usize) -> impl Iterator<Item = usize> {
    let position = |channel: Channel| CHANNELS.iter().position(move |&other| other == channel);
    let surroundings = [Channel::Temp, Channel::Supply].into_iter();
    let motion = [Channel::AcclX, Channel::AcclY, Channel::AcclZ].into_iter().filter(move |_| index < GYROS);
    surroundings.chain(motion).filter_map(position)
}

/// A channel with what it may follow, ready for the regression.
struct Surroundings {
    channel: Curve<OCTAVES>,
    members: Vec<usize, MAX_CAUSES>,
    covariates: Vec<Covariate<OCTAVES>, MAX_CAUSES>,
    with_channel: Vec<Shared<OCTAVES>, MAX_CAUSES>,
    mutual: Vec<Shared<OCTAVES>, { MAX_CAUSES * (MAX_CAUSES - 1) / 2 }>,
}

impl Surroundings {
    fn of(
        epoch: &Epoch,
        index: usize,
        config: Config,
        covariate: impl Fn(Curve<OCTAVES>, f64) -> Covariate<OCTAVES>,
    ) -> Option<Self> {
        let couplings = epoch.couplings()?;
        let lsb = |index: usize| CHANNELS[index].lsb(config.range());
        let shared = |a: usize, b: usize| couplings.shared(a, b, (lsb(a), lsb(b)));
        let members: Vec<usize, MAX_CAUSES> = causes(index).collect();
        let mut surroundings = Self {
            channel: epoch.curve(index, config),
            covariates: Vec::new(),
            with_channel: members.iter().map(|&member| shared(index, member)).collect(),
            mutual: Vec::new(),
            members: Vec::new(),
        };
        for (i, &member) in members.iter().enumerate() {
            let curve = epoch.curve(member, config);
            let coupled = curve.clone().from_factor(1 << FIRST);
            // There is room for as many as there are members, and for their pairs.
            let _ = surroundings.covariates.push(covariate(curve, lsb(member)).continued(coupled));
            for &other in &members[..i] {
                let _ = surroundings.mutual.push(shared(member, other));
            }
        }
        surroundings.members = members;
        Some(surroundings)
    }

    fn beside(&self) -> Beside<'_, OCTAVES> {
        Beside {
            channel: &self.channel,
            covariates: &self.covariates,
            with_channel: &self.with_channel,
            mutual: &self.mutual,
        }
    }
}
