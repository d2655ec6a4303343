//! A recording as it is analysed: means of consecutive samples, of one each if it is short, and findings about the samples themselves.

use crate::detectors::stuck_output;
use crate::effects::Effect;
use crate::parallel::per_channel;
use crate::record::sample_curves::SampleCurves;
use crate::record::sample_effects::SampleEffects;
use crate::spectra::Welch;
use crate::spectra::spectral_lines::MergedLine;
use measurement::{ChannelId, Measurement, PerChannel, RecordingDescription};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::{Arc, LazyLock};

pub struct CondensedRecord<'a> {
    pub(crate) description: RecordingDescription,
    /// Means of [`samples_per_mean`](Self::samples_per_mean) samples each.
    pub(crate) means: Cow<'a, Measurement>,
    /// The first samples, if not all are kept.
    pub(crate) first: Option<Measurement>,
    /// 1 if all samples are kept.
    pub(crate) samples_per_mean: u64,
    /// Sample periods of `means` that repeat the sample before in all channels; no channel uses them.
    pub(crate) repeated: Vec<u64>,
    pub(crate) channels: PerChannel<CondensedChannel>,
}

/// Lines that means do not show, sought when first asked for, so that other channels need not wait.
pub(crate) type FasterLines = Arc<LazyLock<Vec<MergedLine>, Box<dyn FnOnce() -> Vec<MergedLine> + Send>>>;

#[derive(Clone)]
pub(crate) struct CondensedChannel {
    pub samples: SampleCurves,
    /// Variance of the samples within each mean, in the square of the channel's unit; empty if all samples are kept.
    pub variances: Arc<[f64]>,
    pub counts_per_step: u32,
    /// True if spikes can be sought: not in means, and not in values that are cut off.
    pub can_show_spikes: bool,
    pub faster_lines: FasterLines,
    /// Lines of the first half alone.
    pub faster_lines_of_first_half: FasterLines,
    /// Effects that only the samples themselves show, in an inertial channel.
    pub effects: Vec<Effect>,
    pub effects_of_first_half: Vec<Effect>,
    /// Spikes and knocks of the first half that the means leave out: sample period, and distance from the neighbours in the channel's unit.
    pub screened: Vec<(u64, f64)>,
    /// Refused samples of this channel alone, by cause.
    pub refused: BTreeMap<&'static str, u64>,
}

pub(crate) fn faster_lines(find: impl FnOnce() -> Vec<MergedLine> + Send + 'static) -> FasterLines {
    Arc::new(LazyLock::new(Box::new(find)))
}

impl<'a> CondensedRecord<'a> {
    pub(crate) fn of_samples(measurement: Cow<'a, Measurement>) -> Self {
        let (measurement, stuck) = stuck_output::screened(measurement);
        let shown = SampleEffects::detect(&measurement);
        let (samples, period_s) = (measurement.len() as u64, measurement.period_s());
        let channel = |id: ChannelId| {
            let channel = &measurement[id];
            let counts_per_step = shown.counts_per_step(id);
            let resolution = f64::from(counts_per_step) * channel.profile.lsb;
            CondensedChannel {
                samples: SampleCurves::of_all(&measurement, id, resolution),
                variances: Arc::default(),
                counts_per_step,
                can_show_spikes: channel.profile.quantity.is_inertial() && !shown.is_saturated(id),
                faster_lines: faster_lines(Vec::new),
                faster_lines_of_first_half: faster_lines(Vec::new),
                effects: shown.of(id).cloned().chain(stuck[id.position()].effect(samples, period_s)).collect(),
                effects_of_first_half: Vec::new(),
                screened: Vec::new(),
                refused: channel.refused.iter().map(|(&cause, of)| (cause, of.len() as u64)).collect(),
            }
        };
        Self {
            channels: per_channel(measurement.ids(), channel),
            repeated: shown.repeated(),
            description: RecordingDescription::from(measurement.as_ref()),
            first: None,
            samples_per_mean: 1,
            means: measurement,
        }
    }

    /// The record up to its middle, without influence of the second half.
    pub(crate) fn first_half(&self) -> CondensedRecord<'static> {
        let half = self.means.before(self.means.middle());
        if self.samples_per_mean == 1 {
            return CondensedRecord::of_samples(Cow::Owned(half));
        }
        let channel = |of: &CondensedChannel| CondensedChannel {
            samples: of.samples.of_first_half(),
            faster_lines: Arc::clone(&of.faster_lines_of_first_half),
            effects: of.effects_of_first_half.clone(),
            ..of.clone()
        };
        CondensedRecord {
            description: self.description.clone(),
            means: Cow::Owned(half),
            first: None,
            samples_per_mean: self.samples_per_mean,
            repeated: Vec::new(),
            channels: self.channels.map(channel),
        }
    }

    pub(crate) fn first_samples(&self) -> &Measurement {
        self.first.as_ref().unwrap_or(&self.means)
    }

    /// Spectrum of a channel's samples in some means; `None` if all samples are kept, or without samples.
    pub(crate) fn spectrum_within(&self, channel: ChannelId, means: Range<u64>) -> Option<Welch> {
        let samples = &self.channels[channel].samples;
        (self.samples_per_mean > 1).then(|| samples.spectrum_within(samples.slots_of(means))).flatten()
    }

    pub(crate) fn is_traced(&self, channel: ChannelId) -> bool {
        self.means[channel].profile.quantity.is_inertial()
    }
}
