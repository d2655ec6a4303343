//! The Analog Devices ADIS16405, from its data sheet (Rev. B).

use allan_core::term::MovingAverageFilter;

use crate::profile::{
    ChannelProfile, DITHERED_AVAR_COUNTS2, DataSheetDeviation, DataSheetNoise, DataSheetSensitivities,
    HOST_CLOCK_ERROR, LARGEST_SENSITIVITY_MULTIPLE, Quantity, SAMPLE_RATE_ERROR, SensorProfile,
};

/// Sample clock after reset (SMPL_PRD = 0x0001), Hz.
const INTERNAL_RATE_HZ: f64 = 819.2;
/// Time base of the sample period, Hz; the slow one is 31 of its periods.
const TIME_BASE_HZ: f64 = 1638.4;
const SLOW_TIME_BASE: u32 = 31;
/// Initial bias errors (1 σ): of gyroscopes in deg/s, of accelerometers in g.
const GYRO_BIAS: f64 = 3.0;
const ACCELEROMETER_BIAS: f64 = 0.05;
const ACCELEROMETER_LSB: f64 = 3.33e-3;
const MAGNETOMETER_LSB: f64 = 0.5e-3;
/// Largest count of a 14-bit register.
const FULL_SCALE_COUNTS: f64 = 8191.0;
/// Noise of a gyroscope: 2 °/√h; 0.007 °/s.
const GYRO_NOISE: DataSheetNoise = DataSheetNoise {
    angle_random_walk: Some(2.0 / 60.0),
    in_run_bias_stability: Some(0.007),
    rate_random_walk: None,
    curve: &GYRO_CURVE,
};
/// Noise of an accelerometer: 0.2 m/s/√h in g·√s; 0.2 mg.
const ACCELEROMETER_NOISE: DataSheetNoise = DataSheetNoise {
    angle_random_walk: Some(0.2 / 60.0 / 9.806_65),
    in_run_bias_stability: Some(0.2e-3),
    rate_random_walk: None,
    curve: &ACCELEROMETER_CURVE,
};
/// Noise of a magnetometer: 0.066 mgauss/√Hz.
const MAGNETOMETER_NOISE: DataSheetNoise = DataSheetNoise {
    angle_random_walk: Some(0.066e-3),
    in_run_bias_stability: None,
    rate_random_walk: None,
    curve: &[],
};

const fn deviation(tau_s: f64, mean: f64, low: f64, high: f64) -> DataSheetDeviation {
    DataSheetDeviation { tau_s, mean, low, high }
}

/// Curve of Figure 7, page 9: mean and ±1 σ over parts, °/s, at the corners of the drawn lines.
const GYRO_CURVE: [DataSheetDeviation; 18] = [
    deviation(0.1, 0.0937, 0.0879, 0.099),
    deviation(1.0, 0.0312, 0.0292, 0.033),
    deviation(2.0, 0.0224, 0.021, 0.0237),
    deviation(3.0, 0.0188, 0.0176, 0.0199),
    deviation(5.0, 0.0149, 0.0142, 0.0157),
    deviation(7.0, 0.0129, 0.0124, 0.0135),
    deviation(10.0, 0.0111, 0.0106, 0.0118),
    deviation(20.0, 0.00867, 0.0082, 0.0091),
    deviation(30.0, 0.00758, 0.00704, 0.00802),
    deviation(50.0, 0.00676, 0.00635, 0.00722),
    deviation(70.0, 0.0064, 0.006, 0.00682),
    deviation(100.0, 0.00619, 0.00576, 0.00666),
    deviation(200.0, 0.00605, 0.00511, 0.00704),
    deviation(300.0, 0.00644, 0.00527, 0.00764),
    deviation(500.0, 0.00676, 0.00487, 0.00867),
    deviation(700.0, 0.00671, 0.00435, 0.0091),
    deviation(1000.0, 0.00699, 0.00456, 0.00948),
    deviation(2000.0, 0.0082, 0.00431, 0.0122),
];
/// Curve of Figure 8, page 9: mean and ±1 σ over parts, g. The mean has no corner from 3 to 9 s.
const ACCELEROMETER_CURVE: [DataSheetDeviation; 17] = [
    deviation(0.1, 912.0e-6, 856.0e-6, 974.0e-6),
    deviation(1.0, 351.0e-6, 311.0e-6, 393.0e-6),
    deviation(2.0, 284.0e-6, 242.0e-6, 326.0e-6),
    deviation(3.0, 260.0e-6, 217.0e-6, 306.0e-6),
    deviation(9.0, 222.0e-6, 184.0e-6, 258.0e-6),
    deviation(10.0, 217.0e-6, 179.0e-6, 256.0e-6),
    deviation(20.0, 208.0e-6, 169.0e-6, 248.0e-6),
    deviation(30.0, 208.0e-6, 172.0e-6, 244.0e-6),
    deviation(50.0, 217.0e-6, 173.0e-6, 260.0e-6),
    deviation(70.0, 227.0e-6, 183.0e-6, 271.0e-6),
    deviation(100.0, 236.0e-6, 198.0e-6, 276.0e-6),
    deviation(200.0, 258.0e-6, 215.0e-6, 304.0e-6),
    deviation(300.0, 269.0e-6, 204.0e-6, 334.0e-6),
    deviation(500.0, 265.0e-6, 189.0e-6, 342.0e-6),
    deviation(700.0, 256.0e-6, 189.0e-6, 324.0e-6),
    deviation(1000.0, 271.0e-6, 189.0e-6, 351.0e-6),
    deviation(2000.0, 278.0e-6, 213.0e-6, 342.0e-6),
];
/// Sensitivities of a gyroscope: 0.01 °/s/°C, 0.32 °/s/V, 0.05 °/s/g.
const GYRO_SENSITIVITIES: DataSheetSensitivities =
    DataSheetSensitivities { temperature: Some(0.01), supply: Some(0.32), specific_force: Some(0.05) };
/// Name of the part.
pub const NAME: &str = "ADIS16405";
/// Size of a gyroscope's count in the largest range, 300 deg/s: deg/s.
pub const GYRO_LSB_300: f64 = 0.05;

/// The profile of the sensor; `gyro_lsb` is a gyroscope's count in deg/s: 0.05, 0.025 or 0.0125.
#[must_use]
pub fn profile(gyro_lsb: f64) -> SensorProfile {
    let channel = |name, quantity, axis, unit, lsb, initial_bias_error| ChannelProfile {
        name,
        quantity,
        axis,
        unit,
        lsb,
        initial_bias_error,
        range: None,
        data_sheet: DataSheetNoise::default(),
        sensitivities: DataSheetSensitivities::default(),
    };
    // The full scale is the range of 14 bits, not the specified range.
    let full_scale = |lsb: f64| Some(lsb * FULL_SCALE_COUNTS);
    let gyro = |name, axis| ChannelProfile {
        range: full_scale(gyro_lsb),
        data_sheet: GYRO_NOISE,
        sensitivities: GYRO_SENSITIVITIES,
        ..channel(name, Quantity::AngularRate, axis, "deg/s", gyro_lsb, Some(GYRO_BIAS))
    };
    let accelerometer = |name, axis| ChannelProfile {
        range: full_scale(ACCELEROMETER_LSB),
        data_sheet: ACCELEROMETER_NOISE,
        ..channel(name, Quantity::SpecificForce, axis, "g", ACCELEROMETER_LSB, Some(ACCELEROMETER_BIAS))
    };
    let magnetometer = |name, axis| ChannelProfile {
        range: full_scale(MAGNETOMETER_LSB),
        data_sheet: MAGNETOMETER_NOISE,
        ..channel(name, Quantity::MagneticField, axis, "gauss", MAGNETOMETER_LSB, None)
    };
    SensorProfile {
        name: NAME,
        channels: vec![
            channel("supply", Quantity::SupplyVoltage, "", "V", 2.418e-3, None),
            gyro("gyro_x", "x"),
            gyro("gyro_y", "y"),
            gyro("gyro_z", "z"),
            accelerometer("accl_x", "x"),
            accelerometer("accl_y", "y"),
            accelerometer("accl_z", "z"),
            magnetometer("magn_x", "x"),
            magnetometer("magn_y", "y"),
            magnetometer("magn_z", "z"),
            // Sources give 0.14 °C and 0.1357 °C; most drivers use 0.14 °C.
            channel("temp", Quantity::Temperature, "", "degC", 0.14, None),
            channel("aux_adc", Quantity::AuxiliaryVoltage, "", "V", 0.806e-3, None),
        ],
        internal_rate_hz: INTERNAL_RATE_HZ,
        native_rates_hz: native_rates_hz(),
        filters: filters(),
        may_be_low_pass: false,
        dithered_avar_counts2: DITHERED_AVAR_COUNTS2,
        largest_sensitivity_multiple: LARGEST_SENSITIVITY_MULTIPLE,
        host_clock_error: HOST_CLOCK_ERROR,
        sample_rate_error: SAMPLE_RATE_ERROR,
    }
}

/// All rates of SMPL_PRD: bits 0 to 6 are the divisor less one, bit 7 the slow time base; 0x00 is an external clock.
fn native_rates_hz() -> Vec<f64> {
    let fast = (2..=128).map(|divisor| TIME_BASE_HZ / f64::from(divisor));
    let slow = (1..=128).map(|divisor| TIME_BASE_HZ / f64::from(SLOW_TIME_BASE * divisor));
    fast.chain(slow).collect()
}

/// Bartlett windows of 2 to 64 taps per stage, as SENS_AVG selects them.
fn filters() -> Vec<MovingAverageFilter> {
    (1..=6).map(|taps_log2| MovingAverageFilter::bartlett(1 << taps_log2)).collect()
}

#[cfg(test)]
mod tests {
    use super::profile;
    use crate::profile::DataSheetNoise;
    use adis16405_driver::{Channel, GyroRange, SamplePeriod};

    #[test]
    fn names_units_and_scales_are_those_of_the_driver() {
        for range in [GyroRange::Dps300, GyroRange::Dps150, GyroRange::Dps75] {
            let profile = profile(range.lsb());
            assert_eq!(profile.channels.len(), Channel::ALL.len());
            for (channel, known) in Channel::ALL.into_iter().zip(&profile.channels) {
                assert_eq!((known.name, known.unit, known.lsb), (channel.name(), channel.unit(), channel.lsb(range)));
                assert_eq!(known.quantity.is_inertial(), Channel::INERTIAL.contains(&channel));
            }
        }
    }

    /// The curves and the stated noise differ by at most a sixth, as in the data sheet.
    #[test]
    fn the_drawn_curves_are_those_of_the_stated_noise() {
        let profile = profile(0.05);
        for channel in profile.channels.iter().filter(|channel| channel.quantity.is_inertial()) {
            let DataSheetNoise { angle_random_walk, in_run_bias_stability, curve, .. } = channel.data_sheet;
            assert!(curve.is_sorted_by(|a, b| a.tau_s < b.tau_s), "{}", channel.name);
            assert!(curve.iter().all(|of| of.low < of.mean && of.mean < of.high), "{}", channel.name);
            let lowest = curve.iter().map(|of| of.mean).fold(f64::INFINITY, f64::min);
            let stated = in_run_bias_stability.expect("stated");
            assert!((lowest / stated - 1.0).abs() < 1.0 / 6.0, "{}: {lowest}", channel.name);
            let walk = angle_random_walk.expect("stated");
            let shortest = curve.first().expect("a curve");
            assert!((shortest.mean * shortest.tau_s.sqrt() / walk - 1.0).abs() < 1.0 / 6.0, "{}", channel.name);
        }
    }

    /// At 100 Hz every 8.192th value is read; 2 × 4 taps reach over 7 values, so samples are uncorrelated.
    #[test]
    fn filters_are_read_at_the_rate_of_the_recording() {
        let profile = profile(0.05);
        let own: Vec<u16> = profile.filters.iter().map(|filter| filter.taps).collect();
        assert_eq!(own, [2, 4, 8, 16, 32, 64]);
        assert_eq!(profile.filters_read_at(819.2), profile.filters);
        let slow: Vec<(u16, f64)> =
            profile.filters_read_at(100.0)[6..].iter().map(|of| (of.taps, of.decimation)).collect();
        assert_eq!(slow, [(8, 8.192), (16, 8.192), (32, 8.192), (64, 8.192)]);
        assert_eq!([819.2, 816.4, 409.6, 204.0, 91.02, 100.0].map(|rate| profile.read_every(rate)), [1, 1, 2, 4, 9, 1]);
    }

    #[test]
    fn native_rates_are_those_that_the_driver_can_set() {
        let profile = profile(0.05);
        assert_eq!(profile.native_rates_hz.len(), 255);
        for smpl_prd in 1..=255 {
            let rate = SamplePeriod::from_register(smpl_prd).expect("not the external clock").hz();
            assert!(profile.native_rates_hz.contains(&rate), "SMPL_PRD = {smpl_prd:#04x}: {rate} Hz");
        }
        for rate in [816.43, 204.1, 101.9, 53.0, 1.0, 0.1] {
            let nearest = SamplePeriod::nearest(rate).expect("a rate").hz();
            assert_eq!(profile.nearest_native_rate_hz(rate), Some(nearest));
        }
    }
}
