//! An explanation that is proposed for a channel, where it comes from, and what decides between proposals beside them.

use crate::effects::Effect;
use crate::spectra::decaying_disturbances::DecayingDisturbances;
use crate::spectra::frequency_track::FrequencyTrack;
use crate::spectra::periodic_signal::PeriodicSignal;
use allan_core::NoiseTerm;

#[derive(Debug, Clone)]
pub(crate) struct Proposal {
    pub effect: Effect,
    pub origin: Origin,
}

#[derive(Debug, Clone)]
pub(crate) enum Origin {
    /// The samples: repeated ones, knocks, spikes, steps, ramps, responses.
    Samples,
    /// The means of a second, which leave their median.
    Motion {
        /// True if another channel of the same quantity leaves it in the same seconds.
        is_shared: bool,
        /// True if they change faster than a Gaussian process would.
        is_sudden: bool,
    },
    Covariate {
        /// True if the sensitivity is within what is known of the sensor.
        is_plausible: bool,
    },
    /// A term that was added to the model of the curve. Several effects of one term exclude each other.
    Term {
        /// Number of the term.
        number: usize,
        kind: NoiseTerm,
    },
    /// Two levels in the samples.
    Levels {
        /// True if the samples change upwards as they change downwards.
        is_reversible: bool,
    },
    CrossSpectra,
    Line {
        /// True if it has a few periods in the record.
        is_slow: bool,
    },
    /// The rest of the curve without the model.
    Residual,
    Signal(Signal),
    /// The level of the noise in blocks.
    Level,
}

/// A signal in the samples of a channel: no term of the noise model has it, but for the variance of the last one.
#[derive(Debug, Clone)]
pub(crate) enum Signal {
    /// A slow periodic one that is no sinusoid.
    Periodic(PeriodicSignal),
    Chirp(FrequencyTrack),
    Decays(DecayingDisturbances),
}

impl Signal {
    pub(crate) const fn decays(&self) -> Option<&DecayingDisturbances> {
        if let Self::Decays(of) = self { Some(of) } else { None }
    }
}

impl Proposal {
    pub(crate) fn new(effect: impl Into<Effect>, origin: Origin) -> Self {
        Self { effect: effect.into(), origin }
    }

    /// Number of the term of the curve that it explains.
    pub(crate) const fn term(&self) -> Option<usize> {
        match self.origin {
            Origin::Term { number, .. } => Some(number),
            _ => None,
        }
    }
}

/// The properties of a channel that decide between its proposals.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ChannelFacts {
    /// Smallest distance of two values, in the channel's unit.
    pub resolution: f64,
    pub period_s: f64,
    pub duration_s: f64,
    /// Allan variance of neighbouring samples.
    pub avar: f64,
    /// True if the noise is large enough against the resolution, at short averaging times, that rounding adds white noise alone.
    pub is_dithered: bool,
    /// True if it is at the shortest averaging time.
    pub is_dithered_at_once: bool,
    /// Change from the first tenth of the samples to the last over the time between them, in the channel's unit per s; `None` where the
    /// samples are not kept.
    pub slope_of_ends: Option<f64>,
}
