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

/// Averaging time for an angle or a velocity, s.
const MINUTE_S: f64 = 60.0;

/// Parts of a channel's Allan variance that are due to an effect, in percent, at averaging times up to an eighth of the record.
pub(super) struct Shares {
    /// At the averaging time where it is largest.
    pub(super) largest: f64,
    /// At the octave of [`MINUTE_S`].
    pub(super) after_minute: Option<f64>,
}

impl Shares {
    /// `None` where the effect adds no variance of its own: a filter, a clock, lost samples.
    pub(super) fn new(shown: &Shown, channels: &[ChannelReport], profile: &SensorProfile) -> Option<Self> {
        let channel = &channels[shown.channel];
        let modelled = channel.curve.iter().zip(&channel.refitted.adev);
        let shares: Vec<(f64, f64)> = modelled
            .filter(|(point, _)| point.n <= channel.samples / 8)
            .filter_map(|(point, adev)| Some((point.tau_s, percent(shown, channels, profile, point, adev * adev)?)))
            .collect();
        let is_minute = |(tau_s, _): &&(f64, f64)| (tau_s / MINUTE_S).log2().round() == 0.0;
        let after_minute = shares.iter().find(is_minute).map(|of| of.1);
        let largest = shares.iter().map(|of| of.1).fold(0.0, f64::max);
        (largest > 0.0).then_some(Self { largest, after_minute })
    }
}

/// The part at one point of the channel's curve; `None` where it is not finite.
fn percent(
    shown: &Shown,
    channels: &[ChannelReport],
    profile: &SensorProfile,
    point: &CurvePoint,
    model_avar: f64,
) -> Option<f64> {
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
        samples: channels[shown.channel].samples,
        model_avar,
        adev_of: &adev_of,
    };
    let added: AddedVariance = shown.parts.iter().map(|part| part.kind().avar(&at)).sum();
    let own = added.modelled + added.corrected;
    let total = model_avar.max(added.modelled) + added.corrected;
    // Rounding can take a whole share beyond 100.
    (own >= 0.0 && total > 0.0 && total.is_finite()).then(|| (100.0 * own / total).min(100.0))
}
