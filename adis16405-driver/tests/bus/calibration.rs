//! Offsets 0x1A to 0x24, hard iron 0x26 to 0x2A, soft iron 0x2C to 0x30, on-chip compensation (MSC_CTRL 0x34, bits 7
//! and 6). The part sends offsets sign-extended.

use adis16405_driver::{Config, Error, GyroBias, OnChipCompensation, Register};

use super::harness::{Frames, NONE, gyro_offsets, read, read_all, write};

/// The frames that set a register: a read, writes of both bytes, and a read back.
fn set(address: u8, value: u16, width: u16) -> Frames {
    let [upper, lower] = (value & width).to_be_bytes();
    [read(address, 0x1111 & width), write(address, lower), write(address + 1, upper), read(address, value)].concat()
}

#[test]
fn gyro_offsets_are_13_bits_and_the_driver_applies_a_negative_x() {
    let bias = both!(Config::default(); [gyro_offsets(0xFFC8, 0x1FC8, 0x0FFF)]; NONE; |imu| imu.gyro_offsets());
    assert_eq!(bias, Ok(GyroBias { part: [-56, -56, 4095], host_x: 0 }));

    let bus = [set(0x1A, 56, 0x1FFF), set(0x1C, (-56i16) as u16, 0x1FFF), set(0x1E, (-4096i16) as u16, 0x1FFF)];
    let bias = both!(Config::default(); bus; NONE; |imu| imu.set_gyro_offsets([56, -56, -4096]));
    assert_eq!(bias, Ok(GyroBias { part: [56, -56, -4096], host_x: 0 }));

    let bus = [read(0x1A, 0x0000), read(0x1C, 0x0000), read(0x1E, 0x0000)];
    let bias = both!(Config::default(); bus; NONE; |imu| imu.set_gyro_offsets([-56, 0, 0]));
    assert_eq!(bias, Ok(GyroBias { part: [0, 0, 0], host_x: -56 }));

    let bus = [gyro_offsets(0x1FC8, 0, 0), read(0x1A, 0x1FC8), write(0x1A, 0), write(0x1B, 0), read(0x1A, 0)];
    let bias = both!(Config::default(); bus; NONE; |imu| imu.keep_negative_x_bias_on_host());
    assert_eq!(bias, Ok(GyroBias { part: [0, 0, 0], host_x: -56 }));
    let bus = [gyro_offsets(0x0038, 0, 0)];
    let bias = both!(Config::default(); bus; NONE; |imu| imu.keep_negative_x_bias_on_host());
    assert_eq!(bias, Ok(GyroBias { part: [56, 0, 0], host_x: 0 }));
}

#[test]
fn accelerometer_offsets_are_12_bits_and_hard_iron_14() {
    let bus = [read_all(&[(0x20, 0xF800), (0x22, 0x0FFF), (0x24, 0x07FF)])];
    assert_eq!(both!(Config::default(); bus; NONE; |imu| imu.accl_offsets()), Ok([-2048, -1, 2047]));
    let bus = [set(0x20, 2, 0x0FFF), set(0x22, (-2048i16) as u16, 0x0FFF), set(0x24, 2047, 0x0FFF)];
    assert_eq!(both!(Config::default(); bus; NONE; |imu| imu.set_accl_offsets([2, -2048, 2047])), Ok(()));

    let bus = [read_all(&[(0x26, 0xE000), (0x28, 0x3FFF), (0x2A, 0x1FFF)])];
    assert_eq!(both!(Config::default(); bus; NONE; |imu| imu.hard_iron()), Ok([-8192, -1, 8191]));
    let bus = [set(0x26, 2, 0x3FFF), set(0x28, (-8192i16) as u16, 0x3FFF), set(0x2A, 8191, 0x3FFF)];
    assert_eq!(both!(Config::default(); bus; NONE; |imu| imu.set_hard_iron([2, -8192, 8191])), Ok(()));
}

#[test]
fn soft_iron_is_12_bits_unsigned() {
    let bus = [read_all(&[(0x2C, 0x0800), (0x2E, 0x0FFF), (0x30, 0xF000)])];
    assert_eq!(both!(Config::default(); bus; NONE; |imu| imu.soft_iron()), Ok([0x0800, 0x0FFF, 0]));
    let bus = [set(0x2C, 0x0800, 0x0FFF), set(0x2E, 0x0FFF, 0x0FFF), set(0x30, 0x0000, 0x0FFF)];
    assert_eq!(both!(Config::default(); bus; NONE; |imu| imu.set_soft_iron([0x0800, 0x0FFF, 0])), Ok(()));
}

#[test]
fn values_that_do_not_fit_are_refused_without_bus_traffic() {
    let empty = || [Frames::new()];
    for (x, y, z, register, value) in [
        (4096, 0, 0, Register::XgyroOff, 4096),
        (-4097, 0, 0, Register::XgyroOff, -4097),
        (0, 4096, 0, Register::YgyroOff, 4096),
        (0, 0, -4097, Register::ZgyroOff, -4097),
    ] {
        let refused = both!(Config::default(); empty(); NONE; |imu| imu.set_gyro_offsets([x, y, z]));
        assert_eq!(refused, Err(Error::Value { register, value }));
    }
    let refused = both!(Config::default(); empty(); NONE; |imu| imu.set_accl_offsets([0, 0, 2048]));
    assert_eq!(refused, Err(Error::Value { register: Register::ZacclOff, value: 2048 }));
    let refused = both!(Config::default(); empty(); NONE; |imu| imu.set_hard_iron([0, -8193, 0]));
    assert_eq!(refused, Err(Error::Value { register: Register::YmagnHif, value: -8193 }));
    assert_eq!(refused.unwrap_err().to_string(), "-8193 does not fit YMAGN_HIF");
    let refused = both!(Config::default(); empty(); NONE; |imu| imu.set_soft_iron([0x1000, 0, 0]));
    assert_eq!(refused, Err(Error::Value { register: Register::XmagnSif, value: 0x1000 }));
}

#[test]
fn each_compensation_has_its_bit() {
    for (bits, linear_acceleration, origin_alignment) in
        [(0x00, false, false), (0x40, false, true), (0x80, true, false), (0xC0, true, true)]
    {
        let compensation = OnChipCompensation { linear_acceleration, origin_alignment };
        let control = 0x0006 | bits;
        let got = both!(Config::default(); [read(0x34, control)]; NONE; |imu| imu.compensation());
        assert_eq!(got, Ok(compensation));
        let other = control ^ 0x40;
        let bus = [read(0x34, other), write(0x34, control as u8), read(0x34, control)];
        assert_eq!(both!(Config::default(); bus; NONE; |imu| imu.set_compensation(compensation)), Ok(()));
    }
}
