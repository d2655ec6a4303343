//! Preprocessing: what the detectors find in the samples of each channel, and the series without it.
//!
//! Spikes and repeated samples become gaps, a bias step is subtracted. A ramp is reported and stays in the samples, because
//! the noise model has a term for it. A sensitivity to temperature or supply stays in them too, and is kept for the
//! regression on covariates.

use crate::detectors::bias::{BiasChanges, BiasSensitivity};
use crate::detectors::block_means::NoiseGrids;
use crate::detectors::{bias, effective_lsb, spikes};
use crate::findings::{Correction, Detection, Effect};
use crate::sampling_faults;
use crate::series::Series;
use allan_core::NoiseTerm;
use measurement::{ChannelProfile, Measurement, Quantity};
use std::collections::BTreeSet;

/// Effects in the samples, and the corrections that remove them.
#[derive(Default)]
pub(crate) struct Preprocessing {
    /// Effects that concern every channel: sample loss, repeated samples, the sample clock.
    common_effects: Vec<Effect>,
    channel_effects: Vec<(ChannelProfile, Effect)>,
    /// Positions in the recording.
    excluded: BTreeSet<usize>,
    /// By channel: the first position from which an offset is subtracted, and the offset in the channel's unit.
    offsets: Vec<(ChannelProfile, usize, f64)>,
    /// A channel, the temperature or supply that it depends on, and how much.
    sensitivities: Vec<(ChannelProfile, ChannelProfile, BiasSensitivity)>,
    /// Channels whose values are all multiples of several counts, and of how many.
    counts_per_step: Vec<(ChannelProfile, u32)>,
}

impl Preprocessing {
    /// Looks for spikes, steps, ramps, sensitivities and a coarse resolution in the channels `traced`, and for lost or
    /// repeated samples and a wrong sample rate in the whole recording.
    pub(crate) fn detect(measurement: &Measurement, traced: &[ChannelProfile], noise_grids: &NoiseGrids) -> Self {
        let mut preprocessing = Self::default();
        for finding in sampling_faults::detect(measurement) {
            preprocessing.excluded.extend(excluded(&finding.correction));
            preprocessing.common_effects.push(finding.effect);
        }
        let recorded: Vec<ChannelProfile> = measurement.profiles().collect();
        let measured = |channel: ChannelProfile| Series::from_measurement(measurement, &channel);
        let steps = in_parallel(&recorded, |&channel| effective_lsb::counts_per_step(&measured(channel)));
        preprocessing.counts_per_step = recorded.iter().copied().zip(steps).filter(|(_, counts)| *counts > 1).collect();
        let series_of =
            |channel: ChannelProfile| measured(channel).with_counts_per_step(preprocessing.counts_per_step(channel));
        let regressors: Vec<(ChannelProfile, Series)> =
            recorded.iter().map(|&channel| (channel, series_of(channel))).collect();
        let found = in_parallel(traced, |&channel| {
            let series = series_of(channel);
            let lsb = effective_lsb::find(&measured(channel));
            let spikes = spikes::find(&series);
            let left_out = spikes.as_ref().map(|finding| excluded(&finding.correction)).unwrap_or_default();
            let cleaned = series.corrected(&Correction::Exclude(left_out.clone()));
            // The regressors need the same samples as the channel.
            let (profiles, others): (Vec<ChannelProfile>, Vec<Series>) = regressors
                .iter()
                .filter(|(regressor, _)| may_depend(channel, *regressor))
                .map(|(regressor, series)| {
                    (*regressor, series.clone().corrected(&Correction::Exclude(left_out.clone())))
                })
                .unzip();
            let bias_changes = bias::find(&cleaned, &others.iter().collect::<Vec<_>>(), noise_grids);
            (lsb, spikes, bias_changes, profiles, left_out)
        });
        for (&channel, (lsb, spikes, BiasChanges { step, ramp, sensitivities }, regressors, left_out)) in
            traced.iter().zip(found)
        {
            if let Some(Detection { correction: Some(Correction::Offset { from, size }), .. }) = &step {
                preprocessing.offsets.push((channel, position_with_excluded(*from, &left_out), *size));
            }
            // The differences measure a sensitivity to motion better; the slow part of an accelerometer's signal is its
            // own drift.
            let slow = sensitivities.into_iter().map(|(place, sensitivity)| (channel, regressors[place], sensitivity));
            preprocessing.sensitivities.extend(slow.filter(|(_, regressor, _)| regressor.quantity.is_environment()));
            preprocessing.excluded.extend(left_out);
            let findings = lsb.into_iter().chain(spikes).chain(step).chain(ramp);
            preprocessing.channel_effects.extend(findings.map(|finding| (channel, finding.effect)));
        }
        preprocessing
    }

    /// How many counts the smallest step of a channel's values has.
    pub(crate) fn counts_per_step(&self, channel: ChannelProfile) -> u32 {
        self.counts_per_step.iter().find(|(of, _)| *of == channel).map_or(1, |(_, counts)| *counts)
    }

    /// Whether the sample at `position` of the recording is not used.
    pub(crate) fn excludes(&self, position: usize) -> bool {
        self.excluded.contains(&position)
    }

    /// What is subtracted from the sample at `position`, in the channel's unit.
    pub(crate) fn offset(&self, channel: ChannelProfile, position: usize) -> f64 {
        self.offsets.iter().filter(|(of, from, _)| *of == channel && position >= *from).map(|(.., size)| size).sum()
    }

    /// A channel's series after preprocessing.
    pub(crate) fn series(&self, measurement: &Measurement, channel: ChannelProfile) -> Series {
        let mut series =
            Series::from_measurement(measurement, &channel).with_counts_per_step(self.counts_per_step(channel));
        for &(_, from, size) in self.offsets.iter().filter(|(of, ..)| *of == channel) {
            series = series.corrected(&Correction::Offset { from, size });
        }
        series.corrected(&Correction::Exclude(self.excluded.iter().copied().collect()))
    }

    /// Whether a ramp was found in a channel.
    pub(crate) fn has_ramp(&self, channel: ChannelProfile) -> bool {
        self.effects(channel).any(|effect| effect.kind == NoiseTerm::RateRamp.name())
    }

    /// Sensitivity of a channel to a temperature or supply.
    pub(crate) fn sensitivity(&self, channel: ChannelProfile, regressor: ChannelProfile) -> Option<BiasSensitivity> {
        let of = |(of, to, _): &&(ChannelProfile, ChannelProfile, BiasSensitivity)| (*of, *to) == (channel, regressor);
        self.sensitivities.iter().find(of).map(|(.., followed)| *followed)
    }

    /// The effects of a channel, those that concern every channel first.
    pub(crate) fn effects(&self, channel: ChannelProfile) -> impl Iterator<Item = Effect> + '_ {
        let own = self.channel_effects.iter().filter(move |(of, _)| *of == channel).map(|(_, effect)| effect);
        self.common_effects.iter().chain(own).cloned()
    }
}

/// Runs `task` for each of `items`, each on its own thread, and returns the results in the order of `items`.
pub(crate) fn in_parallel<T: Sync, R: Send>(items: &[T], task: impl Fn(&T) -> R + Sync) -> Vec<R> {
    std::thread::scope(|scope| {
        let tasks: Vec<_> = items.iter().map(|item| scope.spawn(|| task(item))).collect();
        // A panic in a task is passed on to the caller.
        tasks.into_iter().map(|task| task.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))).collect()
    })
}

fn excluded(correction: &Option<Correction>) -> Vec<usize> {
    match correction {
        Some(Correction::Exclude(positions)) => positions.clone(),
        _ => Vec::new(),
    }
}

/// Whether the bias of `channel` may depend on `regressor`: on temperature and supply, and that of a gyroscope on the
/// specific force.
fn may_depend(channel: ChannelProfile, regressor: ChannelProfile) -> bool {
    let motion = regressor.quantity == Quantity::SpecificForce && channel.quantity == Quantity::AngularRate;
    regressor.quantity.is_environment() || motion
}

/// The position that a sample had before those at the positions `left_out` were excluded.
fn position_with_excluded(position: usize, left_out: &[usize]) -> usize {
    left_out.iter().fold(position, |position, &excluded| if excluded <= position { position + 1 } else { position })
}
