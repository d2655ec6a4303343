//! A low-pass filter of the second order in place of moving averages: the analog one of a part, or the digital one of a flight controller
//! whose own rate is high against that of the samples.

use super::channel_deviance::ChannelDeviance;
use super::hypothesis::{BOUNDED, chi_squared_quantile};
use crate::bounds::BoundedEstimate;
use crate::minimum::{least_within, risen};
use allan_core::NoiseTerm;
use allan_core::term::{LowPass, MovingAverageFilter};

/// A design with its frequency, Hz.
type Design = fn(f64) -> LowPass;

/// The designs that are in use.
const DESIGNS: [Design; 2] = [LowPass::butterworth, LowPass::two_stages];
/// Lowest and highest frequency that is tried, in sample rates: as long as the longest moving averages, and so high that neighbouring
/// samples behind two stages correlate by a seventieth, `exp(−2π)·(1 + 2π)`.
const FREQUENCIES: (f64, f64) = (1.0 / 128.0, 1.0);
/// Factor between two frequencies that are tried: the deviance has one minimum within two of them.
const STEP: f64 = std::f64::consts::SQRT_2;
/// Accuracy of the likeliest frequency, as a part of it.
const ACCURACY: f64 = 1e-4;

/// The low-pass filter with which the deviances of the channels, with what their other terms cost, are less than with the `averages` by
/// more than `required`; and the bounds of its frequency, Hz.
pub(super) fn in_place_of(
    averages: MovingAverageFilter,
    channels: &mut [ChannelDeviance],
    required: f64,
) -> Option<(LowPass, BoundedEstimate)> {
    let rate_hz = 1.0 / channels.first()?.sample_period();
    let found = DESIGNS.map(|design| likeliest(design, channels, rate_hz));
    let (_, design, at) = found.into_iter().min_by(|(a, ..), (b, ..)| a.total_cmp(b))?;
    let (mut fall, mut dispersions) = (0.0, Vec::new());
    for channel in &mut *channels {
        let with_averages = channel.cost_behind(NoiseTerm::Filtered(averages));
        let own = channel.cost_behind(NoiseTerm::LowPass(design(at)));
        // What neither of them describes scatters both deviances.
        let dispersion = channel.dispersion_by(own.deviance.min(with_averages.deviance));
        fall += (with_averages.total() - own.total()) / dispersion;
        dispersions.push(dispersion);
    }
    if fall <= required {
        return None;
    }
    let mut sum = |log: f64| {
        let behind = NoiseTerm::LowPass(design(log.exp()));
        let of = |(of, dispersion): (&mut ChannelDeviance, &f64)| of.cost_behind(behind).total() / dispersion;
        channels.iter_mut().zip(&dispersions).map(of).sum::<f64>()
    };
    let mut bound = |outside: f64| risen((at.ln(), outside.ln()), chi_squared_quantile(BOUNDED, 1.0), &mut sum).exp();
    let (low, high) = (bound(at / STEP), bound(at * STEP));
    Some((design(at), BoundedEstimate { value: at, low, high }))
}

/// The least sum of the costs behind a design, with its frequency.
fn likeliest(design: Design, channels: &mut [ChannelDeviance], rate_hz: f64) -> (f64, Design, f64) {
    let mut sum = |log: f64| {
        let behind = NoiseTerm::LowPass(design(log.exp()));
        channels.iter_mut().map(|of| of.cost_behind(behind).total() / of.dispersion).sum::<f64>()
    };
    let (from, to) = (FREQUENCIES.0 * rate_hz, FREQUENCIES.1 * rate_hz);
    let tried = std::iter::successors(Some(from.ln()), |log| Some(log + STEP.ln())).take_while(|log| *log <= to.ln());
    let tried = tried.map(|log| (sum(log), log)).reduce(|best, next| if next.0 < best.0 { next } else { best });
    let start = tried.map_or(from.ln(), |(_, log)| log);
    let at = least_within((start - STEP.ln(), start + STEP.ln()), ACCURACY, &mut sum);
    (sum(at), design, at.exp())
}
