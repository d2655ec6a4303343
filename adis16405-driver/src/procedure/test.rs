//! What the part can test about itself.

use crate::channel::Channel;
use crate::diagnosis::Diagnosis;
use crate::frame::OutputWord;
use crate::register::Register;
use crate::self_test::{FlashTest, SelfTest, Stimulus};
use crate::session::{Order, Refusal, Session};

const FLASH_TEST: u16 = 1 << 11;
const SELF_TEST: u16 = 1 << 10;
/// What a test may leave different in MSC_CTRL: everything that stays set by itself.
const LASTING: u16 = 0x03C7;
const STIMULI: u16 = 0x0300;
/// Samples whose mean is compared with and without a stimulus.
const AVERAGED: i32 = 8;
/// Filter taps and samples of a self-test, at any rate: sample periods that the deadline allows for.
const SAMPLES_IN_TEST: u32 = 20;

const INERTIAL: [Register; 6] = [
    Register::XgyroOut,
    Register::YgyroOut,
    Register::ZgyroOut,
    Register::XacclOut,
    Register::YacclOut,
    Register::ZacclOut,
];

impl Session<'_> {
    pub(crate) async fn diagnosis(&self) -> Result<Diagnosis, Refusal> {
        Ok(Diagnosis::from_bits_retain(self.read(Register::DiagStat).await))
    }

    pub(crate) async fn self_test(&mut self) -> Result<SelfTest, Refusal> {
        let usual_us = self.state.timing.self_test_us.saturating_add(SAMPLES_IN_TEST * self.sample_us());
        let (before, ran, diagnosis) = self.msc_test(SELF_TEST, usual_us).await?;
        Ok(SelfTest { before, ran, diagnosis })
    }

    pub(crate) async fn flash_test(&mut self) -> Result<FlashTest, Refusal> {
        let usual_us = self.state.timing.flash_test_us.get(self.state.mode);
        let (before, ran, diagnosis) = self.msc_test(FLASH_TEST, usual_us).await?;
        Ok(FlashTest { before, ran, diagnosis })
    }

    /// Sets a bit of MSC_CTRL that clears itself, waits for that, and leaves the register as it was. Only the upper byte
    /// is written: the lower one holds the data-ready line.
    async fn msc_test(&mut self, bit: u16, usual_us: u32) -> Result<(Diagnosis, bool, Diagnosis), Refusal> {
        // A part that does not answer reads as one that is done.
        self.identity().await?;
        let before = self.diagnosis().await?;
        let control = self.read(Register::MscCtrl).await;
        self.write_high(Register::MscCtrl, bit).await;
        let ran = self.wait_until_clear(Register::MscCtrl, bit, usual_us.saturating_mul(2)).await?;
        let diagnosis = self.diagnosis().await?;
        let now = self.read(Register::MscCtrl).await;
        self.change(Register::MscCtrl, now, LASTING, control, Order::LowerFirst).await?;
        Ok((before, ran, diagnosis))
    }

    pub(crate) async fn stimulus_response(&mut self, stimulus: Stimulus) -> Result<[i16; 6], Refusal> {
        let bits = match stimulus {
            Stimulus::Positive => 1 << 8,
            Stimulus::Negative => 1 << 9,
        };
        self.update_register(Register::MscCtrl, STIMULI, 0).await?;
        let rest = self.sums().await;
        self.update_register(Register::MscCtrl, STIMULI, bits).await?;
        let stimulated = self.sums().await;
        self.update_register(Register::MscCtrl, STIMULI, 0).await?;
        let mut response = [0; 6];
        for (response, (with, without)) in response.iter_mut().zip(stimulated.into_iter().zip(rest)) {
            *response = ((with - without) / AVERAGED) as i16;
        }
        Ok(response)
    }

    /// Sums of several samples of the six inertial outputs, read singly and after the filter has settled.
    async fn sums(&self) -> [i32; 6] {
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
