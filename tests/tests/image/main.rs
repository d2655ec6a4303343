//! The image that one flashes, run in an emulator against the virtual sensor.

mod bench;
mod build;
mod exti;
mod sensor;
mod terminal;

use adis16405_driver::{BURST_BYTES, Burst, Channel, Config, GyroRange, SamplePeriod, TimeBase};
use bench::{Outcome, run};
use firmware::{App, Arrival, Settings};
use host_sim::sensor::{NoiseModel, VirtualAdis16405};
use link::{ChannelReport, Counters, Decoder, Encoder, Hello, Message};
use sensor::Sensor;

/// The bus clock of the board (84 MHz) over the first power of two that brings it to 1 MHz or less.
const SCK_HZ: u32 = 84_000_000 / 128;

/// Everything the image said, and what became of the bytes.
fn decode(received: &[(u64, u8)]) -> (Vec<Message>, Counters) {
    let mut decoder = Decoder::new();
    let messages = received.iter().filter_map(|&(_, byte)| decoder.push(byte)).map(|received| received.message);
    (messages.collect(), decoder.counters())
}

/// The same application on the host, fed with `bursts` until as many samples were taken as `report` says.
fn on_host(bursts: &[(u64, [u8; BURST_BYTES])], report: &ChannelReport) -> ChannelReport {
    let period = SamplePeriod::from_divisor(TimeBase::Fast, 8).unwrap();
    let config = Config::new(GyroRange::Dps300, 0, period).unwrap();
    let settings = Settings { config, product_id: 16405, spi_clock_hz: SCK_HZ, report_interval_us: 0 };
    let mut app = App::new(settings, Encoder::new());
    let mut bursts = bursts.iter();
    while u64::from(app.health().used) < report.samples {
        let (_, bytes) = bursts.next().expect("no report counts samples that were not read");
        app.take(Arrival { dropped: 0, burst: Some(Burst::from_bytes(bytes)) }, 0);
    }
    app.channel(Channel::ALL[usize::from(report.channel)]).expect("an inertial channel")
}

#[test]
fn the_image_reports_what_the_host_computes_from_the_same_counts() {
    const SECONDS: u64 = 8;
    const ASKED_AT_S: f64 = 4.5;
    let part = VirtualAdis16405::new(NoiseModel::paper(), 1);
    let request = ((ASKED_AT_S * 1e9) as u64, b'r');
    let Outcome { sensor, received, complaints } =
        run(build::image(), Some(Sensor::new(part, SCK_HZ)), &[request], SECONDS);
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

    let (messages, counters) = decode(&received);
    assert_eq!(counters, Counters { frames: messages.len() as u64, ..Counters::default() });
    let [Message::Hello(hello), channels @ .., Message::Health(health)] = messages.as_slice() else {
        panic!("a report goes from hello to health: {messages:?}");
    };
    let uptime_s = hello.uptime_us as f64 * 1e-6;
    assert!((ASKED_AT_S - 0.05..ASKED_AT_S + 0.01).contains(&uptime_s), "{uptime_s} s");
    let expected = Hello {
        firmware: (0, 1, 0),
        product_id: 16405,
        gyro_full_scale: 300,
        filter_taps_log2: 0,
        sample_rate_hz: 204.8,
        spi_clock_hz: SCK_HZ,
        uptime_us: hello.uptime_us,
    };
    assert_eq!(*hello, expected);

    // The sensor is configured within 50 ms; from then on 204.8 samples a second.
    let mut least = ((uptime_s - 0.05) * 204.8) as u64;
    for (report, channel) in channels.iter().zip(1..) {
        let Message::Channel(report) = report else { panic!("{report:?}") };
        assert_eq!(report.channel, channel);
        assert!(report.samples >= least, "{} samples, at least {least}", report.samples);
        least = report.samples;
        assert_eq!(report.missing, 0);
        let factors: Vec<u64> = (0..24).map(|octave| 1 << octave).filter(|n| 2 * n <= report.samples).collect();
        assert!(report.points.iter().map(|point| point.n).eq(factors));
        assert_eq!(report.coefficients.len(), 3);
        assert_eq!(*report, on_host(&sensor.bursts, report), "bit for bit");
    }
    assert_eq!(channels.len(), 6);

    assert!(u64::from(health.used) >= least);
    assert_eq!(health.used, health.bursts);
    assert_eq!((health.bus_errors, health.queue_full), (0, 0));
    println!("{} samples, at most {} bursts waited", health.used, health.queue_peak);
}

#[test]
fn a_missing_sensor_is_said_every_second() {
    let Outcome { received, .. } = run(build::image(), None, &[], 3);
    let (messages, counters) = decode(&received);
    assert_eq!(counters.bad_frames, 0);
    assert_eq!(messages.len(), 3, "{messages:?}");
    for message in messages {
        let Message::Log(text) = message else { panic!("{message:?}") };
        assert!(text.starts_with("sensor: PROD_ID answered 0"), "{text}");
    }
}
