//! Differences of the boards, and requirements of their documents: crystal, pins, the 5 V of the sensor, brown-out,
//! log.

use super::bench::{TARGET, feather_image, image, run};
use super::costs::{Costs, Memory, assert_within_budget, counter};
use super::decoded::Decoded;
use super::images;
use emulation::{
    BusRecord, DBGMCU_APB1_FZ, EXTI_FTSR, EXTI_IMR, EXTI_RTSR, FEATHER, FLASH_CR, FLASH_OPTCR, FLASH_SR, H405, OSPEEDR,
    Outcome, PUPDR, SCK_HZ, SPI1_CR1, SYSCFG_EXTICR, Scenario, Sensor, Wiring, gpio,
};
use link::{BootCause, ClockSource};
use std::collections::BTreeMap;
use std::path::Path;
use system_tests::Image;

/// Asserts the registers after a run that the documents of a board and its microcontroller require.
pub(crate) fn assert_set_up(wiring: Wiring, registers: &BTreeMap<u64, u64>) {
    // MISO (PA6) and data ready are pulled down, so that an unplugged sensor gives neither bits nor edges.
    for (port, pin) in [(0, 6), wiring.data_ready] {
        assert_eq!(registers[&gpio(port, PUPDR)] >> (2 * pin) & 3, 0b10, "port {port}, pin {pin}");
    }
    // The receiver may be unconnected; a pull-up makes it idle.
    let (port, pin) = wiring.receiver;
    assert_eq!(registers[&gpio(port, PUPDR)] >> (2 * pin) & 3, 0b01, "pull of the receiver");
    // The pad of SCK (PA5) is at least of medium speed, which 42 MHz at the SPI require (ES0182, section 2.12.4).
    assert!(registers[&gpio(0, OSPEEDR)] >> 10 & 3 >= 0b01, "speed of SCK");
    // SPI mode 3: CPOL and CPHA are set.
    assert_eq!(registers[&SPI1_CR1] & 0b11, 0b11, "SPI mode");
    // The line of the data-ready pin is connected to its port, and only rising edges interrupt.
    let (port, line) = wiring.data_ready;
    let routed = registers[&SYSCFG_EXTICR[usize::from(line) / 4]] >> (4 * (line % 4)) & 0xF;
    assert_eq!(routed, port as u64, "line {line}");
    let edges = [EXTI_IMR, EXTI_RTSR, EXTI_FTSR].map(|register| registers[&register]);
    assert_eq!(edges, [1 << line, 1 << line, 0], "lines, rising and falling edges");
    assert_eq!(registers[&DBGMCU_APB1_FZ] >> 12 & 1, 1, "the watchdog stops with the debugger");
    // BOR_LEV = 11 is off, as delivered (RM0090 section 3.9.10).
    assert_eq!(registers[&FLASH_OPTCR] >> 2 & 3, 0b11, "the option bytes are not written");
}

/// The other board with this microcontroller samples and reports with its own crystal and pins. Its LED changes twice a second.
#[test]
fn the_feather_samples_with_its_crystal_and_pins() {
    let keys = vec![(0.1, b"i 0\r".to_vec()), (2.0, b"r".to_vec())];
    let sensor = Some(Sensor::Published(21));
    let Outcome { sensor, received, diagnostics, led_changes, registers, .. } =
        run(feather_image(), Scenario { wiring: FEATHER, sensor, keys, seconds: 4.0, ..Scenario::default() });
    assert_eq!(diagnostics, [""; 0]);
    assert_eq!(sensor.expect("a sensor").violations, [""; 0]);
    let decoded = Decoded::decode(&received);
    let (hello, health) = (decoded.hellos()[0], decoded.healths()[0]);
    assert_eq!((hello.boot.clock, hello.boot.cause), (ClockSource::Crystal, BootCause::PowerOn));
    // With the crystal of the other board the core would have 3/2 of its clock, and measure 2/3 of the rate.
    assert!((hello.measured_rate_hz.expect("a rate") / 204.8 - 1.0).abs() < 1e-6, "{hello:?}");
    assert_eq!((health.used, health.lost_edges), (health.bursts, 0), "{health:?}");
    assert!((7..=9).contains(&led_changes), "{led_changes} changes of the LED in 4 s");
    assert_set_up(FEATHER, &registers);
}

#[test]
fn without_a_crystal_the_image_runs_from_the_internal_oscillator_and_says_so() {
    let keys = vec![(0.1, b"i 0\r".to_vec()), (2.0, b"s".to_vec())];
    let sensor = Some(Sensor::Published(22));
    let Outcome { received, led_changes, .. } = run(
        image(),
        Scenario { crystal_fails: true, sensor, keys, seconds: 2.5, slow_core: true, ..Scenario::default() },
    );
    let lines = Decoded::decode(&received).lines;
    for expected in ["internal oscillator", "sensor sampled"] {
        assert!(lines.iter().any(|line| line.contains(expected)), "{expected}: {lines:?}");
    }
    // The LED changes eight times as often as with a crystal.
    assert!((36..=41).contains(&led_changes), "{led_changes} changes of the LED in 2.5 s");
}

/// At 102.4 SPS the sensor is in low-power mode, which needs a serial clock of at most 300 kHz.
#[test]
fn a_rate_of_low_power_mode_is_sampled_with_a_slower_serial_clock() {
    let keys = [(0.5, "i 0\rf 102.4\r"), (2.5, "r"), (3.8, "f 204.8\r"), (5.0, "r")];
    let keys = keys.map(|(at_s, keys)| (at_s, keys.as_bytes().to_vec())).to_vec();
    let sensor = Some(Sensor::Published(23));
    let Outcome { sensor, received, diagnostics, .. } =
        run(image(), Scenario { sensor, keys, seconds: 6.2, ..Scenario::default() });
    assert_eq!(diagnostics, [""; 0]);
    let decoded = Decoded::decode(&received);
    for (hello, health) in decoded.hellos().iter().zip(decoded.healths()) {
        println!("{hello:?}");
        assert_eq!((health.used, health.lost_edges), (health.bursts, 0), "{health:?}");
        assert!((hello.measured_rate_hz.expect("a rate") / hello.sample_rate_hz - 1.0).abs() < 1e-4, "{hello:?}");
    }
    let clocks: Vec<_> = decoded.hellos().iter().map(|hello| (hello.sample_rate_hz, hello.spi_clock_hz)).collect();
    assert_eq!(clocks, [(102.4, 42_000_000_u32.div_ceil(256)), (204.8, SCK_HZ)]);
    assert_eq!(sensor.expect("a sensor").violations, [""; 0]);
}

/// Asserts the bus times. Chip select stays low in a burst and is high between two frames for at least `high_us`, as with other drivers;
/// `gap_us` is the pause between the words of a burst. Single frames are sent only while the sensor is probed, with the times of low-power
/// mode, in which it may be.
pub(crate) fn assert_bus_times(sensor: &BusRecord, high_us: u64, gap_us: u64) {
    println!("chip select high for {} ns, gap of {} ns", sensor.shortest_high_ns, sensor.shortest_gap_ns);
    assert_eq!(sensor.violations, [""; 0]);
    // Frames of low-power mode begin 150 us apart (data sheet Rev. B, Table 2).
    assert!(sensor.shortest_read_ns >= 150_000, "{} ns", sensor.shortest_read_ns);
    // The resolution of the counter adds up to 2 us, and the code its own time.
    assert!((high_us * 1000..(high_us + 4) * 1000).contains(&sensor.shortest_high_ns), "{high_us} us");
    assert!((gap_us * 1000..(gap_us + 4) * 1000).contains(&sensor.shortest_gap_ns), "{gap_us} us");
}

/// The bus times are settings, which a command makes longer.
#[test]
fn the_times_on_the_bus_are_longer_on_command() {
    let keys = vec![(0.1, b"bus slow\ri 0\rf 819.2\r".to_vec()), (2.0, b"k".to_vec())];
    let sensor = Some(Sensor::Published(24));
    let Outcome { sensor, received, .. } = run(image(), Scenario { sensor, keys, seconds: 2.3, ..Scenario::default() });
    assert_bus_times(&sensor.expect("a sensor"), 100, 9);
    let lines = Decoded::decode(&received).lines;
    let counter = |name: &str| counter(&lines, name).unwrap_or(0);
    // Sampling continues while the lines are printed.
    assert!((0..9).contains(&(counter("used") - counter("bursts"))), "{lines:?}");
    assert_eq!((counter("lost_edges"), counter("bus_errors")), (0, 0), "{lines:?}");
    assert!(f64::from(counter("used")) > 1.3 * 819.2, "{lines:?}");
}

/// `cargo run` shows the log, whose texts are in the image.
#[test]
fn the_image_logs_its_start() {
    let elf = std::fs::read(image()).expect("the image");
    let contains = |text: &[u8]| elf.windows(text.len()).any(|window| window == text);
    assert!(contains(b"crash record: {=str}"), "texts below the level error are not compiled in");
}

/// `persist` programs the flash memory of the settings, and `forget` erases both of its sectors, in the times of the part. Errors are
/// cleared and the registers locked afterwards. The emulator has the registers and times of the flash interface but does not store data:
/// the device reads back that no record was kept, reports it, and continues to sample. Then data ready is measured at one of the slowest
/// rates, whose next pulse comes within a period.
#[test]
fn flash_that_takes_no_settings_and_slow_data_ready_are_waited_for() {
    let keys =
        [(0.1, "i 0\r"), (1.5, "persist\r"), (2.0, "forget\r"), (5.5, "k"), (6.0, "f 2.6\r"), (6.6, "measure\r")];
    let keys = keys.map(|(at_s, keys)| (at_s, keys.as_bytes().to_vec())).to_vec();
    let sensor = Some(Sensor::Published(28));
    let Outcome { received, diagnostics, registers, .. } =
        run(image(), Scenario { sensor, keys, seconds: 8.0, slow_core: true, ..Scenario::default() });
    let lines = Decoded::decode(&received).lines;
    println!("{lines:#?}");
    assert_eq!(diagnostics, [""; 0]);
    assert!(lines.iter().any(|line| line == "not written: the flash memory does not take them"), "{lines:?}");
    // A sector of 128 kB takes typically 1 s and at most 2 s, at 32 bits (STM32F405 data sheet, flash memory programming).
    let erased = "nothing is kept without power; not sampled for ";
    let told = lines.iter().find_map(|line| line.strip_prefix(erased)?.strip_suffix(" ms")?.parse::<u32>().ok());
    let told = told.expect("an answer to forget");
    assert!((2_000..4_000).contains(&told), "{told} ms");
    // The limit is the watchdog's time at the upper limit of its oscillator, 47 kHz instead of 32 (STM32F405 data sheet, LSI); it is fed
    // before each sector.
    assert!(f64::from(told) < 8_000.0 * 32.0 / 47.0, "{told} ms");
    // LOCK is set; PG, SER and STRT are clear (RM0090 section 3.9.8). No error flag is set (section 3.9.6).
    assert_eq!((registers[&FLASH_CR] >> 31, registers[&FLASH_CR] & 0x1_0003, registers[&FLASH_SR] & 0xF2), (1, 0, 0));
    let counter = |name: &str| counter(&lines, name).unwrap_or(0);
    assert_eq!((counter("recoveries"), counter("suspect")), (0, 0), "{lines:?}");
    // Sampling takes the rest of five and a half seconds, less the start of half a second.
    assert!(f64::from(counter("used")) > 0.7 * 204.8, "{lines:?}");
    let width = lines.iter().find_map(|line| line.strip_prefix("DRDY: high for ")?.split_once(" us")?.0.parse().ok());
    // The pulse of the emulated sensor lasts 100 us.
    assert!((90..115).contains(&width.unwrap_or(0)), "{lines:?}");
}

/// Used bytes of the stack: when a report was sent, and when an epoch was learned from.
struct DeepestStack {
    reported: u32,
    learned: u32,
}

/// Asserts flash, RAM, stack, processor and interrupts: sampling alone at 819.2 SPS, a report, then an epoch that is
/// learned from.
fn assert_board_within_budget(board: &str, image: &Path, wiring: Wiring) -> DeepestStack {
    // The sizes are from RM0090 sections 2.3.1 and 3.4.
    let memory = Memory { flash: 1 << 20, ram: 128 << 10 };
    let keys = [(0.1, "i 0\rf 819.2\re 10\r"), (6.0, "k"), (6.5, "r"), (11.0, "e 0\r")];
    let keys = keys.map(|(at_s, keys)| (at_s, keys.as_bytes().to_vec())).to_vec();
    let sensor = Some(Sensor::Published(25));
    let Outcome { received, diagnostics, .. } =
        run(image, Scenario { wiring, sensor, keys, seconds: LEARNED_S, ..Scenario::default() });
    println!("{board}: {diagnostics:?}");
    let decoded = Decoded::decode(&received);
    let awake_percent = f64::from(counter(&decoded.lines, "awake_permille").expect("the counters")) / 10.0;
    let healths = decoded.healths();
    let [reported, learned] = healths[..] else { panic!("{healths:?}") };
    assert_eq!((learned.used, learned.lost_edges), (learned.bursts, 0), "{learned:?}");
    assert_within_budget(&Costs { board, memory, image, core_mhz: 168.0, awake_percent, health: *learned });
    DeepestStack { reported: reported.stack_bytes, learned: learned.stack_bytes }
}

/// Time by which an epoch of 10 s has been learned from, s.
const LEARNED_S: f64 = 23.0;

/// A fit that needs more stack than available crashes each time that the epoch is learned from, and the crash is recorded. After the second
/// crash the epoch is not learned from, and the device samples on with its statistics.
#[test]
fn the_h405_is_within_its_budget_and_gives_up_an_epoch_whose_fit_crashes() {
    let DeepestStack { reported, learned } = assert_board_within_budget("Olimex STM32-H405", image(), H405);
    assert!(learned > reported + 1024, "{learned} B to learn, {reported} B to report");
    let shallow = images::with_stack(image(), reported.midpoint(learned) & !7);
    // Keys may come while the device starts.
    let keys = [(0.1, "i 0\re 10\r"), (11.5, "e 0\r"), (13.0, "\re 0\r"), (15.0, "\re 0\r"), (17.0, "s"), (17.1, "k")];
    let keys = keys.map(|(at_s, keys)| (at_s, keys.as_bytes().to_vec())).to_vec();
    let scenario = Scenario { sensor: Some(Sensor::Published(33)), keys, seconds: 17.4, ..Scenario::default() };
    let Outcome { sensor, received, diagnostics, .. } = run(&shallow, scenario);
    let Decoded { lines, .. } = Decoded::decode(&received);
    println!("{diagnostics:?}; {lines:#?}");
    let restarts = diagnostics.iter().filter(|diagnostic| diagnostic.starts_with("reset")).count();
    assert_eq!(restarts, 2, "{diagnostics:?}");
    for expected in [
        "start 3 by the program, 8 channels restored",
        "crash record: stack overflow",
        "sensor sampled",
        " samples, epoch 1,",
    ] {
        assert!(lines.iter().any(|line| line.contains(expected)), "{expected}: {lines:#?}");
    }
    assert!(!lines.iter().any(|line| line.starts_with("safe mode")), "{lines:#?}");
    let counter = |name: &str| counter(&lines, name).unwrap_or(0);
    // Sampling continues while the lines are printed.
    assert!((0..9).contains(&(counter("used") - counter("bursts"))) && counter("lost_edges") == 0, "{lines:#?}");
    assert!(sensor.is_some_and(|sensor| sensor.violations.is_empty()));
}

#[test]
#[ignore = "long: the same microcontroller on other boards; run with --long"]
fn the_feather_is_within_its_budget() {
    assert_board_within_budget("Feather STM32F405", feather_image(), FEATHER);
    let usb = Image::of_board("feather", TARGET, &["feather-usb"]);
    assert_board_within_budget("Feather STM32F405, USB", &usb, FEATHER);
}

/// A boot loader that jumps to the image leaves its own vector table selected. The start-up code selects that of the image, at the
/// beginning of flash, by the register at 0xE000_ED08 (ARMv7-M Architecture Reference Manual, B3.2.5). Both are constants beside the code.
#[test]
fn each_image_selects_its_vector_table() {
    let constants = [0xE000_ED08_u32, 0x0800_0000].map(u32::to_le_bytes);
    for image in [image(), feather_image()] {
        let elf = std::fs::read(image).expect("the image");
        let found = elf.windows(8).filter(|window| *window == constants.as_flattened()).count();
        assert_eq!(found, 1, "{}", image.display());
    }
}
