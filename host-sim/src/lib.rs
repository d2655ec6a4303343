//! Parts of the command `host-sim` that tests of the whole system use as well.

pub mod bench;
pub mod monitor;
