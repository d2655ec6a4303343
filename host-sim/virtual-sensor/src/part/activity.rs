//! What keeps the part busy, and for how long. Times are those of Linux and of KU Leuven's driver; where sources disagree,
//! the longer one.

/// Something that takes the part a while.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Activity {
    /// Power was switched on.
    StartUp,
    /// GLOB_CMD bit 7.
    Reset,
    /// MSC_CTRL bit 10.
    SelfTest,
    /// MSC_CTRL bit 11.
    FlashTest,
    /// GLOB_CMD bit 3.
    FlashUpdate,
    /// GLOB_CMD bit 1.
    FactoryRestore,
    /// GLOB_CMD bit 0.
    AutoNull,
    /// GLOB_CMD bit 4.
    PrecisionAutoNull,
    /// SLP_CNT.
    Sleep,
    /// Recovery from sleep.
    WakeUp,
}

impl Activity {
    /// How long it lasts, ns; sleep lasts as long as it is told.
    pub(super) const fn length_ns(self, low_power: bool) -> u64 {
        let ms = match self {
            Activity::StartUp if low_power => 290,
            Activity::StartUp => 220,
            Activity::Reset if low_power => 170,
            Activity::Reset => 100,
            Activity::SelfTest => 12,
            Activity::FlashTest if low_power => 90,
            Activity::FlashTest => 17,
            Activity::FlashUpdate => 100,
            Activity::FactoryRestore | Activity::AutoNull => 50,
            Activity::PrecisionAutoNull => 30_000,
            Activity::Sleep => 0,
            Activity::WakeUp if low_power => 15,
            Activity::WakeUp => 4,
        };
        ms * 1_000_000
    }

    /// True if the bus must be left alone meanwhile.
    pub(super) const fn silent(self) -> bool {
        !matches!(self, Activity::SelfTest | Activity::FlashTest)
    }

    /// True if samples are taken meanwhile.
    pub(super) const fn samples(self) -> bool {
        matches!(self, Activity::SelfTest | Activity::FlashTest | Activity::AutoNull | Activity::PrecisionAutoNull)
    }

    /// The bit of MSC_CTRL that clears at its end.
    pub(super) const fn test_bit(self) -> u16 {
        match self {
            Activity::SelfTest => 1 << 10,
            Activity::FlashTest => 1 << 11,
            _ => 0,
        }
    }
}
