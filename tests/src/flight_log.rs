//! A log of PX4 that a test writes (ULog file format).

/// The bytes of a log: its header, and then its messages.
#[derive(Debug)]
pub struct FlightLog(pub Vec<u8>);

impl FlightLog {
    /// A log without messages, of version 1 and begun at 0.
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
