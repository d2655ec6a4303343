//! The virtual part: its state, and how time passes in it.

mod access;
mod activity;
mod alarm;
mod faults;
mod pins;
mod sensing;
mod wire;

pub use activity::Activity;

use super::output::OutputRegister;

use super::effect::Hidden;
use super::noise::NoiseModel;
use super::police::{self, Record, Violation, ViolationKind};
use super::registers::{self, RegisterFile};
use alarm::Alarms;
use sensing::{Null, Sensing, Setting};
use wire::Wire;

/// One tick of the sample clock, 1/1638.4 s, in sixteenths of a ns: an integer, so that samples never drift.
const TICK_SIXTEENTHS: u64 = 9_765_625;
/// Ticks in the slow time base of SMPL_PRD, 18.921 ms.
const SLOW_TICKS: u64 = 31;
/// Data ready enabled, MSC_CTRL.
const DATA_READY_ENABLED: u16 = 1 << 2;

/// Size of a count of SUPPLY_OUT, V.
const SUPPLY_LSB: f64 = OutputRegister::Supply.lsb(0.0);

const DIAG_SUPPLY_LOW: u16 = 1 << 0;
const DIAG_SUPPLY_HIGH: u16 = 1 << 1;
const DIAG_FLASH_UPDATE: u16 = 1 << 2;
const DIAG_SELF_TEST: u16 = 1 << 5;
const DIAG_FLASH_CHECKSUM: u16 = 1 << 6;

/// An ADIS16405 that exists only in virtual time.
///
/// Time is the caller's: [`advance_to`](Self::advance_to) moves it, samples appear at the programmed rate. On the bus
/// side a harness calls [`select`](Self::select), [`transfer`](Self::transfer) or
/// [`transfer_byte`](Self::transfer_byte), and [`deselect`](Self::deselect); each acts at [`now`](Self::now). With a
/// known SCK ([`set_sck_hz`](Self::set_sck_hz)) every bit takes its time; without, words take none and the clock is not
/// judged.
#[derive(Clone, Debug)]
pub struct VirtualAdis16405 {
    now_ns: u64,
    next_sample_sixteenths: Option<u64>,
    sampled_at_ns: Option<u64>,
    powered: bool,
    /// What keeps the part busy, and until when.
    activity: Option<(Activity, u64)>,
    sensing: Sensing,
    alarms: Alarms,
    null: Null,
    registers: RegisterFile,
    flash: RegisterFile,
    flash_damaged: bool,
    /// Bits of DIAG_STAT that a self-test raises.
    self_test_failures: u16,
    new_data: [bool; 12],
    diagnosis: u16,
    burst_since_reset: bool,
    samples: u64,
    driven: u16,
    latched_dac: u16,
    wire: Wire,
    record: Record,
}

impl VirtualAdis16405 {
    /// A part just after its start-up, with reset values, at time 0. The same model and seed give the same samples.
    pub fn new(model: NoiseModel, seed: u64) -> Self {
        Self::hiding(&Hidden::default(), model, seed)
    }

    /// The same part with effects that its noise model does not declare.
    pub fn hiding(hidden: &Hidden, model: NoiseModel, seed: u64) -> Self {
        let mut part = Self {
            now_ns: 0,
            next_sample_sixteenths: None,
            sampled_at_ns: None,
            powered: true,
            activity: None,
            sensing: Sensing::new(hidden, &model, seed),
            alarms: Alarms::default(),
            null: Null::default(),
            registers: RegisterFile::reset(),
            flash: RegisterFile::reset(),
            flash_damaged: false,
            self_test_failures: 0,
            new_data: [false; 12],
            diagnosis: 0,
            burst_since_reset: false,
            samples: 0,
            driven: 0,
            latched_dac: 0,
            wire: Wire::new(),
            record: Record::default(),
        };
        part.reset();
        part.restart_sampling(0);
        part
    }

    /// Virtual time in ns.
    pub fn now(&self) -> u64 {
        self.now_ns
    }

    /// Lets time pass until `ns`, taking the samples that fall due. Time never runs backwards: an earlier `ns` does
    /// nothing.
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

    /// When data ready is next raised, in ns; `u64::MAX` if it is switched off, or if the part sleeps or waits for an
    /// external clock (SMPL_PRD = 0).
    pub fn next_data_ready(&self) -> u64 {
        let enabled = self.registers.read(registers::MSC_CTRL) & DATA_READY_ENABLED != 0;
        if enabled { self.next_sample() } else { u64::MAX }
    }

    /// The counts of the latest sample, in the order of a burst; zeros before the first.
    pub fn counts(&self) -> &[i16; 12] {
        self.sensing.counts()
    }

    /// Samples taken since time 0.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// What the controller did wrong, oldest first; the first thousand are kept.
    pub fn violations(&self) -> &[Violation] {
        self.record.violations()
    }

    /// How often the controller did wrong.
    pub fn violation_count(&self) -> u64 {
        self.record.count()
    }

    fn next_sample(&self) -> u64 {
        self.next_sample_sixteenths.map_or(u64::MAX, |sixteenths| sixteenths.div_ceil(16))
    }

    fn low_power(&self) -> bool {
        self.registers.read(registers::SMPL_PRD) > police::NORMAL_MODE_MAX_SMPL_PRD
    }

    /// Starts from what is in flash.
    fn reset(&mut self) {
        self.registers = RegisterFile::reset();
        self.registers.keep(&self.flash);
        self.sensing.forget();
        self.sensing.restart_filters(&self.registers);
        self.alarms.forget();
        self.new_data = [false; 12];
        self.diagnosis = 0;
        self.burst_since_reset = false;
        self.latched_dac = 0;
    }

    fn begin(&mut self, activity: Activity) {
        self.begin_until(activity, self.now_ns + activity.length_ns(self.low_power()));
    }

    fn begin_until(&mut self, activity: Activity, until_ns: u64) {
        self.activity = Some((activity, until_ns));
        self.null = Null::default();
        if !activity.samples() {
            self.next_sample_sixteenths = None;
        }
    }

    /// A low pulse on chip select ends a sleep.
    fn wake(&mut self) {
        if matches!(self.activity, Some((Activity::Sleep, _))) {
            self.begin(Activity::WakeUp);
        }
    }

    /// The end of what kept the part busy.
    fn finish(&mut self) {
        let Some((activity, until_ns)) = self.activity.take() else {
            return;
        };
        let control = self.registers.read(registers::MSC_CTRL);
        self.registers.store(registers::MSC_CTRL, control & !activity.test_bit());
        match activity {
            Activity::SelfTest if self.self_test_failures != 0 => {
                self.diagnosis |= self.self_test_failures | DIAG_SELF_TEST;
            }
            Activity::FlashTest if self.flash_damaged => self.diagnosis |= DIAG_FLASH_CHECKSUM,
            Activity::FlashUpdate if self.flash_damaged => self.diagnosis |= DIAG_FLASH_UPDATE,
            Activity::FlashUpdate => {
                let writes = self.registers.read(registers::FLASH_CNT).wrapping_add(1);
                self.registers.store(registers::FLASH_CNT, writes);
                self.flash.keep(&self.registers);
            }
            Activity::FactoryRestore => self.registers.restore_calibration(),
            Activity::AutoNull | Activity::PrecisionAutoNull => self.null.apply(&mut self.registers),
            Activity::Sleep => self.begin(Activity::WakeUp),
            _ => {}
        }
        if !activity.samples() && activity != Activity::Sleep {
            self.restart_sampling(until_ns);
        }
    }

    /// The first sample comes one period after `from_ns`.
    fn restart_sampling(&mut self, from_ns: u64) {
        let idle = self.activity.is_none_or(|(activity, _)| activity.samples());
        self.next_sample_sixteenths = self.period_sixteenths().filter(|_| idle && self.powered).map(|period| {
            self.sensing.set_sample_period(period as f64 / 16e9);
            from_ns * 16 + period
        });
    }

    fn period_sixteenths(&self) -> Option<u64> {
        let smpl_prd = u64::from(self.registers.read(registers::SMPL_PRD));
        let base = if smpl_prd & 0x80 == 0 { 1 } else { SLOW_TICKS };
        let nominal = (smpl_prd % 0x80 + 1) * base * TICK_SIXTEENTHS;
        (smpl_prd != 0).then(|| (nominal as f64 / self.sensing.clock_ratio()).round() as u64)
    }

    fn take_sample(&mut self) {
        if let (Some(at), Some(period)) = (self.next_sample_sixteenths, self.period_sixteenths()) {
            self.now_ns = self.now_ns.max(at.div_ceil(16));
            self.next_sample_sixteenths = Some(at + period);
            self.sample(at as f64 / 16e9, period as f64 / 16e9);
        }
    }

    fn sample(&mut self, time_s: f64, period_s: f64) {
        if !Setting::of(&self.registers).valid {
            let sens_avg = self.registers.read(registers::SENS_AVG);
            self.record.add(self.now_ns, ViolationKind::Configuration { sens_avg });
        }
        self.sensing.sample(&self.registers, time_s, period_s);
        self.null.add(self.sensing.rates());
        self.new_data = [true; 12];
        self.samples += 1;
        self.sampled_at_ns = Some(self.now_ns);
        let supply = f64::from(self.sensing.counts()[0]) * SUPPLY_LSB;
        if supply < 4.75 {
            self.diagnosis |= DIAG_SUPPLY_LOW;
        } else if supply > 5.25 {
            self.diagnosis |= DIAG_SUPPLY_HIGH;
        }
        self.diagnosis |= self.alarms.observe(&self.registers, self.sensing.counts(), self.sensing.unfiltered());
    }

    /// A sample of the external clock, with the time since the one before as its period.
    fn sample_externally(&mut self) {
        if self.activity.is_some_and(|(activity, _)| !activity.samples()) || !self.powered {
            return;
        }
        let since_ns = self.now_ns - self.sampled_at_ns.unwrap_or(0);
        let period_s = since_ns.max(1) as f64 * 1e-9;
        self.sensing.set_sample_period(period_s);
        self.sample(self.now_ns as f64 * 1e-9, period_s);
    }
}
