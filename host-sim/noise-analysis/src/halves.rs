//! Parts of a recording: how one is fitted, the whole, and the first half with its errors on the second.

pub(crate) mod first_half;
pub(crate) mod preprocessed_record;
pub(crate) mod traced_part;
