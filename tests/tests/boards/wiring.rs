//! What the boards differ in, and what their documents demand: crystal, pins, the 5 V of the sensor, brown-out, log.

use super::bench::{TARGET, feather_image, image, run};
use super::costs::{Costs, Memory, assert_within_budget, counter};
use super::decoded::Decoded;
use super::images;
use emulation::{
    DBGMCU_APB1_FZ, EXTI_FTSR, EXTI_IMR, EXTI_RTSR, FEATHER, FLASH_CR, FLASH_OPTCR, FLASH_SR, H405, Outcome, PUPDR,
    SPI1_CR1, SYSCFG_EXTICR, Scenario, Sensor, Wiring, gpio,
};
use link::{BootCause, ClockSource};
use std::path::Path;

/// Both boards boot, sample and report with their own crystal and pins. The LED changes its level twice a second.
#[test]
fn each_board_samples_with_its_crystal_and_pins() {
    for (name, image, wiring) in [("H405", image(), H405), ("Feather", feather_image(), FEATHER)] {
        let keys = vec![(0.1, b"i 0\r".to_vec()), (3.0, b"r".to_vec())];
        let sensor = Some(Sensor::Published(21));
        let Outcome { sensor, received, diagnostics, led_changes, registers, .. } =
            run(image, Scenario { wiring, sensor, keys, seconds: 5.0, ..Scenario::default() });
        assert_eq!(diagnostics, [""; 0], "{name}");
        assert_eq!(sensor.expect("a sensor").violations, [""; 0], "{name}");
        let decoded = Decoded::decode(&received);
        let (hello, health) = (decoded.hellos()[0], decoded.healths()[0]);
        assert_eq!((hello.boot.clock, hello.boot.cause), (ClockSource::Crystal, BootCause::PowerOn), "{name}");
        // A core at 3/2 of its clock, as with the crystal of the other board, would measure 2/3 of the rate.
        assert!((hello.measured_rate_hz.expect("a rate") / 204.8 - 1.0).abs() < 1e-6, "{name}: {hello:?}");
        assert_eq!((health.used, health.lost_edges), (health.bursts, 0), "{name}: {health:?}");
        assert!((9..=11).contains(&led_changes), "{name}: {led_changes} changes of the LED in 5 s");

        // MISO (PA6) and data ready have no pull.
        for (port, pin) in [(0, 6), wiring.data_ready] {
            assert_eq!(registers[&gpio(port, PUPDR)] >> (2 * pin) & 3, 0, "{name}: port {port}, pin {pin}");
        }
        // SPI mode 3: CPOL and CPHA are set.
        assert_eq!(registers[&SPI1_CR1] & 0b11, 0b11, "{name}: SPI mode");
        // The line of the data-ready pin is connected to its port, and interrupts at rising edges alone.
        let (port, line) = wiring.data_ready;
        let routed = registers[&SYSCFG_EXTICR[usize::from(line) / 4]] >> (4 * (line % 4)) & 0xF;
        assert_eq!(routed, port as u64, "{name}: line {line}");
        let edges = [EXTI_IMR, EXTI_RTSR, EXTI_FTSR].map(|register| registers[&register]);
        assert_eq!(edges, [1 << line, 1 << line, 0], "{name}: lines, rising and falling edges");
        assert_eq!(registers[&DBGMCU_APB1_FZ] >> 12 & 1, 1, "{name}: the watchdog stops with the debugger");
        // BOR_LEV = 11: off, as delivered (RM0090 section 3.9.10).
        assert_eq!(registers[&FLASH_OPTCR] >> 2 & 3, 0b11, "{name}: the option bytes are not written");
    }
}

/// On the command alone, and once.
#[test]
fn the_brown_out_level_is_programmed_on_command() {
    let keys = vec![(0.1, b"i 0\r".to_vec()), (1.0, b"brownout\r".to_vec()), (1.5, b"brownout\r".to_vec())];
    let sensor = Some(Sensor::Published(27));
    let Outcome { received, diagnostics, registers, .. } =
        run(image(), Scenario { sensor, keys, seconds: 2.0, ..Scenario::default() });
    assert_eq!(diagnostics, [""; 0]);
    // BOR_LEV = 00: level 3 (RM0090 section 3.9.10).
    assert_eq!(registers[&FLASH_OPTCR] >> 2 & 3, 0, "brown-out level");
    let decoded = Decoded::decode(&received);
    let told = |text: &str| decoded.logs().iter().filter(|log| log.starts_with(text)).count();
    assert_eq!(told("option bytes written"), 1, "{:?}", decoded.logs());
    assert!(decoded.lines.iter().any(|line| line == "brown-out: 2.7 V, as before"), "{:?}", decoded.lines);
}

#[test]
fn without_a_crystal_the_image_runs_from_the_internal_oscillator_and_says_so() {
    let keys = vec![(0.1, b"i 0\r".to_vec()), (2.0, b"r".to_vec()), (4.0, b"s".to_vec())];
    let sensor = Some(Sensor::Published(22));
    let Outcome { received, led_changes, .. } =
        run(image(), Scenario { crystal_fails: true, sensor, keys, seconds: 4.5, ..Scenario::default() });
    let decoded = Decoded::decode(&received);
    let hello = decoded.hellos()[0];
    assert_eq!((hello.boot.clock, hello.sampling), (ClockSource::Internal, true), "{hello:?}");
    assert!(decoded.lines.iter().any(|line| line.contains("internal oscillator")), "{:?}", decoded.lines);
    // Eight times as often as with a crystal.
    assert!((66..=73).contains(&led_changes), "{led_changes} changes of the LED in 4.5 s");
}

/// At 102.4 SPS the sensor is in low-power mode, which takes a serial clock of 300 kHz at most.
#[test]
fn a_rate_of_low_power_mode_is_sampled_with_a_slower_serial_clock() {
    let keys = vec![(0.5, b"i 0\rf 102.4\r".to_vec()), (3.0, b"r".to_vec()), (5.5, b"f 204.8\r".to_vec())];
    let keys = keys.into_iter().chain([(7.0, b"r".to_vec())]).collect();
    let sensor = Some(Sensor::Published(23));
    let Outcome { sensor, received, diagnostics, .. } =
        run(image(), Scenario { sensor, keys, seconds: 9.0, ..Scenario::default() });
    assert_eq!(diagnostics, [""; 0]);
    let decoded = Decoded::decode(&received);
    for (hello, health) in decoded.hellos().iter().zip(decoded.healths()) {
        println!("{hello:?}");
        assert_eq!((health.used, health.lost_edges), (health.bursts, 0), "{health:?}");
        assert!((hello.measured_rate_hz.expect("a rate") / hello.sample_rate_hz - 1.0).abs() < 1e-4, "{hello:?}");
    }
    let clocks: Vec<_> = decoded.hellos().iter().map(|hello| (hello.sample_rate_hz, hello.spi_clock_hz)).collect();
    assert_eq!(clocks, [(102.4, 42_000_000_u32.div_ceil(256)), (204.8, 656_250)]);
    assert_eq!(sensor.expect("a sensor").violations, [""; 0]);
}

/// As other drivers do, the board raises chip select between frames and keeps the stall then; in a burst it stays low. The
/// times are settings, which the command `careful` makes longer. Single frames are sent only while the sensor is probed,
/// with the times of low-power mode, in which it may still be.
#[test]
fn chip_select_is_high_for_the_stall_and_words_are_apart_as_set() {
    for (command, high_us, gap_us) in [("", 75, 0), ("careful 1\r", 100, 9)] {
        let keys = vec![(0.1, format!("{command}i 0\rf 819.2\r").into_bytes()), (2.0, b"r".to_vec())];
        let sensor = Some(Sensor::Published(24));
        let Outcome { sensor, received, .. } =
            run(image(), Scenario { sensor, keys, seconds: 4.0, ..Scenario::default() });
        let sensor = sensor.expect("a sensor");
        assert_eq!(sensor.violations, [""; 0]);
        println!("chip select high for {} ns, gap of {} ns", sensor.shortest_high_ns, sensor.shortest_gap_ns);
        // Data sheet Rev. B, Table 2: frames of low-power mode begin 150 us apart.
        assert!(sensor.shortest_read_ns >= 150_000, "{} ns", sensor.shortest_read_ns);
        // Up to 2 us more by the resolution of the counter, and the time of the code between.
        assert!((high_us * 1000..(high_us + 4) * 1000).contains(&sensor.shortest_high_ns), "{high_us} us");
        assert!((gap_us * 1000..(gap_us + 4) * 1000).contains(&sensor.shortest_gap_ns), "{gap_us} us");
        let health = **Decoded::decode(&received).healths().last().expect("a report");
        assert_eq!((health.used, health.lost_edges, health.bus_errors), (health.bursts, 0, 0), "{health:?}");
        assert!(f64::from(health.used) > 1.7 * 819.2, "{health:?}");
    }
}

/// `cargo run` shows the log: its texts are in the image.
#[test]
fn the_image_logs_its_start() {
    let elf = std::fs::read(image()).expect("the image");
    let contains = |text: &[u8]| elf.windows(text.len()).any(|window| window == text);
    assert!(contains(b"crash record: {=str}"), "texts below the level error are not compiled in");
}

/// The flash memory of the settings is programmed on `persist`, and both of its sectors are erased on `forget`, for the times of the part;
/// errors are cleared and the registers locked afterwards. The emulator has the registers and times of the flash interface and drops
/// what is stored in the array: the device reads back that nothing was kept, says so, and samples on.
#[test]
fn settings_that_the_flash_does_not_take_are_not_called_kept() {
    let keys = vec![(0.1, b"i 0\r".to_vec()), (1.5, b"persist\r".to_vec()), (2.5, b"forget\r".to_vec())];
    let keys = keys.into_iter().chain([(8.0, b"k".to_vec())]).collect();
    let sensor = Some(Sensor::Published(28));
    let Outcome { received, diagnostics, registers, .. } =
        run(image(), Scenario { sensor, keys, seconds: 8.5, ..Scenario::default() });
    let lines = Decoded::decode(&received).lines;
    println!("{lines:#?}");
    assert_eq!(diagnostics, [""; 0]);
    assert!(lines.iter().any(|line| line == "not written: the flash memory does not take them"), "{lines:?}");
    // A sector of 128 kB takes 1 s typically and 2 s at most, 32 bits at once (STM32F405 data sheet, flash memory programming).
    let erased = "nothing is kept without power; not sampled for ";
    let told = lines.iter().find_map(|line| line.strip_prefix(erased)?.strip_suffix(" ms")?.parse::<u32>().ok());
    assert!((2_000..4_000).contains(&told.expect("an answer to forget")), "{told:?} ms");
    // LOCK is set; PG, SER and STRT are clear (RM0090 section 3.9.8). No error flag stands (section 3.9.6).
    assert_eq!((registers[&FLASH_CR] >> 31, registers[&FLASH_CR] & 0x1_0003, registers[&FLASH_SR] & 0xF2), (1, 0, 0));
    let counter = |name: &str| counter(&lines, name).unwrap_or(0);
    assert_eq!((counter("recoveries"), counter("suspect")), (0, 0), "{lines:?}");
    // The rest of eight seconds, less the start of half a second.
    assert!(f64::from(counter("used")) > 3.2 * 204.8, "{lines:?}");
}

/// Sampling alone at 819.2 SPS, then an epoch that is learned from: flash, RAM, stack, processor, interrupts.
fn assert_board_within_budget(board: &str, image: &Path, wiring: Wiring) {
    // RM0090 sections 2.3.1 and 3.4.
    let memory = Memory { flash: 1 << 20, ram: 128 << 10 };
    let keys = vec![(0.1, b"i 0\rf 819.2\re 10\r".to_vec()), (8.0, b"k".to_vec()), (11.0, b"e 0\r".to_vec())];
    let sensor = Some(Sensor::Published(25));
    let Outcome { received, diagnostics, .. } =
        run(image, Scenario { wiring, sensor, keys, seconds: 35.0, ..Scenario::default() });
    println!("{board}: {diagnostics:?}");
    let decoded = Decoded::decode(&received);
    let awake_percent = f64::from(counter(&decoded.lines, "awake_permille").expect("the counters")) / 10.0;
    let health = **decoded.healths().last().expect("the report of the epoch");
    assert_eq!((health.used, health.lost_edges), (health.bursts, 0), "{health:?}");
    assert_within_budget(&Costs { board, memory, image, core_mhz: 168.0, awake_percent, health });
}

#[test]
fn the_h405_is_within_its_budget() {
    assert_board_within_budget("Olimex STM32-H405", image(), H405);
}

#[test]
#[ignore = "long: the same microcontroller on other boards; run with --long"]
fn the_feather_is_within_its_budget() {
    assert_board_within_budget("Feather STM32F405", feather_image(), FEATHER);
    let usb = images::build("feather", TARGET, &["feather-usb"]);
    assert_board_within_budget("Feather STM32F405, USB", &usb, FEATHER);
}
