//! State kept without power: the user's settings, and the models of the last epoch.

use crate::channels::CHANNELS;
use crate::epoch::Regressor;
use crate::learner::EpochModel;
use crate::retained::UserSettings;
use crate::statistics::INERTIAL;
use serde::{Deserialize, Serialize};

const FORMAT: u8 = 1;

/// The stored settings, in the order of their bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct StoredSettings {
    pub(crate) user: UserSettings,
    pub(crate) raw_stream: bool,
}

type Models = [EpochModel; INERTIAL];

/// Encodes settings and models into `record`; `None` without room.
pub(crate) fn encode<'r>(settings: &StoredSettings, models: &Models, record: &'r mut [u8]) -> Option<&'r [u8]> {
    postcard::to_slice(&(FORMAT, settings, models), record).ok().map(|bytes| &*bytes)
}

/// Decodes the settings, and returns them with the remaining bytes, the models. `None` for another format.
pub(crate) fn decode_settings(record: &[u8]) -> Option<(StoredSettings, &[u8])> {
    let (&format, rest) = record.split_first()?;
    (format == FORMAT).then(|| postcard::take_from_bytes(rest).ok())?
}

/// Decodes the models from the remaining bytes. False, and no model, if they are damaged.
pub(crate) fn decode_models(mut rest: &[u8], models: &mut Models) -> bool {
    // Models are decoded one by one to save stack.
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
        user: UserSettings { smpl_prd: 0x81, sens_avg: 0x0402, epoch_s: 3_600, interval_s: 60, prod_id: 16_400 },
        raw_stream: true,
    };

    /// A record of format 1 by postcard: groups of 7 bits, lowest first; the first channel has N, B, K, a term and a
    /// regressor. Devices in use have this format in their flash.
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
    fn the_kept_bytes_are_read_and_written_unchanged() {
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
        // A covariate that is not a channel is damage.
        let mut damaged = kept()[11..].to_vec();
        damaged[1 + 24 + 2 + 8 + 1] = CHANNELS.len() as u8;
        assert!(!decode_models(&damaged, &mut models));
        for end in 11..kept().len() {
            assert!(!decode_models(&kept()[11..end], &mut models), "{end} bytes");
            assert!(models.iter().all(|model| *model == EpochModel::EMPTY));
        }
    }
}
