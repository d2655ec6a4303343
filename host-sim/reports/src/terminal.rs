//! The report on one screen of at most [`MOST_LINES`] lines, with ANSI styles.

use crate::coefficients::LETTERS;
use crate::finding_text::FindingText;
use crate::line_breaks::broken;
use crate::summary::{self, CoefficientTable};
use anstyle::{AnsiColor, Style};
use noise_analysis::report::Report;
use std::io::{self, Write};

pub const MOST_LINES: usize = 30;
/// Columns of the narrowest and the widest screen; text is at most [`TEXT`] wide.
const NARROWEST: usize = 80;
const WIDEST: usize = 200;
const TEXT: usize = 110;
const LABEL: usize = 7;
const ERROR: usize = 17;
/// Most lines of sentences on the record, and on conditions.
const SENTENCES: usize = 5;
const CONDITIONS: usize = 2;
/// Most lines of advice, with and without room.
const STEPS: [usize; 2] = [4, 2];
/// Columns of a finding's number and channels.
const CHANNELS: usize = 17;

const HEADING: Style = Style::new().bold();
const FAINT: Style = Style::new().dimmed();
const WARNING: Style = AnsiColor::Yellow.on_default().bold();

#[derive(Debug, Clone, Copy)]
pub struct Screen<'a> {
    pub report: &'a Report,
    pub source: Option<&'a str>,
    pub columns: usize,
}

impl Screen<'_> {
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

    /// Lines with styles; blocks below the findings are cut to give each finding a line.
    pub fn lines(&self) -> Vec<String> {
        let mut lines = self.above();
        let (found, _) = summary::findings(self.report);
        lines.push(String::new());
        lines.push(styled(HEADING, "What was found"));
        if found.is_empty() && summary::unexplained(self.report).is_empty() {
            lines.push(format!(" {}", summary::nothing_found(self.report)));
        }
        let [roomy, tight] = STEPS.map(|most| self.below(most));
        let room = |below: &[String]| MOST_LINES.saturating_sub(lines.len() + below.len());
        let below = if found.len() <= room(&roomy) { roomy } else { tight };
        let room = room(&below);
        lines.extend(self.findings(&found, room));
        lines.extend(below);
        lines
    }

    /// Findings in `room` lines: one each, and details from the first on as far as there is room.
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

    /// Number, channels, physics without intervals.
    fn brief_finding(&self, number: usize, finding: &FindingText) -> String {
        let FindingText { channels, channel_count, brief, .. } = finding;
        let label = format!("{number:>2}  {channels}");
        let length = label.chars().count();
        // Out of line if both fit.
        let is_long = length >= CHANNELS && length + 1 + brief.chars().count() > self.columns();
        let label = if is_long { format!("{number:>2}  {channel_count} channels") } else { label };
        format!("{}{}", padded(&label, CHANNELS), within(brief, self.columns() - CHANNELS))
    }

    fn above(&self) -> Vec<String> {
        let report = self.report;
        let mut lines = vec![styled(HEADING, &self.headline())];
        lines.extend(capped(&summary::record_sentences_in_short(report), " ", "", (self.text_columns(), SENTENCES)));
        let tables = summary::coefficient_tables(report);
        if !tables.is_empty() {
            lines.push(String::new());
        }
        for (index, table) in tables.iter().enumerate() {
            let rows = table_lines(table, index == 0, self.columns()).into_iter();
            lines.extend(rows.map(|(style, line)| styled(style, &line)));
        }
        let conditions = summary::conditions(report);
        let shown = capped(&conditions, "; ", "", (self.text_columns() - CHANNELS, CONDITIONS));
        lines.extend(block("Conditions", &shown, FAINT));
        lines
    }

    fn finding(&self, number: usize, finding: &FindingText) -> Vec<String> {
        let text = finding.sentences();
        let label = format!("{number:>2}  {}", finding.channels);
        // A long list has lines of its own.
        let [mut labels, mut texts] =
            [broken(&label, CHANNELS - 1, "    "), broken(&text, self.text_columns() - CHANNELS, "")];
        let lines = labels.len().max(texts.len());
        labels.resize(lines, String::new());
        texts.resize(lines, String::new());
        let line =
            |(label, text): (&String, &String)| format!("{}{text}", padded(label, CHANNELS)).trim_end().to_owned();
        labels.iter().zip(&texts).map(line).collect()
    }

    /// Unexplained and contradictions in a line each, advice in `most`.
    fn below(&self, most: usize) -> Vec<String> {
        let columns = self.text_columns() - CHANNELS;
        let mut lines = Vec::new();
        for (heading, text) in [
            ("Not explained", summary::unexplained_in_short(self.report)),
            ("Model is off", summary::contradictions_in_short(self.report)),
        ] {
            let line = text.map(|text| within(&format!("{text}."), columns));
            lines.extend(block(heading, line.as_slice(), WARNING));
        }
        let export = summary::for_filter(self.report).unwrap_or_default();
        let steps = capped(&summary::numbered_steps(self.report), " ", &export, (columns, most));
        lines.extend(block("What to do", &steps, HEADING));
        lines
    }

    /// Part, recording, samples, length; a long name is cut in front.
    fn headline(&self) -> String {
        let name = self.source.unwrap_or_default();
        let others = summary::headline(self.report, Some("")).join("   ").chars().count();
        let room = self.columns().saturating_sub(others);
        let too_long = name.chars().count().saturating_sub(room);
        let end: String = name.chars().skip(too_long + 1).collect();
        let name = if too_long > 0 { format!("…{end}") } else { name.to_owned() };
        summary::headline(self.report, self.source.map(|_| name.as_str())).join("   ")
    }
}

fn block(heading: &str, texts: &[String], style: Style) -> Vec<String> {
    let labelled = |(index, text): (usize, &String)| {
        let label = if index == 0 { heading } else { "" };
        let space = " ".repeat(CHANNELS.saturating_sub(label.chars().count()));
        if label.is_empty() { format!("{space}{text}") } else { format!("{}{space}{text}", styled(style, label)) }
    };
    texts.iter().enumerate().map(labelled).collect()
}

/// `items` with `separator` and `last`, in so many lines and columns, and the number of the rest.
fn capped(items: &[String], separator: &str, last: &str, (columns, most): (usize, usize)) -> Vec<String> {
    let lines = |shown: usize| {
        let more = items.len() - shown;
        let more = if more > 0 { format!("{more} more: --full") } else { String::new() };
        let told = items[..shown].iter().map(String::as_str).chain([more.as_str()]).filter(|part| !part.is_empty());
        let mut text = told.collect::<Vec<_>>().join(separator);
        if !text.is_empty() && !text.ends_with('.') {
            text.push('.');
        }
        broken(format!("{text} {last}").trim(), columns, "")
    };
    let shown = (1..=items.len()).rev().find(|&shown| lines(shown).len() <= most);
    let mut lines = lines(shown.unwrap_or(items.len().min(1)));
    lines.retain(|line| !line.is_empty());
    lines
}

fn within(text: &str, columns: usize) -> String {
    if text.chars().count() <= columns { text.to_owned() } else { format!("{} …", broken(text, columns - 2, "")[0]) }
}

/// Rows with styles; `is_first` adds the heading of the errors.
pub(crate) fn table_lines(table: &CoefficientTable, is_first: bool, columns: usize) -> Vec<(Style, String)> {
    let width = ((columns - LABEL - ERROR) / 3).min(26);
    let widths = [width + 2, width - 1, width];
    let total = columns.min(LABEL + 3 * width + 1 + ERROR);
    let row = |label: &str, cells: [&str; 3], error: &str| {
        let mut line = padded(&format!(" {label}"), LABEL);
        for (cell, width) in cells.into_iter().zip(widths) {
            line += &padded(cell, width);
        }
        let line = line.trim_end();
        let rest = total.saturating_sub(line.chars().count());
        format!("{line}{error:>rest$}").trim_end().to_owned()
    };
    let headings: [String; 3] = std::array::from_fn(|index| format!("{}, {}", LETTERS[index], table.units[index]));
    let error = if is_first { "σ off by  " } else { "" };
    let mut lines = vec![(HEADING, row(table.title, headings.each_ref().map(String::as_str), error))];
    for of in &table.rows {
        let error = if of.is_high { format!("{} !", of.error) } else { format!("{}  ", of.error) };
        let error = format!(" {error}");
        let mut line = row(&of.label, of.coefficients.each_ref().map(String::as_str), &error);
        if line.chars().count() > total {
            // Raw counts have values alone.
            line = row(&of.label, of.coefficients.each_ref().map(|of| of.split(" (").next().unwrap_or(of)), &error);
        }
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

/// Padded to `width`, at least one space.
fn padded(text: &str, width: usize) -> String {
    let width = width.max(text.chars().count() + usize::from(!text.is_empty()));
    format!("{text:width$}")
}
