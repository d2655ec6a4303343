//! Steps of the bench, and the answers to them.

use link::{DecoderCounters, Health, Hello, Message, RawMessage, Received};

/// Reads of PROD_ID that the device makes per command.
const READS_AT_ONCE: u32 = 10_000;

/// The extent of the measurements.
#[derive(Debug, Clone, Copy)]
pub struct BenchPlan {
    /// Number of reads of PROD_ID.
    pub reads: u32,
    /// Time for which the noise is measured without and with a filter, s each.
    pub noise_s: f64,
    /// Time for which the bursts are counted, s.
    pub bursts_s: f64,
}

impl Default for BenchPlan {
    /// The default takes two minutes: a million reads and a minute of bursts.
    fn default() -> Self {
        Self { reads: 1_000_000, noise_s: 4.0, bursts_s: 60.0 }
    }
}

/// Subject of a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Topic {
    Version,
    Setting,
    Report,
    Identity,
    OtherRegister,
    Reads,
    Pattern(u16),
    SelfTest,
    Measurement,
    Deflections,
    /// Raw bursts without a filter.
    Unfiltered,
    /// Raw bursts behind averages of 16 samples.
    Filtered,
    /// Bursts that are counted.
    Bursts,
    /// The report on the counted bursts.
    BurstReport,
}

/// The event that completes the answer to a step; a step ends after its time in any case.
#[derive(Debug, Clone, Copy)]
enum Answered {
    /// The answer ends with a line or a log message that begins with one of these.
    By(&'static [&'static str]),
    /// The answer ends with the last message of a report.
    ByReport,
    /// The answer ends only after its time.
    AfterItsTime,
}

/// A command and the longest time for its answer.
#[derive(Debug, Clone)]
pub struct Step {
    /// The line to send.
    pub command: String,
    /// Longest time for the answer, s.
    pub seconds: f64,
    pub(super) topic: Topic,
    answered: Answered,
    /// True if the step is left out when the sensor does not answer.
    pub(super) needs_sensor: bool,
}

/// Messages and lines after a command.
#[derive(Debug)]
struct Answer {
    topic: Topic,
    received: Vec<Received>,
}

/// All answers, and the state of the link after them.
#[derive(Debug, Default)]
pub struct Transcript {
    answers: Vec<Answer>,
    /// The decoder's counts during the run.
    pub counters: DecoderCounters,
    /// Messages of a second port while the bursts were counted.
    pub second_port: Option<Vec<Received>>,
}

/// Patterns that are written to a 16-bit register and read back; the last one is its reset value.
pub(super) const PATTERNS: [u16; 5] = [0x5555, 0xAAAA, 0xFF00, 0x00FF, 0x0000];

impl BenchPlan {
    /// The steps, in order.
    #[must_use]
    pub fn steps(&self) -> Vec<Step> {
        let step = |topic, command: &str, seconds, answered, needs_sensor| Step {
            command: command.to_owned(),
            seconds,
            topic,
            answered,
            needs_sensor,
        };
        let setting = |command, answer| step(Topic::Setting, command, 1.0, Answered::By(answer), false);
        let raw = |topic, seconds| step(topic, "w 1", seconds, Answered::AfterItsTime, true);
        let configure = |command| step(Topic::Setting, command, 1.5, Answered::By(&["sensor: "]), true);
        let silence = || setting("w 0", &["stream of raw bursts off"]);
        let mut steps = vec![
            step(Topic::Version, "v", 2.0, Answered::By(&["ADIS16405 noise observatory"]), false),
            setting("i 0", &["reports every 0 s"]),
            silence(),
            setting("clear", &["statistics reset"]),
            step(Topic::Report, "r", 15.0, Answered::ByReport, false),
            step(Topic::Identity, "peek prod_id", 1.0, Answered::By(&["PROD_ID"]), false),
            step(Topic::OtherRegister, "peek smpl_prd", 1.0, Answered::By(&["SMPL_PRD"]), false),
        ];
        let reads = step(Topic::Reads, "compare prod_id", 3.0, Answered::By(&["PROD_ID"]), false);
        steps.extend(std::iter::repeat_n(reads, self.reads.div_ceil(READS_AT_ONCE) as usize));
        steps.extend(PATTERNS.map(|pattern| {
            let command = format!("poke alm_mag1 {pattern:04x}");
            step(Topic::Pattern(pattern), &command, 1.0, Answered::By(&["ALM_MAG1"]), true)
        }));
        steps.extend([
            configure("g 300"),
            configure("n 0"),
            configure("f 819.2"),
            step(Topic::SelfTest, "check", 2.0, Answered::By(&["check: "]), true),
            step(Topic::Deflections, "deflect", 2.0, Answered::By(&["negative "]), true),
            raw(Topic::Unfiltered, self.noise_s),
            silence(),
            configure("n 4"),
            raw(Topic::Filtered, self.noise_s),
            silence(),
            configure("n 0"),
            configure("f 204.8"),
            setting("clear", &["statistics reset"]),
            raw(Topic::Bursts, self.bursts_s),
            silence(),
            step(Topic::BurstReport, "r", 15.0, Answered::ByReport, true),
            // This step follows the report, which would count the samples lost during it.
            step(Topic::Measurement, "measure", 2.0, Answered::By(&["DRDY: high for", "DRDY: no pulse"]), false),
        ]);
        steps
    }
}

impl Step {
    /// True for the step that counts bursts, which a second port must receive too.
    #[must_use]
    pub fn counts_bursts(&self) -> bool {
        self.topic == Topic::Bursts
    }

    /// True if this is the end of the answer.
    pub(super) fn is_answered_by(&self, received: &Received) -> bool {
        match (self.answered, received) {
            (Answered::By(starts), received) => {
                text(received).is_some_and(|line| starts.iter().any(|start| line.starts_with(start)))
            }
            (Answered::ByReport, Received::Message { message: Message::Health(_), .. }) => true,
            _ => false,
        }
    }
}

impl Transcript {
    /// Adds what was received after a step.
    pub fn push(&mut self, step: &Step, received: Vec<Received>) {
        self.answers.push(Answer { topic: step.topic, received });
    }

    /// True if nothing was received.
    pub(crate) fn is_silent(&self) -> bool {
        self.answers.iter().all(|answer| answer.received.is_empty())
    }

    fn received(&self, topic: Topic) -> impl Iterator<Item = &Received> {
        self.answers.iter().filter(move |answer| answer.topic == topic).flat_map(|answer| &answer.received)
    }

    /// Lines of text, and log messages, of a topic.
    pub(crate) fn lines(&self, topic: Topic) -> impl Iterator<Item = &str> {
        self.received(topic).filter_map(text)
    }

    pub(crate) fn hello(&self, topic: Topic) -> Option<&Hello> {
        self.received(topic).find_map(|received| match received {
            Received::Message { message: Message::Hello(hello), .. } => Some(hello),
            _ => None,
        })
    }

    pub(crate) fn health(&self, topic: Topic) -> Option<&Health> {
        self.received(topic).find_map(|received| match received {
            Received::Message { message: Message::Health(health), .. } => Some(health),
            _ => None,
        })
    }

    pub(crate) fn raw(&self, topic: Topic) -> impl Iterator<Item = &RawMessage> {
        raw_messages(self.received(topic))
    }

    /// Commands that restore rate, range, filter and reports.
    #[must_use]
    pub fn settings_before(&self) -> Vec<String> {
        let Some(hello) = self.hello(Topic::Report) else { return Vec::new() };
        vec![
            format!("g {}", hello.gyro_full_scale),
            format!("n {}", hello.filter_taps_log2),
            format!("f {:.3}", hello.sample_rate_hz),
            "i 10".to_owned(),
        ]
    }
}

/// The text of a line or of a log message.
fn text(received: &Received) -> Option<&str> {
    match received {
        Received::Text(line) => Some(line.as_str()),
        Received::Message { message: Message::Log(line), .. } => Some(line.as_str()),
        Received::Message { .. } => None,
    }
}

/// The messages of the raw stream.
pub(crate) fn raw_messages<'a>(received: impl Iterator<Item = &'a Received>) -> impl Iterator<Item = &'a RawMessage> {
    received.filter_map(|received| match received {
        Received::Message { message: Message::Raw(raw), .. } => Some(raw),
        _ => None,
    })
}
