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

#[test]
fn every_fault_has_a_name() {
    let named = Faults::CAUSES.into_iter().fold(Faults::empty(), |all, (fault, _)| all | fault);
    assert_eq!(named, Faults::all());
    for (name, flag) in Faults::all().iter_names() {
        assert_eq!(flag.cause(), Some(name.to_lowercase().as_str()));
    }
}
