//! Faults of the sensor, the serial line and the processor. The device recovers from each, counts it, and reports the
//! cause of a restart.

use super::bench::{image, run};
use super::costs::counter;
use super::decoded::{Decoded, in_stretches};
use emulation::{
    Event, FLASH_OPTCR, LogLine, Outcome, Probe, RATE_HZ, SPI1_CR1, SPI1_CRCPR, SYSCFG_MEMRMP, Scenario, Sensor,
};
use link::{BootCause, Health, Message};

/// Upper bound of the duration of a report, s.
const REPORT_S: f64 = 2.5;
/// The programmed sample period: 8 ticks of 1/1638.4 s in 1/256 us.
const PERIOD: u64 = 8 * 156_250;

/// Random bytes for the serial line, from a linear congruential generator (Knuth's MMIX constants).
fn noise(count: usize) -> Vec<u8> {
    let mut state = 1_u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 56) as u8
    };
    (0..count).map(|_| next()).collect()
}

#[test]
fn faults_at_full_speed_are_recovered_from_and_counted() {
    assert_recovers_from_every_fault(819.2, 8);
}

#[test]
#[ignore = "long: the faults of the test above at a lower rate; run with --long"]
fn faults_of_the_sensor_and_the_line_are_recovered_from_and_counted() {
    assert_recovers_from_every_fault(RATE_HZ, 3);
}

fn assert_recovers_from_every_fault(rate_hz: f64, seed: u64) {
    /// Time by which the rate is set: 0.5 s after the start, which takes 50 ms.
    const CONFIGURED_S: f64 = 0.55;
    let report = |at: f64| (at, b"\rr".to_vec());
    let mut keys: Vec<(f64, Vec<u8>)> = vec![(0.5, format!("i 0\rf {rate_hz}\r").into_bytes())];
    keys.extend([1.5, 6.0, 8.5, 11.0, 12.8, 17.5].map(report));
    keys.push((19.0, noise(20_000)));
    keys.push(report(20.5));
    let events = vec![
        (3.5, Event::SensorReset),
        (7.5, Event::ChangeRegister(SPI1_CRCPR, 0x1021)),
        (8.0, Event::Stuck(Some(0x00))),
        (8.3, Event::Stuck(None)),
        (10.5, Event::Stuck(Some(0xFF))),
        (10.8, Event::Stuck(None)),
        (12.5, Event::LoseEdges(3)),
        (14.5, Event::Unplugged(true)),
        (15.7, Event::Unplugged(false)),
    ];
    let (sensor, probe) = (Some(Sensor::Published(seed)), Some(Probe::Reads));
    let scenario = Scenario { sensor, keys, events, seconds: 24.0, probe, ..Scenario::default() };
    let Outcome { sensor, received, diagnostics, log, registers, .. } = run(image(), scenario);
    assert_eq!(diagnostics, [""; 0], "neither a reset nor an access to an unmapped address");
    // The second step of recovery resets the whole SPI through RCC, since BSY may stay set if it is only disabled (ES0182, SPI). A register
    // that the firmware does not use has its reset value, and mode 3 is set again.
    assert_eq!((registers[&SPI1_CRCPR], registers[&SPI1_CR1] & 0b11), (7, 0b11), "SPI1 was reset as a whole");
    let sensor = sensor.expect("a sensor");
    let decoded = Decoded::decode(&received);
    assert_eq!(decoded.counters.missing, 0);
    let healths = decoded.healths();
    let logs = decoded.logs();
    println!("{logs:#?}");
    let [quiet, reset, low, high, lost, unplugged, .., flood] = healths[..] else { panic!("{healths:?}") };
    assert_eq!((quiet.lost_edges, quiet.suspect, quiet.recoveries), (0, 0, 0), "{quiet:?}");

    // The sensor gives no edge for at least 100 ms after its reset, and is configured before its samples are used.
    assert_eq!(reset.recoveries, 1);
    assert!(f64::from(reset.lost_edges) >= 0.1 * rate_hz, "{reset:?}");
    // A burst that the reset cuts short is refused, since its bits are shifted. The sensor then reports a frame with a wrong number of
    // clocks.
    assert!(reset.shifted <= 1 && reset.used + reset.shifted == reset.bursts, "{reset:?}");
    assert_eq!(reset.shifted, reset.diag_spi, "{reset:?}");

    // Sampling stops after 16 bursts of a stuck line, and the sensor is probed until it answers.
    assert_eq!((low.stuck_low, low.recoveries), (16, 2), "{low:?}");
    assert_eq!((high.stuck_high, high.recoveries), (16, 3), "{high:?}");
    assert!(logs.iter().any(|log| log.contains("PROD_ID answered 0 ")) && logs.iter().any(|log| log.contains("65535")));

    // Three lost edges are a gap of three samples, without further effect.
    assert_eq!((lost.lost_edges - high.lost_edges, lost.recoveries), (3, 3), "{lost:?}");

    // The sensor was unplugged for 1.2 s.
    assert_eq!(unplugged.recoveries, 4);
    assert!(f64::from(unplugged.lost_edges - lost.lost_edges) >= 1.2 * rate_hz - 1.0, "{unplugged:?}");

    // 20,000 random bytes cost no sample and change no setting. Lost bytes and invalid commands are counted.
    assert_eq!(flood.lost_edges, unplugged.lost_edges, "{flood:?}");
    assert!(flood.bad_commands > unplugged.bad_commands);
    assert_eq!(decoded.hellos().iter().filter(|hello| hello.sample_rate_hz != rate_hz).count(), 0);
    assert_eq!(flood.queue_full, 0);

    // Every sample period since the configuration is counted. A report begins with the time and ends with the counters,
    // up to 2 s later, since the random bytes also request tables.
    let health_at = decoded.messages.iter().rposition(|message| matches!(message, Message::Health(_)));
    let before = &decoded.messages[..health_at.expect("a report")];
    let hello =
        before.iter().rev().find_map(|message| if let Message::Hello(hello) = message { Some(hello) } else { None });
    let periods = (hello.expect("a report begins with its hello").uptime_us as f64 * 1e-6 - CONFIGURED_S) * rate_hz;
    let counted = f64::from(flood.bursts + flood.lost_edges + flood.suspect + flood.settling);
    assert!(
        (periods - 0.07 * rate_hz..periods + 2.0 * rate_hz).contains(&counted),
        "{counted} of {periods}: {flood:?}"
    );
    assert!(sensor.bursts.len() as u32 >= flood.bursts);
    assert_told_to_a_probe(&log, flood);
}

/// The log of a debug probe has the start, the events of the sensor and the recovery steps, with names and levels, and every event counter
/// that rises.
fn assert_told_to_a_probe(log: &[LogLine], health: &Health) {
    println!("{log:#?}");
    let mut after = log.iter();
    let expected = [
        ("info", "start by power-on, crystal true, crash record: "),
        ("info", "ADIS16405, self-test Some(passed)"),
        ("info", "sensor Sampled { since_us: "),
        ("warn", "sensor in trouble: NoEdges"),
        ("warn", "recovery step Reread"),
        ("info", "sensor Sampled"),
        ("warn", "sensor in trouble: Unusable(stuck_low)"),
        ("warn", "recovery step Reread"),
        ("warn", "recovery step BusReset"),
        ("info", "sensor Sampled"),
    ];
    for (level, text) in expected {
        assert!(after.any(|line| line.level == level && line.text.starts_with(text)), "{level} {text} in its place");
    }
    let counted = [
        ("lost_edges", health.lost_edges),
        ("stuck_low", health.stuck_low),
        ("recoveries", health.recoveries),
        ("settling", health.settling),
        ("repeated", health.repeated),
    ];
    for (name, count) in counted {
        let start = format!("{name} +");
        let last =
            log.iter().rfind(|line| line.text.starts_with(&start)).unwrap_or_else(|| panic!("no line of {name}"));
        assert!(count > 0 && last.text.ends_with(&format!(": {count}")), "{last:?}, in the report {count}");
    }
}

/// The answers to `s` and `k`, in pairs: the lines from each `s` to the next.
fn answers(lines: &[String]) -> Vec<&[String]> {
    let starts: Vec<usize> = (0..lines.len()).filter(|&index| lines[index].starts_with("up ")).collect();
    let ends = starts.iter().skip(1).copied().chain([lines.len()]);
    starts.iter().zip(ends).map(|(&start, end)| &lines[start..end]).collect()
}

/// Asserts that one of the lines has each of these texts.
fn assert_lines(lines: &[String], expected: &[&str]) {
    for text in expected {
        assert!(lines.iter().any(|line| line.contains(text)), "{text}: {lines:#?}");
    }
}

/// Asserts that the device has sampled since the restart without a loss.
fn assert_sampled_since_the_start(lines: &[String]) {
    assert_lines(lines, &["sensor sampled"]);
    let counter = |name: &str| counter(lines, name).unwrap_or(0);
    assert_eq!((counter("lost_edges"), counter("recoveries")), (0, 0), "{lines:#?}");
    // Sampling continues while the lines are printed.
    assert!((0..9).contains(&(counter("used") - counter("bursts"))), "{lines:#?}");
    let up_s: f64 = lines[0].split(' ').nth(1).expect("the time").parse().expect("seconds");
    let counted_s = f64::from(counter("bursts") + counter("settling")) / RATE_HZ;
    // The time is in whole seconds. The self-test takes 48 ms at this rate: 12 ms at 819.2 SPS (data sheet Rev. B,
    // Table 1).
    assert!((up_s - 0.11..up_s + 1.2).contains(&counted_s), "{counted_s} s of bursts, up for {up_s} s");
}

/// A reset by the pin costs at most a second of statistics, and a hard fault is recorded with its address. After a brown-out the image
/// starts with empty state: the random contents of memory are taken neither for statistics nor for settings nor for a crash record.
#[test]
fn a_restart_keeps_what_its_cause_allows() {
    let keys = [
        (0.5, "i 0\re 3600\r"),
        (6.0, "\rr"),
        (7.5, "s"),
        (7.6, "k"),
        (11.0, "\rs"),
        (11.1, "k"),
        (15.0, "\rs"),
        (15.1, "k"),
    ];
    let keys = keys.map(|(at_s, keys)| (at_s, keys.as_bytes().to_vec())).to_vec();
    let events = vec![(4.0, Event::ResetPin), (9.0, Event::BusError), (13.0, Event::BrownOut)];
    let scenario = Scenario { sensor: Some(Sensor::Published(4)), keys, events, seconds: 15.3, ..Scenario::default() };
    let Outcome { sensor, received, diagnostics, .. } = run(image(), scenario);
    assert!(diagnostics.iter().all(|diagnostic| diagnostic.starts_with("reset")), "{diagnostics:?}");
    assert_eq!(diagnostics.len(), 3, "{diagnostics:?}");
    let bursts = sensor.expect("a sensor").bursts;
    let decoded = Decoded::decode(&received);
    println!("{:#?}", decoded.lines);
    let answers = answers(&decoded.lines);
    let [pin, fault, afresh] = answers[..] else { panic!("three answers: {answers:?}") };
    answers.iter().for_each(|lines| assert_sampled_since_the_start(lines));

    assert_lines(pin, &["start 2 by the reset pin, 8 channels restored", "length 3600 s"]);
    // The statistics are those of the first stretch up to its last checkpoint, and those of the second stretch.
    let restarted = bursts.windows(2).position(|pair| pair[1].0 != pair[0].0 + 1).expect("a gap") + 1;
    let (before, after) = bursts.split_at(restarted);
    let (hello, used) = (decoded.hellos()[0], decoded.healths()[0].used as usize);
    for report in decoded.channels() {
        // The report is made channel by channel during sampling, so a channel may lack the latest samples.
        let kept = (0..used).map(|fewer| report.samples as usize - (used - fewer)).find(|&kept| {
            let stretches = [&before[..kept.min(before.len())], after];
            kept <= before.len() && in_stretches(&stretches, hello, report).octaves == report.octaves
        });
        let kept = kept.expect("the sums of two stretches");
        assert!((before.len() - kept) as f64 <= 1.2 * RATE_HZ, "{kept} of {} samples kept", before.len());
        println!("channel {}: {kept} of {} samples kept over the reset", report.channel, before.len());
    }
    assert_eq!(decoded.channels().len(), 8);

    assert_lines(
        fault,
        &["start 3 by the program, 8 channels restored", "crash record: hard fault at 0x080", "length 3600 s"],
    );
    assert_lines(afresh, &["start 1 by a brown-out, 0 channels restored", "rate 204.80 Hz", "epoch 0, ", "length 0 s"]);
    assert!([pin, afresh].iter().all(|lines| lines.iter().all(|line| !line.contains("crash record"))));
}

/// The faults come one after the other, each followed by a report. A failed DMA transfer costs only its burst: no byte of it remains for
/// the next one. A transfer whose end raises no interrupt is ended after 25 ms without a burst; after this silence the sensor is left alone
/// for its start-up time of 290 ms. A sensor in indefinite sleep is woken by the pulse of the second step of recovery, whose length is that
/// of the data sheet (Rev. B, Table 1: 20 us), or by a frame of the first. A data-ready line that oscillates at 125 kHz for 50 ms is masked
/// and reported; the next step of recovery accepts its edges again.
#[test]
fn failed_transfers_sleep_and_an_oscillating_line_are_recovered_from() {
    let reports = [2.0, 5.0, 9.5, 13.0].map(|at_s| (at_s, b"r".to_vec()));
    let keys = [vec![(0.1, b"i 0\r".to_vec())], reports.to_vec()].concat();
    let events = vec![
        (1.5, Event::StopReceiving),
        (3.5, Event::LoseBurstEnd),
        (6.5, Event::SensorSleep),
        (11.0, Event::Oscillate(50_000_000)),
    ];
    let sensor = Some(Sensor::Published(11));
    let scenario = Scenario { sensor, keys, events, seconds: 13.0 + REPORT_S, ..Scenario::default() };
    let Outcome { sensor, received, diagnostics, .. } = run(image(), scenario);
    assert_eq!(diagnostics, [""; 0], "no restart");
    let (sensor, decoded) = (sensor.expect("a sensor"), Decoded::decode(&received));
    println!("{:#?}, pulses of {:?} ns", decoded.logs(), sensor.pulses_ns);
    let healths = decoded.healths();
    let [stopped, silent, woken, masked] = healths[..] else { panic!("{healths:?}") };
    for (health, recoveries) in [(stopped, 0), (silent, 1)] {
        assert_eq!((health.bus_errors, health.recoveries), (1, recoveries), "{health:?}");
        assert_eq!((health.used, health.shifted, health.frozen), (health.bursts, 0, 0), "{health:?}");
        assert!(f64::from(health.lost_edges) < 0.4 * RATE_HZ * f64::from(recoveries) + 1.0, "{health:?}");
    }
    assert!(f64::from(stopped.used) > 1.5 * RATE_HZ, "{stopped:?}");
    assert!(f64::from(silent.used) > 3.8 * RATE_HZ, "{silent:?}");
    // The first step of recovery wakes the sensor by its first frame, and addresses it before it is awake.
    let [short, waking @ ..] = &sensor.violations[..] else { panic!("the short frame") };
    assert!(short.ends_with("chip select rose after 10 bytes"), "{short}");
    assert!(waking.iter().all(|frame| frame.ends_with("addressed while busy with WakeUp")), "{waking:?}");

    assert!(
        !sensor.pulses_ns.is_empty() && sensor.pulses_ns.iter().all(|&pulse| pulse >= 20_000),
        "{:?}",
        sensor.pulses_ns
    );
    assert_eq!((woken.recoveries, woken.sensor_resets), (2, 0), "{woken:?}");
    assert!(woken.bus_resets - silent.bus_resets <= 1, "{woken:?}");
    // This is one and a half seconds before, and at least one of the three after, since steps come once a second.
    assert!(f64::from(woken.used - silent.used) > 2.5 * RATE_HZ, "{woken:?}");

    assert!(decoded.logs().iter().any(|log| log.contains("oscillates and is masked")), "{:?}", decoded.logs());
    assert_eq!((masked.data_ready_masked, masked.recoveries, masked.queue_full), (1, 3, 0), "{masked:?}");
    assert!(f64::from(masked.used - woken.used) > 1.9 * RATE_HZ, "{masked:?}");
}

/// The microsecond counter stops, so that no wait would end.
#[test]
#[ignore = "long: eight emulated seconds of a busy loop take half a minute; run with --long"]
fn the_watchdog_ends_a_hang() {
    let (stopped_s, seconds) = (3.0, 15.0);
    let keys = vec![(0.1, b"i 0\r".to_vec()), (seconds - REPORT_S, b"\rr".to_vec())];
    let (sensor, events) = (Some(Sensor::Published(7)), vec![(stopped_s, Event::StopCounter)]);
    let Outcome { received, diagnostics, .. } =
        run(image(), Scenario { sensor, keys, events, seconds, ..Scenario::default() });
    assert_eq!(diagnostics.iter().filter(|diagnostic| diagnostic.starts_with("reset")).count(), 1, "{diagnostics:?}");
    let decoded = Decoded::decode(&received);
    let hello = decoded.hellos()[0];
    let health = decoded.healths()[0];
    assert_eq!((hello.sampling, health.used, health.lost_edges), (true, health.bursts, 0), "{health:?}");
    assert_eq!(hello.boot.cause, BootCause::Watchdog);
    assert_eq!((hello.boot.starts, hello.boot.restored_channels), (2, 8), "{:?}", hello.boot);
    assert_eq!(hello.boot.crash_record, "");
    // The watchdog's 8 s are counted by an oscillator of 32 kHz, which is exact here; a real one may be 47 % faster or
    // slower.
    let up_s = hello.uptime_us as f64 * 1e-6;
    assert!((seconds - REPORT_S - stopped_s - up_s - 8.0).abs() < 0.6, "up for {up_s} s");
}

/// A panic is recorded with its place, and is an error in the log of a probe. It is caused by a sample period of 0, which the main loop
/// detects. After the third crash within ten minutes the device starts without any stored data, reports this, and takes commands.
#[test]
fn the_third_crash_in_a_row_is_followed_by_safe_mode() {
    let keys = [(0.1, "i 0\re 3600\r"), (6.5, "s"), (6.7, "e 60\r"), (7.0, "s"), (7.1, "k")];
    let keys = keys.map(|(at_s, keys)| (at_s, keys.as_bytes().to_vec())).to_vec();
    let events = [1.5, 3.0, 4.5].map(|at_s| (at_s, Event::ClearInMemory(PERIOD))).to_vec();
    let (sensor, probe) = (Some(Sensor::Published(34)), Some(Probe::Reads));
    let scenario = Scenario { sensor, keys, events, seconds: 7.4, probe, ..Scenario::default() };
    let Outcome { received, diagnostics, log, .. } = run(image(), scenario);
    let decoded = Decoded::decode(&received);
    println!("{diagnostics:?}; {:#?} {:#?}", decoded.logs(), decoded.lines);
    assert_eq!(diagnostics.iter().filter(|diagnostic| diagnostic.starts_with("reset")).count(), 3, "{diagnostics:?}");
    assert_eq!(decoded.logs().iter().filter(|log| log.starts_with("safe mode")).count(), 1, "{:?}", decoded.logs());
    let answers = answers(&decoded.lines);
    let [safe, taking_commands] = answers[..] else { panic!("two answers: {answers:?}") };
    assert_lines(safe, &["safe mode after three crashes", "start 4 by the program, 0 channels restored", "length 0 s"]);
    assert_lines(safe, &["crash record: panic at device.rs:", ": memory is damaged: the sample period is 0"]);
    assert_lines(taking_commands, &["length 60 s"]);
    assert_sampled_since_the_start(taking_commands);
    let panics: Vec<&LogLine> = log.iter().filter(|line| line.text.starts_with("panic at ")).collect();
    assert_eq!(panics.len(), 3, "{log:#?}");
    assert!(panics.iter().all(|line| line.level == "error" && line.text.contains("device.rs:")), "{panics:?}");
}

/// The brown-out level is programmed only on command, and once. The boot loader in system memory is started after a reset, with that memory
/// at address 0. The memory is empty in the emulator, so the loaded stack pointer is 0, and the first push goes to the word below.
#[test]
fn brown_out_level_and_boot_loader_follow_their_commands() {
    let keys = [(0.1, "i 0\r"), (1.0, "brownout\r"), (1.3, "brownout\r"), (1.6, "bootsel\r")];
    let keys = keys.map(|(at_s, keys)| (at_s, keys.as_bytes().to_vec())).to_vec();
    let sensor = Some(Sensor::Published(35));
    let scenario = Scenario { sensor, keys, seconds: 2.0, slow_core: true, ..Scenario::default() };
    let Outcome { received, diagnostics, registers, .. } = run(image(), scenario);
    println!("{diagnostics:#?}");
    // BOR_LEV = 00 is level 3 (RM0090 section 3.9.10).
    assert_eq!(registers[&FLASH_OPTCR] >> 2 & 3, 0, "brown-out level");
    let decoded = Decoded::decode(&received);
    let told = |text: &str| decoded.logs().iter().filter(|log| log.starts_with(text)).count();
    assert_eq!(told("option bytes written"), 1, "{:?}", decoded.logs());
    assert!(decoded.lines.iter().any(|line| line == "brown-out: 2.7 V, as before"), "{:?}", decoded.lines);
    assert_eq!(diagnostics.iter().filter(|diagnostic| diagnostic.starts_with("reset")).count(), 1, "{diagnostics:?}");
    assert!(diagnostics.iter().any(|diagnostic| diagnostic.starts_with("unmapped at=0xfffffffc")), "{diagnostics:?}");
    assert_eq!(registers[&SYSCFG_MEMRMP] & 0b11, 0b01, "the memory at address 0");
}
