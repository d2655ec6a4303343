//! The channels that a burst refuses, by the driver's rule, as channels that are estimated.

use crate::channels::{CHANNELS, ChannelSet};
use adis16405_driver::{Faults, Validity};

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
