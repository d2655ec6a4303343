//! Signals in the samples of a channel that no term of the noise model has: a slow periodic one that is no sinusoid, a line whose
//! frequency runs, and disturbances that begin at once and decay. What was named in their place is taken back.

use crate::bounds::BoundedEstimate;
use crate::effects::{Chirp, Effect, Observation, Unexplained, UnexplainedPlace};
use crate::samples::uniform_series::UniformSeries;
use crate::spectra::decaying_disturbances::DecayingDisturbances;
use crate::spectra::frequency_track::FrequencyTrack;
use crate::spectra::periodic_signal::PeriodicSignal;
use crate::spectra::spectral_lines::MergedLine;
use std::f64::consts::PI;

/// Shortest time constant of a process, in periods of a periodic signal, that may be the signal's: its jumps and slopes have the
/// spectrum of one with its time scale.
const LEAST_OF_PERIOD: f64 = 0.02;
/// Time constants of a process, in periods of a line, that may be the line's: the Allan deviation of the process is largest at 1.89 time
/// constants, that of the line at 0.37 periods, and octaves tell either to a factor of 4.
const OF_TRACK_PERIOD: [f64; 2] = [0.05, 0.8];
/// Averaging time of the largest Allan deviation of a process with the spectrum of a Markov process, in time constants (IEEE Std 952,
/// annex C).
const MARKOV_PEAK: f64 = 1.89;
/// Farthest that the time constant of a process that was named and that of disturbances that decay are apart, in octaves: either is known
/// to a factor of 2.
const SAME_TIME_OCTAVES: f64 = 2.0;

/// The signals of one channel; none by default.
#[derive(Default)]
pub(crate) struct UnexplainedSignals {
    periodic: Option<PeriodicSignal>,
    track: Option<FrequencyTrack>,
    decays: Option<DecayingDisturbances>,
}

impl UnexplainedSignals {
    /// Those of `series`, a channel's samples less its covariates. `lines` are those of its spectrum; those that are a part of one
    /// of the signals are removed from them. `bands_of_curve` are the frequencies of the resonances of the curve, Hz, with what they
    /// take off its deviance.
    pub(crate) fn find(series: &UniformSeries, lines: &mut Vec<MergedLine>, bands_of_curve: &[(f64, f64)]) -> Self {
        let periodic = PeriodicSignal::find(series);
        let resolution = 1.0 / series.duration();
        if let Some(periodic) = &periodic {
            lines.retain(|line| !periodic.has(line.frequency.value, resolution));
        }
        // A stronger band in its range is a frequency that wanders, of which a straight track holds a part.
        let is_told = |track: &FrequencyTrack| {
            let of_lines = lines.iter().filter(|line| line.width.value > 0.0);
            let of_lines = of_lines.map(|line| (line.frequency.value, line.statistic));
            let mut bands = of_lines.chain(bands_of_curve.iter().copied());
            bands.any(|(frequency, statistic)| track.passes(frequency) && 0.5 * statistic > track.energy())
        };
        let track = FrequencyTrack::find(series).filter(|track| !is_told(track));
        if let Some(track) = &track {
            lines.retain(|line| !track.passes(line.frequency.value) || 0.5 * line.statistic > track.energy());
        }
        // The falls of a slow periodic signal are told by that.
        let decays = if periodic.is_none() { DecayingDisturbances::find(series) } else { None };
        Self { periodic, track, decays }
    }

    /// Whether what an effect of the channel tells is a part of one of the signals. `lines` are the other lines of the spectrum; those
    /// of the curve are known to an octave.
    pub(crate) fn has(&self, effect: &Effect, lines: &[MergedLine]) -> bool {
        let is_process = |time_constant_s: f64| {
            let is_decay = |decays: &DecayingDisturbances| {
                (time_constant_s / decays.time_constant.value).log2().abs() <= SAME_TIME_OCTAVES
            };
            let is_periodic = |periodic: &PeriodicSignal| time_constant_s > LEAST_OF_PERIOD * periodic.period_s();
            let is_track = |track: &FrequencyTrack| {
                let [least, most] = OF_TRACK_PERIOD;
                let [first, last] = track.frequencies;
                (least / first.max(last)..=most / first.min(last)).contains(&time_constant_s)
            };
            self.periodic.as_ref().is_some_and(is_periodic)
                || self.track.as_ref().is_some_and(is_track)
                || self.decays.as_ref().is_some_and(is_decay)
        };
        let is_line = |frequency_hz: f64| {
            let is_in_spectrum = lines.iter().any(|line| line.frequency.value == frequency_hz);
            let is_periodic = |periodic: &PeriodicSignal| periodic.reaches(frequency_hz);
            let is_track = |track: &FrequencyTrack| track.passes(frequency_hz);
            let is_part = self.periodic.as_ref().is_some_and(is_periodic) || self.track.as_ref().is_some_and(is_track);
            is_part && !is_in_spectrum
        };
        match effect {
            Effect::MarkovProcess(of) => is_process(of.time_constant_s.value),
            Effect::TelegraphNoise(of) => is_process(of.time_constant_s.value),
            // An octave of the curve.
            Effect::Unexplained(of) => of.tau_s().is_some_and(|tau_s| {
                self.decays.as_ref().is_some_and(|decays| {
                    (tau_s.value / (MARKOV_PEAK * decays.time_constant.value)).log2().abs() <= SAME_TIME_OCTAVES
                })
            }),
            Effect::SinusoidalLine(of) => is_line(of.frequency_hz.value),
            Effect::ResonantLine(of) => is_line(of.frequency_hz.value),
            Effect::LinearDrift(_) => self.periodic.is_some(),
            // A sawtooth falls by π times the amplitude of its fundamental; less than a period from the ends of a record a fall is a step.
            Effect::LevelStep(of) => {
                let least = of.size.low.abs().min(of.size.high.abs());
                self.periodic.as_ref().is_some_and(|periodic| least < PI * periodic.amplitude)
            }
            _ => false,
        }
    }

    /// As they are reported, of a channel in `unit`.
    pub(crate) fn effects(&self, unit: &'static str) -> impl Iterator<Item = Effect> {
        let periodic = self.periodic.as_ref().map(|periodic| Effect::from(periodic_effect(periodic)));
        let track = self.track.as_ref().map(|track| Effect::from(chirp(track, unit)));
        let decays = self.decays.as_ref().map(|decays| Effect::from(decays_effect(decays)));
        periodic.into_iter().chain(track).chain(decays)
    }
}

fn periodic_effect(periodic: &PeriodicSignal) -> Unexplained {
    Unexplained {
        place: UnexplainedPlace::Frequency(periodic.frequency),
        excess_percent: Some(periodic.harmonics_percent),
        observation: Observation::PeriodicSignal {
            harmonics: periodic.harmonics(),
            sum: periodic.sum,
            p_value: periodic.p_value,
        },
    }
}

fn chirp(track: &FrequencyTrack, unit: &'static str) -> Chirp {
    let FrequencyTrack { frequencies, error, duration_s, .. } = *track;
    let bounded = |value: f64, error: f64| BoundedEstimate::new(value, value - error, value + error);
    let [first, last] = frequencies;
    Chirp {
        start_hz: bounded(first, error),
        end_hz: bounded(last, error),
        rate_hz_per_s: bounded((last - first) / duration_s, 2.0 * error / duration_s),
        amplitude: track.amplitude.in_unit(unit),
        excess: track.excess,
        p_value: track.p_value,
    }
}

fn decays_effect(decays: &DecayingDisturbances) -> Unexplained {
    Unexplained {
        place: UnexplainedPlace::AveragingTime(decays.time_constant.scaled(MARKOV_PEAK)),
        excess_percent: None,
        observation: Observation::DecayingDisturbances {
            time_constant_s: decays.time_constant.value,
            sum: decays.sum,
            reversed: decays.reversed,
            p_value: decays.p_value,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::UnexplainedSignals;
    use crate::bounds::BoundedEstimate;
    use crate::effects::{
        Effect, LineEvidence, LineSource, MarkovEvidence, MarkovProcess, ResonantLine, SpectrumEvidence,
    };
    use crate::samples::uniform_series::UniformSeries;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;
    use std::f64::consts::TAU;

    const SAMPLES: usize = 40_000;
    const RATE_HZ: f64 = 100.0;

    /// White noise of deviation 1 over 400 s with a signal of the time.
    fn signals(signal: impl Fn(f64) -> f64) -> UnexplainedSignals {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let value = |at: usize| signal(at as f64 / RATE_HZ) + random.sample::<f64, _>(StandardNormal);
        let series = UniformSeries::new(1.0 / RATE_HZ, (0..SAMPLES).map(value).collect());
        UnexplainedSignals::find(&series, &mut Vec::new(), &[])
    }

    fn markov(time_constant_s: f64) -> Effect {
        MarkovProcess {
            deviation: BoundedEstimate::exact(1.0).in_unit("g"),
            time_constant_s: BoundedEstimate::exact(time_constant_s),
            evidence: MarkovEvidence::Spectrum { corner_hz: 1.0, gain: 10.0 },
        }
        .into()
    }

    fn resonance(frequency_hz: f64) -> Effect {
        let source =
            LineSource::Spectrum(SpectrumEvidence { frequency_hz, width_hz: None, sigmas: 9.0, p_value: 1e-9 });
        ResonantLine {
            frequency_hz: BoundedEstimate::exact(frequency_hz),
            bandwidth_hz: BoundedEstimate::exact(0.1 * frequency_hz),
            deviation: BoundedEstimate::exact(1.0).in_unit("g"),
            multiples: None,
            evidence: LineEvidence { has_width: true, source },
        }
        .into()
    }

    #[test]
    fn names_in_the_place_of_a_slow_signal_are_taken_back() {
        // Harmonics of 40,000/4·(0.3/(πk))², 91/k², over the noise.
        let of_40_s = signals(|time_s| 0.3 * (time_s / 40.0).fract());
        let found: Vec<Effect> = of_40_s.effects("g").collect();
        let [effect_of_40_s] = &found[..] else { panic!("{found:?}") };
        assert!(matches!(effect_of_40_s, Effect::Unexplained(_)), "{found:?}");
        // The resolution is 2.5 mHz, of which the frequency is known to a tenth.
        assert!((effect_of_40_s.frequency_hz().expect("one").value - 0.025).abs() < 0.000_25, "{found:?}");
        assert!(of_40_s.has(&markov(9.0), &[]));
        assert!(of_40_s.has(&resonance(0.05), &[]));
        assert!(!of_40_s.has(&markov(0.05), &[]));
        assert!(!of_40_s.has(&resonance(2.0), &[]));
    }

    #[test]
    fn names_in_the_place_of_a_running_frequency_are_taken_back() {
        // 0.15²·40,000/4 = 225 over the noise.
        let running = signals(|time_s| 0.15 * (TAU * (4.0 + 0.005 * time_s) * time_s).sin());
        let found: Vec<Effect> = running.effects("g").collect();
        let [track] = &found[..] else { panic!("{found:?}") };
        let Effect::Chirp(chirp) = track else { panic!("{track:?}") };
        // From 4 to 8 Hz, within the ordinates of 64 segments of 6.25 s.
        assert!((chirp.start_hz.value - 4.0).abs() < 0.2 && (chirp.end_hz.value - 8.0).abs() < 0.2, "{chirp:?}");
        assert!((chirp.rate_hz_per_s.low..=chirp.rate_hz_per_s.high).contains(&0.01), "{chirp:?}");
        assert!((chirp.amplitude.low..=chirp.amplitude.high).contains(&0.15), "{chirp:?}");
        assert!(running.has(&resonance(6.0), &[]));
        assert!(running.has(&markov(0.05), &[]));
        assert!(!running.has(&markov(5.0), &[]));
        assert!(!running.has(&resonance(12.0), &[]));
        assert_eq!(signals(|_| 0.0).effects("g").count(), 0);
    }
}
