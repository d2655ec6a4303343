//! Events that a debug probe reads: structured, with a level, and made text by the host of the probe.

/// Logs an event as `defmt::$level!` does. On the host there is no probe.
macro_rules! event {
    ($level:ident, $format:literal $(, $value:expr)*) => {{
        #[cfg(all(target_os = "none", feature = "microcontroller"))]
        defmt::$level!($format $(, $value)*);
        $(let _ = &$value;)*
    }};
}

pub(crate) use event;
