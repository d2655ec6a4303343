//! The devices connected to the microcontroller: the virtual sensor at its chip select, and a terminal at the serial
//! port, both in the emulator's time.

use emulation::{BusRecord, SCK_HZ, SLOW_SCK_HZ};
use rigless::chip::{Timeline, spi, uart};
use rigless::snapshot::Store;
use rigless::time::VirtualNanos;
use std::collections::VecDeque;
use virtual_sensor::VirtualAdis16405;

#[derive(Debug, Clone)]
pub(crate) struct Sensor {
    pub(crate) part: VirtualAdis16405,
    /// Byte at which the data line to the processor is held.
    pub(crate) stuck_at: Option<u8>,
    record: BusRecord,
    byte_ns: u64,
    selected_at: u64,
    deselected_at: Option<u64>,
    frame: Vec<(u8, u8)>,
    last_byte: Option<u64>,
    /// True if a frame is under way.
    pub(crate) selected: bool,
}

impl Sensor {
    /// The emulator reports a byte at its end, but the part needs the time of its begin. A byte counts as eight periods
    /// of [`SCK_HZ`] or, by the time of the first byte of its frame, of [`SLOW_SCK_HZ`].
    /// [`BusRecord::shortest_byte_ns`] has the true duration.
    pub(crate) fn new(mut part: VirtualAdis16405) -> Self {
        part.set_sck_hz(Some(SCK_HZ));
        Self {
            part,
            byte_ns: byte_ns(SCK_HZ),
            selected_at: 0,
            deselected_at: None,
            stuck_at: None,
            record: BusRecord {
                shortest_byte_ns: u64::MAX,
                shortest_gap_ns: u64::MAX,
                shortest_high_ns: u64::MAX,
                shortest_read_ns: u64::MAX,
                ..BusRecord::default()
            },
            frame: Vec::new(),
            last_byte: None,
            selected: false,
        }
    }

    /// The record of the sensor so far.
    pub(crate) fn record(&self) -> BusRecord {
        let violations = self.part.violations().iter().map(ToString::to_string).collect();
        BusRecord { samples: self.part.samples(), violations, ..self.record.clone() }
    }

    /// Advances the part to a time in ns. Within a frame it stays one byte behind, since a byte is reported at its end.
    pub(crate) fn advance_to(&mut self, now: u64) {
        self.part.advance_to(if self.selected { now.saturating_sub(self.byte_ns) } else { now });
    }
}

/// Time of eight periods of a serial clock.
fn byte_ns(sck_hz: u32) -> u64 {
    8_000_000_000 / u64::from(sck_hz)
}

impl Store for Sensor {}

impl spi::Peer for Sensor {
    fn transfer(&mut self, mosi: u32, bits: u8, context: &mut Timeline<'_, '_>) -> u32 {
        let now = context.now().0;
        if let Some(last) = self.last_byte.replace(now) {
            self.record.shortest_byte_ns = self.record.shortest_byte_ns.min(now - last);
            if self.frame.len().is_multiple_of(2) {
                self.record.shortest_gap_ns =
                    self.record.shortest_gap_ns.min((now - last).saturating_sub(self.byte_ns));
            }
        }
        self.record.odd_words += u64::from(bits != 8);
        if self.frame.is_empty() {
            let sck_hz = if now - self.selected_at < byte_ns(SLOW_SCK_HZ) { SCK_HZ } else { SLOW_SCK_HZ };
            self.byte_ns = byte_ns(sck_hz);
            self.part.set_sck_hz(Some(sck_hz));
        }
        self.part.advance_to(now.saturating_sub(self.byte_ns));
        let answer = self.part.transfer_byte(mosi as u8);
        let miso = self.stuck_at.unwrap_or(answer);
        self.frame.push((mosi as u8, miso));
        u32::from(miso)
    }

    fn select(&mut self, context: &mut Timeline<'_, '_>) {
        self.part.advance_to(context.now().0);
        self.part.select();
        self.selected = true;
        let selected_before = std::mem::replace(&mut self.selected_at, context.now().0);
        if let Some(deselected_at) = self.deselected_at {
            self.record.shortest_read_ns = self.record.shortest_read_ns.min(self.selected_at - selected_before);
            self.record.shortest_high_ns = self.record.shortest_high_ns.min(self.selected_at - deselected_at);
        }
        self.frame.clear();
        self.last_byte = None;
    }

    fn deselect(&mut self, context: &mut Timeline<'_, '_>) {
        self.part.advance_to(context.now().0);
        self.part.deselect();
        self.selected = false;
        self.deselected_at = Some(context.now().0);
        if self.frame.is_empty() {
            self.record.pulses_ns.push(context.now().0 - self.selected_at);
        }
        let burst_requested = self.frame.first().is_some_and(|&(mosi, _)| mosi == 0x3E);
        let answers: Vec<u8> = self.frame.iter().map(|&(_, miso)| miso).collect();
        if burst_requested && let Ok(burst) = answers.try_into() {
            self.record.bursts.push((self.part.samples(), burst));
        }
    }
}

/// Records the bytes of the image, and sends keys.
#[derive(Debug, Default)]
pub(crate) struct Terminal {
    /// Every byte received, with the time in ns at which its stop bit ended.
    pub(crate) received: Vec<(u64, u8)>,
    /// Keys still to be sent, by rising time in ns.
    pub(crate) keys: VecDeque<(u64, u8)>,
}

impl Store for Terminal {}

impl uart::Peer for Terminal {
    fn receive(&mut self, word: u16, context: &mut Timeline<'_, '_>) {
        self.received.push((context.now().0, word as u8));
    }

    fn transmit(&mut self, now: VirtualNanos) -> Option<u16> {
        if self.keys.front()?.0 > now.0 {
            return None;
        }
        self.keys.pop_front().map(|(_, key)| u16::from(key))
    }
}
