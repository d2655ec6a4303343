//! Effects that only the samples show: sampling faults, resolution, and limits of the output.

use crate::detectors::effective_lsb;
use crate::detectors::output_range::{ValueCounts, find_noise_below_count};
use crate::effects::Effect;
use crate::effects::findings::Detection;
use crate::parallel::per_channel;
use crate::record::sampling_faults;
use crate::samples::series::Series;
use measurement::{ChannelId, Measurement, PerChannel};

pub(crate) struct SampleEffects {
    /// Every channel's: lost and repeated samples, sample clock.
    recording: Vec<Detection>,
    channels: PerChannel<SamplesOfChannel>,
}

struct SamplesOfChannel {
    is_inertial: bool,
    counts_per_step: u32,
    /// An inertial channel's: coarse resolution, saturation, noise below a count, missing codes.
    found: Vec<Detection>,
}

impl SampleEffects {
    pub(crate) fn detect(measurement: &Measurement) -> Self {
        let channels = per_channel(measurement.ids(), |channel| SamplesOfChannel::detect(measurement, channel));
        Self { recording: sampling_faults::detect(measurement), channels }
    }

    pub(crate) fn repeated(&self) -> Vec<u64> {
        self.recording.iter().flat_map(Detection::excluded).copied().collect()
    }

    pub(crate) fn counts_per_step(&self, channel: ChannelId) -> u32 {
        self.channels[channel].counts_per_step
    }

    /// Findings in an inertial channel; those of every channel first.
    pub(crate) fn of(&self, channel: ChannelId) -> impl Iterator<Item = &Effect> {
        let SamplesOfChannel { is_inertial, found, .. } = &self.channels[channel];
        let all = self.recording.iter().chain(found);
        all.filter(|_| *is_inertial).map(|detection| &detection.effect)
    }

    /// True if values are cut off: then spikes cannot be told from noise.
    pub(crate) fn is_saturated(&self, channel: ChannelId) -> bool {
        self.of(channel).any(|effect| matches!(effect, Effect::Saturation(_)))
    }
}

impl SamplesOfChannel {
    fn detect(measurement: &Measurement, channel: ChannelId) -> Self {
        let recorded = &measurement[channel];
        let series = Series::from_measurement(measurement, channel);
        let counts_per_step = effective_lsb::counts_per_step(&series);
        let is_inertial = recorded.profile.quantity.is_inertial();
        if !is_inertial {
            return Self { is_inertial, counts_per_step, found: Vec::new() };
        }
        let resolution = effective_lsb::find(&series);
        let series = series.with_counts_per_step(counts_per_step);
        let mut values = ValueCounts::default();
        recorded.used_samples(&measurement.slots).for_each(|(_, count)| values.push(count));
        let range = values
            .saturation(&recorded.profile, series.resolution)
            .or_else(|| find_noise_below_count(&series, measurement.profile.dithered_avar_counts2))
            .or_else(|| {
                values.missing_codes(recorded.profile.lsb, recorded.profile.unit).filter(|_| counts_per_step == 1)
            });
        Self { is_inertial, counts_per_step, found: resolution.into_iter().chain(range).collect() }
    }
}
