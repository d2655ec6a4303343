//! Faults that a test can inject, behaviour that the data sheet does not define, and the reset line.

use crate::activity::{Activity, BusyAnswers};
use crate::diagnosis::{self, DiagnosisFlag};
use crate::part::VirtualAdis16405;
use crate::registers::{self, OutputRegister};
use crate::spi::{Strictness, ViolationKind};

/// Shortest low pulse on the reset line that resets the part, ns. It is an assumption: the data sheet gives none.
const LEAST_RESET_PULSE_NS: u64 = 10_000;

/// Behaviour that the data sheet does not define.
impl VirtualAdis16405 {
    /// Refreshes supply, magnetometers, temperature and auxiliary input only with every n-th sample (0 counts as 1, the
    /// default). Between refreshes their words keep their counts, and have no new data after a read. The data sheet
    /// does not give the rate at which the real part refreshes them.
    pub fn set_slow_refresh(&mut self, samples: u32) {
        self.slow_refresh = samples.max(1);
    }

    /// Sets what the controller reads while the part starts up, recovers from a reset, sleeps, or runs another
    /// procedure that needs a silent bus. Each frame is then a [`ViolationKind::Busy`] and is not executed.
    pub fn set_busy_answers(&mut self, answers: BusyAnswers) {
        self.busy_answers = answers;
    }

    /// Sets the duration of the start-up after the next [`power_on`](Self::power_on), ns. `None` is the default: 220
    /// ms, or 290 ms in low-power mode.
    pub fn set_start_up_ns(&mut self, duration_ns: Option<u64>) {
        self.start_up_ns = duration_ns;
    }

    /// Sets the reaction to a controller that violates the data sheet.
    pub fn set_strictness(&mut self, strictness: Strictness) {
        self.spi.strictness = strictness;
    }
}

/// Faults that a test can inject.
impl VirtualAdis16405 {
    /// Sets a flag of DIAG_STAT once, as a tap beyond the range or a glitch on chip select does. The flag, and the error/alarm flag of
    /// every output word, stay set until DIAG_STAT is read or the part is reset. The flags of the supply clear with the next sample that
    /// finds it in its window (data sheet Rev. B, page 15).
    pub fn latch_flag(&mut self, flag: DiagnosisFlag) {
        self.diagnosis |= flag.bit();
    }

    /// Sets a flag of DIAG_STAT with every sample while `on`, as a persistent cause does. A read clears the flag until
    /// the next sample.
    pub fn hold_flag(&mut self, flag: DiagnosisFlag, on: bool) {
        let others = self.held_flags & !flag.bit();
        self.held_flags = if on { others | flag.bit() } else { others };
    }

    /// Breaks the sensor of an inertial channel, so that its self-test fails. Has no effect on other channels, which
    /// have no self-test.
    pub fn break_sensor(&mut self, channel: OutputRegister) {
        if let Some(index) = OutputRegister::INERTIAL.iter().position(|&inertial| inertial == channel) {
            self.self_test_failures |= diagnosis::GYRO_X << index;
        }
    }

    /// Damages the flash memory: its test and its update fail.
    pub fn damage_flash(&mut self) {
        self.flash_damaged = true;
    }

    /// Undoes [`damage_flash`](Self::damage_flash).
    pub fn repair_flash(&mut self) {
        self.flash_damaged = false;
    }

    /// Sets the answer of PROD_ID, as of another part of the family. A reset does not change it.
    pub fn set_prod_id(&mut self, prod_id: u16) {
        self.registers.store(registers::PROD_ID, prod_id);
        self.flash.store(registers::PROD_ID, prod_id);
    }
}

/// The reset line.
impl VirtualAdis16405 {
    /// Drives the reset line (RST, active low). While it is low the part does not sample, and the controller reads
    /// ones. If it was low for 10 µs or more, the part is reset when it rises, and recovers for 100 ms, or 170 ms in
    /// low-power mode. A shorter pulse is a [`ViolationKind::ResetPulse`] and does not reset the part.
    pub fn drive_reset(&mut self, high: bool) {
        if !high {
            self.reset_low_since_ns.get_or_insert(self.now_ns);
            self.next_sample_sixteenths = None;
            return;
        }
        let Some(since_ns) = self.reset_low_since_ns.take() else {
            return;
        };
        let low_ns = self.now_ns - since_ns;
        if low_ns >= LEAST_RESET_PULSE_NS {
            self.reset();
            self.begin(Activity::Reset);
        } else {
            self.bus_log.violation(self.now_ns, ViolationKind::ResetPulse { low_ns, least_ns: LEAST_RESET_PULSE_NS });
            self.restart_sampling(self.now_ns);
        }
    }
}
