//! The report on one screen: at most [`MOST_LINES`] lines. Styles are ANSI sequences, which the writer removes where they are not
//! wanted.

use crate::finding_text::FindingText;
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
        let report = self.report;
        let mut above = self.above();
        let below = self.below();
        let (found, unexplained) = summary::findings(report);
        let mut blocks: Vec<Vec<String>> =
            found.iter().enumerate().map(|(index, finding)| self.finding(index + 1, finding)).collect();
        let mut rest: Vec<String> = unexplained
            .iter()
            .flat_map(|finding| {
                self.block("Not explained", &format!("{}: {}", finding.channels, finding.physics), WARNING)
            })
            .collect();
        if blocks.is_empty() && rest.is_empty() {
            blocks.push(vec![" Nothing: N, B and K describe every channel.".to_owned()]);
        }
        let fixed = above.len() + below.len() + 2;
        rest.truncate(MOST_LINES.saturating_sub(fixed + 2));
        let room = MOST_LINES.saturating_sub(fixed + rest.len());
        above.push(String::new());
        above.push(styled(HEADING, "What was found"));
        let total: usize = blocks.iter().map(Vec::len).sum();
        let mut left = if total > room { room.saturating_sub(1) } else { room };
        let mut shown = 0;
        for block in &blocks {
            if block.len() > left {
                break;
            }
            left -= block.len();
            shown += 1;
            above.extend(block.iter().cloned());
        }
        if shown < blocks.len() {
            above.push(styled(FAINT, &format!(" … and {} more: --full", blocks.len() - shown)));
        }
        above.extend(rest);
        above.extend(below);
        above
    }

    /// Verdict, coefficients and conditions.
    fn above(&self) -> Vec<String> {
        let report = self.report;
        let mut lines =
            vec![styled(HEADING, &shortened(&summary::headline(report, self.source).join("   "), self.columns()))];
        lines.extend(wrapped(&summary::record_sentences(report).join(" "), self.text_columns()));
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
        let width = ((self.columns() - LABEL - ERROR) / 3).min(26);
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
            lines.push(styled(HEADING, &row([table.title, names[0], names[1], names[2], "error on  "])));
        }
        let [n, b, k] = &table.units;
        let units = if is_first { row(["", n, b, k, "unseen half  "]) } else { row([table.title, n, b, k, ""]) };
        lines.push(if is_first { styled(FAINT, &units) } else { styled(HEADING, &units) });
        for of in &table.rows {
            let [n, b, k] = &of.coefficients;
            let error = if of.is_high { format!("{} !", of.error) } else { format!("{}  ", of.error) };
            let line = row([&of.label, n, b, k, &error]);
            lines.push(match (of.is_high, of.channel.is_empty()) {
                (true, _) => styled(WARNING, &line),
                (_, true) => styled(FAINT, &line),
                _ => line,
            });
        }
        lines
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
        let labels = wrapped_to(&label, CHANNELS - 1, "    ");
        let texts = wrapped(&text, self.text_columns() - CHANNELS);
        (0..labels.len().max(texts.len()))
            .map(|line| {
                let label = labels.get(line).map_or("", String::as_str);
                let text = texts.get(line).map_or("", String::as_str);
                format!("{}{text}", padded(label, CHANNELS)).trim_end().to_owned()
            })
            .collect()
    }

    /// What the data contradicts, and what to do.
    fn below(&self) -> Vec<String> {
        let mut lines = Vec::new();
        let contradictions = summary::contradictions(self.report);
        if !contradictions.is_empty() {
            const MOST: usize = 3;
            let mut told = contradictions.iter().take(MOST).cloned().collect::<Vec<_>>().join("; ");
            if contradictions.len() > MOST {
                told += &format!("; {} more: --full", contradictions.len() - MOST);
            }
            lines.extend(self.block("Contradicted", &format!("{told}."), WARNING));
        }
        let steps = summary::next_steps(self.report);
        if !steps.is_empty() {
            lines.push(String::new());
            lines.extend(self.block("What to do", &steps.join(" "), HEADING));
        }
        lines
    }

    /// A heading with text beside it.
    fn block(&self, heading: &str, text: &str, style: Style) -> Vec<String> {
        let texts = wrapped(text, self.text_columns() - CHANNELS);
        let labelled = |(index, text): (usize, String)| {
            let label = if index == 0 { heading } else { "" };
            let space = " ".repeat(CHANNELS.saturating_sub(label.chars().count()));
            let label = if label.is_empty() { String::new() } else { styled(style, label) };
            format!("{label}{space}{text}")
        };
        texts.into_iter().enumerate().map(labelled).collect()
    }
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
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

fn wrapped(text: &str, width: usize) -> Vec<String> {
    wrapped_to(text, width, "")
}

/// `text` broken between words into lines of at most `width` columns; all but the first begin with `indent`. A longer word
/// is broken.
fn wrapped_to(text: &str, width: usize, indent: &str) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    let mut line = String::new();
    // Leading spaces of the text are kept.
    let lead: String = text.chars().take_while(|letter| *letter == ' ').collect();
    line.push_str(&lead);
    let mut is_empty = true;
    // Two spaces between the number and the channels of a finding are kept too.
    for word in text.trim_start().split(' ') {
        let length = line.chars().count() + usize::from(!is_empty) + word.chars().count();
        if !is_empty && length > width {
            lines.push(line.trim_end().to_owned());
            line = indent.to_owned();
            is_empty = true;
        }
        if !is_empty {
            line.push(' ');
        }
        line.push_str(word);
        is_empty = false;
        while line.chars().count() > width {
            let head: String = line.chars().take(width).collect();
            let tail: String = line.chars().skip(width).collect();
            lines.push(head);
            line = format!("{indent}{tail}");
        }
    }
    lines.push(line.trim_end().to_owned());
    lines
}
