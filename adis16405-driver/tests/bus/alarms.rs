//! ALM_MAG 0x40 and 0x42, ALM_SMPL 0x44 and 0x46, ALM_CTRL 0x48: bits 15:12 and 11:8 sources of alarm 2 and 1, 7 and 6 rate
//! of change, 4 filtered data, 2 to 0 output (enable, active high, DIO2).

use adis16405_driver::{
    Alarm, AlarmNumber, Channel, Config, Error, Line, Polarity, Register, Signal, Threshold, Watch,
};

use crate::harness::{Frames, NONE, read, read_all, write};

#[test]
fn an_alarm_is_off_while_its_threshold_changes() {
    // −300 counts of the 14-bit field are 0x3ED4; z accelerometer is source 7.
    let alarm = Alarm { source: Channel::AcclZ, watch: Watch::Level, threshold: Threshold::Above(-300) };
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
    assert_eq!(both!(Config::default(); bus; NONE; |imu, delay| imu.set_alarm(AlarmNumber::One, Some(alarm))), Ok(()));

    // Alarm 2, below −5 counts of the 12-bit temperature (source 0xB) over 16 samples.
    let alarm = Alarm { source: Channel::Temp, watch: Watch::RateOfChange(16), threshold: Threshold::Below(-5) };
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
    assert_eq!(both!(Config::default(); bus; NONE; |imu, delay| imu.set_alarm(AlarmNumber::Two, Some(alarm))), Ok(()));

    let bus = [read(0x48, 0xB780), write(0x48, 0x00), write(0x49, 0x07), read(0x48, 0x0700)];
    assert_eq!(both!(Config::default(); bus; NONE; |imu, delay| imu.set_alarm(AlarmNumber::Two, None)), Ok(()));
}

/// Sources are numbered from 1 in the order of the outputs; 0, 0xD, 0xE and 0xF are none.
#[test]
fn every_source_is_read_back() {
    for code in 0..16u16 {
        let bus = [read_all(&[(0x48, code << 8 | 0x40), (0x40, 0x8001), (0x44, 9)])];
        let alarm = both!(Config::default(); bus; NONE; |imu, delay| imu.alarm(AlarmNumber::One)).unwrap();
        let expected = usize::from(code)
            .checked_sub(1)
            .and_then(|index| Channel::ALL.get(index))
            .map(|&source| Alarm { source, watch: Watch::RateOfChange(9), threshold: Threshold::Above(1) });
        assert_eq!(alarm, expected, "{code:#x}");
    }
    let bus = [read_all(&[(0x48, 0x2000), (0x42, 0x3FFF), (0x46, 0)])];
    let alarm = both!(Config::default(); bus; NONE; |imu, delay| imu.alarm(AlarmNumber::Two)).unwrap();
    let expected = Alarm { source: Channel::GyroX, watch: Watch::Level, threshold: Threshold::Below(-1) };
    assert_eq!(alarm, Some(expected));
}

#[test]
fn the_output_and_the_filter_have_bits_of_their_own() {
    let signal = Some(Signal { line: Line::Dio2, polarity: Polarity::ActiveLow });
    let bus = [read(0x48, 0x0702), write(0x48, 0x05), read(0x48, 0x0705)];
    assert_eq!(both!(Config::default(); bus; NONE; |imu, delay| imu.set_alarm_output(signal)), Ok(()));
    let bus = [read(0x48, 0x0705), write(0x48, 0x15), read(0x48, 0x0715)];
    assert_eq!(both!(Config::default(); bus; NONE; |imu, delay| imu.set_alarm_filtering(true)), Ok(()));
    let bus = [read(0x48, 0x0715), write(0x48, 0x05), read(0x48, 0x0705)];
    assert_eq!(both!(Config::default(); bus; NONE; |imu, delay| imu.set_alarm_filtering(false)), Ok(()));
}

#[test]
fn a_threshold_that_the_output_cannot_have_is_refused() {
    for (source, counts, number, register) in [
        (Channel::GyroX, 8192, AlarmNumber::One, Register::AlmMag1),
        (Channel::Temp, -2049, AlarmNumber::Two, Register::AlmMag2),
        (Channel::Supply, -1, AlarmNumber::One, Register::AlmMag1),
        (Channel::AuxAdc, 4096, AlarmNumber::Two, Register::AlmMag2),
    ] {
        let alarm = Alarm { source, watch: Watch::Level, threshold: Threshold::Below(counts) };
        let refused = both!(Config::default(); [Frames::new()]; NONE; |imu, delay| imu.set_alarm(number, Some(alarm)));
        assert_eq!(refused, Err(Error::Value { register, value: i32::from(counts) }));
    }
}
