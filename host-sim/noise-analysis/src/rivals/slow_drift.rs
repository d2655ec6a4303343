//! Slow drift that several channels have in common.

use crate::samples::series::Series;
use crate::samples::uniform_series::UniformSeries;
use crate::spectra::MarkovEstimate;
use crate::spectra::common_mode::CrossSpectra;
use measurement::ChannelId;

/// Smallest gain in ln likelihood of a common-mode drift. Three channels can share a drift in 10 ways, each with a few
/// distinct correlation times; chance gives a gain of 11.3 in one of them with a probability of about 10·1.6·exp(−11.3), 2·10⁻⁴.
const MIN_GAIN: f64 = 11.3;

/// Drift that several channels of one quantity have in common, without a measured cause.
pub(crate) struct ChannelsInCommon {
    pub channels: Vec<ChannelId>,
    pub names: Vec<&'static str>,
    /// Increase of the ln likelihood of the spectra.
    pub gain: f64,
    pub drift: MarkovEstimate,
}

/// The drift that `channels` of one quantity, each with its name, have in common; `samples` are those of each less its covariates. All have a filter with
/// an impulse response of `filter_length_s`, or none.
pub(crate) fn common_mode(
    channels: &[(ChannelId, &'static str)],
    samples: &[UniformSeries],
    filter_length_s: f64,
) -> Option<ChannelsInCommon> {
    let transforms = CrossSpectra::new(samples, filter_length_s)?;
    let (members, gain) = transforms.most_likely_set().filter(|(_, gain)| *gain > MIN_GAIN)?;
    let drift = transforms.fit_markov(&members)?;
    let (channels, names) = members.iter().map(|&member| channels[member]).unzip();
    Some(ChannelsInCommon { channels, names, gain, drift })
}

/// Difference of the means of the last and of the first tenth of a series over the time between them, in its unit per s.
pub(crate) fn slope_of_ends(series: &Series) -> f64 {
    let (values, tenth) = (&series.values, series.values.len() / 10);
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    (mean(&values[values.len() - tenth..]) - mean(&values[..tenth])).abs() / (0.9 * series.duration_s())
}
