//! What the spectrum of a channel shows, and the trace that knows of it.

use super::lines::{self, Line};
use super::study::{Following, Study};
use crate::series::Series;
use allan_core::term::MovingAverageFilter;
use allan_core::{Model, NoiseTerm};

/// Share of a line's deviation that must be left when what the channel follows is taken off; else it is that's line.
const OWN: f64 = 0.5;
/// Power gain of a filter below which noise leaks into its nulls from elsewhere.
const LEAKING: f64 = 0.1;

/// Traces what a channel lacks, with the lines of its spectrum. `rest` are its samples without what it follows, if it
/// follows anything.
pub(super) fn study(
    following: Following,
    series: &Series,
    rest: Option<&Series>,
    filters: &[MovingAverageFilter],
) -> (Study, Vec<Line>) {
    let mut lines = lines::of(series, None);
    if let Some(rest) = rest {
        let left = lines::of(rest, None);
        let is_own = |line: &Line, left: &Line| line.is_same(left) && left.deviation.value > OWN * line.deviation.value;
        lines.retain(|line| left.iter().any(|left| is_own(line, left)));
    }
    let mut study = Study::traced(following, &lines::kinds(&lines), filters);
    let correlated = study.trace.after.terms().iter().any(|term| matches!(term.kind, NoiseTerm::Markov(_)));
    if correlated && lines.iter().any(Line::is_broad) {
        // A hump may be the foot of a process that the spectrum's background has no form for.
        lines.retain(|line| !line.is_broad());
        lines.extend(lines::of(series, Some(&study.trace.after)).into_iter().filter(Line::is_broad));
        study = Study::traced(study.following, &lines::kinds(&lines), filters);
    }
    lines.retain(|line| line.is_steady() || !leaks(&study.trace.after, line.frequency.value));
    (study, lines)
}

/// How long the impulse response of the filters in a model is, s.
pub(super) fn filter_s(model: &Model) -> f64 {
    let length = |kind: &NoiseTerm| match kind {
        NoiseTerm::Filtered(filter) => {
            f64::from(filter.stages) * f64::from(filter.taps) * model.sample_period() / filter.decimation
        }
        _ => 0.0,
    };
    model.terms().iter().map(|term| length(&term.kind)).fold(0.0, f64::max)
}

/// Whether a hump at `frequency` Hz may be what leaks into the nulls of a filter that a model has.
fn leaks(model: &Model, frequency: f64) -> bool {
    let gain = |kind: &NoiseTerm| match kind {
        NoiseTerm::Filtered(filter) if filter.decimation == 1.0 => {
            // 1 at low frequencies, where no noise is left out.
            kind.process().density(frequency, model.sample_period())
        }
        _ => 1.0,
    };
    model.terms().iter().map(|term| gain(&term.kind)).fold(1.0, f64::min) < LEAKING
}
