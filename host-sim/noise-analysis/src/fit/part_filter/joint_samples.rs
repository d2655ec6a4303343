//! The filter by the samples of several channels: they know far more of it than the octaves of the curves.

use super::channel_deviance::{FilteredChannel, kinds};
use super::decimation::{allowed_within, least_within};
use super::hypothesis::{BOUNDED, Hypothesis, Identified, birge_ratio, chi_squared_quantile, simplest};
use crate::distributions::{DESCRIBED, chi_squared_tail};
use crate::fit::noise_terms::{is_white, sinusoids};
use crate::parallel::in_parallel;
use crate::spectra::{SampleSpectrum, SpectrumBehindFilter};
use allan_core::NoiseTerm;
use allan_core::term::MovingAverageFilter;

/// Accuracy of the likeliest decimation, as a part of the range that the curves allow.
const ACCURACY: f64 = 1e-3;

/// A filter that the curves allow, with a decimation between these.
pub(super) type AllowedFilter = (MovingAverageFilter, (f64, f64));

/// The spectrum of one channel.
struct ChannelSpectrum {
    spectrum: SampleSpectrum,
    /// The terms of the channel beside its white noise.
    others: Vec<NoiseTerm>,
}

impl ChannelSpectrum {
    /// With the bands in which none of the filters has leakage. `None` where the samples of the channel are not kept, or too few are,
    /// and with a ramp, whose size is no density.
    fn new(channel: &FilteredChannel, allowed: &[AllowedFilter]) -> Option<Self> {
        let (samples, lines) = channel.samples.as_ref()?;
        let others: Vec<NoiseTerm> =
            channel.model.terms().iter().map(|term| term.kind).filter(|kind| !is_white(kind)).collect();
        if others.contains(&NoiseTerm::RateRamp) {
            return None;
        }
        let lines = [lines.as_slice(), &sinusoids(others.iter())].concat();
        let spectrum = samples.spectrum(channel.curve, &lines).filter(SampleSpectrum::has_all_noise)?;
        let spectrum = allowed.iter().fold(spectrum, |spectrum, (filter, _)| spectrum.without_leakage(*filter));
        Some(Self { spectrum, others })
    }
}

/// The spectrum of a channel behind one filter, with the least deviance at any decimation that is allowed.
struct ChannelBehindFilter<'a> {
    spectrum: SpectrumBehindFilter<'a>,
    least: f64,
}

impl<'a> ChannelBehindFilter<'a> {
    fn new(ChannelSpectrum { spectrum, others }: &'a ChannelSpectrum, (filter, range): AllowedFilter) -> Self {
        let spectrum = spectrum.behind(&kinds(NoiseTerm::Filtered(filter), others));
        let (least, _) = likeliest((filter, range), |read| spectrum.deviance(read));
        Self { least, spectrum }
    }
}

/// The spectrum of a channel behind each filter.
struct TriedChannel<'a> {
    behind: Vec<ChannelBehindFilter<'a>>,
    /// By how much the deviance exceeds that of a spectrum which a filter describes, at least 1; what it is divided by.
    dispersion: f64,
    /// Whether one of the filters describes it.
    is_described: bool,
}

impl<'a> TriedChannel<'a> {
    fn new(of: &'a ChannelSpectrum, allowed: &[AllowedFilter]) -> Self {
        let behind: Vec<ChannelBehindFilter> =
            allowed.iter().map(|filter| ChannelBehindFilter::new(of, *filter)).collect();
        let least = behind.iter().map(|of| of.least).fold(f64::INFINITY, f64::min);
        let bands = of.spectrum.bands() as f64;
        let is_tried = bands > 0.0 && least.is_finite();
        let is_described = is_tried && chi_squared_tail(least, bands) >= DESCRIBED;
        Self { behind, dispersion: (least / bands).max(1.0), is_described }
    }
}

/// The least deviance of a filter at a decimation within a range, and the filter with that decimation.
///
/// A reader that counts the values of the sensor has a whole number, at which the least deviance is a cusp: between two values of
/// its clock a sensor gives the one before, and which one that is changes with time.
fn likeliest(
    (filter, (from, to)): AllowedFilter,
    deviance: impl Fn(MovingAverageFilter) -> f64,
) -> (f64, MovingAverageFilter) {
    if filter.decimation == 1.0 {
        return (deviance(filter), filter);
    }
    let whole = (from.ceil() as u32..=to.floor() as u32).map(f64::from);
    let whole = whole.map(|decimation| MovingAverageFilter { decimation, ..filter });
    let between = least_within(filter, (from, to), ACCURACY * (to / from).ln(), &deviance);
    whole.fold((deviance(between), between), |least, read| {
        let deviance = deviance(read);
        if deviance < least.0 { (deviance, read) } else { least }
    })
}

/// The spectra of several channels behind one filter.
struct JointSpectra<'a> {
    /// With the dispersion of each.
    channels: Vec<(ChannelBehindFilter<'a>, f64)>,
    allowed: AllowedFilter,
}

impl JointSpectra<'_> {
    fn deviances(&self, filter: MovingAverageFilter) -> Vec<f64> {
        self.channels.iter().map(|(of, dispersion)| of.spectrum.deviance(filter) / dispersion).collect()
    }

    fn likeliest(&self) -> Hypothesis {
        let (_, filter) = likeliest(self.allowed, |read| self.deviances(read).iter().sum());
        Hypothesis { filter, deviances: self.deviances(filter) }
    }

    /// Bounds of the decimation of `common`, wider where the channels differ among themselves by more than chance.
    fn bounds(&self, common: &Hypothesis, rise: f64) -> (f64, f64) {
        if common.filter.decimation == 1.0 {
            return (1.0, 1.0);
        }
        let own = self.channels.iter().map(|(of, dispersion)| of.least / dispersion);
        let rises: Vec<f64> = common.deviances.iter().zip(own).map(|(joint, own)| (joint - own).max(0.0)).collect();
        let limit = common.total() + rise * birge_ratio(&rises);
        allowed_within(common.filter, self.allowed.1, limit, |read| self.deviances(read).iter().sum())
    }
}

/// The filter by the samples of channels: one of `allowed`. `None` without samples.
///
/// Where the spectra of some channels are those behind a filter, the others say nothing of it.
pub(super) fn identified(
    channels: &[&FilteredChannel],
    allowed: &[AllowedFilter],
    nominal_decimation: f64,
) -> Option<Identified> {
    let spectra = in_parallel(channels, |channel| ChannelSpectrum::new(channel, allowed));
    let spectra: Vec<&ChannelSpectrum> = spectra.iter().flatten().collect();
    let mut tried_alone = in_parallel(&spectra, |&of| TriedChannel::new(of, allowed));
    if tried_alone.iter().any(|of| of.is_described) {
        tried_alone.retain(|of| of.is_described);
    }
    let mut joint: Vec<JointSpectra> =
        allowed.iter().map(|of| JointSpectra { channels: Vec::new(), allowed: *of }).collect();
    for TriedChannel { behind, dispersion, .. } in tried_alone {
        joint.iter_mut().zip(behind).for_each(|(joint, of)| joint.channels.push((of, dispersion)));
    }
    let tried: Vec<Hypothesis> = in_parallel(&joint, JointSpectra::likeliest);
    let least = tried.iter().map(Hypothesis::total).fold(f64::INFINITY, f64::min);
    let rise = chi_squared_quantile(BOUNDED, 1.0);
    let (chosen, other_taps) = simplest(&tried, least + rise, nominal_decimation).filter(|_| !spectra.is_empty())?;
    Some(Identified::new(tried[chosen].filter, joint[chosen].bounds(&tried[chosen], rise), other_taps))
}
