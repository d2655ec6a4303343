//! The part's tests: internal, flash, manual (MSC_CTRL, DIAG_STAT).

use crate::burst::OutputWord;
use crate::channel::Channel;
use crate::error::Diagnosis;
use crate::protocol::{Protocol, ProtocolError, WriteOrder};
use crate::register::Register;

/// Outcome of the internal self-test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct SelfTest {
    /// DIAG_STAT before the test; the read cleared the register.
    pub before: Diagnosis,
    /// True if the test bit was seen set; if false, a sleeping part may not have tested.
    pub ran: bool,
    /// DIAG_STAT after the test.
    pub diagnosis: Diagnosis,
}

impl SelfTest {
    /// True if the test ran and no sensor failed.
    pub fn passed(&self) -> bool {
        self.ran && !self.diagnosis.intersects(Diagnosis::SELF_TEST_FAILURES)
    }
}

/// Outcome of the flash memory test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct FlashTest {
    /// DIAG_STAT before the test; the read cleared the register.
    pub before: Diagnosis,
    /// True if the test bit was seen set before it cleared.
    pub ran: bool,
    /// DIAG_STAT after the test.
    pub diagnosis: Diagnosis,
}

impl FlashTest {
    /// True if the test ran and the checksum was right.
    pub fn passed(&self) -> bool {
        self.ran && !self.diagnosis.contains(Diagnosis::FLASH_CHECKSUM)
    }
}

/// Direction in which a manual self-test deflects the sensors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Stimulus {
    /// Positive, MSC_CTRL bit 8: gyros and accelerometers.
    Positive,
    /// Negative, MSC_CTRL bit 9. The data sheet (Rev. B, Table 22) contradicts itself on the sign: compare magnitudes.
    Negative,
}

/// MSC_CTRL bits that start a test and clear themselves at its end.
const FLASH_TEST: u16 = 1 << 11;
const SELF_TEST: u16 = 1 << 10;
/// The other bits of MSC_CTRL: a test leaves them as they were, except that it switches [`STIMULI`] off.
const SETTINGS: u16 = 0x03C7;
/// MSC_CTRL bits of the manual self-test, positive and negative.
const STIMULI: u16 = 0x0300;
/// Number of samples whose mean is compared with and without a stimulus.
const AVERAGED: i32 = 8;
/// Sample periods that the test may take beyond [`Timing::self_test_us`](crate::Timing::self_test_us), at any rate.
const SAMPLES_IN_TEST: u32 = 20;

const INERTIAL: [Register; 6] = [
    Register::XgyroOut,
    Register::YgyroOut,
    Register::ZgyroOut,
    Register::XacclOut,
    Register::YacclOut,
    Register::ZacclOut,
];

impl Protocol<'_> {
    pub(crate) async fn self_test(&mut self) -> Result<SelfTest, ProtocolError> {
        let usual_us = self.state.timing.self_test_us.saturating_add(SAMPLES_IN_TEST * self.sample_us());
        let (before, ran, diagnosis) = self.run_test(SELF_TEST, usual_us).await?;
        Ok(SelfTest { before, ran, diagnosis })
    }

    pub(crate) async fn flash_test(&mut self) -> Result<FlashTest, ProtocolError> {
        let usual_us = self.state.timing.flash_test_us.get(self.state.mode);
        let (before, ran, diagnosis) = self.run_test(FLASH_TEST, usual_us).await?;
        Ok(FlashTest { before, ran, diagnosis })
    }

    /// Runs the test of an MSC_CTRL bit; returns DIAG_STAT before, whether the test ran, and DIAG_STAT after.
    async fn run_test(&mut self, bit: u16, usual_us: u32) -> Result<(Diagnosis, bool, Diagnosis), ProtocolError> {
        // An absent part may read as zeros, which would look like a finished test.
        self.identity().await?;
        let before = self.diagnosis().await?;
        let control = self.read(Register::MscCtrl).await;
        self.write_high(Register::MscCtrl, bit).await;
        let ran = self.wait_until_clear(Register::MscCtrl, bit, usual_us.saturating_mul(2)).await?;
        let diagnosis = self.diagnosis().await?;
        let now = self.read(Register::MscCtrl).await;
        self.update_from(Register::MscCtrl, now, SETTINGS, control & !STIMULI, WriteOrder::LowByteFirst).await?;
        self.state.stimulated = false;
        Ok((before, ran, diagnosis))
    }

    pub(crate) async fn stimulus_response(&mut self, stimulus: Stimulus) -> Result<[i16; 6], ProtocolError> {
        let bits = match stimulus {
            Stimulus::Positive => 1 << 8,
            Stimulus::Negative => 1 << 9,
        };
        self.stop_stimulus().await?;
        let rest = self.inertial_sums().await;
        self.state.stimulated = true;
        self.update_register(Register::MscCtrl, STIMULI, bits).await?;
        let stimulated = self.inertial_sums().await;
        self.stop_stimulus().await?;
        let mut response = [0; 6];
        for (response, (with, without)) in response.iter_mut().zip(stimulated.into_iter().zip(rest)) {
            *response = ((with - without) / AVERAGED) as i16;
        }
        Ok(response)
    }

    pub(crate) async fn stop_stimulus(&mut self) -> Result<(), ProtocolError> {
        self.update_register(Register::MscCtrl, STIMULI, 0).await?;
        self.state.stimulated = false;
        Ok(())
    }

    /// Sums over [`AVERAGED`] samples of the six inertial outputs, taken by single reads after the filter has settled.
    async fn inertial_sums(&self) -> [i32; 6] {
        let taps = 2u32 << self.state.config.filter_taps_log2();
        self.pause(self.state.timing.self_test_us.saturating_add(taps * self.sample_us())).await;
        let mut sums = [0; 6];
        for _ in 0..AVERAGED {
            let words = self.read_all(INERTIAL).await;
            for (sum, (word, channel)) in sums.iter_mut().zip(words.into_iter().zip(Channel::INERTIAL)) {
                *sum += i32::from(OutputWord(word).counts(channel));
            }
            self.pause(self.sample_us()).await;
        }
        sums
    }

    /// The internal sample period in µs, rounded up.
    fn sample_us(&self) -> u32 {
        self.state.config.sample_period().ticks().saturating_mul(611)
    }
}
