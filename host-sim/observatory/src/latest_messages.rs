//! The live view of a device from its messages, in the words of the host's reports.

use crate::message_text;
use adis16405_driver::{Channel, GyroRange};
use link::{
    ChannelMessage, DecoderCounters, Health, Hello, LearnedMessage, Message, Received, ReportedAddedTerm,
    ReportedParameter, ReportedRegressor, ReportedTerm, ValidationMessage,
};
use measurement::{SensorProfile, adis16405};
use noise_analysis::bounds::BoundedEstimate;
use noise_analysis::distributions::NORMAL_975;
use noise_analysis::effects::{
    AccelerationSensitivity, AngleQuantization, CurveEvidence, Effect, LineEvidence, LineSource, LinearDrift,
    LinearDriftEvidence, MarkovEvidence, MarkovProcess, OutputFilter, ResonantLine, SinusoidalLine, SupplySensitivity,
    TemperatureSensitivity,
};
use noise_analysis::report::{Finding, Parameter, Validation};
use recordings::Printable;
use reports::finding_text;
use reports::formatting::count;
use reports::live::{LiveCurve, LiveView};
use reports::rounding::{plain, span};
use reports::summary::{ChannelCoefficients, tables_of_channels};
use std::collections::BTreeMap;
use std::time::Duration;

/// Relative difference of frequencies below which two lines of different channels are one finding, as in the device's table.
const SAME_FREQUENCY: f64 = 0.02;

/// The latest messages; those about channels by the channel's position in the burst.
#[derive(Debug, Default)]
pub struct LatestMessages {
    /// Name of the port.
    name: String,
    hello: Option<Hello>,
    health: Option<Health>,
    channels: BTreeMap<u8, ChannelMessage>,
    learned: BTreeMap<u8, LearnedMessage>,
    validations: BTreeMap<u8, ValidationMessage>,
    /// The latest line of text.
    text: String,
    /// The reason for which the sensor is not sampled.
    trouble: Option<String>,
}

impl LatestMessages {
    /// No messages yet, of the device on the port `name`.
    #[must_use]
    pub fn new(name: String) -> Self {
        Self { name, ..Self::default() }
    }

    /// Takes a received message or line.
    pub fn take(&mut self, received: Received) {
        let message = match received {
            Received::Text(line) => return self.take_text(&line),
            Received::Message { message, .. } => message,
        };
        match message {
            Message::Hello(hello) => {
                if self.hello.as_ref().is_some_and(|before| hello.epoch < before.epoch) {
                    self.learned.clear(); // the device restarted without its models
                    self.validations.clear();
                }
                self.hello = Some(hello);
            }
            Message::Channel(report) => drop(self.channels.insert(report.channel, report)),
            Message::Health(health) => self.health = Some(health),
            Message::Validation(report) => drop(self.validations.insert(report.channel, report)),
            Message::Learned(report) => drop(self.learned.insert(report.channel, report)),
            Message::Log(line) => self.take_text(&line),
            Message::Raw(_) => {}
        }
    }

    fn take_text(&mut self, line: &str) {
        self.text = Printable(line).to_string();
        if let Some(said) = self.text.strip_prefix("sensor: ") {
            let is_found = said.starts_with("ADIS") || said.starts_with("DIAG_STAT");
            self.trouble = (!is_found).then(|| said.to_owned());
        }
    }

    /// The live view after `silence` without a message, with the counters of the decoder.
    #[must_use]
    pub fn view(&self, silence: Duration, link: &DecoderCounters) -> LiveView {
        let (mut view, name) = (self.report(), &self.name);
        view.health += &format!(" Link: {}.", message_text::summary(link));
        if silence >= message_text::LONG_SILENCE {
            view.headline = format!("{name}   Nothing received for {} s", silence.as_secs());
            view.sentences = format!("Probably {}.", message_text::SILENCE);
        } else if let Some(trouble) = &self.trouble {
            view.headline = format!("{name}   The sensor is not sampled: {trouble}");
            view.sentences = "Its wires or its supply: the bench says which.".to_owned();
        }
        view
    }

    /// The latest report.
    fn report(&self) -> LiveView {
        let Some(hello) = &self.hello else {
            return LiveView {
                headline: self.name.clone(),
                sentences: "The device has not reported yet; it does every ten seconds, or at the key r.".to_owned(),
                status: self.text.clone(),
                ..LiveView::default()
            };
        };
        let first = self.channels.values().find(|report| report.channel == Channel::GyroX as u8);
        let samples = first.map_or(0, |report| report.samples);
        let length = span(samples.saturating_add(first.map_or(0, |report| report.missing)) as f64 / rate_hz(hello));
        let rate = plain(hello.sample_rate_hz, 4);
        let epoch = match hello.epoch_s {
            0 => "The epoch has no end: no model is learned. e 3600 makes epochs of an hour.".to_owned(),
            length => format!("Epoch {} of {}.", hello.epoch, span(f64::from(length))),
        };
        let lost = match first.map_or(0, |report| report.lost) {
            0 => "No sample lost.".to_owned(),
            lost => format!("{} samples lost.", count(lost)),
        };
        let measured =
            hello.measured_rate_hz.map_or_else(String::new, |hz| format!(" Measured rate {} Hz.", plain(hz, 6)));
        let findings = self.findings(1.0 / hello.sample_rate_hz);
        let mut advice: Vec<String> = Vec::new();
        for step in findings.iter().filter_map(|finding| finding_text::describe(finding, &[]).step) {
            if !advice.contains(&step) {
                advice.push(step);
            }
        }
        LiveView {
            headline: format!(
                "ADIS{}   {}   {} samples   {length} at {rate} Hz",
                hello.product_id,
                self.name,
                count(samples)
            ),
            sentences: format!("{lost} {epoch}{measured}"),
            tables: tables_of_channels(&self.coefficients(), rate_hz(hello)),
            curves: self.channels.values().filter_map(|report| curve(report, hello)).collect(),
            findings: findings.iter().map(|finding| finding_text::describe(finding, &[])).collect(),
            unexplained: Vec::new(),
            advice,
            health: self
                .health
                .as_ref()
                .map_or_else(String::new, |health| format!("Health: {}.", message_text::health_text(health))),
            status: self.text.clone(),
        }
    }

    fn coefficients(&self) -> Vec<ChannelCoefficients> {
        let inertial = |report: &ChannelMessage| {
            let channel = channel_at(report.channel).filter(|channel| Channel::INERTIAL.contains(channel))?;
            let of = |term: ReportedTerm| {
                let found = report.coefficients.iter().find(|coefficient| coefficient.term == term)?;
                Some(Parameter::new(found.value, found.low, found.high, channel.unit()))
            };
            let validation = self.validations.get(&report.channel);
            let errors = validation.map_or([None, None], |report| [report.before, report.after]);
            Some(ChannelCoefficients {
                name: channel.name().to_owned(),
                unit: channel.unit().to_owned(),
                coefficients: [
                    of(ReportedTerm::AngleRandomWalk),
                    of(ReportedTerm::BiasInstability),
                    of(ReportedTerm::RateRandomWalk),
                ],
                rms_percent: errors.map(|error| error.map(|error| error.rms_percent)),
                deviance: errors[1].map(|error| error.deviance_per_point),
            })
        };
        self.channels.values().filter_map(inertial).collect()
    }

    /// Terms beyond N, B and K of channels sampled every `period_s` s. Equal terms of several channels are one finding.
    fn findings(&self, period_s: f64) -> Vec<Finding> {
        let mut findings: Vec<Finding> = Vec::new();
        for report in self.learned.values() {
            let Some(channel) = channel_at(report.channel) else { continue };
            let causes = report.regressors.iter().filter_map(|regressor| of_regressor(channel, regressor));
            let terms = report.added_terms.iter().filter_map(|term| of_term(channel, term, period_s));
            for effect in causes.chain(terms) {
                let name = channel.name().to_owned();
                match findings.iter_mut().find(|earlier| is_shared(&earlier.effect, &effect)) {
                    Some(earlier) => earlier.channels.push(name),
                    None => findings.push(Finding {
                        effect,
                        channels: vec![name],
                        clearest: 0,
                        validated: Validation::Untestable,
                        share_percent: BTreeMap::new(),
                        minute_percent: BTreeMap::new(),
                    }),
                }
            }
        }
        findings
    }
}

fn channel_at(position: u8) -> Option<Channel> {
    Channel::ALL.get(usize::from(position)).copied()
}

/// The sample rate that a report uses.
fn rate_hz(hello: &Hello) -> f64 {
    hello.measured_rate_hz.unwrap_or(hello.sample_rate_hz)
}

/// The Allan deviation of a channel in its unit; `None` for temperature and supply.
fn curve(report: &ChannelMessage, hello: &Hello) -> Option<LiveCurve> {
    let channel = channel_at(report.channel).filter(|channel| Channel::INERTIAL.contains(channel))?;
    let range = match hello.gyro_full_scale {
        75 => GyroRange::Dps75,
        150 => GyroRange::Dps150,
        _ => GyroRange::Dps300,
    };
    let point = |octave: &link::ReportedOctave| {
        let n = octave.n as f64;
        let variance = octave.sum as f64 / (2.0 * n * n * octave.count as f64) - f64::from(octave.interpolation);
        (n / rate_hz(hello), channel.lsb(range) * variance.max(0.0).sqrt())
    };
    let points = report.octaves.iter().map(point).collect();
    Some(LiveCurve { channel: channel.name().to_owned(), unit: channel.unit().to_owned(), points })
}

fn of_regressor(channel: Channel, regressor: &ReportedRegressor) -> Option<Effect> {
    let &ReportedRegressor { value, low, high, .. } = regressor;
    let sensitivity = BoundedEstimate::new(value, low, high).in_unit(channel.unit());
    let sigmas = 2.0 * NORMAL_975 * value.abs() / (high - low);
    let along = |axis: usize| {
        let sensitivity = std::array::from_fn(|of| (of == axis).then_some(sensitivity));
        Effect::from(AccelerationSensitivity { sensitivity, sigmas })
    };
    match channel_at(regressor.covariate)? {
        Channel::Temp => Some(TemperatureSensitivity { sensitivity, sigmas }.into()),
        Channel::Supply => Some(SupplySensitivity { sensitivity, sigmas }.into()),
        Channel::AcclX => Some(along(0)),
        Channel::AcclY => Some(along(1)),
        Channel::AcclZ => Some(along(2)),
        _ => None,
    }
}

/// The effect of a term in the model of a channel that is sampled every `period_s` s.
fn of_term(channel: Channel, added: &ReportedAddedTerm, period_s: f64) -> Option<Effect> {
    let of = &added.coefficient;
    let size = BoundedEstimate::new(of.value, of.low, of.high).in_unit(channel.unit());
    let shape = |index: usize| {
        let ReportedParameter { value, low, high } = *added.shape.get(index)?;
        Some(BoundedEstimate::new(value, low, high))
    };
    let curve = CurveEvidence {
        excess: added.excess,
        tau_s: added.n as f64 * period_s,
        sigmas: added.sigmas,
        gain_sigmas: added.score.sqrt(),
    };
    let line = |has_width: bool| LineEvidence { has_width, source: LineSource::Curve(curve) };
    let SensorProfile { internal_rate_hz, ref filters, .. } = adis16405::profile(Channel::GyroX.lsb(GyroRange::Dps300));
    Some(match of.term {
        ReportedTerm::Quantization => AngleQuantization { coefficient: size, evidence: curve }.into(),
        ReportedTerm::RateRamp => LinearDrift { slope: size, evidence: LinearDriftEvidence::Curve(curve) }.into(),
        ReportedTerm::Filtered => OutputFilter {
            taps: shape(0)?,
            decimation: shape(1)?,
            white_noise: size,
            stages: filters.first().map_or(0, |filter| filter.stages),
            internal_rate_hz,
            evidence: curve,
        }
        .into(),
        ReportedTerm::Markov => {
            let evidence = MarkovEvidence::Curve(curve);
            MarkovProcess { deviation: size, time_constant_s: shape(0)?, evidence }.into()
        }
        ReportedTerm::Resonance => ResonantLine {
            frequency_hz: shape(0)?,
            bandwidth_hz: shape(1)?,
            deviation: size,
            multiples: None,
            evidence: line(true),
        }
        .into(),
        ReportedTerm::Sinusoid => {
            SinusoidalLine { frequency_hz: shape(0)?, amplitude: size, multiples: None, evidence: line(false) }.into()
        }
        ReportedTerm::AngleRandomWalk | ReportedTerm::BiasInstability | ReportedTerm::RateRandomWalk => return None,
    })
}

/// True if two effects have one cause: the part's filter, or lines at one frequency.
fn is_shared(one: &Effect, other: &Effect) -> bool {
    let is_near =
        |one: BoundedEstimate, other: BoundedEstimate| (one.value - other.value).abs() <= SAME_FREQUENCY * one.value;
    match (one, other) {
        (Effect::OutputFilter(one), Effect::OutputFilter(other)) => one.taps.value == other.taps.value,
        (Effect::SinusoidalLine(one), Effect::SinusoidalLine(other)) => is_near(one.frequency_hz, other.frequency_hz),
        (Effect::ResonantLine(one), Effect::ResonantLine(other)) => is_near(one.frequency_hz, other.frequency_hz),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use link::Decoder;
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;
    use reports::live::CurveGroup;

    /// Silence of a quarter of a minute, or what the device reports about a lost sensor, is the headline until the sensor is found.
    #[test]
    fn silence_and_a_lost_sensor_are_the_headline() {
        let mut messages = LatestMessages { name: "/dev/ttyACM0".to_owned(), ..LatestMessages::default() };
        let shown = |messages: &LatestMessages, seconds| {
            let view = messages.view(Duration::from_secs(seconds), &DecoderCounters::default());
            format!("{}. {}", view.headline, view.sentences)
        };
        assert!(shown(&messages, 14).contains("has not reported yet"));
        let silent = shown(&messages, 15);
        assert!(silent.contains("Nothing received for 15 s") && silent.contains("`bench`"), "{silent}");
        let log = |text: &str| Received::Text(link::text_line(format_args!("{text}")));
        messages.take(log("sensor: PROD_ID answered 0 (0x0000), not 16405 or 16400; reading again"));
        let lost = shown(&messages, 1);
        assert!(lost.contains("not sampled: PROD_ID answered 0") && lost.contains("the bench says"), "{lost}");
        messages.take(log("sensor: ADIS16405, self-test passed"));
        assert!(shown(&messages, 1).contains("has not reported yet"));
    }

    /// One message of each kind, with all its fields.
    const KEPT: &[u8] = include_bytes!("../../../firmware/link/tests/kept_stream/version-4-mixed-alarm.bin");
    const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

    /// Decodes a message; one about a channel is made that of gyro x, whose samples and losses are shown.
    fn received(body: &[u8]) -> Option<Received> {
        let content = [body, &CRC.checksum(body).to_le_bytes()].concat();
        let mut decoder = Decoder::new();
        let bytes = [&[0], cobs::encode_vec(&content).as_slice(), &[0]].concat();
        let mut received = bytes.into_iter().filter_map(|byte| decoder.push(byte)).next();
        if let Some(Received::Message { message: Message::Channel(report), .. }) = &mut received {
            report.channel = Channel::GyroX as u8;
        }
        received
    }

    /// A device may send any number, including NaN, and the largest integers. At every place of every message, eight bytes are replaced by
    /// such a number, or an integer of any length by the largest one (LEB128), with a matching checksum.
    #[test]
    fn any_number_of_a_device_is_shown() {
        let bodies = KEPT.split(|byte| *byte == 0).filter(|frame| !frame.is_empty()).map(|frame| {
            let mut content = frame.to_vec();
            let length = cobs::decode_in_place(&mut content).expect("COBS") - 4;
            content.truncate(length);
            content
        });
        let bodies: Vec<Vec<u8>> = bodies.collect();
        let numbers = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX, -f64::MAX, 5e-324, 0.0];
        let largest = |bits: u32| [vec![0xFF; bits as usize / 7], vec![(1 << (bits % 7)) - 1]].concat();
        let integer = |of: &[u8]| of.iter().position(|byte| *byte < 0x80).map_or(of.len(), |last| last + 1);
        let mut terminal = Terminal::new(TestBackend::new(80, 24)).expect("a terminal in memory");
        let (mut taken, mut drawn) = (0, 0);
        for (changed, body) in bodies.iter().enumerate() {
            for at in 2..body.len() {
                let (before, after) = body.split_at(at);
                let with = |new: &[u8], old: usize| [before, new, &after[old..]].concat();
                let floats = numbers.iter().filter(|_| after.len() >= 8).map(|number| with(&number.to_le_bytes(), 8));
                let integers = [16, 32, 64].into_iter().map(|bits| with(&largest(bits), integer(after)));
                for hostile in floats.chain(integers).filter_map(|body| received(&body)) {
                    let mut messages = LatestMessages::default();
                    let of_kind =
                        bodies.iter().enumerate().map(|(index, body)| (index != changed).then(|| received(body)));
                    for message in of_kind.flatten().flatten().chain([hostile]) {
                        messages.take(message);
                    }
                    let view = messages.view(Duration::ZERO, &DecoderCounters::default());
                    taken += 1;
                    // Drawing is a hundred times as slow, so not every view is drawn.
                    if taken % 16 == 0 {
                        drawn += 1;
                        terminal.draw(|frame| view.draw(frame, CurveGroup::default(), false)).expect("a frame");
                    }
                }
            }
        }
        assert!(taken > 1000 && drawn > 60, "{taken} {drawn}");
    }
}
