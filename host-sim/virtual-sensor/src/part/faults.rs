//! What can be made to go wrong with the part.

use crate::output::OutputRegister;

use super::VirtualAdis16405;
use super::activity::Activity;
use crate::registers;

/// Self-test failure of gyro x; y, z and the accelerometers follow.
const DIAG_GYRO_X: u16 = 1 << 10;

impl VirtualAdis16405 {
    /// The sensor of one inertial channel is broken: self-tests fail. Other channels have no self-test.
    pub fn break_sensor(&mut self, channel: OutputRegister) {
        if let Some(index) = OutputRegister::INERTIAL.iter().position(|&inertial| inertial == channel) {
            self.self_test_failures |= DIAG_GYRO_X << index;
        }
    }

    /// The flash memory is damaged: its test and its update fail.
    pub fn damage_flash(&mut self) {
        self.flash_damaged = true;
    }

    /// Another part answers: what PROD_ID reads from now on, also after a reset.
    pub fn set_prod_id(&mut self, prod_id: u16) {
        self.registers.store(registers::PROD_ID, prod_id);
        self.flash.store(registers::PROD_ID, prod_id);
    }

    /// Power is lost, or the cable is pulled: no samples, and the controller reads ones.
    pub fn power_off(&mut self) {
        self.powered = false;
        self.activity = None;
        self.next_sample_sixteenths = None;
        self.reset();
    }

    /// Power comes back: the part starts up.
    pub fn power_on(&mut self) {
        self.powered = true;
        self.reset();
        self.begin(Activity::StartUp);
    }
}
