//! What the device has learnt, applied to its raw stream.

use adis16405_driver::{Channel, GyroRange, OutputWord};
use link::{LearnedMessage, RawBurst, ReportedRegressor};
use std::collections::BTreeMap;

/// What each channel follows, as the device said last.
#[derive(Default)]
pub struct Compensation {
    /// By the channel's place in the burst.
    causes: BTreeMap<u8, Vec<ReportedRegressor>>,
}

/// A sample before and after, in the channel's unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Compensated {
    /// Which channel.
    pub channel: Channel,
    /// As measured.
    pub raw: f64,
    /// Less what follows the causes.
    pub compensated: f64,
}

impl Compensation {
    /// Takes what an epoch has taught of a channel in the place of what was known.
    pub fn learn(&mut self, learnt: &LearnedMessage) {
        self.causes.insert(learnt.channel, learnt.regressors.to_vec());
    }

    /// The compensated channels of a burst that was read at this setting of SENS_AVG; those that follow nothing are left
    /// out.
    pub fn of(&self, burst: &RawBurst, sens_avg: u16) -> Vec<Compensated> {
        let Some(range) = GyroRange::from_sens_avg(sens_avg) else { return Vec::new() };
        let value = |place: u8| {
            let channel = *Channel::ALL.get(usize::from(place))?;
            let word = OutputWord(u16::from_be_bytes(burst.words[usize::from(place)]));
            Some((channel, f64::from(word.counts(channel)) * channel.lsb(range) + channel.offset()))
        };
        let compensated = |(&place, causes): (&u8, &Vec<ReportedRegressor>)| {
            let (channel, raw) = value(place).filter(|_| !causes.is_empty())?;
            let followed =
                |cause: &ReportedRegressor| Some(cause.value * (value(cause.covariate)?.1 - cause.reference));
            let compensated = raw - causes.iter().filter_map(followed).sum::<f64>();
            Some(Compensated { channel, raw, compensated })
        };
        self.causes.iter().filter_map(compensated).collect()
    }
}
