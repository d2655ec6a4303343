//! The noise model of one channel: what is fitted to a curve, how a model is edited, and the filter that all channels share.

pub(crate) mod channel_fit;
pub mod contradiction;
pub(crate) mod covariates;
pub(crate) mod event_share;
pub mod gauss_markov;
pub(crate) mod noise_terms;
pub(crate) mod octave_covariance;
pub(crate) mod part_filter;
pub(crate) mod quantized_after_filter;
pub mod sample_coefficients;
pub(crate) mod signal_share;
pub(crate) mod traced_model;
