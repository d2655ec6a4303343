//! The command `imunoise`, and its analysis of one recording as a function of other programs.

mod analyze;
mod batch;
pub mod bench;
mod cli;
pub mod command;
mod compare;
mod convert;
mod export;
mod input_file;
mod inspect;
mod interrupt;
mod live;
pub mod monitor;
mod output;
mod output_files;
mod output_format;
mod progress;
mod record;
pub mod recording_analysis;
mod recording_file;
mod several_recordings;
mod simulate;
mod tip;
