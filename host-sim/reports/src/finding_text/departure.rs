//! A departure from every model in words.

use super::shown_effect::ShownEffect;
use crate::rounding::{extremes, quantity, signed, significant, span};
use noise_analysis::effects::{Observation, Unexplained, UnexplainedPlace};

/// The excess of σ in each channel.
pub(crate) fn excess_percent(shown: &[ShownEffect]) -> Vec<f64> {
    let excesses = shown.iter().filter_map(|shown| shown.effect.parameters().remove("excess_percent"));
    excesses.map(|of| of.value).collect()
}

/// Amount and place of a departure from every model; `percent` is the excess of σ per channel.
pub(crate) fn departure(of: &Unexplained, percent: &[f64]) -> String {
    let place = match of.place {
        UnexplainedPlace::LineOfCurve { tau_s, frequency_hz } => {
            format!("around τ = {}, as by a line at {}", span(tau_s.value), quantity(frequency_hz.value, "Hz"))
        }
        UnexplainedPlace::AveragingTime(tau_s) => format!("around τ = {}", span(tau_s.value)),
        UnexplainedPlace::Frequency(frequency_hz) => format!("around {}", quantity(frequency_hz.value, "Hz")),
    };
    let (low, high) = extremes(percent.iter().copied());
    let range = |low: String, high: String| if low == high { high } else { format!("{low} to {high}") };
    let size = |of: f64| significant(of.abs(), 2);
    match (percent, &of.observation) {
        ([], _) => format!("the data departs from the model {place}"),
        (_, Observation::LevelByTemperature { .. }) => {
            format!("the noise changes with the temperature, by {} %", range(signed(low, 2), signed(high, 2)))
        }
        _ if low >= 0.0 => format!("σ is {} % above the model {place}", range(size(low), size(high))),
        _ if high < 0.0 => format!("σ is {} % below the model {place}", range(size(high), size(low))),
        _ => format!("σ is up to {} % below and {} % above the model {place}", size(low), size(high)),
    }
}
