//! Reports of a noise analysis: the text of the terminal, the HTML page with its figures, exports for other programs.

pub mod coefficient_notes;
mod coefficients;
pub mod comparison;
mod evidence;
mod explanation;
pub mod export;
pub mod figure;
pub mod finding_text;
pub mod formatting;
pub mod full_tables;
pub mod json;
mod line_breaks;
pub mod live;
pub mod page;
mod part_note;
pub mod reading;
mod report_tables;
pub mod rounding;
pub mod rows;
pub mod saved_report;
pub mod several;
pub mod summary;
pub mod terminal;
