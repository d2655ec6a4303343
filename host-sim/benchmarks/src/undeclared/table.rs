//! What came of all recordings, in numbers.

mod text;

use super::Group;
use super::examine::{Answer, Estimate, Outcome, Unseen};
use super::kind::Kind;
use serde::Serialize;

/// From this strength on an effect is to be named.
pub const STRONG: f64 = 2.0;
/// Upper ends of the classes of strength.
const CLASSES: [f64; 5] = [0.5, 1.0, 2.0, 5.0, f64::INFINITY];
const CLASS_NAMES: [&str; 5] = ["< 0.5", "0.5…1", "1…2", "2…5", "≥ 5"];

/// The outcomes of all recordings, in the order of the plan.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Table {
    /// Each with the group that it belongs to.
    pub outcomes: Vec<(Group, Outcome)>,
}

/// How often something came out so.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Share {
    /// So often.
    pub yes: usize,
    /// Of so many.
    pub all: usize,
}

impl Share {
    fn of(answers: impl IntoIterator<Item = bool>) -> Self {
        answers
            .into_iter()
            .fold(Self::default(), |share, yes| Self { yes: share.yes + usize::from(yes), all: share.all + 1 })
    }

    /// In percent; `None` of none.
    #[must_use]
    pub fn percent(self) -> Option<f64> {
        (self.all > 0).then(|| 100.0 * self.yes as f64 / self.all as f64)
    }
}

impl std::fmt::Display for Share {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.percent() {
            Some(percent) => f.pad(&format!("{percent:.0} %")),
            None => f.pad("–"),
        }
    }
}

impl Table {
    fn outcomes(&self, group: Group) -> impl Iterator<Item = &Outcome> {
        self.outcomes.iter().filter(move |(of, _)| *of == group).map(|(_, outcome)| outcome)
    }

    fn singles(&self) -> impl Iterator<Item = &Outcome> {
        self.outcomes.iter().filter(|(group, _)| matches!(group, Group::Single(_))).map(|(_, outcome)| outcome)
    }

    fn answers(&self, kind: Kind) -> impl Iterator<Item = &Answer> {
        self.outcomes(Group::Single(kind)).flat_map(|outcome| &outcome.answers)
    }

    /// Single effects of at least twice the limit that were named.
    #[must_use]
    pub fn named(&self) -> Share {
        let strong = self.singles().flat_map(|outcome| &outcome.answers).filter(|answer| answer.strength >= STRONG);
        Share::of(strong.map(|answer| answer.named))
    }

    /// Recordings with nothing hidden in which something is reported.
    #[must_use]
    pub fn false_alarms(&self) -> Share {
        Share::of(self.outcomes(Group::Nothing).map(|outcome| !outcome.false_alarms.is_empty()))
    }

    /// Recordings with one effect in which something else is reported as well.
    #[must_use]
    pub fn something_else(&self) -> Share {
        Share::of(self.singles().map(|outcome| !outcome.false_alarms.is_empty()))
    }

    /// Pairs of which both were named.
    #[must_use]
    pub fn both(&self) -> Share {
        Share::of(self.outcomes(Group::Pair).map(|outcome| outcome.answers.iter().all(|answer| answer.named)))
    }

    /// Parameters of strong single effects that are as near as they are to be: frequencies and rates of a clock within
    /// 2 %, the others within 10 %.
    #[must_use]
    pub fn near(&self) -> Share {
        Share::of(self.estimates(None).map(Estimate::is_near))
    }

    /// Intervals of all named single effects that hold the truth.
    #[must_use]
    pub fn coverage(&self) -> Share {
        Share::of(self.singles().flat_map(|outcome| &outcome.estimates).map(Estimate::is_covered))
    }

    /// Recordings with a strong effect whose unseen error is within 1.5 times what `which` compares it with.
    #[must_use]
    pub fn unseen(&self, which: fn(&Unseen) -> bool) -> Share {
        let strong = self.singles().filter(|outcome| is_strong(outcome));
        Share::of(strong.filter_map(|outcome| outcome.unseen).map(|unseen| which(&unseen)))
    }

    /// Of strong single effects, of one kind or of all.
    fn estimates(&self, kind: Option<Kind>) -> impl Iterator<Item = &Estimate> {
        let strong = self.singles().filter(|outcome| is_strong(outcome));
        strong
            .flat_map(|outcome| &outcome.estimates)
            .filter(move |estimate| kind.is_none_or(|kind| estimate.kind == kind))
    }
}

impl Estimate {
    fn is_near(&self) -> bool {
        self.relative_error <= if matches!(self.name, "frequency" | "rate_hz") { 0.02 } else { 0.1 }
    }

    fn is_covered(&self) -> bool {
        (self.low..=self.high).contains(&self.truth)
    }
}

impl Unseen {
    /// Most of the unseen error, over another's, that counts as no worse.
    const NO_WORSE: f64 = 1.5;

    /// Whether the error after is no worse than the true model's.
    #[must_use]
    pub fn is_near_truth(&self) -> bool {
        self.after <= Self::NO_WORSE * self.truth
    }

    /// Whether the error after is no worse than that of the true terms, fitted.
    #[must_use]
    pub fn is_near_true_terms(&self) -> bool {
        self.after <= Self::NO_WORSE * self.refitted
    }

    /// Whether the true terms, fitted, are no worse than the true model.
    #[must_use]
    pub fn are_true_terms_near_truth(&self) -> bool {
        self.refitted <= Self::NO_WORSE * self.truth
    }
}

fn is_strong(outcome: &Outcome) -> bool {
    outcome.answers.iter().all(|answer| answer.strength >= STRONG)
}
