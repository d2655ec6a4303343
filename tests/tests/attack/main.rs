//! An attack on the program: random inputs, and the properties of every run for any input.
//!
//! A run ends with one clear error or with a report whose figures are consistent, with a defined exit code, without a panic, and within 20
//! s of processor time. For a file below 1 MB it uses at most 500 MB of memory. Reports of white noise have the noise, rate and losses of
//! the record in every format, and 95 % of the intervals contain the true value.
//!
//! Case `n` is drawn from seed `n` alone. A failure names its case; `ATTACK_CASE=n` runs only that case.

mod cases;
mod program;
mod recordings;
mod report;

use self::cases::Campaign;

/// Number of cases of the short form, four of each kind: about 30 s.
const FEW: u64 = 4 * cases::KINDS.len() as u64;
/// Number of cases of the long form: about an hour.
const MANY: u64 = 4_550;

fn attack(test: &str, cases: impl Iterator<Item = u64>) {
    let mut campaign = Campaign::new();
    match std::env::var("ATTACK_CASE").ok().and_then(|text| text.parse().ok()) {
        Some(case) => campaign.run(case),
        None => cases.for_each(|case| campaign.run(case)),
    }
    println!("{test}: {campaign}");
    let faults = campaign.faults();
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn the_program_withstands_a_few_attacks_of_each_kind() {
    attack("the_program_withstands_a_few_attacks_of_each_kind", 0..FEW);
}

#[test]
#[ignore = "long: an hour"]
fn the_program_withstands_many_attacks_of_each_kind() {
    attack("the_program_withstands_many_attacks_of_each_kind", 1_000_000..1_000_000 + MANY);
}
