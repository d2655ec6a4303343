//! The virtual part: time and samples on one side, the SPI protocol on the other.

use adis16405_driver::{Channel, Counts, GyroRange};

use super::effect::{EffectSource, Hidden};
use super::filter::Bartlett;
use super::noise::{NoiseModel, NoiseSource};
use super::police::{self, Record, Violation, ViolationKind};
use super::registers::{self, RegisterFile};

/// One tick of the sample clock, 1/1638.4 s, in sixteenths of a ns: an integer, so that samples never drift.
const TICK_SIXTEENTHS: u64 = 9_765_625;
/// Ticks in the slow time base of SMPL_PRD, 18.921 ms.
const SLOW_TICKS: u64 = 31;
/// From a software reset until the part answers, ns.
const RESET_RECOVERY_NS: u64 = 100_000_000;
/// What the part sends where its answer is not defined (after a write, a reset, a burst).
const UNDEFINED: u16 = 0xA5A5;

const NEW_DATA: u16 = 0x8000;
const ERROR_ALARM: u16 = 0x4000;
const DIAG_SUPPLY_LOW: u16 = 1 << 0;
const DIAG_SUPPLY_HIGH: u16 = 1 << 1;
const DIAG_SPI: u16 = 1 << 3;

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
    busy_until_ns: u64,
    noise: NoiseSource,
    hidden: EffectSource,
    filters: [Bartlett; 12],
    registers: RegisterFile,
    counts: [i16; 12],
    new_data: [bool; 12],
    diagnosis: u16,
    samples: u64,
    sck_hz: Option<u32>,
    selected: bool,
    selected_bytes: usize,
    upper_byte: Option<u8>,
    outgoing: u16,
    reply: u16,
    burst: Option<Burst>,
    last_word_end_ns: Option<u64>,
    record: Record,
}

/// A burst read under way.
#[derive(Clone, Debug)]
struct Burst {
    words: [u16; 12],
    next: usize,
}

impl VirtualAdis16405 {
    /// A part just after its start-up, with reset values, at time 0. The same model and seed give the same samples.
    pub fn new(model: NoiseModel, seed: u64) -> Self {
        Self::hiding(&Hidden::default(), model, seed)
    }

    /// The same part with effects that its noise model does not declare.
    pub fn hiding(hidden: &Hidden, model: NoiseModel, seed: u64) -> Self {
        let registers = RegisterFile::reset();
        let taps = setting(registers.read(registers::SENS_AVG)).taps_log2;
        let mut part = Self {
            now_ns: 0,
            next_sample_sixteenths: None,
            busy_until_ns: 0,
            noise: NoiseSource::new(&model, seed, 1.0),
            hidden: EffectSource::new(hidden, seed),
            filters: std::array::from_fn(|_| Bartlett::new(taps)),
            registers,
            counts: [0; 12],
            new_data: [false; 12],
            diagnosis: 0,
            samples: 0,
            sck_hz: None,
            selected: false,
            selected_bytes: 0,
            upper_byte: None,
            outgoing: UNDEFINED,
            reply: UNDEFINED,
            burst: None,
            last_word_end_ns: None,
            record: Record::default(),
        };
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
        while self.next_data_ready() <= ns {
            self.take_sample();
        }
        self.now_ns = self.now_ns.max(ns);
    }

    /// When the next sample comes, in ns; `u64::MAX` if the part waits for an external clock (SMPL_PRD = 0).
    pub fn next_data_ready(&self) -> u64 {
        self.next_sample_sixteenths.map_or(u64::MAX, |sixteenths| sixteenths.div_ceil(16))
    }

    /// The counts of the latest sample; zeros before the first.
    pub fn counts(&self) -> Counts {
        Counts::new(self.counts)
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

    /// SCK in Hz; `None` if the words take no time and the clock is not to be judged.
    pub fn set_sck_hz(&mut self, sck_hz: Option<u32>) {
        self.sck_hz = sck_hz.map(|hz| hz.max(1));
    }

    /// Chip select falls.
    pub fn select(&mut self) {
        self.selected = true;
        self.selected_bytes = 0;
        self.upper_byte = None;
    }

    /// Chip select rises. A burst or a frame that is not complete is lost.
    pub fn deselect(&mut self) {
        if self.upper_byte.take().is_some() {
            self.diagnosis |= DIAG_SPI;
            self.record.add(self.now_ns, ViolationKind::FrameLength { bytes: self.selected_bytes });
        } else if self.burst.is_some() {
            self.record.add(self.now_ns, ViolationKind::FrameLength { bytes: self.selected_bytes });
        }
        self.burst = None;
        self.selected = false;
    }

    /// Exchanges one 16-bit word.
    pub fn transfer(&mut self, word: u16) -> u16 {
        u16::from_be_bytes(word.to_be_bytes().map(|byte| self.transfer_byte(byte)))
    }

    /// Exchanges half a word, the upper byte first.
    pub fn transfer_byte(&mut self, byte: u8) -> u8 {
        if !self.selected {
            self.record.add(self.now_ns, ViolationKind::NotSelected);
            return 0xFF;
        }
        if self.upper_byte.is_none() {
            self.begin_word();
        }
        self.selected_bytes += 1;
        if let Some(sck_hz) = self.sck_hz {
            self.advance_to(self.now_ns + 8_000_000_000u64.div_ceil(u64::from(sck_hz)));
        }
        let [upper, lower] = self.outgoing.to_be_bytes();
        match self.upper_byte.take() {
            None => {
                self.upper_byte = Some(byte);
                upper
            }
            Some(first) => {
                self.end_word(u16::from_be_bytes([first, byte]));
                lower
            }
        }
    }

    fn begin_word(&mut self) {
        let low_power = self.registers.read(registers::SMPL_PRD) > police::NORMAL_MODE_MAX_SMPL_PRD;
        let (least_ns, most_hz) = match (low_power, &self.burst) {
            (true, _) => (police::MIN_STALL_LOW_POWER_NS, police::MAX_SCK_LOW_POWER_HZ),
            (false, None) => (police::MIN_STALL_NORMAL_NS, police::MAX_SCK_NORMAL_HZ),
            (false, Some(_)) => (police::MIN_STALL_NORMAL_NS, police::MAX_SCK_BURST_HZ),
        };
        if let (None, Some(end_ns)) = (&self.burst, self.last_word_end_ns) {
            let stall_ns = self.now_ns - end_ns;
            if stall_ns < least_ns {
                self.record.add(self.now_ns, ViolationKind::Stall { stall_ns, least_ns });
            }
        }
        if let Some(sck_hz) = self.sck_hz.filter(|hz| *hz > most_hz) {
            self.record.add(self.now_ns, ViolationKind::Clock { sck_hz, most_hz });
        }
        if self.now_ns < self.busy_until_ns {
            self.record.add(self.now_ns, ViolationKind::Busy);
        }
        self.outgoing = match &self.burst {
            Some(burst) => burst.words[burst.next],
            None => self.reply,
        };
    }

    fn end_word(&mut self, word: u16) {
        self.last_word_end_ns = Some(self.now_ns);
        match &mut self.burst {
            Some(burst) => {
                burst.next += 1;
                if burst.next == burst.words.len() {
                    self.burst = None;
                }
            }
            None if self.now_ns < self.busy_until_ns => self.reply = 0,
            None => self.execute(word),
        }
    }

    fn execute(&mut self, word: u16) {
        let [upper, lower] = word.to_be_bytes();
        let address = upper & 0x7F;
        self.reply = UNDEFINED;
        if upper & 0x80 != 0 {
            self.write(address, lower);
        } else if address & 0x7E == registers::GLOB_CMD {
            let words = std::array::from_fn(|index| self.read_output(index));
            self.burst = Some(Burst { words, next: 0 });
        } else {
            self.reply = self.read(address & 0x7E);
        }
    }

    fn read(&mut self, address: u8) -> u16 {
        match address {
            registers::SUPPLY_OUT..=registers::AUX_ADC => {
                self.read_output(usize::from((address - registers::SUPPLY_OUT) / 2))
            }
            registers::DIAG_STAT => std::mem::take(&mut self.diagnosis),
            _ => self.registers.read(address),
        }
    }

    fn read_output(&mut self, index: usize) -> u16 {
        let field = self.counts[index] as u16 & (u16::MAX >> (16 - Channel::ALL[index].bits()));
        let new_data = std::mem::take(&mut self.new_data[index]);
        let flag = |set, bit| if set { bit } else { 0 };
        field | flag(new_data, NEW_DATA) | flag(self.diagnosis != 0, ERROR_ALARM)
    }

    fn write(&mut self, address: u8, byte: u8) {
        if address == registers::GLOB_CMD {
            if byte & 0x80 != 0 {
                self.software_reset();
            }
            return;
        }
        let settings =
            |registers: &RegisterFile| (registers.read(registers::SENS_AVG), registers.read(registers::SMPL_PRD));
        let (sens_avg, smpl_prd) = settings(&self.registers);
        self.registers.write(address, byte);
        let (new_sens_avg, new_smpl_prd) = settings(&self.registers);
        if new_sens_avg != sens_avg {
            self.restart_filters();
        }
        if new_smpl_prd != smpl_prd {
            self.restart_sampling(self.now_ns);
        }
    }

    fn software_reset(&mut self) {
        self.registers = RegisterFile::reset();
        self.counts = [0; 12];
        self.new_data = [false; 12];
        self.diagnosis = 0;
        self.busy_until_ns = self.now_ns + RESET_RECOVERY_NS;
        self.restart_filters();
        self.restart_sampling(self.busy_until_ns);
    }

    fn restart_filters(&mut self) {
        let taps = setting(self.registers.read(registers::SENS_AVG)).taps_log2;
        self.filters = std::array::from_fn(|_| Bartlett::new(taps));
    }

    /// The first sample comes one period after `from_ns`.
    fn restart_sampling(&mut self, from_ns: u64) {
        self.next_sample_sixteenths = self.period_sixteenths().map(|period| {
            self.noise.set_sample_period(period as f64 / 16e9);
            from_ns * 16 + period
        });
    }

    fn period_sixteenths(&self) -> Option<u64> {
        let smpl_prd = u64::from(self.registers.read(registers::SMPL_PRD));
        let base = if smpl_prd & 0x80 == 0 { 1 } else { SLOW_TICKS };
        let nominal = (smpl_prd % 0x80 + 1) * base * TICK_SIXTEENTHS;
        (smpl_prd != 0).then(|| (nominal as f64 / self.hidden.clock_ratio()).round() as u64)
    }

    fn take_sample(&mut self) {
        let (Some(at), Some(period)) = (self.next_sample_sixteenths, self.period_sixteenths()) else {
            return;
        };
        self.now_ns = self.now_ns.max(at.div_ceil(16));
        self.next_sample_sixteenths = Some(at + period);
        let sens_avg = self.registers.read(registers::SENS_AVG);
        let Setting { range, valid, .. } = setting(sens_avg);
        if !valid {
            self.record.add(self.now_ns, ViolationKind::Configuration { sens_avg });
        }
        let (time_s, period_s) = (at as f64 / 16e9, period as f64 / 16e9);
        let mut values = self.noise.sample();
        self.hidden.disturb(&mut values, time_s, period_s);
        let stale = self.hidden.stale();
        for (index, channel) in Channel::ALL.into_iter().enumerate() {
            let sensed = if filtered(channel) { self.filters[index].filter(values[index]) } else { values[index] };
            let value = self.hidden.digitize(channel, self.corrected(channel, sensed), period_s);
            if stale {
                continue;
            }
            let (low, high) = channel.limits();
            let counts = ((value - channel.zero()) / channel.lsb(range)).round();
            self.counts[index] = counts.clamp(f64::from(low), f64::from(high)) as i16;
        }
        self.new_data = [true; 12];
        self.samples += 1;
        let supply = f64::from(self.counts[0]) * Channel::Supply.lsb(range);
        if supply < 4.75 {
            self.diagnosis |= DIAG_SUPPLY_LOW;
        } else if supply > 5.25 {
            self.diagnosis |= DIAG_SUPPLY_HIGH;
        }
    }

    /// Applies the offset, hard-iron and soft-iron registers.
    fn corrected(&self, channel: Channel, value: f64) -> f64 {
        let axis = |first: Channel, address: u8| address + 2 * (channel as u8 - first as u8);
        match channel {
            Channel::GyroX | Channel::GyroY | Channel::GyroZ => {
                value + 0.0125 * self.registers.signed(axis(Channel::GyroX, registers::XGYRO_OFF))
            }
            Channel::AcclX | Channel::AcclY | Channel::AcclZ => {
                value + 3.33e-3 * self.registers.signed(axis(Channel::AcclX, registers::XACCL_OFF))
            }
            Channel::MagnX | Channel::MagnY | Channel::MagnZ => {
                let soft = f64::from(self.registers.read(axis(Channel::MagnX, registers::XMAGN_SIF))) / 2048.0;
                soft * value + 0.5e-3 * self.registers.signed(axis(Channel::MagnX, registers::XMAGN_HIF))
            }
            Channel::Supply | Channel::Temp | Channel::AuxAdc => value,
        }
    }
}

/// SENS_AVG in meanings.
struct Setting {
    range: GyroRange,
    taps_log2: u8,
    valid: bool,
}

/// What the part makes of SENS_AVG. What it does with a setting that is not valid is not known; ±300 °/s and at most 2⁶
/// taps are taken.
fn setting(sens_avg: u16) -> Setting {
    let taps = (sens_avg & 0b111) as u8;
    let (range, least) = match sens_avg >> 8 {
        0b100 => (GyroRange::Dps300, 0),
        0b010 => (GyroRange::Dps150, 2),
        0b001 => (GyroRange::Dps75, 4),
        _ => (GyroRange::Dps300, u8::MAX),
    };
    Setting { range, taps_log2: taps.min(6), valid: (least..=6).contains(&taps) }
}

fn filtered(channel: Channel) -> bool {
    !matches!(channel, Channel::Supply | Channel::Temp | Channel::AuxAdc)
}
