//! What was found in the samples themselves, and how the series become whole again without it.
//!
//! A ramp is named here, where it is clearest, and left in the samples: the model has a term for it.

use crate::detectors::bias::{BiasChanges, BiasSensitivity};
use crate::detectors::block_means::NoiseGrids;
use crate::detectors::{bias, effective_lsb, spikes};
use crate::findings::{Correction, Detection};
use crate::report::Effect;
use crate::series::Series;
use crate::trace::{deliveries, sample_clock};
use allan_core::NoiseTerm;
use measurement::{ChannelProfile, Measurement, Quantity};
use std::collections::BTreeSet;

/// Effects in the samples, and their repairs.
#[derive(Default)]
pub(super) struct Repairs {
    /// What concerns every channel: how the samples were taken and delivered.
    everywhere: Vec<Effect>,
    of_channel: Vec<(ChannelProfile, Effect)>,
    left_out: BTreeSet<usize>,
    levels: Vec<(ChannelProfile, usize, f64)>,
    /// Channels, slow causes that they follow, and how.
    followed: Vec<(ChannelProfile, ChannelProfile, BiasSensitivity)>,
    /// Counts to a step of a channel's values, where it is more than one.
    coarse: Vec<(ChannelProfile, u32)>,
}

impl Repairs {
    /// Looks for spikes and for what moves the level in `traced`, and for what became of the samples of the whole
    /// recording.
    pub(super) fn find(measurement: &Measurement, traced: &[ChannelProfile], noises: &NoiseGrids) -> Self {
        let mut repairs = Self::default();
        let deliveries =
            [deliveries::dropped(measurement), deliveries::repeated(measurement), sample_clock::find(measurement)];
        for finding in deliveries.into_iter().flatten() {
            repairs.left_out.extend(left_out(&finding.correction));
            repairs.everywhere.push(finding.effect);
        }
        let recorded: Vec<ChannelProfile> = measurement.profiles().collect();
        let measured = |channel: ChannelProfile| Series::of(measurement, &channel);
        let coarse = in_parallel(&recorded, |&channel| effective_lsb::counts_per_step(&measured(channel)));
        repairs.coarse = recorded.iter().copied().zip(coarse).filter(|(_, counts)| *counts > 1).collect();
        let of = |channel: ChannelProfile| measured(channel).with_steps(repairs.step(channel));
        let causes: Vec<(ChannelProfile, Series)> = recorded.iter().map(|&channel| (channel, of(channel))).collect();
        let found = in_parallel(traced, |&channel| {
            let series = of(channel);
            let coarse = effective_lsb::find(&measured(channel));
            let spikes = spikes::find(&series);
            let left = spikes.as_ref().map(|finding| left_out(&finding.correction)).unwrap_or_default();
            let cleaned = series.corrected(&Correction::Exclude(left.clone()));
            let may = causes.iter().filter(|(of, _)| may_cause(*of, channel));
            // A cause must have the same samples.
            let others: Vec<(ChannelProfile, Series)> =
                may.map(|(of, series)| (*of, series.clone().corrected(&Correction::Exclude(left.clone())))).collect();
            let courses: Vec<&Series> = others.iter().map(|(_, series)| series).collect();
            let level = bias::find(&cleaned, &courses, noises);
            let causes: Vec<ChannelProfile> = others.iter().map(|(cause, _)| *cause).collect();
            (coarse, spikes, level, causes, left)
        });
        for (&channel, (coarse, spikes, BiasChanges { step, ramp, sensitivities: followed }, causes, left)) in
            traced.iter().zip(found)
        {
            if let Some(Detection { correction: Some(Correction::Offset { from, size }), .. }) = &step {
                repairs.levels.push((channel, before_leaving_out(*from, &left), *size));
            }
            // Motion is fast enough for the differences; its slow part is the accelerometers' own drift.
            let followed = followed.into_iter().map(|(cause, followed)| (channel, causes[cause], followed));
            repairs.followed.extend(followed.filter(|(_, cause, _)| is_slow(*cause)));
            repairs.left_out.extend(left);
            repairs.of_channel.extend(
                coarse.into_iter().chain(spikes).chain(step).chain(ramp).map(|finding| (channel, finding.effect)),
            );
        }
        repairs
    }

    /// Counts to a step of the channel's values.
    pub(super) fn step(&self, channel: ChannelProfile) -> u32 {
        self.coarse.iter().find(|(of, _)| *of == channel).map_or(1, |(_, counts)| *counts)
    }

    /// Whether the sample at `position` of the timeline is not to be used.
    pub(super) fn leaves_out(&self, position: usize) -> bool {
        self.left_out.contains(&position)
    }

    /// What is to be taken from a sample, in the channel's unit.
    pub(super) fn level(&self, channel: ChannelProfile, position: usize) -> f64 {
        self.levels.iter().filter(|(of, from, _)| *of == channel && position >= *from).map(|(.., size)| size).sum()
    }

    /// A channel's series without what was found in it.
    pub(super) fn series(&self, measurement: &Measurement, channel: ChannelProfile) -> Series {
        let mut series = Series::of(measurement, &channel).with_steps(self.step(channel));
        for &(_, from, size) in self.levels.iter().filter(|(of, ..)| *of == channel) {
            series = series.corrected(&Correction::Offset { from, size });
        }
        series.corrected(&Correction::Exclude(self.left_out.iter().copied().collect()))
    }

    /// Whether a channel has a ramp.
    pub(super) fn ramps(&self, channel: ChannelProfile) -> bool {
        self.effects(channel).any(|effect| effect.kind == NoiseTerm::RateRamp.name())
    }

    /// How a channel follows a slow cause.
    pub(super) fn followed(&self, channel: ChannelProfile, cause: ChannelProfile) -> Option<BiasSensitivity> {
        let of = |(follower, followed, _): &&(ChannelProfile, ChannelProfile, BiasSensitivity)| {
            (*follower, *followed) == (channel, cause)
        };
        self.followed.iter().find(of).map(|(.., followed)| *followed)
    }

    /// What was found in a channel.
    pub(super) fn effects(&self, channel: ChannelProfile) -> impl Iterator<Item = Effect> + '_ {
        let own = self.of_channel.iter().filter(move |(of, _)| *of == channel).map(|(_, effect)| effect);
        self.everywhere.iter().chain(own).cloned()
    }
}

/// Runs a task for each of `items`, each on a thread of its own.
pub(super) fn in_parallel<T: Sync, R: Send>(items: &[T], task: impl Fn(&T) -> R + Sync) -> Vec<R> {
    std::thread::scope(|scope| {
        let tasks: Vec<_> = items.iter().map(|item| scope.spawn(|| task(item))).collect();
        // A panic of a task is this thread's too.
        tasks.into_iter().map(|task| task.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))).collect()
    })
}

fn left_out(correction: &Option<Correction>) -> Vec<usize> {
    match correction {
        Some(Correction::Exclude(positions)) => positions.clone(),
        _ => Vec::new(),
    }
}

/// Surroundings and motion may step and take a channel along.
fn may_cause(cause: ChannelProfile, channel: ChannelProfile) -> bool {
    let motion = cause.quantity == Quantity::SpecificForce && channel.quantity == Quantity::AngularRate;
    is_slow(cause) || motion
}

/// Causes that take long to move.
pub(super) fn is_slow(cause: ChannelProfile) -> bool {
    cause.quantity.is_environment()
}

/// The position that a sample had before those at `left` were left out.
fn before_leaving_out(position: usize, left: &[usize]) -> usize {
    left.iter().fold(position, |position, &left| if left <= position { position + 1 } else { position })
}
