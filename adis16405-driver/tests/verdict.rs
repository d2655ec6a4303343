//! Which bursts are believed, and what is counted.

use adis16405_driver::{Burst, Channel, Counts, Faults, Judge, OutputWord};

/// A still, level sensor at 5 V (count 2068).
const STILL: [i16; 12] = [2068, 3, -2, 1, 4, -5, 300, 120, -40, 500, 20, 1000];

fn burst(change: impl FnOnce(&mut [i16; 12])) -> Burst {
    let mut counts = STILL;
    change(&mut counts);
    Burst::fresh(&Counts::new(counts))
}

#[test]
fn a_healthy_burst_is_usable() {
    let verdict = Judge::default().judge(&burst(|_| ()));
    assert!(verdict.usable);
    assert_eq!(verdict.faults.cause(), None);
}

#[test]
fn the_supply_window() {
    // 4.75 V and 5.25 V are 1964.4 and 2171.2 counts of 2.418 mV.
    for (supply, inside) in [(1964, false), (1965, true), (2171, true), (2172, false), (0, false), (4095, false)] {
        let faults = burst(|counts| counts[0] = supply).faults();
        assert_eq!(faults.contains(Faults::SUPPLY), !inside, "{supply}");
    }
}

#[test]
fn flags_of_any_word_count() {
    for channel in Channel::ALL {
        let mut stale = burst(|_| ());
        stale.words[channel as usize].0 &= 0x7FFF;
        assert_eq!(stale.faults(), Faults::NO_NEW_DATA, "{channel:?}");
        let mut alarmed = burst(|_| ());
        alarmed.words[channel as usize].0 |= 0x4000;
        assert_eq!(alarmed.faults(), Faults::ERROR_ALARM, "{channel:?}");
    }
}

#[test]
fn a_dead_line_is_named_as_such() {
    assert_eq!(Burst::from_bytes(&[0x00; 26]).faults().cause(), Some("stuck_low"));
    assert_eq!(Burst::from_bytes(&[0xFF; 26]).faults().cause(), Some("stuck_high"));
}

#[test]
fn a_repetition_is_six_equal_inertial_words() {
    let mut judge = Judge::default();
    assert!(judge.judge(&burst(|_| ())).usable);
    let repeated = judge.judge(&burst(|counts| counts[10] = 21));
    assert_eq!(repeated.faults, Faults::REPEATED);
    assert!(repeated.usable, "new data may equal the last by chance");
    assert!(judge.judge(&burst(|counts| counts[6] += 1)).usable);

    let mut stale = burst(|counts| counts[6] += 1);
    stale.words[1] = OutputWord(stale.words[1].0 & 0x7FFF);
    assert_eq!(judge.judge(&stale).faults, Faults::REPEATED | Faults::NO_NEW_DATA);

    let counters = judge.counters();
    assert_eq!((counters.bursts, counters.unusable), (4, 1));
    assert_eq!(counters.get(Faults::REPEATED), 2);
    let seen: Vec<_> = counters.by_cause().filter(|(_, count)| *count > 0).collect();
    assert_eq!(seen, [("no_new_data", 1), ("repeated", 2)]);
}

/// The 26 bytes as the controller sees them when it is `bits` clocks ahead (the part seems late) or behind.
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

#[test]
fn a_shifted_frame_is_named_as_such() {
    for bits in (-8..=8).filter(|bits| *bits != 0) {
        let shifted = out_of_step(&burst(|_| ()), bits);
        assert_eq!(shifted.faults().cause(), Some("shifted"), "{bits} bits: {shifted:04x?}");
    }
    assert_eq!(out_of_step(&burst(|_| ()), 0).faults(), Faults::empty());
}

/// Stale or noisy words are not taken for shifted ones: of a million random bursts at most a handful may pass for one.
#[test]
fn other_damage_is_not_called_a_shift() {
    let mut stale = burst(|_| ());
    stale.words.iter_mut().for_each(|word| word.0 &= 0x7FFF);
    assert_eq!(stale.faults(), Faults::NO_NEW_DATA);

    // Fibonacci hashing: every bit of its upper half is as good as random.
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
    // Eight ways to be early, each 2⁻¹¹; eight to be late, each 2⁻¹¹ · 207/4096. Of a million 0.41 % are 4,100; 5 √ of that.
    assert!((4_100 - 400..=4_100 + 400).contains(&called_shifted), "{called_shifted}");
}

#[test]
fn rates_beyond_the_sensor_are_impossible() {
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

/// The sign bit is 2¹³: −7000 becomes 1192, −1 becomes 8191.
#[test]
fn a_lost_sign_is_suspected_only_where_it_can_be_lost() {
    for (x, suspect) in [(-1, false), (0, false), (1191, false), (1192, true), (6000, true)] {
        let burst = burst(|counts| counts[1] = x);
        assert_eq!(Judge::default().judge(&burst).faults, Faults::empty());
        let verdict = Judge::default().with_x_sign_at_risk(true).judge(&burst);
        assert_eq!(verdict.faults, if suspect { Faults::X_SIGN } else { Faults::empty() }, "{x}");
        assert_eq!(verdict.usable, !suspect);
    }
}

#[test]
fn outputs_that_never_change_are_frozen() {
    let mut judge = Judge::default();
    let same = burst(|_| ());
    let usable = (0..1000).take_while(|_| judge.judge(&same).usable).count();
    assert_eq!(usable, 512, "the first and 511 that repeat it");
    assert_eq!(judge.judge(&same).faults, Faults::REPEATED | Faults::FROZEN);
    assert_eq!(judge.judge(&same).faults.cause(), Some("frozen"));
    assert!(judge.judge(&burst(|counts| counts[11] += 1)).usable, "any of the twelve words is a sign of life");
    assert_eq!(judge.counters().get(Faults::FROZEN), 3);
}

#[test]
fn every_fault_has_a_name() {
    let named = Faults::CAUSES.into_iter().fold(Faults::empty(), |all, (fault, _)| all | fault);
    assert_eq!(named, Faults::all());
    for (name, flag) in Faults::all().iter_names() {
        assert_eq!(flag.cause(), Some(name.to_lowercase().as_str()));
    }
}
