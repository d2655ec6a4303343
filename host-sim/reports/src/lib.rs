//! Reports of a noise analysis: terminal, page, figures and exports.

pub mod coefficients;
pub mod explain;
pub mod export;
pub mod page;
pub mod plot;
pub mod terminal;
pub mod wording;
