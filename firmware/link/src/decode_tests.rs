use super::*;
use crate::{
    Bounded, Cause, ChannelReport, Checked, Coefficient, Drift, Effect, Encoder, Health, Learnt, MAX_CAUSES,
    MAX_COEFFICIENTS, MAX_DRIFTS, MAX_EFFECTS, MAX_POINTS, MAX_RAW, MAX_RAW_FRAME, MAX_TEXT, ModelError, Point, Raw,
    RawBurst, Shift, Term, line_bytes,
};

extern crate std;
use std::vec::Vec as StdVec;

fn log(text: &str) -> Message {
    Message::Log(text.try_into().unwrap())
}

fn frame(encoder: &mut Encoder, message: &Message) -> StdVec<u8> {
    let mut frame = StdVec::new();
    encoder.encode(message.into(), &mut |bytes| frame.extend(bytes));
    frame
}

fn decode(stream: &[u8]) -> (StdVec<Received>, Counters) {
    let mut decoder = Decoder::new();
    let found = stream.iter().filter_map(|&byte| decoder.push(byte)).collect();
    (found, decoder.counters())
}

fn sequences(found: &[Received]) -> StdVec<u16> {
    let sequence = |received: &Received| match received {
        Received::Message { sequence, .. } => Some(*sequence),
        Received::Line(_) => None,
    };
    found.iter().filter_map(sequence).collect()
}

/// The largest channel report there can be: every integer in its longest encoding.
fn largest() -> Message {
    let point = Point { n: u64::MAX, sum: u128::MAX, count: u64::MAX };
    let coefficient =
        Coefficient { term: Term::RateRandomWalk, value: f64::MIN_POSITIVE, low: f64::MIN, high: f64::MAX };
    Message::Channel(ChannelReport {
        channel: u8::MAX,
        samples: u64::MAX,
        missing: u64::MAX,
        points: core::iter::repeat_n(point, MAX_POINTS).collect(),
        coefficients: core::iter::repeat_n(coefficient, MAX_COEFFICIENTS).collect(),
        unseen: Some(ModelError { deviance_per_point: f64::MAX, rms_percent: f64::MAX }),
    })
}

/// A full message of the raw stream, every integer in its longest encoding.
fn raw() -> Message {
    let burst = RawBurst { after_us: u32::MAX, periods: u32::MAX, words: [[0xA5, 0x5A]; 12] };
    let bursts = core::iter::repeat_n(burst, MAX_RAW).collect();
    Message::Raw(Raw { first: u64::MAX, at_us: u64::MAX, sens_avg: u16::MAX, bursts })
}

/// The longest messages of an epoch.
fn checked() -> Message {
    let error = Some(ModelError { deviance_per_point: f64::MAX, rms_percent: f64::MAX });
    let drift = Drift { n: u64::MAX, raw: f64::MAX, compensated: f64::MIN_POSITIVE };
    Message::Checked(Checked {
        channel: u8::MAX,
        epoch: u32::MAX,
        before: error,
        after: error,
        shift: Some(Shift { raw: f64::MIN, compensated: f64::MAX }),
        drift: core::iter::repeat_n(drift, MAX_DRIFTS).collect(),
    })
}

fn learnt() -> Message {
    let cause = Cause { covariate: 10, value: f64::MAX, low: f64::MIN, high: f64::MAX, reference: 25.0 };
    let bounded = Bounded { value: f64::MAX, low: f64::MIN, high: f64::MAX };
    let effect = Effect {
        coefficient: Coefficient { term: Term::Resonance, value: f64::MAX, low: f64::MIN, high: f64::MAX },
        shape: [bounded; 2].into_iter().collect(),
        score: f64::MAX,
        n: u64::MAX,
        excess: f64::MAX,
        sigmas: f64::MAX,
    };
    Message::Learnt(Learnt {
        channel: u8::MAX,
        epoch: u32::MAX,
        causes: core::iter::repeat_n(cause, MAX_CAUSES).collect(),
        effects: core::iter::repeat_n(effect, MAX_EFFECTS).collect(),
        p_before: f64::MIN_POSITIVE,
        p_after: f64::MAX,
    })
}

/// Numbers from a linear congruential generator (Knuth's MMIX constants), seeded, upper bits only.
struct Noise(u64);

impl Noise {
    fn byte(&mut self) -> u8 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 56) as u8
    }
}

#[test]
fn every_message_comes_back_in_order() {
    let health = Message::Health(Health { bursts: 7, ..Health::default() });
    let messages = [log("start"), largest(), health, raw(), checked(), learnt(), log("")];
    let mut encoder = Encoder::new();
    let stream: StdVec<u8> = messages.iter().flat_map(|message| frame(&mut encoder, message)).collect();
    let (found, counters) = decode(&stream);
    assert_eq!(sequences(&found), [0, 1, 2, 3, 4, 5, 6]);
    assert!(found.into_iter().filter_map(Received::message).eq(messages));
    assert_eq!(counters, Counters { frames: 7, ..Counters::default() });
}

/// What a sender makes room for, since it sends in pieces what it cannot take back.
#[test]
fn no_frame_is_longer_than_it_is_said() {
    let length = |message: &Message| frame(&mut Encoder { sequence: u16::MAX }, message).len();
    for message in [log(&"-".repeat(MAX_TEXT)), raw()] {
        assert!(length(&message) <= MAX_RAW_FRAME, "{} bytes: {message:?}", length(&message));
    }
    for message in [largest(), checked(), learnt()] {
        assert!(length(&message) <= MAX_FRAME, "{} bytes: {message:?}", length(&message));
    }
}

/// The bytes of one short frame worked out by hand: version 3, sequence 0, variant 3 (log), length 1, 'A'; the CRC-32 is
/// zlib's of 03 00 03 01 41; COBS puts a length before each stretch without zeros.
#[test]
fn a_frame_is_what_the_format_says() {
    let frame = frame(&mut Encoder::new(), &log("A"));
    let [a, b, c, d] = 0x9B04_73D3_u32.to_le_bytes();
    assert_eq!(frame.as_slice(), [0, 2, 3, 8, 3, 1, 0x41, a, b, c, d, 0]);
}

#[test]
fn frames_may_arrive_in_pieces_of_any_length() {
    let mut encoder = Encoder::new();
    let stream: StdVec<u8> = (0..5).flat_map(|_| frame(&mut encoder, &largest())).collect();
    for piece in [1, 2, 3, 7, 64, 1000, stream.len()] {
        let mut decoder = Decoder::new();
        let mut found = 0;
        for mut bytes in stream.chunks(piece) {
            loop {
                let (received, rest) = decoder.feed(bytes);
                found += usize::from(received.is_some());
                bytes = rest;
                if bytes.is_empty() {
                    break;
                }
            }
        }
        assert_eq!((found, decoder.counters().bad_frames), (5, 0), "pieces of {piece}");
    }
}

/// CRC-32 detects every burst of errors up to 32 bits; a changed byte may besides split or join frames, which must not
/// cost more than the neighbours it touches.
#[test]
fn a_changed_byte_costs_that_frame_and_no_other() {
    let mut encoder = Encoder::new();
    let frames: [StdVec<u8>; 3] = core::array::from_fn(|i| frame(&mut encoder, &log(["before", "hit", "after"][i])));
    let start = frames[0].len();
    for at in 1..frames[1].len() - 1 {
        for bit in 0..8 {
            let mut stream: StdVec<u8> = frames.iter().flatten().copied().collect();
            stream[start + at] ^= 1 << bit;
            let (found, counters) = decode(&stream);
            assert_eq!(sequences(&found), [0, 2], "byte {at}, bit {bit}");
            assert_eq!(counters.missing, 1);
            assert!((1..=2).contains(&counters.bad_frames));
        }
    }
}

#[test]
fn noise_between_frames_costs_no_frame() {
    let mut noise = Noise(1);
    let mut encoder = Encoder::new();
    let mut stream = StdVec::new();
    for round in 0..200 {
        stream.extend((0..round * 20).map(|_| noise.byte()));
        stream.extend(frame(&mut encoder, &log("between")));
    }
    let (found, counters) = decode(&stream);
    assert_eq!(found.len(), 200);
    assert_eq!((counters.frames, counters.missing), (200, 0));
    assert!(counters.bad_frames > 0 && counters.discarded_bytes > 0);
}

#[test]
fn a_cut_frame_is_counted_and_the_next_one_read() {
    let mut encoder = Encoder::new();
    let [first, second, third]: [StdVec<u8>; 3] = core::array::from_fn(|_| frame(&mut encoder, &largest()));
    let stream: StdVec<u8> = first.iter().chain(&second[..second.len() / 2]).chain(&third).copied().collect();
    let (found, counters) = decode(&stream);
    assert_eq!(sequences(&found), [0, 2]);
    assert_eq!((counters.bad_frames, counters.missing), (1, 1));
}

#[test]
fn an_endless_stream_without_zeros_is_bounded_and_counted() {
    let mut stream = std::vec![0x55; 10 * MAX_FRAME];
    stream.extend(frame(&mut Encoder::new(), &log("still here")));
    let (found, counters) = decode(&stream);
    assert_eq!(found.len(), 1);
    assert_eq!((counters.bad_frames, counters.discarded_bytes), (1, 10 * MAX_FRAME as u64));
}

/// A frame of version 2 with a right checksum, made by hand.
#[test]
fn another_version_is_told_from_damage() {
    let body = [2, 0, 9, 9];
    let mut content = StdVec::from(body);
    content.extend(CRC.checksum(&body).to_le_bytes());
    let mut frame = std::vec![0; 32];
    let length = cobs::encode(&content, &mut frame);
    frame.truncate(length + 1);
    let (found, counters) = decode(&frame);
    assert!(found.is_empty());
    assert_eq!(counters, Counters { other_version: 1, ..Counters::default() });
}

/// Right checksum, wrong content: more points than a report may have, and a variant that does not exist.
#[test]
fn a_valid_checksum_over_nonsense_is_a_bad_frame() {
    for body in [&[VERSION, 0, 1, 1, 1, 0, 0xFF][..], &[VERSION, 0, 200][..], &[VERSION][..]] {
        let mut content = StdVec::from(body);
        content.extend(CRC.checksum(body).to_le_bytes());
        let mut frame = std::vec![0; 32];
        let length = cobs::encode(&content, &mut frame);
        frame.truncate(length + 1);
        let (found, counters) = decode(&frame);
        assert!(found.is_empty());
        assert_eq!(counters.bad_frames, 1);
    }
}

#[test]
fn sequence_numbers_wrap_without_a_gap() {
    let mut encoder = Encoder::new();
    let mut decoder = Decoder::new();
    for _ in 0..70_000 {
        for byte in frame(&mut encoder, &log("")) {
            decoder.push(byte);
        }
    }
    assert_eq!(decoder.counters(), Counters { frames: 70_000, ..Counters::default() });
}

#[test]
fn lines_of_text_are_told_from_noise_and_disturb_no_frame() {
    let mut encoder = Encoder::new();
    let line = |text: &str| line_bytes(&text.try_into().unwrap());
    let mut stream = StdVec::new();
    stream.extend(frame(&mut encoder, &log("before")));
    stream.extend(line("? help"));
    stream.extend(line(""));
    stream.extend(b"no line without its end\0");
    stream.extend(frame(&mut encoder, &log("after")));
    let (found, counters) = decode(&stream);
    let [Received::Message { .. }, Received::Line(help), Received::Line(empty), Received::Message { .. }] = &found[..]
    else {
        panic!("{found:?}");
    };
    assert_eq!((help.as_str(), empty.as_str()), ("? help", ""));
    assert_eq!((counters.frames, counters.lines, counters.bad_frames, counters.missing), (2, 2, 1, 0));
}

/// A line cannot hold what would end it or be taken for a frame.
#[test]
fn a_line_is_printable() {
    let line = line_bytes(&"0.05 °/s\0\n".try_into().unwrap());
    assert_eq!(line.as_slice(), b"\x000.05 ??/s??\r\n\0");
}
