//! Channels of a measurement, and a value for each.

use crate::{MeasuredChannel, Measurement, Quantity};
use std::ops::{Index, IndexMut};
use std::slice;

/// A channel of all measurements with the same channels in the same order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ChannelId(usize);

impl ChannelId {
    /// Position among the channels of the measurement.
    #[must_use]
    pub fn position(self) -> usize {
        self.0
    }
}

/// A value for each channel of a measurement, in the order of its channels.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PerChannel<T>(Vec<T>);

impl<T> PerChannel<T> {
    /// The identifiers of the channels.
    pub fn ids(&self) -> impl DoubleEndedIterator<Item = ChannelId> + Clone + use<T> {
        (0..self.0.len()).map(ChannelId)
    }

    /// The values.
    pub fn iter(&self) -> slice::Iter<'_, T> {
        self.0.iter()
    }

    /// The values, for changes.
    pub fn iter_mut(&mut self) -> slice::IterMut<'_, T> {
        self.0.iter_mut()
    }

    /// The values in the order of the channels, for changes.
    pub fn as_mut_slice(&mut self) -> &mut [T] {
        &mut self.0
    }

    /// Each channel with its value.
    pub fn with_ids(&self) -> impl Iterator<Item = (ChannelId, &T)> + Clone {
        self.ids().zip(&self.0)
    }

    /// The values without the channels.
    #[must_use]
    pub fn into_vec(self) -> Vec<T> {
        self.0
    }

    /// The results of `of` for each value, by channel.
    #[must_use]
    pub fn map<U>(&self, of: impl FnMut(&T) -> U) -> PerChannel<U> {
        self.0.iter().map(of).collect()
    }
}

impl<T> FromIterator<T> for PerChannel<T> {
    fn from_iter<I: IntoIterator<Item = T>>(values: I) -> Self {
        Self(values.into_iter().collect())
    }
}

impl<T> From<Vec<T>> for PerChannel<T> {
    fn from(values: Vec<T>) -> Self {
        Self(values)
    }
}

impl<T> IntoIterator for PerChannel<T> {
    type Item = T;
    type IntoIter = std::vec::IntoIter<T>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.into_iter()
    }
}

impl<'a, T> IntoIterator for &'a PerChannel<T> {
    type Item = &'a T;
    type IntoIter = slice::Iter<'a, T>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.iter()
    }
}

impl<'a, T> IntoIterator for &'a mut PerChannel<T> {
    type Item = &'a mut T;
    type IntoIter = slice::IterMut<'a, T>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.iter_mut()
    }
}

impl<T> Index<ChannelId> for PerChannel<T> {
    type Output = T;

    fn index(&self, channel: ChannelId) -> &T {
        &self.0[channel.0]
    }
}

impl<T> IndexMut<ChannelId> for PerChannel<T> {
    fn index_mut(&mut self, channel: ChannelId) -> &mut T {
        &mut self.0[channel.0]
    }
}

impl Index<ChannelId> for Measurement {
    type Output = MeasuredChannel;

    fn index(&self, channel: ChannelId) -> &MeasuredChannel {
        &self.channels[channel.0]
    }
}

impl Measurement {
    /// The recorded channels.
    pub fn ids(&self) -> impl DoubleEndedIterator<Item = ChannelId> + Clone + use<> {
        (0..self.channels.len()).map(ChannelId)
    }

    /// The recorded channels of one quantity.
    pub fn of_quantity(&self, quantity: Quantity) -> impl Iterator<Item = ChannelId> {
        self.ids().filter(move |&channel| self[channel].profile.quantity == quantity)
    }

    /// The recorded gyroscopes and accelerometers.
    pub fn inertial(&self) -> impl Iterator<Item = ChannelId> {
        self.ids().filter(|&channel| self[channel].profile.quantity.is_inertial())
    }

    /// The recorded channel of this name.
    #[must_use]
    pub fn named(&self, name: &str) -> Option<ChannelId> {
        self.ids().find(|&channel| self[channel].profile.name == name)
    }
}
