use super::*;
use crate::estimators::Estimator;

extern crate std;
use std::boxed::Box;

const KEPT: Settings = Settings { smpl_prd: 7, sens_avg: 0x0400, epoch_s: 3600, epoch: 2, interval_s: 10, starts: 3 };

fn memory() -> &'static Memory {
    Box::leak(Box::new(blank()))
}

fn sums(samples: i32) -> Sums {
    let mut estimator = Estimator::new();
    (0..samples).for_each(|k| estimator.push(k * k % 8191 - 4096));
    estimator.gap(5);
    Sums::of(&estimator)
}

#[test]
fn what_was_kept_is_found_after_a_restart() {
    let memory = memory();
    let mut before = Retained::open(memory);
    assert_eq!(before.settings(), None);
    assert!(before.sums(0).is_none());
    before.keep_settings(KEPT, true);
    for round in 1..4 {
        (0..CHANNELS.len()).for_each(|index| before.keep_sums(index, &sums(100 * round + index as i32)));
    }
    let after = Retained::open(memory);
    assert_eq!(after.settings(), Some(KEPT));
    for index in 0..CHANNELS.len() {
        assert_eq!(after.sums(index).unwrap(), sums(300 + index as i32));
    }
}

/// Sums that need all of their 96 bits; larger ones, which no counts reach, stay at the largest.
#[test]
fn wide_sums_are_kept_whole() {
    let memory = memory();
    let mut retained = Retained::open(memory);
    retained.keep_settings(KEPT, true);
    let octaves = core::array::from_fn(|octave| (MOST - octave as u128, u64::MAX - octave as u64));
    let wide = Sums { samples: u64::MAX, missing: 1 << 33, octaves };
    retained.keep_sums(3, &wide);
    assert_eq!(Retained::open(memory).sums(3).unwrap(), wide);
    retained.keep_sums(3, &Sums { octaves: [(u128::MAX, 1); OCTAVES], ..wide.clone() });
    assert_eq!(retained.sums(3).unwrap(), Sums { octaves: [(MOST, 1); OCTAVES], ..wide });
}

#[test]
fn statistics_under_other_settings_are_out_of_date() {
    let memory = memory();
    let mut retained = Retained::open(memory);
    retained.keep_settings(KEPT, true);
    retained.keep_sums(1, &sums(50));
    retained.keep_settings(Settings { epoch_s: 60, ..KEPT }, false);
    assert!(Retained::open(memory).sums(1).is_some());
    retained.keep_settings(KEPT, true);
    assert!(Retained::open(memory).sums(1).is_none());
    retained.clear();
    assert_eq!(Retained::open(memory).settings(), None);
}

/// A bit flips in any word of the slot written last: the version before it is found.
#[test]
fn damage_costs_one_version_and_no_more() {
    for word in 0..SLOT_WORDS {
        let memory = memory();
        let mut retained = Retained::open(memory);
        retained.keep_settings(KEPT, true);
        retained.keep_sums(2, &sums(100));
        retained.keep_sums(2, &sums(200));
        let slot = retained.newest[3].unwrap();
        memory[slot][word].fetch_xor(0x10, Relaxed);
        assert_eq!(Retained::open(memory).sums(2).map(|sums| sums.samples), Some(100), "word {word}");
    }
}

/// The reset comes after any number of words of the new version were written.
#[test]
fn a_reset_while_writing_costs_that_version_only() {
    let memory = memory();
    let mut retained = Retained::open(memory);
    retained.keep_settings(KEPT, true);
    retained.keep_sums(0, &sums(100));
    retained.keep_sums(0, &sums(200));
    let newest = retained.newest[1].unwrap();
    let free = (0..memory.len()).find(|index| !retained.newest.contains(&Some(*index))).unwrap();
    for (done, (to, from)) in memory[free].iter().zip(&memory[newest]).enumerate() {
        assert_eq!(Retained::open(memory).sums(0).map(|sums| sums.samples), Some(200), "{done} words");
        to.store(!from.load(Relaxed), Relaxed);
    }
}
