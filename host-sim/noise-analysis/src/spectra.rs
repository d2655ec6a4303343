//! Spectral analysis of one channel or of several.
//!
//! All densities are one-sided, in unit²/Hz: twice those of IEEE Std 952. White noise N has `2N²`, flicker noise B
//! `B²/(πf)`, a random walk K `K²/(2π²f²)`.
//!
//! ```text
//! UniformSeries ─► Periodogram ─► Background ─► lines    sinusoids and resonances, from the whole record at once
//!               ├► stacked_spectrum ─► lines          the same, of a record that is read stretch by stretch
//!               ├► alternation                           an offset of every second sample
//!               ├► epoch_spectra                         the same of each epoch, to follow lines over time
//!               ├► sine tapers ─► common_mode            drift that several channels share
//!               ├► periodic_signal ─► harmonics          a slow signal that repeats and is no sinusoid
//!               ├► frequency_track                       a line whose frequency runs
//!               ├► decaying_disturbances                 shot noise: disturbances that begin at once and decay
//!               ├► force_regression                      what of a rate follows the specific force
//!               ├► cosine_spectrum                       a Markov process that the curve does not tell from a walk
//!               ├► SampleSpectrum ─► sample_likelihood   the coefficients of a model by all samples
//!               └► Welch ─► equation_5                   the Allan deviation, by equation (5) of the paper
//!                        └► SpectralShape                a smooth curve through the spectrum
//! ```

mod alternation;
mod coherent_track;
pub(crate) mod common_mode;
pub(crate) mod cosine_spectrum;
pub(crate) mod decaying_disturbances;
pub(crate) mod epoch_spectra;
mod equation_5;
mod filtered_noise;
pub(crate) mod force_regression;
mod found_sine;
mod found_sines;
pub(crate) mod frequency_track;
mod harmonics;
mod line_envelope;
mod line_models;
mod lines;
mod markov_spectrum;

pub(crate) mod periodic_signal;
mod periodogram;
mod sample_likelihood;
mod sample_spectrum;
mod slow_background;
mod smooth_shape;
mod spectral_line;
pub(crate) mod spectral_lines;
pub(crate) mod stacked_spectrum;
mod transforms;
mod welch;
mod whitened_spectrum;
mod whittle;

pub use equation_5::allan_deviations_by_spectrum;
pub(crate) use harmonics::nearest_multiple;
pub use line_envelope::Modulation;
pub use lines::find_lines;
pub(crate) use lines::{find_lines_over, without_sines, without_sines_at, without_slow_sines};
pub(crate) use markov_spectrum::MarkovEstimate;
pub(crate) use sample_likelihood::SpectrumBehindFilter;
pub use sample_spectrum::SampleSpectrum;
pub use smooth_shape::SpectralShape;
pub use spectral_line::SpectralLine;
pub use welch::Welch;
pub use whittle::SpectralBand;
