//! Samples that are left out of a recording, and corrections of the others.

/// Exclusions and corrections. Repeated samples are always left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Exclusion {
    /// The recording as it was made.
    Nothing,
    /// Steps and responses of the first half are subtracted in both halves; knocks and spikes stay.
    BiasOfFirstHalf,
    /// [`BiasOfFirstHalf`](Self::BiasOfFirstHalf), without knocks and spikes by rules fitted to the first half.
    ByFirstHalf,
    /// All findings of the whole record.
    ByWhole,
}

impl Exclusion {
    pub(crate) fn keeps_events(self) -> bool {
        matches!(self, Self::Nothing | Self::BiasOfFirstHalf)
    }
}
