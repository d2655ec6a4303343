//! Internal self-test, flash test, manual self-test. MSC_CTRL 0x34: bit 11 flash test, 10 internal self-test, 9 and 8
//! manual self-test, negative and positive.

use adis16405_driver::{Config, Diagnosis, Error, Register, Stimulus};

use super::harness::{Frames, NONE, read, read_all, write};

#[test]
fn a_self_test_is_polled_until_its_bit_clears() {
    let bus = [
        read(0x56, 16405),
        read(0x3C, 0x0001),
        read(0x34, 0x0086),
        write(0x35, 0x04),
        read(0x34, 0x0486),
        read(0x34, 0x0486),
        read(0x34, 0x0086),
        read(0x3C, 0x1020),
        read(0x34, 0x0086),
    ];
    let outcome = both!(Config::default(); bus; [1_000, 1_000]; |imu| imu.self_test()).unwrap();
    let diagnosis = Diagnosis::GYRO_Z | Diagnosis::SELF_TEST;
    assert_eq!((outcome.before, outcome.ran, outcome.diagnosis), (Diagnosis::SUPPLY_LOW, true, diagnosis));
    assert!(!outcome.passed());
}

#[test]
fn a_self_test_switches_a_manual_self_test_off() {
    let bus = [
        read(0x56, 16405),
        read(0x3C, 0),
        read(0x34, 0x0106),
        write(0x35, 0x04),
        read(0x34, 0x0406),
        read(0x34, 0x0006),
        read(0x3C, 0),
        read(0x34, 0x0006),
    ];
    let outcome = both!(Config::default(); bus; [1_000]; |imu| imu.self_test()).unwrap();
    assert!(outcome.passed());
}

/// A sleeping part never shows the test bit set, and reports no failure. That is not a pass.
#[test]
fn a_test_that_did_not_run_is_not_passed() {
    let bus = || {
        [
            read(0x56, 16405),
            read(0x3C, 0),
            read(0x34, 6),
            write(0x35, 0x04),
            read(0x34, 6),
            read(0x3C, 0),
            read(0x34, 6),
        ]
    };
    let outcome = both!(Config::default(); bus(); NONE; |imu| imu.self_test()).unwrap();
    assert_eq!((outcome.ran, outcome.diagnosis, outcome.passed()), (false, Diagnosis::empty(), false));
}

/// The test takes 17 ms; the deadline is 34 ms, and the poll interval 1 ms.
#[test]
fn a_flash_test_that_does_not_end_is_an_error_at_the_deadline() {
    let mut bus = vec![read(0x56, 16405), read(0x3C, 0), read(0x34, 6), write(0x35, 0x08)];
    bus.extend((0..35).map(|_| read(0x34, 0x0806)));
    let pauses = [1_000; 34];
    let outcome = both!(Config::default(); bus; pauses; |imu| imu.flash_test());
    assert_eq!(outcome, Err(Error::Deadline { register: Register::MscCtrl, mask: 0x0800, waited_us: 34_000 }));
    let text = outcome.unwrap_err().to_string();
    assert_eq!(text, "MSC_CTRL still has bits of 0x0800 set after 34000 µs");
}

#[test]
fn a_flash_test_reports_a_wrong_checksum() {
    let bus = [
        read(0x56, 16405),
        read(0x3C, 0),
        read(0x34, 6),
        write(0x35, 0x08),
        read(0x34, 0x0806),
        read(0x34, 6),
        read(0x3C, 0x0040),
        read(0x34, 6),
    ];
    let outcome = both!(Config::default(); bus; [1_000]; |imu| imu.flash_test()).unwrap();
    let flash_checksum = Diagnosis::FLASH_CHECKSUM;
    assert_eq!((outcome.before, outcome.ran, outcome.diagnosis), (Diagnosis::empty(), true, flash_checksum));
    assert!(!outcome.passed());
}

#[test]
fn a_stimulus_response_is_a_difference_of_means_and_the_stimulus_is_switched_off() {
    for (stimulus, bit) in [(Stimulus::Positive, 0x01u8), (Stimulus::Negative, 0x02)] {
        let sample = |k: u16| {
            read_all(&[
                (0x04, 0x8000 | k),
                (0x06, 0xBFFF),
                (0x08, 0x8000),
                (0x0A, 0x8000 + k / 2),
                (0x0C, 0x8000),
                (0x0E, 0xBED4),
            ])
        };
        let mut bus: Vec<Frames> = vec![read(0x34, 0x0006)];
        bus.extend((0..8).map(|_| sample(10)));
        bus.extend([read(0x34, 0x0006), write(0x35, bit), read(0x34, u16::from(bit) << 8 | 6)]);
        bus.extend((0..8).map(|_| sample(500)));
        bus.extend([read(0x34, u16::from(bit) << 8 | 6), write(0x35, 0x00), read(0x34, 0x0006)]);
        // 12 ms and eight sample periods until the filter of 2 · 4 taps has settled, then 2 · 0.611 ms per sample.
        let mean = [[12_000 + 8 * 1_222].as_slice(), [1_222; 8].as_slice()].concat();
        let pauses = [mean.clone(), mean].concat();
        let response = both!(Config::default(); bus.clone(); pauses.clone();
            |imu| imu.stimulus_response(stimulus));
        assert_eq!(response, Ok([490, 0, 0, 245, 0, 0]), "{stimulus:?}");
    }
}

#[test]
fn a_diagnosis_has_the_bits_that_were_read() {
    for bits in [0x0000, 0xFFFF, 0x0080, 0x8420] {
        let diagnosis = both!(Config::default(); [read(0x3C, bits)]; NONE; |imu| imu.diagnosis());
        assert_eq!(diagnosis.map(|diagnosis| diagnosis.bits()), Ok(bits));
    }
}
