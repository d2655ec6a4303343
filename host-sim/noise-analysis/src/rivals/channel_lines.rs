//! The model of a channel with the lines that its spectrum shows.

use crate::fit::channel_fit::ChannelFit;
use crate::fit::covariates::CovariateFit;
use crate::rivals::shown_by_samples::ShownBySamples;
use crate::rivals::table::{LineClaim, stands_as_line};
use crate::spectra::spectral_lines::{MergedLine, before_averaging, is_read_slowly};
use allan_core::Model;
use allan_core::term::NoiseTerm;
use measurement::SensorProfile;

/// Traces what the baseline model lacks with the lines that the samples have shown; lines that come from a covariate are left out.
///
/// `faster` are lines, known beforehand, that a series of means over so many samples does not show at their own frequencies: their
/// aliases are left out.
pub(crate) fn fit_with_lines(
    covariates: CovariateFit,
    shown: &ShownBySamples,
    profile: &SensorProfile,
    (samples_per_mean, faster): (u64, &[MergedLine]),
) -> (ChannelFit, Vec<MergedLine>) {
    let period_s = shown.series.period_s;
    let standing = |mut lines: Vec<MergedLine>| {
        lines.retain(|line| stands_as_line(&LineClaim { faster, ..LineClaim::new(line, period_s) }));
        lines.iter_mut().for_each(|line| line.deviation = before_averaging(line, period_s, samples_per_mean));
        lines
    };
    let mut lines = standing(shown.lines.clone());
    if let Some(left) = shown.lines_of_rest.clone().map(standing) {
        lines.retain(|line| stands_as_line(&LineClaim { left: Some(&left), ..LineClaim::new(line, period_s) }));
    }
    lines.extend(faster);
    let kinds = |lines: &[MergedLine]| lines.iter().map(MergedLine::kind).collect::<Vec<NoiseTerm>>();
    let filters = profile.filters_read_at(1.0 / covariates.curve.sample_period());
    let mut fit = ChannelFit::fit_traced(covariates, &kinds(&lines), &filters);
    let is_shaped =
        fit.correlation_times().next().is_some() || fit.after().terms().iter().any(|of| is_read_slowly(&of.kind));
    if is_shaped && lines.iter().any(MergedLine::is_broad) {
        // A broad line may be a part of a Markov process or the edge of a null of a filter that is read slowly, which the background of
        // the first search has no form for. Of what both searches find, that of the spectrum that has more of a resonance's shape counts: the
        // process may be a wrong one.
        let (first, others): (Vec<MergedLine>, Vec<MergedLine>) = lines.iter().partition(|line| line.is_broad());
        let likelier = |line: MergedLine| {
            let same = first.iter().filter(|other| line.is_same(other));
            same.fold(line, |best, other| if other.shape_p_value > best.shape_p_value { *other } else { best })
        };
        lines = others;
        lines.extend(standing(shown.lines_over(fit.after())).into_iter().filter(MergedLine::is_broad).map(likelier));
        lines.extend(faster.iter().filter(|line| line.is_broad()));
        fit = ChannelFit::fit_traced(fit.covariates, &kinds(&lines), &filters);
    }
    (fit, lines)
}

/// Leaves out the `lines` that leak into a null of the filter of a channel's model. The filter that the channel has by itself, before it is
/// known by all channels, may be a wrong one beside a strong band.
pub(crate) fn without_leakage(lines: &mut Vec<MergedLine>, model: &Model) {
    lines.retain(|line| {
        let gain = filter_gain(model, line.frequency.value);
        stands_as_line(&LineClaim { gain, ..LineClaim::new(line, model.sample_period()) })
    });
}

/// The part of the density of white noise that passes the filter of the model, with what is folded, at `frequency` Hz.
fn filter_gain(model: &Model, frequency: f64) -> f64 {
    model.filter().map_or(1.0, |filter| NoiseTerm::Filtered(filter).process().density(frequency, model.sample_period()))
}
