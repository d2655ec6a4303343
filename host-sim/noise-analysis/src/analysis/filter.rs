//! A part has one filter, and all its channels pass it.
//!
//! A channel of less noise than a count shows it badly: rounding is then no noise of its own, and steeper at the shortest
//! times than the filter is.

use super::study::Study;
use allan_core::NoiseTerm;
use allan_core::fit::{fit_shapes, goodness};
use allan_core::term::MovingAverageFilter;
use allan_core::trace::Trace;

/// By how much the deviance may rise with the filter of the other channels instead of a channel's own: chance does more
/// to one that is right once in 600 times (χ² of one degree of freedom).
const RISE: f64 = 10.0;
/// Channels from which on a filter that most of them lack is not the part's.
const FEWEST: usize = 3;

/// A channel's study, and whether its noise reaches from one count to the next.
pub(super) struct Channel<'a> {
    pub study: &'a mut Study,
    pub dithered: bool,
}

/// Gives all channels that show a filter the one that most of the evidence is for, unless a channel contradicts.
///
/// Evidence is the score that the filter was found with. Of three channels or more, at least half must show one; else
/// what looks like a filter in a few is something else, and is no longer among what was found.
pub(super) fn agree(channels: &mut [Channel]) {
    let Some(common) = most_evident(channels) else { return };
    let showing = channels.iter().filter(|channel| own(&channel.study.trace).is_some()).count();
    if channels.len() >= FEWEST && 2 * showing < channels.len() {
        for channel in channels {
            if let Some((term, _, _)) = own(&channel.study.trace) {
                channel.study.trace.added.retain(|found| found.term != term);
            }
        }
        return;
    }
    for channel in channels {
        let Some((term, filter, _)) = own(&channel.study.trace) else { continue };
        if is_alike(filter, common) {
            continue;
        }
        let study = &mut *channel.study;
        let mut kinds: Vec<NoiseTerm> = study.trace.after.terms().iter().map(|known| known.kind).collect();
        kinds[term] = NoiseTerm::Filtered(common);
        // At the filter's own rate, what comes behind it is told from what passes it: rounding, if nothing else.
        if common.decimation == 1.0 && !kinds.contains(&NoiseTerm::AngleRandomWalk) {
            kinds.push(NoiseTerm::AngleRandomWalk);
        }
        let model = fit_shapes(&study.following.curve, &kinds);
        let judged = goodness(&study.following.curve, &model);
        if !channel.dithered || judged.deviance < study.trace.after_goodness.deviance + RISE {
            (study.trace.after, study.trace.after_goodness) = (model, judged);
        }
    }
}

/// Where in the model a filter is that was found missing, which, and with what score.
fn own(trace: &Trace) -> Option<(usize, MovingAverageFilter, f64)> {
    trace.added.iter().find_map(|found| match trace.after.terms()[found.term].kind {
        NoiseTerm::Filtered(filter) => Some((found.term, filter, found.score)),
        _ => None,
    })
}

/// By the channels whose noise reaches from one count to the next.
fn most_evident(channels: &[Channel]) -> Option<MovingAverageFilter> {
    let dithered = channels.iter().filter(|channel| channel.dithered);
    let shown: Vec<(MovingAverageFilter, f64)> =
        dithered.filter_map(|channel| own(&channel.study.trace)).map(|(_, filter, score)| (filter, score)).collect();
    let evidence = |of: MovingAverageFilter| {
        shown.iter().filter(|(filter, _)| is_alike(*filter, of)).map(|(_, score)| score).sum::<f64>()
    };
    let clearest = shown.iter().map(|&(filter, score)| (filter, evidence(filter), score));
    clearest.max_by(|a, b| a.1.total_cmp(&b.1).then(a.2.total_cmp(&b.2))).map(|(filter, _, _)| filter)
}

/// Whether two filters differ at most in what a clock does.
fn is_alike(a: MovingAverageFilter, b: MovingAverageFilter) -> bool {
    (a.stages, a.taps, a.decimation == 1.0) == (b.stages, b.taps, b.decimation == 1.0)
}
