//! A recording as it is analysed: the means of as many samples in a row as leave few enough of them, and what is known of the samples
//! beside. A short recording has one sample a mean.

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

/// A recording, condensed.
pub struct CondensedRecord<'a> {
    pub(crate) description: RecordingDescription,
    /// Means of [`samples_per_mean`](Self::samples_per_mean) samples each.
    pub(crate) means: Cow<'a, Measurement>,
    /// The first samples, as recorded, of a record of which not all samples are kept.
    pub(crate) first: Option<Measurement>,
    /// 1 where all samples are kept.
    pub(crate) samples_per_mean: u64,
    /// Sample periods of `means` that no channel uses: their sample equals the one before in all channels.
    pub(crate) repeated: Vec<u64>,
    pub(crate) channels: PerChannel<CondensedChannel>,
}

/// Lines that means do not show. They are sought when they are first asked for: where that takes one channel longer than the others, these
/// go on with their fits.
pub(crate) type FasterLines = Arc<LazyLock<Vec<MergedLine>, Box<dyn FnOnce() -> Vec<MergedLine> + Send>>>;

/// What is known of the samples of one channel beside their means.
#[derive(Clone)]
pub(crate) struct CondensedChannel {
    pub samples: SampleCurves,
    /// How many counts the smallest step of the values of a mean has.
    pub counts_per_step: u32,
    /// Whether spikes can be looked for: not in means, from which they are left out, and not in values that are cut off, which are no
    /// noise around which a sample could be a spike.
    pub can_show_spikes: bool,
    pub faster_lines: FasterLines,
    /// Those of the first half alone.
    pub faster_lines_of_first_half: FasterLines,
    /// What only the samples themselves show, in an inertial channel.
    pub effects: Vec<Effect>,
    /// The same of the first half of the recording, as far as it is known.
    pub effects_of_first_half: Vec<Effect>,
    /// Samples of the first half that are left out of the means as spikes or knocks, and how far each is from its neighbours, in the
    /// channel's unit.
    pub screened: Vec<(u64, f64)>,
    /// Samples that are refused in the channel alone, by cause.
    pub refused: BTreeMap<&'static str, u64>,
}

/// The lines that `find` finds.
pub(crate) fn faster_lines(find: impl FnOnce() -> Vec<MergedLine> + Send + 'static) -> FasterLines {
    Arc::new(LazyLock::new(Box::new(find)))
}

impl<'a> CondensedRecord<'a> {
    /// A record all of whose samples are kept.
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

    /// The record as it would be had it ended in its middle: nothing of the second half decides what is in it.
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

    /// The first samples, or all of them.
    pub(crate) fn first_samples(&self) -> &Measurement {
        self.first.as_ref().unwrap_or(&self.means)
    }

    /// The spectrum of the samples of a channel in some means; `None` where all samples are kept, or have none.
    pub(crate) fn spectrum_within(&self, channel: ChannelId, means: Range<u64>) -> Option<Welch> {
        let samples = &self.channels[channel].samples;
        (self.samples_per_mean > 1).then(|| samples.spectrum_within(samples.slots_of(means))).flatten()
    }

    /// Whether effects are traced in a channel: in the inertial ones.
    pub(crate) fn is_traced(&self, channel: ChannelId) -> bool {
        self.means[channel].profile.quantity.is_inertial()
    }
}
