//! How the bus must be used, and a record of how it was not.

use std::fmt;

use super::part::Activity;

/// Least pause between frames in normal mode, ns.
pub const MIN_STALL_NORMAL_NS: u64 = 9_000;
/// Least pause between frames in low-power mode, ns; no source at hand confirms it.
pub const MIN_STALL_LOW_POWER_NS: u64 = 75_000;
/// Highest SCK in normal mode, Hz.
pub const MAX_SCK_NORMAL_HZ: u32 = 2_000_000;
/// Highest SCK in a burst read, Hz.
pub const MAX_SCK_BURST_HZ: u32 = 1_000_000;
/// Highest SCK in low-power mode, Hz.
pub const MAX_SCK_LOW_POWER_HZ: u32 = 300_000;
/// SMPL_PRD above this value is low-power mode.
pub const NORMAL_MODE_MAX_SMPL_PRD: u16 = 0x08;

/// Violations kept in full; the rest are only counted.
const KEPT: usize = 1000;

/// One thing that a controller must not do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Violation {
    /// Virtual time, ns.
    pub at_ns: u64,
    /// What it was.
    pub kind: ViolationKind,
}

/// What a controller must not do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ViolationKind {
    /// Too short a pause between frames.
    Stall {
        /// The pause, ns.
        stall_ns: u64,
        /// The least allowed, ns.
        least_ns: u64,
    },
    /// Chip select rose inside a 16-bit frame or a burst.
    FrameLength {
        /// Whole bytes since chip select fell.
        bytes: usize,
    },
    /// SCK too fast.
    Clock {
        /// The clock, Hz.
        sck_hz: u32,
        /// The highest allowed, Hz.
        most_hz: u32,
    },
    /// Clocked without chip select.
    NotSelected,
    /// Addressed while the bus must be silent.
    Busy {
        /// What the part was doing.
        activity: Activity,
    },
    /// A register was read that cannot be read, or a byte written that cannot be written.
    Address {
        /// Address of the byte.
        address: u8,
        /// True for a write.
        write: bool,
    },
    /// A sample was taken with a combination of range and filter taps that the part does not allow.
    Configuration {
        /// SENS_AVG.
        sens_avg: u16,
    },
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "at {:.6} s: ", self.at_ns as f64 * 1e-9)?;
        match self.kind {
            ViolationKind::Stall { stall_ns, least_ns } => {
                write!(f, "stall of {stall_ns} ns between frames, at least {least_ns} ns needed")
            }
            ViolationKind::FrameLength { bytes } => write!(f, "chip select rose after {bytes} bytes"),
            ViolationKind::Clock { sck_hz, most_hz } => write!(f, "SCK of {sck_hz} Hz, at most {most_hz} Hz allowed"),
            ViolationKind::NotSelected => write!(f, "clocked without chip select"),
            ViolationKind::Busy { activity } => write!(f, "addressed while busy with {activity:?}"),
            ViolationKind::Address { address, write: true } => {
                write!(f, "write to {address:#04x}, which cannot be written")
            }
            ViolationKind::Address { address, write: false } => {
                write!(f, "read of {address:#04x}, which cannot be read")
            }
            ViolationKind::Configuration { sens_avg } => {
                write!(f, "SENS_AVG {sens_avg:#06x} has too few taps for its range, or no valid range")
            }
        }
    }
}

/// The record of violations.
#[derive(Clone, Debug, Default)]
pub(super) struct Record {
    violations: Vec<Violation>,
    count: u64,
}

impl Record {
    pub(super) fn add(&mut self, at_ns: u64, kind: ViolationKind) {
        self.count += 1;
        if self.violations.len() < KEPT {
            self.violations.push(Violation { at_ns, kind });
        }
    }

    pub(super) fn violations(&self) -> &[Violation] {
        &self.violations
    }

    pub(super) fn count(&self) -> u64 {
        self.count
    }
}
