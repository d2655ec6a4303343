//! The procedures of the part that take time. Durations are those of the data sheet (Rev. B): Table 1, and pages 10 and 13 for procedures
//! that write the flash.

/// A procedure that takes time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Activity {
    /// The start-up after power-on.
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
    /// The recovery from sleep.
    WakeUp,
}

impl Activity {
    /// Duration, ns; 0 for sleep, whose duration SLP_CNT sets.
    pub(crate) const fn duration_ns(self, low_power: bool) -> u64 {
        let ms = match self {
            Activity::StartUp if low_power => 290,
            Activity::StartUp => 220,
            Activity::Reset if low_power => 170,
            Activity::Reset => 100,
            Activity::SelfTest => 12,
            Activity::FlashTest if low_power => 90,
            Activity::FlashTest => 17,
            Activity::FlashUpdate | Activity::FactoryRestore | Activity::AutoNull => 50,
            // The procedure takes 30 s offline, then the flash update.
            Activity::PrecisionAutoNull => 30_050,
            Activity::Sleep => 0,
            Activity::WakeUp if low_power => 15,
            Activity::WakeUp => 4,
        };
        ms * 1_000_000
    }

    /// True if the controller must not use the bus during the procedure.
    pub(crate) const fn needs_silent_bus(self) -> bool {
        !matches!(self, Activity::SelfTest | Activity::FlashTest)
    }

    /// True if the part samples during the procedure; the samples reach no output if it [is offline](Self::is_offline).
    pub(crate) const fn keeps_sampling(self) -> bool {
        matches!(self, Activity::SelfTest | Activity::FlashTest | Activity::AutoNull | Activity::PrecisionAutoNull)
    }

    /// True if samples taken during the procedure reach no output.
    pub(crate) const fn is_offline(self) -> bool {
        matches!(self, Activity::PrecisionAutoNull)
    }

    /// The bit of MSC_CTRL that starts the procedure and clears at its end; 0 for procedures of other registers.
    pub(crate) const fn test_bit(self) -> u16 {
        match self {
            Activity::SelfTest => 1 << 10,
            Activity::FlashTest => 1 << 11,
            _ => 0,
        }
    }
}

/// Answers that the controller reads during an [`Activity`] that needs a silent bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BusyAnswers {
    /// Zeros.
    #[default]
    Zeros,
    /// Ones: the part ignores the bus and does not drive its data line, which has a pull-up.
    Ones,
    /// Random words, the same in every run.
    Garbage,
}
