//! Reports of a noise analysis: the text of the terminal, the HTML page with its figures, exports for other programs,
//! and the text that explains a recording.

pub mod coefficients;
pub mod explanation;
pub mod export;
pub mod figure;
pub mod formatting;
pub mod page;
pub mod terminal;
