//! A channel's samples without what they follow.

use super::study::Following;
use crate::series::Series;

/// `series` less the covariates of `following`: `causes` are the samples of all that the part holds.
///
/// The covariates' own noise comes along. `None` where the channel follows nothing, or a covariate has other samples.
pub(super) fn compensated(series: &Series, following: &Following, causes: &[Series]) -> Option<Series> {
    let mut rest = series.clone();
    let mut followed = 0;
    for (place, sensitivity) in following.causes() {
        let cause = &causes[place];
        if cause.slots != series.slots {
            return None;
        }
        let level = cause.values.iter().sum::<f64>() / cause.values.len() as f64;
        for (value, cause) in rest.values.iter_mut().zip(&cause.values) {
            *value -= sensitivity.value * (cause - level);
        }
        followed += 1;
    }
    (followed > 0).then_some(rest)
}
