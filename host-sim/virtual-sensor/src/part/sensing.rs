//! From physics to counts: noise, hidden effects, self-test stimulus, filter, corrections, quantization.

use crate::output::OutputRegister;

use crate::effect::{EffectSource, Hidden};
use crate::filter::Bartlett;
use crate::noise::{NoiseModel, NoiseSource};
use crate::registers::{self, RegisterFile};

/// Size of a count of the gyro offsets, °/s.
const GYRO_OFFSET_LSB: f64 = 0.0125;
/// What the manual self-test moves, °/s and g. No source tells how much a real part moves.
const STIMULUS: [(OutputRegister, f64); 6] = [
    (OutputRegister::GyroX, 40.0),
    (OutputRegister::GyroY, 40.0),
    (OutputRegister::GyroZ, 40.0),
    (OutputRegister::AcclX, 0.5),
    (OutputRegister::AcclY, 0.5),
    (OutputRegister::AcclZ, 0.5),
];

/// The sensors and what makes numbers of them.
#[derive(Clone, Debug)]
pub(super) struct Sensing {
    noise: NoiseSource,
    hidden: EffectSource,
    filters: [Bartlett; 12],
    counts: [i16; 12],
    unfiltered: [i16; 12],
    rates: [f64; 3],
}

impl Sensing {
    pub(super) fn new(hidden: &Hidden, model: &NoiseModel, seed: u64) -> Self {
        Self {
            noise: NoiseSource::new(model, seed, 1.0),
            hidden: EffectSource::new(hidden, seed),
            filters: std::array::from_fn(|_| Bartlett::new(0)),
            counts: [0; 12],
            unfiltered: [0; 12],
            rates: [0.0; 3],
        }
    }

    /// The latest sample; zeros before the first.
    pub(super) fn counts(&self) -> &[i16; 12] {
        &self.counts
    }

    /// The latest sample as it would be without the digital filter.
    pub(super) fn unfiltered(&self) -> &[i16; 12] {
        &self.unfiltered
    }

    /// The latest rates before the offsets are added, °/s.
    pub(super) fn rates(&self) -> [f64; 3] {
        self.rates
    }

    pub(super) fn forget(&mut self) {
        self.counts = [0; 12];
        self.unfiltered = [0; 12];
    }

    /// True rate of the part's clock over its nominal rate.
    pub(super) fn clock_ratio(&self) -> f64 {
        self.hidden.clock_ratio()
    }

    pub(super) fn set_sample_period(&mut self, seconds: f64) {
        self.noise.set_sample_period(seconds);
    }

    pub(super) fn restart_filters(&mut self, registers: &RegisterFile) {
        let taps = Setting::of(registers).taps_log2;
        self.filters = std::array::from_fn(|_| Bartlett::new(taps));
    }

    /// Takes the sample at `time_s`. The same random numbers are drawn whatever the registers say.
    pub(super) fn sample(&mut self, registers: &RegisterFile, time_s: f64, period_s: f64) {
        let mut values = self.noise.sample();
        self.hidden.disturb(&mut values, time_s, period_s);
        stimulate(&mut values, registers);
        let stale = self.hidden.stale();
        let gyro_lsb = Setting::of(registers).gyro_lsb;
        for (index, channel) in OutputRegister::ALL.into_iter().enumerate() {
            let direct = values[index];
            let sensed = if filtered(channel) { self.filters[index].filter(direct) } else { direct };
            if let Some(rate) =
                index.checked_sub(OutputRegister::GyroX as usize).and_then(|axis| self.rates.get_mut(axis))
            {
                *rate = sensed;
            }
            let value = self.hidden.digitize(channel, corrected(registers, channel, sensed), period_s);
            if !stale {
                self.counts[index] = quantized(channel, gyro_lsb, value);
                self.unfiltered[index] = quantized(channel, gyro_lsb, corrected(registers, channel, direct));
            }
        }
    }
}

fn quantized(channel: OutputRegister, gyro_lsb: f64, value: f64) -> i16 {
    let (low, high) = channel.limits();
    let counts = ((value - channel.zero()) / channel.lsb(gyro_lsb)).round();
    counts.clamp(f64::from(low), f64::from(high)) as i16
}

/// MSC_CTRL bit 8 deflects the sensors one way, bit 9 the other.
fn stimulate(values: &mut [f64; 12], registers: &RegisterFile) {
    let sign = match registers.read(registers::MSC_CTRL) >> 8 & 0b11 {
        0b01 => 1.0,
        0b10 => -1.0,
        _ => return,
    };
    for (channel, response) in STIMULUS {
        values[channel as usize] += sign * response;
    }
}

/// Applies the offset, hard-iron and soft-iron registers.
fn corrected(registers: &RegisterFile, channel: OutputRegister, value: f64) -> f64 {
    let axis = |first: OutputRegister, address: u8| address + 2 * (channel as u8 - first as u8);
    match channel {
        OutputRegister::GyroX | OutputRegister::GyroY | OutputRegister::GyroZ => {
            value + GYRO_OFFSET_LSB * registers.signed(axis(OutputRegister::GyroX, registers::XGYRO_OFF))
        }
        OutputRegister::AcclX | OutputRegister::AcclY | OutputRegister::AcclZ => {
            value + 3.33e-3 * registers.signed(axis(OutputRegister::AcclX, registers::XACCL_OFF))
        }
        OutputRegister::MagnX | OutputRegister::MagnY | OutputRegister::MagnZ => {
            let soft = f64::from(registers.read(axis(OutputRegister::MagnX, registers::XMAGN_SIF))) / 2048.0;
            soft * value + 0.5e-3 * registers.signed(axis(OutputRegister::MagnX, registers::XMAGN_HIF))
        }
        OutputRegister::Supply | OutputRegister::Temp | OutputRegister::AuxAdc => value,
    }
}

fn filtered(channel: OutputRegister) -> bool {
    !matches!(channel, OutputRegister::Supply | OutputRegister::Temp | OutputRegister::AuxAdc)
}

/// SENS_AVG in meanings.
pub(super) struct Setting {
    /// Size of a count of the gyros, °/s.
    pub(super) gyro_lsb: f64,
    pub(super) taps_log2: u8,
    pub(super) valid: bool,
}

impl Setting {
    /// What the part makes of SENS_AVG. What it does with a setting that is not valid is not known; ±300 °/s and at most
    /// 2⁶ taps are taken.
    pub(super) fn of(registers: &RegisterFile) -> Self {
        let sens_avg = registers.read(registers::SENS_AVG);
        let taps = (sens_avg & 0b111) as u8;
        let (gyro_lsb, least) = match sens_avg >> 8 {
            0b100 => (0.05, 0),
            0b010 => (0.025, 2),
            0b001 => (0.0125, 4),
            _ => (0.05, u8::MAX),
        };
        Self { gyro_lsb, taps_log2: taps.min(6), valid: (least..=6).contains(&taps) }
    }
}

/// The gyro rates summed while the part nulls its offsets.
#[derive(Clone, Debug, Default)]
pub(super) struct Null {
    sum: [f64; 3],
    samples: f64,
}

impl Null {
    pub(super) fn add(&mut self, rates: [f64; 3]) {
        for (sum, rate) in self.sum.iter_mut().zip(rates) {
            *sum += rate;
        }
        self.samples += 1.0;
    }

    /// Sets the offsets so that the mean becomes zero; without a sample they stay.
    pub(super) fn apply(&self, registers: &mut RegisterFile) {
        if self.samples > 0.0 {
            for (address, sum) in (registers::XGYRO_OFF..).step_by(2).zip(self.sum) {
                let offset = -(sum / self.samples / GYRO_OFFSET_LSB).round();
                registers.store(address, offset.clamp(-4096.0, 4095.0) as i16 as u16);
            }
        }
    }
}
