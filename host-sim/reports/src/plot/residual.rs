//! Measured over modelled, in percent: what the model does not explain.

use super::panel::Panel;
use super::{AFTER, BEFORE, Canvas, Drawn, RESIDUAL, effects_added, intervals, markers, shown};
use noise_analysis::report::{ChannelReport, CurvePoint, ModelReport};
use plotters::prelude::*;
use std::ops::Range;

/// Points against the best model of the report; when there are two, the declared one as a line.
pub(super) fn draw(canvas: &Canvas<'_>, taus: Range<f64>, channel: &ChannelReport) -> Drawn {
    let added = effects_added(channel);
    let best = if added { &channel.after } else { &channel.before };
    let points = ratios(channel, best);
    let declared = if added { ratios(channel, &channel.before) } else { Vec::new() };
    let extreme = points.iter().chain(&declared).map(|r| r.percent.abs()).fold(0.0, f64::max);
    let limit = (extreme * 1.25).clamp(4.0, 250.0);
    let area = Panel::new(canvas, &RESIDUAL, taus, -limit..limit);
    area.decades_across(true)?;
    area.steps_up(step(limit))?;
    area.frame()?;
    area.label_up("σ / model − 1, %")?;
    area.label_across("averaging time τ, s")?;

    let bounds: Vec<(f64, f64, f64)> = points
        .iter()
        .filter(|ratio| ratio.low.is_finite() && ratio.high.is_finite())
        .map(|ratio| (ratio.tau, area.clamp(ratio.low), area.clamp(ratio.high)))
        .collect();
    intervals(&area, &bounds)?;
    if added {
        let line: Vec<(f64, f64)> = declared.iter().map(|ratio| (ratio.tau, area.clamp(ratio.percent))).collect();
        area.area.draw(&PathElement::new(line, BEFORE.stroke_width(3)))?;
    }
    let colour = if added { AFTER } else { BEFORE };
    let zero = vec![(area.across.start, 0.0), (area.across.end, 0.0)];
    area.area.draw(&PathElement::new(zero, colour.stroke_width(4)))?;
    markers(&area, points.iter().map(|ratio| (ratio.tau, area.clamp(ratio.percent))))
}

/// One point of the lower panel: `log10` of the averaging time, and percent.
struct Ratio {
    tau: f64,
    percent: f64,
    low: f64,
    high: f64,
}

fn ratios(channel: &ChannelReport, model: &ModelReport) -> Vec<Ratio> {
    let pairs = channel.curve.iter().zip(model.adev.iter().copied());
    pairs
        .filter(|(point, adev)| shown(point.tau_s) && shown(point.adev) && shown(*adev))
        .map(|(point, adev)| Ratio::of(point, adev))
        .filter(|ratio| ratio.percent.is_finite())
        .collect()
}

impl Ratio {
    fn of(point: &CurvePoint, adev: f64) -> Self {
        let percent = |deviation: f64| 100.0 * (deviation / adev - 1.0);
        Ratio {
            tau: point.tau_s.log10(),
            percent: percent(point.adev),
            low: percent(point.low),
            high: percent(point.high),
        }
    }
}

/// A round distance that puts two or three labels on either side of zero.
fn step(limit: f64) -> f64 {
    const ROUND: [f64; 6] = [2.0, 5.0, 10.0, 20.0, 50.0, 100.0];
    ROUND.into_iter().find(|step| limit / step < 3.5).unwrap_or(100.0)
}

#[cfg(test)]
mod tests {
    use super::step;

    #[test]
    fn few_labels_on_either_side() {
        for limit in [4.0, 6.9, 12.0, 33.0, 60.0, 130.0, 250.0] {
            let labels = (limit / step(limit)).floor();
            assert!((1.0..=3.0).contains(&labels), "{limit}: {labels}");
        }
    }
}
