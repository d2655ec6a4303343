//! The image that one flashes, run in an emulator against the virtual sensor.

mod bench;
mod build;
mod exti;
mod sensor;
mod terminal;

use adis16405_driver::{BURST_BYTES, Burst};
use bench::{Outcome, run};
use firmware::{Arrival, CHANNELS, Estimator, Estimators, FIRST_CONFIG, channel_model, channel_report};
use host_sim::sensor::{NoiseModel, VirtualAdis16405};
use link::{Boot, BootCause, ChannelReport, Counters, Decoder, Hello, Message, Received};
use sensor::Sensor;

/// The bus clock of the board (84 MHz) over the first power of two that brings it to 1 MHz or less.
const SCK_HZ: u32 = 84_000_000 / 128;

/// Everything the image said, and what became of the bytes.
fn decode(received: &[(u64, u8)]) -> (Vec<Message>, Counters) {
    let mut decoder = Decoder::new();
    let messages = received.iter().filter_map(|&(_, byte)| decoder.push(byte)).filter_map(Received::message);
    (messages.collect(), decoder.counters())
}

/// The same estimators on the host, fed with `bursts` until as many samples were taken as `report` says.
fn on_host(bursts: &[(u64, [u8; BURST_BYTES])], report: &ChannelReport) -> ChannelReport {
    let index =
        CHANNELS.iter().position(|&channel| channel as u8 == report.channel).expect("a channel that is estimated");
    let mut cascades = CHANNELS.map(|_| Estimator::new());
    let mut estimators = Estimators::new(&mut cascades, FIRST_CONFIG);
    for (sample, bytes) in bursts {
        if estimators.get(index).unwrap().len() == report.samples {
            break;
        }
        let at_us = (*sample as f64 * 1e6 / 204.8) as u64;
        estimators.take(Arrival { at_us, dropped: 0, burst: Some(Burst::from_bytes(bytes)) }, 0);
    }
    let (channel, estimator) = (CHANNELS[index], estimators.get(index).unwrap());
    let model = (index < 6).then(|| channel_model(channel, estimator, FIRST_CONFIG));
    channel_report(channel, estimator, FIRST_CONFIG, model.as_ref(), None)
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
        assert!(report.points.iter().map(|point| point.n).eq(factors));
        assert_eq!(report.coefficients.len(), if channel.unit() == "degC" || channel.unit() == "V" { 0 } else { 3 });
        assert_eq!(*report, on_host(&sensor.bursts, report), "bit for bit");
    }
    assert_eq!(channels.len(), 8);

    assert!(u64::from(health.used) >= least);
    assert_eq!(health.used, health.bursts);
    assert_eq!((health.bus_errors, health.queue_full), (0, 0));
    println!("{health:?}");
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
