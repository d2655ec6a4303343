//! GLOB_CMD 0x3E: bit 4 precision auto-null, 3 flash update, 1 factory restore, 0 auto-null; and sleep, SLP_CNT 0x3A.

use core::num::NonZeroU8;

use adis16405_driver::{Config, Diagnosis, Error, FactoryRestore, GyroBias, Product, Sleep};
use embedded_hal_mock::eh1::spi::Transaction;

use crate::harness::{NONE, gyro_offsets, init, read, read_all, write};

#[test]
fn an_auto_null_is_followed_by_silence_and_moves_a_negative_x_to_the_host() {
    let bus = [write(0x3E, 0x01), read(0x56, 16405), gyro_offsets(0x0028, 0xFFD8, 0x0000)];
    let bias = both!(Config::default(); bus; [50_000]; |imu, delay| imu.auto_null(&mut delay));
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
    let bias = both!(Config::default(); bus; [30_000_000]; |imu, delay| imu.precision_auto_null(&mut delay)).unwrap();
    assert_eq!(bias, GyroBias { part: [0, 1, 0], host_x: -40 });
    assert_eq!(bias.total(), [-40, 1, 0]);
}

#[test]
fn a_part_that_is_gone_after_a_null_is_noticed() {
    let bus = [write(0x3E, 0x01), read(0x56, 0xFFFF)];
    let bias = both!(Config::default(); bus; [50_000]; |imu, delay| imu.auto_null(&mut delay));
    assert_eq!(bias, Err(Error::Product { answer: 0xFFFF }));
}

#[test]
fn a_factory_restore_reads_what_it_will_overwrite() {
    let bus = [
        gyro_offsets(0x0001, 0x0002, 0x1FFF),
        read_all(&[(0x20, 0x0800), (0x22, 0x07FF), (0x24, 0xFFFF)]),
        read_all(&[(0x26, 0x2000), (0x28, 0x1FFF), (0x2A, 0x0000)]),
        read_all(&[(0x2C, 0x0800), (0x2E, 0xF801), (0x30, 0x0000)]),
        write(0x3E, 0x02),
        init(0x0001, 0x0402),
    ];
    let lost = both!(Config::default(); bus; [50_000]; |imu, delay| imu.factory_restore(&mut delay));
    let expected = FactoryRestore {
        gyro: GyroBias { part: [1, 2, -1], host_x: 0 },
        accl: [-2048, 2047, -1],
        hard_iron: [-8192, 8191, 0],
        soft_iron: [0x0800, 0x0801, 0x0000],
    };
    assert_eq!(lost, Ok(expected));
}

#[test]
fn a_flash_update_is_believed_only_if_it_was_counted() {
    let bus = [read(0x00, 41), write(0x3E, 0x08), read(0x3C, 0x0000), read(0x00, 42)];
    assert_eq!(both!(Config::default(); bus; [100_000]; |imu, delay| imu.flash_update(&mut delay)), Ok(42));

    for (diagnosis, after) in [(Diagnosis::empty(), 41), (Diagnosis::FLASH_UPDATE | Diagnosis::SUPPLY_LOW, 42)] {
        let bus = [read(0x00, 41), write(0x3E, 0x08), read(0x3C, diagnosis.bits()), read(0x00, after)];
        let outcome = both!(Config::default(); bus; [100_000]; |imu, delay| imu.flash_update(&mut delay));
        assert_eq!(outcome, Err(Error::FlashUpdate { before: 41, after, diagnosis }));
    }
    let error: Error<()> = Error::FlashUpdate { before: 41, after: 41, diagnosis: Diagnosis::FLASH_UPDATE };
    assert_eq!(error.to_string(), "flash update failed: FLASH_CNT was 41 and is 41, DIAG_STAT 0x0004");
    assert_eq!(both!(Config::default(); [read(0x00, 9)]; NONE; |imu, delay| imu.flash_writes()), Ok(9));
}

#[test]
fn sleep_is_one_byte_and_waking_a_pulse_of_chip_select() {
    let nap = Sleep::HalfSeconds(NonZeroU8::new(20).unwrap());
    assert_eq!(both!(Config::default(); [write(0x3A, 20)]; NONE; |imu, delay| imu.sleep(nap)), Ok(()));
    let sleep = both!(Config::default(); [write(0x3B, 0x01)]; NONE; |imu, delay| imu.sleep(Sleep::Indefinite));
    assert_eq!(sleep, Ok(()));

    let pulse = vec![Transaction::transaction_start(), Transaction::delay(10_000), Transaction::transaction_end()];
    let woken = both!(Config::default(); [pulse, read(0x56, 16405)]; [4_000]; |imu, delay| imu.wake(&mut delay));
    assert_eq!(woken, Ok(Product::Adis16405));
}
