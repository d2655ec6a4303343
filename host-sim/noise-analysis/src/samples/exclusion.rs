//! Which samples of a recording are left out.

/// Which of the samples that the detectors found are left out. Samples that were read twice always are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Exclusion {
    /// None.
    None,
    /// Knocks and spikes by rules that were fitted to the first half of the record, in both halves.
    ByFirstHalf,
    /// The knocks and spikes of the whole record.
    ByWhole,
}
