//! Structured events for a debug probe.

/// Logs as `defmt::$level!` on the target; does nothing on the host.
macro_rules! event {
    ($level:ident, $format:literal $(, $value:expr)*) => {{
        #[cfg(all(target_os = "none", feature = "microcontroller"))]
        defmt::$level!($format $(, $value)*);
        $(let _ = &$value;)*
    }};
}

pub(crate) use event;
