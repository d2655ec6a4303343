//! What is kept without power, as bytes: the settings that a person has made, and the models that were fitted to the last epoch.

use crate::channels::CHANNELS;
use crate::epoch::Regressor;
use crate::learner::EpochModel;
use crate::retained::RetainedSettings;
use crate::statistics::INERTIAL;
use serde::{Deserialize, Serialize};

/// Version of the layout; a record of another one is not read.
const FORMAT: u8 = 1;

/// The settings, in the order of their bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct StoredSettings {
    /// Value of SMPL_PRD: the rate.
    pub(crate) smpl_prd: u8,
    /// Value of SENS_AVG: range and filter.
    pub(crate) sens_avg: u16,
    /// Length of an epoch in s.
    pub(crate) epoch_s: u32,
    /// Seconds between reports.
    pub(crate) interval_s: u32,
    /// PROD_ID of a part that is taken for an ADIS16405.
    pub(crate) prod_id: u16,
    /// The stream of raw bursts is on.
    pub(crate) raw_stream: bool,
}

impl StoredSettings {
    pub(crate) fn new(settings: RetainedSettings, raw_stream: bool) -> Self {
        let RetainedSettings { smpl_prd, sens_avg, epoch_s, interval_s, prod_id, .. } = settings;
        Self { smpl_prd, sens_avg, epoch_s, interval_s, prod_id, raw_stream }
    }

    /// These settings in the place of those of `others`.
    pub(crate) fn apply_to(self, others: RetainedSettings) -> RetainedSettings {
        let Self { smpl_prd, sens_avg, epoch_s, interval_s, prod_id, raw_stream: _ } = self;
        RetainedSettings { smpl_prd, sens_avg, epoch_s, interval_s, prod_id, ..others }
    }

    /// Whether samples of `others` are of the same rate, range and filter.
    pub(crate) fn have_sensor_of(self, others: RetainedSettings) -> bool {
        (self.smpl_prd, self.sens_avg) == (others.smpl_prd, others.sens_avg)
    }
}

type Models = [EpochModel; INERTIAL];

/// Writes settings and models to `record` and returns the bytes that they take; `None` if there are too few.
pub(crate) fn encode<'r>(settings: &StoredSettings, models: &Models, record: &'r mut [u8]) -> Option<&'r [u8]> {
    postcard::to_slice(&(FORMAT, settings, models), record).ok().map(|bytes| &*bytes)
}

/// The settings in a record, and its rest, which has the models; `None` if it has another format.
pub(crate) fn decode_settings(record: &[u8]) -> Option<(StoredSettings, &[u8])> {
    let (&format, rest) = record.split_first()?;
    (format == FORMAT).then(|| postcard::take_from_bytes(rest).ok())?
}

/// Overwrites `models` with those in the rest of a record. Returns false, and leaves no model, if they are none.
pub(crate) fn decode_models(mut rest: &[u8], models: &mut Models) -> bool {
    // One after the other: together they would take some kB of stack several times.
    let decoded = models.iter_mut().all(|model| match decode_model(rest) {
        Some((decoded, later)) => {
            (*model, rest) = (decoded, later);
            true
        }
        None => false,
    });
    if !decoded {
        models.fill(EpochModel::EMPTY);
    }
    decoded
}

#[inline(never)]
fn decode_model(rest: &[u8]) -> Option<(EpochModel, &[u8])> {
    let (model, later): (EpochModel, _) = postcard::take_from_bytes(rest).ok()?;
    let is_channel = |regressor: &Regressor| regressor.covariate < CHANNELS.len();
    model.regressors.iter().all(is_channel).then_some((model, later))
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use std::vec;
    use std::vec::Vec;

    const SETTINGS: StoredSettings = StoredSettings {
        smpl_prd: 0x81,
        sens_avg: 0x0402,
        epoch_s: 3_600,
        interval_s: 60,
        prod_id: 16_400,
        raw_stream: true,
    };

    /// What format 1 is, by the rules of postcard: integers of more than 8 bits in groups of 7, the lowest first; then the models of the
    /// channels: that of the first with N, B and K, a term and a regressor, the others without any. Devices in use have it in their flash.
    fn kept() -> Vec<u8> {
        let mut bytes = vec![1, 0x81, 0x82, 0x08, 0x90, 0x1C, 0x3C, 0x90, 0x80, 0x01, 1];
        bytes.push(1);
        for coefficient in [0.5_f64, 0.25, 0.125] {
            bytes.extend(coefficient.to_le_bytes());
        }
        bytes.extend([1, 1]); // one term, angle random walk
        bytes.extend(0.75_f64.to_le_bytes());
        bytes.extend([1, 6]); // one regressor, temperature
        for value in [-0.01_f64, 0.001, 25.0] {
            bytes.extend(value.to_le_bytes());
        }
        bytes.extend([0; 3 * (INERTIAL - 1)]);
        bytes
    }

    #[test]
    fn the_kept_bytes_are_read_and_written_as_ever() {
        let (settings, rest) =
            decode_settings(&kept()).map(|(settings, rest)| (settings, rest.to_vec())).expect("format 1");
        assert_eq!(settings, SETTINGS);
        let mut models = [const { EpochModel::EMPTY }; INERTIAL];
        assert!(decode_models(&rest, &mut models));
        let (term, regressor) = (models[0].added_terms().count(), models[0].regressors[0]);
        assert_eq!(
            (term, regressor.covariate, regressor.value, regressor.error, regressor.reference),
            (0, 6, -0.01, 0.001, 25.0)
        );
        let mut record = [0; 512];
        assert_eq!(encode(&settings, &models, &mut record), Some(kept().as_slice()));
    }

    #[test]
    fn another_format_and_damaged_models_are_not_taken() {
        let mut models = [const { EpochModel::EMPTY }; INERTIAL];
        let other: Vec<u8> = kept().into_iter().enumerate().map(|(at, byte)| if at == 0 { 2 } else { byte }).collect();
        assert!(decode_settings(&other).is_none() && decode_settings(&[]).is_none());
        // The covariate of the regressor, which has to be a channel.
        let mut damaged = kept()[11..].to_vec();
        damaged[1 + 24 + 2 + 8 + 1] = CHANNELS.len() as u8;
        assert!(!decode_models(&damaged, &mut models));
        for end in 11..kept().len() {
            assert!(!decode_models(&kept()[11..end], &mut models), "{end} bytes");
            assert!(models.iter().all(|model| *model == EpochModel::EMPTY));
        }
    }
}
