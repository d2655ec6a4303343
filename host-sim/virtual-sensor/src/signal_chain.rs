//! The signal chain from sensed values to counts: noise, effects, self-test stimulus, digital filter, corrections,
//! quantization.

use crate::effects::{EffectSource, SensorScenario};
use crate::noise::{NoiseModel, NoiseSource};
use crate::noise_ahead::NoiseAhead;
use crate::registers::{self, OutputRegister, RegisterFile};

/// Size of a count of the gyro offsets, °/s.
const GYRO_OFFSET_LSB: f64 = 0.0125;
/// Size of a count of the acceleration offsets, g.
const ACCL_OFFSET_LSB: f64 = 3.33e-3;
/// Size of a count of the hard-iron corrections, gauss.
const HARD_IRON_LSB: f64 = 0.5e-3;
/// Soft-iron factor of 1, in counts.
const SOFT_IRON_ONE: f64 = 2048.0;
/// Response to the stimulus of the self-test, °/s and g. The values are assumptions: page 15 of the data sheet (Rev. B) refers to Table 1
/// for them, which has none.
const STIMULUS: [(OutputRegister, f64); 6] = [
    (OutputRegister::GyroX, 40.0),
    (OutputRegister::GyroY, 40.0),
    (OutputRegister::GyroZ, 40.0),
    (OutputRegister::AcclX, 0.5),
    (OutputRegister::AcclY, 0.5),
    (OutputRegister::AcclZ, 0.5),
];

/// The signal chain of all channels, with the latest sample. Arrays are in burst order.
#[derive(Clone, Debug)]
pub(crate) struct SignalChain {
    noise: NoiseAhead,
    effects: EffectSource,
    filters: [CascadedBoxFilter; 12],
    counts: [i16; 12],
    unfiltered: [i16; 12],
    rates: [f64; 3],
}

impl SignalChain {
    pub(crate) fn new(scenario: &SensorScenario, model: &NoiseModel, seed: u64) -> Self {
        Self {
            noise: NoiseAhead::new(NoiseSource::new(model, seed, 1.0)),
            effects: EffectSource::new(scenario, seed),
            filters: std::array::from_fn(|_| CascadedBoxFilter::new(0)),
            counts: [0; 12],
            unfiltered: [0; 12],
            rates: [0.0; 3],
        }
    }

    /// The counts of the latest sample; zeros before the first.
    pub(crate) fn counts(&self) -> &[i16; 12] {
        &self.counts
    }

    /// The counts of the latest sample without the digital filter; zeros before the first.
    pub(crate) fn unfiltered(&self) -> &[i16; 12] {
        &self.unfiltered
    }

    /// The filtered rates of the latest sample about x, y and z before the offsets are added, °/s.
    pub(crate) fn rates(&self) -> [f64; 3] {
        self.rates
    }

    /// Sets the latest sample to zeros.
    pub(crate) fn clear(&mut self) {
        self.counts = [0; 12];
        self.unfiltered = [0; 12];
    }

    /// True rate of the part's clock over its nominal rate.
    pub(crate) fn clock_ratio(&self) -> f64 {
        self.effects.clock_ratio()
    }

    /// Changes the time between samples, s.
    pub(crate) fn set_sample_period(&mut self, seconds: f64) {
        self.noise.set_sample_period(seconds);
    }

    /// Restarts the filters with the number of taps that SENS_AVG selects.
    pub(crate) fn restart_filters(&mut self, registers: &RegisterFile) {
        let taps = SensAvg::decode(registers).taps_log2;
        self.filters = std::array::from_fn(|_| CascadedBoxFilter::new(taps));
    }

    /// Takes the sample at `time_s`, with the sensors deflected by `stimulus`. Outputs that are not inertial keep their counts unless
    /// `slow_due`. The random numbers do not depend on the registers.
    pub(crate) fn sample(
        &mut self,
        registers: &RegisterFile,
        stimulus: Option<Stimulus>,
        time_s: f64,
        period_s: f64,
        slow_due: bool,
    ) {
        let mut values = self.noise.sample();
        self.effects.disturb(&mut values, time_s, period_s);
        if let Some(stimulus) = stimulus {
            stimulate(&mut values, stimulus);
        }
        let repeated = self.effects.repeats_sample();
        let gyro_lsb = SensAvg::decode(registers).gyro_lsb;
        for (index, channel) in OutputRegister::ALL.into_iter().enumerate() {
            let unfiltered = values[index];
            let sensed = if has_filter(channel) { self.filters[index].filter(unfiltered) } else { unfiltered };
            if let Some(rate) =
                index.checked_sub(OutputRegister::GyroX as usize).and_then(|axis| self.rates.get_mut(axis))
            {
                *rate = sensed;
            }
            let value = self.effects.digitize(channel, correct(registers, channel, sensed), period_s);
            if !repeated && (slow_due || OutputRegister::INERTIAL.contains(&channel)) {
                self.counts[index] = quantize(channel, gyro_lsb, value);
                self.unfiltered[index] = quantize(channel, gyro_lsb, correct(registers, channel, unfiltered));
            }
        }
    }
}

/// The count of `value`, limited to the field of the output.
fn quantize(channel: OutputRegister, gyro_lsb: f64, value: f64) -> i16 {
    let (low, high) = channel.limits();
    let counts = ((value - channel.zero()) / channel.lsb(gyro_lsb)).round();
    counts.clamp(f64::from(low), f64::from(high)) as i16
}

/// The force that a self-test applies to the sensors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stimulus {
    /// The force acts on gyros and accelerometers.
    Positive,
    /// The force acts on gyros: Table 22 of the data sheet (Rev. B) names no other sensors.
    NegativeGyros,
}

impl Stimulus {
    /// The stimulus of the manual self-test, MSC_CTRL bits 8 and 9.
    pub(crate) fn manual(registers: &RegisterFile) -> Option<Self> {
        match registers.read(registers::MSC_CTRL) >> 8 & 0b11 {
            0b01 => Some(Self::Positive),
            0b10 => Some(Self::NegativeGyros),
            _ => None,
        }
    }
}

/// Adds the response to a stimulus. By the text of Table 22 the output of a gyro rises with the negative stimulus and
/// falls with the positive one. The sign here is that of the stimulus.
fn stimulate(values: &mut [f64; 12], stimulus: Stimulus) {
    for (channel, response) in STIMULUS {
        match stimulus {
            Stimulus::Positive => values[channel as usize] += response,
            Stimulus::NegativeGyros if OutputRegister::GYROS.contains(&channel) => values[channel as usize] -= response,
            Stimulus::NegativeGyros => {}
        }
    }
}

/// Applies the offset, hard-iron and soft-iron registers.
fn correct(registers: &RegisterFile, channel: OutputRegister, value: f64) -> f64 {
    let axis = |first: OutputRegister, address: u8| address + 2 * (channel as u8 - first as u8);
    match channel {
        OutputRegister::GyroX | OutputRegister::GyroY | OutputRegister::GyroZ => {
            value + GYRO_OFFSET_LSB * registers.read_signed(axis(OutputRegister::GyroX, registers::XGYRO_OFF))
        }
        OutputRegister::AcclX | OutputRegister::AcclY | OutputRegister::AcclZ => {
            value + ACCL_OFFSET_LSB * registers.read_signed(axis(OutputRegister::AcclX, registers::XACCL_OFF))
        }
        OutputRegister::MagnX | OutputRegister::MagnY | OutputRegister::MagnZ => {
            let soft = f64::from(registers.read(axis(OutputRegister::MagnX, registers::XMAGN_SIF))) / SOFT_IRON_ONE;
            soft * value + HARD_IRON_LSB * registers.read_signed(axis(OutputRegister::MagnX, registers::XMAGN_HIF))
        }
        OutputRegister::Supply | OutputRegister::Temp | OutputRegister::AuxAdc => value,
    }
}

fn has_filter(channel: OutputRegister) -> bool {
    !matches!(channel, OutputRegister::Supply | OutputRegister::Temp | OutputRegister::AuxAdc)
}

/// The digital filter of one channel: two cascaded averages of N = 2^M samples each, and a delay of one sample. Together they are the
/// Bartlett window of 2N + 1 taps, whose first and last tap are 0, with a phase of N samples (data sheet Rev. B, Figure 15).
#[derive(Clone, Debug)]
pub struct CascadedBoxFilter {
    stages: [MovingAverage; 2],
    /// The output for the next sample.
    due: Option<f64>,
}

impl CascadedBoxFilter {
    /// `taps_log2` is M, 0 to 6 in the part; with M = 0 the filter only delays.
    pub fn new(taps_log2: u8) -> Self {
        let stage = MovingAverage { window: vec![0.0; 1 << taps_log2], position: 0, filled: false };
        Self { stages: [stage.clone(), stage], due: None }
    }

    /// Filters one value. The first value also stands for all earlier ones, so there is no transient from zero.
    pub fn filter(&mut self, value: f64) -> f64 {
        let [first, second] = &mut self.stages;
        let filtered = second.push(first.push(value));
        self.due.replace(filtered).unwrap_or(filtered)
    }
}

#[derive(Clone, Debug)]
struct MovingAverage {
    window: Vec<f64>,
    position: usize,
    filled: bool,
}

impl MovingAverage {
    fn push(&mut self, value: f64) -> f64 {
        if !self.filled {
            self.window.fill(value);
            self.filled = true;
        }
        self.window[self.position] = value;
        self.position = (self.position + 1) % self.window.len();
        // The sum is computed for each sample: the rounding errors of a running sum would grow over a long simulation.
        self.window.iter().sum::<f64>() / self.window.len() as f64
    }
}

/// SENS_AVG: gyro range and filter.
pub(crate) struct SensAvg {
    /// Size of a count of the gyros, °/s.
    pub(crate) gyro_lsb: f64,
    /// M, 0 to 6.
    pub(crate) taps_log2: u8,
    /// False if the range does not exist or has fewer taps than it needs.
    pub(crate) valid: bool,
}

impl SensAvg {
    /// Decodes the register. No source tells what a real part does at an invalid setting; here the range is ±300 °/s
    /// and the taps are at most 2⁶.
    pub(crate) fn decode(registers: &RegisterFile) -> Self {
        let sens_avg = registers.read(registers::SENS_AVG);
        let taps = (sens_avg & 0b111) as u8;
        let gyro_lsb = match sens_avg >> 8 {
            0b010 => 0.025,
            0b001 => 0.0125,
            _ => 0.05,
        };
        let valid = Self::least_taps_log2(sens_avg).is_some_and(|least| (least..=6).contains(&taps));
        Self { gyro_lsb, taps_log2: taps.min(6), valid }
    }

    /// The smallest M that the range of a SENS_AVG value allows (data sheet Rev. B, Table 17); `None` if there is no
    /// such range.
    pub(crate) fn least_taps_log2(sens_avg: u16) -> Option<u8> {
        match sens_avg >> 8 {
            0b100 => Some(0),
            0b010 => Some(2),
            0b001 => Some(4),
            _ => None,
        }
    }
}

/// Sum of the gyro rates during an auto-null.
#[derive(Clone, Debug, Default)]
pub(crate) struct AutoNull {
    sum: [f64; 3],
    samples: f64,
}

impl AutoNull {
    pub(crate) fn add(&mut self, rates: [f64; 3]) {
        for (sum, rate) in self.sum.iter_mut().zip(rates) {
            *sum += rate;
        }
        self.samples += 1.0;
    }

    /// Sets the gyro offsets to minus the mean rates. Without a sample they stay.
    pub(crate) fn apply(&self, registers: &mut RegisterFile) {
        if self.samples > 0.0 {
            for (address, sum) in (registers::XGYRO_OFF..).step_by(2).zip(self.sum) {
                let offset = -(sum / self.samples / GYRO_OFFSET_LSB).round();
                registers.store(address, offset.clamp(-4096.0, 4095.0) as i16 as u16);
            }
        }
    }
}
