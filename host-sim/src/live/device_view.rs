//! A device on a serial port: its reports as the live view, in the words of the host's reports.

use super::LiveSource;
use adis16405_driver::{Channel, GyroRange};
use anyhow::Result;
use host_sim::monitor;
use link::{
    ChannelMessage, Health, Hello, LearnedMessage, Message, Received, ReportedAddedTerm, ReportedRegressor,
    ReportedTerm, ValidationMessage,
};
use noise_analysis::report::{Finding, Parameter, Validation};
use recordings::Printable;
use recordings::serial::SerialLink;
use reports::finding_text;
use reports::formatting::count;
use reports::live::{LiveCurve, LiveView};
use reports::rounding::{plain, span};
use reports::summary::{ChannelCoefficients, tables_of_channels};
use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::time::Instant;

/// Two lines of different channels whose frequencies differ by less than this share are one finding, as in the device's table.
const SAME_FREQUENCY: f64 = 0.02;

/// A device and the latest of each of its messages.
pub(crate) struct DeviceSource<'a, P> {
    cable: &'a mut SerialLink<P>,
    messages: LatestMessages,
}

impl<'a, P: Read + Write> DeviceSource<'a, P> {
    /// The device at the other end of `cable`, which is called `name`.
    pub(crate) fn new(cable: &'a mut SerialLink<P>, name: String) -> Self {
        Self { cable, messages: LatestMessages { name, ..LatestMessages::default() } }
    }
}

impl<P: Read + Write> LiveSource for DeviceSource<'_, P> {
    fn advance(&mut self, deadline: Instant) -> Result<bool> {
        while let Some(received) = self.cable.next(Some(deadline))? {
            self.messages.take(received);
        }
        Ok(!self.cable.is_disconnected())
    }

    fn view(&self) -> LiveView {
        let mut view = self.messages.view();
        view.health += &format!(" Link: {}.", monitor::summary(&self.cable.counters()));
        view
    }
}

/// The latest messages, those on channels by the channel's position in the burst.
#[derive(Debug, Default)]
struct LatestMessages {
    name: String,
    hello: Option<Hello>,
    health: Option<Health>,
    channels: BTreeMap<u8, ChannelMessage>,
    learned: BTreeMap<u8, LearnedMessage>,
    validations: BTreeMap<u8, ValidationMessage>,
    /// The last line of text.
    text: String,
}

impl LatestMessages {
    fn take(&mut self, received: Received) {
        let message = match received {
            Received::Text(line) => {
                self.text = Printable(line.as_str()).to_string();
                return;
            }
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
            Message::Log(line) => self.text = Printable(line.as_str()).to_string(),
            Message::Raw(_) => {}
        }
    }

    fn view(&self) -> LiveView {
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
        let length = span((samples + first.map_or(0, |report| report.missing)) as f64 / rate_hz(hello));
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
        let findings = self.findings();
        let mut advice: Vec<String> = Vec::new();
        for finding in &findings {
            let told = finding_text::describe(finding).advice;
            let first =
                told.split_inclusive(['.', ';']).next().unwrap_or_default().trim_end_matches([';', '.']).to_owned();
            if !first.starts_with("Nothing to repair") && !advice.contains(&first) {
                advice.push(first);
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
            findings: findings.iter().map(finding_text::describe).collect(),
            unexplained: None,
            advice,
            health: self
                .health
                .as_ref()
                .map_or_else(String::new, |health| format!("Health: {}.", monitor::health_text(health))),
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
            let deviance = |error: Option<link::ReportedModelError>| error.map(|error| error.deviance_per_point);
            Some(ChannelCoefficients {
                name: channel.name().to_owned(),
                unit: channel.unit().to_owned(),
                coefficients: [
                    of(ReportedTerm::AngleRandomWalk),
                    of(ReportedTerm::BiasInstability),
                    of(ReportedTerm::RateRandomWalk),
                ],
                deviance: [
                    validation.and_then(|report| deviance(report.before)),
                    validation.and_then(|report| deviance(report.after)),
                ],
            })
        };
        self.channels.values().filter_map(inertial).collect()
    }

    /// What the models have beyond N, B and K; what several channels share is one finding.
    fn findings(&self) -> Vec<Finding> {
        let mut findings: Vec<Finding> = Vec::new();
        for report in self.learned.values() {
            let Some(channel) = channel_at(report.channel) else { continue };
            let causes = report.regressors.iter().filter_map(|regressor| of_regressor(channel, regressor));
            let terms = report.added_terms.iter().filter_map(|term| of_term(channel, term));
            for found in causes.chain(terms) {
                match findings.iter_mut().find(|earlier| is_shared(earlier, &found)) {
                    Some(earlier) => earlier.channels.extend(found.channels),
                    None => findings.push(found),
                }
            }
        }
        findings
    }
}

fn channel_at(position: u8) -> Option<Channel> {
    Channel::ALL.get(usize::from(position)).copied()
}

/// The sample rate with which a report was made.
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

fn finding<'a>(channel: Channel, kind: &str, parameters: impl IntoIterator<Item = (&'a str, Parameter)>) -> Finding {
    Finding {
        kind: kind.to_owned(),
        channels: vec![channel.name().to_owned()],
        parameters: parameters.into_iter().map(|(name, parameter)| (name.to_owned(), parameter)).collect(),
        evidence: String::new(),
        validated: Validation::Untestable,
        share_percent: BTreeMap::new(),
    }
}

fn of_regressor(channel: Channel, regressor: &ReportedRegressor) -> Option<Finding> {
    let covariate = channel_at(regressor.covariate)?;
    let (kind, name) = match covariate {
        Channel::Temp => ("temperature", "sensitivity"),
        Channel::Supply => ("supply", "sensitivity"),
        Channel::AcclX => ("acceleration", "sensitivity_x"),
        Channel::AcclY => ("acceleration", "sensitivity_y"),
        Channel::AcclZ => ("acceleration", "sensitivity_z"),
        _ => return None,
    };
    let unit = format!("{}/{}", channel.unit(), covariate.unit());
    Some(finding(channel, kind, [(name, Parameter::new(regressor.value, regressor.low, regressor.high, unit))]))
}

fn of_term(channel: Channel, added: &ReportedAddedTerm) -> Option<Finding> {
    let unit = channel.unit();
    let of = &added.coefficient;
    let size = |unit: String| Parameter::new(of.value, of.low, of.high, unit);
    let shape = |index: usize, unit: &str| {
        added.shape.get(index).map(|shape| Parameter::new(shape.value, shape.low, shape.high, unit))
    };
    let (kind, parameters) = match of.term {
        ReportedTerm::Quantization => ("quantization", vec![("value", Some(size(format!("{unit}*s"))))]),
        ReportedTerm::RateRamp => ("rate_ramp", vec![("slope", Some(size(format!("{unit}/s"))))]),
        ReportedTerm::Filtered => ("filter_bandwidth", vec![("taps", shape(0, "")), ("decimation", shape(1, ""))]),
        ReportedTerm::Markov => {
            ("markov", vec![("deviation", Some(size(unit.to_owned()))), ("time_constant", shape(0, "s"))])
        }
        ReportedTerm::Resonance => (
            "resonance",
            vec![
                ("deviation", Some(size(unit.to_owned()))),
                ("frequency", shape(0, "Hz")),
                ("bandwidth", shape(1, "Hz")),
            ],
        ),
        ReportedTerm::Sinusoid => {
            ("sinusoid", vec![("amplitude", Some(size(unit.to_owned()))), ("frequency", shape(0, "Hz"))])
        }
        ReportedTerm::AngleRandomWalk | ReportedTerm::BiasInstability | ReportedTerm::RateRandomWalk => return None,
    };
    let known = parameters.into_iter().filter_map(|(name, parameter)| Some((name, parameter?)));
    Some(finding(channel, kind, known))
}

/// Whether one cause explains both: the part's filter, or lines at one frequency.
fn is_shared(one: &Finding, other: &Finding) -> bool {
    let value = |of: &Finding, name: &str| of.parameters.get(name).map(|parameter| parameter.value);
    one.kind == other.kind
        && match one.kind.as_str() {
            "filter_bandwidth" => value(one, "taps") == value(other, "taps"),
            "sinusoid" | "resonance" => value(one, "frequency")
                .zip(value(other, "frequency"))
                .is_some_and(|(one, other)| (one - other).abs() <= SAME_FREQUENCY * one),
            _ => false,
        }
}
