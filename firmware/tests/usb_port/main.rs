//! The USB port on a simulated bus. These tests cover what the Pico's emulator cannot show: line coding, suspending,
//! unplugging, and a host that does not read for an hour.

mod host;

use firmware::usb_port::{MANUFACTURER, PRODUCT, UsbPort};
use firmware::{ReceiveBuffer, Receiver, ServedPort as _, TransmitBuffer, TransmitQueue};
use heapless::spsc::Consumer;
use host::MockBus;
use link::{Decoder, MessageRef, Received, text_line};
use std::cell::RefCell;
use usb_device::bus::UsbBusAllocator;
use usb_device::device::UsbVidPid;

const PRODUCT_ID: UsbVidPid = UsbVidPid(0x2E8A, 0x000A);
const SERIAL_NUMBER: &str = "E66058388309A1B2";

// Requests of USB 2.0, section 9.4, and of the class for communication devices (PSTN 1.2, sections 6.3.10 to 6.3.12).
const SET_ADDRESS: [u8; 8] = [0x00, 5, 7, 0, 0, 0, 0, 0];
const SET_CONFIGURATION: [u8; 8] = [0x00, 9, 1, 0, 0, 0, 0, 0];
const GET_DEVICE: [u8; 8] = [0x80, 6, 0, 1, 0, 0, 18, 0];
const SET_LINE_CODING: [u8; 8] = [0x21, 0x20, 0, 0, 0, 0, 7, 0];
const GET_LINE_CODING: [u8; 8] = [0xA1, 0x21, 0, 0, 0, 0, 7, 0];
/// DTR and RTS are set: a terminal opens the port.
const OPEN: [u8; 8] = [0x21, 0x22, 3, 0, 0, 0, 0, 0];
const CLOSE: [u8; 8] = [0x21, 0x22, 0, 0, 0, 0, 0, 0];

/// The endpoints that carry the bytes. They follow the endpoint of the notifications in the order of allocation.
const DATA_IN: usize = 2;
const DATA_OUT: usize = 1;

/// A device on the bus, with a UART that is always emptied.
struct Bench {
    bus: MockBus,
    port: UsbPort<'static, MockBus>,
    queue: TransmitQueue<'static>,
    uart: Consumer<'static, u8>,
    received: Consumer<'static, u8>,
    now_us: u32,
}

thread_local! {
    /// Requests of the port to its controller, in order: off the bus (false), or start again (true).
    static RECONNECTED: RefCell<Vec<bool>> = const { RefCell::new(Vec::new()) };
}

fn leak<T>(value: T) -> &'static mut T {
    Box::leak(Box::new(value))
}

impl Bench {
    fn new() -> Self {
        let bus = MockBus::default();
        let allocator = leak(UsbBusAllocator::new(bus.clone()));
        let (to_uart, uart) = leak(TransmitBuffer::new()).split();
        let (to_usb, usb) = leak(TransmitBuffer::new()).split();
        let (receive, received) = leak(ReceiveBuffer::new()).split();
        let reconnect = |connected| RECONNECTED.with_borrow_mut(|calls| calls.push(connected));
        let ends = (usb, Receiver::new(receive));
        let port = UsbPort::new(allocator, PRODUCT_ID, SERIAL_NUMBER, ends, reconnect).expect("enough endpoints");
        let queue = TransmitQueue::new(to_uart).with_usb(Some(to_usb));
        Self { bus, port, queue, uart, received, now_us: u32::MAX - 5_000_000 }
    }

    fn serve(&mut self) -> u32 {
        self.port.serve(self.now_us)
    }

    fn control(&mut self, setup: [u8; 8], data: &[u8]) -> Option<Vec<u8>> {
        let (port, now_us) = (&mut self.port, self.now_us);
        self.bus.control(setup, data, || {
            port.serve(now_us);
        })
    }

    /// Serves the port every 0.1 s, as the board does 16 times a second.
    fn pass_tenths_of_a_second(&mut self, count: u32) {
        for _ in 0..count {
            self.now_us = self.now_us.wrapping_add(100_000);
            self.serve();
        }
    }

    /// The host finds the device and configures it.
    fn enumerate(&mut self) {
        self.bus.reset_bus();
        self.serve();
        assert_eq!(self.control(SET_ADDRESS, &[]), Some(vec![]));
        assert_eq!(self.control(SET_CONFIGURATION, &[]), Some(vec![]));
    }

    fn open(&mut self) {
        assert_eq!(self.control(OPEN, &[]), Some(vec![]));
    }

    /// Sends a text; the UART has sent it on return.
    fn print(&mut self, text: &str) -> Vec<u8> {
        assert!(self.queue.send_text(&text_line(format_args!("{text}"))), "the UART has room");
        self.serve();
        self.uart()
    }

    fn uart(&mut self) -> Vec<u8> {
        std::iter::from_fn(|| self.uart.dequeue()).collect()
    }

    /// Reads as the host until the device has no more bytes.
    fn read(&mut self) -> Vec<u8> {
        let mut bytes = Vec::new();
        while let Some(packet) = self.bus.read(DATA_IN) {
            bytes.extend(packet);
            self.serve();
        }
        bytes
    }

    fn string(&mut self, number: u8) -> String {
        let bytes = self.control([0x80, 6, number, 3, 0x09, 0x04, 255, 0], &[]).expect("a string");
        let units: Vec<u16> = bytes[2..].chunks(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]])).collect();
        String::from_utf16(&units).unwrap()
    }
}

fn lines(bytes: &[u8]) -> Vec<String> {
    let mut decoder = Decoder::new();
    let received = bytes.iter().filter_map(|&byte| decoder.push(byte));
    let lines = received.map(|received| match received {
        Received::Text(line) => line.as_str().to_owned(),
        Received::Message { message, .. } => format!("{message:?}"),
    });
    let lines = lines.collect();
    assert_eq!(decoder.counters().bad_frames, 0, "{:?}", decoder.counters());
    lines
}

#[test]
fn the_host_finds_a_serial_port_with_a_name_and_a_number() {
    let mut bench = Bench::new();
    bench.enumerate();
    let device = bench.control(GET_DEVICE, &[]).expect("the descriptor");
    // The expected values are from USB 2.0, table 9-8, and the class of communication devices.
    assert_eq!((device[0], device[1], device[4]), (18, 1, 2));
    assert_eq!(device[8..12], [0x8A, 0x2E, 0x0A, 0x00]);
    let strings = [14, 15, 16].map(|field| bench.string(device[field]));
    assert_eq!(strings, [MANUFACTURER, PRODUCT, SERIAL_NUMBER]);
}

/// The baud rate has no meaning on USB, but a terminal that sets it must read it back.
#[test]
fn any_line_coding_is_taken() {
    let mut bench = Bench::new();
    bench.enumerate();
    // 9,600 and 3,000,000 Bd, stop bits, parity and data bits.
    for coding in [[0x80, 0x25, 0, 0, 0, 0, 8], [0xC0, 0xC6, 0x2D, 0, 2, 1, 7]] {
        assert_eq!(bench.control(SET_LINE_CODING, &coding), Some(vec![]));
        assert_eq!(bench.control(GET_LINE_CODING, &[]), Some(coding.to_vec()));
    }
    bench.open();
    let sent = bench.print("sampling");
    assert_eq!(bench.read(), sent);
}

#[test]
fn usb_has_the_bytes_of_the_uart_and_takes_commands() {
    let mut bench = Bench::new();
    bench.enumerate();
    bench.open();
    let (mut uart, mut usb) = (Vec::new(), Vec::new());
    // Packets have all lengths up to the longest, and a full one comes last.
    for length in 1..=120 {
        uart.extend(bench.print(&"x".repeat(length)));
        usb.extend(bench.read());
    }
    assert_eq!(usb, uart);
    assert!(bench.queue.send(MessageRef::Log("a message")));
    bench.serve();
    assert_eq!(bench.read(), bench.uart());
    bench.bus.send(DATA_OUT, b"f 819.2\r");
    assert_eq!(bench.serve(), 0);
    let typed: Vec<u8> = std::iter::from_fn(|| bench.received.dequeue()).collect();
    assert_eq!(typed, b"f 819.2\r");
}

/// The input is longer than the receive queue. Lost bytes are counted, and the packets do not stay in the endpoint, whose interrupt would
/// not end.
#[test]
fn too_much_input_is_counted() {
    let mut bench = Bench::new();
    bench.enumerate();
    (0..5).for_each(|_| bench.bus.send(DATA_OUT, &[b'?'; 64]));
    let lost: u32 = (0..8).map(|_| bench.serve()).sum();
    assert_eq!(lost, 5 * 64 - 255);
    assert_eq!(std::iter::from_fn(|| bench.received.dequeue()).count(), 255);
}

/// No host reads while 36,000 lines are printed; then a terminal reads. It gets the lines that the queue held, whole,
/// and all later ones. The others are counted.
#[test]
fn a_host_that_does_not_read_loses_only_the_lines_of_that_time() {
    let mut bench = Bench::new();
    bench.enumerate();
    bench.open();
    for number in 0..36_000 {
        assert_eq!(lines(&bench.print(&format!("line {number}"))), [format!("line {number}")], "the UART is complete");
        assert!(bench.queue.has_room());
    }
    let kept = lines(&bench.read());
    assert_eq!(kept.len() + bench.queue.usb_dropped() as usize, 36_000);
    assert!(kept.len() > 100 && kept.iter().enumerate().all(|(number, line)| *line == format!("line {number}")));
    let sent = bench.print("read again");
    assert_eq!(bench.read(), sent);
}

/// With a cable without a host, or a charger, no byte is queued and none counts as lost.
#[test]
fn without_a_host_nothing_waits() {
    let mut bench = Bench::new();
    (0..1000).for_each(|number| drop(bench.print(&format!("line {number}"))));
    assert_eq!(bench.queue.usb_dropped(), 0);
    bench.enumerate();
    bench.open();
    let sent = bench.print("the first line for the host");
    assert_eq!(bench.read(), sent);
}

/// A terminal that opens the port does not get what was printed while the port was closed.
#[test]
fn a_terminal_begins_with_what_comes_after_it() {
    let mut bench = Bench::new();
    bench.enumerate();
    bench.open();
    bench.print("half read");
    assert_eq!(bench.control(CLOSE, &[]), Some(vec![]));
    (0..500).for_each(|number| drop(bench.print(&format!("unread {number}"))));
    bench.bus.read(DATA_IN); // packets that the class holds go out first
    bench.open();
    bench.read();
    let sent = bench.print("after it was opened");
    assert_eq!(bench.read(), sent);
}

/// The host sleeps and wakes. The device continues where it was, and counts the bytes for which it had no room.
#[test]
fn a_suspended_bus_gets_nothing_and_the_kept_lines_after_it_has_resumed() {
    let mut bench = Bench::new();
    bench.enumerate();
    bench.open();
    bench.bus.suspend_bus();
    bench.serve();
    for number in 0..1000 {
        bench.print(&format!("line {number}"));
        assert_eq!(bench.bus.read(DATA_IN), None, "nothing is sent on a suspended bus");
    }
    bench.bus.resume_bus();
    bench.serve();
    let kept = lines(&bench.read());
    assert!(kept.len() > 100 && kept[0] == "line 0", "{} lines", kept.len());
    assert_eq!(kept.len() + bench.queue.usb_dropped() as usize, 1000);
    let sent = bench.print("awake");
    assert_eq!(bench.read(), sent);
}

/// The cable is unplugged at any byte of a line and plugged in again, a hundred times. The host finds the device again, and reads whole
/// lines.
#[test]
fn the_port_works_each_time_that_it_is_plugged_in_again() {
    let mut bench = Bench::new();
    for attempt in 0..100 {
        bench.enumerate();
        bench.open();
        let sent = bench.print(&format!("plugged in {attempt} times"));
        assert_eq!(bench.read(), sent, "attempt {attempt}");
        // The host reads some packets before the cable is pulled. The device goes on, since the sensor's supply may
        // feed it.
        bench.print(&"y".repeat(attempt));
        bench.print(&"z".repeat(110));
        (0..attempt % 4).for_each(|_| drop(bench.bus.read(DATA_IN)));
        bench.serve();
        bench.bus.suspend_bus();
        bench.serve();
        bench.print("nobody is there");
    }
}

/// The controller takes no more packets although the host has the port open. After half a minute it is reset, and stays off the bus until
/// the host has noticed. Then the host finds it again, and it carries bytes.
#[test]
fn a_controller_that_hangs_is_reset() {
    let mut bench = Bench::new();
    bench.enumerate();
    bench.open();
    let reconnected = || RECONNECTED.with_borrow(Vec::clone);
    for number in 0..200 {
        bench.print(&format!("line {number}"));
    }
    bench.pass_tenths_of_a_second(299);
    assert_eq!(reconnected(), [false; 0], "a host may be slow");
    bench.pass_tenths_of_a_second(3);
    assert_eq!(reconnected(), [false]);
    bench.bus.read(DATA_IN);
    bench.pass_tenths_of_a_second(3);
    assert_eq!(bench.bus.read(DATA_IN), None, "the controller is held in reset");
    bench.pass_tenths_of_a_second(2);
    assert_eq!(reconnected(), [false, true]);
    bench.enumerate();
    bench.open();
    let sent = bench.print("found again");
    assert_eq!(bench.read(), sent);
    bench.pass_tenths_of_a_second(36_000);
    assert_eq!(reconnected(), [false, true], "nothing waits");
}

/// A port that no terminal has opened, a suspended bus and a bus without a host do not count as stalled.
#[test]
fn a_port_without_a_reader_is_left_alone() {
    let mut bench = Bench::new();
    let print_and_pass = |bench: &mut Bench| {
        bench.print(&"x".repeat(100));
        bench.print(&"y".repeat(100));
        bench.pass_tenths_of_a_second(1_000);
    };
    print_and_pass(&mut bench);
    bench.enumerate();
    print_and_pass(&mut bench);
    bench.open();
    bench.bus.suspend_bus();
    bench.serve();
    print_and_pass(&mut bench);
    assert_eq!(RECONNECTED.with_borrow(Vec::clone), [false; 0]);
}

/// The rule by which Linux's ModemManager leaves the port alone names the product.
#[test]
fn the_rule_for_udev_names_the_product() {
    let rule = include_str!("../../udev/60-adis16405-observatory.rules");
    let line = rule.lines().find(|line| !line.starts_with('#') && !line.is_empty()).expect("a rule");
    assert!(line.contains(&format!("ATTRS{{product}}==\"{PRODUCT}\"")), "{line}");
    assert!(line.contains("ENV{ID_MM_DEVICE_IGNORE}=\"1\""), "{line}");
}
