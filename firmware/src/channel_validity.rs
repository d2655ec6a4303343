//! The channels that a burst refuses, by the driver's rule, as channels that are estimated.

use crate::channels::{CHANNELS, ChannelSet};
use adis16405_driver::{Burst, Faults, Validity};

/// Whether a burst is one that a sensor has sent, by itself: no fault but a warning or one of single channels.
pub(crate) fn is_frame_sound(burst: &Burst) -> bool {
    (Faults::WARNINGS | Faults::OF_CHANNELS).contains(burst.faults())
}

/// The estimated channels that are refused.
pub(crate) fn refused_channels(validity: Validity) -> ChannelSet {
    let mut refused = ChannelSet::EMPTY;
    if !validity.is_usable() {
        for (index, channel) in CHANNELS.into_iter().enumerate() {
            refused.insert_if(index, validity.refused.contains(channel));
        }
    }
    refused
}

/// Whether the samples of a burst with these faults are marked: used, with a warning.
pub(crate) fn is_marked(faults: Faults) -> bool {
    faults.intersects(Faults::SUPPLY | Faults::ERROR_ALARM)
}
