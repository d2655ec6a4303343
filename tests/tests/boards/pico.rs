//! The image for the Raspberry Pi Pico, built as for flashing, in the emulator rp2040js (npm) under Node.js with the
//! virtual sensor. Its core has no floating-point unit, and reports the same numbers.

mod bench;

use super::costs::{Costs, Memory, assert_within_budget, counter};
use super::decoded::{Decoded, on_host};
use super::epochs::{FOUND, assert_told, learned_on_device, learned_on_host};
use adis16405_driver::Burst;
use bench::{Event, Fault, Outcome, Pico, SOUND, run, run_example, run_to_measure};
use emulation::{EPOCH_S, RATE_HZ, four_effects, warming_part};
use virtual_sensor::{NoiseModel, VirtualAdis16405};

fn sensor(seed: u64) -> VirtualAdis16405 {
    VirtualAdis16405::new(NoiseModel::paper(), seed)
}

/// The bytes that the UART of a faultless board has sent, and the part.
pub(crate) fn run_sound(seed: u64, seconds: f64, keys: &[&str]) -> (Vec<(u64, u8)>, VirtualAdis16405) {
    let Outcome { received, part, .. } = run(SOUND, sensor(seed), seconds, keys, &[]);
    (received, part)
}

#[test]
#[ignore = "long: 20 emulated seconds with software floating point take half a minute; run with --long"]
fn the_pico_reports_what_the_host_computes_from_the_same_counts() {
    const SECONDS: f64 = 20.0;
    let outcome = run(SOUND, sensor(6), SECONDS, &["1.0=i 0\r", "2.0=r"], &[]);
    println!("{} instructions in {SECONDS} s; {}", outcome.instructions, outcome.diagnostics);
    let (bursts, part) = (&outcome.bursts, &outcome.part);
    // The sensor checks the times between frames and the clock.
    assert_eq!(part.violations(), []);
    assert!(bursts.windows(2).all(|pair| pair[1].0 == pair[0].0 + 1), "every sample is read once");
    // The sensor is left alone for its start-up time of 290 ms and configured 50 ms later. Its self-test takes 48 ms.
    assert!(bursts.len() as f64 > (SECONDS - 0.45) * RATE_HZ, "{} bursts", bursts.len());

    let decoded = Decoded::decode(&outcome.received);
    assert_eq!((decoded.counters.bad_frames, decoded.counters.missing), (0, 0), "{:?}", decoded.counters);
    assert!(decoded.logs()[0].starts_with("sensor: ADIS16405, self-test"), "{:?}", decoded.logs());
    let hello = decoded.hellos()[0];
    assert_eq!((hello.product_id, hello.sample_rate_hz, hello.sampling), (16405, RATE_HZ, true));
    assert!(hello.spi_clock_hz <= 1_000_000, "{hello:?}");
    assert_eq!(decoded.channels().len(), 8, "a whole report");
    for report in decoded.channels() {
        assert!(report.samples as f64 > 1.4 * RATE_HZ && report.missing == 0, "{report:?}");
        assert_eq!(*report, on_host(bursts, hello, report), "bit for bit");
    }
    let health = decoded.healths()[0];
    assert_eq!((health.used, health.lost_edges, health.queue_full), (health.bursts, 0, 0), "{health:?}");
    println!("{health:?}");
}

/// The raw stream is complete, and the device recovers from each fault and counts it.
#[test]
fn the_pico_samples_at_full_speed_and_recovers_from_faults() {
    const FAST_HZ: f64 = 819.2;
    let keys = ["0.5=i 0\rf 819.2\r", "1.0=w 1\r", "3.0=w 0\r", "8.6=k", "8.9=s"];
    let events = [
        (3.5, Event::Stuck(Some(0))),
        (3.8, Event::Stuck(None)),
        (5.5, Event::SensorReset),
        (7.5, Event::EdgesLost(true)),
        (7.6, Event::EdgesLost(false)),
    ];
    let Outcome { part, bursts, received, registers, shortest_slow_read_ns, diagnostics, .. } =
        run(SOUND, sensor(9), 9.2, &keys, &events);
    assert!(!diagnostics.contains("SCK is driven before chip select"), "{diagnostics}");
    let [control, edges, watchdog, miso, data_ready] = registers[..] else { panic!("{registers:x?}") };
    // MISO and data ready are pulled down (bit 2) and not up (bit 3), so that an unplugged sensor gives no edges (section 2.19.6.3).
    assert_eq!([miso, data_ready].map(|pad| pad >> 2 & 0b11), [0b01; 2], "{registers:x?}");
    // RP2040 data sheet: sections 4.4.4 (SPH and SPO), 2.19.6.1 (only the rising edge of GP20 among GP16 to GP23), and 4.7.6 (a debugger at
    // either core or the JTAG pauses the watchdog).
    assert_eq!(control >> 6 & 0b11, 0b11, "SPI mode 3: {control:#x}");
    assert_eq!(edges, 1 << (4 * (20 % 8) + 3), "edges that interrupt: {edges:#x}");
    assert_eq!(watchdog >> 24 & 0b111, 0b111, "the watchdog stops with the debugger: {watchdog:#x}");
    // The limit is from Table 2 of the sensor's data sheet, Rev. B.
    assert!(shortest_slow_read_ns >= 150_000, "{shortest_slow_read_ns} ns");
    let decoded = Decoded::decode(&received);
    println!("{:#?}", decoded.logs());
    assert_eq!((decoded.counters.bad_frames, decoded.counters.missing), (0, 0), "{:?}", decoded.counters);

    // The raw stream of two seconds equals what the sensor sent, in order and complete.
    let raw = decoded.raw();
    assert!(raw.len() as f64 > 1.9 * FAST_HZ, "{} bursts in the stream", raw.len());
    let sent: Vec<Burst> = bursts.iter().map(|(_, bytes)| Burst::from_bytes(bytes)).collect();
    let first = sent.windows(raw.len()).position(|window| raw.iter().map(|(_, burst)| burst).eq(window));
    let first = first.expect("the stream is part of the bursts that were sent");
    assert!(bursts[first..first + raw.len()].windows(2).all(|pair| pair[1].0 == pair[0].0 + 1), "every sample once");

    // The counters are printed as text, since a report takes seconds on this core.
    println!("{:#?}", decoded.lines);
    let counter = |name: &str| counter(&decoded.lines, name).unwrap_or(0);
    assert_eq!((counter("stuck_low"), counter("recoveries")), (16, 3));
    assert_eq!((counter("queue_full"), counter("raw_dropped"), counter("serial_overruns")), (0, 0, 0));
    // Sampling continues while the lines are printed.
    assert!((0..9).contains(&(counter("used") + 16 - counter("bursts"))), "{:?}", decoded.lines);
    assert!(f64::from(counter("used")) > 5.0 * FAST_HZ);
    assert!(decoded.lines.iter().any(|line| line.contains("sensor sampled")), "{:?}", decoded.lines);
    assert!(decoded.lines.iter().any(|line| line.starts_with("start 1 by power-on")), "{:?}", decoded.lines);
    assert_eq!(part.violations(), []);
}

/// The host finds the port by its name and the number of the board, reads a report and sends commands. The bytes of USB equal those of the
/// UART since the port was opened.
#[test]
fn usb_carries_the_report_of_the_uart() {
    let board = Pico { usb_reads_at: Some(0.0), ..SOUND };
    let keys = ["usb:0.5=i 0\r", "usb:1.5=v", "usb:2.0=r", "usb:11.0=k", "usb:11.5=bootsel\r"];
    let outcome = run(board, sensor(21), 12.0, &keys, &[]);
    println!("{}; {}", outcome.usb_device, outcome.diagnostics);
    let name = "ADIS16405 noise observatory";
    assert_eq!(outcome.usb_device, format!("2e8a:000a Noise observatory, {name}, E6605838830A1234, 250 mA"));
    let bytes = |received: &[(u64, u8)]| received.iter().map(|&(_, byte)| byte).collect::<Vec<u8>>();
    let (usb, uart) = (bytes(&outcome.received_by_usb), bytes(&outcome.received));
    let decoded = Decoded::decode(&outcome.received_by_usb);
    println!("{} bytes by USB, {} by the UART: {:#?}", usb.len(), uart.len(), decoded.lines);
    assert!(uart.ends_with(&usb), "not the bytes of the UART");
    assert_eq!((decoded.counters.bad_frames, decoded.counters.missing), (0, 0), "{:?}", decoded.counters);
    assert!(decoded.lines.iter().any(|line| line.starts_with("ADIS16405 noise observatory ")), "the answer to v");
    assert_eq!((decoded.hellos().len(), decoded.channels().len()), (1, 8), "a whole report");
    for report in decoded.channels() {
        assert_eq!(*report, on_host(&outcome.bursts, decoded.hellos()[0], report), "bit for bit");
    }
    let health = decoded.healths()[0];
    assert_eq!((health.used, health.lost_edges, health.usb_dropped), (health.bursts, 0, 0), "{health:?}");
    assert_eq!(outcome.part.violations(), []);
    let boot_loader_s = outcome.boot_loader_at.expect("bootsel starts the boot loader") as f64 * 1e-9;
    assert!((11.5..11.7).contains(&boot_loader_s), "{boot_loader_s} s");
}

/// The host opens the port and reads nothing for six seconds of the raw stream at full speed. Messages are lost on USB only, as a whole and
/// counted. Then the host reads again.
#[test]
fn an_unread_usb_port_loses_output_alone() {
    let board = Pico { usb_reads_at: Some(6.0), ..SOUND };
    let keys = ["0.5=i 0\rf 819.2\r", "1.0=w 1\r", "5.9=w 0\r", "6.2=w 1\r", "6.35=w 0\r", "7.0=k"];
    let outcome = run(board, sensor(22), 8.0, &keys, &[]);
    let (uart, usb) = (Decoded::decode(&outcome.received), Decoded::decode(&outcome.received_by_usb));
    println!("UART {:?}, USB {:?}: {:#?}", uart.counters, usb.counters, usb.lines);
    let counter = |name: &str| counter(&uart.lines, name).unwrap_or(0);
    assert_eq!((uart.counters.bad_frames, uart.counters.missing, usb.counters.bad_frames), (0, 0, 0));
    assert!(uart.raw().len() as f64 > 4.8 * 819.2, "{} bursts in the stream of the UART", uart.raw().len());
    assert!(usb.raw().len() < uart.raw().len() / 10, "{} bursts in the stream of USB", usb.raw().len());
    // Messages of the stream are dropped, and lines, which have no number. The next message shows how many messages are
    // missing.
    assert!(usb.counters.missing > 200 && u64::from(counter("usb_dropped")) >= usb.counters.missing);
    assert_eq!(
        (counter("lost_edges"), counter("queue_full"), counter("raw_dropped"), counter("recoveries")),
        (0, 0, 0, 0)
    );
    assert!((0..9).contains(&(counter("used") - counter("bursts"))), "{:?}", uart.lines);
    let answer = uart.lines.iter().position(|line| line.starts_with("bursts ")).expect("the answer to k");
    assert!(usb.lines.ends_with(&uart.lines[answer..]), "what is sent after six seconds arrives");
    assert!(outcome.longest_unfed_s < 0.5, "{} s", outcome.longest_unfed_s);
}

/// A port that accepts nothing for half a minute, as with a hanging controller, is reset. The host finds the device a second time. Sampling
/// and the UART continue.
#[test]
#[ignore = "long: half an emulated minute takes a minute; run with --long"]
fn a_usb_port_that_stalls_is_reset() {
    let board = Pico { usb_reads_at: Some(1000.0), ..SOUND };
    let outcome = run(board, sensor(26), 33.0, &["0.5=i 0\r", "0.6=w 1\r", "32.5=w 0\rk"], &[]);
    let device = "2e8a:000a Noise observatory, ADIS16405 noise observatory, E6605838830A1234, 250 mA";
    assert_eq!(outcome.usb_device, [device; 2].concat(), "{}", outcome.diagnostics);
    let uart = Decoded::decode(&outcome.received);
    let counter = |name: &str| counter(&uart.lines, name).unwrap_or(0);
    assert_eq!((uart.counters.bad_frames, uart.counters.missing), (0, 0), "{:?}", uart.counters);
    assert_eq!((counter("lost_edges"), counter("queue_full"), counter("recoveries")), (0, 0, 0), "{:?}", uart.lines);
    assert!(f64::from(counter("used")) > 31.0 * RATE_HZ, "{:?}", uart.lines);
}

/// Rate, range and filter are stored in flash by functions of the boot ROM, and found after the supply was off. The write costs a gap, but
/// no probe.
#[test]
fn settings_survive_power_in_the_flash_of_the_pico() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("flash.bin").to_str().expect("UTF-8").to_owned().leak();
    let board = Pico { settings: Some(file), ..SOUND };
    let first = run(board, sensor(23), 3.5, &["0.5=i 0\rf 102.4\rg 150\rn 3\r", "2.0=persist\r", "3.0=k"], &[]);
    let lines = Decoded::decode(&first.received).lines;
    println!("{lines:#?} {}", first.diagnostics);
    let kept = "settings and models are kept without power; not sampled for ";
    let told = lines.iter().find_map(|line| line.strip_prefix(kept)?.strip_suffix(" ms")?.parse::<u32>().ok());
    let milliseconds = told.expect("an answer to persist");
    // The write takes pages of 0.4 ms, and 45 ms for each sector that a new ring erases.
    assert!((1..500).contains(&milliseconds), "{milliseconds} ms");
    let counter = |name: &str| counter(&lines, name).unwrap_or(0);
    assert!(counter("lost_edges") <= milliseconds * 102 / 1000 + 2, "{lines:?}");
    assert_eq!((counter("recoveries"), counter("suspect")), (0, 0));

    let second = run(board, sensor(23), 2.0, &["1.5=sr"], &[]);
    let decoded = Decoded::decode(&second.received);
    let hello = decoded.hellos()[0];
    assert_eq!((hello.sample_rate_hz, hello.gyro_full_scale, hello.filter_taps_log2), (102.4, 150, 3), "{hello:?}");
    assert_eq!(hello.boot.cause, link::BootCause::PowerOn);
}

/// A board outside of `firmware` connects RST. The fourth step of the recovery resets the sensor by it, and samples flow again.
#[test]
fn the_example_board_resets_the_sensor_by_its_pin() {
    let events = [(1.5, Event::Stuck(Some(0))), (5.6, Event::Stuck(None))];
    let outcome = run_example(sensor(25), 8.5, &["0.5=i 0\r", "8.0=k"], &events);
    let lines = Decoded::decode(&outcome.received).lines;
    println!("{lines:#?}");
    let counter = |name: &str| counter(&lines, name).unwrap_or(0);
    assert!(outcome.resets >= 1 && counter("reset_lines") == outcome.resets, "{} pulses", outcome.resets);
    assert_eq!(counter("recoveries"), 1);
    // There is a second of samples before, and more than one afterwards.
    assert!(f64::from(counter("used")) > 2.2 * RATE_HZ, "{lines:?}");
}

/// The answers for a person at the bench, for the emulated part.
#[test]
fn the_bench_console_reads_registers_and_times() {
    let keys = [
        "1.0=i 0\r",
        "1.5=peek prod_id\r",
        "1.6=peek 36\r",
        "1.7=poke alm_mag1 1234\r",
        "2.0=measure\r",
        "3.0=deflect\r",
        "4.5=dump\r",
        "5.5=k",
    ];
    let outcome = run(SOUND, sensor(24), 6.0, &keys, &[]);
    let lines = Decoded::decode(&outcome.received).lines;
    println!("{lines:#?}");
    let has = |expected: &str| assert!(lines.iter().any(|line| line.starts_with(expected)), "{expected}: {lines:?}");
    // PROD_ID is the number of the part, SMPL_PRD the divisor less 1 (data sheet of the part, Rev. B).
    has("PROD_ID    0x56  0x4015  16405");
    has("SMPL_PRD   0x36  0x0007  7");
    has("ALM_MAG1   0x40  0x1234  4660");
    let number = |prefix: &str| -> f64 {
        let line = lines.iter().find(|line| line.starts_with(prefix)).expect(prefix);
        let digits = line[prefix.len()..].split_ascii_whitespace().next().expect("a number");
        digits.parse().expect("a number")
    };
    // A burst takes 208 bits at the clock that is set, and less than a tenth more.
    let (set_hz, burst_us) =
        (number("SCK: "), lines.iter().find_map(|line| line.split(" took ").nth(1)).expect("a burst"));
    let burst_us: f64 = burst_us.split(' ').next().expect("a number").parse().expect("a number");
    assert!((1.0..1.1).contains(&(burst_us * 1e-6 * set_hz / 208.0)), "{burst_us} us at {set_hz} Hz");
    // The console addresses the part as in low-power mode, whose frames are 150 us apart (Table 2 of the data sheet). After 16 bits at
    // 299,044 Hz chip select is high for 96 us.
    assert!((96.0..106.0).contains(&number("stall: CS high for ")), "{lines:?}");
    assert!((204.0..206.0).contains(&number("DRDY: ")), "{lines:?}");
    // The pulse of the emulated part is known to some us.
    assert!((90.0..115.0).contains(&number("DRDY: high for ")), "{lines:?}");
    // The deflections of the virtual part have opposite signs.
    let deflections = ["positive ", "negative "].map(|sign| {
        let line = lines.iter().find_map(|line| line.strip_prefix(sign)).expect(sign);
        line.split_ascii_whitespace().map(|count| count.parse::<i32>().expect("counts")).collect::<Vec<_>>()
    });
    assert!(deflections.iter().all(|counts| counts.len() == 6), "{deflections:?}");
    assert!(deflections[0].iter().zip(&deflections[1]).take(3).all(|(a, b)| a * b < 0), "{deflections:?}");
    assert_eq!(outcome.part.violations(), []);
    let counter = |name: &str| counter(&lines, name).unwrap_or(0);
    assert_eq!((counter("recoveries"), counter("spurious_edges")), (0, 0), "{lines:?}");
}

/// An error of the DMA costs the burst and the samples until the transfer is abandoned 25 ms later, and those in the sensor's start-up time
/// of 290 ms after this silence. Then no byte of it remains, and the channel works.
#[test]
fn a_failed_transfer_is_recovered_from() {
    let board = Pico::with_fault(1.0, Fault::Dma);
    let Outcome { received, led_changes, .. } = run(board, sensor(12), 2.6, &["0.1=i 0\r", "2.2=k"], &[]);
    let decoded = Decoded::decode(&received);
    let counter = |name: &str| counter(&decoded.lines, name).unwrap_or(0);
    println!("{:#?}", decoded.lines);
    assert_eq!((counter("bus_errors"), counter("recoveries"), counter("shifted")), (1, 1, 0));
    assert!(counter("bursts").abs_diff(counter("used")) <= 1, "{:?}", decoded.lines);
    // Samples that the sensor's filter mixes with its start are counted and not used.
    assert!(f64::from(counter("used") + counter("settling")) > 1.5 * RATE_HZ, "{:?}", decoded.lines);
    assert!((4..=6).contains(&led_changes), "{led_changes} changes of the LED in 2.6 s");
}

/// Statistics and settings survive every restart except power-on. The next start reports the cause: the text of a
/// panic, the address of a fault, nothing after a lock-up, which the watchdog ends within 8.3 s.
#[test]
fn a_restart_keeps_the_statistics_and_tells_its_cause() {
    // The panic comes before every channel has been checkpointed.
    let cases = [
        (None, "start 2 by the program, 8 channels restored", ""),
        (Some((0.25, Fault::Period)), "start 2 by the program, ", "panic at device.rs:"),
        (Some((2.5, Fault::Exception)), "start 2 by the program, 8 channels restored", "hard fault at 0x100"),
        (Some((2.5, Fault::LockUp)), "start 2 by the watchdog, 8 channels restored", ""),
    ];
    for (fault, start, record) in cases {
        let locked_s = if matches!(fault, Some((_, Fault::LockUp))) { 8.3 } else { 0.0 };
        let (status, counters) = (format!("{}=s", 4.5 + locked_s), format!("{}=k", 4.7 + locked_s));
        let keys = ["0.1=i 0\re 3600\r", if fault.is_none() { "2.5=boot\r" } else { "2.4=v" }, &status, &counters];
        let board = fault.map_or(SOUND, |(at_s, fault)| Pico::with_fault(at_s, fault));
        let Outcome { part, received, .. } = run(board, sensor(15), 5.2 + locked_s, &keys, &[]);
        let lines = Decoded::decode(&received).lines;
        println!("{fault:?}: {lines:#?}");
        assert!(lines.iter().any(|line| line.contains(start)), "{start}: {lines:?}");
        let crashed = lines.iter().find_map(|line| line.split("crash record: ").nth(1));
        assert!(crashed.unwrap_or_default().starts_with(record) && crashed.is_none() == record.is_empty(), "{lines:?}");
        // The sensor continues while the core stands still. It is sampled again for two seconds, and no sample is lost
        // since.
        let counter = |name: &str| counter(&lines, name).unwrap_or(0);
        assert!(counter("used") > (1.4 * RATE_HZ) as u32 && counter("lost_edges") == 0, "{lines:?}");
        assert_eq!(part.violations(), []);
    }
}

/// Without the crystal there is no serial port. The LED changes its level 80 times, then the next attempt follows.
#[test]
fn without_a_crystal_the_led_blinks_fast() {
    let board = Pico { crystal_starts: false, ..SOUND };
    let Outcome { received, led_changes, .. } = run(board, sensor(13), 0.4, &[], &[]);
    assert_eq!(received, []);
    assert!((30..=80).contains(&led_changes), "{led_changes} changes of the LED in 0.4 s");
}

/// A whole epoch: its report, the models of all channels, and a quarter of the stack never used. The watchdog with its
/// time of 8.3 s is also fed during the longest step.
#[test]
#[ignore = "long: 150 emulated seconds with software floating point take some minutes; run with --long"]
fn the_pico_learns_from_an_epoch() {
    assert_learns("Raspberry Pi Pico", true);
}

/// The cost of USB is the difference from the image with USB.
#[test]
#[ignore = "long: 150 emulated seconds with software floating point take some minutes; run with --long"]
fn the_pico_learns_from_an_epoch_without_usb() {
    assert_learns("Raspberry Pi Pico, no USB", false);
}

fn assert_learns(board: &str, usb: bool) {
    const SECONDS: f64 = 150.0;
    let keys = ["0.1=i 0\rf 819.2\re 10\r", "8.0=k", "11.0=e 0\r"];
    let (outcome, image) = run_to_measure(usb, sensor(14), SECONDS, &keys);
    let decoded = Decoded::decode(&outcome.received);
    println!("{:#?}", decoded.lines);
    println!("the watchdog was not fed for {:.2} s at most", outcome.longest_unfed_s);
    let learned = decoded.messages.iter().filter(|message| matches!(message, link::Message::Learned(_))).count();
    let health = **decoded.healths().last().expect("the report of an epoch");
    println!("{health:?}");
    assert_eq!((decoded.channels().len() % 8, learned % 6), (0, 0));
    assert!(learned >= 6);
    assert!(outcome.longest_unfed_s < 0.5, "{} s", outcome.longest_unfed_s);
    assert_eq!((health.used, health.lost_edges, health.queue_full), (health.bursts, 0, 0), "{health:?}");
    // The sizes are from the RP2040 data sheet, section 2.6.2; the stack is the rest of 264 KiB.
    let memory = Memory { flash: 2 << 20, ram: 200 << 10 };
    let awake_percent = f64::from(counter(&decoded.lines, "awake_permille").expect("the counters")) / 10.0;
    assert_within_budget(&Costs { board, memory, image: &image, core_mhz: 125.0, awake_percent, health });
}

/// Names, parameters and errors of four hidden effects equal those of the host for the same samples, bit for bit, as on the other boards.
/// The table states them in words.
#[test]
#[ignore = "long: five and a half emulated minutes with software floating point take a quarter of an hour; run with --long"]
fn the_pico_finds_hidden_effects() {
    // Learning from an epoch takes 110 s, and the next epoch ends after it: at 60 s, at 170 s and, with its new length, long after the end.
    const LEARNED_S: f64 = EPOCH_S + 2.0 * 120.0;
    let epoch = format!("0.5=i 0\re {EPOCH_S}\r");
    let table = format!("{LEARNED_S}=t");
    let keys = [epoch.as_str(), "200.0=e 3600\r", table.as_str()];
    let outcome = run(SOUND, warming_part(four_effects()), LEARNED_S + 30.0, &keys, &[]);
    let decoded = Decoded::decode(&outcome.received);
    let samples: Vec<u64> = decoded.channels().iter().map(|report| report.samples).collect();
    let rates: Vec<Option<f64>> = decoded.hellos().iter().map(|hello| hello.measured_rate_hz).collect();
    let expected = learned_on_host(&outcome.bursts, &samples[..16], &rates);
    assert_eq!(learned_on_device(&decoded.messages), expected, "bit for bit");
    assert_told(&decoded.lines, &FOUND);
}
