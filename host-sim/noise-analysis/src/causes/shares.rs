//! The Allan variance that an effect adds to a channel, by its reported parameters.
//!
//! | effect | Allan variance at `n` samples of period τ₀, in a record of M samples |
//! |---|---|
//! | terms of the noise model | their closed form |
//! | temperature, supply, acceleration | sensitivity² times that of the measured covariate |
//! | spikes of size A, λ a second | white noise: λτ₀A²/n |
//! | a step of size A | A²·n/(3(M − 2n + 1)): the squared second differences that it touches, averaged over all |
//! | values rounded to steps of Δ | white noise: Δ²/(12n) |
//! | a knock at L times the level for a part p of the record | (L² − 1)·p times that of the channel without it |

use super::cause::Shown;
use crate::findings::Effect;
use crate::report::ChannelReport;
use allan_core::NoiseTerm;
use allan_core::term::{Markov, Resonance, Sinusoid};
use measurement::{Quantity, SensorProfile};

/// Seconds in an hour: the rate of spikes is reported per hour.
const HOUR_S: f64 = 3600.0;
/// Kinds whose samples the models leave out, or are corrected for.
const NOT_IN_MODEL: [&str; 3] = ["spikes", "bias_step", "knock"];

/// The part of the channel's Allan variance that is due to the effect, in percent, at the averaging time where it is
/// largest, of those up to an eighth of the record. `None` where an effect adds no variance of its own: a filter, a clock,
/// lost samples.
pub(super) fn percent(shown: &Shown, channels: &[ChannelReport], profile: &SensorProfile) -> Option<f64> {
    let channel = &channels[shown.channel];
    let largest = channel.samples / 8;
    let modelled = channel.curve.iter().zip(&channel.refitted.adev).filter(|(point, _)| point.n <= largest);
    let share = |(point, adev): (&crate::report::CurvePoint, &f64)| {
        let period_s = point.tau_s / point.n as f64;
        let at = At { n: point.n, period_s, samples: channel.samples, rest: adev * adev };
        let own: f64 = shown.parts.iter().filter_map(|part| at.avar(part, channels, profile)).sum();
        let is_in_model = !NOT_IN_MODEL.contains(&shown.effect.kind.as_str());
        let total = if is_in_model { at.rest.max(own) } else { at.rest + own };
        // Rounding can take a whole share beyond 100.
        (own > 0.0 && total.is_finite()).then(|| (100.0 * own / total).min(100.0))
    };
    modelled.filter_map(share).reduce(f64::max)
}

/// An averaging factor of a record.
struct At {
    n: u64,
    period_s: f64,
    samples: u64,
    /// The model's Allan variance.
    rest: f64,
}

impl At {
    /// The Allan variance of an effect.
    fn avar(&self, effect: &Effect, channels: &[ChannelReport], profile: &SensorProfile) -> Option<f64> {
        let value = |name: &str| effect.parameters.get(name).map(|parameter| parameter.value);
        let term = |kind: NoiseTerm, size: f64| Some(size * size * kind.avar(self.n, self.period_s));
        let n = self.n as f64;
        match effect.kind.as_str() {
            "sinusoid" => term(NoiseTerm::Sinusoid(Sinusoid { frequency: value("frequency")? }), value("amplitude")?),
            "resonance" => {
                let shape = Resonance { frequency: value("frequency")?, bandwidth: value("bandwidth")? };
                term(NoiseTerm::Resonance(shape), value("deviation")?)
            }
            "markov" | "common_mode" => {
                term(NoiseTerm::Markov(Markov { time_constant: value("time_constant")? }), value("deviation")?)
            }
            // Two levels that are equally frequent are two standard deviations apart.
            "telegraph" => {
                term(NoiseTerm::Markov(Markov { time_constant: value("time_constant")? }), 0.5 * value("amplitude")?)
            }
            "quantization" => match value("value") {
                Some(angle) => term(NoiseTerm::Quantization, angle),
                // Rounding error is uniform within a step, and white where noise reaches over several steps.
                None => Some(value("step")?.powi(2) / 12.0 / n),
            },
            "rate_ramp" => term(NoiseTerm::RateRamp, value("slope")?),
            "temperature" => self.covariate(Quantity::Temperature, "", value("sensitivity")?, channels, profile),
            "supply" => self.covariate(Quantity::SupplyVoltage, "", value("sensitivity")?, channels, profile),
            "acceleration" => Some(
                ["x", "y", "z"]
                    .into_iter()
                    .filter_map(|axis| {
                        let sensitivity = value(&format!("sensitivity_{axis}"))?;
                        self.covariate(Quantity::SpecificForce, axis, sensitivity, channels, profile)
                    })
                    .sum(),
            ),
            "spikes" => Some(value("rate")? / HOUR_S * self.period_s * value("size")?.powi(2) / n),
            "bias_step" => {
                let count = (self.samples + 1).checked_sub(2 * self.n).filter(|count| *count > 0)?;
                Some(value("size")?.powi(2) * n / (3.0 * count as f64))
            }
            "knock" => {
                let part = (value("to")? - value("from")?) / (self.samples as f64 * self.period_s);
                Some((value("level")?.powi(2) - 1.0).max(0.0) * part * self.rest)
            }
            _ => None,
        }
    }

    /// The Allan variance of `sensitivity` times a channel that was measured beside.
    fn covariate(
        &self,
        quantity: Quantity,
        axis: &str,
        sensitivity: f64,
        channels: &[ChannelReport],
        profile: &SensorProfile,
    ) -> Option<f64> {
        let is_meant = |report: &&ChannelReport| {
            profile.channel(&report.name).is_some_and(|of| of.quantity == quantity && of.axis == axis)
        };
        let curve = &channels.iter().find(is_meant)?.curve;
        let adev = curve.iter().find(|point| point.n == self.n)?.adev;
        Some((sensitivity * adev).powi(2))
    }
}
