//! The numbers, written for a person.

use super::{CLASS_NAMES, CLASSES, Group, STRONG, Share, Table, Unseen, is_strong};
use crate::undeclared::examine::Estimate;
use crate::undeclared::kind::Kind;
use std::collections::BTreeMap;
use std::io::{self, Write};

impl Table {
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
        writeln!(
            out,
            "Named, by strength over the smallest effect that any test could see; \"course told\": seen by a test"
        )?;
        writeln!(out, "that is told channel and course of the effect, and has to estimate the noise as well\n")?;
        write!(out, "{:<18}", "")?;
        for name in CLASS_NAMES {
            write!(out, "{name:>12}")?;
        }
        writeln!(out, "{:>26}", "≥ 2, course told")?;
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
            // Its course and channel told, and the noise not.
            let strong = self.answers(kind).filter(|answer| answer.strength >= STRONG);
            let share = Share::of(strong.filter_map(|answer| answer.shape_known));
            let cell = if share.all == 0 { String::new() } else { format!("{}/{}", share.yes, share.all) };
            writeln!(out, "{cell:>26}")?;
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
        let heads = ["before", "after", "true terms", "true model"];
        writeln!(out, "{:<18}{:>12}{:>12}{:>14}{:>14}", "", heads[0], heads[1], heads[2], heads[3])?;
        for kind in self.kinds() {
            let strong = self.outcomes(Group::Single(kind)).filter(|outcome| is_strong(outcome));
            let unseen: Vec<_> = strong.filter_map(|outcome| outcome.unseen).collect();
            let median = |of: fn(&Unseen) -> f64| {
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

    fn write_summary(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out)?;
        let lines = [
            ("named, single effects of twice the limit or more", self.named()),
            ("nothing hidden, yet something reported", self.false_alarms()),
            ("one effect hidden, and something else reported too", self.something_else()),
            ("both effects of a pair named", self.both()),
            ("parameters within 10 % (frequencies 2 %)", self.near()),
            ("95 % intervals that hold the truth", self.coverage()),
            ("unseen error within 1.5 times the true model's", self.unseen(Unseen::is_near_truth)),
            ("… that of the true terms, fitted as the model is", self.unseen(Unseen::is_near_true_terms)),
            ("… and how often those are within it of the true model", self.unseen(Unseen::are_true_terms_near_truth)),
        ];
        for (what, share) in lines {
            let percent = share.percent().map_or("–".to_owned(), |percent| format!("{percent:.1} %"));
            writeln!(out, "{what:<56}{percent:>8}   ({} of {})", share.yes, share.all)?;
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
