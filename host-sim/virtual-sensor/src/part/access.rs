//! What reading and writing a register does.

use crate::output::OutputRegister;

use super::VirtualAdis16405;
use super::activity::Activity;
use crate::police::ViolationKind;
use crate::registers;

/// What the part sends where its answer is not defined (after a write, a burst, from a register that cannot be read).
pub(super) const UNDEFINED: u16 = 0xA5A5;

const NEW_DATA: u16 = 0x8000;
const ERROR_ALARM: u16 = 0x4000;
const SIGN: u16 = 1 << 13;
const INDEFINITE_SLEEP: u16 = 1 << 8;
const HALF_SECOND_NS: u64 = 500_000_000;

impl VirtualAdis16405 {
    pub(super) fn read(&mut self, address: u8) -> u16 {
        if !registers::readable(address) {
            self.record.add(self.now_ns, ViolationKind::Address { address, write: false });
            return UNDEFINED;
        }
        match address & 0x7E {
            output @ registers::SUPPLY_OUT..=registers::AUX_ADC => {
                self.read_output(usize::from((output - registers::SUPPLY_OUT) / 2))
            }
            registers::DIAG_STAT => std::mem::take(&mut self.diagnosis),
            registers::GPIO_CTRL => self.levels() << 8 | self.registers.read(address) & 0xF,
            _ => self.registers.read(address),
        }
    }

    /// All outputs, and from now on the erratum of [`read_output`](Self::read_output).
    pub(super) fn read_burst(&mut self) -> [u16; 12] {
        self.burst_since_reset = true;
        std::array::from_fn(|index| self.read_output(index))
    }

    /// Bit 15 new data, bit 14 error or alarm, below them the field. After a burst a negative x rate loses its sign while
    /// XGYRO_OFF is negative (EngineerZone, thread 81805).
    fn read_output(&mut self, index: usize) -> u16 {
        let channel = OutputRegister::ALL[index];
        let mut field = self.sensing.counts()[index] as u16 & (u16::MAX >> (16 - channel.bits()));
        if channel == OutputRegister::GyroX
            && self.burst_since_reset
            && self.registers.signed(registers::XGYRO_OFF) < 0.0
        {
            field &= !SIGN;
        }
        let new_data = std::mem::take(&mut self.new_data[index]);
        let flag = |set, bit| if set { bit } else { 0 };
        field | flag(new_data, NEW_DATA) | flag(self.diagnosis != 0, ERROR_ALARM)
    }

    pub(super) fn write(&mut self, address: u8, byte: u8) {
        if !registers::writable(address) {
            self.record.add(self.now_ns, ViolationKind::Address { address, write: true });
            return;
        }
        if address == registers::GLOB_CMD {
            self.command(byte);
            return;
        }
        let before = self.registers.clone();
        self.registers.write(address, byte);
        let changed = |register| before.read(register) != self.registers.read(register);
        let (filter, period) = (changed(registers::SENS_AVG), changed(registers::SMPL_PRD));
        if filter {
            self.sensing.restart_filters(&self.registers);
        }
        if period {
            self.restart_sampling(self.now_ns);
        }
        match address {
            registers::SLP_CNT | registers::SLP_CNT_UPPER => self.sleep(),
            registers::MSC_CTRL_UPPER => self.start_test(),
            _ => {}
        }
    }

    fn start_test(&mut self) {
        let control = self.registers.read(registers::MSC_CTRL);
        let asked = [Activity::SelfTest, Activity::FlashTest].into_iter().find(|test| control & test.test_bit() != 0);
        if let Some(test) = asked {
            self.begin(test);
        }
    }

    fn sleep(&mut self) {
        let count = self.registers.read(registers::SLP_CNT);
        self.registers.store(registers::SLP_CNT, 0);
        if count & INDEFINITE_SLEEP != 0 {
            self.begin_until(Activity::Sleep, u64::MAX);
        } else if count != 0 {
            self.begin_until(Activity::Sleep, self.now_ns + u64::from(count) * HALF_SECOND_NS);
        }
    }

    /// GLOB_CMD: the most drastic of the bits counts.
    fn command(&mut self, byte: u8) {
        match byte {
            reset if reset & 1 << 7 != 0 => {
                self.reset();
                self.begin(Activity::Reset);
            }
            null if null & 1 << 4 != 0 => self.begin(Activity::PrecisionAutoNull),
            update if update & 1 << 3 != 0 => self.begin(Activity::FlashUpdate),
            latch if latch & 1 << 2 != 0 => self.latched_dac = self.registers.read(registers::AUX_DAC),
            restore if restore & 1 << 1 != 0 => self.begin(Activity::FactoryRestore),
            null if null & 1 != 0 => self.begin(Activity::AutoNull),
            _ => {}
        }
    }
}
