//! Identification, start-up and configuration; GLOB_CMD 0x3E (bit 7 reset, 4 precision auto-null, 3 flash update, 1
//! factory restore, 0 auto-null); sleep, SLP_CNT 0x3A.

use core::num::NonZeroU8;

use adis16405_driver::{
    Adis16405, Config, ConfigError, Diagnosis, Error, GyroBias, GyroRange, Product, Register, SamplePeriod, Sleep,
};

use super::harness::{
    Bench, Frames, NONE, SLOW_STALL_NS, Step, frame_with, gyro_offsets, init, read, read_all, slow, write,
};

fn config(range: GyroRange, taps: u8, smpl_prd: u8) -> Config {
    Config::new(range, taps, SamplePeriod::from_register(smpl_prd).unwrap()).unwrap()
}

#[test]
fn both_parts_are_identified_and_others_refused() {
    for (answer, product) in [(0x4015, Product::Adis16405), (0x4010, Product::Adis16400)] {
        assert_eq!(both!(Config::default(); [read(0x56, answer)]; NONE; |imu| imu.identity()), Ok(product));
        assert_eq!(product.prod_id(), answer);
    }
    for answer in [0x0000, 0xFFFF, 0x4040, 0x0003] {
        let refused = Err(Error::Product { answer });
        assert_eq!(both!(Config::default(); [read(0x56, answer)]; NONE; |imu| imu.identity()), refused);
        assert_eq!(both!(Config::default(); [slow(read(0x56, answer))]; NONE; |imu| imu.init()), refused);
    }
    let error: Error<()> = Error::Product { answer: 0x4040 };
    assert_eq!(error.to_string(), "PROD_ID answered 16448 (0x4040), not 16405 or 16400");
}

#[test]
fn init_of_a_part_that_is_already_configured_only_reads() {
    let ready = both!(Config::default(); [init(0x0001, 0x0402)]; NONE; |imu| imu.init());
    assert_eq!(ready, Ok(Product::Adis16405));
}

#[test]
fn init_writes_the_range_before_the_filter_and_reads_back() {
    let bus = [
        slow([read(0x56, 0x4015), read(0x36, 0x0001), write(0x36, 0x07), read(0x36, 0x0007)].concat()),
        read(0x38, 0x0402),
        write(0x39, 0x01),
        write(0x38, 0x04),
        read(0x38, 0x0104),
        gyro_offsets(0, 0, 0),
    ];
    let ready = both!(config(GyroRange::Dps75, 4, 0x07); bus; NONE; |imu| imu.init());
    assert_eq!(ready, Ok(Product::Adis16405));
}

/// The range can change the filter (data sheet Rev. B, page 14), so that the filter is written after it in any case.
#[test]
fn init_writes_only_the_bytes_that_change() {
    // Bits outside the width of a register (8 of SMPL_PRD, 11 of SENS_AVG) are ignored.
    let range = [write(0x39, 0x04), write(0x38, 0x02)].concat();
    let bus = [slow(read(0x56, 0x4015)), slow(read(0x36, 0xFF01)), read(0x38, 0xF802), range, read(0x38, 0xF402)];
    let bus = bus.into_iter().chain([gyro_offsets(0, 0, 0)]);
    assert_eq!(both!(Config::default(); bus; NONE; |imu| imu.init()), Ok(Product::Adis16405));
    let bus =
        [slow(read(0x56, 0x4015)), slow(read(0x36, 0xFF01)), read(0x38, 0xFC04), write(0x38, 0x02), read(0x38, 0xFC02)];
    let bus = bus.into_iter().chain([gyro_offsets(0, 0, 0)]);
    assert_eq!(both!(Config::default(); bus; NONE; |imu| imu.init()), Ok(Product::Adis16405));
}

/// From ±75 °/s, which needs 2⁴ taps, to no filter: with the filter written first, a sample might be taken with a
/// combination that is not allowed.
#[test]
fn the_range_is_written_first_where_the_new_filter_is_too_short_for_the_old_range() {
    let bus = [read(0x36, 0x0001), read(0x38, 0x0104), write(0x39, 0x04), write(0x38, 0x00), read(0x38, 0x0400)];
    let unfiltered = config(GyroRange::Dps300, 0, 1);
    assert_eq!(both!(Config::default(); bus; NONE; |imu| imu.configure(unfiltered)), Ok(()));
}

#[test]
fn init_reports_a_register_that_does_not_take_its_value() {
    let bus = [read(0x56, 0x4015), read(0x36, 0x0001), write(0x36, 0x07), read(0x36, 0x0001)].map(slow);
    let result = both!(config(GyroRange::Dps300, 2, 0x07); bus; NONE; |imu| imu.init());
    assert_eq!(result, Err(Error::Verify { register: Register::SmplPrd, expected: 7, answer: 1 }));
    assert_eq!(result.unwrap_err().to_string(), "SMPL_PRD was written 0x0007 and answered 0x0001");
}

#[test]
fn the_longer_stall_is_kept_while_the_power_mode_changes() {
    let slow = |sent: [u8; 2], answer: u16| frame_with(SLOW_STALL_NS, &sent, &answer.to_be_bytes());
    let bus = [
        slow([0x36, 0], 0),
        slow([0, 0], 0x0001),
        slow([0xB6, 0x0F], 0),
        slow([0x36, 0], 0),
        slow([0, 0], 0x000F),
        slow([0x38, 0], 0),
        slow([0, 0], 0x0402),
    ];
    let rate = both!(Config::default(); bus; NONE; |imu| imu.set_sample_rate(100.0));
    assert_eq!(rate, Ok(1638.4 / 16.0), "the rate that was set");

    // Back to normal mode: the longer stall is kept until the new period was read back.
    let bus = [
        slow([0x36, 0], 0),
        slow([0, 0], 0x000F),
        slow([0xB6, 0x01], 0),
        slow([0x36, 0], 0),
        slow([0, 0], 0x0001),
        read(0x38, 0x0402),
    ];
    let rate = both!(config(GyroRange::Dps300, 2, 0x0F); bus; NONE; |imu| imu.set_sample_rate(819.2));
    assert_eq!(rate, Ok(819.2));
}

#[test]
fn range_filter_and_external_clock_are_set_one_by_one() {
    let range = [write(0x39, 0x02), write(0x38, 0x02)].concat();
    let bus = [read(0x36, 0x0001), read(0x38, 0x0402), range, read(0x38, 0x0202)];
    assert_eq!(both!(Config::default(); bus; NONE; |imu| imu.set_range(GyroRange::Dps150)), Ok(()));
    let bus = [read(0x36, 0x0001), read(0x38, 0x0402), write(0x38, 0x06), read(0x38, 0x0406)];
    assert_eq!(both!(Config::default(); bus; NONE; |imu| imu.set_filter_taps_log2(6)), Ok(()));
    // SMPL_PRD = 0 and GPIO_CTRL[3] = 0 are the external clock.
    let period = [read(0x36, 0x0001), write(0x36, 0x00), read(0x36, 0x0000)].concat();
    let bus = [period, read(0x32, 0x0009), write(0x32, 0x01), read(0x32, 0x0001), read(0x38, 0x0402)];
    let external = Config::default().with_external_clock();
    assert_eq!(both!(Config::default(); bus; NONE; |imu| imu.configure(external)), Ok(()));
}

#[test]
fn settings_that_the_part_does_not_accept_are_not_sent() {
    let empty = || [Frames::new()];
    let narrow = both!(Config::default(); empty(); NONE; |imu| imu.set_range(GyroRange::Dps75));
    let error = ConfigError::FilterTaps { range: GyroRange::Dps75, filter_taps_log2: 2 };
    assert_eq!(narrow, Err(Error::Config(error)));
    let taps = both!(Config::default(); empty(); NONE; |imu| imu.set_filter_taps_log2(7));
    let error = ConfigError::FilterTaps { range: GyroRange::Dps300, filter_taps_log2: 7 };
    assert_eq!(taps, Err(Error::Config(error)));
    let rate = both!(Config::default(); empty(); NONE; |imu| imu.set_sample_rate(-1.0));
    assert_eq!(rate, Err(Error::Config(ConfigError::Rate)));
}

/// 290 ms from power-on and 170 ms from a reset are the times of low-power mode, the longer ones. Both load SMPL_PRD,
/// and with it the power mode, from flash.
#[test]
fn after_start_up_and_reset_the_bus_is_silent_and_then_slow() {
    let bus = [init(0x0001, 0x0402)];
    let started = both!(Config::default(); bus; [290_000]; |imu| imu.start_up());
    assert_eq!(started, Ok(Product::Adis16405));
    let bus = [slow(write(0x3E, 0x80)), init(0x0001, 0x0402)];
    let reset = both!(Config::default(); bus; [170_000]; |imu| imu.software_reset());
    assert_eq!(reset, Ok(Product::Adis16405));
}

/// XGYRO_OFF is 0xFFC8, −56, as an auto-null has left it in flash.
#[test]
fn init_moves_a_negative_offset_of_x_to_the_host() {
    let offsets = gyro_offsets(0xFFC8, 0, 0);
    let cleared = [read(0x1A, 0xFFC8), write(0x1A, 0x00), write(0x1B, 0x00), read(0x1A, 0x0000)].concat();
    let probed = slow([read(0x56, 16405), read(0x36, 0x0001)].concat());
    let bus = [probed, read(0x38, 0x0402), offsets, cleared, gyro_offsets(0, 0, 0)];
    let bench = Bench::new(bus.concat(), NONE);
    let mut imu = Adis16405::new(bench.clone(), bench.clone(), Config::default());
    imu.init().unwrap();
    assert!(!imu.x_sign_at_risk());
    assert_eq!(imu.gyro_offsets(), Ok(GyroBias { part: [0, 0, 0], host_x: -56 }));
    bench.done();
}

#[test]
fn an_auto_null_is_followed_by_silence_and_the_driver_applies_a_negative_x() {
    let bus = [write(0x3E, 0x01), read(0x56, 16405), gyro_offsets(0x0028, 0xFFD8, 0x0000)];
    let bias = both!(Config::default(); bus; [100_000]; |imu| imu.auto_null());
    assert_eq!(bias, Ok(GyroBias { part: [40, -40, 0], host_x: 0 }));

    let bus = [
        write(0x3E, 0x10),
        read(0x56, 16405),
        gyro_offsets(0xFFD8, 0x0001, 0x0000),
        read(0x1A, 0xFFD8),
        write(0x1A, 0x00),
        write(0x1B, 0x00),
        read(0x1A, 0x0000),
    ];
    let bias = both!(Config::default(); bus; [31_000_000]; |imu| imu.precision_auto_null()).unwrap();
    assert_eq!(bias, GyroBias { part: [0, 1, 0], host_x: -40 });
    assert_eq!(bias.total(), [-40, 1, 0]);
}

#[test]
fn a_part_that_does_not_answer_after_an_auto_null_is_an_error() {
    let bus = [write(0x3E, 0x01), read(0x56, 0xFFFF)];
    let bias = both!(Config::default(); bus; [100_000]; |imu| imu.auto_null());
    assert_eq!(bias, Err(Error::Product { answer: 0xFFFF }));
}

#[test]
fn a_factory_restore_returns_the_corrections_that_it_overwrites() {
    let bus = [
        gyro_offsets(0x0001, 0x0002, 0x1FFF),
        read_all(&[(0x20, 0x0800), (0x22, 0x07FF), (0x24, 0xFFFF)]),
        read_all(&[(0x26, 0x2000), (0x28, 0x1FFF), (0x2A, 0x0000)]),
        write(0x3E, 0x02),
        init(0x0001, 0x0402),
    ];
    let lost = both!(Config::default(); bus; [100_000]; |imu| imu.factory_restore()).unwrap();
    assert_eq!(lost.gyro, GyroBias { part: [1, 2, -1], host_x: 0 });
    assert_eq!((lost.accl, lost.hard_iron), ([-2048, 2047, -1], [-8192, 8191, 0]));
}

/// DIAG_STAT is read before the command and after it: a flag from before is not taken for a failure of this update.
#[test]
fn a_flash_update_is_judged_by_flash_cnt_and_by_its_own_flags() {
    let update = |before: Diagnosis, writes: u16, diagnosis: Diagnosis| {
        let bus = [
            read(0x3C, before.bits()),
            read(0x00, 41),
            write(0x3E, 0x08),
            read(0x3C, diagnosis.bits()),
            read(0x00, writes),
        ];
        let result = both!(Config::default(); bus; [100_000]; |imu| imu.flash_update());
        let (Ok(outcome) | Err(Error::FlashUpdate(outcome))) = result else { panic!("{result:?}") };
        assert_eq!((outcome.before, outcome.writes_before), (before, 41));
        assert_eq!((outcome.writes, outcome.diagnosis), (writes, diagnosis));
        result
    };
    let (none, failed, low) = (Diagnosis::empty(), Diagnosis::FLASH_UPDATE, Diagnosis::SUPPLY_LOW);
    for (before, writes, diagnosis) in [(none, 42, none), (failed | low, 42, none), (none, 42, low)] {
        assert!(update(before, writes, diagnosis).is_ok());
    }
    for (before, writes, diagnosis) in [(none, 41, none), (low, 42, failed | low), (failed, 41, none)] {
        assert!(update(before, writes, diagnosis).is_err());
    }
    assert_eq!(
        update(none, 41, failed).unwrap_err().to_string(),
        "flash update failed: FLASH_CNT was 41 and is 41, DIAG_STAT 0x0004"
    );
    assert_eq!(both!(Config::default(); [read(0x00, 9)]; NONE; |imu| imu.flash_writes()), Ok(9));
}

#[test]
fn sleep_writes_one_byte_and_wake_pulses_chip_select() {
    let nap = Sleep::HalfSeconds(NonZeroU8::new(20).unwrap());
    assert_eq!(both!(Config::default(); [write(0x3A, 20)]; NONE; |imu| imu.sleep(nap)), Ok(()));
    let sleep = both!(Config::default(); [write(0x3B, 0x01)]; NONE; |imu| imu.sleep(Sleep::Indefinite));
    assert_eq!(sleep, Ok(()));

    let pulse = vec![Step::Select, Step::Delay(25_000), Step::Deselect, Step::Delay(1_000)];
    let woken = both!(Config::default(); [pulse, read(0x56, 16405)]; [4_000]; |imu| imu.wake());
    assert_eq!(woken, Ok(Product::Adis16405));
}
