//! Full speed: 819.2 samples a second during the raw stream, reports, fits and key presses.

use super::bench::{assert_stack_suffices, image, run};
use super::decoded::{Decoded, on_host};
use adis16405_driver::{BURST_BYTES, BURST_REQUEST, Burst, GyroRange};
use emulation::{Outcome, Probe, Scenario, Sensor, Work};
use link::Message;
use noise_analysis::analysis::analyze;
use recordings::frame_log::{Frame, FrameLogWriter};
use recordings::serial::RawStreamRecorder;
use recordings::time_base::measurement;
use reports::json::ReportJson;
use simulation::replay;
use std::path::Path;

const RATE_HZ: f64 = 819.2;
/// Times between which raw stream and reports are off, so that only sampling and estimating are measured, s.
const QUIET_S: (f64, f64) = (3.0, 6.0);

/// A debug probe that has stalled or was pulled off makes the image wait for it all the time.
#[test]
fn no_sample_is_lost_or_doubled_under_full_load() {
    assert_no_sample_lost_in(31.0);
}

#[test]
#[ignore = "long: ten emulated minutes take five; run with --long"]
fn no_sample_is_lost_or_doubled_in_ten_minutes() {
    assert_no_sample_lost_in(600.0);
}

fn assert_no_sample_lost_in(seconds: f64) {
    let mut keys = vec![(1.0, b"i 0\rf 819.2\r".to_vec()), (QUIET_S.1, b"i 15\rw 1\r".to_vec())];
    // The first two commands print a fit of every channel.
    let typed =
        [&b"r"[..], b"t", b"?", b"s", b"k", b"e 0\r", b"x\r", b"v", b"k", b"s", b"i 15\r", b"k", b"?", b"s", b"k"];
    let times = (0..).map(|k| QUIET_S.1 + 1.3 + 1.2 * f64::from(k)).take_while(|&at| at < seconds - 6.0);
    keys.extend(times.zip(typed.iter().cycle()).map(|(at, keys)| (at, keys.to_vec())));
    keys.push((seconds - 3.5, b"w 0\r".to_vec()));
    keys.push((seconds - 3.0, b"r".to_vec()));
    let (sensor, probe) = (Some(Sensor::Published(2)), Some(Probe::Stalls));
    let scenario = Scenario { sensor, keys, seconds, probe, ..Scenario::default() };
    let Outcome { sensor, received, diagnostics, work, .. } = run(image(), scenario);
    let sensor = sensor.expect("the sensor on the bus");
    assert_eq!(diagnostics, [""; 0]);
    assert_eq!(sensor.violations, [""; 0]);

    // Every sample since the rate was set was read once.
    let set = sensor.bursts.windows(2).rposition(|pair| pair[1].0 != pair[0].0 + 1).expect("the rate was set") + 1;
    let bursts = &sensor.bursts[set..];
    assert!(bursts.len() as f64 > (seconds - 1.1) * RATE_HZ - 100.0, "{} bursts", bursts.len());
    assert!(sensor.samples - bursts[bursts.len() - 1].0 <= 1);

    // The raw stream equals what the sensor sent, in order and complete.
    let decoded = Decoded::decode(&received);
    assert_eq!((decoded.counters.missing, decoded.counters.bad_frames), (0, 0), "{:?}", decoded.counters);
    let raw = decoded.raw();
    assert!(raw.len() as f64 > (seconds - QUIET_S.1 - 3.6) * RATE_HZ, "{} bursts in the stream", raw.len());
    let sent: Vec<Burst> = bursts.iter().map(|(_, bytes)| Burst::from_bytes(bytes)).collect();
    let first = raw[0].0 as usize;
    for (k, (number, burst)) in raw.iter().enumerate() {
        assert_eq!(*number as usize, first + k, "numbers without a gap");
        assert_eq!(*burst, sent[first + k], "burst {k}");
    }

    // In the last report no sample is lost, and it equals the host's bit for bit.
    let health = **decoded.healths().last().expect("a report");
    assert_eq!((health.used, health.lost_edges + health.spurious_edges + health.queue_full), (health.bursts, 0));
    assert_eq!((health.recoveries, health.raw_dropped, health.serial_overruns), (0, 0, 0), "{health:?}");
    let (channels, hellos) = (decoded.channels(), decoded.hellos());
    let hello = hellos.last().expect("a report");
    for report in &channels[channels.len() - 8..] {
        assert_eq!(report.missing, 0);
        assert_eq!(**report, on_host(bursts, hello, report), "bit for bit");
    }
    let measured = decoded.hellos().last().and_then(|hello| hello.measured_rate_hz).expect("a rate");
    assert!((measured / RATE_HZ - 1.0).abs() < 1e-6, "{measured} Hz");
    assert!(decoded.lines.iter().any(|line| line.starts_with("Allan deviation")));

    assert_recorded_stream_gives_the_identical_report(&decoded, &bursts[first..]);

    let quiet = load_between(&work, QUIET_S);
    let busy = load_between(&work, (QUIET_S.1 + 1.0, seconds - 4.0));
    println!("{seconds} s at {RATE_HZ} SPS, {} bursts read, {} in the raw stream", bursts.len(), raw.len());
    println!("sampling and estimating: {} instructions per sample, {:.2} % of 168 MHz", quiet.0, quiet.1);
    println!("with raw stream, reports and keys: {} instructions per sample, {:.2} %", busy.0, busy.1);
    println!(
        "longest sampling interrupt {} instructions, longest of the estimators {}",
        health.sampling_cycles, health.estimator_cycles
    );
    println!(
        "stack {} of {} B, at most {} bursts in the queue",
        health.stack_bytes, health.stack_size, health.queue_peak
    );
    assert_stack_suffices(&health);
    assert!(quiet.1 < 5.0, "more than 5 % of the processor");
    assert!(health.sampling_cycles < 168 * 20, "a sampling interrupt of more than 20 us");
}

/// Instructions per sample, and the percentage of 168 million instructions a second, between two times in s.
fn load_between(work: &[Work], (from, to): (f64, f64)) -> (u64, f64) {
    let at = |seconds: f64| work.iter().find(|work| work.at as f64 >= seconds * 1e9).expect("a time of the run");
    let (from, to) = (at(from), at(to));
    let instructions = to.instructions - from.instructions;
    let share = 100.0 * instructions as f64 / (168e6 * (to.at - from.at) as f64 * 1e-9);
    (instructions / (to.samples - from.samples), share)
}

/// The file that `imunoise record` writes from the serial bytes, and a log of the sensor's frames with times of the
/// board's own clock, give the same report.
fn assert_recorded_stream_gives_the_identical_report(decoded: &Decoded, bursts: &[(u64, [u8; BURST_BYTES])]) {
    let folder = tempfile::tempdir().expect("a folder");
    let report = |file: &Path| {
        let recording = replay(file, GyroRange::Dps300).expect("a log").recording;
        let measurement = measurement(&recording, Some(RATE_HZ)).expect("a time base");
        serde_json::to_string(&ReportJson::new(&analyze(&measurement), None)).expect("a report")
    };
    let recorded_file = folder.path().join("recorded.csv");
    let mut tape = RawStreamRecorder::create(&recorded_file).expect("a log");
    for message in &decoded.messages {
        if let Message::Raw(raw) = message {
            tape.write(raw).expect("room");
        }
    }
    assert_eq!(tape.missing(), 0);
    let recorded = decoded.raw().len();
    tape.finish().expect("room");
    let sensor_log = folder.path().join("sensor.csv");
    let mut log = FrameLogWriter::create(&sensor_log).expect("a log");
    for (sample, bytes) in &bursts[..recorded] {
        let frame = Frame { time_s: *sample as f64 / RATE_HZ, mosi: BURST_REQUEST.to_vec(), miso: bytes.to_vec() };
        log.write(&frame).expect("room");
    }
    log.finish().expect("room");
    assert_eq!(report(&recorded_file), report(&sensor_log));
}
