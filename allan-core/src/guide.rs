//! The book: what the Allan variance is for, and how to record, choose parameters and share an estimator with an
//! interrupt.
#![doc = include_str!("../guide/allan_variance.md")]
#![doc = include_str!("../guide/allan_deviation.svg")]
#![doc = include_str!("../guide/terms.md")]

#[doc = include_str!("../guide/recording.md")]
pub mod recording {}

#[doc = include_str!("../guide/parameters.md")]
pub mod parameters {}

#[doc = include_str!("../guide/interrupts.md")]
pub mod interrupts {}

#[doc = include_str!("../guide/costs.md")]
pub mod costs {}

#[doc = include_str!("../guide/limits.md")]
pub mod limits {}
