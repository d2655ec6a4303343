//! The bytes of a device.

use link::{Decoder, Encoder, Received};

/// A received message must be one that a device could have sent: encoded again, it is received with the same content. Every byte belongs to
/// a frame or a line, or is counted as discarded.
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
        // Texts are compared, since NaN is not equal to itself.
        assert_eq!(format!("{again:?}"), format!("{message:?}"));
    }
}
