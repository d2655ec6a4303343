//! Which samples of a recording are left out, and what is subtracted from the others.

/// What of a recording is left out and subtracted. Samples that were read twice are always left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Exclusion {
    /// Nothing: the recording as it was made.
    Nothing,
    /// The steps and responses that the first half shows are subtracted, in both halves; knocks and spikes stay.
    BiasOfFirstHalf,
    /// As [`BiasOfFirstHalf`](Self::BiasOfFirstHalf), without the knocks and spikes by rules that were fitted to the first half, in both
    /// halves.
    ByFirstHalf,
    /// What the whole record shows.
    ByWhole,
}

impl Exclusion {
    /// Whether knocks and spikes stay.
    pub(crate) fn keeps_events(self) -> bool {
        matches!(self, Self::Nothing | Self::BiasOfFirstHalf)
    }
}
