//! The noise observatory without hardware: a virtual ADIS16405, recordings, replay, analysis and reports.
//!
//! ```text
//! sensor (virtual part) ─► record ─┐
//! source (files) ─► replay (bus) ──┼─► recording ─► timeline ─► analysis ─► report ─► terminal, page, JSON
//! source (files) ──────────────────┘
//! ```
//!
//! Wherever samples come from, the words are judged by the driver's code and the statistics are those of `allan-core`.

pub mod analysis;
pub mod cli;
pub mod coefficients;
pub mod device;
pub mod explain;
pub mod export;
pub mod grid;
pub mod innovation;
pub mod monitor;
pub mod navigation;
pub mod page;
pub mod paper;
pub mod plot;
pub mod practice;
pub mod record;
pub mod record_length;
pub mod recording;
pub mod replay;
pub mod report;
pub mod sensor;
pub mod source;
pub mod spectrum;
pub mod terminal;
pub mod time_course;
pub mod timeline;
pub mod trace;
pub mod uf2;
pub mod undeclared;
pub mod units;
pub mod wording;
