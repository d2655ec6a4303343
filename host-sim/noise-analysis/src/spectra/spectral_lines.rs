//! The lines of a channel's spectrum as terms of a noise model. Peaks of a wandering line are merged.

use super::transforms::gain_of_mean;
use crate::bounds::MeasuredValue;
use crate::samples::rounding::Rounding;
use crate::samples::series::Series;
use crate::samples::uniform_series::UniformSeries;
use crate::spectra;
use allan_core::Model;
use allan_core::confidence::NORMAL_975;
use allan_core::model::FittedTerm;
use allan_core::term::{NoiseTerm, Resonance, Shape, Sinusoid};
use std::f64::consts::SQRT_2;

/// Relative distance of peaks of one line, if either has a width.
const MERGE_DISTANCE: f64 = 0.03;
/// Distance of peaks of one line, in widths.
const MERGE_WIDTHS: f64 = 3.0;
/// Distance of peaks of one line, in resolutions: side lobes.
const MERGE_RESOLUTIONS: f64 = 8.0;
/// Least frequency of a line in widths; below is a Markov process.
const MIN_WIDTHS_FROM_ZERO: f64 = 1.5;
/// Least noise of the model over that of its Markov processes: rounding remains in a filter's nulls.
const MIN_NOISE: f64 = 1e-6;
/// Relative width above which a line may be an error of the background.
const BROAD: f64 = 0.1;
/// Least bandwidth times record length of a resonance; less is a sinusoid.
const MIN_PHASE_CHANGES: f64 = 30.0;
/// Least relative bandwidth of a resonance with few phase changes: a damping ratio of half a percent.
const NARROWEST_BAND: f64 = 0.01;
/// Periods below which a sinusoid is a ramp to the longest octaves.
pub(crate) const FEW_PERIODS: f64 = 8.0;
/// Full width at half maximum of a normal curve, in standard deviations.
const FULL_WIDTH: f64 = 2.35;

#[derive(Debug, Clone, Copy)]
pub(crate) struct MergedLine {
    /// Weighted by power, Hz.
    pub frequency: MeasuredValue,
    /// Standard deviation of the line's signal, in the channel's unit.
    pub deviation: MeasuredValue,
    /// Full width at half maximum, Hz; 0 or the scatter of the peaks if unresolved.
    pub width: MeasuredValue,
    /// For the strongest peak: −2 log-likelihood ratio.
    pub statistic: f64,
    /// For the strongest peak at any frequency, without lines.
    pub p_value: f64,
    /// p-value of the strongest peak as a resonance.
    pub shape_p_value: f64,
    /// Periodic change of the strongest peak.
    pub modulation: Option<spectra::Modulation>,
    /// True if the strongest peak is likelier a resonance.
    is_resonance: bool,
    duration_s: f64,
}

/// The line before it was averaged over `m` samples, `width` s.
pub(crate) fn before_averaging(line: &MergedLine, width: f64, m: u64) -> MeasuredValue {
    let gain = gain_of_mean(line.frequency.value, width, m);
    MeasuredValue { value: line.deviation.value / gain, error: line.deviation.error / gain }
}

/// True if `line` is the alias of the faster line `of` at the period, s: at its frequency, as wide.
pub(crate) fn is_alias(line: &MergedLine, of: &MergedLine, period_s: f64) -> bool {
    let turns = of.frequency.value * period_s;
    let alias = (turns - turns.round()).abs() / period_s;
    let reach =
        MERGE_WIDTHS * (of.width.value + of.frequency.error + line.width.value) + MERGE_RESOLUTIONS / line.duration_s;
    // A narrower one is a line of its own.
    let is_as_wide = MERGE_WIDTHS * line.width.value >= of.width.value || of.is_sinusoid();
    is_as_wide && (line.frequency.value - alias).abs() < reach
}

/// The lines of a series over the background of `known`, the strongest first; a sample is one of `read_every` values.
pub(crate) fn find(
    series: &Series,
    rounding: &Rounding,
    known: Option<&Model>,
    rate_error: f64,
    read_every: u32,
) -> Vec<MergedLine> {
    let duration_s = series.duration_s();
    let grid = UniformSeries::from_series(series).with_one_of(read_every).with_rounding(rounding.clone());
    let peaks = match known {
        Some(model) => spectra::find_lines_over(&grid, |frequency| background(model, frequency, grid.rounding())),
        None => spectra::find_lines(&grid),
    };
    merged(peaks, duration_s, duration_s, rate_error)
}

/// Merges `peaks` of a record of `duration_s` whose spectrum resolves 1/`resolved_s`.
pub(crate) fn merged(
    peaks: Vec<spectra::SpectralLine>,
    resolved_s: f64,
    duration_s: f64,
    rate_error: f64,
) -> Vec<MergedLine> {
    let is_line = |peak: &spectra::SpectralLine| {
        let is_finite = peak.frequency.error.is_finite() && peak.deviation.error.is_finite();
        is_finite && peak.frequency.value > MIN_WIDTHS_FROM_ZERO * width(peak)
    };
    let mut rest: Vec<spectra::SpectralLine> = peaks.into_iter().filter(is_line).collect();
    let mut lines = Vec::new();
    while let Some(strongest) = rest.first().copied() {
        let reach = (MERGE_WIDTHS * width(&strongest)).max(MERGE_RESOLUTIONS / resolved_s);
        let is_same = |peak: &spectra::SpectralLine| {
            let distance = (peak.frequency.value - strongest.frequency.value).abs();
            let wanders = peak.width.is_some() || strongest.width.is_some();
            distance < reach || (wanders && distance < MERGE_DISTANCE * strongest.frequency.value)
        };
        let (same, others): (Vec<_>, Vec<_>) = rest.into_iter().partition(is_same);
        lines.push(MergedLine::merge(&same, duration_s, rate_error));
        rest = others;
    }
    lines
}

/// Full width at half maximum, Hz; 0 of a sinusoid.
fn width(peak: &spectra::SpectralLine) -> f64 {
    peak.width.map_or(0.0, |width| width.value)
}

/// Density of a model's noise without lines over its N, B and K; `rounding` remains in the nulls of filters.
fn background(model: &Model, frequency: f64, rounding: &Rounding) -> f64 {
    let rounding = 0.5 * rounding.density(frequency);
    let (mut all, mut power_laws) = (0.0, 0.0);
    for FittedTerm { kind, value, .. } in model.terms() {
        let density = value * value * kind.process().density(frequency, model.sample_period());
        let (own, of_power_laws) = match kind {
            NoiseTerm::Sinusoid(_) | NoiseTerm::Resonance(_) => (0.0, 0.0),
            NoiseTerm::Markov(_) => (density, 0.0),
            kind if is_read_slowly(kind) => (density + rounding, value * value + rounding),
            _ => (density, density),
        };
        (all, power_laws) = (all + own, power_laws + of_power_laws);
    }
    all / power_laws.max(MIN_NOISE * all)
}

pub(crate) fn is_read_slowly(kind: &NoiseTerm) -> bool {
    matches!(kind, NoiseTerm::Filtered(filter) if filter.decimation > 1.0)
}

impl MergedLine {
    fn merge(peaks: &[spectra::SpectralLine], duration_s: f64, rate_error: f64) -> Self {
        let strongest = peaks[0];
        // A rest of sidebands is no part of the line between them.
        let peaks = if strongest.modulation.is_some() { &peaks[..1] } else { peaks };
        let power = |peak: &spectra::SpectralLine| peak.deviation.value * peak.deviation.value;
        let total: f64 = peaks.iter().map(power).sum();
        let mean = |of: &dyn Fn(&spectra::SpectralLine) -> f64| {
            peaks.iter().map(|peak| power(peak) * of(peak)).sum::<f64>() / total
        };
        let frequency = mean(&|peak| peak.frequency.value);
        let spread = mean(&|peak| (peak.frequency.value - frequency).powi(2)).sqrt();
        let own_width = mean(&|peak| width(peak));
        let width_error = mean(&|peak| peak.width.map_or(0.0, |width| width.error));
        Self {
            frequency: MeasuredValue {
                value: frequency,
                error: strongest.frequency.error.max(spread).hypot(rate_error * frequency),
            },
            deviation: MeasuredValue {
                value: total.sqrt(),
                error: strongest.deviation.error * total.sqrt() / strongest.deviation.value,
            },
            width: MeasuredValue { value: own_width.hypot(FULL_WIDTH * spread), error: width_error.hypot(spread) },
            statistic: peaks.iter().map(|peak| peak.statistic).fold(0.0, f64::max),
            p_value: peaks.iter().map(|peak| peak.p_value).fold(1.0, f64::min),
            shape_p_value: strongest.shape_p_value,
            modulation: strongest.modulation,
            is_resonance: strongest.width.is_some(),
            duration_s,
        }
    }

    /// Equal within the wider one and the resolution.
    pub(crate) fn is_same(&self, other: &Self) -> bool {
        let reach = self.width.value.max(other.width.value).max(MERGE_RESOLUTIONS / self.duration_s);
        (self.frequency.value - other.frequency.value).abs() < reach
    }

    pub(crate) fn is_sinusoid(&self) -> bool {
        matches!(self.kind(), NoiseTerm::Sinusoid(_))
    }

    pub(crate) fn is_slow(&self) -> bool {
        self.frequency.value * self.duration_s < FEW_PERIODS
    }

    pub(crate) fn is_broad(&self) -> bool {
        self.width.value > BROAD * self.frequency.value
    }

    pub(crate) fn is_wider_than_resolution(&self) -> bool {
        self.width.value * self.duration_s >= 1.0
    }

    /// True if a resonance is significantly wider than the resolution and a wandering line.
    pub(crate) fn is_band(&self) -> bool {
        let least = self.width.value - NORMAL_975 * self.width.error;
        let is_broad_enough = self.width.value > NARROWEST_BAND * self.frequency.value;
        self.is_resonance && is_broad_enough && least * self.duration_s > 1.0
    }

    pub(crate) fn fitted_term(&self) -> FittedTerm {
        let kind = self.kind();
        let bounds = |of: MeasuredValue| {
            let half = NORMAL_975 * of.error;
            ((of.value - half).max(0.0), of.value + half)
        };
        // Coefficient: amplitude of a sinusoid, deviation of a resonance.
        let scale = if self.is_sinusoid() { SQRT_2 } else { 1.0 };
        let (low, high) = bounds(self.deviation);
        let value = scale * self.deviation.value;
        let frequency = bounds(self.frequency);
        let shape = match kind {
            NoiseTerm::Resonance(_) => Shape::Resonance { frequency, bandwidth: bounds(self.width) },
            _ => Shape::Sinusoid { frequency },
        };
        let mut term = FittedTerm::exact(kind, value).with_bounds(scale * low, scale * high);
        term.shape = shape;
        term
    }

    /// A sinusoid, or a resonance if wider than the record resolves.
    pub(crate) fn kind(&self) -> NoiseTerm {
        let (frequency, bandwidth) = (self.frequency.value, self.width.value);
        if bandwidth * self.duration_s < MIN_PHASE_CHANGES {
            NoiseTerm::Sinusoid(Sinusoid { frequency })
        } else {
            NoiseTerm::Resonance(Resonance { frequency, bandwidth })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::find;
    use crate::samples::rounding::Rounding;
    use crate::samples::series::Series;
    use crate::spectra::transforms::gain_of_mean;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;
    use std::f64::consts::TAU;

    /// 400 s at 50 Hz: white noise of deviation 1 and a sinusoid at 7.3 Hz, amplitude by the part of the record.
    fn series(amplitude: impl Fn(f64) -> f64) -> Series {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let slots = 0..20_000_u64;
        let value = |slot: u64| {
            let time_s = 0.02 * slot as f64;
            amplitude(time_s / 400.0) * (TAU * 7.3 * time_s).sin() + random.sample::<f64, _>(StandardNormal)
        };
        let values = slots.clone().map(value).collect();
        Series { slots: slots.clone().collect(), values, span: slots, period_s: 0.02, resolution: 1e-6, unit: "g" }
    }

    #[test]
    fn a_line_that_swells_and_fades_has_sidebands() {
        let of = |depth: f64| {
            let swelling = series(|part| 1.0 + depth * (TAU * 5.0 * part).sin());
            find(&swelling, &Rounding::default(), None, 0.0, 1)
                .first()
                .map(|line| (line.frequency.value, line.modulation))
        };
        let (frequency, modulation) = of(0.5).expect("100 times the noise at its frequency");
        assert!((frequency - 7.3).abs() < 0.0025, "{frequency}");
        let modulation = modulation.expect("two sidebands of a quarter of the amplitude");
        assert!((modulation.frequency.value - 5.0 / 400.0).abs() < 0.0025, "{modulation:?}");
        // Sidebands are known to a fiftieth of the line.
        assert!((modulation.depth.value - 0.5).abs() < 0.1, "{modulation:?}");
        assert_eq!(of(0.0).map(|(_, modulation)| modulation), Some(None));
    }

    /// Sidebands at the third, fifth and seventh multiple have 225, 81 and 41 times the noise.
    #[test]
    fn a_line_that_is_switched_on_and_off_is_one() {
        let switched = series(|part| if (5.0 * part).fract() < 0.5 { 2.0 } else { 0.0 });
        let found = find(&switched, &Rounding::default(), None, 0.0, 1);
        let [line] = &found[..] else { panic!("{found:?}") };
        let change = line.modulation.expect("switched");
        assert!((change.frequency.value - 5.0 / 400.0).abs() < 0.0005, "{change:?}");
    }

    /// Up to two fifths of the means' rate.
    #[test]
    fn a_mean_has_the_part_of_a_sinusoid_that_its_samples_have() {
        const MEANS: usize = 10_000;
        for m in [1, 2, 4, 64] {
            for turns_in_mean in [0.011, 0.1, 0.4] {
                let sample = |at: usize| (TAU * turns_in_mean * at as f64 / m as f64).sin();
                let mean = |number: usize| (m * number..m * (number + 1)).map(sample).sum::<f64>() / m as f64;
                let square = (0..MEANS).map(|number| mean(number).powi(2)).sum::<f64>() / MEANS as f64;
                // Whole turns have the mean square ½; the last one adds 1 in 110.
                let expected = gain_of_mean(turns_in_mean, 1.0, m as u64) / 2f64.sqrt();
                assert!(
                    (square.sqrt() / expected - 1.0).abs() < 0.005,
                    "{m}, {turns_in_mean}: {} {expected}",
                    square.sqrt()
                );
            }
        }
        assert_eq!(gain_of_mean(0.37, 0.9, 1), 1.0);
    }
}
