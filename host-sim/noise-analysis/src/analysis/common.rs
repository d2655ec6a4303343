//! A slow part that channels of a sort share without a measured cause.

use crate::grid::Grid;
use crate::spectrum::shared::{Shared, Transforms};
use measurement::ChannelProfile;

/// By how much the spectra must be likelier with it, in ln likelihood. In 3 channels there are 10 ways to share
/// something and a few distinct correlation times: e⁻⁹ for each leaves a chance of some 1 in 500.
const CONVINCING: f64 = 9.0;

/// What channels share.
pub(super) struct Common {
    pub channels: Vec<ChannelProfile>,
    /// In ln likelihood.
    pub gain: f64,
    pub shared: Shared,
}

/// What the channels of one sort share; their samples are less what each follows.
pub(super) fn find(channels: &[ChannelProfile], samples: &[Grid]) -> Option<Common> {
    let transforms = Transforms::of(samples)?;
    let (members, gain) = transforms.clearest().filter(|(_, gain)| *gain > CONVINCING)?;
    let shared = transforms.markov(&members)?;
    Some(Common { channels: members.iter().map(|&member| channels[member]).collect(), gain, shared })
}
