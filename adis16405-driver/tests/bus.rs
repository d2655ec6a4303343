//! Exact bytes and pauses on the bus, constants as in the data sheet.

use adis16405_driver::{Access, Adis16405, Config, Error, GyroRange, Register, SamplePeriod};
use embedded_hal_mock::eh1::spi::{Mock, Transaction};

const STALL_NS: u32 = 16_000;

fn frame_with(stall_ns: u32, sent: &[u8], answer: &[u8]) -> [Transaction<u8>; 4] {
    [
        Transaction::transaction_start(),
        Transaction::transfer(sent.to_vec(), answer.to_vec()),
        Transaction::delay(stall_ns),
        Transaction::transaction_end(),
    ]
}

fn frame(sent: [u8; 2], answer: [u8; 2]) -> [Transaction<u8>; 4] {
    frame_with(STALL_NS, &sent, &answer)
}

/// A read: the address, then 0x0000 during which the answer comes.
fn read(address: u8, answer: u16) -> Vec<Transaction<u8>> {
    [frame([address, 0], [0xA5, 0x5A]), frame([0, 0], answer.to_be_bytes())].concat()
}

/// A write of one byte: bit 15 and the byte's own address.
fn write(address: u8, byte: u8) -> Vec<Transaction<u8>> {
    frame([0x80 | address, byte], [0xA5, 0x5A]).to_vec()
}

/// What ends an `init`: XGYRO_OFF to ZGYRO_OFF in four frames, each with the answer to the one before.
fn gyro_offsets(x: u16) -> Vec<Transaction<u8>> {
    let frames = [([0x1A, 0], 0xA55A), ([0x1C, 0], x), ([0x1E, 0], 0x0000), ([0, 0], 0x0000)];
    frames.into_iter().flat_map(|(sent, answer)| frame(sent, u16::to_be_bytes(answer))).collect()
}

fn on_bus<T>(config: Config, expected: &[Vec<Transaction<u8>>], run: impl FnOnce(&mut Adis16405<Mock<u8>>) -> T) -> T {
    let mut imu = Adis16405::new(Mock::new(&expected.concat()), config);
    let result = run(&mut imu);
    imu.release().done();
    result
}

fn config(range: GyroRange, taps: u8, smpl_prd: u8) -> Config {
    Config::new(range, taps, SamplePeriod::from_register(smpl_prd).unwrap()).unwrap()
}

#[test]
fn new_sends_nothing() {
    on_bus(Config::default(), &[], |_| ());
}

#[test]
fn init_of_a_part_that_is_already_configured_only_reads() {
    for product in [16405, 16400] {
        let bus = [read(0x56, product), read(0x36, 0x0001), read(0x38, 0x0402), gyro_offsets(0)];
        on_bus(Config::default(), &bus, |imu| imu.init()).unwrap();
    }
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
        gyro_offsets(0),
    ];
    on_bus(config(GyroRange::Dps75, 4, 0x07), &bus, |imu| imu.init()).unwrap();
}

#[test]
fn init_writes_only_the_byte_that_changes() {
    // Bits outside the registers (SMPL_PRD has 8, SENS_AVG 11) must not matter.
    let bus = [
        read(0x56, 0x4015),
        read(0x36, 0xFF01),
        read(0x38, 0xF802),
        write(0x39, 0x04),
        read(0x38, 0xF402),
        gyro_offsets(0),
    ];
    on_bus(Config::default(), &bus, |imu| imu.init()).unwrap();
    let bus = [
        read(0x56, 0x4015),
        read(0x36, 0x0001),
        read(0x38, 0x0402),
        write(0x38, 0x06),
        read(0x38, 0x0406),
        gyro_offsets(0),
    ];
    on_bus(config(GyroRange::Dps300, 6, 0x01), &bus, |imu| imu.init()).unwrap();
}

#[test]
fn init_refuses_another_part() {
    for answer in [0x0000, 0xFFFF, 0x4040, 0x0003] {
        let result = on_bus(Config::default(), &[read(0x56, answer)], |imu| imu.init());
        assert_eq!(result, Err(Error::Product { answer }));
    }
}

#[test]
fn init_reports_a_register_that_does_not_take_its_value() {
    let bus = [read(0x56, 0x4015), read(0x36, 0x0001), write(0x36, 0x07), read(0x36, 0x0001)];
    let result = on_bus(config(GyroRange::Dps300, 2, 0x07), &bus, |imu| imu.init());
    assert_eq!(result, Err(Error::Verify { register: Register::SmplPrd, expected: 7, answer: 1 }));
    assert_eq!(result.unwrap_err().to_string(), "SMPL_PRD was written 0x0007 and answered 0x0001");
}

#[test]
fn the_low_power_mode_stalls_longer() {
    let bus = [frame_with(75_000, &[0x3C, 0], &[0, 0]), frame_with(75_000, &[0, 0], &[0x12, 0x34])].map(Vec::from);
    let value = on_bus(config(GyroRange::Dps300, 2, 0x09), &bus, |imu| imu.read_register(Register::DiagStat));
    assert_eq!(value, Ok(0x1234));
}

#[test]
fn the_stall_can_be_set() {
    let mut imu = Adis16405::new(Mock::new(&frame_with(9_000, &[0xBE, 0x80], &[0, 0])), Config::default());
    imu = imu.with_stall_ns(9_000);
    imu.write_register(Register::GlobCmd, 0x80).unwrap();
    imu.release().done();
}

#[test]
fn registers_are_written_byte_by_byte() {
    let bus = [write(0x1A, 0x34), write(0x1B, 0x12), write(0x36, 0x07)];
    on_bus(Config::default(), &bus, |imu| {
        imu.write_register(Register::XgyroOff, 0x1234).unwrap();
        imu.write_register(Register::SmplPrd, 0x07).unwrap();
    });
}

#[test]
fn access_is_respected_without_touching_the_bus() {
    for &register in Register::ALL {
        if register.access() == Access::Read {
            let result = on_bus(Config::default(), &[], |imu| imu.write_register(register, 0));
            assert_eq!(result, Err(Error::ReadOnly(register)));
        }
    }
    for register in [Register::GlobCmd, Register::SlpCnt] {
        let result = on_bus(Config::default(), &[], |imu| imu.read_register(register));
        assert_eq!(result, Err(Error::WriteOnly(register)));
    }
}

#[test]
fn a_burst_is_one_transaction_of_26_bytes() {
    let mut sent = [0; 26];
    sent[0] = 0x3E;
    let mut answer = [0xA5; 26];
    for (index, byte) in answer[2..].iter_mut().enumerate() {
        *byte = 0x80 + index as u8;
    }
    let bus = [frame_with(STALL_NS, &sent, &answer).to_vec()];
    let burst = on_bus(Config::default(), &bus, |imu| imu.burst()).unwrap();
    assert_eq!(burst.words[0].0, 0x8081);
    assert_eq!(burst.words[11].0, 0x9697);
}

/// The register map of the data sheet: the address of a register's lower byte.
#[test]
fn addresses() {
    let mut expected: Vec<u8> = (0x00..=0x4A).step_by(2).collect();
    expected.push(0x56);
    let addresses: Vec<u8> = Register::ALL.iter().map(|register| register.address()).collect();
    assert_eq!(addresses, expected);
    for (register, address, bits) in [
        (Register::ZgyroOff, 0x1E, 13),
        (Register::XacclOff, 0x20, 12),
        (Register::XmagnHif, 0x26, 14),
        (Register::GpioCtrl, 0x32, 12),
        (Register::MscCtrl, 0x34, 12),
        (Register::SmplPrd, 0x36, 8),
        (Register::SensAvg, 0x38, 11),
        (Register::SlpCnt, 0x3A, 9),
        (Register::DiagStat, 0x3C, 16),
        (Register::GlobCmd, 0x3E, 8),
        (Register::AlmCtrl, 0x48, 16),
        (Register::AuxDac, 0x4A, 12),
        (Register::ProdId, 0x56, 16),
    ] {
        assert_eq!((register.address(), register.bits()), (address, bits), "{}", register.name());
    }
}
