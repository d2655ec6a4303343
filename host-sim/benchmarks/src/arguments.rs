//! Arguments of the benchmarks: their limits, and the number of threads.

use std::num::NonZeroUsize;

/// Most recordings of a benchmark. Each has its own seed, and its result is kept until the end.
pub const MOST_RECORDINGS: u64 = 100_000;

pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, NonZeroUsize::get)
}

/// Reads a number of threads, 1 or more.
///
/// # Errors
/// The text is no such number.
pub fn jobs(text: &str) -> Result<usize, String> {
    text.parse::<NonZeroUsize>().map(NonZeroUsize::get).map_err(|error| error.to_string())
}

fn number_in<T: std::str::FromStr>(text: &str, is_in: impl Fn(&T) -> bool, limits: &str) -> Result<T, String> {
    text.parse().ok().filter(is_in).ok_or_else(|| format!("not a {limits}"))
}

pub(crate) fn loss_percent(text: &str) -> Result<f64, String> {
    number_in(text, |percent| (0.0..=50.0).contains(percent), "percentage from 0 to 50")
}

/// Reads a finite number above 0.
///
/// # Errors
/// The text is no such number.
pub fn positive(text: &str) -> Result<f64, String> {
    number_in(text, |value: &f64| *value > 0.0 && value.is_finite(), "number above 0")
}

/// Taps or decimation of a filter.
pub(crate) fn in_filter(text: &str) -> Result<usize, String> {
    number_in(text, |value| (1..=128).contains(value), "whole number from 1 to 128")
}
