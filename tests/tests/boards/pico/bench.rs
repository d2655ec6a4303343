//! Runs the image in rp2040js under Node.js, with the virtual sensor on its bus, in the emulator's time.

use super::super::images;
use adis16405_driver::BURST_BYTES;
use image_file::uf2;
use std::collections::VecDeque;
use std::io::{Read, Write};
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::OnceLock;
use system_tests::{Image, image_folder, workspace};
use virtual_sensor::VirtualAdis16405;

/// Paths of rp2040js and of the image, as ELF and as UF2.
struct Bench {
    emulator: PathBuf,
    elf: PathBuf,
    uf2: PathBuf,
}

const TARGET: &str = "thumbv6m-none-eabi";
/// Pause longer than the stall of the sensor in either power mode (data sheet Rev. B, Table 2), ns.
const REST_NS: u64 = 100_000;

impl Bench {
    fn new(elf: PathBuf) -> Self {
        let blocks = uf2::from_elf(&std::fs::read(&elf).expect("the image")).expect("an image for the Pico");
        let uf2 = elf.with_extension("uf2");
        std::fs::write(&uf2, blocks).expect("room");
        Self { emulator: emulator(), elf, uf2 }
    }
}

/// The image, built at most once per run; `OBSERVATORY_PICO_IMAGE` names another one.
fn bench() -> &'static Bench {
    static BENCH: OnceLock<Bench> = OnceLock::new();
    BENCH.get_or_init(|| {
        let build = || Image::of_board("pico", TARGET, &[]);
        Bench::new(std::env::var_os("OBSERVATORY_PICO_IMAGE").map_or_else(build, PathBuf::from))
    })
}

/// The image of the example board outside of `firmware`.
fn example_bench() -> Bench {
    Bench::new(images::build_package(
        ("example-board", "example-board"),
        TARGET,
        &["--features", "image"],
        "example-board",
    ))
}

/// The image without its serial port on USB.
fn bench_without_usb() -> Bench {
    let arguments = ["--no-default-features", "--features", "board-pico"];
    Bench::new(images::build_package(("firmware", "observatory-pico"), TARGET, &arguments, "observatory-pico-uart"))
}

/// The folder with rp2040js. The first of several simultaneous tests installs it.
fn emulator() -> PathBuf {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    let install = || {
        let folder = image_folder().join("rp2040js");
        // An installation writes this file last.
        if !folder.join("node_modules/.package-lock.json").is_file() {
            std::fs::create_dir_all(&folder).expect("a folder");
            let install = Command::new("npm")
                .args(["install", "--no-save", "--no-audit", "--no-fund", "--prefix"])
                .arg(&folder)
                .arg("rp2040js@1.4.1")
                .status();
            assert!(
                install.is_ok_and(|status| status.success()),
                "rp2040js cannot be installed: it needs Node.js 18 or later with npm"
            );
        }
        folder
    };
    FOLDER.get_or_init(install).clone()
}

/// An event that happens to the sensor during a run.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Event {
    /// The sensor resets itself, as after a dip of its supply.
    SensorReset,
    /// The data line to the processor is held at this byte, or released.
    Stuck(Option<u8>),
    /// True while data-ready edges do not reach the processor.
    EdgesLost(bool),
}

/// The results of a run.
pub(crate) struct Outcome {
    pub(crate) part: VirtualAdis16405,
    /// The bytes sent to the processor in each burst, with the number of the part's latest sample at that time.
    pub(crate) bursts: Vec<(u64, [u8; BURST_BYTES])>,
    /// Bytes from the UART, each with its time in ns.
    pub(crate) received: Vec<(u64, u8)>,
    /// Bytes from the USB port, each with its time in ns.
    pub(crate) received_by_usb: Vec<(u64, u8)>,
    /// The USB descriptors: vendor and product, their names, the serial number, the current.
    pub(crate) usb_device: String,
    /// Number of pulses on the sensor's RST line.
    pub(crate) resets: u32,
    /// Time at which the program started the boot loader, in ns.
    pub(crate) boot_loader_at: Option<u64>,
    pub(crate) instructions: u64,
    /// Number of changes of the LED's level.
    pub(crate) led_changes: u64,
    /// Longest time for which the watchdog was not fed, in s.
    pub(crate) longest_unfed_s: f64,
    /// Final values of SSPCR0 of SPI0, PROC0_INTE2 of the pins, CTRL of the watchdog, and the pads of GP16 and GP20.
    pub(crate) registers: Vec<u32>,
    /// Shortest time from one falling edge of chip select to the next while SCK was at most 300 kHz, in ns.
    pub(crate) shortest_slow_read_ns: u64,
    /// Warnings and errors of the emulator, one per line.
    pub(crate) diagnostics: String,
}

/// The board: its crystal starts or not, and it may have one fault at a time in s.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pico {
    pub(crate) crystal_starts: bool,
    pub(crate) fault: Option<(f64, Fault)>,
    /// Time from which a USB host reads the port, in s; `None` without a host.
    pub(crate) usb_reads_at: Option<f64>,
    /// The file with the flash memory for the settings.
    pub(crate) settings: Option<&'static str>,
}

/// A fault of the microcontroller, by its name in `emulator.mjs`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Fault {
    /// The DMA channel that receives a burst stops with an error.
    Dma,
    /// The programmed sample period becomes 0.
    Period,
    /// The exception HardFault is raised.
    Exception,
    /// The core stops executing, as after a fault within the fault handler.
    LockUp,
}

/// A board without a fault and without a USB host.
pub(crate) const SOUND: Pico = Pico { crystal_starts: true, fault: None, usb_reads_at: None, settings: None };

impl Pico {
    /// A board with one fault, at a time in s.
    pub(crate) fn with_fault(at_s: f64, fault: Fault) -> Self {
        Self { fault: Some((at_s, fault)), ..SOUND }
    }

    /// The arguments of the emulator.
    fn arguments(self) -> [String; 5] {
        let crystal = if self.crystal_starts { "ok" } else { "dead" };
        let (at_s, fault) = self.fault.map_or(("0".to_owned(), "none".to_owned()), |(at_s, fault)| {
            (at_s.to_string(), format!("{fault:?}").to_lowercase())
        });
        let usb = self.usb_reads_at.map_or_else(|| "none".to_owned(), |at_s| at_s.to_string());
        [crystal.to_owned(), fault, at_s, usb, self.settings.unwrap_or("none").to_owned()]
    }
}

/// Boots the image from its UF2 and runs it. A key is `TIME=TEXT`, or `usb:TIME=TEXT` for the USB port; `events` are in order of time.
/// Times are in s.
pub(crate) fn run(
    board: Pico,
    part: VirtualAdis16405,
    seconds: f64,
    keys: &[&str],
    events: &[(f64, Event)],
) -> Outcome {
    run_image(bench(), board, part, seconds, keys, events)
}

/// Runs the image of the example board as [`run`] does.
pub(crate) fn run_example(part: VirtualAdis16405, seconds: f64, keys: &[&str], events: &[(f64, Event)]) -> Outcome {
    run_image(&example_bench(), SOUND, part, seconds, keys, events)
}

/// The result of [`run`] with the path of the image, which has its port on USB and a host that reads, or has none.
pub(crate) fn run_to_measure(usb: bool, part: VirtualAdis16405, seconds: f64, keys: &[&str]) -> (Outcome, PathBuf) {
    let uart_alone;
    let (bench, board) = if usb {
        (bench(), Pico { usb_reads_at: Some(0.0), ..SOUND })
    } else {
        uart_alone = bench_without_usb();
        (&uart_alone, SOUND)
    };
    (run_image(bench, board, part, seconds, keys, &[]), bench.elf.clone())
}

fn run_image(
    Bench { emulator, elf, uf2 }: &Bench,
    board: Pico,
    mut part: VirtualAdis16405,
    seconds: f64,
    keys: &[&str],
    events: &[(f64, Event)],
) -> Outcome {
    let mut events: VecDeque<(u64, Event)> = events.iter().map(|&(at, event)| ((at * 1e9) as u64, event)).collect();
    let (mut stuck_at, mut edges_lost) = (None, false);
    let (mut announced, mut selected) = (0, false);
    let mut node = Command::new("node")
        .arg(workspace().join("tests/tests/boards/pico/emulator.mjs"))
        .args([emulator, uf2, elf])
        .arg(seconds.to_string())
        .args(board.arguments())
        .args(keys)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("Node.js 18 or later starts");
    let (mut answers, mut questions) = (node.stdin.take().expect("a pipe"), node.stdout.take().expect("a pipe"));
    let (mut bursts, mut received, mut frame) = (Vec::new(), Vec::new(), Vec::new());
    let (mut received_by_usb, mut usb_device, mut boot_loader_at) = (Vec::new(), String::new(), None);
    let mut resets = 0;
    let (mut instructions, mut led_changes, mut longest_unfed_s) = (0, 0, 0.0);
    let (mut registers, mut sck_hz, mut selected_at, mut shortest_slow_read_ns) = (Vec::new(), 0.0, 0, u64::MAX);
    let (mut deselected_at, mut question) = (0, [0; 9]);
    while questions.read_exact(&mut question).is_ok() {
        let [kind, value @ ..] = question;
        let value = f64::from_le_bytes(value);
        let mut byte = [0];
        if matches!(kind, b'b' | b'u' | b'v' | b'x') {
            questions.read_exact(&mut byte).expect("a byte");
        }
        match kind {
            b'e' => instructions = value as u64,
            b'l' => led_changes = value as u64,
            b'w' => longest_unfed_s = value * 1e-9,
            b'r' => registers.push(value as u32),
            b'o' => boot_loader_at = Some(value as u64),
            b'x' => usb_device.push(char::from(byte[0])),
            b'v' => received_by_usb.push((value as u64, byte[0])),
            b'c' => {
                sck_hz = value;
                part.set_sck_hz(Some(value as u32));
            }
            _ => {}
        }
        if matches!(kind, b'c' | b'e' | b'l' | b'o' | b'r' | b'v' | b'w' | b'x') {
            continue;
        }
        part.advance_to(value as u64);
        // An event waits for a rest of the bus, since the sensor's event is a frame too: no recent frame, and no sample now or soon. The
        // emulator sends `n` at least once a millisecond.
        let has_rest = !selected
            && value as u64 >= deselected_at + REST_NS
            && part.next_data_ready() >= value as u64 + REST_NS
            && (edges_lost || announced == part.samples());
        if kind == b'n'
            && has_rest
            && let Some((_, event)) = events.pop_front_if(|&mut (at, _)| value as u64 >= at)
        {
            match event {
                Event::SensorReset => {
                    part.select();
                    part.transfer(0xBE80); // GLOB_CMD bit 7
                    part.deselect();
                }
                Event::Stuck(byte) => stuck_at = byte,
                Event::EdgesLost(lost) => edges_lost = lost,
            }
        }
        match kind {
            b's' => {
                selected = true;
                let before = std::mem::replace(&mut selected_at, value as u64);
                if sck_hz <= 300_000.0 && before > 0 {
                    shortest_slow_read_ns = shortest_slow_read_ns.min(selected_at - before);
                }
                part.select();
                frame.clear(); // a restart may have cut the one before
            }
            b'z' => part.power_off(),
            b'Z' => {
                part.power_on();
                resets += 1;
            }
            b'd' => {
                (selected, deselected_at) = (false, value as u64);
                part.deselect();
                let requested = frame.first().is_some_and(|&(mosi, _)| mosi == 0x3E);
                let sent: Vec<u8> = frame.drain(..).map(|(_, miso)| miso).collect();
                if requested && let Ok(burst) = sent.try_into() {
                    bursts.push((part.samples(), burst));
                }
            }
            b'b' => {
                let answer = part.transfer_byte(byte[0]);
                let miso = stuck_at.unwrap_or(answer);
                frame.push((byte[0], miso));
                answers.write_all(&[miso]).expect("the emulator reads");
            }
            b'n' => {
                let next = part.next_data_ready() as f64;
                announced = if edges_lost { announced } else { part.samples() };
                let answer = [(announced as f64).to_le_bytes(), next.to_le_bytes()];
                answers.write_all(answer.as_flattened()).expect("the emulator reads");
            }
            _ => received.push((value as u64, byte[0])),
        }
    }
    let output = node.wait_with_output().expect("the emulator ends");
    let diagnostics = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{diagnostics}");
    Outcome {
        part,
        bursts,
        received,
        received_by_usb,
        usb_device,
        resets,
        boot_loader_at,
        instructions,
        led_changes,
        longest_unfed_s,
        registers,
        shortest_slow_read_ns,
        diagnostics,
    }
}
