//! What came of all recordings, in numbers.

use super::Group;
use super::examine::{Answer, Estimate, Outcome};
use super::kind::Kind;
use serde::Serialize;
use std::collections::BTreeMap;
use std::io::{self, Write};

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

    /// Recordings with a strong effect whose unseen error is within 1.5 times that of the true model.
    #[must_use]
    pub fn unseen(&self) -> Share {
        let strong = self.singles().filter(|outcome| is_strong(outcome));
        Share::of(strong.filter_map(|outcome| outcome.unseen).map(|unseen| unseen.after <= 1.5 * unseen.truth))
    }

    /// Of strong single effects, of one kind or of all.
    fn estimates(&self, kind: Option<Kind>) -> impl Iterator<Item = &Estimate> {
        let strong = self.singles().filter(|outcome| is_strong(outcome));
        strong
            .flat_map(|outcome| &outcome.estimates)
            .filter(move |estimate| kind.is_none_or(|kind| estimate.kind == kind))
    }

    /// Writes all of it.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        self.write_rates(out)?;
        self.write_confusion(out)?;
        self.write_parameters(out)?;
        self.write_unseen(out)?;
        self.write_summary(out)
    }

    fn kinds(&self) -> Vec<Kind> {
        Kind::ALL.into_iter().filter(|kind| self.answers(*kind).next().is_some()).collect()
    }

    fn write_rates(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "Named, by strength over the smallest effect that any test could see\n")?;
        write!(out, "{:<18}", "")?;
        for name in CLASS_NAMES {
            write!(out, "{name:>12}")?;
        }
        writeln!(out)?;
        for kind in self.kinds() {
            write!(out, "{:<18}", kind.name())?;
            let mut from = 0.0;
            for to in CLASSES {
                let within = self.answers(kind).filter(|answer| (from..to).contains(&answer.strength));
                let share = Share::of(within.map(|answer| answer.named));
                let cell = if share.all == 0 { "–".to_owned() } else { format!("{}/{}", share.yes, share.all) };
                write!(out, "{cell:>12}")?;
                from = to;
            }
            writeln!(out)?;
        }
        Ok(())
    }

    fn write_confusion(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "\nConfusion: strong effects (rows) and what was named in their channels\n")?;
        let initials = |kind: Kind| kind.name().chars().take(5).collect::<String>();
        write!(out, "{:<18}", "")?;
        for kind in Kind::ALL {
            write!(out, "{:>6}", initials(kind))?;
        }
        writeln!(out, "{:>6}{:>6}", "other", "none")?;
        for kind in self.kinds() {
            let mut named: BTreeMap<Option<&str>, usize> = BTreeMap::new();
            for answer in self.answers(kind).filter(|answer| answer.strength >= STRONG) {
                let name = if answer.named { Some(kind.name()) } else { answer.instead.as_deref() };
                *named.entry(name).or_insert(0) += 1;
            }
            write!(out, "{:<18}", kind.name())?;
            for column in Kind::ALL {
                write!(out, "{:>6}", cell(named.remove(&Some(column.name()))))?;
            }
            let none = named.remove(&None);
            writeln!(out, "{:>6}{:>6}", cell((!named.is_empty()).then(|| named.values().sum())), cell(none))?;
        }
        Ok(())
    }

    fn write_parameters(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "\nParameters of strong effects that were named\n")?;
        writeln!(
            out,
            "{:<34}{:>8}{:>14}{:>14}{:>12}{:>10}",
            "", "number", "median error", "90 % within", "near enough", "coverage"
        )?;
        for kind in self.kinds() {
            let mut names: Vec<&str> = self.estimates(Some(kind)).map(|estimate| estimate.name).collect();
            names.sort_unstable();
            names.dedup();
            for name in names {
                let of = || self.estimates(Some(kind)).filter(|estimate| estimate.name == name);
                let errors: Vec<f64> = of().map(|estimate| 100.0 * estimate.relative_error).collect();
                writeln!(
                    out,
                    "{:<34}{:>8}{:>14}{:>14}{:>12}{:>10}",
                    format!("{} {name}", kind.name()),
                    errors.len(),
                    percent(quantile(&errors, 0.5)),
                    percent(quantile(&errors, 0.9)),
                    Share::of(of().map(Estimate::is_near)).to_string(),
                    Share::of(of().map(Estimate::is_covered)).to_string(),
                )?;
            }
        }
        Ok(())
    }

    fn write_unseen(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "\nDeviance per point on unseen data, medians over strong effects\n")?;
        writeln!(out, "{:<18}{:>12}{:>12}{:>14}{:>22}", "", "before", "after", "true model", "after ≤ 1.5 × true")?;
        for kind in self.kinds() {
            let strong = self.outcomes(Group::Single(kind)).filter(|outcome| is_strong(outcome));
            let unseen: Vec<_> = strong.filter_map(|outcome| outcome.unseen).collect();
            let median = |of: fn(&super::examine::Unseen) -> f64| {
                quantile(&unseen.iter().map(of).collect::<Vec<_>>(), 0.5)
                    .map_or("–".to_owned(), |v| format!("{v:.2}"))
            };
            writeln!(
                out,
                "{:<18}{:>12}{:>12}{:>14}{:>22}",
                kind.name(),
                median(|unseen| unseen.before),
                median(|unseen| unseen.after),
                median(|unseen| unseen.truth),
                Share::of(unseen.iter().map(|unseen| unseen.after <= 1.5 * unseen.truth)).to_string(),
            )?;
        }
        Ok(())
    }

    fn write_summary(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out)?;
        let lines = [
            ("named, single effects of twice the limit or more", self.named()),
            ("nothing hidden, yet something reported", self.false_alarms()),
            ("one effect hidden, and something else reported too", self.something_else()),
            ("both effects of a pair named", self.both()),
            ("parameters within 10 % (frequencies 2 %)", self.near()),
            ("95 % intervals that hold the truth", self.coverage()),
            ("unseen error within 1.5 times the true model's", self.unseen()),
        ];
        for (what, share) in lines {
            let percent = share.percent().map_or("–".to_owned(), |percent| format!("{percent:.1} %"));
            writeln!(out, "{what:<52}{percent:>8}   ({} of {})", share.yes, share.all)?;
        }
        let mut alarms: BTreeMap<&str, usize> = BTreeMap::new();
        for alarm in self.outcomes(Group::Nothing).flat_map(|outcome| &outcome.false_alarms) {
            *alarms.entry(alarm).or_insert(0) += 1;
        }
        for (alarm, count) in alarms {
            writeln!(out, "  false alarm, nothing hidden: {alarm} × {count}")?;
        }
        Ok(())
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

fn is_strong(outcome: &Outcome) -> bool {
    outcome.answers.iter().all(|answer| answer.strength >= STRONG)
}

fn cell(count: Option<usize>) -> String {
    count.map_or(".".to_owned(), |count| count.to_string())
}

fn percent(value: Option<f64>) -> String {
    value.map_or("–".to_owned(), |value| format!("{value:.2} %"))
}

/// The value below which the part `level` of `values` lies.
fn quantile(values: &[f64], level: f64) -> Option<f64> {
    let mut sorted: Vec<f64> = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let at = (level * sorted.len() as f64).ceil() as usize;
    sorted.get(at.saturating_sub(1)).copied()
}
