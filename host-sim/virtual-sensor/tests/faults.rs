//! The part when it is cold, latched, strict about its bus, or reset by its pin, by words on the bus without the
//! driver. Times and bits are from the data sheet.

use virtual_sensor::{
    Activity, BusyAnswers, DiagnosisFlag, EmulatedBus, NoiseModel, Strictness, Violation, ViolationKind,
    VirtualAdis16405,
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
    frame_after(part, 40_000, u16::from(address) << 8);
    frame_after(part, 40_000, 0x0000)
}

fn burst(part: &mut VirtualAdis16405) -> [u16; 12] {
    part.advance_to(part.now() + 40_000);
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
        let words: Vec<u16> = (0..20).map(|_| frame_after(&mut part, 40_000, 0x5600)).collect();
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
    frame_after(&mut part, 40_000, 0xB607);
    part.advance_to(220 * MS);
    assert_eq!(read(&mut part, 0x36), 0x0001);
}

/// Table 1 gives 12 ms at SMPL_PRD = 0x01. For the same number of samples this is 48 ms at 0x07, where the period is
/// four times as long.
#[test]
fn the_self_test_takes_as_many_samples_at_a_slower_rate() {
    for (smpl_prd, hold_ms) in [(0x01, 12), (0x07, 48)] {
        let mut part = part();
        frame_after(&mut part, 40_000, 0xB600 | smpl_prd);
        // Bit 10 of MSC_CTRL clears at the end of the test.
        frame_after(&mut part, 40_000, 0xB504);
        let begun = part.now();
        part.advance_to(begun + (hold_ms - 1) * MS);
        assert_eq!(read(&mut part, 0x34) & 1 << 10, 1 << 10, "SMPL_PRD {smpl_prd:#x}");
        part.advance_to(begun + (hold_ms + 1) * MS);
        assert_eq!(read(&mut part, 0x34) & 1 << 10, 0, "SMPL_PRD {smpl_prd:#x}");
    }
}

#[test]
fn a_start_up_takes_longer_in_low_power_mode_or_as_long_as_is_set() {
    let mut part = part();
    // SMPL_PRD = 0x0F is written, then stored in flash.
    frame_after(&mut part, 40_000, 0xB60F);
    frame_after(&mut part, 150_000, 0xBE08);
    part.advance_to(part.now() + 50 * MS);
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
    // The flags of the supply return to 0 without a read (page 15).
    for flag in DiagnosisFlag::ALL.into_iter().skip(2) {
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
    // All bits are flags except bit 7.
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

fn pedantic(least_high_ns: u64) -> VirtualAdis16405 {
    let mut part = part();
    part.set_strictness(Strictness::Pedantic { least_high_ns });
    part
}

#[test]
fn a_pedantic_part_needs_chip_select_high_between_frames() {
    // By default chip select may rise and fall at once; only stall and read rate are checked.
    let mut tolerant = part();
    let mut pedantic = pedantic(1_000);
    for part in [&mut tolerant, &mut pedantic] {
        part.select();
        part.transfer(0x5600);
        part.advance_to(part.now() + 40_000);
        part.deselect();
        part.advance_to(part.now() + 999);
    }
    tolerant.select();
    assert_eq!(tolerant.transfer(0x0000), 0x4015);
    tolerant.deselect();
    assert_eq!(tolerant.violations(), []);

    pedantic.select();
    assert_ne!(pedantic.transfer(0xB607), 0x4015, "garbled");
    pedantic.deselect();
    let kind = ViolationKind::SelectHigh { high_ns: 999, least_ns: 1_000 };
    assert_eq!(pedantic.violations(), [Violation { at_ns: 40_999, kind }]);
    assert!(pedantic.violations()[0].to_string().contains("999 ns"));
    // The write did not happen, and the flag of the SPI port is latched.
    assert_eq!(read(&mut pedantic, 0x36), 0x0001);
    assert_eq!(read(&mut pedantic, 0x3C), 0x0008);
    assert_eq!(read(&mut pedantic, 0x3C), 0x0000);
    frame_after(&mut pedantic, 40_000, 0x5600);
    assert_eq!(frame_after(&mut pedantic, 40_000, 0x0000), 0x4015);
    assert_eq!(pedantic.violation_count(), 1);
}

#[test]
fn a_pedantic_part_needs_chip_select_to_rise_between_frames_but_not_in_a_burst() {
    let mut part = pedantic(1_000);
    part.advance_to(part.next_data_ready());
    assert!(burst(&mut part)[1..7].iter().all(|word| word & 0x8000 != 0));
    assert_eq!(part.violations(), []);
    part.advance_to(part.now() + 40_000);
    part.select();
    part.transfer(0x5600);
    part.advance_to(part.now() + 20_000);
    assert_ne!(part.transfer(0x0000), 0x4015);
    part.deselect();
    assert_eq!(kinds(&part), [ViolationKind::SelectHigh { high_ns: 0, least_ns: 1_000 }]);
}

#[test]
fn the_reset_line_resets_after_10_us() {
    let bus = EmulatedBus::new(part());
    let mut line = bus.reset_line();
    frame_after(&mut bus.part_mut(), 40_000, 0xB607);
    bus.part_mut().latch_flag(DiagnosisFlag::OverRange);

    let Ok(()) = line.set_low();
    let fell = bus.part().now();
    bus.advance_to(fell + 9_999);
    assert_eq!(bus.part_mut().next_data_ready(), u64::MAX);
    let Ok(()) = line.set_high();
    assert_eq!(kinds(&bus.part()), [ViolationKind::ResetPulse { low_ns: 9_999, least_ns: 10_000 }]);
    assert_eq!(read(&mut bus.part_mut(), 0x36), 0x0007);

    let Ok(()) = line.set_low();
    assert_eq!(frame_after(&mut bus.part_mut(), 40_000, 0x5600), 0xFFFF);
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
    // After two samples the next one is not the fourth.
    for _ in 0..2 {
        part.advance_to(part.next_data_ready());
    }
    frame_after(&mut part, 40_000, 0xBE80);
    part.advance_to(part.now() + 100 * MS);
    part.advance_to(part.next_data_ready());
    let words = burst(&mut part);
    assert_eq!(words[0], 0x8000 | 2068, "5 V; 0 V would raise the flag of a low supply");
    assert_eq!(read(&mut part, 0x3C), 0);
}

/// Data sheet Rev. B, page 15: the flags of the supply return to 0 without a read, the others do not.
#[test]
fn the_flags_of_the_supply_follow_the_supply() {
    let mut part = part();
    part.latch_flag(DiagnosisFlag::SupplyLow);
    part.latch_flag(DiagnosisFlag::SupplyHigh);
    part.latch_flag(DiagnosisFlag::OverRange);
    part.advance_to(part.next_data_ready());
    assert_eq!(read(&mut part, 0x3C), 1 << 4);
}

/// Page 13 and Table 1: chip select low for 20 µs wakes the part, with bytes or without.
#[test]
fn chip_select_wakes_the_part_after_20_us() {
    for (words, low_ns, wakes) in [(0, 19_999, false), (0, 20_000, true), (1, 19_999, false), (1, 20_000, true)] {
        let mut part = part();
        part.set_sck_hz(Some(2_000_000));
        // This writes SLP_CNT = 0x0100.
        frame_after(&mut part, 40_000, 0xBB01);
        part.advance_to(part.now() + 1000 * MS);
        part.select();
        let fell = part.now();
        for _ in 0..words {
            part.transfer(0x5600);
        }
        part.advance_to(fell + low_ns);
        part.deselect();
        let pulse = ViolationKind::WakePulse { low_ns, least_ns: 20_000 };
        assert_eq!(kinds(&part).contains(&pulse), !wakes, "{words} words, {low_ns} ns");
        part.advance_to(part.now() + 4 * MS);
        assert_eq!(read(&mut part, 0x56) == 0x4015, wakes, "{words} words, {low_ns} ns");
    }
}

/// Table 2 and Figure 3: the time from one falling edge of chip select to the next is at least 40 µs in normal mode, 150 µs in low-power
/// mode.
#[test]
fn a_frame_that_comes_too_soon_is_garbled_unless_the_part_is_lenient() {
    for (smpl_prd, least_ns) in [(0x09, 40_000u64), (0x0A, 150_000)] {
        for strictness in [Strictness::DataSheet, Strictness::Lenient] {
            let mut part = part();
            part.set_strictness(strictness);
            part.set_sck_hz(Some(300_000));
            frame_after(&mut part, 200_000, 0xB600 | smpl_prd);
            frame_after(&mut part, 200_000, 0x5600);
            assert_eq!(frame_after(&mut part, 200_000, 0x0000), 0x4015);
            assert_eq!(part.violations(), []);
            // The bus rounds 16 periods of 300 kHz up to 53.334 µs.
            let pause_ns = least_ns.saturating_sub(53_336).max(if smpl_prd == 0x09 { 8_998 } else { 0 });
            frame_after(&mut part, 200_000, 0x5600);
            let answer = frame_after(&mut part, pause_ns, 0xB607);
            let lenient = strictness == Strictness::Lenient;
            assert_eq!(answer == 0x4015, lenient);
            let expected = match smpl_prd {
                0x09 => ViolationKind::Stall { stall_ns: 8_998, least_ns: 9_000 },
                _ => ViolationKind::ReadRate { interval_ns: 149_998, least_ns: 150_000 },
            };
            assert_eq!(kinds(&part), [expected]);
            part.advance_to(part.now() + MS);
            assert_eq!(read_slowly(&mut part, 0x36), if lenient { 0x07 } else { smpl_prd });
        }
    }
    let mut part = part();
    part.set_sck_hz(Some(2_000_000));
    frame_after(&mut part, 40_000, 0x5600);
    frame_after(&mut part, 31_999, 0x0000);
    assert_eq!(kinds(&part), [ViolationKind::ReadRate { interval_ns: 39_999, least_ns: 40_000 }]);
}

fn read_slowly(part: &mut VirtualAdis16405, address: u8) -> u16 {
    frame_after(part, 200_000, u16::from(address) << 8);
    frame_after(part, 200_000, 0x0000)
}

/// Table 2: SCK is 10 kHz to 2 MHz, and at most 1 MHz in a burst.
#[test]
fn a_clock_beyond_its_limits_garbles() {
    for (sck_hz, frame_is_right, burst_is_right) in [
        (9_999, false, false),
        (10_000, true, true),
        (1_000_000, true, true),
        (1_000_001, true, false),
        (2_000_001, false, false),
    ] {
        let mut part = part();
        part.advance_to(100 * MS);
        part.set_sck_hz(Some(sck_hz));
        assert_eq!(read_slowly(&mut part, 0x56) == 0x4015, frame_is_right, "{sck_hz} Hz");
        part.advance_to(part.next_data_ready());
        assert_eq!(burst(&mut part)[0] & 0x3FFF == 2068, burst_is_right, "{sck_hz} Hz");
        part.set_strictness(Strictness::Lenient);
        assert_eq!(read_slowly(&mut part, 0x56), 0x4015);
    }
}

/// Page 13: auto-null, precision auto-null and factory restore set the outputs to 0 and write the flash within 50 ms, the second after 30 s
/// offline. Page 10: a flash update takes 50 ms and needs the supply in its window.
#[test]
fn the_calibration_commands_write_the_flash() {
    for (command, duration_ms) in [(0x01, 50), (0x02, 50), (0x08, 50), (0x10, 30_050)] {
        for volts in [5.0, 4.6] {
            let mut model = NoiseModel::noiseless();
            model.channel_mut(virtual_sensor::OutputRegister::Supply).bias = volts;
            model.channel_mut(virtual_sensor::OutputRegister::GyroX).bias = 0.5;
            let mut part = VirtualAdis16405::new(model, 1);
            part.advance_to(100 * MS);
            // These frames set YACCL_OFF = 5 and ZMAGN_SIF = 0x0700.
            frame_after(&mut part, 40_000, 0xA205);
            frame_after(&mut part, 40_000, 0xB107);
            frame_after(&mut part, 40_000, 0xBE00 | command);
            let begun = part.now();
            let samples = part.samples();
            part.advance_to(begun + duration_ms * MS - 1);
            if command == 0x10 {
                assert_eq!((part.samples(), part.next_data_ready()), (samples, u64::MAX), "offline");
            }
            part.advance_to(begun + duration_ms * MS);
            let clears_outputs = command != 0x08;
            assert_eq!(part.counts()[0] == 0, clears_outputs, "{command:#04x}");
            let in_window = volts == 5.0;
            assert_eq!(read(&mut part, 0x00), u16::from(in_window), "{command:#04x} at {volts} V: FLASH_CNT");
            assert_eq!(read(&mut part, 0x3C) & 1 << 2 != 0, !in_window, "flash update failure");
            let expected = if command == 0x02 { [0, 0x0700] } else { [5, 0x0700] };
            assert_eq!([0x22, 0x30].map(|address| read(&mut part, address)), expected, "{command:#04x}");
            frame_after(&mut part, 40_000, 0xBE80);
            part.advance_to(part.now() + 100 * MS);
            let x = read(&mut part, 0x1A) as i16;
            // 0.5 °/s are 40 counts of 0.0125 °/s.
            assert_eq!(x, if in_window && matches!(command, 0x01 | 0x10) { -40 } else { 0 }, "{command:#04x}");
        }
    }
}

/// Table 26: ALM_SMPL = 0x00 and 0x01 both compare with the previous sample.
#[test]
fn a_rate_of_change_over_0_samples_is_that_over_1() {
    for samples in [0u16, 1] {
        let mut part = part();
        // Alarm 1 watches the rate of change of gyro y, unfiltered, above 99 counts.
        for word in [0xC903, 0xC840, 0xC400 | samples, 0xC063, 0xC180] {
            frame_after(&mut part, 40_000, word);
        }
        for _ in 0..4 {
            part.advance_to(part.next_data_ready());
        }
        assert_eq!(read(&mut part, 0x3C), 0);
        // YGYRO_OFF = 400 makes a step of 100 counts.
        frame_after(&mut part, 40_000, 0x9C90);
        frame_after(&mut part, 40_000, 0x9D01);
        part.advance_to(part.next_data_ready());
        assert_eq!(read(&mut part, 0x3C), 1 << 8, "ALM_SMPL = {samples}");
        part.advance_to(part.next_data_ready());
        assert_eq!(read(&mut part, 0x3C), 0);
    }
}

/// Table 2 and Figure 4: pulses last at least 5 µs, are at least 833 µs apart, and come 600 µs before data ready. Page 14: DIO4 is an
/// input.
#[test]
fn the_external_clock_has_the_times_of_table_2() {
    let mut part = part();
    frame_after(&mut part, 40_000, 0xB600);
    let pulse = |high_ns: u64, part: &mut VirtualAdis16405| {
        let samples = part.samples();
        part.drive_pin(4, true);
        let rose = part.now();
        part.advance_to(rose + high_ns);
        part.drive_pin(4, false);
        let ready = part.next_data_ready();
        part.advance_to(rose + 599_999);
        let before = part.samples() - samples;
        part.advance_to(rose + 600_000);
        (before, part.samples() - samples, (ready != u64::MAX).then(|| ready - rose))
    };
    assert_eq!(pulse(5_000, &mut part), (0, 1, Some(600_000)));
    part.advance_to(part.now() + 233_000);
    assert_eq!(pulse(4_999, &mut part), (0, 0, None));
    part.advance_to(part.now() + 232_999);
    assert_eq!(pulse(5_000, &mut part).1, 0);
    let expected = [
        ViolationKind::SyncPulse { high_ns: 4_999, least_ns: 5_000 },
        ViolationKind::SyncPeriod { period_ns: 832_999, least_ns: 833_000 },
    ];
    assert_eq!(kinds(&part), expected);
    part.advance_to(part.now() + MS);
    frame_after(&mut part, 40_000, 0xB208);
    assert_eq!(pulse(5_000, &mut part), (0, 0, None), "DIO4 is an output");
}
