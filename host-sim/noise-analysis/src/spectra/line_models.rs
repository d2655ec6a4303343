//! Models of a line: a sinusoid, fitted to the samples, and a resonance, fitted to the spectrum.

use super::periodogram::taper;
use super::whittle::departure_by_chance;
use crate::minimum::summit;
use crate::samples::uniform_series::UniformSeries;
use fourier::Complex;
use nalgebra::{Matrix4, Vector4};
use std::f64::consts::{PI, TAU};
use std::ops::Range;

/// Samples per recomputation of the rotating phasor, which loses a bit in a thousand steps.
const STEPS: usize = 512;

/// `cosine·cos(2πft) + sine·sin(2πft)`, t from the first sample, fitted under the taper.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sine {
    pub frequency: f64,
    cosine: f64,
    sine: f64,
    /// `|Σwye^(−2πift)|²/Σw²`
    power: f64,
}

impl Sine {
    /// The least-squares sinusoid within `spacing`/2 of `frequency`, Hz; `spacing` is at most 1/(2·length).
    pub(super) fn fit_near(series: &UniformSeries, frequency: f64, spacing: f64) -> Self {
        let sums = PhaseSums::new(series, frequency);
        let (mut frequency, mut power) = (frequency, sums.power_at(frequency));
        // Parabolas of decreasing width.
        for step in [0.3 * spacing, 0.1 * spacing, 0.03 * spacing] {
            let [left, right] = [-step, step].map(|offset| sums.power_at(frequency + offset));
            let shifted = frequency + step * summit([left, power, right]);
            let highest = sums.power_at(shifted);
            if highest > power {
                (frequency, power) = (shifted, highest);
            }
        }
        sums.fit_at(frequency)
    }

    pub(super) fn delayed(self, delay: f64) -> Self {
        let (sine, cosine) = (TAU * self.frequency * delay).sin_cos();
        Self { cosine: self.cosine * cosine - self.sine * sine, sine: self.cosine * sine + self.sine * cosine, ..self }
    }

    pub(super) fn scaled(self, factor: f64) -> Self {
        let [cosine, sine] = [self.cosine, self.sine].map(|part| factor * part);
        Self { cosine, sine, power: factor * factor * self.power, ..self }
    }

    pub(super) fn amplitude(&self) -> f64 {
        self.cosine.hypot(self.sine)
    }

    /// φ of `amplitude·cos(2πft − φ)`, rad.
    pub(super) fn phase(&self) -> f64 {
        self.sine.atan2(self.cosine)
    }

    /// Periodogram ordinate at its frequency, unit²/Hz.
    pub(super) fn density(&self, series: &UniformSeries) -> f64 {
        2.0 * self.power * series.sample_period()
    }

    pub(super) fn negative(self) -> Self {
        self.scaled(-1.0)
    }

    pub(super) fn subtracted_from(&self, series: &UniformSeries) -> UniformSeries {
        let mut values = Vec::with_capacity(series.values().len());
        for_each_phase(series, self.frequency, |_, value, cosine, sine| {
            values.push(value - self.cosine * cosine - self.sine * sine);
        });
        series.with_values(values)
    }
}

/// Fewest blocks of sums; the phase of a frequency turns by π/4/1024 within half a block: an error of 10⁻⁷.
const BLOCKS: usize = 1024;

/// Sums over blocks that give the least-squares sinusoid of any nearby frequency without another pass.
pub(super) struct PhaseSums {
    /// ω/2π of the sums, Hz.
    frequency: f64,
    /// Middle of the first block, s from the first sample, and block period.
    first_s: f64,
    block_s: f64,
    squared_weights: f64,
    blocks: Vec<BlockSums>,
}

/// Sums over a block's samples y under the taper w.
struct BlockSums {
    weight: f64,
    /// Σwe^(−2iωt).
    double: Complex<f64>,
    /// Σwye^(−iωt).
    product: Complex<f64>,
}

impl PhaseSums {
    pub(super) fn new(series: &UniformSeries, frequency: f64) -> Self {
        let length = series.values().len();
        let size = (length / BLOCKS).clamp(1, STEPS);
        let empty = || BlockSums { weight: 0.0, double: Complex::ZERO, product: Complex::ZERO };
        let mut blocks: Vec<BlockSums> = (0..length.div_ceil(size)).map(|_| empty()).collect();
        let mut squared_weights = 0.0;
        for_each_phase(series, frequency, |at, value, cosine, sine| {
            if value.is_finite() {
                let weight = taper(at, length);
                let block = &mut blocks[at / size];
                block.weight += weight;
                block.double += weight * Complex::new(cosine * cosine - sine * sine, -2.0 * cosine * sine);
                block.product += weight * value * Complex::new(cosine, -sine);
                squared_weights += weight * weight;
            }
        });
        let (first_s, block_s) =
            (0.5 * (size as f64 - 1.0) * series.sample_period(), size as f64 * series.sample_period());
        Self { frequency, first_s, block_s, squared_weights, blocks }
    }

    /// Calls `visit` with every block and its phasor relative to the sums' frequency.
    fn for_each_block(&self, frequency: f64, mut visit: impl FnMut(&BlockSums, Complex<f64>)) {
        let offset = -TAU * (frequency - self.frequency);
        let turn = Complex::cis(offset * self.block_s);
        for (number, blocks) in self.blocks.chunks(STEPS).enumerate() {
            let mut turned = Complex::cis(offset * (self.first_s + (number * STEPS) as f64 * self.block_s));
            for block in blocks {
                visit(block, turned);
                turned *= turn;
            }
        }
    }

    /// `|Σwye^(−iωt)|²/Σw²` at one frequency, in Hz.
    pub(super) fn power_at(&self, frequency: f64) -> f64 {
        let mut product = Complex::<f64>::ZERO;
        self.for_each_block(frequency, |block, turned| product += block.product * turned);
        product.norm_sqr() / self.squared_weights
    }

    pub(super) fn fit_at(&self, frequency: f64) -> Sine {
        let (mut weight, mut double, mut product) = (0.0, Complex::<f64>::ZERO, Complex::<f64>::ZERO);
        self.for_each_block(frequency, |block, turned| {
            weight += block.weight;
            double += block.double * turned * turned;
            product += block.product * turned;
        });
        // cos² = (1 + cos 2ωt)/2 and so on.
        let (cc, ss, cs) = (0.5 * (weight + double.re), 0.5 * (weight - double.re), -0.5 * double.im);
        let (yc, ys) = (product.re, -product.im);
        let determinant = cc * ss - cs * cs;
        if determinant <= 0.0 {
            return Sine { frequency, cosine: 0.0, sine: 0.0, power: 0.0 };
        }
        let (cosine, sine) = ((yc * ss - ys * cs) / determinant, (ys * cc - yc * cs) / determinant);
        Sine { frequency, cosine, sine, power: (yc * yc + ys * ys) / self.squared_weights }
    }
}

/// Calls `visit` with position, value, cosine and sine of every sample.
pub(super) fn for_each_phase(series: &UniformSeries, frequency: f64, mut visit: impl FnMut(usize, f64, f64, f64)) {
    let turn = frequency * series.sample_period();
    let (step_sine, step_cosine) = (TAU * turn).sin_cos();
    for (block, values) in series.values().chunks(STEPS).enumerate() {
        // Whole turns are dropped before the multiplication, which would cost digits.
        let (mut sine, mut cosine) = (TAU * (turn * (block * STEPS) as f64).fract()).sin_cos();
        for (at, value) in values.iter().enumerate() {
            visit(block * STEPS + at, *value, cosine, sine);
            (cosine, sine) = (cosine * step_cosine - sine * step_sine, sine * step_cosine + cosine * step_sine);
        }
    }
}

/// Half-width of the fitted region, in widths; at least [`LEAST`] ordinates.
const REACH: f64 = 6.0;
const LEAST: f64 = 16.0;
/// Most groups of averaged ordinates.
const GROUPS: usize = 256;
/// Most Levenberg-Marquardt steps.
const ROUNDS: usize = 60;
/// Narrowest width, resolutions.
const NARROWEST: f64 = 0.5;

/// `level·(1 + height/(1 + (2(k − centre)/width)²))` over the ordinates `k`, and its mirror; by Whittle's likelihood.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lorentz {
    pub level: f64,
    pub height: f64,
    /// In resolutions.
    pub centre: f64,
    /// Full width at half maximum, in resolutions.
    pub width: f64,
    /// Standard deviations of `ln height`, of `centre` and of `ln width`.
    pub errors: [f64; 3],
    /// Covariance of `ln height` and `ln width`.
    pub height_and_width: f64,
    /// −2 log-likelihood ratio of the level alone against level and line.
    pub statistic: f64,
    /// p-value of the ordinates' deviation from this curve.
    pub shape_p_value: f64,
}

struct Group {
    position: f64,
    density: f64,
    ordinates: f64,
}

impl Lorentz {
    /// The likeliest curve near `centre` and `width`, resolutions, over `bins`, means of `looks` exponential variables.
    pub(super) fn fit(
        spectrum: &dyn Fn(Range<usize>) -> Vec<f64>,
        bins: Range<usize>,
        looks: f64,
        centre: f64,
        width: f64,
    ) -> Option<Self> {
        let within = |centre: f64, width: f64, reach: f64| {
            let reach = reach.max(LEAST);
            let low = ((centre - reach).max(bins.start as f64)) as usize;
            let high = ((centre + reach) as usize).min(bins.end.checked_sub(2)?);
            let is_enough = high >= low + LEAST as usize;
            is_enough.then(|| Self::fit_groups(&groups(&spectrum(low..high + 1), low, looks), centre, width, reach))?
        };
        let near = within(centre, width, REACH * width)?;
        // Skirts of a high line.
        let skirts = near.width * near.height.sqrt().max(REACH);
        let reach = skirts.min(bins.end as f64 / 8.0);
        within(near.centre, near.width, reach).or(Some(near))
    }

    fn fit_groups(groups: &[Group], centre: f64, width: f64, reach: f64) -> Option<Self> {
        let weight: f64 = groups.iter().map(|group| group.ordinates).sum();
        let mean = |groups: &mut dyn Iterator<Item = &Group>| {
            let (sum, weight) = groups.fold((0.0, 0.0), |(sum, weight), group| {
                (sum + group.ordinates * group.density, weight + group.ordinates)
            });
            sum / weight
        };
        let everything = mean(&mut groups.iter());
        let floor = mean(&mut groups.iter().filter(|group| (group.position - centre).abs() > 0.6 * reach));
        let summit = mean(&mut around(groups, centre, width).iter().copied());
        // Mean over the full width: π/4 of the height.
        let height = ((summit / floor - 1.0) * 4.0 / PI).max(0.1);
        let mut parameters = Vector4::new(floor.ln(), height.ln(), centre, width.ln());
        let mut likelihood = log_likelihood(groups, &parameters);
        let mut damping = 1e-2;
        for _ in 0..ROUNDS {
            let (information, score) = normal_equations(groups, &parameters);
            let damped = information + Matrix4::from_diagonal(&(damping * information.diagonal()));
            let next = parameters + damped.cholesky()?.solve(&score);
            let better = log_likelihood(groups, &next);
            let inside = (next[2] - centre).abs() < 2.0 * width.max(reach / REACH)
                && next[3] < reach.ln()
                && next[3] > NARROWEST.ln();
            if inside && better > likelihood {
                let gain = better - likelihood;
                (parameters, likelihood, damping) = (next, better, damping / 10.0);
                if gain < 1e-6 {
                    break;
                }
            } else if damping > 1e6 {
                break;
            } else {
                damping *= 10.0;
            }
        }
        let level_alone = -weight * (everything.ln() + 1.0);
        let covariance = normal_equations(groups, &parameters).0.cholesky()?.inverse();
        Some(Self {
            level: parameters[0].exp(),
            height: parameters[1].exp(),
            centre: parameters[2],
            width: parameters[3].exp(),
            errors: [1, 2, 3].map(|at| covariance[(at, at)].sqrt()),
            height_and_width: covariance[(1, 3)],
            statistic: 2.0 * (likelihood - level_alone),
            shape_p_value: shape_p_value(groups, &parameters),
        })
    }

    /// True if centre, height or width differ by more than half a standard deviation.
    pub(super) fn differs_from(&self, other: &Self) -> bool {
        let changes = [(self.height / other.height).ln(), self.centre - other.centre, (self.width / other.width).ln()];
        changes.iter().zip(self.errors).any(|(change, error)| change.abs() > 0.5 * error)
    }

    /// Factor on the ordinate at `position` that removes the line.
    pub(super) fn deflation(&self, position: f64) -> f64 {
        1.0 / (1.0 + self.height * bell(position, self.centre, self.width))
    }

    /// Relative standard deviation of the area `height·width`.
    pub(super) fn area_error(&self) -> f64 {
        let [height, _, width] = self.errors;
        (height * height + width * width + 2.0 * self.height_and_width).max(0.0).sqrt()
    }
}

/// Groups within half a width of the centre, at least one.
fn around(groups: &[Group], centre: f64, width: f64) -> Vec<&Group> {
    let distance = |group: &&Group| (group.position - centre).abs();
    let inside: Vec<&Group> = groups.iter().filter(|group| distance(group) <= width / 2.0).collect();
    if inside.is_empty() {
        groups.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).into_iter().collect()
    } else {
        inside
    }
}

/// Height 1 at the positive and at the negative frequency.
fn bell(position: f64, centre: f64, width: f64) -> f64 {
    let at = |centre: f64| 1.0 / (1.0 + (2.0 * (position - centre) / width).powi(2));
    at(centre) + at(-centre)
}

fn groups(ordinates: &[f64], first: usize, looks: f64) -> Vec<Group> {
    let size = ordinates.len().div_ceil(GROUPS);
    let group = |(index, chunk): (usize, &[f64])| Group {
        position: (first + index * size) as f64 + (chunk.len() - 1) as f64 / 2.0,
        density: chunk.iter().sum::<f64>() / chunk.len() as f64,
        ordinates: looks * chunk.len() as f64,
    };
    ordinates.chunks(size).enumerate().map(group).collect()
}

/// Parameters `ln level`, `ln height`, `centre`, `ln width`.
struct LorentzCurve {
    level: f64,
    height: f64,
    centre: f64,
    width: f64,
}

impl LorentzCurve {
    fn new(parameters: &Vector4<f64>) -> Self {
        let [level, height, width] = [0, 1, 3].map(|at| parameters[at].exp());
        Self { level, height, centre: parameters[2], width }
    }

    fn line(&self, group: &Group) -> f64 {
        self.level * self.height * bell(group.position, self.centre, self.width)
    }

    fn density(&self, group: &Group) -> f64 {
        self.level + self.line(group)
    }

    fn slopes(&self, group: &Group) -> (f64, Vector4<f64>) {
        let offset = 2.0 * (group.position - self.centre) / self.width;
        let near = 1.0 / (1.0 + offset * offset);
        let line = self.line(group);
        let density = self.level + line;
        // The derivatives neglect the negative frequency.
        let slope = self.level * self.height * near * near * offset;
        (density, Vector4::new(density, line, 4.0 * slope / self.width, 2.0 * slope * offset))
    }
}

fn log_likelihood(groups: &[Group], parameters: &Vector4<f64>) -> f64 {
    let curve = LorentzCurve::new(parameters);
    let of_group = |group: &Group| {
        let density = curve.density(group);
        -group.ordinates * (density.ln() + group.density / density)
    };
    groups.iter().map(of_group).sum()
}

/// p-value of the ordinates' deviation from the modelled density.
fn shape_p_value(groups: &[Group], parameters: &Vector4<f64>) -> f64 {
    let curve = LorentzCurve::new(parameters);
    let over_density = |group: &Group| (group.density / curve.density(group), group.ordinates);
    departure_by_chance(&groups.iter().map(over_density).collect::<Vec<_>>())
}

fn normal_equations(groups: &[Group], parameters: &Vector4<f64>) -> (Matrix4<f64>, Vector4<f64>) {
    let (mut information, mut score) = (Matrix4::zeros(), Vector4::zeros());
    let curve = LorentzCurve::new(parameters);
    for group in groups {
        let (density, slope) = curve.slopes(group);
        let weight = group.ordinates / (density * density);
        information += weight * slope * slope.transpose();
        score += weight * (group.density - density) * slope;
    }
    (information, score)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fits_and_removes_a_sinusoid_between_two_ordinates() {
        let values =
            (0..10_000).map(|at| if at % 11 == 5 { f64::NAN } else { 3.0 * (TAU * 0.123_456 * f64::from(at)).cos() });
        let series = UniformSeries::new(1.0, values.collect());
        let sine = Sine::fit_near(&series, 0.123_475, 5e-5);
        assert!((sine.frequency - 0.123_456).abs() < 1e-8, "{}", sine.frequency);
        assert!((sine.amplitude() - 3.0).abs() < 1e-4);
        let rest = sine.subtracted_from(&series);
        assert!(rest.values().iter().filter(|value| value.is_finite()).all(|value| value.abs() < 1e-3));
        // A²·M·dt/2 without a taper; a Tukey window over a tenth keeps (1 − 0.05)²/(1 − 0.0625).
        let ordinate = 9.0 * series.present() as f64 / 2.0 * 0.95 * 0.95 / 0.9375;
        assert!((sine.density(&series) / ordinate - 1.0).abs() < 1e-3);
    }
}
