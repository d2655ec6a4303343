//! The image that one flashes, run in an emulator against the virtual sensor.

mod bench;
mod build;
mod compensation;
mod crash;
mod decoded;
mod exti;
mod faults;
mod full_speed;
mod memory;
mod overflow;
mod restart;
mod sensor;
mod size;
mod terminal;

use bench::{Outcome, Scenario, run};
use decoded::{Decoded, on_host};
use firmware::CHANNELS;
use link::{Boot, BootCause, DecoderCounters, Health, Hello, Message};
use sensor::Sensor;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use virtual_sensor::{NoiseModel, VirtualAdis16405};

/// The bus clock of the board (84 MHz) over the first power of two that brings it to 1 MHz or less.
const SCK_HZ: u32 = 84_000_000 / 128;

/// What interrupts may add to the deepest stack that was seen, if none came then: four, one above the other, each with the
/// 104 bytes that the processor stacks (with floating point) and the frames of its functions, which disassembled are
/// 1.1 kB of the estimators (a full message of the raw stream is framed there) and 160 bytes of the others together.
const INTERRUPTS_STACK: u32 = 4 * 104 + 1280 + 256;

/// The stack that was left over takes what interrupts may add.
fn stack_suffices(health: &Health) {
    assert!(health.stack_bytes + INTERRUPTS_STACK <= health.stack_size, "{health:?}");
}

/// The image, built at most once a run; `OBSERVATORY_IMAGE` names another.
fn image() -> &'static Path {
    static IMAGE: OnceLock<PathBuf> = OnceLock::new();
    let build = || build::image("f405", "thumbv7em-none-eabihf");
    IMAGE.get_or_init(|| std::env::var_os("OBSERVATORY_IMAGE").map_or_else(build, PathBuf::from))
}

/// The sensor of the published characterisation.
fn sensor(seed: u64) -> Sensor {
    Sensor::new(VirtualAdis16405::new(NoiseModel::paper(), seed), SCK_HZ)
}

#[test]
fn the_image_reports_what_the_host_computes_from_the_same_counts() {
    const ASKED_AT_S: f64 = 4.5;
    let keys = vec![(ASKED_AT_S, b"r".to_vec())];
    let scenario = Scenario { sensor: Some(sensor(1)), keys, seconds: 7.0, ..Scenario::default() };
    let Outcome { sensor, received, complaints, .. } = run(image(), scenario);
    let sensor = sensor.expect("the sensor hangs on the bus");
    assert_eq!(complaints, [""; 0], "the emulator has nothing to complain about");

    // The bus: no stall, frame or clock that the data sheet forbids. Eight periods of SCK take 12 190.5 ns; between
    // bytes the processor may spend 2 % more.
    assert_eq!(sensor.part.violations(), []);
    assert_eq!(sensor.odd_words, 0);
    assert!((12_184..=12_440).contains(&sensor.shortest_byte_ns), "a byte in {} ns", sensor.shortest_byte_ns);

    // Every sample since sampling began was read once.
    let (first, last) = (sensor.bursts[0].0, sensor.bursts[sensor.bursts.len() - 1].0);
    assert!(sensor.bursts.iter().map(|&(sample, _)| sample).eq(first..=last));
    assert!(sensor.part.samples() - last <= 1);

    let Decoded { messages, counters, .. } = Decoded::of(&received);
    assert_eq!(counters, DecoderCounters { frames: messages.len() as u64, ..DecoderCounters::default() });
    let [Message::Log(log), Message::Hello(hello), channels @ .., Message::Health(health)] = messages.as_slice() else {
        panic!("a report goes from hello to health: {messages:?}");
    };
    assert!(log.starts_with("sensor: ADIS16405, self-test"), "{log}");
    let uptime_s = hello.uptime_us as f64 * 1e-6;
    assert!((ASKED_AT_S - 0.05..ASKED_AT_S + 0.01).contains(&uptime_s), "{uptime_s} s");
    let expected = Hello {
        firmware: (0, 1, 0),
        product_id: 16405,
        gyro_full_scale: 300,
        filter_taps_log2: 0,
        sample_rate_hz: 204.8,
        measured_rate_hz: hello.measured_rate_hz,
        spi_clock_hz: SCK_HZ,
        uptime_us: hello.uptime_us,
        sampling: true,
        epoch: 0,
        epoch_s: 0,
        boot: Boot { cause: BootCause::PowerOn, starts: 1, ..Boot::default() },
    };
    assert_eq!(*hello, expected);

    // Microseconds of the crystal's clock over 4 s.
    let measured = hello.measured_rate_hz.unwrap();
    assert!((measured / 204.8 - 1.0).abs() < 1e-6, "{measured}");

    // The sensor is configured within 50 ms; from then on 204.8 samples a second.
    let mut least = ((uptime_s - 0.05) * 204.8) as u64;
    for (report, channel) in channels.iter().zip(CHANNELS) {
        let Message::Channel(report) = report else { panic!("{report:?}") };
        assert_eq!(report.channel, channel as u8);
        assert!(report.samples >= least, "{} samples, at least {least}", report.samples);
        least = report.samples;
        assert_eq!(report.missing, 0);
        let factors: Vec<u64> = (0..24).map(|octave| 1 << octave).filter(|n| 2 * n <= report.samples).collect();
        assert!(report.octaves.iter().map(|point| point.n).eq(factors));
        assert_eq!(report.coefficients.len(), if channel.unit() == "degC" || channel.unit() == "V" { 0 } else { 3 });
        assert_eq!(*report, on_host(&sensor.bursts, 204.8, report), "bit for bit");
    }
    assert_eq!(channels.len(), 8);

    assert!(u64::from(health.used) >= least);
    assert_eq!(health.used, health.bursts);
    assert_eq!((health.bus_errors, health.queue_full), (0, 0));
    let sent = |bytes: &(u64, u8)| bytes.0;
    let (first, last) =
        (received.iter().rfind(|bytes| bytes.0 < 4_500_000_000).map_or(0, sent), received.last().map_or(0, sent));
    println!("{health:?}");
    println!("a report took {:.3} s", (last - first.max(4_500_000_000)) as f64 * 1e-9);
}

#[test]
fn the_image_fits_its_flash_and_memory() {
    let size = size::size(image());
    println!("{size:?}");
    // 128 kB with what the paths to cargo's registry, which panics name, may be longer elsewhere.
    assert!(size.flash <= 127 * 1024, "{size:?}");
    // All that is ever used: the stack, of which other tests assert that it suffices, and what lies above it.
    assert!(size.ram <= 64 * 1024, "{size:?}");
}

#[test]
fn a_missing_sensor_is_said_every_second() {
    let Outcome { received, .. } = run(image(), Scenario { seconds: 3.0, ..Scenario::default() });
    let Decoded { messages, counters, .. } = Decoded::of(&received);
    assert_eq!(counters.bad_frames, 0);
    assert_eq!(messages.len(), 3, "{messages:?}");
    for message in messages {
        let Message::Log(text) = message else { panic!("{message:?}") };
        assert!(text.starts_with("sensor: PROD_ID answered 0"), "{text}");
    }
}
