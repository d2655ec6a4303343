//! Answers of several lines, made and sent one line at a time.

use link::TextLine;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(all(target_os = "none", feature = "microcontroller"), derive(defmt::Format))]
pub(crate) enum Answer {
    Help,
    Table,
    Counters,
    Status,
    Registers,
    Measurement,
    Deflections,
}

pub(crate) enum AnswerLine {
    Text(TextLine),
    Skip,
    End,
}

impl From<Option<TextLine>> for AnswerLine {
    fn from(line: Option<TextLine>) -> Self {
        line.map_or(Self::Skip, Self::Text)
    }
}
