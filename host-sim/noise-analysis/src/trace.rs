//! Sample loss, repeated samples and the rate of the sample clock.

pub mod deliveries;
pub mod sample_clock;
