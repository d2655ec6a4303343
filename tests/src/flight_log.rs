//! A log of PX4 that a test writes (ULog file format).

/// The bytes of a log: a header, then messages.
#[derive(Debug)]
pub struct FlightLog(pub Vec<u8>);

impl FlightLog {
    /// A log of version 1 that begins at time 0 and has no messages.
    pub fn empty() -> Self {
        Self([&b"ULog\x01\x12\x35\x01"[..], &[0; 8]].concat())
    }

    /// Adds a message of a kind, such as `F` for a definition, `A` for a subscription and `D` for data.
    pub fn add(&mut self, kind: u8, body: &[u8]) {
        self.0.extend(u16::try_from(body.len()).expect("short").to_le_bytes());
        self.0.push(kind);
        self.0.extend(body);
    }
}
