//! What only the samples of a recording show, and not their means: faults of the sampling, the resolution of each channel, and
//! whether its output can express its noise and its range.

use crate::detectors::effective_lsb;
use crate::detectors::output_range::{ValueCounts, find_noise_below_count};
use crate::findings::Detection;
use crate::parallel::in_parallel;
use crate::sampling_faults;
use crate::series::Series;
use measurement::{ChannelProfile, Measurement};

/// What the samples show; nothing by default.
#[derive(Default)]
pub(crate) struct SampleEffects {
    /// Of every channel: lost and repeated samples, the sample clock.
    pub recording: Vec<Detection>,
    /// Channels whose values are all multiples of several counts, and of how many.
    counts_per_step: Vec<(ChannelProfile, u32)>,
    /// Of one channel each: a resolution of several counts, values that are cut off, noise below a count.
    channels: Vec<(ChannelProfile, Detection)>,
}

impl SampleEffects {
    /// What the samples of the channels `traced` show; the steps of all channels.
    pub(crate) fn detect(measurement: &Measurement, traced: &[ChannelProfile]) -> Self {
        let measured = |channel: ChannelProfile| Series::from_measurement(measurement, &channel);
        let recorded: Vec<ChannelProfile> = measurement.profiles().collect();
        let steps = in_parallel(&recorded, |&channel| effective_lsb::counts_per_step(&measured(channel)));
        let steps = recorded.into_iter().zip(steps).filter(|(_, counts)| *counts > 1).collect();
        let mut effects =
            Self { recording: sampling_faults::detect(measurement), counts_per_step: steps, channels: Vec::new() };
        let found = in_parallel(traced, |&channel| {
            let series = measured(channel);
            let resolution = effective_lsb::find(&series);
            let series = series.with_counts_per_step(effects.counts_per_step(channel));
            let mut values = ValueCounts::default();
            let recorded = measurement.channel(&channel).into_iter();
            recorded.flat_map(|of| of.used_samples(&measurement.slots)).for_each(|(_, count)| values.push(count));
            let range = values
                .saturation(&channel, series.resolution)
                .or_else(|| find_noise_below_count(&series, measurement.profile.dithered_avar_counts2));
            [resolution, range]
        });
        for (&channel, found) in traced.iter().zip(found) {
            effects.channels.extend(found.into_iter().flatten().map(|detection| (channel, detection)));
        }
        effects
    }

    /// Sample periods whose sample equals the one before in all channels.
    pub(crate) fn repeated(&self) -> Vec<u64> {
        self.recording.iter().flat_map(Detection::excluded).copied().collect()
    }

    /// How many counts the smallest step of a channel's values has.
    pub(crate) fn counts_per_step(&self, channel: ChannelProfile) -> u32 {
        self.counts_per_step.iter().find(|(of, _)| *of == channel).map_or(1, |(_, counts)| *counts)
    }

    /// What the samples of one channel show.
    pub(crate) fn of(&self, channel: ChannelProfile) -> impl Iterator<Item = &Detection> {
        self.channels.iter().filter(move |(of, _)| *of == channel).map(|(_, detection)| detection)
    }

    /// Whether values of a channel are cut off: they are no noise around which a sample could be a spike.
    pub(crate) fn is_saturated(&self, channel: ChannelProfile) -> bool {
        self.of(channel).any(|detection| detection.effect.kind == "saturated")
    }
}
