//! Effects that happen now and then, and the clock.

use noise_analysis::trace::sample_clock::HOST_CLOCK;
use std::f64::consts::LN_2;

/// Expected log likelihood ratio of `samples` samples of which the part `probability` is off by `size` standard
/// deviations of the noise, up or down.
pub(crate) fn spikes(samples: f64, probability: f64, size: f64) -> f64 {
    // Over the noise of a sample that is struck and of one that is not; ±8 σ in steps of 0.05 σ.
    let step = 0.05;
    // Beyond, nothing changes but that exponentials overflow.
    let size = size.min(37.0);
    let gain = |value: f64| {
        let raised = 0.5 * ((size * value - 0.5 * size * size).exp() + (-size * value - 0.5 * size * size).exp());
        (probability * (raised - 1.0)).ln_1p()
    };
    let mean = |centre: f64| {
        let density = |deviation: f64| (-0.5 * deviation * deviation).exp() / (2.0 * std::f64::consts::PI).sqrt();
        let at = |k: i32| f64::from(k) * step;
        (-160..=160).map(|k| step * density(at(k)) * gain(centre + at(k))).sum::<f64>()
    };
    samples * ((1.0 - probability) * mean(0.0) + probability * mean(size))
}

/// Events that are seen in half of the recordings where `by_chance` of them, at a mean, happen anyway: the mean number at
/// which a count is as often above as below the largest that chance gives in 99 of 100 recordings.
pub(crate) fn count(by_chance: f64) -> f64 {
    let mut fewest = 1u64;
    while noise_analysis::distributions::poisson_tail(fewest, by_chance) > super::FALSE_ALARM {
        fewest += 1;
    }
    // The median of a Poisson number is nearly its mean less a third; exactly ln 2 for the first event.
    if fewest == 1 { LN_2 } else { fewest as f64 - 1.0 / 3.0 - by_chance }
}

/// Expected log likelihood ratio of a clock that is off by the fraction `off`, as a host's clock tells.
pub(crate) fn clock(off: f64) -> f64 {
    0.5 * (off / HOST_CLOCK).powi(2)
}
