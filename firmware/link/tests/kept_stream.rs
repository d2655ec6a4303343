//! Byte streams from firmware of each version of the wire format, with their contents. If a change decodes them differently, the format
//! needs a new version, since devices in use send them. Also tested: messages, and fields at the end of a message, that the receiver does
//! not know.

use link::{Decoder, DecoderCounters, Encoder, Message, Received};

/// One message of each kind, numbered from 0.
const VERSION_4: &[u8] = include_bytes!("kept_stream/version-4-safe-mode.bin");
const VERSION_4_MESSAGES: &str = include_str!("kept_stream/version-4-safe-mode.txt");
/// The stream of [`VERSION_4`] before `Boot` had its last field, `safe_mode`, which is false.
const SECOND_VERSION_4: &[u8] = include_bytes!("kept_stream/version-4-mixed-alarm.bin");
const SECOND_VERSION_4_MESSAGES: &str = include_str!("kept_stream/version-4-mixed-alarm.txt");
/// The stream of [`VERSION_4`] before `Health` had its last field, `mixed_alarm`, which is 0.
const FIRST_VERSION_4: &[u8] = include_bytes!("kept_stream/version-4.bin");
const FIRST_VERSION_4_MESSAGES: &str = include_str!("kept_stream/version-4.txt");

const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

fn decode(stream: &[u8]) -> (Vec<Message>, DecoderCounters) {
    let mut decoder = Decoder::new();
    let found = stream.iter().filter_map(|&byte| decoder.push(byte)).filter_map(Received::message).collect();
    (found, decoder.counters())
}

/// The contents of the frames of a stream, without their checksums.
fn bodies(stream: &[u8]) -> Vec<Vec<u8>> {
    let frames = stream.split(|byte| *byte == 0).filter(|frame| !frame.is_empty());
    frames
        .map(|frame| {
            let mut content = frame.to_vec();
            let body = cobs::decode_in_place(&mut content).expect("COBS") - 4;
            content.truncate(body + 4);
            assert_eq!(content[body..], CRC.checksum(&content[..body]).to_le_bytes());
            content.truncate(body);
            content
        })
        .collect()
}

fn frame(body: &[u8]) -> Vec<u8> {
    let content = [body, &CRC.checksum(body).to_le_bytes()].concat();
    let mut frame = vec![0; content.len() + content.len() / 254 + 3];
    let length = cobs::encode(&content, &mut frame[1..]);
    frame.truncate(length + 2);
    frame
}

#[test]
fn the_kept_streams_decode_to_the_kept_messages() {
    for (stream, said) in [
        (VERSION_4, VERSION_4_MESSAGES),
        (SECOND_VERSION_4, SECOND_VERSION_4_MESSAGES),
        (FIRST_VERSION_4, FIRST_VERSION_4_MESSAGES),
    ] {
        let (messages, counters) = decode(stream);
        assert_eq!(counters, DecoderCounters { frames: 7, ..DecoderCounters::default() });
        assert_eq!(format!("{messages:#?}\n"), said);
    }
}

#[test]
fn messages_are_encoded_as_in_the_kept_stream() {
    let (messages, _) = decode(VERSION_4);
    let mut encoder = Encoder::new();
    let mut stream: Vec<u8> = Vec::new();
    for message in &messages {
        encoder.encode(message.into(), &mut |bytes| stream.extend(bytes));
    }
    assert_eq!(stream, VERSION_4);
}

#[test]
fn fields_that_a_later_build_appends_are_left_out() {
    let later: Vec<u8> = bodies(VERSION_4).iter().flat_map(|body| frame(&[body, &[1, 2, 3][..]].concat())).collect();
    let (messages, counters) = decode(&later);
    assert_eq!(counters, DecoderCounters { frames: 7, ..DecoderCounters::default() });
    assert_eq!(messages, decode(VERSION_4).0);
}

#[test]
fn a_message_that_a_later_build_adds_loses_no_other() {
    // The receiver knows kinds 0 to 6; a message of kind 7 follows each.
    let frames = bodies(VERSION_4).into_iter().flat_map(|body| {
        let unknown = [&[body[0], body[1], 7][..], &[9; 40]].concat();
        [frame(&body), frame(&unknown)].concat()
    });
    let (messages, counters) = decode(&frames.collect::<Vec<u8>>());
    assert_eq!(messages, decode(VERSION_4).0);
    assert_eq!((counters.frames, counters.bad_frames), (7, 7));
}
