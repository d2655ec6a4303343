//! MSC_CTRL 0x34: bits 2 to 0 data ready (enable, active high, DIO2), 7 and 6 compensation. GPIO_CTRL 0x32: bits 11:8 levels
//! of DIO4 to DIO1, 3:0 directions. AUX_DAC 0x4A, latched by bit 2 of GLOB_CMD 0x3E.

use adis16405_driver::{Compensation, Config, DacLevel, Dio, Gpio, Line, Polarity, Signal};

use crate::harness::{NONE, read, write};

#[test]
fn data_ready_has_a_line_and_a_polarity() {
    use Line::{Dio1, Dio2};
    use Polarity::{ActiveHigh, ActiveLow};
    for (bits, line, polarity) in
        [(0b100, Dio1, ActiveLow), (0b101, Dio2, ActiveLow), (0b110, Dio1, ActiveHigh), (0b111, Dio2, ActiveHigh)]
    {
        let signal = Some(Signal { line, polarity });
        let control = 0x0080 | bits;
        assert_eq!(both!(Config::default(); [read(0x34, control)]; NONE; |imu, delay| imu.data_ready()), Ok(signal));
        let bus = [read(0x34, 0x0080), write(0x34, control as u8), read(0x34, control)];
        assert_eq!(both!(Config::default(); bus; NONE; |imu, delay| imu.set_data_ready(signal)), Ok(()));
    }
    assert_eq!(both!(Config::default(); [read(0x34, 0x0003)]; NONE; |imu, delay| imu.data_ready()), Ok(None));
    let bus = [read(0x34, 0x0086), write(0x34, 0x80), read(0x34, 0x0080)];
    assert_eq!(both!(Config::default(); bus; NONE; |imu, delay| imu.set_data_ready(None)), Ok(()));
    assert_eq!(Signal::default(), Signal { line: Dio1, polarity: ActiveHigh }, "after a reset, MSC_CTRL = 0x0006");
}

#[test]
fn compensations() {
    for (bits, linear_acceleration, origin_alignment) in
        [(0x00, false, false), (0x40, false, true), (0x80, true, false), (0xC0, true, true)]
    {
        let compensation = Compensation { linear_acceleration, origin_alignment };
        let control = 0x0006 | bits;
        let got = both!(Config::default(); [read(0x34, control)]; NONE; |imu, delay| imu.compensation());
        assert_eq!(got, Ok(compensation));
        let other = control ^ 0x40;
        let bus = [read(0x34, other), write(0x34, control as u8), read(0x34, control)];
        assert_eq!(both!(Config::default(); bus; NONE; |imu, delay| imu.set_compensation(compensation)), Ok(()));
    }
}

#[test]
fn general_purpose_lines() {
    let gpio = Gpio { outputs: Dio::DIO1 | Dio::DIO4, high: Dio::DIO4 | Dio::DIO2 };
    assert_eq!(both!(Config::default(); [read(0x32, 0x0A09)]; NONE; |imu, delay| imu.gpio()), Ok(gpio));
    // DIO2 is an input: its level is the pin's, and 0 here.
    let bus = [read(0x32, 0x0000), write(0x32, 0x09), write(0x33, 0x08), read(0x32, 0x0809)];
    assert_eq!(both!(Config::default(); bus; NONE; |imu, delay| imu.set_gpio(gpio)), Ok(()));
}

#[test]
fn the_analog_output_is_latched_after_it_is_written() {
    let level = DacLevel::from_counts(0x0ABC).unwrap();
    let bus = [read(0x4A, 0x0000), write(0x4A, 0xBC), write(0x4B, 0x0A), read(0x4A, 0x0ABC), write(0x3E, 0x04)];
    assert_eq!(both!(Config::default(); bus; NONE; |imu, delay| imu.set_aux_dac(level)), Ok(()));
}

#[test]
fn levels_of_the_analog_output() {
    assert_eq!(DacLevel::from_counts(4096), None);
    assert_eq!(DacLevel::from_millivolts(3301), None);
    for millivolts in 0..=3300u16 {
        let level = DacLevel::from_millivolts(millivolts).unwrap();
        let error = f64::from(level.counts()) * 0.8059 - f64::from(millivolts);
        assert!(error.abs() <= 0.8059 / 2.0 + 1e-9, "{millivolts} mV: off by {error}");
    }
}
