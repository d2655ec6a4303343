//! An attack on the program: inputs that are drawn at random, and what every run owes whatever its input is.
//!
//! A run ends in one clear error or in a report whose figures agree, with an exit code of its own, without a panic, within 20 s of processor
//! time and, for a file below 1 MB, 500 MB of memory. Records of white noise have the noise, the rate and the losses that they were written
//! with, in every format, and 95 % of the intervals hold the true value.
//!
//! Case `n` is drawn from seed `n` alone. A failure names its case; `ATTACK_CASE=n` runs it alone.

mod cases;
mod program;
mod recordings;
mod report;

use crate::cases::Campaign;
use std::time::{Duration, Instant};

fn attack(test: &str, first: u64, duration: Duration) {
    let mut campaign = Campaign::new();
    if let Some(case) = std::env::var("ATTACK_CASE").ok().and_then(|text| text.parse().ok()) {
        campaign.run(case);
    } else {
        let started = Instant::now();
        let mut case = first;
        // Each kind of attack at least once.
        while started.elapsed() < duration || case < first + cases::KINDS.len() as u64 {
            campaign.run(case);
            case += 1;
        }
    }
    println!("{test}: {campaign}");
    let faults = campaign.faults();
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn the_program_withstands_thirty_seconds_of_attack() {
    attack("the_program_withstands_thirty_seconds_of_attack", 0, Duration::from_secs(30));
}

#[test]
#[ignore = "long: an hour"]
fn the_program_withstands_an_hour_of_attack() {
    attack("the_program_withstands_an_hour_of_attack", 1_000_000, Duration::from_secs(3600));
}
