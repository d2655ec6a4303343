//! The virtual part: its state, its time, and its procedures.

use crate::activity::{Activity, BusyAnswers};
use crate::diagnosis::{self, Alarms};
use crate::effects::SensorScenario;
use crate::noise::NoiseModel;
use crate::registers::{self, OutputRegister, RegisterFile};
use crate::signal_chain::{AutoNull, SensAvg, SignalChain, Stimulus};
use crate::spi::{BusLog, NORMAL_MODE_MAX_SMPL_PRD, Note, SpiPort, Violation, ViolationKind};

/// One tick of the sample clock, 1/1638.4 s, in sixteenths of a ns: an integer, so that sample times have no rounding error.
const TICK_SIXTEENTHS: u64 = 9_765_625;
/// Ticks in the slow time base of SMPL_PRD, 18.921 ms.
const SLOW_TICKS: u64 = 31;
/// MSC_CTRL: data ready is enabled.
const DATA_READY_ENABLED: u16 = 1 << 2;

/// An ADIS16405 in virtual time.
///
/// The caller advances time with [`advance_to`](Self::advance_to); samples are taken at the programmed rate. A bus
/// calls [`select`](Self::select), [`transfer`](Self::transfer) or [`transfer_byte`](Self::transfer_byte), and
/// [`deselect`](Self::deselect), each of which acts at [`now`](Self::now). If SCK is known
/// ([`set_sck_hz`](Self::set_sck_hz)), every byte takes eight of its periods. Otherwise words take no time and the
/// clock is not checked.
#[derive(Clone, Debug)]
pub struct VirtualAdis16405 {
    pub(crate) now_ns: u64,
    /// Time of the next sample in sixteenths of a ns; `None` while the part does not sample by itself.
    pub(crate) next_sample_sixteenths: Option<u64>,
    pub(crate) sampled_at_ns: Option<u64>,
    pub(crate) powered: bool,
    /// The procedure under way and its end, ns.
    pub(crate) activity: Option<(Activity, u64)>,
    pub(crate) signal_chain: SignalChain,
    alarms: Alarms,
    auto_null: AutoNull,
    pub(crate) registers: RegisterFile,
    pub(crate) flash: RegisterFile,
    pub(crate) flash_damaged: bool,
    /// Bits of DIAG_STAT that a self-test sets.
    pub(crate) self_test_failures: u16,
    /// Bits of DIAG_STAT that every sample sets.
    pub(crate) held_flags: u16,
    pub(crate) busy_answers: BusyAnswers,
    /// State of the generator of [`BusyAnswers::Garbage`]; not 0.
    pub(crate) garbage: u32,
    /// Duration of the start-up, ns; `None` for that of the power mode.
    pub(crate) start_up_ns: Option<u64>,
    /// Time at which the reset line fell, ns; `None` while it is high.
    pub(crate) reset_low_since_ns: Option<u64>,
    /// True for outputs that have not been read since the latest sample.
    pub(crate) new_data: [bool; 12],
    /// Number of samples between refreshes of the outputs that are not inertial.
    pub(crate) slow_refresh: u32,
    /// DIAG_STAT.
    pub(crate) diagnosis: u16,
    pub(crate) burst_since_reset: bool,
    samples: u64,
    /// `samples` at the latest reset; the first sample after it refreshes all outputs.
    samples_at_reset: u64,
    /// Levels of DIO1 (bit 0) to DIO4 that are driven from outside.
    pub(crate) driven: u16,
    pub(crate) latched_dac: u16,
    /// Time at which the external sample clock rose last, ns.
    pub(crate) clock_rose_at_ns: Option<u64>,
    pub(crate) spi: SpiPort,
    pub(crate) bus_log: BusLog,
}

impl VirtualAdis16405 {
    /// A part just after its start-up at time 0, with reset values. The same model and seed give the same samples.
    pub fn new(model: NoiseModel, seed: u64) -> Self {
        Self::with_scenario(&SensorScenario::default(), model, seed)
    }

    /// A part that is switched on at time 0 and starts up: see [`power_on`](Self::power_on).
    pub fn cold(model: NoiseModel, seed: u64) -> Self {
        let mut part = Self::new(model, seed);
        part.power_on();
        part
    }

    /// The part of [`new`](Self::new) in an environment and with effects that its noise model does not declare.
    pub fn with_scenario(scenario: &SensorScenario, model: NoiseModel, seed: u64) -> Self {
        let mut part = Self {
            now_ns: 0,
            next_sample_sixteenths: None,
            sampled_at_ns: None,
            powered: true,
            activity: None,
            signal_chain: SignalChain::new(scenario, &model, seed),
            alarms: Alarms::default(),
            auto_null: AutoNull::default(),
            registers: RegisterFile::new(),
            flash: RegisterFile::new(),
            flash_damaged: false,
            self_test_failures: 0,
            held_flags: 0,
            busy_answers: BusyAnswers::default(),
            garbage: 16405,
            start_up_ns: None,
            reset_low_since_ns: None,
            new_data: [false; 12],
            slow_refresh: 1,
            diagnosis: 0,
            burst_since_reset: false,
            samples: 0,
            samples_at_reset: 0,
            driven: 0,
            latched_dac: 0,
            spi: SpiPort::new(),
            bus_log: BusLog::default(),
            clock_rose_at_ns: None,
        };
        part.reset();
        part.restart_sampling(0);
        part
    }

    /// Virtual time in ns.
    pub fn now(&self) -> u64 {
        self.now_ns
    }

    /// Advances time to `ns`: takes the samples and ends the procedure that are due. Has no effect if `ns` is before
    /// [`now`](Self::now).
    pub fn advance_to(&mut self, ns: u64) {
        loop {
            let sample = self.next_sample();
            let done = self.activity.map_or(u64::MAX, |(_, until)| until);
            if done <= sample && done <= ns && done != u64::MAX {
                self.now_ns = self.now_ns.max(done);
                self.finish();
            } else if sample <= ns && sample != u64::MAX {
                self.take_sample();
            } else {
                break;
            }
        }
        self.now_ns = self.now_ns.max(ns);
    }

    /// Time of the next data-ready pulse, ns; `u64::MAX` if the signal is switched off, or if the part sleeps or waits for
    /// an external clock (SMPL_PRD = 0).
    pub fn next_data_ready(&self) -> u64 {
        let enabled = self.registers.read(registers::MSC_CTRL) & DATA_READY_ENABLED != 0;
        if enabled && !self.is_offline() { self.next_sample() } else { u64::MAX }
    }

    /// The counts of the latest sample, in the order of a burst; zeros before the first.
    pub fn counts(&self) -> &[i16; 12] {
        self.signal_chain.counts()
    }

    /// Samples taken since time 0.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// The first thousand violations of the data sheet's rules by the controller, oldest first.
    pub fn violations(&self) -> &[Violation] {
        &self.bus_log.violations
    }

    /// Number of all violations.
    pub fn violation_count(&self) -> u64 {
        self.bus_log.violation_count
    }

    /// The first thousand notes on accepted behaviour that the data sheet does not show, oldest first.
    pub fn notes(&self) -> &[Note] {
        &self.bus_log.notes
    }

    /// Number of all notes.
    pub fn note_count(&self) -> u64 {
        self.bus_log.note_count
    }

    fn next_sample(&self) -> u64 {
        self.next_sample_sixteenths.map_or(u64::MAX, |sixteenths| sixteenths.div_ceil(16))
    }

    /// True if samples reach no output.
    fn is_offline(&self) -> bool {
        self.activity.is_some_and(|(activity, _)| activity.is_offline())
    }

    pub(crate) fn is_low_power(&self) -> bool {
        self.registers.read(registers::SMPL_PRD) > NORMAL_MODE_MAX_SMPL_PRD
    }

    /// Loads the registers from flash and clears the rest of the state; time, samples and violations go on.
    pub(crate) fn reset(&mut self) {
        self.registers = RegisterFile::new();
        self.registers.copy_flash_registers(&self.flash);
        self.signal_chain.clear();
        self.signal_chain.restart_filters(&self.registers);
        self.alarms = Alarms::default();
        self.new_data = [false; 12];
        self.diagnosis = 0;
        self.burst_since_reset = false;
        self.samples_at_reset = self.samples;
        self.latched_dac = 0;
    }

    /// Begins a procedure of the usual duration.
    pub(crate) fn begin(&mut self, activity: Activity) {
        self.begin_until(
            activity,
            self.now_ns + activity.duration_ns(self.is_low_power()) * self.lengthening(activity),
        );
    }

    /// Factor on the duration of a procedure at the present sample period. The duration of the self-test is stated for SMPL_PRD = 0x01
    /// (data sheet Rev. B, Table 1) and counted in samples here, the longer choice at other periods.
    fn lengthening(&self, activity: Activity) -> u64 {
        match (activity, self.period_sixteenths()) {
            (Activity::SelfTest, Some(period)) => period.div_ceil(2 * TICK_SIXTEENTHS),
            _ => 1,
        }
    }

    /// Begins a procedure that ends at `until_ns`.
    pub(crate) fn begin_until(&mut self, activity: Activity, until_ns: u64) {
        self.activity = Some((activity, until_ns));
        self.auto_null = AutoNull::default();
        if !activity.keeps_sampling() {
            self.next_sample_sixteenths = None;
        }
    }

    /// Switches the power off, or disconnects the part. It does not sample, and the controller reads ones.
    pub fn power_off(&mut self) {
        self.powered = false;
        self.activity = None;
        self.next_sample_sixteenths = None;
        self.reset();
    }

    /// Switches the power on. The part starts up for 220 ms, or for 290 ms if the SMPL_PRD in its flash selects
    /// low-power mode ([`set_start_up_ns`](Self::set_start_up_ns) changes this). The controller must not use the bus
    /// before; [`set_busy_answers`](Self::set_busy_answers) sets what it reads if it does.
    pub fn power_on(&mut self) {
        self.powered = true;
        self.reset();
        let duration_ns = self.start_up_ns.unwrap_or(Activity::StartUp.duration_ns(self.is_low_power()));
        self.begin_until(Activity::StartUp, self.now_ns + duration_ns);
    }

    /// True if the part drives its data line: it has power and is not held in reset.
    pub(crate) fn is_alive(&self) -> bool {
        self.powered && self.reset_low_since_ns.is_none()
    }

    /// Ends a sleep.
    pub(crate) fn wake(&mut self) {
        if matches!(self.activity, Some((Activity::Sleep, _))) {
            self.begin(Activity::WakeUp);
        }
    }

    /// Ends the procedure under way, with its results.
    fn finish(&mut self) {
        let Some((activity, until_ns)) = self.activity.take() else {
            return;
        };
        let control = self.registers.read(registers::MSC_CTRL);
        self.registers.store(registers::MSC_CTRL, control & !activity.test_bit());
        match activity {
            Activity::SelfTest if self.self_test_failures != 0 => {
                self.diagnosis |= self.self_test_failures | diagnosis::SELF_TEST;
            }
            Activity::FlashTest if self.flash_damaged => self.diagnosis |= diagnosis::FLASH_CHECKSUM,
            Activity::FlashUpdate => self.write_flash(),
            // Each sets all sensor data to 0 and also updates the flash (data sheet Rev. B, page 13).
            Activity::FactoryRestore | Activity::AutoNull | Activity::PrecisionAutoNull => {
                match activity {
                    Activity::FactoryRestore => self.registers.restore_calibration(),
                    _ => self.auto_null.apply(&mut self.registers),
                }
                self.write_flash();
                self.signal_chain.clear();
            }
            Activity::Sleep => self.begin(Activity::WakeUp),
            _ => {}
        }
        if !activity.keeps_sampling() && activity != Activity::Sleep {
            self.restart_sampling(until_ns);
        }
    }

    /// Copies the registers to the flash, which needs the supply in its window (data sheet Rev. B, page 10).
    fn write_flash(&mut self) {
        let has_sampled = self.samples > self.samples_at_reset;
        if self.flash_damaged || has_sampled && diagnosis::check_supply(self.signal_chain.counts()) != 0 {
            self.diagnosis |= diagnosis::FLASH_UPDATE;
            return;
        }
        let writes = self.registers.read(registers::FLASH_CNT).wrapping_add(1);
        self.registers.store(registers::FLASH_CNT, writes);
        self.flash.copy_flash_registers(&self.registers);
    }

    /// Restarts the sample clock unless it is external: the first sample comes one period after `from_ns`.
    pub(crate) fn restart_sampling(&mut self, from_ns: u64) {
        let may_sample = self.activity.is_none_or(|(activity, _)| activity.keeps_sampling());
        self.next_sample_sixteenths =
            self.period_sixteenths().filter(|_| may_sample && self.is_alive()).map(|period| {
                self.signal_chain.set_sample_period(period as f64 / 16e9);
                from_ns * 16 + period
            });
    }

    /// Sample period by SMPL_PRD and the true rate of the clock; `None` if the clock is external.
    fn period_sixteenths(&self) -> Option<u64> {
        let smpl_prd = u64::from(self.registers.read(registers::SMPL_PRD));
        let base = if smpl_prd & 0x80 == 0 { 1 } else { SLOW_TICKS };
        let nominal = (smpl_prd % 0x80 + 1) * base * TICK_SIXTEENTHS;
        (smpl_prd != 0).then(|| (nominal as f64 / self.signal_chain.clock_ratio()).round() as u64)
    }

    fn take_sample(&mut self) {
        let Some(at) = self.next_sample_sixteenths.take() else { return };
        self.now_ns = self.now_ns.max(at.div_ceil(16));
        match self.period_sixteenths() {
            Some(period) => {
                self.next_sample_sixteenths = Some(at + period);
                self.sample(at as f64 / 16e9, period as f64 / 16e9);
            }
            None => self.sample_externally(),
        }
    }

    fn sample(&mut self, time_s: f64, period_s: f64) {
        if !SensAvg::decode(&self.registers).valid {
            let sens_avg = self.registers.read(registers::SENS_AVG);
            self.bus_log.violation(self.now_ns, ViolationKind::Configuration { sens_avg });
        }
        let slow_due = (self.samples - self.samples_at_reset).is_multiple_of(u64::from(self.slow_refresh));
        let stimulus = match self.activity {
            Some((Activity::SelfTest, _)) => Some(Stimulus::Positive),
            _ => Stimulus::manual(&self.registers),
        };
        self.signal_chain.sample(&self.registers, stimulus, time_s, period_s, slow_due);
        self.auto_null.add(self.signal_chain.rates());
        if self.is_offline() {
            return;
        }
        for (new, channel) in self.new_data.iter_mut().zip(OutputRegister::ALL) {
            *new |= slow_due || OutputRegister::INERTIAL.contains(&channel);
        }
        self.samples += 1;
        self.sampled_at_ns = Some(self.now_ns);
        let (counts, unfiltered) = (self.signal_chain.counts(), self.signal_chain.unfiltered());
        let found = diagnosis::check_supply(counts) | self.alarms.check(&self.registers, counts, unfiltered);
        self.diagnosis = self.diagnosis & !diagnosis::SUPPLY_FLAGS | found | self.held_flags;
    }

    /// Takes a sample by the external clock; its period is the time since the previous sample.
    pub(crate) fn sample_externally(&mut self) {
        if self.activity.is_some_and(|(activity, _)| !activity.keeps_sampling()) || !self.is_alive() {
            return;
        }
        let since_ns = self.now_ns - self.sampled_at_ns.unwrap_or(0);
        let period_s = since_ns.max(1) as f64 * 1e-9;
        self.signal_chain.set_sample_period(period_s);
        self.sample(self.now_ns as f64 * 1e-9, period_s);
    }
}
