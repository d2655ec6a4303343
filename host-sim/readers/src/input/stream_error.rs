//! Reasons against streaming.

use crate::input::input_error::InputError;
use time_base::TimeBaseError;

/// Why a recording cannot be read in blocks.
#[derive(Debug, thiserror::Error)]
pub enum StreamError {
    /// The file is damaged, or its columns cannot be chosen.
    #[error(transparent)]
    Input(#[from] InputError),
    #[error(transparent)]
    TimeBase(#[from] TimeBaseError),
}
