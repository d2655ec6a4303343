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
