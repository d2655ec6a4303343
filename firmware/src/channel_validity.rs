//! Channels that a burst refuses, by the driver's rule.

use crate::channels::{CHANNELS, ChannelSet};
use adis16405_driver::{Burst, Faults, Validity};

/// True unless a fault concerns the whole burst.
pub(crate) fn is_frame_sound(burst: &Burst) -> bool {
    (Faults::WARNINGS | Faults::OF_CHANNELS).contains(burst.faults())
}

pub(crate) fn refused_channels(validity: Validity) -> ChannelSet {
    let mut refused = ChannelSet::EMPTY;
    if !validity.is_usable() {
        for (index, channel) in CHANNELS.into_iter().enumerate() {
            refused.insert_if(index, validity.refused.contains(channel));
        }
    }
    refused
}

/// True for samples that are used with a warning.
pub(crate) fn is_marked(faults: Faults) -> bool {
    faults.intersects(Faults::SUPPLY | Faults::ERROR_ALARM)
}
