//! The model of a channel with the lines that its spectrum shows.

use crate::fit::channel_fit::ChannelFit;
use crate::fit::covariates::CovariateFit;
use crate::samples::series::Series;
use crate::spectra::spectral_lines::{self, MergedLine, before_averaging, is_alias};
use allan_core::Model;
use allan_core::term::NoiseTerm;
use measurement::SensorProfile;

/// A line of the channel itself keeps more than this part of its deviation when the covariates are subtracted.
const MIN_OWN_DEVIATION: f64 = 0.5;
/// Power gain of a filter below which the spectrum holds leakage from other frequencies.
const LEAKAGE_GAIN: f64 = 0.1;

/// Finds the lines of `series` and traces what the baseline model lacks with them.
///
/// `rest` is the series less its covariates, if the channel depends on any; lines that come from a covariate are left out.
/// Of a series that has means of so many samples, `faster` are the lines that it does not show, and that are known beforehand; what
/// they look like in the series is left out.
pub(crate) fn fit_with_lines(
    covariates: CovariateFit,
    series: &Series,
    rest: Option<&Series>,
    profile: &SensorProfile,
    (samples_per_mean, faster): (u64, &[MergedLine]),
) -> (ChannelFit, Vec<MergedLine>) {
    let rate_error = profile.sample_rate_error;
    let find = |series: &Series, known: Option<&Model>| {
        let mut lines = spectral_lines::find(series, known, rate_error);
        lines.retain(|line| !faster.iter().any(|faster| is_alias(line, faster, series.period_s)));
        lines.iter_mut().for_each(|line| line.deviation = before_averaging(line, series.period_s, samples_per_mean));
        lines
    };
    let mut lines = find(series, None);
    if let Some(rest) = rest {
        let left = find(rest, None);
        let is_own = |line: &MergedLine, left: &MergedLine| {
            line.is_same(left) && left.deviation.value > MIN_OWN_DEVIATION * line.deviation.value
        };
        lines.retain(|line| left.iter().any(|left| is_own(line, left)));
    }
    lines.extend(faster);
    let kinds = |lines: &[MergedLine]| lines.iter().map(MergedLine::kind).collect::<Vec<NoiseTerm>>();
    let filters = profile.filters_read_at(1.0 / covariates.curve.sample_period());
    let mut fit = ChannelFit::fit_traced(covariates, &kinds(&lines), &filters);
    if fit.correlation_times().next().is_some() && lines.iter().any(MergedLine::is_broad) {
        // A broad line may be a part of a Markov process, which the background of the first search has no form for.
        lines.retain(|line| !line.is_broad());
        lines.extend(find(series, Some(fit.after())).into_iter().filter(MergedLine::is_broad));
        lines.extend(faster.iter().filter(|line| line.is_broad()));
        fit = ChannelFit::fit_traced(fit.covariates, &kinds(&lines), &filters);
    }
    lines.retain(|line| line.is_sinusoid() || !is_leakage(fit.after(), line.frequency.value));
    (fit, lines)
}

/// Whether a broad line at `frequency` Hz may be leakage into a null of a filter of the model.
fn is_leakage(model: &Model, frequency: f64) -> bool {
    let gain = |kind: &NoiseTerm| match kind {
        // The density of the filtered unit white noise is 1 at low frequencies.
        NoiseTerm::Filtered(filter) if filter.decimation == 1.0 => {
            kind.process().density(frequency, model.sample_period())
        }
        _ => 1.0,
    };
    model.terms().iter().map(|term| gain(&term.kind)).fold(1.0, f64::min) < LEAKAGE_GAIN
}
