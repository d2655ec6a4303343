//! What the part says about itself when asked to test.

use crate::diagnosis::Diagnosis;

/// Outcome of the internal self-test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SelfTest {
    /// What DIAG_STAT held before; reading it cleared it.
    pub before: Diagnosis,
    /// The test bit was seen set before it cleared. If not, the part may have been asleep and has tested nothing.
    pub ran: bool,
    /// What DIAG_STAT held after.
    pub diagnosis: Diagnosis,
}

impl SelfTest {
    /// True if the test ran and found no fault.
    pub fn passed(&self) -> bool {
        self.ran && !self.diagnosis.intersects(Diagnosis::SELF_TEST_FAILURES)
    }
}

/// Outcome of the flash memory test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FlashTest {
    /// What DIAG_STAT held before; reading it cleared it.
    pub before: Diagnosis,
    /// The test bit was seen set before it cleared.
    pub ran: bool,
    /// What DIAG_STAT held after.
    pub diagnosis: Diagnosis,
}

impl FlashTest {
    /// True if the test ran and the checksum was right.
    pub fn passed(&self) -> bool {
        self.ran && !self.diagnosis.contains(Diagnosis::FLASH_CHECKSUM)
    }
}

/// Direction in which the manual self-test deflects the sensors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Stimulus {
    /// MSC_CTRL bit 8.
    Positive,
    /// MSC_CTRL bit 9.
    Negative,
}
