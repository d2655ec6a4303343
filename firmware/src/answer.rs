//! Answers of several lines to a person at a terminal, which are made and sent one line at a time.

use link::TextLine;

/// An answer of several lines.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(all(target_os = "none", feature = "microcontroller"), derive(defmt::Format))]
pub(crate) enum Answer {
    Help,
    /// The report as a table.
    Table,
    Counters,
    Status,
    /// All registers of the sensor.
    Registers,
    /// The times of the bus and of data ready.
    Measurement,
    /// The self-test with its deflections.
    Deflections,
}

/// Line of an answer at some index.
pub(crate) enum AnswerLine {
    Text(TextLine),
    /// No line at this index, but there may be one at a later index.
    Skip,
    End,
}

impl From<Option<TextLine>> for AnswerLine {
    fn from(line: Option<TextLine>) -> Self {
        line.map_or(Self::Skip, Self::Text)
    }
}
