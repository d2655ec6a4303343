//! The noise model of one channel in one part of a recording, and the agreement of all channels on the sensor's one
//! low-pass filter.

use crate::OCTAVES;
use crate::covariates::CovariateFit;
use crate::estimators::RecordPart;
use allan_core::fit::{fit_shapes, goodness};
use allan_core::term::{Markov, MovingAverageFilter};
use allan_core::trace::{LineCandidates, Trace, trace};
use allan_core::{Curve, NoiseTerm};
use measurement::{ChannelProfile, SensorProfile};

/// A channel is dithered if its Allan deviation exceeds the limit of the profile at any of the first octaves, this many.
/// Behind a filter neighbouring samples are correlated, so that the limit is exceeded only at longer averaging times.
pub(crate) const DITHERED_OCTAVES: usize = 7;
/// p-value of a model's goodness of fit below which a trace with the lines of the curve itself is tried.
const POOR_FIT: f64 = 1e-3;
/// By how much the deviance may rise with the other channels' filter: a correct filter rises by more by chance once in 600
/// times (χ² of one degree of freedom).
const MAX_DEVIANCE_RISE: f64 = 10.0;
/// From so many channels on, at least half of them must show a filter.
const MIN_CHANNELS_FOR_MAJORITY: usize = 3;

/// The fit of one channel in one part of a recording: its covariates, and the trace of what the baseline model lacks.
pub(crate) struct ChannelFit {
    pub covariates: CovariateFit,
    pub trace: Trace,
}

impl ChannelFit {
    /// The baseline model alone.
    pub(crate) fn fit_baseline(covariates: CovariateFit) -> Self {
        let trace = Trace::baseline(&covariates.curve);
        Self { covariates, trace }
    }

    /// The baseline model and what it lacks; `lines` are those of the spectrum, `filters` those that the sensor may have.
    ///
    /// If the model with `lines` fits badly and the lines that the curve itself shows fit better, those are used: a line
    /// whose frequency wanders is many lines in the spectrum of a long record and one in the curve.
    pub(crate) fn fit_traced(covariates: CovariateFit, lines: &[NoiseTerm], filters: &[MovingAverageFilter]) -> Self {
        let by_spectrum = trace(&covariates.curve, LineCandidates::Spectrum(lines), filters);
        if lines.is_empty() || by_spectrum.after_goodness.p_value > POOR_FIT {
            return Self { covariates, trace: by_spectrum };
        }
        let by_curve = trace(&covariates.curve, LineCandidates::Curve, filters);
        let is_better = by_curve.after_goodness.deviance < by_spectrum.after_goodness.deviance;
        Self { covariates, trace: if is_better { by_curve } else { by_spectrum } }
    }

    /// Correlation times of the model's Markov processes, s.
    pub(crate) fn correlation_times(&self) -> impl Iterator<Item = f64> {
        self.trace.after.terms().iter().filter_map(|term| match term.kind {
            NoiseTerm::Markov(Markov { time_constant }) => Some(time_constant),
            _ => None,
        })
    }

    /// Whether the noise of the first `octaves` is large enough against the channel's `resolution` (in its unit) that
    /// rounding adds white noise and nothing else.
    pub(crate) fn is_dithered(&self, profile: &SensorProfile, resolution: f64, octaves: usize) -> bool {
        let avars = self.covariates.curve.points().iter().take(octaves).map(|point| point.avar);
        avars.fold(0.0, f64::max) > profile.dithered_avar_counts2 * resolution * resolution
    }

    /// The Allan deviation of the model with the added terms at each point of `whole`, with the share of the covariates: that
    /// is in the measured curve and not in the model. `avar_of` is the Allan variance of a channel of the whole record at an
    /// averaging factor.
    pub(crate) fn deviations(
        &self,
        both: &RecordPart,
        position: usize,
        whole: &Curve<OCTAVES>,
        avar_of: impl Fn(ChannelProfile, u64) -> Option<f64>,
    ) -> Vec<f64> {
        let factors = || whole.points().iter().map(|point| point.n);
        let shares = self.covariates.shares(both, position, factors(), avar_of);
        factors().zip(shares).map(|(n, share)| (self.trace.after.avar(n) + share).sqrt()).collect()
    }

    /// The filter that the trace added: the term's position in the model, the filter, and its score.
    fn added_filter(&self) -> Option<(usize, MovingAverageFilter, f64)> {
        let trace = &self.trace;
        trace.added.iter().find_map(|found| match trace.after.terms()[found.term].kind {
            NoiseTerm::Filtered(filter) => Some((found.term, filter, found.score)),
            _ => None,
        })
    }
}

/// Replaces the filters of the channels by the one with the largest sum of scores, unless the deviance of a dithered
/// channel rises by more than [`MAX_DEVIANCE_RISE`].
///
/// Each fit comes with whether the channel is dithered: whether its noise reaches from one count to the next. A channel that
/// is not shows the filter badly, because its rounding error is no white noise and falls faster at the shortest averaging
/// times than behind the filter; its score is not counted, and it takes the filter without this test. Of three channels or more at least half must show a
/// filter; otherwise no filter is reported; the fitted models keep theirs.
pub(crate) fn agree_on_filter(channels: &mut [(&mut ChannelFit, bool)]) {
    let Some(agreed) = highest_scoring_filter(channels) else { return };
    let showing = channels.iter().filter(|(fit, _)| fit.added_filter().is_some()).count();
    if channels.len() >= MIN_CHANNELS_FOR_MAJORITY && 2 * showing < channels.len() {
        for (fit, _) in channels {
            if let Some((term, ..)) = fit.added_filter() {
                fit.trace.added.retain(|found| found.term != term);
            }
        }
        return;
    }
    for (fit, is_dithered) in channels {
        let Some((term, filter, _)) = fit.added_filter() else { continue };
        if is_alike(filter, agreed) {
            continue;
        }
        let mut kinds: Vec<NoiseTerm> = fit.trace.after.terms().iter().map(|known| known.kind).collect();
        kinds[term] = NoiseTerm::Filtered(agreed);
        // At the filter's own rate, white noise that is added behind the filter (at least rounding) can be told from the
        // noise that passes it.
        if agreed.decimation == 1.0 && !kinds.contains(&NoiseTerm::AngleRandomWalk) {
            kinds.push(NoiseTerm::AngleRandomWalk);
        }
        let model = fit_shapes(&fit.covariates.curve, &kinds);
        let judged = goodness(&fit.covariates.curve, &model);
        if !*is_dithered || judged.deviance < fit.trace.after_goodness.deviance + MAX_DEVIANCE_RISE {
            (fit.trace.after, fit.trace.after_goodness) = (model, judged);
        }
    }
}

/// The filter of the dithered channels whose scores, those of filters alike included, have the largest sum.
fn highest_scoring_filter(channels: &[(&mut ChannelFit, bool)]) -> Option<MovingAverageFilter> {
    let dithered = channels.iter().filter(|(_, is_dithered)| *is_dithered);
    let shown: Vec<(MovingAverageFilter, f64)> =
        dithered.filter_map(|(fit, _)| fit.added_filter()).map(|(_, filter, score)| (filter, score)).collect();
    let sum = |of: MovingAverageFilter| {
        shown.iter().filter(|(filter, _)| is_alike(*filter, of)).map(|(_, score)| score).sum::<f64>()
    };
    let scored = shown.iter().map(|&(filter, score)| (filter, sum(filter), score));
    scored.max_by(|a, b| a.1.total_cmp(&b.1).then(a.2.total_cmp(&b.2))).map(|(filter, ..)| filter)
}

/// Whether two filters differ at most in the ratio of the two sample clocks.
fn is_alike(a: MovingAverageFilter, b: MovingAverageFilter) -> bool {
    (a.stages, a.taps, a.decimation == 1.0) == (b.stages, b.taps, b.decimation == 1.0)
}
