//! The faults that bursts show, which of them leave the data usable, and how they are counted.

use adis16405_driver::{Burst, BurstValidator, Channel, ChannelMask, Counts, Faults, OutputWord};

/// A still, level sensor at 5 V (count 2068).
const STILL: [i16; 12] = [2068, 3, -2, 1, 4, -5, 300, 120, -40, 500, 20, 1000];

fn burst(change: impl FnOnce(&mut [i16; 12])) -> Burst {
    let mut counts = STILL;
    change(&mut counts);
    Burst::from_counts(&Counts::new(counts))
}

#[test]
fn a_burst_without_faults_is_usable() {
    let validity = BurstValidator::default().validate(&burst(|_| ()));
    assert!(validity.is_usable());
    assert_eq!(validity.faults.cause(), None);
}

#[test]
fn a_supply_outside_4_75_to_5_25_v_is_a_fault() {
    // 4.75 V and 5.25 V are 1964.4 and 2171.2 counts of 2.418 mV.
    for (supply, inside) in [(1964, false), (1965, true), (2171, true), (2172, false), (0, false), (4095, false)] {
        let faults = burst(|counts| counts[0] = supply).faults();
        assert_eq!(faults.contains(Faults::SUPPLY), !inside, "{supply}");
    }
}

fn refused(change: impl FnOnce(&mut Burst)) -> ChannelMask {
    let mut burst = burst(|_| ());
    change(&mut burst);
    BurstValidator::default().validate(&burst).refused
}

#[test]
fn a_fault_of_one_word_refuses_that_channel() {
    let only = |channel| ChannelMask::EMPTY.with(channel);
    assert_eq!(refused(|_| ()), ChannelMask::EMPTY);
    assert_eq!(refused(|burst| burst.words[2] = OutputWord::from_counts(Channel::GyroY, -7001)), only(Channel::GyroY));
    for channel in Channel::ALL {
        // Words other than the inertial ones may be refreshed slowly.
        let expected = if Channel::INERTIAL.contains(&channel) { only(channel) } else { ChannelMask::EMPTY };
        assert_eq!(refused(|burst| burst.words[channel as usize].0 &= 0x7FFF), expected, "{channel:?}");
    }
    let x = burst(|counts| counts[1] = 1192);
    let at_risk = BurstValidator::default().with_x_sign_at_risk(true).validate(&x);
    assert_eq!(at_risk.refused, only(Channel::GyroX));
    let two = refused(|burst| {
        burst.words[1].0 &= 0x7FFF;
        burst.words[3] = OutputWord::from_counts(Channel::GyroZ, 7001);
    });
    assert_eq!(two, only(Channel::GyroX).with(Channel::GyroZ));
    let every_inertial = Channel::INERTIAL.into_iter().fold(ChannelMask::EMPTY, ChannelMask::with);
    assert_eq!(ChannelMask::INERTIAL, every_inertial);
    assert_eq!(ChannelMask::ALL, Channel::ALL.into_iter().fold(ChannelMask::EMPTY, ChannelMask::with));
}

#[test]
fn a_fault_of_the_burst_refuses_every_channel() {
    assert_eq!(refused(|burst| burst.words = [OutputWord(0); 12]), ChannelMask::ALL);
    assert_eq!(refused(|burst| burst.words = [OutputWord(0xFFFF); 12]), ChannelMask::ALL);
    let old = |burst: &mut Burst| burst.words.iter_mut().for_each(|word| word.0 &= 0x7FFF);
    assert_eq!(refused(old), ChannelMask::ALL, "an old sample");
    let old_inertial = |burst: &mut Burst| burst.words[1..7].iter_mut().for_each(|word| word.0 &= 0x7FFF);
    assert_eq!(refused(old_inertial), ChannelMask::ALL, "no new sample");
    assert_eq!(refused(|burst| *burst = out_of_step(burst, 3)), ChannelMask::ALL);
    let all_flags = |burst: &mut Burst| burst.words.iter_mut().for_each(|word| word.0 |= 0x4000);
    assert_eq!(refused(all_flags), ChannelMask::EMPTY, "an error flag is a warning");
}

/// 4.70 V, as from a USB port, and 5.40 V are warnings. A part measures no 1 V and no 8 V; 6.0 V is its absolute maximum
/// rating (data sheet Rev. B, page 7).
#[test]
fn a_supply_outside_its_window_is_a_warning_and_an_implausible_one_no_word_of_a_part() {
    for (volts, refuses) in [(4.70, false), (5.40, false), (4.3, false), (1.0, true), (8.0, true), (0.0, true)] {
        let burst = burst(|counts| counts[0] = (volts / 2.418e-3_f64) as i16);
        let validity = BurstValidator::default().validate(&burst);
        assert_eq!(validity.refused, if refuses { ChannelMask::ALL } else { ChannelMask::EMPTY }, "{volts} V");
        assert_eq!(validity.faults.cause(), Some(if refuses { "implausible_supply" } else { "supply" }), "{volts} V");
    }
    assert!(!Burst::from_bytes(&[0; 26]).faults().contains(Faults::IMPLAUSIBLE_SUPPLY), "the line is stuck");
}

#[test]
fn the_faults_that_refuse_can_be_chosen() {
    let low = burst(|counts| counts[0] = 1900);
    let strict = Faults::REFUSED | Faults::SUPPLY;
    assert_eq!(BurstValidator::default().with_refused_faults(strict).validate(&low).refused, ChannelMask::ALL);
    let mut old = burst(|_| ());
    old.words.iter_mut().for_each(|word| word.0 &= 0x7FFF);
    let mut lenient = BurstValidator::default().with_refused_faults(Faults::REFUSED - Faults::NO_NEW_DATA);
    assert_eq!(lenient.validate(&old).refused, ChannelMask::EMPTY);
    assert_eq!(lenient.counters().get(Faults::NO_NEW_DATA), 1, "it is counted in either case");
}

/// The name of a burst that is refused is that of a fault that refuses it.
#[test]
fn warnings_are_the_last_causes() {
    let refusing = Faults::CAUSES.iter().take_while(|(fault, _)| Faults::REFUSED.contains(*fault)).count();
    assert!(Faults::CAUSES[refusing..].iter().all(|(fault, _)| Faults::WARNINGS.contains(*fault)));
}

#[test]
fn a_stale_inertial_word_and_an_error_flag_of_any_word_are_faults() {
    for channel in Channel::ALL {
        let mut stale = burst(|_| ());
        stale.words[channel as usize].0 &= 0x7FFF;
        // Supply, magnetometers, temperature and auxiliary input may refresh more slowly.
        let inertial = (Channel::GyroX..=Channel::AcclZ).contains(&channel);
        assert_eq!(stale.faults(), if inertial { Faults::NO_NEW_DATA } else { Faults::empty() }, "{channel:?}");
        let mut alarmed = burst(|_| ());
        alarmed.words[channel as usize].0 |= 0x4000;
        assert_eq!(alarmed.faults(), Faults::ERROR_ALARM | Faults::MIXED_ALARM, "{channel:?}");
    }
}

/// The flag says that DIAG_STAT has an error or alarm (data sheet Rev. B, page 11), which is so for all words of a burst.
#[test]
fn an_error_flag_of_some_words_alone_refuses_every_channel() {
    let alarmed = |words: u16| {
        let mut burst = burst(|_| ());
        let set = burst.words.iter_mut().enumerate().filter(|(at, _)| words >> at & 1 != 0);
        set.for_each(|(_, word)| word.0 |= 0x4000);
        burst
    };
    for words in 0..1 << 12 {
        let validity = BurstValidator::default().validate(&alarmed(words));
        let (faults, refused) = match words {
            0 => (Faults::empty(), ChannelMask::EMPTY),
            0xFFF => (Faults::ERROR_ALARM, ChannelMask::EMPTY),
            _ => (Faults::ERROR_ALARM | Faults::MIXED_ALARM, ChannelMask::ALL),
        };
        assert_eq!((validity.faults, validity.refused), (faults, refused), "{words:#014b}");
    }
}

#[test]
fn a_burst_that_ends_in_ones_has_the_cause_of_a_stuck_line() {
    // Chip select rises after 2 to 20 bytes of the words, with the error flag set or clear in all of them.
    for (sent, flag) in (2..=20).flat_map(|sent| [(sent, 0), (sent, 0x4000)]) {
        let mut whole = burst(|_| ());
        whole.words.iter_mut().for_each(|word| word.0 |= flag);
        let mut bytes = whole.to_bytes();
        bytes[2 + sent..].fill(0xFF);
        let validity = BurstValidator::default().validate(&Burst::from_bytes(&bytes));
        assert_eq!(
            (validity.faults.cause(), validity.refused),
            (Some("stuck_high"), ChannelMask::ALL),
            "{sent} {flag:#x}"
        );
    }
    // One count below 25 °C, and an input at full scale, are words of a part.
    let full = burst(|counts| (counts[10], counts[11]) = (-1, 4095)).faults();
    assert_eq!(full, Faults::empty());
}

#[test]
fn bursts_of_zeros_or_ones_have_the_cause_of_a_stuck_line() {
    assert_eq!(Burst::from_bytes(&[0x00; 26]).faults().cause(), Some("stuck_low"));
    assert_eq!(Burst::from_bytes(&[0xFF; 26]).faults().cause(), Some("stuck_high"));
}

#[test]
fn six_equal_inertial_words_are_a_repetition_and_usable() {
    let mut validator = BurstValidator::default();
    assert!(validator.validate(&burst(|_| ())).is_usable());
    let repeated = validator.validate(&burst(|counts| counts[10] = 21));
    assert_eq!(repeated.faults, Faults::REPEATED);
    assert!(repeated.is_usable(), "a new sample may equal the last by chance");
    assert!(validator.validate(&burst(|counts| counts[6] += 1)).is_usable());

    let mut stale = burst(|counts| counts[6] += 1);
    stale.words[1] = OutputWord(stale.words[1].0 & 0x7FFF);
    assert_eq!(validator.validate(&stale).faults, Faults::REPEATED | Faults::NO_NEW_DATA);

    let counters = validator.counters();
    assert_eq!((counters.bursts, counters.unusable), (4, 1));
    assert_eq!(counters.get(Faults::REPEATED), 2);
    let seen: Vec<_> = counters.by_cause().filter(|(_, count)| *count > 0).collect();
    assert_eq!(seen, [("no_new_data", 1), ("repeated", 2)]);
}

/// The 26 bytes that the controller receives if its clock count is `bits` ahead of the part (words arrive late) or, for
/// negative `bits`, behind.
fn out_of_step(burst: &Burst, bits: i32) -> Burst {
    let sent: Vec<bool> =
        burst.to_bytes().iter().flat_map(|byte| (0..8).map(move |bit| byte >> (7 - bit) & 1 != 0)).collect();
    let mut bytes = [0; 26];
    for at in 0..26 * 8 {
        let from = at as i32 - bits;
        let bit = usize::try_from(from).ok().and_then(|from| sent.get(from)).copied().unwrap_or(false);
        bytes[at / 8] |= u8::from(bit) << (7 - at % 8);
    }
    Burst::from_bytes(&bytes)
}

/// With all words new, and with only the inertial ones new.
#[test]
fn a_burst_shifted_by_up_to_a_byte_has_the_cause_shifted() {
    let mut slow = burst(|_| ());
    for channel in [0, 7, 8, 9, 10, 11] {
        slow.words[channel].0 &= 0x7FFF;
    }
    for (burst, bits) in (-8..=8).filter(|bits| *bits != 0).flat_map(|bits| [(burst(|_| ()), bits), (slow, bits)]) {
        let shifted = out_of_step(&burst, bits);
        assert_eq!(shifted.faults().cause(), Some("shifted"), "{bits} bits: {shifted:04x?}");
    }
    assert_eq!(out_of_step(&burst(|_| ()), 0).faults(), Faults::empty());
}

/// Bursts without new data are not taken for shifted ones, and random words only as often as chance has it.
/// Words that would be those of a sensor after a shift by a byte: bit 7 of the first six is set, bit 6 of none. The supply of a burst
/// that is shifted is implausible too, and one of its words has no new data; neither alone makes a shift of them.
#[test]
fn a_shift_takes_an_implausible_supply_and_a_word_without_new_data() {
    let words = |supply| burst(|counts| *counts = [supply, 128, 128, 128, 128, 128, 0, 0, 0, 0, 0, 0]);
    let in_range = words(0b111_1011_0010); // 1970
    assert_eq!(in_range.faults(), Faults::empty());
    let above = words(0b1000_1001_1000); // 2200, 5.32 V
    assert_eq!(above.faults(), Faults::SUPPLY);
    let stale = |mut burst: Burst| {
        burst.words[6].0 &= 0x7FFF;
        burst.faults()
    };
    assert_eq!(stale(in_range), Faults::NO_NEW_DATA);
    assert_eq!(stale(above), Faults::SUPPLY | Faults::NO_NEW_DATA | Faults::SHIFTED);
}

#[test]
fn a_set_of_channels_contains_those_that_were_added() {
    for channel in Channel::ALL {
        assert!(!ChannelMask::EMPTY.contains(channel) && ChannelMask::ALL.contains(channel));
        assert_eq!(ChannelMask::INERTIAL.contains(channel), Channel::INERTIAL.contains(&channel));
        let only = ChannelMask::EMPTY.with(channel);
        assert!(Channel::ALL.into_iter().all(|other| only.contains(other) == (other == channel)), "{channel:?}");
    }
}

#[test]
fn stale_bursts_are_not_shifted_and_random_ones_by_chance_only() {
    let mut stale = burst(|_| ());
    stale.words.iter_mut().for_each(|word| word.0 &= 0x7FFF);
    assert_eq!(stale.faults(), Faults::NO_NEW_DATA);

    // A linear congruential generator; the upper 16 bits of its state are taken as random.
    let mut state = 16405u64;
    let mut called_shifted = 0;
    for _ in 0..1_000_000 {
        let mut noise = Burst::default();
        for word in &mut noise.words {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            *word = OutputWord((state >> 48) as u16);
        }
        called_shifted += u32::from(noise.faults().contains(Faults::SHIFTED));
    }
    // Six new-data flags are set and eleven error flags are equal with probability 2⁻⁶ · 2⁻¹⁰. Eight early shifts pass
    // with this probability each, eight late ones with 207/4096 of it, where the supply as received is out of range:
    // 122 of a million. The tolerance is 6 standard deviations of that count, √122 = 11.
    assert!((122 - 66..=122 + 66).contains(&called_shifted), "{called_shifted}");
}

#[test]
fn rates_beyond_7000_counts_are_impossible() {
    // ±6000 counts are full scale in every range; ±350 °/s at 0.05 °/s are 7000.
    for (rate, possible) in
        [(0, true), (6000, true), (7000, true), (7001, false), (-7000, true), (-7001, false), (8184, false)]
    {
        for axis in 1..=3 {
            let faults = burst(|counts| counts[axis] = rate).faults();
            assert_eq!(faults, if possible { Faults::empty() } else { Faults::IMPOSSIBLE_RATE }, "{rate} about {axis}");
        }
    }
}

/// The sign bit is 2¹³: without it −7000 reads 1192, and −1 reads 8191.
#[test]
fn a_lost_sign_is_reported_only_where_it_is_at_risk() {
    for (x, suspect) in [(-1, false), (0, false), (1191, false), (1192, true), (6000, true)] {
        let burst = burst(|counts| counts[1] = x);
        assert_eq!(BurstValidator::default().validate(&burst).faults, Faults::empty());
        let validity = BurstValidator::default().with_x_sign_at_risk(true).validate(&burst);
        assert_eq!(validity.faults, if suspect { Faults::X_SIGN } else { Faults::empty() }, "{x}");
        assert_eq!(validity.is_usable(), !suspect);
    }
}

#[test]
fn twelve_words_equal_for_512_bursts_are_frozen() {
    let mut validator = BurstValidator::default();
    let same = burst(|_| ());
    let usable = (0..1000).take_while(|_| validator.validate(&same).is_usable()).count();
    assert_eq!(usable, 512, "the first and 511 that repeat it");
    assert_eq!(validator.validate(&same).faults, Faults::REPEATED | Faults::FROZEN);
    assert_eq!(validator.validate(&same).faults.cause(), Some("frozen"));
    assert!(
        validator.validate(&burst(|counts| counts[11] += 1)).is_usable(),
        "a change of any of the twelve words ends it"
    );
    assert_eq!(validator.counters().get(Faults::FROZEN), 3);
}

#[test]
fn every_fault_has_its_flag_name_as_cause() {
    let named = Faults::CAUSES.into_iter().fold(Faults::empty(), |all, (fault, _)| all | fault);
    assert_eq!(named, Faults::all());
    for (name, flag) in Faults::all().iter_names() {
        assert_eq!(flag.cause(), Some(name.to_lowercase().as_str()));
    }
}
