//! Frames and text lines on the wire: round trip, longest frames, damage, noise.

use link::{
    ChannelMessage, Decoder, DecoderCounters, Encoder, Health, LearnedMessage, MAX_ADDED_TERMS, MAX_COEFFICIENTS,
    MAX_COVARIATES, MAX_DEVIATIONS, MAX_FRAME, MAX_OCTAVES, MAX_RAW_BURSTS, MAX_RAW_FRAME, MAX_TEXT, Message, RawBurst,
    RawMessage, Received, ReportedAddedTerm, ReportedCoefficient, ReportedDeviations, ReportedModelError,
    ReportedOctave, ReportedParameter, ReportedRegressor, ReportedShift, ReportedTerm, VERSION, ValidationMessage,
    text_line, wire_bytes,
};

const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

fn log(text: &str) -> Message {
    Message::Log(text.try_into().unwrap())
}

fn frame(encoder: &mut Encoder, message: &Message) -> Vec<u8> {
    let mut frame = Vec::new();
    encoder.encode(message.into(), &mut |bytes| frame.extend(bytes));
    frame
}

fn decode(stream: &[u8]) -> (Vec<Received>, DecoderCounters) {
    let mut decoder = Decoder::new();
    let found = stream.iter().filter_map(|&byte| decoder.push(byte)).collect();
    (found, decoder.counters())
}

fn sequences(found: &[Received]) -> Vec<u16> {
    let sequence = |received: &Received| match received {
        Received::Message { sequence, .. } => Some(*sequence),
        Received::Text(_) => None,
    };
    found.iter().filter_map(sequence).collect()
}

/// The longest channel message: every list full, every integer in its longest encoding.
fn longest_channel() -> Message {
    let point = ReportedOctave { n: u64::MAX, sum: u128::MAX, count: u64::MAX, interpolation: f32::MAX };
    let coefficient = ReportedCoefficient {
        term: ReportedTerm::RateRandomWalk,
        value: f64::MIN_POSITIVE,
        low: f64::MIN,
        high: f64::MAX,
    };
    Message::Channel(ChannelMessage {
        channel: u8::MAX,
        samples: u64::MAX,
        missing: u64::MAX,
        octaves: core::iter::repeat_n(point, MAX_OCTAVES).collect(),
        coefficients: core::iter::repeat_n(coefficient, MAX_COEFFICIENTS).collect(),
        unseen_error: Some(ReportedModelError { deviance_per_point: f64::MAX, rms_percent: f64::MAX }),
        lost: u64::MAX,
        refused: u64::MAX,
        replaced: u64::MAX,
        self_test_failed: true,
    })
}

/// The longest raw message.
fn longest_raw() -> Message {
    let burst = RawBurst { after_us: u32::MAX, periods: u32::MAX, words: [[0xA5, 0x5A]; 12] };
    let bursts = core::iter::repeat_n(burst, MAX_RAW_BURSTS).collect();
    Message::Raw(RawMessage { first: u64::MAX, at_us: u64::MAX, sens_avg: u16::MAX, bursts })
}

/// The longest validation message.
fn longest_validation() -> Message {
    let error = Some(ReportedModelError { deviance_per_point: f64::MAX, rms_percent: f64::MAX });
    let drift = ReportedDeviations { n: u64::MAX, raw: f64::MAX, compensated: f64::MIN_POSITIVE };
    Message::Validation(ValidationMessage {
        channel: u8::MAX,
        epoch: u32::MAX,
        before: error,
        after: error,
        shift: Some(ReportedShift { raw: f64::MIN, compensated: f64::MAX }),
        drift: core::iter::repeat_n(drift, MAX_DEVIATIONS).collect(),
    })
}

/// The longest message of a learned model.
fn longest_learned() -> Message {
    let regressor =
        ReportedRegressor { covariate: 10, value: f64::MAX, low: f64::MIN, high: f64::MAX, reference: 25.0 };
    let parameter = ReportedParameter { value: f64::MAX, low: f64::MIN, high: f64::MAX };
    let added_term = ReportedAddedTerm {
        coefficient: ReportedCoefficient {
            term: ReportedTerm::Resonance,
            value: f64::MAX,
            low: f64::MIN,
            high: f64::MAX,
        },
        shape: [parameter; 2].into_iter().collect(),
        score: f64::MAX,
        n: u64::MAX,
        excess: f64::MAX,
        sigmas: f64::MAX,
    };
    Message::Learned(LearnedMessage {
        channel: u8::MAX,
        epoch: u32::MAX,
        regressors: core::iter::repeat_n(regressor, MAX_COVARIATES).collect(),
        added_terms: core::iter::repeat_n(added_term, MAX_ADDED_TERMS).collect(),
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
fn every_message_is_decoded_in_order() {
    let health = Message::Health(Health { bursts: 7, ..Health::default() });
    let messages =
        [log("start"), longest_channel(), health, longest_raw(), longest_validation(), longest_learned(), log("")];
    let mut encoder = Encoder::new();
    let stream: Vec<u8> = messages.iter().flat_map(|message| frame(&mut encoder, message)).collect();
    let (found, counters) = decode(&stream);
    assert_eq!(sequences(&found), [0, 1, 2, 3, 4, 5, 6]);
    assert!(found.into_iter().filter_map(Received::message).eq(messages));
    assert_eq!(counters, DecoderCounters { frames: 7, ..DecoderCounters::default() });
}

/// The sender reserves this room in its queue before it emits the first piece of a frame.
#[test]
fn no_frame_exceeds_the_stated_maximum() {
    let length = |message: &Message| {
        let mut encoder = Encoder::new();
        (0..u16::MAX).for_each(|_| encoder.skip()); // the longest encoding of the sequence number
        frame(&mut encoder, message).len()
    };
    for message in [log(&"-".repeat(MAX_TEXT)), longest_raw()] {
        assert!(length(&message) <= MAX_RAW_FRAME, "{} bytes: {message:?}", length(&message));
    }
    for message in [longest_channel(), longest_validation(), longest_learned()] {
        assert!(length(&message) <= MAX_FRAME, "{} bytes: {message:?}", length(&message));
    }
}

/// The bytes of one short frame worked out by hand: version 4, sequence 0, variant 3 (log), length 1, 'A'; the CRC-32 is
/// zlib's of 04 00 03 01 41; COBS puts a length before each block without zeros.
#[test]
fn a_frame_matches_bytes_worked_out_by_hand() {
    let frame = frame(&mut Encoder::new(), &log("A"));
    let [a, b, c, d] = 0x2924_AFC3_u32.to_le_bytes();
    assert_eq!(frame.as_slice(), [0, 2, 4, 8, 3, 1, 0x41, a, b, c, d, 0]);
}

/// CRC-32 detects every burst of errors up to 32 bits; a changed byte may also split or join frames, which must not
/// lose more than this frame.
#[test]
fn a_changed_byte_loses_that_frame_only() {
    let mut encoder = Encoder::new();
    let frames: [Vec<u8>; 3] = core::array::from_fn(|i| frame(&mut encoder, &log(["before", "hit", "after"][i])));
    let start = frames[0].len();
    for at in 1..frames[1].len() - 1 {
        for bit in 0..8 {
            let mut stream: Vec<u8> = frames.iter().flatten().copied().collect();
            stream[start + at] ^= 1 << bit;
            let (found, counters) = decode(&stream);
            assert_eq!(sequences(&found), [0, 2], "byte {at}, bit {bit}");
            assert_eq!(counters.missing, 1);
            assert!((1..=2).contains(&counters.bad_frames));
        }
    }
}

#[test]
fn noise_between_frames_loses_no_frame() {
    let mut noise = Noise(1);
    let mut encoder = Encoder::new();
    let mut stream = Vec::new();
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
fn a_truncated_frame_is_counted_and_the_next_one_is_received() {
    let mut encoder = Encoder::new();
    let [first, second, third]: [Vec<u8>; 3] = core::array::from_fn(|_| frame(&mut encoder, &longest_channel()));
    let stream: Vec<u8> = first.iter().chain(&second[..second.len() / 2]).chain(&third).copied().collect();
    let (found, counters) = decode(&stream);
    assert_eq!(sequences(&found), [0, 2]);
    assert_eq!((counters.bad_frames, counters.missing), (1, 1));
}

#[test]
fn an_endless_stream_without_zeros_is_bounded_and_counted() {
    let mut stream = vec![0x55; 10 * MAX_FRAME];
    stream.extend(frame(&mut Encoder::new(), &log("still here")));
    let (found, counters) = decode(&stream);
    assert_eq!(found.len(), 1);
    assert_eq!((counters.bad_frames, counters.discarded_bytes), (1, 10 * MAX_FRAME as u64));
}

/// A frame of version 2 with a right checksum, assembled by hand.
#[test]
fn another_version_is_counted_apart_from_damage() {
    let body = [2, 0, 9, 9];
    let mut content = Vec::from(body);
    content.extend(CRC.checksum(&body).to_le_bytes());
    let mut frame = vec![0; 32];
    let length = cobs::encode(&content, &mut frame);
    frame.truncate(length + 1);
    let (found, counters) = decode(&frame);
    assert!(found.is_empty());
    assert_eq!(counters, DecoderCounters { other_version: 1, ..DecoderCounters::default() });
}

/// The checksum is right and the content wrong: more octaves than a message may have, or a variant that does not exist.
#[test]
fn a_valid_checksum_over_invalid_content_is_a_bad_frame() {
    for body in [&[VERSION, 0, 1, 1, 1, 0, 0xFF][..], &[VERSION, 0, 200][..], &[VERSION][..]] {
        let mut content = Vec::from(body);
        content.extend(CRC.checksum(body).to_le_bytes());
        let mut frame = vec![0; 32];
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
    assert_eq!(decoder.counters(), DecoderCounters { frames: 70_000, ..DecoderCounters::default() });
}

#[test]
fn text_lines_are_distinguished_from_noise_and_from_frames() {
    let mut encoder = Encoder::new();
    let line = |text: &str| wire_bytes(&text.try_into().unwrap());
    let mut stream = Vec::new();
    stream.extend(frame(&mut encoder, &log("before")));
    stream.extend(line("? help"));
    stream.extend(line(""));
    stream.extend(b"no line without its end\0");
    stream.extend(frame(&mut encoder, &log("after")));
    let (found, counters) = decode(&stream);
    let [Received::Message { .. }, Received::Text(help), Received::Text(empty), Received::Message { .. }] = &found[..]
    else {
        panic!("{found:?}");
    };
    assert_eq!((help.as_str(), empty.as_str()), ("? help", ""));
    assert_eq!((counters.frames, counters.lines, counters.bad_frames, counters.missing), (2, 2, 1, 0));
}

/// Text cannot contain a line end or a zero byte.
#[test]
fn a_text_line_is_printable() {
    let line = wire_bytes(&"0.05 °/s\0\n".try_into().unwrap());
    assert_eq!(line.as_slice(), b"\x000.05 ??/s??\r\n\0");
}

/// The longest line, a zero byte on either side and its end take 124 bytes, which just fit the buffer.
#[test]
fn the_longest_text_line_is_sent_whole() {
    let line = "x".repeat(MAX_TEXT);
    let bytes = wire_bytes(&line.as_str().try_into().unwrap());
    assert_eq!(bytes.as_slice(), format!("\0{line}\r\n\0").as_bytes());
    assert!(bytes.len() == 124 && bytes.is_full());
}

#[test]
fn a_text_line_is_cut_between_two_characters() {
    assert_eq!(text_line(format_args!("{:°>200}", "")).len(), MAX_TEXT);
    assert_eq!(text_line(format_args!("a{:°>200}", "")).len(), MAX_TEXT - 1);
}
