//! Identity, configuration, start-up and reset.

use adis16405_driver::{Config, ConfigError, Error, GyroRange, Product, Register, SamplePeriod};

use crate::harness::{Frames, NONE, frame_with, gyro_offsets, init, read, write};

fn config(range: GyroRange, taps: u8, smpl_prd: u8) -> Config {
    Config::new(range, taps, SamplePeriod::from_register(smpl_prd).unwrap()).unwrap()
}

#[test]
fn the_two_parts_are_told_apart_and_others_refused() {
    for (answer, product) in [(0x4015, Product::Adis16405), (0x4010, Product::Adis16400)] {
        assert_eq!(both!(Config::default(); [read(0x56, answer)]; NONE; |imu, delay| imu.identity()), Ok(product));
        assert_eq!(product.prod_id(), answer);
    }
    for answer in [0x0000, 0xFFFF, 0x4040, 0x0003] {
        let refused = Err(Error::Product { answer });
        assert_eq!(both!(Config::default(); [read(0x56, answer)]; NONE; |imu, delay| imu.identity()), refused);
        assert_eq!(both!(Config::default(); [read(0x56, answer)]; NONE; |imu, delay| imu.init()), refused);
    }
    let error: Error<()> = Error::Product { answer: 0x4040 };
    assert_eq!(error.to_string(), "PROD_ID answered 16448 (0x4040), not 16405 or 16400");
}

#[test]
fn init_of_a_part_that_is_already_configured_only_reads() {
    let ready = both!(Config::default(); [init(0x0001, 0x0402)]; NONE; |imu, delay| imu.init());
    assert_eq!(ready, Ok(Product::Adis16405));
}

#[test]
fn init_writes_the_lower_byte_first_and_reads_back() {
    let bus = [
        read(0x56, 0x4015),
        read(0x36, 0x0001),
        write(0x36, 0x07),
        read(0x36, 0x0007),
        read(0x38, 0x0402),
        write(0x38, 0x04),
        write(0x39, 0x01),
        read(0x38, 0x0104),
        gyro_offsets(0, 0, 0),
    ];
    let ready = both!(config(GyroRange::Dps75, 4, 0x07); bus; NONE; |imu, delay| imu.init());
    assert_eq!(ready, Ok(Product::Adis16405));
}

#[test]
fn init_writes_only_the_byte_that_changes() {
    // Bits outside the registers (SMPL_PRD has 8, SENS_AVG 11) must not matter.
    let bus = [read(0x56, 0x4015), read(0x36, 0xFF01), read(0x38, 0xF802), write(0x39, 0x04), read(0x38, 0xF402)];
    let bus = bus.into_iter().chain([gyro_offsets(0, 0, 0)]);
    assert_eq!(both!(Config::default(); bus; NONE; |imu, delay| imu.init()), Ok(Product::Adis16405));
}

/// From ±75 °/s (at least 2⁴ taps) to no filter: with the filter first, a sample might be taken with a forbidden pair.
#[test]
fn the_range_goes_first_where_the_filter_would_be_too_short_for_the_old_one() {
    let bus = [read(0x36, 0x0001), read(0x38, 0x0104), write(0x39, 0x04), write(0x38, 0x00), read(0x38, 0x0400)];
    let unfiltered = config(GyroRange::Dps300, 0, 1);
    assert_eq!(both!(Config::default(); bus; NONE; |imu, delay| imu.configure(unfiltered)), Ok(()));
}

#[test]
fn init_reports_a_register_that_does_not_take_its_value() {
    let bus = [read(0x56, 0x4015), read(0x36, 0x0001), write(0x36, 0x07), read(0x36, 0x0001)];
    let result = both!(config(GyroRange::Dps300, 2, 0x07); bus; NONE; |imu, delay| imu.init());
    assert_eq!(result, Err(Error::Verify { register: Register::SmplPrd, expected: 7, answer: 1 }));
    assert_eq!(result.unwrap_err().to_string(), "SMPL_PRD was written 0x0007 and answered 0x0001");
}

#[test]
fn the_longer_stall_holds_while_the_mode_changes() {
    let slow = |sent: [u8; 2], answer: u16| frame_with(75_000, &sent, &answer.to_be_bytes());
    let bus = [
        slow([0x36, 0], 0),
        slow([0, 0], 0x0001),
        slow([0xB6, 0x0F], 0),
        slow([0x36, 0], 0),
        slow([0, 0], 0x000F),
        slow([0x38, 0], 0),
        slow([0, 0], 0x0402),
    ];
    let rate = both!(Config::default(); bus; NONE; |imu, delay| imu.set_sample_rate(100.0));
    assert_eq!(rate, Ok(1638.4 / 16.0), "the rate that was really set");

    // Back: slow until the period is known to be short.
    let bus = [
        slow([0x36, 0], 0),
        slow([0, 0], 0x000F),
        slow([0xB6, 0x01], 0),
        slow([0x36, 0], 0),
        slow([0, 0], 0x0001),
        read(0x38, 0x0402),
    ];
    let rate = both!(config(GyroRange::Dps300, 2, 0x0F); bus; NONE; |imu, delay| imu.set_sample_rate(819.2));
    assert_eq!(rate, Ok(819.2));
}

#[test]
fn settings_change_one_by_one() {
    let bus = [read(0x36, 0x0001), read(0x38, 0x0402), write(0x39, 0x02), read(0x38, 0x0202)];
    assert_eq!(both!(Config::default(); bus; NONE; |imu, delay| imu.set_range(GyroRange::Dps150)), Ok(()));
    let bus = [read(0x36, 0x0001), read(0x38, 0x0402), write(0x38, 0x06), read(0x38, 0x0406)];
    assert_eq!(both!(Config::default(); bus; NONE; |imu, delay| imu.set_filter_taps_log2(6)), Ok(()));
    // SMPL_PRD = 0 is the external clock.
    let bus = [read(0x36, 0x0001), write(0x36, 0x00), read(0x36, 0x0000), read(0x38, 0x0402)];
    let external = Config::default().with_external_clock();
    assert_eq!(both!(Config::default(); bus; NONE; |imu, delay| imu.configure(external)), Ok(()));
}

#[test]
fn settings_that_the_part_refuses_are_not_sent() {
    let empty = || [Frames::new()];
    let narrow = both!(Config::default(); empty(); NONE; |imu, delay| imu.set_range(GyroRange::Dps75));
    let error = ConfigError::FilterTaps { range: GyroRange::Dps75, filter_taps_log2: 2 };
    assert_eq!(narrow, Err(Error::Config(error)));
    let taps = both!(Config::default(); empty(); NONE; |imu, delay| imu.set_filter_taps_log2(7));
    let error = ConfigError::FilterTaps { range: GyroRange::Dps300, filter_taps_log2: 7 };
    assert_eq!(taps, Err(Error::Config(error)));
    let rate = both!(Config::default(); empty(); NONE; |imu, delay| imu.set_sample_rate(-1.0));
    assert_eq!(rate, Err(Error::Config(ConfigError::Rate)));
}

/// 290 ms from power-on and 170 ms from a reset are the longer ones of two modes.
#[test]
fn the_part_is_left_alone_while_it_starts() {
    let started = both!(Config::default(); [init(0x0001, 0x0402)]; [290_000]; |imu, delay| imu.start_up(&mut delay));
    assert_eq!(started, Ok(Product::Adis16405));
    let bus = [write(0x3E, 0x80), init(0x0001, 0x0402)];
    let reset = both!(Config::default(); bus; [170_000]; |imu, delay| imu.software_reset(&mut delay));
    assert_eq!(reset, Ok(Product::Adis16405));
}

#[test]
fn a_negative_offset_of_x_is_noticed() {
    let bus = [read(0x56, 16405), read(0x36, 0x0001), read(0x38, 0x0402), gyro_offsets(0xFFC8, 0, 0)].concat();
    let mut imu = adis16405_driver::Adis16405::new(embedded_hal_mock::eh1::spi::Mock::new(&bus), Config::default());
    imu.init().unwrap();
    assert!(imu.x_sign_at_risk());
    imu.release().done();
}
