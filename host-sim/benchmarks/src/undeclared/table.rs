//! The scores of all recordings, with a summary.

use super::draw::RecordingGroup;
use super::effect::EffectKind;
use super::outside::OutsideKind;
use super::score::{EffectScore, OutsideScore, ParameterScore, RecordingScore, UnseenErrors};
use serde::Serialize;
use std::collections::BTreeMap;
use std::io::{self, Write};

/// Least strength of effects in the summary.
pub const STRONG: f64 = 2.0;
const CLASSES: [f64; 5] = [0.5, 1.0, 2.0, 5.0, f64::INFINITY];
const CLASS_NAMES: [&str; 5] = ["< 0.5", "0.5…1", "1…2", "2…5", "≥ 5"];

/// The scores, in the order of the plan.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ScoreTable {
    pub outcomes: Vec<(RecordingGroup, RecordingScore)>,
}

/// A number of cases out of all.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Proportion {
    pub yes: usize,
    pub all: usize,
}

impl Proportion {
    pub(super) fn count(cases: impl IntoIterator<Item = bool>) -> Self {
        let add = |sum: Self, yes| Self { yes: sum.yes + usize::from(yes), all: sum.all + 1 };
        cases.into_iter().fold(Self::default(), add)
    }

    /// The proportion in percent; `None` if there is no case.
    #[must_use]
    pub fn percent(self) -> Option<f64> {
        (self.all > 0).then(|| 100.0 * self.yes as f64 / self.all as f64)
    }
}

impl std::fmt::Display for Proportion {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.percent() {
            Some(percent) => f.pad(&format!("{percent:.0} %")),
            None => f.pad("–"),
        }
    }
}

impl ScoreTable {
    fn outcomes(&self, group: RecordingGroup) -> impl Iterator<Item = &RecordingScore> {
        self.outcomes.iter().filter(move |(of, _)| *of == group).map(|(_, outcome)| outcome)
    }

    fn singles(&self) -> impl Iterator<Item = &RecordingScore> {
        self.outcomes.iter().filter(|(group, _)| matches!(group, RecordingGroup::Single(_))).map(|(_, outcome)| outcome)
    }

    fn answers(&self, kind: EffectKind) -> impl Iterator<Item = &EffectScore> {
        self.outcomes(RecordingGroup::Single(kind)).flat_map(|outcome| &outcome.answers)
    }

    /// Named single effects, of those with a strength of at least [`STRONG`].
    #[must_use]
    pub fn named(&self) -> Proportion {
        let strong = self.singles().flat_map(|outcome| &outcome.answers).filter(|answer| answer.strength >= STRONG);
        Proportion::count(strong.map(|answer| answer.named))
    }

    /// Recordings without an effect whose report has a name.
    #[must_use]
    pub fn false_alarms(&self) -> Proportion {
        Proportion::count(self.outcomes(RecordingGroup::Nothing).map(|outcome| !outcome.false_alarms.is_empty()))
    }

    /// Recordings with one effect whose report also has a wrong name.
    #[must_use]
    pub fn something_else(&self) -> Proportion {
        Proportion::count(self.singles().map(|outcome| !outcome.false_alarms.is_empty()))
    }

    /// Recordings of [`RecordingGroup::Pair`] or [`RecordingGroup::Triple`] whose effects are all named.
    #[must_use]
    pub fn all_named(&self, group: RecordingGroup) -> Proportion {
        Proportion::count(self.outcomes(group).map(|outcome| outcome.answers.iter().all(|answer| answer.named)))
    }

    /// Recordings of all groups whose report has a wrong name.
    #[must_use]
    pub fn wrong_names(&self) -> Proportion {
        Proportion::count(self.outcomes.iter().map(|(_, outcome)| !outcome.false_alarms.is_empty()))
    }

    /// Effects outside the vocabulary with a strength of at least [`STRONG`] that are reported as unexplained or
    /// described.
    #[must_use]
    pub fn outside_told(&self) -> Proportion {
        let strong = self.outcomes.iter().filter_map(|(_, outcome)| outcome.outside.as_ref());
        Proportion::count(strong.filter(|score| score.strength >= STRONG).map(OutsideScore::is_told))
    }

    /// The scores of a kind outside the vocabulary, each with the other findings of its report.
    fn outside(&self, kind: OutsideKind) -> impl Iterator<Item = (&OutsideScore, &[String])> {
        let of = self.outcomes(RecordingGroup::Outside(kind));
        of.filter_map(|outcome| Some((outcome.outside.as_ref()?, outcome.false_alarms.as_slice())))
    }

    /// Accurate parameters of strong single effects: within 2 % for frequencies and rate, 10 % for others.
    #[must_use]
    pub fn near(&self) -> Proportion {
        Proportion::count(self.estimates(None).map(ParameterScore::is_near))
    }

    /// Parameters of named single effects whose 95 % interval contains the truth.
    #[must_use]
    pub fn coverage(&self) -> Proportion {
        Proportion::count(self.singles().flat_map(|outcome| &outcome.estimates).map(ParameterScore::is_covered))
    }

    /// Strong single effects whose errors fulfil `which`.
    #[must_use]
    pub fn unseen(&self, which: fn(&UnseenErrors) -> bool) -> Proportion {
        let strong = self.singles().filter(|outcome| is_strong(outcome));
        Proportion::count(strong.filter_map(|outcome| outcome.unseen).map(|unseen| which(&unseen)))
    }

    /// Parameters of strong single effects, of one kind or of all.
    fn estimates(&self, kind: Option<EffectKind>) -> impl Iterator<Item = &ParameterScore> {
        let strong = self.singles().filter(|outcome| is_strong(outcome));
        strong
            .flat_map(|outcome| &outcome.estimates)
            .filter(move |estimate| kind.is_none_or(|kind| estimate.kind == kind))
    }
}

impl ParameterScore {
    pub(super) fn is_near(&self) -> bool {
        self.relative_error <= if matches!(self.name, "frequency" | "rate_hz") { 0.02 } else { 0.1 }
    }

    pub(super) fn is_covered(&self) -> bool {
        (self.low..=self.high).contains(&self.truth)
    }
}

impl OutsideScore {
    /// True if the channel is reported as unexplained, or the effect is described.
    #[must_use]
    pub fn is_told(&self) -> bool {
        self.unexplained || self.named
    }
}

impl UnseenErrors {
    /// Largest ratio of two errors that count as equally good.
    const TOLERANCE: f64 = 1.5;

    /// True if the added terms are as good as the true model.
    #[must_use]
    pub fn is_near_truth(&self) -> bool {
        self.after <= Self::TOLERANCE * self.truth
    }

    /// True if the added terms are as good as the fitted true terms.
    #[must_use]
    pub fn is_near_true_terms(&self) -> bool {
        self.after <= Self::TOLERANCE * self.refitted
    }

    /// True if the fitted true terms are as good as the true model.
    #[must_use]
    pub fn are_true_terms_near_truth(&self) -> bool {
        self.refitted <= Self::TOLERANCE * self.truth
    }
}

impl ScoreTable {
    /// Writes all tables and the summary as text.
    pub fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        self.write_rates(out)?;
        self.write_confusion(out)?;
        self.write_parameters(out)?;
        self.write_unseen(out)?;
        self.write_outside(out)?;
        self.write_summary(out)
    }

    fn kinds(&self) -> Vec<EffectKind> {
        EffectKind::ALL.into_iter().filter(|kind| self.answers(*kind).next().is_some()).collect()
    }

    fn write_rates(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(
            out,
            "Named, by strength (size over the detection limit); \"waveform given\": detected by a test that is given"
        )?;
        writeln!(out, "channel and waveform of the effect, and has to estimate the noise\n")?;
        write!(out, "{:<18}", "")?;
        for name in CLASS_NAMES {
            write!(out, "{name:>12}")?;
        }
        writeln!(out, "{:>26}", "≥ 2, waveform given")?;
        for kind in self.kinds() {
            write!(out, "{:<18}", kind.name())?;
            let mut from = 0.0;
            for to in CLASSES {
                let within = self.answers(kind).filter(|answer| (from..to).contains(&answer.strength));
                let share = Proportion::count(within.map(|answer| answer.named));
                let cell = if share.all == 0 { "–".to_owned() } else { format!("{}/{}", share.yes, share.all) };
                write!(out, "{cell:>12}")?;
                from = to;
            }
            let strong = self.answers(kind).filter(|answer| answer.strength >= STRONG);
            let share = Proportion::count(strong.filter_map(|answer| answer.shape_known));
            let cell = if share.all == 0 { String::new() } else { format!("{}/{}", share.yes, share.all) };
            writeln!(out, "{cell:>26}")?;
        }
        Ok(())
    }

    fn write_confusion(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(
            out,
            "\nConfusion: strong effects (rows) and the effects that were named in their channels (columns)\n"
        )?;
        let initials = |kind: EffectKind| kind.name().chars().take(5).collect::<String>();
        write!(out, "{:<18}", "")?;
        for kind in EffectKind::ALL {
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
            for column in EffectKind::ALL {
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
            "", "number", "median error", "90 % within", "accurate", "coverage"
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
                    Proportion::count(of().map(ParameterScore::is_near)).to_string(),
                    Proportion::count(of().map(ParameterScore::is_covered)).to_string(),
                )?;
            }
        }
        Ok(())
    }

    fn write_unseen(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "\nDeviance per point on unseen data, medians over strong effects\n")?;
        let heads = ["before", "after", "true terms", "true model"];
        writeln!(out, "{:<18}{:>12}{:>12}{:>14}{:>14}", "", heads[0], heads[1], heads[2], heads[3])?;
        for kind in self.kinds() {
            let strong = self.outcomes(RecordingGroup::Single(kind)).filter(|outcome| is_strong(outcome));
            let unseen: Vec<_> = strong.filter_map(|outcome| outcome.unseen).collect();
            let median = |of: fn(&UnseenErrors) -> f64| {
                quantile(&unseen.iter().map(of).collect::<Vec<_>>(), 0.5)
                    .map_or("–".to_owned(), |v| format!("{v:.2}"))
            };
            writeln!(
                out,
                "{:<18}{:>12}{:>12}{:>14}{:>14}",
                kind.name(),
                median(|unseen| unseen.before),
                median(|unseen| unseen.after),
                median(|unseen| unseen.refitted),
                median(|unseen| unseen.truth),
            )?;
        }
        Ok(())
    }

    fn write_outside(&self, out: &mut dyn Write) -> io::Result<()> {
        if OutsideKind::ALL.into_iter().all(|kind| self.outside(kind).next().is_none()) {
            return Ok(());
        }
        writeln!(out, "\nEffects that the analysis was not made for\n")?;
        let heads = ["number", "unexplained", "right name", "either", "no wrong name"];
        let [number, unexplained, right, either, unnamed] = heads;
        writeln!(out, "{:<18}{number:>8}{unexplained:>14}{right:>12}{either:>8}{unnamed:>15}   wrong names", "")?;
        for kind in OutsideKind::ALL {
            let unexplained = Proportion::count(self.outside(kind).map(|(score, _)| score.unexplained));
            let named = Proportion::count(self.outside(kind).map(|(score, _)| score.named));
            let told = Proportion::count(self.outside(kind).map(|(score, _)| score.is_told()));
            let unnamed = Proportion::count(self.outside(kind).map(|(_, wrong)| wrong.is_empty()));
            let mut names: BTreeMap<&str, usize> = BTreeMap::new();
            for wrong in self.outside(kind).flat_map(|(_, wrong)| wrong) {
                *names.entry(wrong.split_once(": ").map_or(wrong.as_str(), |(_, name)| name)).or_insert(0) += 1;
            }
            let names: Vec<String> = names.into_iter().map(|(name, count)| format!("{name} × {count}")).collect();
            writeln!(
                out,
                "{:<18}{:>8}{:>14}{:>12}{:>8}{:>15}   {}",
                kind.name(),
                unexplained.all,
                unexplained.yes,
                named.yes,
                told.yes,
                unnamed.yes,
                names.join(", ")
            )?;
        }
        Ok(())
    }

    fn write_summary(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out)?;
        let lines = [
            ("named: single effects of twice the limit or more", self.named()),
            ("an effect reported although nothing was hidden", self.false_alarms()),
            ("another effect reported although one was hidden", self.something_else()),
            ("both effects of a pair named", self.all_named(RecordingGroup::Pair)),
            ("all three effects of a triple named", self.all_named(RecordingGroup::Triple)),
            ("wrong names, over all recordings", self.wrong_names()),
            ("effects outside the vocabulary unexplained or rightly named", self.outside_told()),
            ("parameters within 10 % (frequencies 2 %)", self.near()),
            ("95 % intervals that contain the true value", self.coverage()),
            ("error on unseen data within 1.5 times the true model's", self.unseen(UnseenErrors::is_near_truth)),
            ("… within 1.5 times that of the fitted true terms", self.unseen(UnseenErrors::is_near_true_terms)),
            ("fitted true terms within 1.5 times the true model", self.unseen(UnseenErrors::are_true_terms_near_truth)),
        ];
        for (what, share) in lines {
            let percent = share.percent().map_or("–".to_owned(), |percent| format!("{percent:.1} %"));
            writeln!(out, "{what:<60}{percent:>8}   ({} of {})", share.yes, share.all)?;
        }
        let mut alarms: BTreeMap<&str, usize> = BTreeMap::new();
        for alarm in self.outcomes(RecordingGroup::Nothing).flat_map(|outcome| &outcome.false_alarms) {
            *alarms.entry(alarm).or_insert(0) += 1;
        }
        for (alarm, count) in alarms {
            writeln!(out, "  false alarm, nothing hidden: {alarm} × {count}")?;
        }
        Ok(())
    }
}

fn is_strong(score: &RecordingScore) -> bool {
    score.answers.iter().all(|answer| answer.strength >= STRONG)
}

fn cell(count: Option<usize>) -> String {
    count.map_or(".".to_owned(), |count| count.to_string())
}

fn percent(value: Option<f64>) -> String {
    value.map_or("–".to_owned(), |value| format!("{value:.2} %"))
}

/// Smallest value that the fraction `level` does not exceed.
pub(super) fn quantile(values: &[f64], level: f64) -> Option<f64> {
    let mut sorted: Vec<f64> = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let at = (level * sorted.len() as f64).ceil() as usize;
    sorted.get(at.saturating_sub(1)).copied()
}
