//! The sinusoids taken out of a record, fitted together, and their changes over the record.

use super::found_sine::FoundSine;
use super::line_envelope::{MOST_PERIODS, Modulation, is_same};
use super::line_models::Sine;
use super::spectral_line::{Resonance, SpectralLine};
use crate::samples::uniform_series::UniformSeries;

/// Refits of neighbouring sinusoids in turn.
const REFITS: usize = 3;
/// Distance, resolutions, below which one is a residue of the other within the taper's lobe.
const LOBE: f64 = 2.5;
/// Widths of a resonance within which the noise is not white.
const SKIRTS: f64 = 20.0;

/// In the order in which they were taken.
#[derive(Default)]
pub(super) struct FoundSines {
    found: Vec<FoundSine>,
}

impl FoundSines {
    pub(super) fn len(&self) -> usize {
        self.found.len()
    }

    /// Takes a sinusoid out of the `series`; returns the rest.
    pub(super) fn take(&mut self, found: FoundSine, series: &UniformSeries) -> UniformSeries {
        self.found.push(found);
        self.refit_near_the_last(found.sine.subtracted_from(series))
    }

    /// Takes the two sidebands of a sinusoid out of the `series` if its modulation is likelier than the `resonance`.
    pub(super) fn take_sidebands(&mut self, resonance: &SpectralLine, series: &UniformSeries) -> Option<UniformSeries> {
        let duration = series.duration();
        let is_in_band = |found: &&FoundSine| {
            is_on_skirts(found.sine.frequency, resonance)
                && found.resolutions_from(resonance.frequency.value, duration) <= MOST_PERIODS as f64
        };
        let over_noise = |found: &FoundSine| found.over_noise(series);
        let in_band = self.found.iter().filter(is_in_band);
        let strongest = *in_band.max_by(|a, b| over_noise(a).total_cmp(&over_noise(b)))?;
        let change = Modulation::find(&strongest.sine, series, strongest.density, |_| true)?;
        if change.with_multiples < resonance.statistic {
            return None;
        }
        let without_sideband = |left: UniformSeries, distance: f64| {
            let sine = Sine::fit_near(&left, strongest.sine.frequency + distance, 0.5 / duration);
            self.take(FoundSine { sine, p_value: resonance.p_value, ..strongest }, &left)
        };
        Some([-change.frequency.value, change.frequency.value].into_iter().fold(series.clone(), without_sideband))
    }

    /// Refits the last sinusoid and its neighbours, each to the record without the others; returns the rest.
    fn refit_near_the_last(&mut self, mut rest: UniformSeries) -> UniformSeries {
        let duration = rest.duration();
        let Some((last, others)) = self.found.split_last_mut() else { return rest };
        let frequency = last.sine.frequency;
        let mut near: Vec<&mut FoundSine> = others
            .iter_mut()
            .filter(|of| of.is_near(frequency, duration) && of.resolutions_from(frequency, duration) > LOBE)
            .collect();
        if near.is_empty() {
            return rest;
        }
        near.push(last);
        for _ in 0..REFITS {
            for found in &mut near {
                let with_it = found.sine.negative().subtracted_from(&rest);
                found.sine = Sine::fit_near(&with_it, found.sine.frequency, 0.5 / duration);
                rest = found.sine.subtracted_from(&with_it);
            }
        }
        rest
    }

    /// The lines with their changes, if these are likelier than the `resonances` around them, and without sidebands of others; `rest` is the
    /// record without the lines.
    pub(super) fn into_lines(self, rest: &UniformSeries, resonances: &[Resonance]) -> Vec<SpectralLine> {
        let Self { mut found } = self;
        let duration = rest.duration();
        let mut lines = Vec::new();
        found.sort_by(|a, b| a.sine.amplitude().total_cmp(&b.sine.amplitude()));
        while let Some(strongest) = found.pop() {
            let frequency = strongest.sine.frequency;
            let distance = |other: &FoundSine| other.sine.frequency - frequency;
            let near: Vec<&FoundSine> = found.iter().filter(|other| other.is_near(frequency, duration)).collect();
            let with_near = near.iter().fold(rest.clone(), |rest, other| other.sine.negative().subtracted_from(&rest));
            let has_line = |of: f64| near.iter().any(|other| is_same(distance(other).abs(), of, duration));
            let is_likelier = |change: &Modulation| {
                let mut bands = resonances.iter().filter(|resonance| is_on_skirts(frequency, &resonance.line));
                bands.all(|resonance| change.with_multiples >= resonance.line.statistic)
            };
            let modulation =
                Modulation::find(&strongest.sine, &with_near, strongest.density, has_line).filter(is_likelier);
            found.retain(|other| !modulation.is_some_and(|change| change.is_sideband(distance(other), duration)));
            lines.push(SpectralLine { modulation, ..strongest.line(rest) });
        }
        lines
    }
}

pub(super) fn is_on_skirts(frequency: f64, resonance: &SpectralLine) -> bool {
    let distance = (resonance.frequency.value - frequency).abs();
    resonance.width.is_some_and(|width| distance < SKIRTS * width.value)
}

#[cfg(test)]
mod tests {
    use crate::samples::uniform_series::UniformSeries;
    use crate::spectra::find_lines;
    use fourier::Complex;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;
    use std::f64::consts::{PI, TAU};

    /// 400 s at 50 Hz: white noise of deviation 1 and a sine at 7.3 Hz with an envelope by the part of the record.
    fn enveloped(seed: u64, amplitude: f64, envelope: impl Fn(f64) -> f64) -> UniformSeries {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let value = |at: u32| {
            let part = f64::from(at) / 20_000.0;
            let sine = (TAU * 7.3 * 400.0 * part).sin();
            amplitude * envelope(part) * sine + random.sample::<f64, _>(StandardNormal)
        };
        UniformSeries::new(0.02, (0..20_000).map(value).collect())
    }

    /// The amplitude swells and fades by half, `changes` times.
    fn series(seed: u64, amplitude: f64, changes: f64) -> UniformSeries {
        enveloped(seed, amplitude, |part| 1.0 + 0.5 * (TAU * changes * part).sin())
    }

    /// Sidebands of a quarter of the line, 4 to 9 resolutions away, with a statistic of 56 (amplitude 0.3) to 6,000.
    #[test]
    fn two_sidebands_near_a_line_are_a_change_of_it_and_no_band() {
        for seed in 1..=6 {
            for (changes, amplitude) in [(4.2, 1.0), (5.6, 3.0), (7.3, 0.3)] {
                let found = find_lines(&series(seed, amplitude, changes));
                let [line] = found.as_slice() else { panic!("{changes} {amplitude}: {found:?}") };
                let change = line.modulation.expect("56 times the noise or more");
                assert_eq!((line.width, change.of_phase), (None, false));
                assert!((change.frequency.value * 400.0 - changes).abs() < 0.3, "{changes}: {change:?}");
                // A statistic of 112 gives the depth to 10 %.
                assert!((change.depth.value - 0.5).abs() < 0.15, "{changes}: {change:?}");
            }
        }
    }

    /// On for half of the time: half of the amplitude, sidebands of 1/π, depth 4/π.
    #[test]
    fn a_line_that_is_switched_is_no_band() {
        for seed in 1..=6 {
            for (changes, amplitude) in [(6.6, 0.4), (6.6, 1.0), (35.6, 0.6), (60.2, 1.0)] {
                let switched = |part: f64| if (changes * part).fract() < 0.5 { 1.0 } else { 0.0 };
                let found = find_lines(&enveloped(seed, amplitude, switched));
                let line = found.iter().find(|line| (line.frequency.value - 7.3).abs() < 0.001).expect("a line");
                let change = line.modulation.expect("two sidebands of 80 times the noise or more");
                assert_eq!((line.width, change.of_phase), (None, false));
                assert!((change.frequency.value * 400.0 - changes).abs() < 0.3, "{changes}: {change:?}");
                // At an amplitude of 0.4 the ordinates are 130 times the noise, the depth known to 0.1.
                let most = 0.12 / amplitude;
                assert!((change.depth.value - 1.27).abs() < most, "{changes}: {change:?}");
            }
        }
    }

    /// White noise and a resonance of this deviation and width in resolutions.
    fn band(seed: u64, width: f64, deviation: f64) -> UniformSeries {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let kept = (-PI * width / 20_000.0).exp();
        let (drive, turn) = ((1.0 - kept * kept).sqrt(), Complex::cis(TAU * 7.3 * 0.02));
        let mut state = Complex::<f64>::ZERO;
        let mut value = |_: u32| {
            let mut normal = || random.sample::<f64, _>(StandardNormal);
            state = kept * turn * state + drive * Complex::new(normal(), normal());
            deviation * state.re + normal()
        };
        UniformSeries::new(0.02, (0..20_000).map(&mut value).collect())
    }

    /// Tried at 1 of 100 false alarms: more than nine of 360 occur in 1 of 200 cases.
    #[test]
    fn a_narrow_band_is_no_line_that_changes() {
        let bands = [4.0, 8.0, 16.0].into_iter().flat_map(|width| [0.3, 1.0, 3.0].map(|deviation| (width, deviation)));
        let all = bands.flat_map(|(width, deviation)| (0..40).map(move |seed| band(1000 + seed, width, deviation)));
        let changing = all.filter(|series| find_lines(series).iter().any(|line| line.modulation.is_some())).count();
        assert!(changing <= 9, "{changing}");
    }

    /// Two sines three resolutions apart; a single fit is 0.1 resolutions off.
    #[test]
    fn neighbours_are_fitted_together() {
        let value = |at: u32| {
            let turns = f64::from(at) / 20_000.0;
            (TAU * 2_920.0 * turns).sin() + 0.7 * (TAU * 2_923.1 * turns).cos()
        };
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let noisy = (0..20_000).map(|at| value(at) + 0.1 * random.sample::<f64, _>(StandardNormal));
        let mut found = find_lines(&UniformSeries::new(0.02, noisy.collect()));
        found.truncate(2);
        found.sort_by(|a, b| a.frequency.value.total_cmp(&b.frequency.value));
        let [low, high] = [&found[0], &found[1]].map(|line| line.frequency.value * 400.0);
        assert!((low - 2_920.0).abs() < 0.02 && (high - 2_923.1).abs() < 0.02, "{low} {high}");
    }
}
