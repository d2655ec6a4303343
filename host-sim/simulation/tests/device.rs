//! The firmware's application on the host: commands, reports, epochs, recovery, and the state retained over a restart.

use adis16405_driver::{Channel, OutputWord};
use embedded_hal::spi::SpiDevice;
use firmware::CHANNELS;
use link::{ChannelMessage, Decoder, Health, Hello, Message, RawMessage, Received};
use simulation::Device;
use virtual_sensor::{InjectedEffect, NoiseModel, OutputRegister, SensorScenario, VirtualAdis16405};

const SECOND: u64 = 1_000_000;

fn device() -> Device {
    Device::new(VirtualAdis16405::new(NoiseModel::paper(), 1), Device::blank_memory())
}

struct Transcript {
    messages: Vec<Message>,
    lines: Vec<String>,
}

fn hear(bytes: &[u8]) -> Transcript {
    let mut decoder = Decoder::new();
    let mut heard = Transcript { messages: Vec::new(), lines: Vec::new() };
    for received in bytes.iter().filter_map(|&byte| decoder.push(byte)) {
        match received {
            Received::Message { message, .. } => heard.messages.push(message),
            Received::Text(line) => heard.lines.push(line.as_str().to_owned()),
        }
    }
    let counters = decoder.counters();
    assert_eq!((counters.bad_frames, counters.missing, counters.discarded_bytes), (0, 0, 0));
    heard
}

impl Transcript {
    fn logs(&self) -> Vec<&str> {
        self.messages
            .iter()
            .filter_map(|message| if let Message::Log(line) = message { Some(line.as_str()) } else { None })
            .collect()
    }

    fn hellos(&self) -> Vec<&Hello> {
        self.messages
            .iter()
            .filter_map(|message| if let Message::Hello(hello) = message { Some(hello) } else { None })
            .collect()
    }

    fn health(&self) -> &Health {
        self.messages
            .iter()
            .filter_map(|message| if let Message::Health(health) = message { Some(health) } else { None })
            .next_back()
            .expect("a report")
    }

    /// Number of reports, each of hello, eight channels and health; other messages are not counted.
    fn reports(&self) -> usize {
        let extra = |message: &&Message| {
            matches!(message, Message::Log(_) | Message::Raw(_) | Message::Validation(_) | Message::Learned(_))
        };
        let frames: Vec<&Message> = self.messages.iter().filter(|message| !extra(message)).collect();
        for report in frames.chunks(10) {
            let [Message::Hello(_), channels @ .., Message::Health(_)] = report else { panic!("{report:?}") };
            let numbers = channels.iter().map(|message| match message {
                Message::Channel(report) => usize::from(report.channel),
                _ => 0,
            });
            assert!(numbers.eq(CHANNELS.map(|channel| channel as usize)), "{report:?}");
        }
        frames.len() / 10
    }
}

/// Sends `keys`, then runs until `until_us`.
fn after(device: &mut Device, keys: &str, until_us: u64) -> Transcript {
    device.press(keys.as_bytes());
    hear(&device.run_until(until_us))
}

#[test]
fn a_report_is_due_every_ten_seconds_and_on_request() {
    let mut device = device();
    assert_eq!(after(&mut device, "", 10 * SECOND - 1).reports(), 0);
    assert_eq!(after(&mut device, "", 10 * SECOND + SECOND / 2).reports(), 1);
    let asked = after(&mut device, "rr", 11 * SECOND);
    assert_eq!(asked.reports(), 1, "one at a time");
    assert_eq!(after(&mut device, "i 2\r", 21 * SECOND + SECOND / 2).reports(), 5);
    assert_eq!(after(&mut device, "i0\r", 60 * SECOND).reports(), 0);
}

#[test]
fn a_report_has_product_id_and_measured_rate() {
    let mut device = device();
    let heard = after(&mut device, "", 10 * SECOND + SECOND / 2);
    assert_eq!(heard.logs().len(), 1, "{:?}", heard.logs());
    assert!(heard.logs()[0].starts_with("sensor: ADIS16405, self-test"), "{:?}", heard.logs());
    let hello = heard.hellos()[0];
    assert_eq!((hello.product_id, hello.gyro_full_scale, hello.sample_rate_hz), (16405, 300, 204.8));
    assert!((hello.measured_rate_hz.unwrap() - 204.8).abs() < 1e-3, "{hello:?}");
    assert_eq!((heard.health().used, heard.health().bursts), (heard.health().bursts, heard.health().bursts));
    assert!(heard.health().used > 2000);
}

#[test]
fn rate_range_and_filter_are_set_or_refused_with_the_reason() {
    let mut device = device().with_fixed_clock(1_000_000);
    after(&mut device, "", SECOND);
    after(&mut device, "f 819.2\rn 5\rg 75\r", 2 * SECOND);
    let heard = after(&mut device, "r", 3 * SECOND);
    let hello = heard.hellos()[0];
    assert_eq!((hello.gyro_full_scale, hello.filter_taps_log2, hello.sample_rate_hz), (75, 5, 819.2));
    assert!((hello.measured_rate_hz.unwrap() / 819.2 - 1.0).abs() < 1e-4, "{hello:?}");
    for (keys, answer) in [
        ("n 2\r", "filter taps 2^2 are outside 2^4 to 2^6"),
        ("f 0\r", "the sample rate must be a finite number above 0"),
        ("g 100\r", "no such g command; ? lists them"),
        ("autonull\r", "not armed"),
        ("x", "x is no command; ? lists them"),
    ] {
        let until = (device.bus().part().now() / 1000) + SECOND / 10;
        let lines = after(&mut device, keys, until).lines;
        assert!(lines.iter().any(|line| line.contains(answer)), "{keys}: {lines:?}");
    }
    assert_eq!(device.bus().part().violations(), []);
    let until = (device.bus().part().now() / 1000) + SECOND / 10;
    assert_eq!(after(&mut device, "\rr", until).health().bad_commands, 2);
}

/// Rates of low-power mode need a serial clock of at most 300 kHz, and a longer stall until the sensor has left the
/// mode.
#[test]
fn the_serial_clock_follows_the_rate() {
    let mut device = device();
    after(&mut device, "i 0\r", SECOND);
    for (at, end, rate_hz, clock_hz) in
        [(1_u32, 4_u32, 51.2, 300_000), (4, 7, 163.84, 300_000), (7, 10, 182.0, 1_000_000), (10, 18, 0.8, 300_000)]
    {
        after(&mut device, &format!("f {rate_hz}\r"), u64::from(end - 1) * SECOND);
        let heard = after(&mut device, "r", u64::from(end) * SECOND);
        let (hello, health) = (heard.hellos()[0], heard.health());
        assert_eq!(hello.spi_clock_hz, clock_hz, "{rate_hz} Hz");
        assert!((hello.sample_rate_hz / rate_hz - 1.0).abs() < 0.02 && hello.sampling, "{hello:?}");
        assert_eq!((health.used, health.lost_edges), (health.bursts, 0), "{rate_hz} Hz: {health:?}");
        // The report is made a second before the end; the first half second and a sample period are not counted.
        let least = rate_hz * (f64::from(end - at) - 1.5) - 1.0;
        assert!(f64::from(health.used + health.settling) > least, "{rate_hz} Hz: {health:?}");
    }
    assert_eq!(device.bus().part().violations(), []);
}

/// The numbers of a table cell, without the words around them.
fn numbers(text: &str) -> Vec<f64> {
    text.split(|letter: char| !(letter.is_ascii_digit() || letter == '.'))
        .filter_map(|word| word.trim_matches('.').parse().ok())
        .collect()
}

/// The table has the numbers of the frames, in its own units, with the digits that the bounds support.
#[test]
fn the_table_shows_the_numbers_of_the_report() {
    let mut device = device();
    after(&mut device, "", 9 * SECOND);
    let heard = after(&mut device, "tr", 9 * SECOND + 1);
    let channels: Vec<&ChannelMessage> = heard
        .messages
        .iter()
        .filter_map(|message| if let Message::Channel(channel) = message { Some(channel) } else { None })
        .collect();
    assert_eq!(channels.len(), CHANNELS.len());
    let lines = &heard.lines;
    assert!(lines.iter().all(|line| line.is_ascii() && line.len() <= 80), "{lines:#?}");
    let samples = format!("ADIS16405   {},{:03} samples   ", channels[0].samples / 1000, channels[0].samples % 1000);
    assert!(lines[0].starts_with(&samples) && lines[0].contains(" at 204.8 Hz"), "{}", lines[0]);
    assert_eq!(lines[1], "0 lost, 0 refused at most; the epoch has no end");
    let place = |start: &str| {
        lines.iter().position(|line| line.starts_with(start)).unwrap_or_else(|| panic!("{start}: {lines:#?}"))
    };
    let (gyros, accelerometers) = (place("        deg/sqrt(s)") + 1, place(" accel  ug/sqrt(Hz)") + 1);
    assert!(gyros < accelerometers && accelerometers < place("Allan deviation"), "{lines:#?}");
    // The frames are in deg/s and g. The columns of the table begin at their titles.
    let columns = ["angle random walk", "bias instability", "rate random walk", "error on"];
    let starts = columns.map(|title| lines[gyros - 2].find(title).expect(title));
    for (index, report) in channels[..6].iter().enumerate() {
        let (line, factors) = if index < 3 {
            (&lines[gyros + index], [1.0, 1e3, 1e3])
        } else {
            (&lines[accelerometers + index - 3], [1e6; 3])
        };
        assert_eq!(line.trim_start().chars().next(), "xyz".chars().nth(index % 3), "{line}");
        for (k, (coefficient, factor)) in report.coefficients.iter().zip(factors).enumerate() {
            let cell = line.get(starts[k]..(starts[k + 1].min(line.len()))).unwrap_or_default().trim();
            let found = numbers(&cell.replace(',', ""));
            let (value, low, high) = (factor * coefficient.value, factor * coefficient.low, factor * coefficient.high);
            // Numbers have at least two significant digits: an error of at most 5 %, for 1.05 written as 1.1.
            let near = |shown: f64, of: f64| (shown - of).abs() <= 0.05 * of.abs();
            let is_right = match found[..] {
                [bound] if cell.starts_with('<') => near(bound, high),
                [shown, half] if cell.contains("+-") => {
                    near(shown, value) && (half / ((high - low) / 2.0) - 1.0).abs() < 0.2
                }
                [shown, bound] if cell.contains("(<") => near(shown, value) && near(bound, high),
                [shown, below, above] => near(shown, value) && near(below, low) && near(above, high),
                _ => false,
            };
            assert!(is_right, "{cell}: {value} ({low} .. {high})");
        }
    }
    let curve = place("Allan deviation") + 2;
    for (k, point) in channels[0].octaves.iter().enumerate() {
        let cells = numbers(&lines[curve + k]);
        for (index, report) in channels[..6].iter().enumerate() {
            let of = report.octaves[k];
            let n = point.n as f64;
            // The data sheet gives 0.05 deg/s and 3.33 mg a count.
            let unit = if index < 3 { 0.05 } else { 3.33 };
            let deviation = unit * (of.sum as f64 / (2.0 * n * n * of.count as f64)).sqrt();
            assert!((cells[0] * 204.8 / n - 1.0).abs() < 1e-3, "{}", lines[curve + k]);
            // The deviations have four significant digits.
            assert!((cells[1 + index] / deviation - 1.0).abs() < 0.6e-3, "{deviation}: {}", lines[curve + k]);
        }
    }
}

#[test]
fn commands_show_help_status_version_and_counters() {
    let mut device = device();
    after(&mut device, "", SECOND);
    let lines = after(&mut device, "?", 2 * SECOND).lines;
    for expected in (0..).map_while(firmware::command::help) {
        assert!(lines.iter().any(|line| line.as_str() == expected.as_str()), "{expected}: {lines:?}");
    }
    let lines =
        [after(&mut device, "s", 3 * SECOND), after(&mut device, "k", 4 * SECOND), after(&mut device, "v", 5 * SECOND)];
    let lines: Vec<String> = lines.into_iter().flat_map(|heard| heard.lines).collect();
    for expected in [
        "sensor sampled",
        "rate 204.80 Hz, measured 204.8",
        "start 1",
        "used ",
        concat!("observatory ", env!("CARGO_PKG_VERSION")),
    ] {
        assert!(lines.iter().any(|line| line.contains(expected)), "{expected}: {lines:?}");
    }
}

/// Keys in quick succession are answered in order; those beyond the queue are answered with "busy".
#[test]
fn queued_keys_are_answered_in_order() {
    let mut device = device();
    after(&mut device, "", SECOND);
    let lines = after(&mut device, "?sks", 2 * SECOND).lines;
    let starts: Vec<usize> = ["this list", "start 1", "used ", "start 1"]
        .iter()
        .scan(0, |from, wanted| {
            let at = *from + lines[*from..].iter().position(|line| line.contains(wanted))?;
            *from = at + 1;
            Some(at)
        })
        .collect();
    assert_eq!(starts.len(), 4, "{lines:?}");
    let lines = after(&mut device, "ssssss", 4 * SECOND).lines;
    let count = |wanted: &str| lines.iter().filter(|line| line.contains(wanted)).count();
    assert_eq!((count("start 1"), count("busy")), (4, 2), "{lines:?}");
}

/// Every burst of the raw stream is one that the part sent, in order and without a gap.
#[test]
fn the_raw_stream_is_complete() {
    let mut device = device();
    after(&mut device, "i0\r", SECOND);
    let heard = after(&mut device, "w1\r", 5 * SECOND);
    let raw = |message: &Message| if let Message::Raw(raw) = message { Some(raw.clone()) } else { None };
    let raws: Vec<RawMessage> = heard.messages.iter().filter_map(raw).collect();
    let counts: Vec<i16> = raws
        .iter()
        .flat_map(|raw| &raw.bursts)
        .map(|burst| OutputWord(u16::from_be_bytes(burst.words[1])).counts(Channel::GyroX))
        .collect();
    // A part with the same seed gives the counts sample by sample.
    let mut twin = Device::new(VirtualAdis16405::new(NoiseModel::paper(), 1), Device::blank_memory());
    after(&mut twin, "", SECOND);
    let mut expected = Vec::new();
    while expected.len() < counts.len() {
        let samples = twin.bus().part().samples();
        let now_us = twin.bus().part().now() / 1000;
        after(&mut twin, "", now_us + 100);
        if twin.bus().part().samples() > samples {
            expected.push(twin.bus().part().counts()[Channel::GyroX as usize]);
        }
    }
    assert!(counts.len() > 800);
    assert_eq!(counts, expected);
    assert!(raws.windows(2).all(|pair| pair[1].first == pair[0].first + 16));
    assert!(after(&mut device, "w0\r", 6 * SECOND).messages.len() <= 1, "the stream ends");
}

/// The sensor is reset, but not by the firmware. Samples with other settings are not used, the sensor is configured
/// again, and the statistics go on with a gap.
#[test]
fn a_sensor_that_was_reset_is_configured_again() {
    let mut device = device();
    after(&mut device, "", 4 * SECOND);
    let mut bus = device.bus().clone();
    let Ok(()) = bus.write(&[0xBE, 0x80]); // GLOB_CMD bit 7
    let heard = after(&mut device, "", 6 * SECOND);
    assert_eq!(heard.logs().len(), 2, "{:?}", heard.logs());
    assert!(heard.logs()[0].contains("no data-ready edges"));
    let health = *after(&mut device, "r", 8 * SECOND).health();
    assert_eq!(health.recoveries, 1);
    assert_eq!(health.used, health.bursts);
    let lost = health.lost_edges + health.suspect + health.settling;
    assert!((20..250).contains(&lost), "{health:?}");
    // The self-test of the first probe takes 12 ms at 819.2 SPS (data sheet Rev. B, Table 1), 48 ms here: 10 samples.
    assert!(u64::from(health.used + lost).abs_diff((6.0 * 204.8) as u64) < 10 + 10, "{health:?}");
}

/// An epoch accumulates, reports, fits its model and begins again. From the second one on, the model of the previous
/// epoch is validated.
#[test]
fn an_epoch_ends_with_a_report_and_its_model_is_validated_on_the_next() {
    let mut device = device();
    let heard = after(&mut device, "i0\re20\r", 61 * SECOND);
    assert_eq!(heard.reports(), 3);
    let epochs: Vec<u32> = heard.hellos().iter().map(|hello| hello.epoch).collect();
    assert_eq!(epochs, [0, 1, 2]);
    let channels: Vec<_> = heard
        .messages
        .iter()
        .filter_map(|message| if let Message::Channel(report) = message { Some(report) } else { None })
        .collect();
    for (index, report) in channels.iter().enumerate() {
        let inertial = index % 8 < 6;
        assert_eq!(report.unseen_error.is_some(), index >= 8 && inertial, "{report:?}");
        // The gate against gross errors learns from the first 32 samples.
        let learning = if index < 8 { 32 } else { 0 };
        assert!((report.samples + learning).abs_diff(20 * 2048 / 10) < 40, "{}", report.samples);
        if let Some(error) = report.unseen_error {
            // A true model has an expected deviance of 1, with a spread of the same size: 10 correlated octaves.
            assert!((0.0..5.0).contains(&error.deviance_per_point), "{error:?}");
            assert!((0.0..30.0).contains(&error.rms_percent), "{error:?}");
        }
    }
}

#[test]
fn the_statistics_are_reset_on_command() {
    let mut device = device();
    after(&mut device, "", 5 * SECOND);
    assert_eq!(after(&mut device, "clear\r", 6 * SECOND).lines, ["statistics reset"]);
    let health = *after(&mut device, "r", 6 * SECOND + 1).health();
    assert!((190..=210).contains(&health.used), "{health:?}");
}

/// A restart keeps settings and statistics: the samples go on with the same configuration.
#[test]
fn a_restart_keeps_statistics_and_settings() {
    let memory = Device::blank_memory();
    let mut first = Device::new(VirtualAdis16405::new(NoiseModel::paper(), 1), memory);
    after(&mut first, "f 819.2\ri 3\re 100\r", SECOND);
    let used = after(&mut first, "", 9 * SECOND).health().used;
    assert_eq!(first.restarts(), 0);
    after(&mut first, "boot\r", 9 * SECOND + 1000);
    assert_eq!(first.restarts(), 1);

    let part = first.bus().part().clone();
    let start = part.now() / 1000;
    let mut second = Device::new(part, memory);
    let heard = after(&mut second, "r", start + SECOND / 2);
    let hello = heard.hellos()[0];
    assert_eq!((hello.boot.starts, hello.boot.restored_channels), (2, 8));
    assert_eq!((hello.sample_rate_hz, hello.epoch_s), (819.2, 100));
    let samples = heard.messages.iter().filter_map(|message| match message {
        Message::Channel(report) => Some(report.samples),
        _ => None,
    });
    assert!(samples.clone().count() == 8 && samples.clone().all(|samples| samples >= u64::from(used)), "{used}");
}

/// XGYRO_OFF = −100, byte by byte (data sheet Rev. B, table 8: address 0x1A, 13 bits).
const NEGATIVE_BIAS: [u16; 2] = [0x9A9C, 0x9B1F];

/// The part's erratum: with a negative bias of gyro x in the sensor, each burst would lose the sign of negative rates.
/// The firmware moves the bias out of the sensor before it uses samples.
#[test]
fn a_negative_x_bias_in_the_sensor_costs_no_sample() {
    let mut part = VirtualAdis16405::new(NoiseModel::paper(), 11);
    for (k, word) in (1..).zip(NEGATIVE_BIAS) {
        part.advance_to(k * 100_000);
        part.select();
        part.transfer(word);
        part.deselect();
    }
    part.advance_to(300_000);
    let mut device = Device::new(part, Device::blank_memory());
    let health = *after(&mut device, "", 11 * SECOND).health();
    assert!(health.bursts > 2_000, "{health:?}");
    assert_eq!(health.used, health.bursts, "{health:?}");
}

/// Epochs of a minute contain restarts and still end a minute after they began, except for the time that a restart takes: up to 0.8 s since
/// the last checkpoint.
#[test]
fn an_epoch_keeps_its_age_over_a_restart() {
    let memory = Device::blank_memory();
    let mut device = Device::new(VirtualAdis16405::new(NoiseModel::paper(), 1), memory);
    after(&mut device, "i0\re60\r", 50 * SECOND);
    for restarts_at in [50, 55] {
        let part = device.bus().part().clone();
        let start = part.now() / 1000;
        assert!(start / SECOND == restarts_at);
        device = Device::new(part, memory);
        let lines = after(&mut device, "s", start + 5 * SECOND).lines;
        assert!(lines.iter().any(|line| line.contains("epoch 0, begun ")), "{lines:?}");
    }
    let start = device.bus().part().now() / 1000;
    let mut heard = after(&mut device, "", start + 2 * SECOND);
    heard.messages.extend(after(&mut device, "", start + 7 * SECOND).messages);
    let epochs: Vec<u32> = heard.hellos().iter().map(|hello| hello.epoch).collect();
    assert_eq!(epochs, [0], "the first epoch has ended within 62 s");
}

/// A part with another product number, 3, is used only on request, then also after a restart.
#[test]
fn a_part_with_another_prod_id_is_used_if_asked_for() {
    let memory = Device::blank_memory();
    let mut part = VirtualAdis16405::new(NoiseModel::paper(), 1);
    part.set_prod_id(3);
    let mut device = Device::new(part, memory);
    let heard = after(&mut device, "", 3 * SECOND);
    assert!(heard.logs().iter().any(|log| log.contains("PROD_ID answered 3")), "{:?}", heard.logs());
    let heard = after(&mut device, "p 3\r", 5 * SECOND);
    assert!(
        heard.logs().iter().any(|log| log.starts_with("sensor: ADIS16405, self-test passed")),
        "{:?}",
        heard.logs()
    );
    assert!(after(&mut device, "r", 6 * SECOND).health().used > 300);
    let part = device.bus().part().clone();
    let start = part.now() / 1000;
    let mut second = Device::new(part, memory);
    let heard = after(&mut second, "r", start + SECOND);
    assert!(heard.hellos()[0].sampling, "{:?}", heard.hellos());
    let until = start + 4 * SECOND;
    let heard = after(&mut second, "p 0\r", until);
    assert!(heard.logs().iter().any(|log| log.contains("PROD_ID answered 3")), "{:?}", heard.logs());
}

/// A gyro whose self-test fails, as in motion, is marked in the report and in the table. All samples are used.
#[test]
fn a_failed_self_test_excludes_no_sample() {
    let mut part = VirtualAdis16405::new(NoiseModel::paper(), 1);
    part.break_sensor(OutputRegister::GyroY);
    let mut device = Device::new(part, Device::blank_memory());
    let mut heard = after(&mut device, "", 3 * SECOND);
    assert_eq!(heard.logs(), ["sensor: ADIS16405, self-test failed, DIAG_STAT 0x0820: gyro_y"]);
    heard = after(&mut device, "rt", 3 * SECOND + 1);
    let failed: Vec<u8> = heard
        .messages
        .iter()
        .filter_map(|message| if let Message::Channel(report) = message { Some(report) } else { None })
        .filter(|report| report.self_test_failed)
        .map(|report| report.channel)
        .collect();
    assert_eq!(failed, [Channel::GyroY as u8]);
    let marked = heard.lines.iter().filter(|line| line.contains("fail ")).collect::<Vec<_>>();
    assert!(marked.len() == 1 && marked[0].starts_with(" y fail"), "{:#?}", heard.lines);
    let health = heard.health();
    assert!(health.used > 500 && (health.used, health.recoveries) == (health.bursts, 0), "{health:?}");
    let heard = after(&mut device, "check\r", 4 * SECOND);
    assert!(heard.logs().iter().any(|log| log.starts_with("check: FAILED")), "{:?}", heard.logs());
    let health = *after(&mut device, "r", 4 * SECOND + 1).health();
    assert!(f64::from(health.used + health.settling) > 3.8 * 204.8, "{health:?}");
}

/// For an hour the host does not read the USB port. Only its output is lost: no sample, no restart, no message of the UART.
#[test]
fn an_unread_usb_port_costs_its_output_alone() {
    const HOUR: u64 = 3600 * SECOND;
    let part = VirtualAdis16405::new(NoiseModel::paper(), 3);
    let mut device = Device::new(part, Device::blank_memory()).with_restarts().with_unread_usb();
    let heard = after(&mut device, "w 1\ri 60\r", HOUR);
    let last = after(&mut device, "w 0\rr", HOUR + SECOND);
    let health = last.health();
    assert_eq!(device.restarts(), 0);
    assert_eq!((health.used, health.recoveries), (health.bursts, 0), "{health:?}");
    assert_eq!((health.lost_edges, health.queue_full, health.raw_dropped), (0, 0, 0), "{health:?}");
    assert!(f64::from(health.used) > 3599.0 * 204.8, "{health:?}");
    let streamed = heard.messages.iter().filter(|message| matches!(message, Message::Raw(_))).count();
    assert!(streamed as f64 > 3599.0 * 204.8 / 16.0, "{streamed} messages of the raw stream");
    // The queue holds a few kB of the 20 MB that the UART has sent.
    let sent = heard.messages.len() + heard.lines.len();
    assert!((sent as u32 - 100..sent as u32 + 100).contains(&health.usb_dropped), "{} of {sent}", health.usb_dropped);
}

/// Settings, the raw stream and the models of the last epoch survive a loss of power; everything else is lost. `forget` erases them.
#[test]
fn settings_and_models_survive_the_loss_of_power() {
    let part = || VirtualAdis16405::new(NoiseModel::paper(), 5);
    let mut device = Device::new(part(), Device::blank_memory());
    after(&mut device, "f 819.2\rg 150\rn 3\re 20\ri 7\rw 1\r", 2 * SECOND);
    let learned = hear(&device.run_until(30 * SECOND));
    let models: Vec<&Message> = learned.messages.iter().filter(|m| matches!(m, Message::Learned(_))).collect();
    assert_eq!(models.len(), 6);
    let kept = learned.logs().into_iter().find(|line| line.starts_with("models kept")).expect("a log").to_owned();
    assert!(kept.ends_with("not sampled for 50 ms") || kept.ends_with("not sampled for 51 ms"), "{kept}");

    let mut again = device.power_cycled(part());
    let heard = hear(&again.run_until(8 * SECOND));
    let hello = heard.hellos()[0];
    assert_eq!((hello.sample_rate_hz, hello.gyro_full_scale, hello.filter_taps_log2), (819.2, 150, 3));
    assert_eq!((hello.epoch, hello.epoch_s, hello.boot.starts), (0, 20, 1), "{hello:?}");
    assert_eq!(heard.reports(), 1, "every 7 s");
    assert!(heard.messages.iter().any(|message| matches!(message, Message::Raw(_))), "the stream goes on");
    // The earlier models are validated on the first epoch after the loss.
    let heard = hear(&again.run_until(30 * SECOND));
    let validated = heard.messages.iter().filter(|message| matches!(message, Message::Validation(_))).count();
    assert_eq!(validated, 6);

    let heard = after(&mut again, "forget\r", 31 * SECOND);
    assert!(
        heard.lines.iter().any(|line| line.starts_with("nothing is kept without power; not sampled")),
        "{:?}",
        heard.lines
    );
    let mut fresh = again.power_cycled(part());
    let heard = after(&mut fresh, "r", 2 * SECOND);
    assert_eq!(heard.hellos()[0].sample_rate_hz, 204.8);
    assert!(!heard.messages.iter().any(|message| matches!(message, Message::Raw(_))));
}

/// The samples lost during a write are a gap: they are counted, and the sensor is not probed.
#[test]
fn a_write_costs_a_gap_and_no_probe() {
    let mut device = device();
    after(&mut device, "i 0\r", 2 * SECOND);
    let heard = after(&mut device, "persist\r", 4 * SECOND);
    assert!(
        heard.lines[0].starts_with("settings and models are kept without power; not sampled for 5"),
        "{:?}",
        heard.lines
    );
    let health = *after(&mut device, "r", 5 * SECOND).health();
    assert_eq!((health.recoveries, health.rereads, health.suspect), (0, 0, 0), "{health:?}");
    // A write takes 50 ms, at 204.8 SPS.
    assert!((10..=11).contains(&health.lost_edges), "{health:?}");
    assert_eq!(health.used, health.bursts);
}

/// The part turns by 2 deg/s about each axis. Its correction of x is negative and not applied, since bursts would lose the sign of x.
#[test]
fn autonull_says_what_it_does_not_apply() {
    for (rate, told) in
        [(2.0, "bias of y and z nulled, statistics reset; x: -"), (-2.0, "bias nulled, statistics reset")]
    {
        let step = |channel| InjectedEffect::BiasStep { channel, time_s: 0.5, size: rate };
        let effects = [OutputRegister::GyroX, OutputRegister::GyroY, OutputRegister::GyroZ].map(step).to_vec();
        let scenario = SensorScenario { effects, ..SensorScenario::default() };
        let part = VirtualAdis16405::with_scenario(&scenario, NoiseModel::noiseless(), 1);
        let mut device = Device::new(part, Device::blank_memory());
        after(&mut device, "i 0\r", 2 * SECOND);
        let lines = after(&mut device, "arm\rautonull\r", 4 * SECOND).lines;
        let line = lines.iter().find(|line| line.starts_with(told)).unwrap_or_else(|| panic!("{rate}: {lines:?}"));
        if let Some(x) = line.strip_prefix("bias of y and z nulled, statistics reset; x: ") {
            // 0.0125 deg/s a count (data sheet Rev. B, Table 8).
            assert_eq!(x, "-160 counts not applied by the part");
        }
        // The correction is applied: the samples of y and z are 0, and those of x too if its correction is positive.
        let [_, x, y, z, ..] = *device.bus().part().counts();
        let applied = if rate < 0.0 { [x, y, z] } else { [0, y, z] };
        assert!(applied.iter().all(|count| count.abs() <= 1), "{applied:?}");
        assert_eq!(x.abs() <= 1, rate < 0.0, "{x}");
    }
}

/// An answer of some thirty lines reads the load figures once, since reading them searches the stack.
#[test]
fn the_counters_are_read_once_for_an_answer() {
    let mut device = device();
    after(&mut device, "i 0\r", 2 * SECOND);
    let before = device.meter_readings();
    let lines = after(&mut device, "k", 2 * SECOND + 1000).lines;
    assert!(lines.iter().any(|line| line.starts_with("settling ")), "{lines:?}");
    // The log of a debug probe reads them once a second.
    assert!(device.meter_readings() - before <= 2, "{} times", device.meter_readings() - before);
}
