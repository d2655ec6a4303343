//! The Allan variance that an effect adds to a channel, by its reported parameters.
//!
//! | effect | Allan variance at `n` samples of period τ₀, in a record of M samples |
//! |---|---|
//! | terms of the noise model | their closed form |
//! | temperature, supply, acceleration | sensitivity² times that of the measured covariate |
//! | a lag, a curvature, a rectified vibration | that of the bias which the samples are corrected for |
//! | spikes of size A, λ a second | white noise: λτ₀A²/n |
//! | a step of size A | A²·n/(3(M − 2n + 1)): the squared second differences that it touches, averaged over all |
//! | values rounded to steps of Δ | white noise: Δ²/(12n) |
//! | a knock at L times the level for a part p of the record | (L² − 1)·p times that of the channel without it |

use crate::effects::{AddedVariance, AveragingTime};
use crate::report::{ChannelReport, CurvePoint};
use crate::rivals::cause::Shown;
use measurement::{Quantity, SensorProfile};

/// The part of the channel's Allan variance that is due to the effect, in percent, at the averaging time where it is
/// largest, of those up to an eighth of the record. `None` where an effect adds no variance of its own: a filter, a clock,
/// lost samples.
pub(super) fn percent(shown: &Shown, channels: &[ChannelReport], profile: &SensorProfile) -> Option<f64> {
    let channel = &channels[shown.channel];
    let largest = channel.samples / 8;
    let modelled = channel.curve.iter().zip(&channel.refitted.adev).filter(|(point, _)| point.n <= largest);
    let share = |(point, adev): (&CurvePoint, &f64)| {
        let adev_of = |quantity: Quantity, axis: &str| {
            let is_meant = |report: &&ChannelReport| {
                profile.channel(&report.name).is_some_and(|of| of.quantity == quantity && of.axis == axis)
            };
            let curve = &channels.iter().find(is_meant)?.curve;
            Some(curve.iter().find(|other| other.n == point.n)?.adev)
        };
        let at = AveragingTime {
            n: point.n,
            period_s: point.tau_s / point.n as f64,
            samples: channel.samples,
            model_avar: adev * adev,
            adev_of: &adev_of,
        };
        let added: AddedVariance = shown.parts.iter().map(|part| part.kind().avar(&at)).sum();
        let own = added.modelled + added.corrected;
        let total = at.model_avar.max(added.modelled) + added.corrected;
        // Rounding can take a whole share beyond 100.
        (own > 0.0 && total.is_finite()).then(|| (100.0 * own / total).min(100.0))
    };
    modelled.filter_map(share).reduce(f64::max)
}
