//! Pins: MSC_CTRL 0x34, bits 2 to 0 data ready (enable, active high, DIO2). GPIO_CTRL 0x32, bits 11:8 levels of DIO4 to
//! DIO1, 3:0 directions. AUX_DAC 0x4A, latched by bit 2 of GLOB_CMD 0x3E.
//!
//! Alarms: ALM_MAG 0x40 and 0x42, ALM_SMPL 0x44 and 0x46. ALM_CTRL 0x48, bits 15:12 and 11:8 sources of alarms 2 and 1,
//! 7 and 6 rate of change, 4 filtered data, 2 to 0 output (enable, active high, DIO2).

use adis16405_driver::{
    Alarm, AlarmNumber, AlarmThreshold, AlarmWatch, Channel, Config, DacLevel, Dio, DioLine, DioSignal, Error, Gpio,
    Polarity, Register,
};

use super::harness::{Frames, NONE, read, read_all, write};

#[test]
fn data_ready_is_set_by_line_and_polarity() {
    use DioLine::{Dio1, Dio2};
    use Polarity::{ActiveHigh, ActiveLow};
    for (bits, line, polarity) in
        [(0b100, Dio1, ActiveLow), (0b101, Dio2, ActiveLow), (0b110, Dio1, ActiveHigh), (0b111, Dio2, ActiveHigh)]
    {
        let signal = Some(DioSignal { line, polarity });
        let control = 0x0080 | bits;
        assert_eq!(both!(Config::default(); [read(0x34, control)]; NONE; |imu| imu.data_ready()), Ok(signal));
        let bus = [read(0x34, 0x0080), write(0x34, control as u8), read(0x34, control)];
        assert_eq!(both!(Config::default(); bus; NONE; |imu| imu.set_data_ready(signal)), Ok(()));
    }
    assert_eq!(both!(Config::default(); [read(0x34, 0x0003)]; NONE; |imu| imu.data_ready()), Ok(None));
    let bus = [read(0x34, 0x0086), write(0x34, 0x80), read(0x34, 0x0080)];
    assert_eq!(both!(Config::default(); bus; NONE; |imu| imu.set_data_ready(None)), Ok(()));
    assert_eq!(
        DioSignal::default(),
        DioSignal { line: Dio1, polarity: ActiveHigh },
        "after a reset, MSC_CTRL = 0x0006"
    );
}

#[test]
fn gpio_writes_directions_and_the_levels_of_outputs_only() {
    let gpio = Gpio { outputs: Dio::DIO1 | Dio::DIO4, high: Dio::DIO4 | Dio::DIO2 };
    assert_eq!(both!(Config::default(); [read(0x32, 0x0A09)]; NONE; |imu| imu.gpio()), Ok(gpio));
    // DIO2 is an input: its level bit shows the pin, 0 here, and is not written.
    let bus = [read(0x32, 0x0000), write(0x32, 0x09), write(0x33, 0x08), read(0x32, 0x0809)];
    assert_eq!(both!(Config::default(); bus; NONE; |imu| imu.set_gpio(gpio)), Ok(()));
}

#[test]
fn the_analog_output_is_latched_after_it_is_written() {
    let level = DacLevel::from_counts(0x0ABC).unwrap();
    let bus = [read(0x4A, 0x0000), write(0x4A, 0xBC), write(0x4B, 0x0A), read(0x4A, 0x0ABC), write(0x3E, 0x04)];
    assert_eq!(both!(Config::default(); bus; NONE; |imu| imu.set_aux_dac(level)), Ok(()));
}

#[test]
fn analog_levels_are_rounded_to_the_nearest_count() {
    assert_eq!(DacLevel::from_counts(4096), None);
    assert_eq!(DacLevel::from_millivolts(3301), None);
    for millivolts in 0..=3300u16 {
        let level = DacLevel::from_millivolts(millivolts).unwrap();
        let error = f64::from(level.counts()) * 0.8059 - f64::from(millivolts);
        assert!(error.abs() <= 0.8059 / 2.0 + 1e-9, "{millivolts} mV: off by {error}");
    }
}

#[test]
fn an_alarm_is_off_while_its_registers_change() {
    // −300 counts of the 14-bit field are 0x3ED4; z accelerometer is source 7.
    let alarm = Alarm { source: Channel::AcclZ, watch: AlarmWatch::Level, threshold: AlarmThreshold::Above(-300) };
    let bus = [
        read(0x48, 0x2516),
        write(0x49, 0x20),
        read(0x48, 0x2016),
        read(0x40, 0x0000),
        write(0x40, 0xD4),
        write(0x41, 0xBE),
        read(0x40, 0xBED4),
        read(0x44, 0x0000),
        read(0x48, 0x2016),
        write(0x49, 0x27),
        read(0x48, 0x2716),
    ];
    assert_eq!(both!(Config::default(); bus; NONE; |imu| imu.set_alarm(AlarmNumber::One, Some(alarm))), Ok(()));

    // Alarm 2, below −5 counts of the 12-bit temperature (source 0xB) over 16 samples.
    let alarm =
        Alarm { source: Channel::Temp, watch: AlarmWatch::RateOfChange(16), threshold: AlarmThreshold::Below(-5) };
    let bus = [
        read(0x48, 0x0700),
        read(0x42, 0x0000),
        write(0x42, 0xFB),
        write(0x43, 0x0F),
        read(0x42, 0x0FFB),
        read(0x46, 0x0000),
        write(0x46, 0x10),
        read(0x46, 0x0010),
        read(0x48, 0x0700),
        write(0x48, 0x80),
        write(0x49, 0xB7),
        read(0x48, 0xB780),
    ];
    assert_eq!(both!(Config::default(); bus; NONE; |imu| imu.set_alarm(AlarmNumber::Two, Some(alarm))), Ok(()));

    let bus = [read(0x48, 0xB780), write(0x48, 0x00), write(0x49, 0x07), read(0x48, 0x0700)];
    assert_eq!(both!(Config::default(); bus; NONE; |imu| imu.set_alarm(AlarmNumber::Two, None)), Ok(()));
}

/// Sources are numbered from 1 in burst order; 0, 0xD, 0xE and 0xF are no source.
#[test]
fn an_alarm_is_read_with_its_source() {
    for code in 0..16u16 {
        let bus = [read_all(&[(0x48, code << 8 | 0x40), (0x40, 0x8001), (0x44, 9)])];
        let alarm = both!(Config::default(); bus; NONE; |imu| imu.alarm(AlarmNumber::One)).unwrap();
        let expected = usize::from(code)
            .checked_sub(1)
            .and_then(|index| Channel::ALL.get(index))
            .map(|&source| Alarm { source, watch: AlarmWatch::RateOfChange(9), threshold: AlarmThreshold::Above(1) });
        assert_eq!(alarm, expected, "{code:#x}");
    }
    let bus = [read_all(&[(0x48, 0x2000), (0x42, 0x3FFF), (0x46, 0)])];
    let alarm = both!(Config::default(); bus; NONE; |imu| imu.alarm(AlarmNumber::Two)).unwrap();
    let expected = Alarm { source: Channel::GyroX, watch: AlarmWatch::Level, threshold: AlarmThreshold::Below(-1) };
    assert_eq!(alarm, Some(expected));
}

#[test]
fn alarm_output_and_filtering_change_their_bits_only() {
    let signal = Some(DioSignal { line: DioLine::Dio2, polarity: Polarity::ActiveLow });
    let bus = [read(0x48, 0x0702), write(0x48, 0x05), read(0x48, 0x0705)];
    assert_eq!(both!(Config::default(); bus; NONE; |imu| imu.set_alarm_output(signal)), Ok(()));
    let bus = [read(0x48, 0x0705), write(0x48, 0x15), read(0x48, 0x0715)];
    assert_eq!(both!(Config::default(); bus; NONE; |imu| imu.set_alarm_filtering(true)), Ok(()));
    let bus = [read(0x48, 0x0715), write(0x48, 0x05), read(0x48, 0x0705)];
    assert_eq!(both!(Config::default(); bus; NONE; |imu| imu.set_alarm_filtering(false)), Ok(()));
}

#[test]
fn a_threshold_outside_the_limits_of_its_channel_is_refused() {
    for (source, counts, number, register) in [
        (Channel::GyroX, 8192, AlarmNumber::One, Register::AlmMag1),
        (Channel::Temp, -2049, AlarmNumber::Two, Register::AlmMag2),
        (Channel::Supply, -1, AlarmNumber::One, Register::AlmMag1),
        (Channel::AuxAdc, 4096, AlarmNumber::Two, Register::AlmMag2),
    ] {
        let alarm = Alarm { source, watch: AlarmWatch::Level, threshold: AlarmThreshold::Below(counts) };
        let refused = both!(Config::default(); [Frames::new()]; NONE; |imu| imu.set_alarm(number, Some(alarm)));
        assert_eq!(refused, Err(Error::Value { register, value: i32::from(counts) }));
    }
}
