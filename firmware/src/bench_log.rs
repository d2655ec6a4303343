//! The log that a debug probe reads on the bench: the same lines as those of the serial port, and every counted event.

/// Logs a line at the level `info`, which is compiled into an image by default. On the host there is no bench.
pub(crate) fn bench_log(line: &str) {
    #[cfg(all(target_os = "none", feature = "microcontroller"))]
    defmt::info!("{=str}", line);
    let _ = line;
}
