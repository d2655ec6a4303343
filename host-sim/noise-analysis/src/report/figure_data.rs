//! Data of the figures beside the Allan deviation, at most [`MOST_POINTS`] points each: data sheet, measured spectrum, bias over time.

use crate::distributions::chi_squared_quantile;
use crate::effects::BiasBlocks;
use crate::parallel::in_parallel;
use crate::record::condensed_record::CondensedRecord;
use crate::report::{BiasOverTime, ChannelReport, DataSheetReport, FigureData, Report, SpectrumReport, TermReport};
use crate::samples::series::Series;
use crate::samples::uniform_series::UniformSeries;
use crate::spectra::Welch;
use allan_core::Model;
use measurement::{ChannelId, DataSheetNoise, Measurement, Quantity};
use std::collections::BTreeMap;

/// Points of a spectrum and of a bias over time at most.
pub const MOST_POINTS: usize = 400;
/// Bands of a spectrum; the other points are for its lines.
const BANDS: usize = 240;
/// Blocks of a bias over time.
const BLOCKS: usize = 240;
/// Probability that white noise shows a line anywhere in a spectrum.
const FALSE_LINE: f64 = 1e-3;
/// Segments of the finer spectrum: few, for the lowest frequencies.
const FINE_SEGMENTS: usize = 4;
/// Segments of the coarser spectrum: enough for a smooth line.
const COARSE_SEGMENTS: usize = 64;
/// The coarser spectrum is used from its point of this number on: below, the removed mean and the window's skirts change it.
const COARSE_FROM: f64 = 16.0;
/// Lowest point of the finer spectrum that is used, for the same reason; what it changes there is below 10 % for a random walk.
const FINE_FROM: f64 = 3.0;
/// Part of the rate of means up to which their spectrum is shown.
const OF_MEANS: f64 = 0.4;
/// Significant digits: more than a figure resolves.
const DIGITS: usize = 6;

/// Sets the figure data of every channel of `report`, the report of `record`.
pub(crate) fn set(report: &mut Report, record: &CondensedRecord) {
    let measurement = record.means.as_ref();
    let period_s = report.sample_rate_hz.recip();
    let recorded: Vec<(ChannelId, &ChannelReport)> = measurement.ids().zip(&report.channels).collect();
    let mut data = in_parallel(&recorded, |&(id, channel)| {
        let profile = &measurement[id].profile;
        let series = Series::from_measurement(measurement, id);
        FigureData {
            data_sheet: data_sheet(&profile.data_sheet),
            spectrum: {
                let terms = channel.refitted.terms.iter().map(|TermReport { term, .. }| *term);
                let whole = Model::new(period_s, terms);
                // Root of the one-sided density.
                let model = |frequency: f64| (2.0 * whole.density(frequency)).sqrt();
                let of_samples = record.spectrum_within(id, series.span.clone());
                spectrum(&UniformSeries::from_series(&series), of_samples.as_ref(), model)
            },
            bias_over_time: bias_over_time(&series),
        }
    });
    let blocks = BlockMeans::new(measurement, &data);
    let followed: Vec<Vec<f64>> =
        report.channels.iter().zip(&data).map(|(channel, data)| blocks.followed(channel, data)).collect();
    for (data, followed) in data.iter_mut().zip(followed) {
        if let Some(bias) = &mut data.bias_over_time {
            bias.followed = followed;
        }
    }
    for (channel, data) in report.channels.iter_mut().zip(data) {
        channel.figure_data = data;
    }
}

pub(crate) fn data_sheet(noise: &DataSheetNoise) -> Option<DataSheetReport> {
    let &DataSheetNoise { angle_random_walk, in_run_bias_stability, rate_random_walk, curve } = noise;
    (*noise != DataSheetNoise::default()).then_some(DataSheetReport {
        angle_random_walk,
        in_run_bias_stability,
        rate_random_walk,
        curve: curve.to_vec(),
    })
}

/// The spectrum of `series` in bands of equal width on a logarithmic axis. If these are means, the spectrum `of_samples` stands above four
/// tenths of their rate, where they have lost a quarter of a sinusoid.
fn spectrum(series: &UniformSeries, of_samples: Option<&Welch>, model: impl Fn(f64) -> f64) -> Option<SpectrumReport> {
    let length = |segments: usize| {
        let samples = series.values().len() / segments;
        samples.checked_ilog2().map(|log2| 1_usize << log2)
    };
    let fine = Welch::estimate(series, length(FINE_SEGMENTS)?)?;
    let coarse = length(COARSE_SEGMENTS).and_then(|length| Welch::estimate(series, length));
    let change = coarse.as_ref().map_or(f64::INFINITY, |coarse| COARSE_FROM * coarse.resolution());
    let nyquist = 0.5 / of_samples.map_or(series.sample_period(), Welch::sample_period);
    let limit = if of_samples.is_some() { OF_MEANS / series.sample_period() } else { nyquist };
    let first = FINE_FROM * fine.resolution();
    let ratio = (nyquist / first).max(1.0).powf(1.0 / BANDS as f64);
    let low = bands(&fine, first..change.min(limit), ratio);
    let high = coarse.as_ref().map(|coarse| bands(coarse, change..limit, ratio)).unwrap_or_default();
    let faster = of_samples.map(|welch| bands(welch, limit..nyquist, ratio)).unwrap_or_default();
    let points = low.into_iter().chain(high).chain(faster);
    let mut points: Vec<SpectralPoint> = points.filter(|point| point.density > 0.0).collect();
    keep_most(&mut points);
    let column =
        |of: &dyn Fn(&SpectralPoint) -> f64| points.iter().map(|point| rounded(of(point))).collect::<Vec<f64>>();
    // χ² bounds of a density with 2g degrees of freedom.
    let bound = |point: &SpectralPoint, probability: f64| {
        let freedom = 2.0 * point.ordinates;
        (point.density * freedom / chi_squared_quantile(probability, freedom)).sqrt()
    };
    (!points.is_empty()).then(|| SpectrumReport {
        frequency_hz: column(&|point| point.frequency),
        density: column(&|point| point.density.sqrt()),
        low: column(&|point| bound(point, 0.975)),
        high: column(&|point| bound(point, 0.025)),
        model: column(&|point| model(point.frequency)),
    })
}

/// A point of a condensed spectrum: the average of a band, or a line.
struct SpectralPoint {
    frequency: f64,
    /// One-sided, unit²/Hz.
    density: f64,
    /// Half the degrees of freedom.
    ordinates: f64,
    is_line: bool,
}

/// The lines that stand out the most, if there are more points than [`MOST_POINTS`].
fn keep_most(points: &mut Vec<SpectralPoint>) {
    let surplus = points.len().saturating_sub(MOST_POINTS);
    if surplus > 0 {
        let mut lines: Vec<f64> = points.iter().filter(|point| point.is_line).map(|point| point.density).collect();
        lines.sort_by(f64::total_cmp);
        let least = lines.get(surplus).copied().unwrap_or(f64::INFINITY);
        points.retain(|point| !point.is_line || point.density >= least);
    }
}

/// Averages of the spectrum over bands in `range` of frequencies, each `ratio` times as high as the one before. A point of
/// a band that is higher than chance makes it becomes a point of its own and is left out of the average.
fn bands(welch: &Welch, range: std::ops::Range<f64>, ratio: f64) -> Vec<SpectralPoint> {
    let inside: Vec<(f64, f64)> = welch.points().filter(|(frequency, _)| range.contains(frequency)).collect();
    let ordinates = welch.ordinates();
    // The quantile of one point among all, over its mean.
    let highest =
        chi_squared_quantile(1.0 - FALSE_LINE / inside.len().max(1) as f64, 2.0 * ordinates) / (2.0 * ordinates);
    let mut points = Vec::new();
    let mut rest = inside.as_slice();
    while let Some(&(from, _)) = rest.first() {
        let count = rest.partition_point(|(frequency, _)| *frequency < from * ratio).max(1);
        let (band, after) = rest.split_at(count);
        rest = after;
        let mut densities: Vec<f64> = band.iter().map(|(_, density)| *density).collect();
        let middle = densities.len() / 2;
        let (_, &mut median, _) = densities.select_nth_unstable_by(middle, f64::total_cmp);
        let is_line = |density: f64| band.len() >= 5 && density > highest * median;
        let (lines, smooth): (Vec<_>, Vec<_>) = band.iter().partition(|(_, density)| is_line(*density));
        let count = smooth.len() as f64;
        let middle = (from * band.last().map_or(from, |(frequency, _)| *frequency)).sqrt();
        // Neighbouring points of a Hann window are worth half their number.
        let independent = (count / 2.0).max(1.0) * ordinates;
        points.push(SpectralPoint {
            frequency: middle,
            density: smooth.iter().map(|(_, density)| density).sum::<f64>() / count,
            ordinates: independent,
            is_line: false,
        });
        // One line keeps its highest point.
        let peak = lines.into_iter().max_by(|a, b| a.1.total_cmp(&b.1));
        points.extend(peak.map(|(frequency, density)| SpectralPoint { frequency, density, ordinates, is_line: true }));
    }
    points.sort_by(|a, b| a.frequency.total_cmp(&b.frequency));
    points
}

/// `value` with [`DIGITS`] significant digits: what is not seen takes no space.
fn rounded(value: f64) -> f64 {
    format!("{value:.*e}", DIGITS - 1).parse().unwrap_or(value)
}

/// Means of at most [`BLOCKS`] blocks; `None` of fewer than two blocks.
fn bias_over_time(series: &Series) -> Option<BiasOverTime> {
    let periods = series.span.end - series.span.start;
    let length = periods.div_ceil(BLOCKS as u64).max(1);
    let sums = series.sums_of_blocks(series.span.start, length).into_iter().enumerate();
    let whole: Vec<(usize, f64)> = sums
        .filter(|(_, (_, count))| 2 * count >= length)
        .map(|(block, (sum, count))| (block, sum / count as f64))
        .collect();
    if whole.len() < 2 {
        return None;
    }
    let level = whole.iter().map(|(_, mean)| mean).sum::<f64>() / whole.len() as f64;
    let block_s = length as f64 * series.period_s;
    Some(BiasOverTime {
        block_s,
        time_s: whole.iter().map(|(block, _)| rounded((*block as f64 + 0.5) * block_s)).collect(),
        mean: whole.iter().map(|(_, mean)| rounded(mean - level)).collect(),
        followed: Vec::new(),
    })
}

/// The block means of the channels that others follow.
struct BlockMeans<'a> {
    temperature: Option<&'a BiasOverTime>,
    supply: Option<&'a BiasOverTime>,
    /// By axis.
    specific_force: BTreeMap<&'static str, &'a BiasOverTime>,
}

impl<'a> BlockMeans<'a> {
    fn new(measurement: &Measurement, data: &'a [FigureData]) -> Self {
        let of = |quantity: Quantity| {
            let channels = measurement.profiles().zip(data).filter(move |(profile, _)| profile.quantity == quantity);
            channels.filter_map(|(profile, data)| Some((profile.axis, data.bias_over_time.as_ref()?)))
        };
        Self {
            temperature: of(Quantity::Temperature).map(|(_, bias)| bias).next(),
            supply: of(Quantity::SupplyVoltage).map(|(_, bias)| bias).next(),
            specific_force: of(Quantity::SpecificForce).collect(),
        }
    }

    /// The part of a channel's bias over time that its effects explain; empty if they explain nothing.
    fn followed(&self, channel: &ChannelReport, data: &FigureData) -> Vec<f64> {
        let Some(bias) = &data.bias_over_time else { return Vec::new() };
        let of = |quantity: Quantity, axis: &str| {
            let other = match quantity {
                Quantity::Temperature => self.temperature,
                Quantity::SupplyVoltage => self.supply,
                _ => self.specific_force.get(axis).copied(),
            };
            other.map(|other| at_times(other, &bias.time_s))
        };
        let blocks = BiasBlocks { time_s: &bias.time_s, of: &of };
        let parts: Vec<(f64, Vec<f64>)> =
            channel.effects.iter().flat_map(|shown| shown.effect.kind().course(&blocks)).collect();
        if parts.is_empty() {
            return Vec::new();
        }
        let mut sum = vec![0.0; bias.time_s.len()];
        for (factor, values) in parts {
            sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += factor * value);
        }
        let level = sum.iter().sum::<f64>() / sum.len() as f64;
        sum.into_iter().map(|value| rounded(value - level)).collect()
    }
}

/// The values of `bias` at `times`, that of the nearest block.
fn at_times(bias: &BiasOverTime, times: &[f64]) -> Vec<f64> {
    let nearest = |time: &f64| {
        let after = bias.time_s.partition_point(|of| of < time).min(bias.time_s.len() - 1);
        let before = after.saturating_sub(1);
        let is_before = (bias.time_s[before] - time).abs() < (bias.time_s[after] - time).abs();
        bias.mean[if is_before { before } else { after }]
    };
    times.iter().map(nearest).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};
    use std::f64::consts::PI;

    const PERIOD_S: f64 = 0.01;

    fn white(count: usize, seed: u64) -> Vec<f64> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        (0..count).map(|_| StandardNormal.sample(&mut random)).collect()
    }

    #[test]
    fn the_spectrum_of_white_noise_is_flat_and_inside_its_bounds() {
        let series = UniformSeries::new(PERIOD_S, white(200_000, 1));
        let spectrum = spectrum(&series, None, |_| 1.0).expect("a spectrum");
        // One-sided: 2σ²·dt.
        let expected = (2.0 * PERIOD_S).sqrt();
        let count = spectrum.density.len();
        assert!((100..=MOST_POINTS).contains(&count), "{count}");
        let inside = (0..count).filter(|&at| (spectrum.low[at]..=spectrum.high[at]).contains(&expected)).count();
        // 95 % of independent points; neighbours correlate, which triples the variance: three standard deviations of 0.02.
        assert!(inside as f64 > 0.89 * count as f64, "{inside} of {count}");
        assert!(spectrum.frequency_hz.is_sorted() && spectrum.frequency_hz[count - 1] < 0.5 / PERIOD_S);
    }

    #[test]
    fn a_line_has_a_point_of_its_own() {
        const FREQUENCY_HZ: f64 = 20.5;
        let line = |index: usize| 0.3 * (2.0 * PI * FREQUENCY_HZ * PERIOD_S * index as f64).sin();
        let values = white(200_000, 2).into_iter().enumerate().map(|(index, noise)| noise + line(index)).collect();
        let spectrum = spectrum(&UniformSeries::new(PERIOD_S, values), None, |_| 1.0).expect("a spectrum");
        let highest = (0..spectrum.density.len()).max_by(|&a, &b| spectrum.density[a].total_cmp(&spectrum.density[b]));
        let highest = highest.expect("a point");
        // Segments of 2048 samples resolve 0.05 Hz; the bands around are 0.5 Hz wide.
        assert!((spectrum.frequency_hz[highest] - FREQUENCY_HZ).abs() < 0.05, "{}", spectrum.frequency_hz[highest]);
        // A²/2 over the noise bandwidth of a Hann window, 1.5 resolutions, less at most 1.42 dB between two points.
        let power = 0.3f64.powi(2) / 2.0 / (1.5 * 0.0488);
        assert!(spectrum.density[highest].powi(2) > 0.6 * power, "{}", spectrum.density[highest].powi(2) / power);
    }

    #[test]
    fn blocks_of_a_straight_line_lie_on_it() {
        let slots: Vec<u64> = (0..100_000).filter(|slot| !(20_000..30_000).contains(slot)).collect();
        let series = Series {
            values: slots.iter().map(|&slot| 5.0 + slot as f64 * PERIOD_S).collect(),
            slots: slots.into(),
            span: 0..100_000,
            period_s: PERIOD_S,
            resolution: 0.0,
            unit: "deg/s",
        };
        let bias = bias_over_time(&series).expect("blocks");
        assert!(bias.mean.len() <= BLOCKS && bias.mean.len() > BLOCKS * 8 / 10, "{}", bias.mean.len());
        assert!(bias.time_s.iter().all(|time| !(201.0..299.0).contains(time)), "blocks without samples");
        let level = bias.mean[0] - bias.time_s[0];
        for (time, mean) in bias.time_s.iter().zip(&bias.mean) {
            // Half a sample, the first and last blocks of a gap, and six digits of 1,000 s.
            assert!((mean - time - level).abs() < 0.6 * bias.block_s, "{time}: {mean}");
        }
        assert!(bias.mean.iter().sum::<f64>().abs() < 0.1);
    }
}
