//! The output of an image, decoded by the host, and the report that the host computes from the same bursts.

use adis16405_driver::{BURST_BYTES, Burst, GyroRange, SamplePeriod};
use firmware::{CHANNELS, ChannelEstimator, ChannelSums, Estimators, ReportScale, Statistics, TimedBurst};
use link::{ChannelMessage, Decoder, DecoderCounters, Health, Hello, Message, RawMessage, Received};

pub(crate) struct Decoded {
    pub(crate) messages: Vec<Message>,
    pub(crate) lines: Vec<String>,
    pub(crate) counters: DecoderCounters,
}

impl Decoded {
    /// Decodes the bytes of the serial port.
    pub(crate) fn decode(received: &[(u64, u8)]) -> Self {
        let mut decoder = Decoder::new();
        let (mut messages, mut lines) = (Vec::new(), Vec::new());
        for received in received.iter().filter_map(|&(_, byte)| decoder.push(byte)) {
            match received {
                Received::Message { message, .. } => messages.push(message),
                Received::Text(line) => lines.push(line.as_str().to_owned()),
            }
        }
        Self { messages, lines, counters: decoder.counters() }
    }

    pub(crate) fn logs(&self) -> Vec<&str> {
        self.messages
            .iter()
            .filter_map(|m| if let Message::Log(line) = m { Some(line.as_str()) } else { None })
            .collect()
    }

    pub(crate) fn hellos(&self) -> Vec<&Hello> {
        self.messages.iter().filter_map(|m| if let Message::Hello(hello) = m { Some(hello) } else { None }).collect()
    }

    pub(crate) fn healths(&self) -> Vec<&Health> {
        self.messages.iter().filter_map(|m| if let Message::Health(health) = m { Some(health) } else { None }).collect()
    }

    pub(crate) fn channels(&self) -> Vec<&ChannelMessage> {
        self.messages
            .iter()
            .filter_map(|m| if let Message::Channel(report) = m { Some(report) } else { None })
            .collect()
    }

    /// The bursts of the raw stream, each with its number.
    pub(crate) fn raw(&self) -> Vec<(u64, Burst)> {
        let mut bursts = Vec::new();
        for message in &self.messages {
            let Message::Raw(RawMessage { first, bursts: stream, .. }) = message else { continue };
            let mut number = *first;
            for burst in stream {
                number += u64::from(burst.periods);
                let mut bytes = [0; BURST_BYTES];
                bytes[2..].copy_from_slice(burst.words.as_flattened());
                bursts.push((number, Burst::from_bytes(&bytes)));
            }
        }
        bursts
    }
}

/// The report of a channel by the firmware's estimators on the host. They take the first bursts until they have as many
/// samples as `report`, which belongs to `hello`.
pub(crate) fn on_host(bursts: &[(u64, [u8; BURST_BYTES])], hello: &Hello, report: &ChannelMessage) -> ChannelMessage {
    in_stretches(&[bursts], hello, report)
}

/// [`on_host`] for bursts in several stretches; each one after the first starts as the image does after a restart.
pub(crate) fn in_stretches(
    stretches: &[&[(u64, [u8; BURST_BYTES])]],
    hello: &Hello,
    report: &ChannelMessage,
) -> ChannelMessage {
    let rate_hz = hello.sample_rate_hz;
    let index = CHANNELS.iter().position(|&channel| channel as u8 == report.channel).expect("a channel");
    let period = SamplePeriod::nearest(rate_hz).expect("a rate");
    let config = adis16405_driver::Config::new(GyroRange::Dps300, 0, period).expect("no filter");
    let mut estimator = ChannelEstimator::new();
    for bursts in stretches {
        let mut statistics = Statistics::new();
        let mut estimators = Estimators::new(&mut statistics, config);
        estimators.restore(index, &ChannelSums::from_estimator(&estimator));
        let at_us = |sample: u64| (sample as f64 * 1e6 / rate_hz) as u64;
        estimators.accept_samples_after_settling(bursts.first().map_or(0, |&(sample, _)| at_us(sample)));
        for &(sample, ref bytes) in *bursts {
            if estimators.channel(index).is_some_and(|estimator| estimator.len() == report.samples) {
                break;
            }
            estimators
                .process(TimedBurst { at_us: at_us(sample), dropped: 0, burst: Some(Burst::from_bytes(bytes)) }, 0);
        }
        estimator.clone_from(estimators.channel(index).expect("a channel"));
    }
    let channel = CHANNELS[index];
    let sums = ChannelSums::from_estimator(&estimator);
    let model = (index < 6).then(|| sums.fit_baseline(channel, ReportScale::new(config, hello.measured_rate_hz)));
    sums.report(channel, model.as_ref(), None)
}
