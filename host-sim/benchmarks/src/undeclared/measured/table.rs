//! The scores of all effects in measured noise, and tables of them.

use super::hidden_kind::HiddenKind;
use super::score::{MeasuredErrors, MeasuredScore};
use crate::undeclared::score::ParameterScore;
use crate::undeclared::table::{Proportion, quantile};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, Write};

/// The scores, in the order of the stretches.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct MeasuredNoiseTable {
    pub not_hidden: Vec<HiddenKind>,
    pub scores: Vec<MeasuredScore>,
}

impl MeasuredNoiseTable {
    /// Named effects, of those for which the report has a name.
    #[must_use]
    pub fn named(&self) -> Proportion {
        let known = self.scores.iter().filter(|score| matches!(score.kind, HiddenKind::Known(_)));
        Proportion::count(known.map(|score| score.named))
    }

    /// Effects outside the vocabulary that are reported as unexplained or by a name that describes them.
    #[must_use]
    pub fn outside_told(&self) -> Proportion {
        let outside = self.scores.iter().filter(|score| matches!(score.kind, HiddenKind::Outside(_)));
        Proportion::count(outside.map(|score| score.named))
    }

    /// Stretches with an effect whose report has a wrong name.
    #[must_use]
    pub fn wrong_names(&self) -> Proportion {
        Proportion::count(self.scores.iter().map(|score| !score.wrong_names.is_empty()))
    }

    /// Effects whose report increases the error on the unseen half.
    #[must_use]
    pub fn grew(&self) -> Proportion {
        Proportion::count(self.scores.iter().map(|score| score.errors.grew()))
    }

    /// Writes the table and its summary as text.
    pub fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        let heads = ["named", "wrong", "grew", "near", "held", "before", "after", "untouched"];
        writeln!(out, "Effects in measured noise; deviance per point on the unseen half: medians\n")?;
        write!(out, "{:<18}", "")?;
        heads.iter().try_for_each(|head| write!(out, "{head:>11}"))?;
        writeln!(out)?;
        for kind in HiddenKind::ALL {
            self.write_row(out, kind.name(), &|score| score.kind == kind)?;
        }
        writeln!(out)?;
        let recordings: BTreeSet<&str> = self.scores.iter().map(|score| score.recording.as_str()).collect();
        for recording in recordings {
            self.write_row(out, recording, &|score| score.recording == recording)?;
        }
        writeln!(out)?;
        let lines = [
            ("named: effects that the report has a name for", self.named()),
            ("unexplained or rightly named: the others", self.outside_told()),
            ("a wrong name beyond those of the untouched stretch", self.wrong_names()),
            ("error on the unseen half above both 3 and N, B and K", self.grew()),
        ];
        for (what, share) in lines {
            let percent = share.percent().map_or("–".to_owned(), |percent| format!("{percent:.1} %"));
            writeln!(out, "{what:<56}{percent:>8}   ({} of {})", share.yes, share.all)?;
        }
        let mut missing: BTreeMap<&str, usize> = BTreeMap::new();
        self.not_hidden.iter().for_each(|kind| *missing.entry(kind.name()).or_insert(0) += 1);
        for (kind, stretches) in missing {
            writeln!(
                out,
                "  not hidden, as no channel can have it at this strength: {kind}, in {stretches} stretches"
            )?;
        }
        self.write_rest(out, "wrong", |score| (!score.wrong_names.is_empty()).then_some(&score.wrong_names))?;
        self.write_rest(out, "missed", |score| (!score.named).then_some(&score.found))
    }

    fn write_row(&self, out: &mut dyn Write, name: &str, is_of_row: &dyn Fn(&MeasuredScore) -> bool) -> io::Result<()> {
        let of = || self.scores.iter().filter(|score| is_of_row(score));
        if of().next().is_none() {
            return Ok(());
        }
        let share = |which: &dyn Fn(&MeasuredScore) -> bool| cell(Proportion::count(of().map(which)));
        let parameters = |which: fn(&ParameterScore) -> bool| {
            cell(Proportion::count(of().flat_map(|score| &score.estimates).map(which)))
        };
        let median = |which: fn(&MeasuredErrors) -> Option<f64>| {
            let values: Vec<f64> = of().filter_map(|score| which(&score.errors)).collect();
            quantile(&values, 0.5).map_or("–".to_owned(), |value| format!("{value:.2}"))
        };
        let cells = [
            share(&|score| score.named),
            share(&|score| !score.wrong_names.is_empty()),
            share(&|score| score.errors.grew()),
            parameters(ParameterScore::is_near),
            parameters(ParameterScore::is_covered),
            median(|errors| errors.before),
            median(|errors| errors.after),
            median(|errors| errors.untouched_after),
        ];
        write!(out, "{name:<18}")?;
        cells.iter().try_for_each(|cell| write!(out, "{cell:>11}"))?;
        writeln!(out)
    }

    /// Writes one line per effect with names of the sort `what`.
    fn write_rest(
        &self,
        out: &mut dyn Write,
        what: &str,
        names: impl Fn(&MeasuredScore) -> Option<&Vec<String>>,
    ) -> io::Result<()> {
        for (score, names) in self.scores.iter().filter_map(|score| Some((score, names(score)?))) {
            let MeasuredScore { recording, from_s, strength, .. } = score;
            let (kind, channels) = (score.kind.name(), score.channels.join(", "));
            let names = if names.is_empty() { "nothing".to_owned() } else { names.join(", ") };
            writeln!(
                out,
                "  {what}: {kind} of strength {strength:.1} in {channels} of {recording} from {from_s:.0} s: {names}"
            )?;
        }
        Ok(())
    }
}

fn cell(share: Proportion) -> String {
    if share.all == 0 { "–".to_owned() } else { format!("{}/{}", share.yes, share.all) }
}
