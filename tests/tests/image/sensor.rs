//! The virtual sensor behind the chip select of the emulated bus, in the emulator's time.

use adis16405_driver::BURST_BYTES;
use rigless::chip::{Timeline, spi::Peer};
use rigless::snapshot::Store;
use virtual_sensor::VirtualAdis16405;

#[derive(Debug, Clone)]
pub(crate) struct Sensor {
    pub(crate) part: VirtualAdis16405,
    /// What the part answered in each burst, in order, with the number of the sample that it had then.
    pub(crate) bursts: Vec<(u64, [u8; BURST_BYTES])>,
    /// Shortest time from one byte to the next within a frame, in ns.
    pub(crate) shortest_byte_ns: u64,
    /// What the data line is held at.
    pub(crate) stuck: Option<u8>,
    /// Words that were not of eight bits.
    pub(crate) odd_words: u64,
    byte_ns: u64,
    frame: Vec<(u8, u8)>,
    last_byte: Option<u64>,
    /// Whether a frame is under way.
    pub(crate) selected: bool,
}

impl Sensor {
    /// `sck_hz` is what the clock should be: the emulator reports a byte when it has crossed, the part wants to know
    /// when it began. [`shortest_byte_ns`](Self::shortest_byte_ns) shows what the clock was.
    pub(crate) fn new(mut part: VirtualAdis16405, sck_hz: u32) -> Self {
        part.set_sck_hz(Some(sck_hz));
        Self {
            part,
            byte_ns: 8_000_000_000 / u64::from(sck_hz),
            bursts: Vec::new(),
            shortest_byte_ns: u64::MAX,
            stuck: None,
            odd_words: 0,
            frame: Vec::new(),
            last_byte: None,
            selected: false,
        }
    }
}

impl Sensor {
    /// Lets the part's time pass; within a frame no further than to where a byte under way has begun, which is heard of
    /// when it has crossed.
    pub(crate) fn advance_to(&mut self, now: u64) {
        self.part.advance_to(if self.selected { now.saturating_sub(self.byte_ns) } else { now });
    }
}

impl Store for Sensor {}

impl Peer for Sensor {
    fn transfer(&mut self, mosi: u32, bits: u8, context: &mut Timeline<'_, '_>) -> u32 {
        let now = context.now().0;
        if let Some(last) = self.last_byte.replace(now) {
            self.shortest_byte_ns = self.shortest_byte_ns.min(now - last);
        }
        self.odd_words += u64::from(bits != 8);
        self.part.advance_to(now.saturating_sub(self.byte_ns));
        let answer = self.part.transfer_byte(mosi as u8);
        let miso = self.stuck.unwrap_or(answer);
        self.frame.push((mosi as u8, miso));
        u32::from(miso)
    }

    fn select(&mut self, context: &mut Timeline<'_, '_>) {
        self.part.advance_to(context.now().0);
        self.part.select();
        self.selected = true;
        self.frame.clear();
        self.last_byte = None;
    }

    fn deselect(&mut self, context: &mut Timeline<'_, '_>) {
        self.part.advance_to(context.now().0);
        self.part.deselect();
        self.selected = false;
        let asked_for_burst = self.frame.first().is_some_and(|&(mosi, _)| mosi == 0x3E);
        let answers: Vec<u8> = self.frame.iter().map(|&(_, miso)| miso).collect();
        if asked_for_burst && let Ok(burst) = answers.try_into() {
            self.bursts.push((self.part.samples(), burst));
        }
    }
}
