use super::*;

extern crate std;
use std::vec::Vec;

fn parse(text: &str) -> Vec<Result<Command, Mistake>> {
    let mut parser = Parser::default();
    text.bytes().filter_map(|byte| parser.push(byte)).collect()
}

#[test]
fn single_letters_act_at_once_and_numbers_with_enter() {
    assert_eq!(parse("r?"), [Ok(Command::Report), Ok(Command::Help)]);
    assert_eq!(
        parse("f 819.2\rn4\ng 75\r\n"),
        [Ok(Command::Rate(819_200)), Ok(Command::Filter(4)), Ok(Command::Range(GyroRange::Dps75)),]
    );
    assert_eq!(
        parse("e3600\ri0\rw1\rw 0\r"),
        [Ok(Command::Epoch(3600)), Ok(Command::Interval(0)), Ok(Command::Raw(true)), Ok(Command::Raw(false)),]
    );
    assert_eq!(
        parse("f.5\rf5.\rf1.23456\r"),
        [Ok(Command::Rate(500)), Ok(Command::Rate(5000)), Ok(Command::Rate(1234)),]
    );
}

#[test]
fn what_changes_something_takes_a_whole_line() {
    assert_eq!(
        parse("zero\rcheck\narm\rnull\rboot\r"),
        [
            Ok(Command::ResetStatistics),
            Ok(Command::SelfTest),
            Ok(Command::ArmNull),
            Ok(Command::Null),
            Ok(Command::Restart),
        ]
    );
    assert_eq!(parse("xnull\rzero\r"), [Err(Mistake::Unknown(b'x')), Ok(Command::ResetStatistics)]);
}

#[test]
fn mistakes_are_named_once_and_end_with_the_line() {
    assert_eq!(parse("xyXY5r\rr"), [Err(Mistake::Unknown(b'x')), Ok(Command::Report), Ok(Command::Report)]);
    assert_eq!(parse("f1\u{8}\u{8}r"), [Ok(Command::Report)], "backspace takes a letter back");
    let long = "f00000000000000000\r";
    for wrong in [
        "f\r",
        "f.\r",
        "n7\r",
        "n1.5\r",
        "g100\r",
        "w2\r",
        "f1e3\r",
        "f-1\r",
        "f1.2.3\r",
        "f1.2345x\r",
        "e4294968\r",
        "zer0\r",
        long,
    ] {
        let letter = wrong.as_bytes()[0];
        assert_eq!(parse(wrong), [Err(Mistake::Line(letter))], "{wrong}");
    }
}

/// Every key and word of the help is a command, and no key is missing from it.
#[test]
fn the_help_is_complete() {
    let first = |line: &&str| line.split([' ', ',']).next().unwrap().as_bytes()[0];
    let listed: Vec<u8> = HELP.iter().filter(|line| !line.ends_with(':')).map(first).collect();
    for letter in b'!'..=b'~' {
        let known = key(letter).is_some() || STARTS.contains(&letter);
        assert_eq!(known, listed.contains(&letter), "{}", letter as char);
    }
}

/// A million bytes of noise on an open input press keys, but change nothing.
#[test]
fn noise_changes_nothing() {
    let mut parser = Parser::default();
    let mut state = 1_u64;
    for _ in 0..1_000_000 {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        if let Some(Ok(command)) = parser.push((state >> 56) as u8) {
            use Command::*;
            assert!(matches!(command, Help | Report | Table | Status | Faults | Version), "{command:?}");
        }
    }
}
