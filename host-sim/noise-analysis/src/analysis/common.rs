//! A slow part that channels of a sort share without a measured cause.

use crate::spectra::common_mode::{CommonModeDrift, CrossSpectra};
use crate::uniform_series::UniformSeries;
use measurement::ChannelProfile;

/// By how much the spectra must be likelier with it, in ln likelihood. In 3 channels there are 10 ways to share
/// something and a few distinct correlation times: e⁻⁹ for each leaves a chance of some 1 in 500.
const CONVINCING: f64 = 9.0;

/// What channels share.
pub(super) struct Common {
    pub channels: Vec<ChannelProfile>,
    /// In ln likelihood.
    pub gain: f64,
    pub shared: CommonModeDrift,
}

/// What the channels of one sort share; their samples are less what each follows.
pub(super) fn find(channels: &[ChannelProfile], samples: &[UniformSeries]) -> Option<Common> {
    let transforms = CrossSpectra::new(samples)?;
    let (members, gain) = transforms.most_likely_set().filter(|(_, gain)| *gain > CONVINCING)?;
    let shared = transforms.fit_markov(&members)?;
    Some(Common { channels: members.iter().map(|&member| channels[member]).collect(), gain, shared })
}
