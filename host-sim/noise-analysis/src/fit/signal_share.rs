//! The share of signals in the Allan variance of a channel: a slow periodic one that is no sinusoid, and a line whose frequency runs.
//!
//! No term of the noise model has them. They are independent of the noise beneath, so that their variances add: a model is fitted to the
//! curve less their share, and the share is a part of what the model foretells. A periodic signal is the same in any part of a recording.
//! A frequency that runs goes on at the same rate.

use crate::OCTAVES;
use crate::bounds::BoundedEstimate;
use crate::effects::{avar_of_harmonics, avar_of_run};
use crate::spectra::frequency_track::FrequencyTrack;
use crate::spectra::periodic_signal::PeriodicSignal;
use allan_core::{AllanPoint, Curve, Model};

/// Amplitudes that are tried, in parts of the way from the estimate to either 95 % bound: half of that is a standard deviation.
const STEPS: [f64; 5] = [-1.0, -0.5, 0.0, 0.5, 1.0];
/// The Allan variance that the signals in a part of a recording add to a channel.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct SignalShare {
    periodic: Option<Harmonics>,
    run: Option<Run>,
}

#[derive(Debug, Clone, PartialEq)]
struct Harmonics {
    /// Frequency of the fundamental, Hz.
    frequency: f64,
    /// Amplitudes from that of the fundamental on, in the unit of the channel.
    amplitudes: Vec<f64>,
    /// Factors from the amplitudes to their bounds.
    bounds: [f64; 2],
}

#[derive(Debug, Clone, PartialEq)]
struct Run {
    amplitude: f64,
    /// Factors from the amplitude to its bounds.
    bounds: [f64; 2],
    /// At the beginning and at the end of the part, Hz.
    frequencies: [f64; 2],
}

impl SignalShare {
    pub(crate) fn new(periodic: Option<&PeriodicSignal>, track: Option<&FrequencyTrack>) -> Self {
        let harmonics = |found: &PeriodicSignal| Harmonics {
            frequency: found.frequency.value,
            amplitudes: std::iter::once(found.amplitude.value).chain(found.harmonics.iter().copied()).collect(),
            bounds: bounds(found.amplitude),
        };
        let run = |found: &FrequencyTrack| Run {
            amplitude: found.amplitude.value,
            bounds: bounds(found.amplitude),
            frequencies: found.frequencies,
        };
        Self { periodic: periodic.map(harmonics), run: track.map(run) }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.periodic.is_none() && self.run.is_none()
    }

    pub(crate) fn has_run(&self) -> bool {
        self.run.is_some()
    }

    /// The signals from one time to another, in lengths of the part: 1 to 2 is as long a part that follows it.
    ///
    /// A frequency beyond half the sample rate shows at its alias. One below 0 is that of a turn the other way, which has the same line.
    pub(crate) fn within(&self, times: [f64; 2]) -> Self {
        let mut within = self.clone();
        if let Some(Run { frequencies, .. }) = &mut within.run {
            let [first, last] = *frequencies;
            *frequencies = times.map(|time| first + (last - first) * time);
        }
        within
    }

    /// The same with amplitudes from their lower bounds to their upper ones, each signal's by itself.
    pub(crate) fn within_bounds(&self) -> impl Iterator<Item = Self> {
        let factor = |[low, high]: [f64; 2], step: f64| {
            if step < 0.0 { 1.0 + step * (1.0 - low) } else { 1.0 + step * (high - 1.0) }
        };
        let steps = |is_there: bool| if is_there { &STEPS[..] } else { &[0.0] };
        let of_run = steps(self.run.is_some());
        let steps = steps(self.periodic.is_some()).iter().flat_map(move |of| of_run.iter().map(move |run| (*of, *run)));
        steps.map(move |(of_periodic, of_run)| {
            let mut scaled = self.clone();
            if let Some(Harmonics { amplitudes, bounds, .. }) = &mut scaled.periodic {
                amplitudes.iter_mut().for_each(|amplitude| *amplitude *= factor(*bounds, of_periodic));
            }
            if let Some(Run { amplitude, bounds, .. }) = &mut scaled.run {
                *amplitude *= factor(*bounds, of_run);
            }
            scaled
        })
    }

    pub(crate) fn avar(&self, n: u64, period_s: f64) -> f64 {
        let of_periodic = |Harmonics { frequency, amplitudes, .. }: &Harmonics| {
            avar_of_harmonics(*frequency, amplitudes.iter().copied(), n, period_s)
        };
        let of_run = |Run { amplitude, frequencies, .. }: &Run| avar_of_run(*amplitude, *frequencies, n, period_s);
        self.periodic.as_ref().map_or(0.0, of_periodic) + self.run.as_ref().map_or(0.0, of_run)
    }

    /// The curve without them, at least a tenth of each point. Its scatter stays: a point that is mostly signal says little of the noise.
    pub(crate) fn left_of(&self, curve: &Curve<OCTAVES>) -> Curve<OCTAVES> {
        let mut left = curve.clone();
        if !self.is_empty() {
            left.subtract_interpolation(|n| self.avar(n, curve.sample_period()));
        }
        left
    }

    /// The Allan variance of `model` with these signals, and the degrees of freedom of a `point` that measures it: those of its noise.
    pub(crate) fn predicted(&self, model: &Model, point: &AllanPoint) -> (f64, f64) {
        (model.avar(point.n) + self.avar(point.n, model.sample_period()), model.edf(point))
    }

    /// The deviance from `curve` of `model` with these signals, over the averaging times up to an eighth of the curve.
    pub(crate) fn deviance(&self, model: &Model, curve: &Curve<OCTAVES>) -> f64 {
        let of = |point: &AllanPoint| {
            let (avar, edf) = self.predicted(model, point);
            let measured = point.avar / avar;
            edf * (measured - 1.0 - measured.ln())
        };
        let is_compared = |point: &&AllanPoint| point.n <= curve.samples() / 8 && point.avar > 0.0;
        curve.points().iter().filter(is_compared).map(of).sum()
    }
}

fn bounds(amplitude: BoundedEstimate) -> [f64; 2] {
    [amplitude.low, amplitude.high].map(|bound| if amplitude.value > 0.0 { bound / amplitude.value } else { 1.0 })
}

#[cfg(test)]
mod tests {
    use super::{Harmonics, Run, SignalShare};
    use crate::OVERLAP;
    use allan_core::Cascade;
    use std::f64::consts::TAU;

    const PERIOD_S: f64 = 0.01;
    const SAMPLES: usize = 60_000;

    /// The frequency of a line rises from 30 to 60 Hz in one part of a record and from 60 to 90 Hz in the next, which samples at 100 Hz show
    /// as 40 to 10 Hz; that of another falls from 6 Hz to 1 Hz, through 0 to 4 Hz the other way. The Allan variance of the samples of the
    /// next part is by definition half the mean square of the second differences of their sums, over n².
    #[test]
    fn a_frequency_goes_on_at_the_same_rate() {
        const AMPLITUDE: f64 = 0.3;
        let duration_s = SAMPLES as f64 * PERIOD_S;
        for frequencies in [[30.0, 60.0], [6.0, 1.0]] {
            let [first, last] = frequencies;
            let sample = |at: usize| {
                let time_s = at as f64 * PERIOD_S;
                AMPLITUDE * (TAU * (first + 0.5 * (last - first) * time_s / duration_s) * time_s).sin()
            };
            let mut sums = vec![0.0];
            (0..SAMPLES).for_each(|at| sums.push(sums[at] + sample(SAMPLES + at)));
            let share =
                SignalShare { periodic: None, run: Some(Run { amplitude: AMPLITUDE, bounds: [1.0; 2], frequencies }) };
            let next = share.within([1.0, 2.0]);
            for n in [1_usize, 2, 4, 8, 16] {
                let differences = sums.windows(2 * n + 1).map(|of| (of[2 * n] - 2.0 * of[n] + of[0]) / n as f64);
                let expected = 0.5 * differences.map(|of| of * of).sum::<f64>() / (SAMPLES + 1 - 2 * n) as f64;
                let found = next.avar(n as u64, PERIOD_S);
                assert!((found / expected - 1.0).abs() < 0.01, "{frequencies:?}, {n}: {found} {expected}");
            }
        }
    }

    /// One amplitude at its lower bound beside the other at its upper one is among those that are tried.
    #[test]
    fn the_amplitudes_of_two_signals_are_tried_independently() {
        let of = |periodic: f64, run: f64| SignalShare {
            periodic: Some(Harmonics { frequency: 0.02, amplitudes: vec![periodic], bounds: [0.5, 1.5] }),
            run: Some(Run { amplitude: run, bounds: [0.8, 1.2], frequencies: [3.0, 5.0] }),
        };
        let expected = of(0.5, 1.2);
        let is_near = |tried: SignalShare| {
            let [found, expected] = [8, 512].map(|n| [&tried, &expected].map(|of| of.avar(n, PERIOD_S)));
            [found, expected].iter().all(|[found, expected]| (found / expected - 1.0).abs() < 1e-9)
        };
        assert!(of(1.0, 1.0).within_bounds().any(is_near));
        assert_eq!(SignalShare { periodic: None, ..of(1.0, 1.0) }.within_bounds().count(), 5);
    }

    /// A line that is alone in a record has all of its variance: a tenth is left.
    #[test]
    fn a_tenth_of_a_point_is_left() {
        let mut cascade = Cascade::<{ crate::OCTAVES }, OVERLAP>::new();
        let line = |at: usize| 1000.0 * (TAU * 7.0 * PERIOD_S * at as f64).sin();
        (0..SAMPLES).for_each(|at| cascade.push(line(at).round() as i32));
        let curve = cascade.curve(PERIOD_S);
        let share = SignalShare {
            periodic: None,
            run: Some(Run { amplitude: 1000.0, bounds: [1.0; 2], frequencies: [7.0; 2] }),
        };
        let left = share.left_of(&curve);
        for (left, point) in left.points().iter().zip(curve.points()).take(3) {
            assert!((left.avar / point.avar - 0.1).abs() < 1e-9, "{left:?}");
        }
        assert_eq!(SignalShare::default().left_of(&curve), curve);
    }
}
