//! The bytes of a device.

use link::{Decoder, Encoder, Received};

/// Whatever arrives, a message that was taken is one that could have been sent: encoded again it is received again, with the same content;
/// and every byte is a frame's, a line's, or was discarded.
pub(crate) fn stream(bytes: &[u8]) {
    let (mut decoder, mut encoder) = (Decoder::new(), Encoder::new());
    for received in bytes.iter().filter_map(|&byte| decoder.push(byte)) {
        let Received::Message { message, .. } = received else { continue };
        let mut again = Decoder::new();
        let mut frame = Vec::new();
        encoder.encode((&message).into(), &mut |bytes| frame.extend_from_slice(bytes));
        let received: Vec<Received> = frame.iter().filter_map(|&byte| again.push(byte)).collect();
        let [Received::Message { message: again, .. }] = received.as_slice() else {
            panic!("{message:?}: {received:?}")
        };
        // By their text: a number that is none is not equal to itself.
        assert_eq!(format!("{again:?}"), format!("{message:?}"));
    }
}
