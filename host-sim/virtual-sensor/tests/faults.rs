//! What the part does when it is cold, latched, strict about its bus, or reset by its pin: words on the bus, without the
//! driver. Times and bits are those of the data sheet.

use virtual_sensor::{
    Activity, BusyAnswers, DiagnosisFlag, EmulatedBus, NoiseModel, Violation, ViolationKind, VirtualAdis16405,
};

use embedded_hal::digital::OutputPin;

const MS: u64 = 1_000_000;

fn part() -> VirtualAdis16405 {
    VirtualAdis16405::new(NoiseModel::noiseless(), 1)
}

/// Exchanges one frame, `pause_ns` after chip select rose from the frame before.
fn frame_after(part: &mut VirtualAdis16405, pause_ns: u64, word: u16) -> u16 {
    part.advance_to(part.now() + pause_ns);
    part.select();
    let answer = part.transfer(word);
    part.deselect();
    answer
}

fn read(part: &mut VirtualAdis16405, address: u8) -> u16 {
    frame_after(part, 20_000, u16::from(address) << 8);
    frame_after(part, 20_000, 0x0000)
}

fn burst(part: &mut VirtualAdis16405) -> [u16; 12] {
    part.advance_to(part.now() + 20_000);
    part.select();
    part.transfer(0x3E00);
    let words = std::array::from_fn(|_| part.transfer(0));
    part.deselect();
    words
}

fn kinds(part: &VirtualAdis16405) -> Vec<ViolationKind> {
    part.violations().iter().map(|violation| violation.kind).collect()
}

#[test]
fn a_cold_part_answers_nonsense_until_its_start_up_is_over() {
    for (answers, expected) in
        [(BusyAnswers::Zeros, Some(0x0000)), (BusyAnswers::Ones, Some(0xFFFF)), (BusyAnswers::Garbage, None)]
    {
        let mut part = VirtualAdis16405::cold(NoiseModel::noiseless(), 1);
        part.set_busy_answers(answers);
        part.advance_to(219 * MS);
        let words: Vec<u16> = (0..20).map(|_| frame_after(&mut part, 20_000, 0x5600)).collect();
        match expected {
            Some(word) => assert!(words.iter().all(|answer| *answer == word), "{answers:?}: {words:04x?}"),
            None => assert!(words.windows(2).all(|pair| pair[0] != pair[1]), "{answers:?}: {words:04x?}"),
        }
        assert_eq!(kinds(&part), vec![ViolationKind::Busy { activity: Activity::StartUp }; 20]);
        assert_eq!(part.samples(), 0);
        part.advance_to(220 * MS);
        assert_eq!(read(&mut part, 0x56), 0x4015);
        assert_eq!(part.violation_count(), 20);
    }
}

#[test]
fn a_write_to_a_cold_part_is_lost() {
    let mut part = VirtualAdis16405::cold(NoiseModel::noiseless(), 1);
    part.advance_to(219 * MS);
    frame_after(&mut part, 20_000, 0xB607);
    part.advance_to(220 * MS);
    assert_eq!(read(&mut part, 0x36), 0x0001);
}

#[test]
fn a_start_up_takes_longer_in_low_power_mode_or_as_long_as_is_set() {
    let mut part = part();
    // SMPL_PRD = 0x0F is stored in flash.
    frame_after(&mut part, 20_000, 0xB60F);
    frame_after(&mut part, 80_000, 0xBE08);
    part.advance_to(part.now() + 100 * MS);
    for (set_ns, expected_ns) in [(None, 290 * MS), (Some(250 * MS), 250 * MS)] {
        part.set_start_up_ns(set_ns);
        part.power_off();
        part.advance_to(part.now() + MS);
        part.power_on();
        let on = part.now();
        let period_ns = 16 * 610_352;
        assert!(part.next_data_ready() > 1 << 62, "it does not sample yet");
        part.advance_to(on + expected_ns - 1);
        assert!(part.next_data_ready() > 1 << 62);
        part.advance_to(on + expected_ns);
        assert!(part.next_data_ready().abs_diff(on + expected_ns + period_ns) < 10);
    }
}

#[test]
fn every_flag_latches_alone_and_shows_in_the_burst_until_it_is_read() {
    for flag in DiagnosisFlag::ALL {
        let mut part = part();
        part.advance_to(part.next_data_ready());
        part.latch_flag(flag);
        for _ in 0..3 {
            assert!(burst(&mut part).iter().all(|word| word & 0x4000 != 0), "{flag:?}");
            part.advance_to(part.next_data_ready());
        }
        assert_eq!(read(&mut part, 0x3C), 1 << flag as u8, "{flag:?}");
        assert!(burst(&mut part).iter().all(|word| word & 0x4000 == 0), "{flag:?}");
        assert_eq!(read(&mut part, 0x3C), 0);
    }
    // All bits but the unused one, 7.
    assert_eq!(DiagnosisFlag::ALL.iter().fold(0, |all, flag| all | flag.bit()), 0xFF7F);
}

#[test]
fn a_held_flag_comes_back_with_the_next_sample() {
    let mut part = part();
    part.hold_flag(DiagnosisFlag::SupplyLow, true);
    assert_eq!(read(&mut part, 0x3C), 0);
    part.advance_to(part.next_data_ready());
    assert_eq!(read(&mut part, 0x3C), 0x0001);
    assert_eq!(read(&mut part, 0x3C), 0x0000, "cleared by the read, until the next sample");
    part.advance_to(part.next_data_ready());
    part.hold_flag(DiagnosisFlag::SupplyLow, false);
    assert_eq!(read(&mut part, 0x3C), 0x0001);
    part.advance_to(part.next_data_ready());
    assert_eq!(read(&mut part, 0x3C), 0x0000);
}

#[test]
fn a_strict_part_needs_chip_select_high_between_frames() {
    // By default chip select may rise and fall at once; the stall counts from the last clock.
    let mut lenient = part();
    let mut strict = part();
    strict.set_strict_select(Some(1_000));
    for part in [&mut lenient, &mut strict] {
        part.select();
        part.transfer(0x5600);
        part.advance_to(part.now() + 16_000);
        part.deselect();
        part.advance_to(part.now() + 999);
    }
    lenient.select();
    assert_eq!(lenient.transfer(0x0000), 0x4015);
    lenient.deselect();
    assert_eq!(lenient.violations(), []);

    strict.select();
    assert_ne!(strict.transfer(0xB607), 0x4015, "garbled");
    strict.deselect();
    let kind = ViolationKind::SelectHigh { high_ns: 999, least_ns: 1_000 };
    assert_eq!(strict.violations(), [Violation { at_ns: 16_999, kind }]);
    assert!(strict.violations()[0].to_string().contains("999 ns"));
    // The write did not happen, and the flag of the SPI port latched.
    assert_eq!(read(&mut strict, 0x36), 0x0001);
    assert_eq!(read(&mut strict, 0x3C), 0x0008);
    assert_eq!(read(&mut strict, 0x3C), 0x0000);
    // With chip select high for 1 µs and the stall kept, all is well.
    frame_after(&mut strict, 9_000, 0x5600);
    assert_eq!(frame_after(&mut strict, 9_000, 0x0000), 0x4015);
    assert_eq!(strict.violation_count(), 1);
}

#[test]
fn a_strict_part_needs_chip_select_to_rise_between_frames_but_not_in_a_burst() {
    let mut part = part();
    part.set_strict_select(Some(1_000));
    part.advance_to(part.next_data_ready());
    assert!(burst(&mut part)[1..7].iter().all(|word| word & 0x8000 != 0));
    assert_eq!(part.violations(), []);
    part.advance_to(part.now() + 20_000);
    part.select();
    part.transfer(0x5600);
    part.advance_to(part.now() + 20_000);
    assert_ne!(part.transfer(0x0000), 0x4015);
    part.deselect();
    assert_eq!(kinds(&part), [ViolationKind::SelectHigh { high_ns: 0, least_ns: 1_000 }]);
}

#[test]
fn too_short_a_stall_garbles_the_frame_of_a_strict_part() {
    for (strict, expected) in [(false, 0x4015), (true, 0x4015 ^ 0xA5A5u16)] {
        let mut part = part();
        part.set_strict_select(strict.then_some(1_000));
        frame_after(&mut part, 20_000, 0x5600);
        let answer = frame_after(&mut part, 8_999, 0xB607);
        assert_eq!(answer, if strict { expected.rotate_left(1) } else { expected });
        assert_eq!(kinds(&part), [ViolationKind::Stall { stall_ns: 8_999, least_ns: 9_000 }]);
        assert_eq!(read(&mut part, 0x36), if strict { 0x0001 } else { 0x0007 });
    }
    // A burst after too short a stall is garbled as a whole, and one violation.
    let mut part = part();
    part.set_strict_select(Some(1_000));
    part.advance_to(part.next_data_ready());
    frame_after(&mut part, 20_000, 0x5600);
    part.advance_to(part.now() + 5_000);
    part.select();
    part.transfer(0x3E00);
    let words: [u16; 12] = std::array::from_fn(|_| part.transfer(0));
    part.deselect();
    assert_eq!(words, [(0x4015u16 ^ 0xA5A5).rotate_left(1); 12]);
    assert_eq!(part.violation_count(), 1);
}

#[test]
fn the_reset_line_resets_after_10_us() {
    let bus = EmulatedBus::new(part());
    let mut line = bus.reset_line();
    frame_after(&mut bus.part_mut(), 20_000, 0xB607);
    bus.part_mut().latch_flag(DiagnosisFlag::OverRange);

    let Ok(()) = line.set_low();
    let fell = bus.part().now();
    bus.advance_to(fell + 9_999);
    assert_eq!(bus.part_mut().next_data_ready(), u64::MAX);
    let Ok(()) = line.set_high();
    assert_eq!(kinds(&bus.part()), [ViolationKind::ResetPulse { low_ns: 9_999, least_ns: 10_000 }]);
    assert_eq!(read(&mut bus.part_mut(), 0x36), 0x0007);

    let Ok(()) = line.set_low();
    assert_eq!(frame_after(&mut bus.part_mut(), 20_000, 0x5600), 0xFFFF);
    let samples = bus.part().samples();
    let now = bus.part().now();
    bus.advance_to(now + 50 * MS);
    assert_eq!(bus.part().samples(), samples, "held in reset, it does not sample");
    let Ok(()) = line.set_high();
    let rose = bus.part().now();
    let Ok(()) = line.set_high();
    bus.advance_to(rose + 99 * MS);
    assert_eq!(read(&mut bus.part_mut(), 0x56), 0x0000);
    bus.advance_to(rose + 100 * MS);
    assert_eq!(read(&mut bus.part_mut(), 0x36), 0x0001);
    assert_eq!(read(&mut bus.part_mut(), 0x3C), 0x0000);
    assert_eq!(bus.part().violation_count(), 3, "the short pulse and the two frames during the recovery");
}

#[test]
fn the_first_sample_after_a_reset_refreshes_the_slow_words_too() {
    let mut part = part();
    part.set_slow_refresh(4);
    // Two samples, so that the next one is not the fourth.
    for _ in 0..2 {
        part.advance_to(part.next_data_ready());
    }
    frame_after(&mut part, 20_000, 0xBE80);
    part.advance_to(part.now() + 100 * MS);
    part.advance_to(part.next_data_ready());
    let words = burst(&mut part);
    assert_eq!(words[0], 0x8000 | 2068, "5 V; 0 V would raise the flag of a low supply");
    assert_eq!(read(&mut part, 0x3C), 0);
}
