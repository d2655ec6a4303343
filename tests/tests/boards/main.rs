//! The images, built as for flashing, run in emulators with the virtual sensor: those for the STM32F405 in a program of `tests/tools`, that
//! for the Raspberry Pi Pico in rp2040js.

mod bench;
mod checklist;
mod compensation;
mod costs;
mod decoded;
mod epochs;
mod faults;
mod full_speed;
mod images;
mod pico;
mod sampling_path;
mod wiring;

use self::bench::{image, run};
use self::decoded::{Decoded, on_host};
use self::wiring::{assert_bus_times, assert_set_up};
use adis16405_driver::GyroRange;
use emulation::{H405, Outcome, SCK_HZ, Scenario, Sensor};
use firmware::CHANNELS;
use link::{Boot, BootCause, DecoderCounters, Hello, Message};

#[test]
fn the_image_reports_what_the_host_computes_from_the_same_counts() {
    const REQUESTED_AT_S: f64 = 4.5;
    let keys = vec![(REQUESTED_AT_S, b"r".to_vec())];
    let scenario = Scenario { sensor: Some(Sensor::Published(1)), keys, seconds: 7.0, ..Scenario::default() };
    let Outcome { sensor, received, diagnostics, led_changes, registers, .. } = run(image(), scenario);
    let sensor = sensor.expect("the sensor on the bus");
    assert_eq!(diagnostics, [""; 0], "neither resets nor accesses to unmapped addresses");

    // The bus keeps the timing of the data sheet. Eight periods of SCK take 12 190.5 ns, and the processor may add 2 %
    // between bytes.
    assert_bus_times(&sensor, 75, 0);
    assert_eq!(sensor.odd_words, 0);
    assert!(
        (12_184..=12_440).contains(&sensor.shortest_byte_ns),
        "the shortest byte took {} ns",
        sensor.shortest_byte_ns
    );

    assert_set_up(H405, &registers);
    assert!((13..=15).contains(&led_changes), "{led_changes} changes of the LED in 7 s, of two a second");

    // Every sample since the first burst was read once.
    let (first, last) = (sensor.bursts[0].0, sensor.bursts[sensor.bursts.len() - 1].0);
    assert!(sensor.bursts.iter().map(|&(sample, _)| sample).eq(first..=last));
    assert!(sensor.samples - last <= 1);

    let Decoded { messages, counters, .. } = Decoded::decode(&received);
    assert_eq!(counters, DecoderCounters { frames: messages.len() as u64, ..DecoderCounters::default() });
    let [Message::Log(log), Message::Hello(hello), channels @ .., Message::Health(health)] = messages.as_slice() else {
        panic!("a report begins with hello and ends with health: {messages:?}");
    };
    assert!(log.starts_with("sensor: ADIS16405, self-test"), "{log}");
    let uptime_s = hello.uptime_us as f64 * 1e-6;
    assert!((REQUESTED_AT_S - 0.05..REQUESTED_AT_S + 0.01).contains(&uptime_s), "{uptime_s} s");
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

    // A time stamp of 1 us over 4 s allows 2.5e-7.
    let measured = hello.measured_rate_hz.unwrap();
    assert!((measured / 204.8 - 1.0).abs() < 1e-6, "{measured}");

    // The sensor is left alone for its start-up time of 290 ms and configured 50 ms later. Its self-test takes 48 ms at this rate. From
    // then on there are 204.8 samples a second, of which the filter takes four to settle, and the gate against gross errors 32 to learn.
    let mut least = ((uptime_s - 0.42) * 204.8) as u64 - 32;
    for (report, channel) in channels.iter().zip(CHANNELS) {
        let Message::Channel(report) = report else { panic!("{report:?}") };
        assert_eq!(report.channel, channel as u8);
        assert!(report.samples >= least, "{} samples, at least {least}", report.samples);
        least = report.samples;
        assert_eq!(report.missing, 0);
        let factors: Vec<u64> = (0..24).map(|octave| 1 << octave).filter(|n| 2 * n <= report.samples).collect();
        assert!(report.octaves.iter().map(|point| point.n).eq(factors));
        assert_eq!(report.coefficients.len(), if channel.unit() == "degC" || channel.unit() == "V" { 0 } else { 3 });
        assert_eq!(*report, on_host(&sensor.bursts, hello, report), "bit for bit");
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
fn a_missing_sensor_is_reported_every_second() {
    let Outcome { received, .. } = run(image(), Scenario { seconds: 3.0, slow_core: true, ..Scenario::default() });
    let Decoded { messages, counters, .. } = Decoded::decode(&received);
    assert_eq!(counters.bad_frames, 0);
    assert_eq!(messages.len(), 3, "{messages:?}");
    for message in messages {
        let Message::Log(text) = message else { panic!("{message:?}") };
        assert!(text.starts_with("sensor: PROD_ID answered 0"), "{text}");
    }
}

/// Host and device give the same analysis only with the same candidates and averaging times.
#[test]
fn the_firmware_analyses_with_the_settings_of_the_host() {
    for range in [GyroRange::Dps300, GyroRange::Dps150, GyroRange::Dps75] {
        // The host derives the filters with decimation from the sample rate.
        let own_rate: Vec<_> =
            firmware::learner::FILTERS.into_iter().filter(|filter| filter.decimation == 1.0).collect();
        assert_eq!(measurement::adis16405::profile(range.lsb()).filters, own_rate);
    }
    assert_eq!((firmware::OCTAVES, firmware::OVERLAP), (noise_analysis::OCTAVES, noise_analysis::OVERLAP));
}
