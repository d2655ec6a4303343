//! The other view of the noise: how its power is spread over frequency.
//!
//! All densities are one-sided: their integral over 0 … fs/2 is the variance. White noise N has the density `2N²`,
//! flicker noise B `B²/(πf)`, a random walk K `K²/(2π²f²)`.
//!
//! ```text
//! Grid ─► Periodogram ─► Background ─► lines   (line: sinusoids and resonances, the whole record at once)
//!        ├► sine tapers ─► shared                   (what two channels have in common at low frequencies)
//!        └► Welch ─► Shape ─► N, B, K            (independent of the Allan variance)
//! ```

pub mod autocorrelation;
mod background;
pub mod line;
mod lorentz;
mod mixture;
mod periodogram;
pub mod shape;
pub mod shared;
mod sine;
mod tapered;
pub mod welch;

pub use autocorrelation::{CorrelationTime, correlation_time};
pub use line::{Line, lines, lines_over};
pub use welch::Welch;
