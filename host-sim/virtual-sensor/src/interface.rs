//! The interface of the part to its controller: SPI words, registers with the side effects of access, and pins.

use crate::activity::{Activity, BusyAnswers};
use crate::diagnosis;
use crate::part::VirtualAdis16405;
use crate::registers::{self, OutputRegister};
use crate::signal_chain::SensAvg;
use crate::spi::{FLOATING, NoteKind, UNDEFINED, ViolationKind, WordStart};

/// Bit 15 of an output register: new data.
const NEW_DATA: u16 = 0x8000;
/// Bit 14 of an output register: a bit of DIAG_STAT is set.
const ERROR_ALARM: u16 = 0x4000;
/// Sign of a 14-bit field.
const SIGN: u16 = 1 << 13;
/// SLP_CNT: sleep until a pulse on chip select.
const INDEFINITE_SLEEP: u16 = 1 << 8;
/// Unit of SLP_CNT, ns.
const HALF_SECOND_NS: u64 = 500_000_000;
/// Length of a data-ready pulse, ns: the shortest of 100 to 200 µs (data sheet Rev. B, page 14).
const PULSE_NS: u64 = 100_000;
/// Least time of chip select low that wakes the part, ns (Table 1).
const LEAST_WAKE_PULSE_NS: u64 = 20_000;
/// Least length of a pulse of the external sample clock, ns (Table 2, t1).
const LEAST_SYNC_PULSE_NS: u64 = 5_000;
/// Least period of the external sample clock, ns (Table 2, t3).
const LEAST_SYNC_PERIOD_NS: u64 = 833_000;
/// Time from the rising edge of the external sample clock to data ready, ns (Table 2, t2).
const SYNC_TO_DATA_READY_NS: u64 = 600_000;
/// GPIO_CTRL: DIO4 is an output, and so not the input of a sample clock.
const DIO4_IS_OUTPUT: u16 = 1 << 3;
/// A frame of ones.
const DUMMY_FRAME: u16 = 0xFFFF;
/// A write of 0 to the upper byte of GLOB_CMD.
const SECOND_COMMAND_BYTE: u16 = 0xBF00;
/// Size of a count of AUX_DAC, V.
const AUX_DAC_LSB: f64 = 0.8059e-3;

/// The SPI port.
impl VirtualAdis16405 {
    /// Sets SCK, Hz (at least 1). With `None`, words take no time and the clock is not checked.
    pub fn set_sck_hz(&mut self, sck_hz: Option<u32>) {
        self.spi.sck_hz = sck_hz.map(|hz| hz.max(1));
    }

    /// Lets chip select fall.
    pub fn select(&mut self) {
        self.spi.select(self.now_ns);
    }

    /// Lets chip select rise. An incomplete burst or frame is dropped. 20 µs or more of chip select low end a sleep,
    /// with or without bytes (data sheet Rev. B, page 13 and Table 1).
    pub fn deselect(&mut self) {
        self.wake_by_select(true);
        let end = self.spi.deselect(self.now_ns);
        if self.is_alive() {
            if end.in_frame {
                self.diagnosis |= diagnosis::SPI;
            }
            if end.in_frame || end.in_burst {
                let bytes = end.bytes.unwrap_or(0);
                self.bus_log.violation(self.now_ns, ViolationKind::FrameLength { bytes });
            }
        }
    }

    /// Ends a sleep if chip select has been low for the required time.
    fn wake_by_select(&mut self, is_rising: bool) {
        let Some(low_ns) = self.spi.wake_pulse_ns(self.now_ns).filter(|_| self.is_alive() && self.is_asleep()) else {
            return;
        };
        if low_ns >= LEAST_WAKE_PULSE_NS {
            self.wake();
        } else if is_rising {
            let least_ns = LEAST_WAKE_PULSE_NS;
            self.bus_log.violation(self.now_ns, ViolationKind::WakePulse { low_ns, least_ns });
        }
    }

    fn is_asleep(&self) -> bool {
        matches!(self.activity, Some((Activity::Sleep, _)))
    }

    /// Exchanges one 16-bit word.
    pub fn transfer(&mut self, word: u16) -> u16 {
        u16::from_be_bytes(word.to_be_bytes().map(|byte| self.transfer_byte(byte)))
    }

    /// Exchanges half a word, the upper byte first.
    pub fn transfer_byte(&mut self, byte: u8) -> u8 {
        if !self.spi.is_selected() {
            self.bus_log.violation(self.now_ns, ViolationKind::NotSelected);
            return FLOATING;
        }
        self.wake_by_select(false);
        if self.spi.at_word_begin() && self.is_alive() {
            if self.silent_activity().is_some() {
                self.answer_while_busy();
            }
            let smpl_prd = self.registers.read(registers::SMPL_PRD);
            let start = self.spi.begin_word(self.now_ns, smpl_prd, &mut self.bus_log);
            if start == WordStart::Garbled {
                self.diagnosis |= diagnosis::SPI;
            }
        }
        self.advance_to(self.now_ns + self.spi.byte_ns());
        let shifted = self.spi.shift(byte);
        if !self.is_alive() {
            return FLOATING;
        }
        if let Some(word) = shifted.word
            && self.spi.end_word(self.now_ns)
        {
            self.execute(word);
        }
        shifted.answer
    }

    /// The procedure under way if it needs a silent bus.
    fn silent_activity(&self) -> Option<Activity> {
        self.activity.map(|(activity, _)| activity).filter(|activity| activity.needs_silent_bus())
    }

    /// Sets the word that is sent during a procedure that needs a silent bus.
    fn answer_while_busy(&mut self) {
        let word = match self.busy_answers {
            BusyAnswers::Zeros => 0,
            BusyAnswers::Ones => u16::MAX,
            BusyAnswers::Garbage => {
                // Marsaglia's xorshift generator of 32 bits fills the answer.
                self.garbage ^= self.garbage << 13;
                self.garbage ^= self.garbage >> 17;
                self.garbage ^= self.garbage << 5;
                self.garbage as u16
            }
        };
        self.spi.answer(word);
    }

    /// Executes a frame: a write (bit 15), a burst read (a read of GLOB_CMD), or a read.
    fn execute(&mut self, word: u16) {
        let [upper, lower] = word.to_be_bytes();
        let address = upper & 0x7F;
        if let Some(activity) = self.silent_activity() {
            self.answer_while_busy();
            if word == SECOND_COMMAND_BYTE && !self.spi.is_pedantic() {
                self.bus_log.note(self.now_ns, NoteKind::SecondCommandByte);
            } else {
                self.bus_log.violation(self.now_ns, ViolationKind::Busy { activity });
            }
        } else if word == DUMMY_FRAME && !self.spi.is_pedantic() {
            self.bus_log.note(self.now_ns, NoteKind::DummyFrame);
            self.spi.answer(UNDEFINED);
        } else if upper & 0x80 != 0 {
            self.spi.answer(UNDEFINED);
            self.write(address, lower);
        } else if address & 0x7E == registers::GLOB_CMD {
            let words = self.read_burst();
            self.spi.begin_burst(words);
        } else {
            let answer = self.read(address);
            self.spi.answer(answer);
        }
    }
}

/// The registers.
impl VirtualAdis16405 {
    fn read(&mut self, address: u8) -> u16 {
        if !registers::readable(address) {
            self.bus_log.violation(self.now_ns, ViolationKind::Address { address, write: false });
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

    /// Reads all outputs. From then on the erratum of [`read_output`](Self::read_output) applies.
    fn read_burst(&mut self) -> [u16; 12] {
        self.burst_since_reset = true;
        std::array::from_fn(|index| self.read_output(index))
    }

    /// Reads an output: bit 15 new data, bit 14 error or alarm, below them the field. The erratum: after a burst read,
    /// a negative x rate loses its sign while XGYRO_OFF is negative (EngineerZone, thread 81805).
    fn read_output(&mut self, index: usize) -> u16 {
        let output = OutputRegister::ALL[index];
        let mut field = self.signal_chain.counts()[index] as u16 & (u16::MAX >> (16 - output.bits()));
        let is_gyro_x = output == OutputRegister::GyroX;
        if is_gyro_x && self.burst_since_reset && self.registers.read_signed(registers::XGYRO_OFF) < 0.0 {
            field &= !SIGN;
        }
        let new_data = std::mem::take(&mut self.new_data[index]);
        let flag = |set, bit| if set { bit } else { 0 };
        field | flag(new_data, NEW_DATA) | flag(self.diagnosis != 0, ERROR_ALARM)
    }

    fn write(&mut self, address: u8, byte: u8) {
        if !registers::writable(address) {
            if byte == 0 && registers::is_unused_byte(address) && !self.spi.is_pedantic() {
                self.bus_log.note(self.now_ns, NoteKind::UnusedByte { address });
            } else {
                self.bus_log.violation(self.now_ns, ViolationKind::Address { address, write: true });
            }
            return;
        }
        if address == registers::GLOB_CMD {
            self.command(byte);
            return;
        }
        let before = self.registers.clone();
        self.registers.write_byte(address, byte);
        if address == registers::SENS_AVG_UPPER {
            self.lengthen_filter();
        }
        let changed = |register| before.read(register) != self.registers.read(register);
        let (filter, period) = (changed(registers::SENS_AVG), changed(registers::SMPL_PRD));
        if filter {
            self.signal_chain.restart_filters(&self.registers);
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

    /// Raises the taps of the filter to the minimum of the range. So a range can change the filter (data sheet Rev. B,
    /// page 14).
    fn lengthen_filter(&mut self) {
        let sens_avg = self.registers.read(registers::SENS_AVG);
        if let Some(least) = SensAvg::least_taps_log2(sens_avg).filter(|least| sens_avg & 0b111 < u16::from(*least)) {
            self.registers.store(registers::SENS_AVG, sens_avg & !0b111 | u16::from(least));
        }
    }

    /// Starts the self-test or flash test whose bit of MSC_CTRL is set.
    fn start_test(&mut self) {
        let control = self.registers.read(registers::MSC_CTRL);
        let tests = [Activity::SelfTest, Activity::FlashTest];
        if let Some(test) = tests.into_iter().find(|test| control & test.test_bit() != 0) {
            self.begin(test);
        }
    }

    fn sleep(&mut self) {
        let count = self.registers.read(registers::SLP_CNT);
        self.spi.fall_asleep();
        self.registers.store(registers::SLP_CNT, 0);
        if count & INDEFINITE_SLEEP != 0 {
            self.begin_until(Activity::Sleep, u64::MAX);
        } else if count != 0 {
            self.begin_until(Activity::Sleep, self.now_ns + u64::from(count) * HALF_SECOND_NS);
        }
    }

    /// Executes a write to GLOB_CMD. If several bits are set, the first in this order counts: reset, precision
    /// auto-null, flash update, DAC latch, factory restore, auto-null.
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

/// The pins.
impl VirtualAdis16405 {
    /// Level of DIO`line`, 1 to 4. It is the data-ready or alarm signal if one is assigned to the line, else the level
    /// that the part or the outside drives. Other numbers read low.
    pub fn pin(&self, line: u8) -> bool {
        let signal = |control: u16, active: bool| {
            let here = control & 0b100 != 0 && control & 1 == u16::from(line == 2) && (line == 1 || line == 2);
            here.then_some((control & 0b010 != 0) == active)
        };
        let pulse = self.sampled_at_ns.is_some_and(|at| self.now_ns < at + PULSE_NS);
        let alarm = self.diagnosis & diagnosis::ALARMS != 0;
        signal(self.registers.read(registers::MSC_CTRL), pulse)
            .or_else(|| signal(self.registers.read(registers::ALM_CTRL), alarm))
            .unwrap_or_else(|| (1..=4).contains(&line) && self.levels() >> (line - 1) & 1 != 0)
    }

    /// Drives DIO`line`, 1 to 4, from outside; has no effect on a line that the part drives. With SMPL_PRD = 0 and GPIO_CTRL\[3\] = 0, DIO4
    /// is the external sample clock. A sample is taken 600 µs after it rises if it stays high for 5 µs and has not risen in the 833 µs
    /// before (data sheet Rev. B, Table 2, Figure 4 and page 14).
    pub fn drive_pin(&mut self, line: u8, high: bool) {
        if let 1..=4 = line {
            let bit = 1 << (line - 1);
            let was_high = self.driven & bit != 0;
            self.driven = if high { self.driven | bit } else { self.driven & !bit };
            if line == 4 && high != was_high && self.registers.read(registers::SMPL_PRD) == 0 {
                self.clock_edge(high);
            }
        }
    }

    /// Handles an edge of the external sample clock.
    fn clock_edge(&mut self, rising: bool) {
        if self.registers.read(registers::GPIO_CTRL) & DIO4_IS_OUTPUT != 0 {
            return;
        }
        let since_ns = self.clock_rose_at_ns.map(|at_ns| self.now_ns - at_ns);
        match since_ns {
            Some(period_ns) if rising && period_ns < LEAST_SYNC_PERIOD_NS => {
                let least_ns = LEAST_SYNC_PERIOD_NS;
                self.bus_log.violation(self.now_ns, ViolationKind::SyncPeriod { period_ns, least_ns });
            }
            Some(high_ns) if !rising && high_ns < LEAST_SYNC_PULSE_NS => {
                let least_ns = LEAST_SYNC_PULSE_NS;
                self.bus_log.violation(self.now_ns, ViolationKind::SyncPulse { high_ns, least_ns });
                self.next_sample_sixteenths = None;
            }
            _ if rising => {
                self.clock_rose_at_ns = Some(self.now_ns);
                self.next_sample_sixteenths = Some((self.now_ns + SYNC_TO_DATA_READY_NS) * 16);
            }
            _ => {}
        }
    }

    /// Voltage of the auxiliary analog output, V, by the AUX_DAC that was latched last.
    pub fn aux_output_v(&self) -> f64 {
        f64::from(self.latched_dac) * AUX_DAC_LSB
    }

    /// Levels of the lines, bit 0 for DIO1: driven by the part if GPIO_CTRL makes them outputs, else from outside.
    fn levels(&self) -> u16 {
        let control = self.registers.read(registers::GPIO_CTRL);
        let outputs = control & 0xF;
        control >> 8 & outputs | self.driven & !outputs & 0xF
    }
}
