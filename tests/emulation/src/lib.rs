//! A run of an image on an emulated STM32F405: the requests of the tests to the emulator (`tests/tools/stm32f4-emulator`), and its results.
//!
//! The emulator is a separate program, since it depends on a compiler of machine code and needs a newer Rust. It reads a [`Scenario`] from
//! its standard input and writes an [`Outcome`] to its standard output, both in the format of postcard.

mod sensors;

pub use sensors::{EPOCH_S, LINE_HZ, RATE_HZ, SENSITIVITY, STEP_G, Sensor, four_effects, warming_part};

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Bytes of a burst, with the request.
pub const BURST_BYTES: usize = 26;

/// Address of the register at `offset` of a GPIO port.
pub const fn gpio(port: usize, offset: u64) -> u64 {
    0x4002_0000 + 0x400 * port as u64 + offset
}
/// Offsets of GPIOx_OSPEEDR, GPIOx_PUPDR and GPIOx_ODR (RM0090 section 8.4).
pub const OSPEEDR: u64 = 0x08;
pub const PUPDR: u64 = 0x0C;
pub const ODR: u64 = 0x14;
/// Status and control of the flash interface (RM0090 sections 3.9.6 and 3.9.8).
pub const FLASH_SR: u64 = 0x4002_3C0C;
pub const FLASH_CR: u64 = 0x4002_3C10;
/// Option bytes (RM0090 section 3.9.10).
pub const FLASH_OPTCR: u64 = 0x4002_3C14;
/// Control register 1 of SPI1, whose bits 0 and 1 are CPHA and CPOL (RM0090 section 28.5.1).
pub const SPI1_CR1: u64 = 0x4001_3000;
/// CRC polynomial of SPI1, which the firmware does not use; 7 after a reset of the peripheral (RM0090 section 28.5.5).
pub const SPI1_CRCPR: u64 = 0x4001_3010;
/// Ports to which the lines 0 to 7 of the external interrupt controller are connected (RM0090 section 9.2).
pub const SYSCFG_EXTICR: [u64; 2] = [0x4001_3808, 0x4001_380C];
/// Lines that raise an interrupt, and those that do so at rising and at falling edges (RM0090 section 12.3).
pub const EXTI_IMR: u64 = 0x4001_3C00;
pub const EXTI_RTSR: u64 = 0x4001_3C08;
pub const EXTI_FTSR: u64 = 0x4001_3C0C;
/// Peripherals that stop while a debugger halts the processor; bit 12 is the watchdog (RM0090 section 38.16.4).
pub const DBGMCU_APB1_FZ: u64 = 0xE004_2008;

/// Memory that is at address 0; 1 in its lowest two bits is system memory (RM0090 section 9.2.1).
pub const SYSCFG_MEMRMP: u64 = 0x4001_3800;

/// The boards' bus clock of 42 MHz, divided by the first power of two that gives at most 1 MHz, and at most 300 kHz.
pub const SCK_HZ: u32 = 42_000_000 / 64;
pub const SLOW_SCK_HZ: u32 = 42_000_000 / 256;

/// The wiring of a board by its documents: crystal, and the connections of the image's pins.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct Wiring {
    pub crystal_hz: u64,
    /// Port (0 for A) and pin of the data-ready line.
    pub data_ready: (usize, u8),
    /// Index of the USART that is connected to the host: 1 for USART2.
    pub usart: usize,
    /// Port and pin of the USART's receiver.
    pub receiver: (usize, u8),
    /// Port and pin of the LED.
    pub led: (usize, u8),
}

/// Olimex STM32-H405: 8 MHz, PB0, USART2, PC12.
pub const H405: Wiring = Wiring { crystal_hz: 8_000_000, data_ready: (1, 0), usart: 1, receiver: (0, 3), led: (2, 12) };
/// Adafruit Feather STM32F405 Express: 12 MHz, PC4 (A4), USART3 (TX, RX), PC1 (D13).
pub const FEATHER: Wiring =
    Wiring { crystal_hz: 12_000_000, data_ready: (2, 4), usart: 2, receiver: (1, 11), led: (2, 1) };

/// A debug probe.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Probe {
    /// The probe reads the log.
    Reads,
    /// The probe makes the image wait for it when the log is full, as probe-rs does, and reads nothing.
    Stalls,
}

/// An event that happens to the device during a run.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub enum Event {
    /// The sensor resets itself, as after a dip of its supply.
    SensorReset,
    /// The sensor is put to sleep indefinitely.
    SensorSleep,
    /// Another device writes this frame to the sensor.
    WriteRegister(u16),
    /// The data line to the processor is held at this byte, or released.
    Stuck(Option<u8>),
    /// The data-ready line changes its level every 4 us for this time, in ns.
    Oscillate(u64),
    /// This number of data-ready edges do not reach the processor.
    LoseEdges(u32),
    /// The sensor is unplugged (no edges, zeros on the data line), or plugged in again.
    Unplugged(bool),
    /// The reset pin is pulsed.
    ResetPin,
    /// The supply dips: memory loses its contents, and the microcontroller restarts.
    BrownOut,
    /// The end of the next burst raises no interrupt, as if a bit of the DMA's control register had flipped.
    LoseBurstEnd,
    /// The stream that receives the next burst stops within it, as after an error on the bus.
    StopReceiving,
    /// A register of the microcontroller holds this value, as if its bits had flipped.
    ChangeRegister(u64, u64),
    /// The microsecond counter stops.
    StopCounter,
    /// The next access to the timer is answered with a bus error.
    BusError,
    /// Every aligned pair of words in memory that holds this value becomes 0.
    ClearInMemory(u64),
}

/// The parameters of a run.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Scenario {
    pub wiring: Wiring,
    /// True if the crystal does not start.
    pub crystal_fails: bool,
    pub sensor: Option<Sensor>,
    /// Keys sent over the serial port, each with its time in s, in order.
    pub keys: Vec<(f64, Vec<u8>)>,
    /// Events, each with its time in s, in order.
    pub events: Vec<(f64, Event)>,
    pub seconds: f64,
    pub probe: Option<Probe>,
    /// True if the core takes eight cycles per instruction instead of one, so that waiting for a peripheral costs an eighth to emulate.
    pub slow_core: bool,
}

impl Default for Scenario {
    fn default() -> Self {
        Self {
            wiring: H405,
            crystal_fails: false,
            sensor: None,
            keys: vec![],
            events: vec![],
            seconds: 0.0,
            probe: None,
            slow_core: false,
        }
    }
}

/// Instructions executed and samples taken up to a time.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct Work {
    /// The time, ns.
    pub at: u64,
    pub instructions: u64,
    pub samples: u64,
}

/// Record of the sensor on the bus.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct BusRecord {
    /// Number of samples that the part has taken.
    pub samples: u64,
    /// Violations of the bus timing, as text.
    pub violations: Vec<String>,
    /// The part's answer to each burst in order, with the number of its latest sample at that time.
    pub bursts: Vec<(u64, [u8; BURST_BYTES])>,
    /// Shortest time from one byte to the next within a frame, in ns.
    pub shortest_byte_ns: u64,
    /// Shortest time between the last SCK edge of a word of a burst and the first of the next, in ns.
    pub shortest_gap_ns: u64,
    /// Shortest time for which chip select was high between two frames, in ns.
    pub shortest_high_ns: u64,
    /// Shortest time from one falling edge of chip select to the next, in ns.
    pub shortest_read_ns: u64,
    /// Times for which chip select was low without a clock, in ns.
    pub pulses_ns: Vec<u64>,
    /// Number of words that do not have eight bits.
    pub odd_words: u64,
}

/// A line of the log (RTT) in the image's memory, decoded by the table of formats in its ELF.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct LogLine {
    pub level: String,
    pub text: String,
}

/// The results of a run.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Outcome {
    pub sensor: Option<BusRecord>,
    /// Bytes from the serial port, each with the time in ns at which its stop bit ended.
    pub received: Vec<(u64, u8)>,
    /// Messages of the emulator: accesses to unmapped addresses, registers without a model, resets.
    pub diagnostics: Vec<String>,
    /// One value per virtual second, and one at the end.
    pub work: Vec<Work>,
    /// Number of changes of the LED's level.
    pub led_changes: u32,
    /// Registers at the end, by address: speeds and pulls of ports A to C, and the others that this crate names.
    pub registers: BTreeMap<u64, u64>,
    /// Lines of the log that a debug probe has read.
    pub log: Vec<LogLine>,
}

impl Scenario {
    /// The bytes that the emulator reads.
    pub fn to_bytes(&self) -> Vec<u8> {
        postcard::to_stdvec(self).expect("room")
    }

    pub fn from_bytes(bytes: &[u8]) -> Result<Self, postcard::Error> {
        postcard::from_bytes(bytes)
    }
}

impl Outcome {
    /// The bytes that the emulator writes.
    pub fn to_bytes(&self) -> Vec<u8> {
        postcard::to_stdvec(self).expect("room")
    }

    pub fn from_bytes(bytes: &[u8]) -> Result<Self, postcard::Error> {
        postcard::from_bytes(bytes)
    }
}
