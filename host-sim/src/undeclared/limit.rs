//! The smallest effect that any test could see.
//!
//! A likelihood-ratio test that knows the truth sees an effect in half of the recordings when the expected logarithm of
//! the likelihood ratio, of the truth against the best description without the effect, is `z²/2`: exactly so for
//! Gaussian data whose mean is shifted by `z` standard deviations, nearly so for the others. `z` is the point that a
//! standard normal number exceeds with 1 %, divided by the number of places (frequencies, times, directions) where the
//! effect could be: that much nobody can know. "Best description" leaves N, B and K free; a telegraph signal has to
//! be told from a Markov process as well, a common mode from independent ones.
//!
//! | effect | log likelihood ratio |
//! |---|---|
//! | Markov, resonance, quantization, filter | Whittle's, over the Fourier frequencies |
//! | common mode | the same, of the coherent against the separate channels |
//! | telegraph | hidden Markov chain against Kalman filter, on a simulated path |
//! | sinusoid, acceleration | matched filter in the noise at their frequencies |
//! | ramp, step, temperature, supply | regression on block means with the covariance of the noise |
//! | spikes | mixture of normal laws |
//! | lost and repeated samples | Poisson count; sample clock: the host's clock |

mod chain;
pub(super) mod events;
pub(super) mod spectrum;
pub(super) mod waveform;

pub(super) use chain::telegraph_from_markov;

use crate::trace::normal::quantile;

/// Probability of a false alarm at which the limit is set.
const FALSE_ALARM: f64 = 0.01;

/// The log likelihood ratio at which half of the effects are seen that could be at `places`.
pub(super) fn needed(places: f64) -> f64 {
    let z = quantile(FALSE_ALARM / places.max(1.0));
    0.5 * z * z
}

/// The size at which `ratio(size)`, which grows with the size, is `needed`.
pub(super) fn size(needed: f64, ratio: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (1e-9f64, 1e6f64);
    for _ in 0..60 {
        let middle = (low * high).sqrt();
        if ratio(middle) < needed { low = middle } else { high = middle }
    }
    (low * high).sqrt()
}
