//! The estimated channels, their sets and their estimator.

use adis16405_driver::Channel;
use allan_core::Cascade;

/// Channels that are estimated, by index: the six inertial channels, then the covariates temperature and supply.
pub const CHANNELS: [Channel; 8] = {
    let [a, b, c, d, e, f] = Channel::INERTIAL;
    [a, b, c, d, e, f, Channel::Temp, Channel::Supply]
};
pub(crate) const INERTIAL: usize = Channel::INERTIAL.len();
/// Number of gyros, which come first in [`CHANNELS`].
pub(crate) const GYROS: usize = 3;

/// Octaves of averaging factors on the device: up to 2²³ samples, 11 hours at 204.8 samples a second.
pub const OCTAVES: usize = 24;
/// Overlap of the second differences on the device.
pub const OVERLAP: usize = 8;

/// The streaming estimator of one channel.
pub type ChannelEstimator = Cascade<OCTAVES, OVERLAP>;

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct ChannelSet(pub(crate) u8);

impl ChannelSet {
    pub(crate) const EMPTY: Self = Self(0);
    pub(crate) const ALL: Self = Self(u8::MAX);
    const INERTIAL: Self = Self((1 << INERTIAL) - 1);

    pub(crate) const fn contains(self, index: usize) -> bool {
        self.0 >> index & 1 != 0
    }

    pub(crate) const fn is_empty(self) -> bool {
        self.0 == 0
    }

    pub(crate) const fn has_all_inertial(self) -> bool {
        self.0 & Self::INERTIAL.0 == Self::INERTIAL.0
    }

    pub(crate) const fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    pub(crate) fn insert_if(&mut self, index: usize, condition: bool) {
        self.0 |= u8::from(condition) << index;
    }
}
