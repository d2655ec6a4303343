//! Signals in the samples of a channel that no effect of a name has: a slow periodic one that is no sinusoid, and a line whose
//! frequency runs. What was named in their place is taken back.

use crate::distributions::NORMAL_975;
use crate::findings::{Effect, Parameter};
use crate::spectra::frequency_track::FrequencyTrack;
use crate::spectra::periodic_signal::PeriodicSignal;
use crate::spectral_lines::MergedLine;
use crate::uniform_series::UniformSeries;

/// Shortest time constant of a process, in periods of a periodic signal, that may be the signal's: its jumps and slopes have the
/// spectrum of one with its time scale.
const LEAST_OF_PERIOD: f64 = 0.02;
/// Time constants of a process, in periods of a line, that may be the line's: the Allan deviation of the process is largest at 1.89 time
/// constants, that of the line at 0.37 periods, and octaves tell either to a factor of 4.
const OF_TRACK_PERIOD: [f64; 2] = [0.05, 0.8];
/// Half the width of a resonance that may be a track, over the range of the track.
const LEAST_OF_TRACK: f64 = 0.5;

/// The signals of one channel.
pub(crate) struct UnexplainedSignals {
    periodic: Option<PeriodicSignal>,
    track: Option<FrequencyTrack>,
}

impl UnexplainedSignals {
    /// Those of `series`, a channel's samples less its covariates. `lines` are those of its spectrum; those that are a part of one
    /// of the signals are removed from them.
    pub(crate) fn find(series: &UniformSeries, lines: &mut Vec<MergedLine>) -> Self {
        let periodic = PeriodicSignal::find(series);
        let resolution = 1.0 / series.duration();
        if let Some(periodic) = &periodic {
            lines.retain(|line| !periodic.has(line.frequency.value, resolution));
        }
        let is_stronger = |line: &MergedLine, track: &FrequencyTrack| 0.5 * line.statistic > track.energy();
        // A stronger resonance that covers the track is what wanders there.
        let is_told = |track: &FrequencyTrack| {
            let [first, last] = track.frequencies;
            lines.iter().any(|line| {
                let covers = line.width.value > LEAST_OF_TRACK * (last - first).abs();
                covers && track.passes(line.frequency.value) && is_stronger(line, track)
            })
        };
        let track = FrequencyTrack::find(series).filter(|track| !is_told(track));
        if let Some(track) = &track {
            lines.retain(|line| !track.passes(line.frequency.value) || is_stronger(line, track));
        }
        Self { periodic, track }
    }

    /// None, of a channel that is not traced.
    pub(crate) fn none() -> Self {
        Self { periodic: None, track: None }
    }

    /// Whether what an effect of the channel tells is a part of one of the signals.
    pub(crate) fn has(&self, effect: &Effect) -> bool {
        match effect.kind.as_str() {
            "markov" | "telegraph" => effect.parameters.get("time_constant").is_some_and(|time| {
                let is_periodic = |periodic: &PeriodicSignal| time.value > LEAST_OF_PERIOD * periodic.period_s();
                let is_track = |track: &FrequencyTrack| {
                    let [least, most] = OF_TRACK_PERIOD;
                    let [first, last] = track.frequencies;
                    (least / first.max(last)..=most / first.min(last)).contains(&time.value)
                };
                self.periodic.as_ref().is_some_and(is_periodic) || self.track.as_ref().is_some_and(is_track)
            }),
            "rate_ramp" => self.periodic.is_some(),
            _ => false,
        }
    }

    /// As they are reported.
    pub(crate) fn effects(&self) -> impl Iterator<Item = Effect> {
        self.periodic.as_ref().map(periodic_effect).into_iter().chain(self.track.as_ref().map(track_effect))
    }
}

fn periodic_effect(periodic: &PeriodicSignal) -> Effect {
    let evidence = format!(
        "the same every {:.1} s, but no sinusoid: the harmonics have {:.0} % of the deviation of the fundamental, {:.0} times the noise, by \
         chance at any period {:.0e}",
        periodic.period_s(),
        periodic.harmonics_percent.value,
        periodic.sum,
        periodic.p_value,
    );
    let count = periodic.harmonics();
    let parameters = [
        ("frequency", periodic.frequency.clone()),
        ("excess_percent", periodic.harmonics_percent.clone()),
        ("harmonics", Parameter::new(count, count, count, "")),
    ];
    Effect::new("unexplained", parameters, evidence)
}

fn track_effect(track: &FrequencyTrack) -> Effect {
    let [first, last] = track.frequencies;
    let middle = 0.5 * (first + last);
    let frequency = Parameter::new(middle, first.min(last) - track.error, first.max(last) + track.error, "Hz");
    // Of the Allan deviation of what a filter around the line would pass.
    let percent = |excess: f64| 100.0 * ((1.0 + excess.max(0.0)).sqrt() - 1.0);
    let half = NORMAL_975 * track.excess_error;
    let excess = Parameter::new(percent(track.excess), percent(track.excess - half), percent(track.excess + half), "%");
    let evidence = format!(
        "a line whose frequency runs from {first:.2} to {last:.2} Hz over the record, {:+.0} % of the noise of short spectra, by chance \
         anywhere {:.0e}: a speed that changes",
        100.0 * track.excess,
        track.p_value,
    );
    Effect::new("unexplained", [("frequency", frequency), ("excess_percent", excess)], evidence)
}
