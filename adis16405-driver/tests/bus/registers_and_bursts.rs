//! Reads and writes of registers, and bursts.

use adis16405_driver::{
    Access, Adis16405, Config, Error, GyroRange, Register, SamplePeriod, SelectDuringStall, Timing,
};

use super::harness::{
    BURST_STALL_NS, Bench, Frames, NONE, SLOW_STALL_NS, STALL_NS, Step, frame_with, read, read_all, write,
};

fn config(range: GyroRange, taps: u8, smpl_prd: u8) -> Config {
    Config::new(range, taps, SamplePeriod::from_register(smpl_prd).unwrap()).unwrap()
}

/// Other times than the default ones.
fn timing(change: impl FnOnce(&mut Timing)) -> Timing {
    let mut timing = Timing::DEFAULT;
    change(&mut timing);
    timing
}

#[test]
fn new_sends_nothing() {
    // An empty bench refuses every step.
    let bench = Bench::new([], NONE);
    let (spi, delay) = Adis16405::new(bench.clone(), bench.clone(), Config::default()).release();
    #[cfg(feature = "async")]
    Adis16405::new_async(spi.clone(), delay.clone(), Config::default());
    spi.done();
    delay.done();
}

#[test]
fn a_read_is_two_frames_and_several_reads_overlap() {
    let value = both!(Config::default(); [read(0x3C, 0x1234)]; NONE; |imu| imu.read_register(Register::DiagStat));
    assert_eq!(value, Ok(0x1234));
    let registers = [Register::XgyroOut, Register::TempOut, Register::ProdId];
    let bus = [read_all(&[(0x04, 0x8001), (0x16, 0x8002), (0x56, 0x4015)])];
    let values = both!(Config::default(); bus; NONE; |imu| imu.read_registers(registers));
    assert_eq!(values, Ok([0x8001, 0x8002, 0x4015]));
    let nothing = both!(Config::default(); [Frames::new()]; NONE; |imu| imu.read_registers([]));
    assert_eq!(nothing, Ok([]));
}

#[test]
fn the_stall_is_that_of_low_power_mode_above_0x08() {
    let slow = |answer: [u8; 2], sent: [u8; 2]| frame_with(SLOW_STALL_NS, &sent, &answer);
    let bus = [slow([0, 0], [0x3C, 0]), slow([0x12, 0x34], [0, 0])];
    let low_power = config(GyroRange::Dps300, 2, 0x09);
    assert_eq!(both!(low_power; bus; NONE; |imu| imu.read_register(Register::DiagStat)), Ok(0x1234));
}

/// Linux has the limit of normal mode one higher than the data sheet.
#[test]
fn the_limit_of_normal_mode_can_be_set() {
    let timing = timing(|timing| timing.normal_mode_max_smpl_prd = 0x09);
    let config = config(GyroRange::Dps300, 2, 0x09);
    let value = both!(config, with [.with_timing(timing)]; [read(0x00, 7)]; NONE; |imu| imu.flash_writes());
    assert_eq!(value, Ok(7));
}

/// Data sheet Rev. B, Table 2 and Figure 3: at least 40 µs from one falling edge of chip select to the next in normal mode, 150 µs
/// in low-power mode, and at least 9 µs or 75 µs between the frames. A frame takes 16 periods of SCK.
#[test]
fn the_stall_keeps_the_read_rate_at_every_clock() {
    let (normal, low_power) = (Config::default(), config(GyroRange::Dps300, 2, 0x7F));
    for (config, sck_hz, set_ns, stall_ns) in [
        (normal, 2_000_000, 9_000, 32_000),
        (normal, 1_000_000, 9_000, 24_000),
        (normal, 1_000_000, 30_000, 30_000),
        // 24.38 µs of 40 µs; the driver takes the clock for 657 kHz.
        (normal, 656_250, 9_000, 15_647),
        (normal, 300_000, 9_000, 9_000),
        (normal, 10_000, 9_000, 9_000),
        (low_power, 300_000, 75_000, 96_667),
        (low_power, 100_000, 75_000, 75_000),
    ] {
        let read_rate_ns = 1e9 * 16.0 / f64::from(sck_hz) + f64::from(stall_ns);
        assert!(read_rate_ns >= if config == normal { 40e3 } else { 150e3 } - 0.5, "{sck_hz} Hz");
        let bus = [frame_with(stall_ns, &[0xBE, 0x80], &[0, 0])];
        let written = both!(config, with [.with_stall_ns(set_ns).with_sck_hz(sck_hz)]; bus; NONE;
            |imu| imu.write_register(Register::GlobCmd, 0x80));
        assert_eq!(written, Ok(()), "{sck_hz} Hz");
    }
}

/// Linux, PX4 and Canopus raise chip select between frames and wait then.
#[test]
fn chip_select_is_high_during_the_stall_unless_it_is_set_to_be_low() {
    let exchange = Step::Exchange { sent: vec![0xBE, 0x80], answer: vec![0, 0] };
    let (select, deselect) = (Step::Select, Step::Deselect);
    let high = |ns| vec![select.clone(), exchange.clone(), deselect.clone(), Step::Delay(ns)];
    let low = |stall_ns, high_ns: Option<u32>| {
        let inside = [select.clone(), exchange.clone(), Step::Delay(stall_ns), deselect.clone()];
        inside.into_iter().chain(high_ns.map(Step::Delay)).collect::<Frames>()
    };
    let default = Timing::DEFAULT;
    assert_eq!((default.stall_select, default.select_high_ns), (SelectDuringStall::High, 1_000));
    let held_low = timing(|timing| timing.stall_select = SelectDuringStall::Low);
    let mut pulsed = held_low;
    pulsed.select_high_ns = 0;
    for (timing, bus) in [
        (default, high(STALL_NS)),
        (timing(|timing| timing.select_high_ns = 50_000), high(50_000)),
        (held_low, low(STALL_NS, Some(1_000))),
        (pulsed, low(STALL_NS, None)),
    ] {
        let written = both!(Config::default(), with [.with_timing(timing)]; [bus.clone()]; NONE;
            |imu| imu.write_register(Register::GlobCmd, 0x80));
        assert_eq!(written, Ok(()), "{timing:?}");
    }
}

#[test]
fn registers_are_written_by_bytes_with_the_lower_first() {
    let bus = [write(0x1A, 0x34), write(0x1B, 0x12)];
    let written = both!(Config::default(); bus; NONE; |imu| imu.write_register(Register::XgyroOff, 0x1234));
    assert_eq!(written, Ok(()));
    let bus = [write(0x36, 0x07)];
    let written = both!(Config::default(); bus; NONE; |imu| imu.write_register(Register::SmplPrd, 0xFF07));
    assert_eq!(written, Ok(()), "SMPL_PRD has one byte");
}

#[test]
fn an_update_writes_the_bytes_that_change_and_reads_back() {
    let update = |bus: Vec<Frames>, mask, value| both!(Config::default(); bus.clone(); NONE; |imu| imu.update_register(Register::AlmCtrl, mask, value));
    assert_eq!(update(vec![read(0x48, 0x1234)], 0x00F0, 0x0030), Ok(()), "nothing changes");
    assert_eq!(update(vec![read(0x48, 0x1234), write(0x48, 0x54), read(0x48, 0x1254)], 0x00F0, 0xFF5F), Ok(()));
    assert_eq!(update(vec![read(0x48, 0x1234), write(0x49, 0xA2), read(0x48, 0xA234)], 0xF000, 0xA000), Ok(()));
    let both_bytes = vec![read(0x48, 0x1234), write(0x48, 0xCD), write(0x49, 0xAB), read(0x48, 0xABCD)];
    assert_eq!(update(both_bytes, 0xFFFF, 0xABCD), Ok(()));
    // Other bits of the register may change in between.
    assert_eq!(update(vec![read(0x48, 0x1234), write(0x48, 0x54), read(0x48, 0xFF5F)], 0x00F0, 0x0050), Ok(()));
    let refused = update(vec![read(0x48, 0x1234), write(0x48, 0x54), read(0x48, 0x1234)], 0x00F0, 0x0050);
    assert_eq!(refused, Err(Error::Verify { register: Register::AlmCtrl, expected: 0x0050, answer: 0x0030 }));
}

#[test]
fn without_verification_nothing_is_read_back() {
    let bus = [read(0x36, 0x0001), write(0x36, 0x05)];
    let written = both!(Config::default(), with [.with_verified_writes(false)]; bus; NONE;
        |imu| imu.update_register(Register::SmplPrd, 0xFFFF, 0x05));
    assert_eq!(written, Ok(()));
}

#[test]
fn a_forbidden_access_is_refused_without_bus_traffic() {
    for &register in Register::ALL {
        if register.access() == Access::Read {
            let refused = Err(Error::ReadOnly(register));
            let empty = [Frames::new()];
            assert_eq!(both!(Config::default(); empty; NONE; |imu| imu.write_register(register, 0)), refused);
            let empty = [Frames::new()];
            assert_eq!(both!(Config::default(); empty; NONE; |imu| imu.update_register(register, 1, 1)), refused);
        }
    }
    for register in [Register::GlobCmd, Register::SlpCnt] {
        let refused = Err(Error::WriteOnly(register));
        let read = both!(Config::default(); [Frames::new()]; NONE; |imu| imu.read_register(register));
        assert_eq!(read, refused.map(|()| 0));
        let several = both!(Config::default(); [Frames::new()]; NONE;
            |imu| imu.read_registers([Register::ProdId, register]));
        assert_eq!(several, refused.map(|()| [0, 0]));
        let updated = both!(Config::default(); [Frames::new()]; NONE; |imu| imu.update_register(register, 1, 1));
        assert_eq!(updated, refused);
    }
}

/// The bytes sent, 0x3E00 and zeros, and those received, whose words start with the third byte.
fn burst_bytes() -> ([u8; 26], [u8; 26]) {
    let mut sent = [0; 26];
    sent[0] = 0x3E;
    let mut answer = [0xA5; 26];
    for (index, byte) in answer[2..].iter_mut().enumerate() {
        *byte = 0x80 + index as u8;
    }
    (sent, answer)
}

#[test]
fn a_burst_is_one_transaction_of_26_bytes() {
    let (sent, answer) = burst_bytes();
    let bus = [frame_with(BURST_STALL_NS, &sent, &answer)];
    let burst = both!(Config::default(); bus; NONE; |imu| imu.burst()).unwrap();
    assert_eq!(burst.words[0].0, 0x8081);
    assert_eq!(burst.words[11].0, 0x9697);

    let bench = Bench::new([], NONE);
    let sample = Adis16405::new(bench.clone(), bench, config(GyroRange::Dps75, 4, 1)).sample_from(burst);
    assert_eq!((*sample.counts(), sample.range()), (burst.counts(), GyroRange::Dps75));
}

#[test]
fn a_word_gap_splits_a_burst_into_13_transfers() {
    let (sent, answer) = burst_bytes();
    let word = |word: usize| {
        let bytes = 2 * word..2 * word + 2;
        Step::Exchange { sent: sent[bytes.clone()].to_vec(), answer: answer[bytes].to_vec() }
    };
    let between = || (0..12).flat_map(|index| [word(index), Step::Delay(1_000)]);
    let high =
        [Step::Select].into_iter().chain(between()).chain([word(12), Step::Deselect, Step::Delay(BURST_STALL_NS)]);
    let low = [Step::Select].into_iter().chain(between()).chain([
        word(12),
        Step::Delay(BURST_STALL_NS),
        Step::Deselect,
        Step::Delay(1_000),
    ]);
    let gaps = timing(|timing| timing.word_gap_ns = 1_000);
    let mut held_low = gaps;
    held_low.stall_select = SelectDuringStall::Low;
    for (timing, bus) in [(gaps, high.collect::<Frames>()), (held_low, low.collect())] {
        let burst = both!(Config::default(), with [.with_timing(timing)]; [bus.clone()]; NONE; |imu| imu.burst());
        assert_eq!(burst.unwrap().words.map(|word| word.0)[..2], [0x8081, 0x8283]);
        assert_eq!(burst.unwrap().words[11].0, 0x9697);
    }
}

/// The addresses of the lower bytes, and widths, of the data sheet's register map.
#[test]
fn registers_have_the_addresses_and_widths_of_the_data_sheet() {
    let mut expected: Vec<u8> = (0x00..=0x4A).step_by(2).collect();
    expected.push(0x56);
    let addresses: Vec<u8> = Register::ALL.iter().map(|register| register.address()).collect();
    assert_eq!(addresses, expected);
    for (register, address, bits) in [
        (Register::ZgyroOff, 0x1E, 13),
        (Register::XacclOff, 0x20, 12),
        (Register::XmagnHif, 0x26, 14),
        (Register::XmagnSif, 0x2C, 12),
        (Register::GpioCtrl, 0x32, 12),
        (Register::MscCtrl, 0x34, 12),
        (Register::SmplPrd, 0x36, 8),
        (Register::SensAvg, 0x38, 11),
        (Register::SlpCnt, 0x3A, 9),
        (Register::DiagStat, 0x3C, 16),
        (Register::GlobCmd, 0x3E, 8),
        (Register::AlmMag2, 0x42, 16),
        (Register::AlmSmpl1, 0x44, 8),
        (Register::AlmCtrl, 0x48, 16),
        (Register::AuxDac, 0x4A, 12),
        (Register::ProdId, 0x56, 16),
    ] {
        assert_eq!((register.address(), register.bits()), (address, bits), "{}", register.name());
    }
}
