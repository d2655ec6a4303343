//! The report on one screen: at most [`MOST_LINES`] lines. Styles are ANSI sequences, which the writer removes where they are not
//! wanted.

use crate::finding_text::FindingText;
use crate::formatting::capital;
use crate::line_breaks::broken;
use crate::summary::{self, CoefficientTable};
use anstyle::{AnsiColor, Style};
use noise_analysis::report::Report;
use std::io::{self, Write};

/// Lines of the screen at most.
pub const MOST_LINES: usize = 40;
/// Columns of the narrowest and of the widest screen. Text is not wider than [`TEXT`].
const NARROWEST: usize = 80;
const WIDEST: usize = 200;
/// Columns of a line of text that is read with ease.
const TEXT: usize = 110;
/// Columns of the channel's label, and of the error.
const LABEL: usize = 7;
const ERROR: usize = 15;
/// Contradictions that are told where there is room.
const MOST_CONTRADICTED: usize = 3;
/// Columns of the channels of a finding, with its number.
const CHANNELS: usize = 17;

const HEADING: Style = Style::new().bold();
const FAINT: Style = Style::new().dimmed();
const WARNING: Style = AnsiColor::Yellow.on_default().bold();

/// The screen of a report.
#[derive(Debug, Clone, Copy)]
pub struct Screen<'a> {
    /// The report.
    pub report: &'a Report,
    /// Name of the recording, if it has one.
    pub source: Option<&'a str>,
    /// Columns of the terminal.
    pub columns: usize,
}

impl Screen<'_> {
    /// Writes the screen.
    ///
    /// # Errors
    /// `out` cannot be written.
    pub fn write(&self, out: &mut impl Write) -> io::Result<()> {
        for line in self.lines() {
            writeln!(out, "{line}")?;
        }
        Ok(())
    }

    fn columns(&self) -> usize {
        self.columns.clamp(NARROWEST, WIDEST)
    }

    fn text_columns(&self) -> usize {
        self.columns().min(TEXT)
    }

    /// The lines, with styles.
    #[must_use]
    pub fn lines(&self) -> Vec<String> {
        let mut lines = self.above();
        let (found, _) = summary::findings(self.report);
        let rest = summary::unexplained(self.report)
            .map_or_else(Vec::new, |text| self.block("Not explained", &format!("{text}."), WARNING));
        lines.push(String::new());
        lines.push(styled(HEADING, "What was found"));
        if found.is_empty() && rest.is_empty() {
            lines.push(format!(" {}", summary::nothing_found(self.report)));
        }
        // Of what is contradicted, fewer lines where the findings need the room.
        let room = |contradicted: usize| {
            let below = self.below(contradicted);
            let room = MOST_LINES.saturating_sub(lines.len() + rest.len() + below.len());
            (below, room)
        };
        let (mut below, mut left) = room(MOST_CONTRADICTED);
        if left < found.len() {
            (below, left) = room(1);
        }
        lines.extend(self.findings(&found, left));
        lines.extend(rest);
        lines.extend(below);
        lines.truncate(MOST_LINES);
        lines
    }

    /// The findings in at most `room` lines: each in one, and with intervals and weight, from the first on, as far as there is
    /// room for that.
    fn findings(&self, found: &[FindingText], room: usize) -> Vec<String> {
        let shown = if found.len() > room { room.saturating_sub(1) } else { found.len() };
        let mut left = room.saturating_sub(found.len());
        let mut lines = Vec::new();
        for (index, finding) in found.iter().take(shown).enumerate() {
            let block = self.finding(index + 1, finding);
            if block.len() <= left + 1 {
                left -= block.len() - 1;
                lines.extend(block);
            } else {
                lines.push(self.brief_finding(index + 1, finding));
            }
        }
        if shown < found.len() && room > 0 {
            lines.push(styled(FAINT, &format!(" … and {} more: --full", found.len() - shown)));
        }
        lines
    }

    /// One finding in one line: number, channels, physics without intervals.
    fn brief_finding(&self, number: usize, finding: &FindingText) -> String {
        let label = shortened(&format!("{number:>2}  {}", finding.channels), CHANNELS - 1);
        format!("{}{}", padded(&label, CHANNELS), shortened(&finding.brief, self.columns() - CHANNELS))
    }

    /// Verdict, coefficients and conditions.
    fn above(&self) -> Vec<String> {
        let report = self.report;
        let mut lines =
            vec![styled(HEADING, &shortened(&summary::headline(report, self.source).join("   "), self.columns()))];
        lines.extend(broken(&summary::record_sentences_in_short(report).join(" "), self.text_columns(), ""));
        let tables = summary::coefficient_tables(report);
        if !tables.is_empty() {
            lines.push(String::new());
        }
        for (index, table) in tables.iter().enumerate() {
            lines.extend(self.table(table, index == 0));
        }
        let conditions = summary::conditions(report);
        if !conditions.is_empty() {
            lines.extend(self.block("Conditions", &format!("{}.", conditions.join("; ")), FAINT));
        }
        lines
    }

    fn table(&self, table: &CoefficientTable, is_first: bool) -> Vec<String> {
        table_lines(table, is_first, self.columns()).into_iter().map(|(style, line)| styled(style, &line)).collect()
    }

    /// One finding: number, channels, physics and weight.
    fn finding(&self, number: usize, finding: &FindingText) -> Vec<String> {
        let text = if finding.weight.is_empty() {
            finding.physics.clone()
        } else {
            format!("{} {}.", finding.physics, capital(&finding.weight))
        };
        let label = format!("{number:>2}  {}", finding.channels);
        // A long list of channels has lines of its own beside the text.
        let labels = broken(&label, CHANNELS - 1, "    ");
        let texts = broken(&text, self.text_columns() - CHANNELS, "");
        (0..labels.len().max(texts.len()))
            .map(|line| {
                let label = labels.get(line).map_or("", String::as_str);
                let text = texts.get(line).map_or("", String::as_str);
                format!("{}{text}", padded(label, CHANNELS)).trim_end().to_owned()
            })
            .collect()
    }

    /// What the data contradicts, `most` of it, and what to do.
    fn below(&self, most: usize) -> Vec<String> {
        let mut lines = Vec::new();
        let contradictions = summary::contradictions(self.report);
        if !contradictions.is_empty() {
            let mut told = contradictions.iter().take(most).cloned().collect::<Vec<_>>().join("; ");
            if contradictions.len() > most {
                told += &format!("; {} more: --full", contradictions.len() - most);
            }
            lines.extend(self.block("Contradicted", &format!("{told}."), WARNING));
        }
        // A warning has a line of its own.
        let (warnings, steps): (Vec<String>, Vec<String>) =
            summary::next_steps(self.report).into_iter().partition(|step| step.starts_with('!'));
        let paragraphs = [steps.join(" ")].into_iter().filter(|steps| !steps.is_empty()).chain(warnings);
        for (index, paragraph) in paragraphs.enumerate() {
            if index == 0 {
                lines.push(String::new());
            }
            lines.extend(self.block(if index == 0 { "What to do" } else { "" }, &paragraph, HEADING));
        }
        lines
    }

    /// A heading with text beside it.
    fn block(&self, heading: &str, text: &str, style: Style) -> Vec<String> {
        let texts = broken(text, self.text_columns() - CHANNELS, "");
        let labelled = |(index, text): (usize, String)| {
            let label = if index == 0 { heading } else { "" };
            let space = " ".repeat(CHANNELS.saturating_sub(label.chars().count()));
            let label = if label.is_empty() { String::new() } else { styled(style, label) };
            format!("{label}{space}{text}")
        };
        texts.into_iter().enumerate().map(labelled).collect()
    }
}

/// The rows of a table in `columns` columns, each with its style; `is_first` has the names of the coefficients above it.
pub(crate) fn table_lines(table: &CoefficientTable, is_first: bool, columns: usize) -> Vec<(Style, String)> {
    let width = ((columns - LABEL - ERROR) / 3).min(26);
    let row = |cells: [&str; 5]| {
        let [label, n, b, k, error] = cells;
        let line = format!(
            "{}{}{}{}{}",
            padded(&format!(" {label}"), LABEL),
            padded(n, width),
            padded(b, width),
            padded(k, width),
            left_padded(error, ERROR)
        );
        line.trim_end().to_owned()
    };
    let mut lines = Vec::new();
    if is_first {
        let names = ["angle random walk", "bias instability", "rate random walk"];
        lines.push((HEADING, row([table.title, names[0], names[1], names[2], "error on  "])));
    }
    let [n, b, k] = &table.units;
    let units = if is_first { row(["", n, b, k, "unseen half  "]) } else { row([table.title, n, b, k, ""]) };
    lines.push(if is_first { (FAINT, units) } else { (HEADING, units) });
    for of in &table.rows {
        let [n, b, k] = &of.coefficients;
        let error = if of.is_high { format!("{} !", of.error) } else { format!("{}  ", of.error) };
        let line = row([&of.label, n, b, k, &error]);
        lines.push(match (of.is_high, of.channel.is_empty()) {
            (true, _) => (WARNING, line),
            (_, true) => (FAINT, line),
            _ => (Style::new(), line),
        });
    }
    lines
}

fn styled(style: Style, text: &str) -> String {
    format!("{style}{text}{style:#}")
}

/// `text` with spaces after it up to `width` columns, at least one.
fn padded(text: &str, width: usize) -> String {
    let space = width.saturating_sub(text.chars().count()).max(usize::from(!text.is_empty()));
    format!("{text}{}", " ".repeat(space))
}

fn left_padded(text: &str, width: usize) -> String {
    format!("{}{text}", " ".repeat(width.saturating_sub(text.chars().count())))
}

/// `text` cut off behind `width` columns.
fn shortened(text: &str, width: usize) -> String {
    if text.chars().count() <= width {
        return text.to_owned();
    }
    text.chars().take(width.saturating_sub(1)).chain(['…']).collect()
}
