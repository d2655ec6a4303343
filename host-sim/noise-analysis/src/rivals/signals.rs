//! Signals in the samples of a channel: a slow periodic one that is no sinusoid, a line whose frequency runs, and disturbances that begin
//! at once and decay; and the lines of the spectrum beside them.

use crate::bounds::BoundedEstimate;
use crate::effects::{Chirp, Periodic, ShotNoise};
use crate::rivals::proposal::{Origin, Proposal, Signal};
use crate::samples::uniform_series::UniformSeries;
use crate::spectra::decaying_disturbances::DecayingDisturbances;
use crate::spectra::frequency_track::FrequencyTrack;
use crate::spectra::periodic_signal::PeriodicSignal;
use crate::spectra::spectral_lines::MergedLine;

const HOUR_S: f64 = 3600.0;

#[derive(Clone)]
pub(crate) struct SampleSignals {
    periodic: Option<PeriodicSignal>,
    track: Option<FrequencyTrack>,
    decays: Option<DecayingDisturbances>,
}

impl SampleSignals {
    /// The signals in `series`, a channel's samples less its covariates.
    pub(crate) fn find(series: &UniformSeries) -> Self {
        Self {
            periodic: PeriodicSignal::find(series),
            track: FrequencyTrack::find(series),
            decays: DecayingDisturbances::find(series),
        }
    }
}

#[derive(Clone)]
pub(crate) struct SpectrumProposals {
    pub lines: Vec<MergedLine>,
    pub periodic: Option<PeriodicSignal>,
    pub track: Option<FrequencyTrack>,
    pub decays: Option<DecayingDisturbances>,
    /// Frequencies of the resonances of the curve, Hz, with what they take off its deviance.
    pub bands_of_curve: Vec<(f64, f64)>,
    pub resolution_hz: f64,
}

pub(crate) enum SpectrumClaim<'a> {
    Line(&'a MergedLine),
    Chirp(&'a FrequencyTrack),
    Decays,
}

impl SpectrumProposals {
    /// The signals in samples over so many seconds, beside the `lines` of their spectrum.
    pub(crate) fn new(
        signals: SampleSignals,
        duration_s: f64,
        lines: Vec<MergedLine>,
        bands_of_curve: Vec<(f64, f64)>,
    ) -> Self {
        let SampleSignals { periodic, track, decays } = signals;
        Self { lines, periodic, track, decays, bands_of_curve, resolution_hz: 1.0 / duration_s }
    }

    /// Frequencies of the bands of spectrum and curve, Hz, each with its statistic.
    pub(crate) fn bands(&self) -> impl Iterator<Item = (f64, f64)> {
        let of_lines = self.lines.iter().filter(|line| line.width.value > 0.0);
        of_lines.map(|line| (line.frequency.value, line.statistic)).chain(self.bands_of_curve.iter().copied())
    }

    /// The lines, and the signals in the order in which they are reported.
    pub(crate) fn into_lines_and_signals(self) -> (Vec<MergedLine>, Vec<Signal>) {
        let periodic = self.periodic.map(Signal::Periodic).into_iter();
        let signals = periodic.chain(self.track.map(Signal::Chirp)).chain(self.decays.map(Signal::Decays));
        (self.lines, signals.collect())
    }
}

pub(crate) fn proposal(signal: &Signal, unit: &'static str) -> Proposal {
    let origin = Origin::Signal(signal.clone());
    match signal {
        Signal::Periodic(found) => Proposal::new(periodic(found, unit), origin),
        Signal::Chirp(track) => Proposal::new(chirp(track, unit), origin),
        Signal::Decays(decays) => Proposal::new(shot_noise(decays, unit), origin),
    }
}

fn periodic(found: &PeriodicSignal, unit: &'static str) -> Periodic {
    Periodic {
        frequency_hz: found.frequency,
        amplitude: found.amplitude.in_unit(unit),
        harmonics_percent: found.harmonics_percent,
        harmonics: found.harmonics.clone(),
        sum: found.sum,
        p_value: found.p_value,
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

fn shot_noise(decays: &DecayingDisturbances, unit: &'static str) -> ShotNoise {
    ShotNoise {
        rate_per_hour: decays.rate_hz.scaled(HOUR_S),
        size: decays.size.in_unit(unit),
        time_constant_s: decays.time_constant,
        deviation: decays.deviation.in_unit(unit),
        sum: decays.sum,
        reversed: decays.reversed,
        p_value: decays.p_value,
    }
}

#[cfg(test)]
mod tests {
    use super::{SampleSignals, SpectrumProposals, proposal};
    use crate::effects::Effect;
    use crate::samples::uniform_series::UniformSeries;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;
    use std::f64::consts::{PI, TAU};

    const SAMPLES: usize = 40_000;
    const RATE_HZ: f64 = 100.0;

    /// The effects of white noise of deviation 1 over 400 s with a signal of the time.
    fn effects(signal: impl Fn(f64) -> f64) -> Vec<Effect> {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let value = |at: usize| signal(at as f64 / RATE_HZ) + random.sample::<f64, _>(StandardNormal);
        let series = UniformSeries::new(1.0 / RATE_HZ, (0..SAMPLES).map(value).collect());
        let found = SampleSignals::find(&series);
        let (_, signals) =
            SpectrumProposals::new(found, series.duration(), Vec::new(), Vec::new()).into_lines_and_signals();
        signals.iter().map(|signal| proposal(signal, "g").effect).collect()
    }

    #[test]
    fn a_slow_sawtooth_is_a_periodic_signal() {
        // Harmonics of 40,000/4·(0.3/(πk))², 91/k², over the noise.
        let found = effects(|time_s| 0.3 * (time_s / 40.0).fract());
        let Some(Effect::Periodic(periodic)) = found.first() else { panic!("{found:?}") };
        // The resolution is 2.5 mHz, of which the frequency is known to a tenth.
        assert!((periodic.frequency_hz.value - 0.025).abs() < 0.000_25, "{found:?}");
        // A sawtooth of height 0.3 has the amplitudes 0.3/(πk): of the first one 0.0955, and of the second to the eighth the root of
        // the sum of 1/k², 0.726, of that.
        let amplitude = periodic.amplitude.estimate();
        assert!((amplitude.low..=amplitude.high).contains(&(0.3 / PI)), "{periodic:?}");
        let percent = periodic.harmonics_percent;
        assert!((percent.low..=percent.high).contains(&72.6), "{periodic:?}");
        // The noise of one amplitude is √(2/40,000), 0.007.
        for (number, amplitude) in (2..).map(f64::from).zip(&periodic.harmonics) {
            assert!((amplitude - 0.3 / (PI * number)).abs() < 4.0 * 0.007, "{number}: {periodic:?}");
        }
    }

    #[test]
    fn a_frequency_that_runs_is_a_chirp() {
        // 0.15²·40,000/4 = 225 over the noise.
        let found = effects(|time_s| 0.15 * (TAU * (4.0 + 0.005 * time_s) * time_s).sin());
        let [Effect::Chirp(chirp)] = &found[..] else { panic!("{found:?}") };
        // From 4 to 8 Hz, within the ordinates of 64 segments of 6.25 s.
        assert!((chirp.start_hz.value - 4.0).abs() < 0.2 && (chirp.end_hz.value - 8.0).abs() < 0.2, "{chirp:?}");
        assert!((chirp.rate_hz_per_s.low..=chirp.rate_hz_per_s.high).contains(&0.01), "{chirp:?}");
        assert!((chirp.amplitude.low..=chirp.amplitude.high).contains(&0.15), "{chirp:?}");
        assert_eq!(effects(|_| 0.0), []);
    }
}
