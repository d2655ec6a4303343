//! The bench: drives the console of a device through the checklist of docs/bench.md and says what passes, what fails, and what is probably
//! wrong. Pages and tables are those of the ADIS16400/ADIS16405 data sheet, Rev. B.

mod verdicts;

use link::{DecoderCounters, Health, Hello, Message, RawMessage, Received};
use recordings::Printable;
use recordings::serial::SerialLink;
use std::io::{self, Read, Write};
use std::time::{Duration, Instant};

pub use verdicts::{Cause, Check, checks};

/// Reads of PROD_ID that the device makes at one command.
const READS_AT_ONCE: u32 = 10_000;
/// Time for which one of two ports is listened to.
const TURN: Duration = Duration::from_millis(1);

/// How much is measured.
#[derive(Debug, Clone, Copy)]
pub struct BenchPlan {
    /// Reads of PROD_ID.
    pub reads: u32,
    /// Time for which the noise is measured without and with a filter, s each.
    pub noise_s: f64,
    /// Time for which the bursts are counted, s.
    pub bursts_s: f64,
}

impl Default for BenchPlan {
    /// A million reads and a minute of bursts: two minutes in all.
    fn default() -> Self {
        Self { reads: 1_000_000, noise_s: 4.0, bursts_s: 60.0 }
    }
}

/// What a step asks for.
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
    /// The bursts that are counted.
    Bursts,
    /// The report on them.
    BurstReport,
}

/// When a step has its answer; it ends after its time in any case.
#[derive(Debug, Clone, Copy)]
enum Answered {
    /// With a line or a log message that begins with one of these.
    By(&'static [&'static str]),
    /// With the last message of a report.
    ByReport,
    /// Only after its time.
    AfterItsTime,
}

/// A command and the longest time for its answer.
#[derive(Debug, Clone)]
pub struct Step {
    /// The line to send.
    pub command: String,
    /// Longest time for the answer, s.
    pub seconds: f64,
    topic: Topic,
    answered: Answered,
    /// Left out if the sensor does not answer: there is nothing to measure.
    needs_sensor: bool,
}

/// What has been received after a command.
#[derive(Debug)]
struct Answer {
    topic: Topic,
    received: Vec<Received>,
}

/// All answers, and the state of the link after them.
#[derive(Debug, Default)]
pub struct Transcript {
    answers: Vec<Answer>,
    /// Of the decoder of the link.
    pub counters: DecoderCounters,
    /// What came on a second port while the bursts were counted.
    pub second_port: Option<Vec<Received>>,
}

/// Patterns that are written to a register of 16 bits and read back, the last of them its reset value.
const PATTERNS: [u16; 5] = [0x5555, 0xAAAA, 0xFF00, 0x00FF, 0x0000];

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
            step(Topic::Measurement, "measure", 2.0, Answered::By(&["DRDY: high for", "DRDY: no pulse"]), false),
            step(Topic::BurstReport, "r", 15.0, Answered::ByReport, true),
        ]);
        steps
    }
}

impl Step {
    /// Whether `received` is the end of the answer.
    fn is_answered_by(&self, received: &Received) -> bool {
        match (self.answered, received) {
            (Answered::By(starts), received) => {
                text(received).is_some_and(|line| starts.iter().any(|start| line.starts_with(start)))
            }
            (Answered::ByReport, Received::Message { message: Message::Health(_), .. }) => true,
            _ => false,
        }
    }
}

/// A device to which commands are sent.
pub trait Console {
    /// Sends a command.
    ///
    /// # Errors
    /// The port fails.
    fn send(&mut self, command: &str) -> io::Result<()>;
    /// Time since the console was opened, s.
    fn now_s(&self) -> f64;
    /// The next message or line; `None` at this time, or if the device has hung up.
    ///
    /// # Errors
    /// The port fails.
    fn next(&mut self, until_s: f64) -> io::Result<Option<Received>>;
    /// Of the decoder.
    fn counters(&self) -> DecoderCounters;
    /// What has come on a second port since the last call; `None` without one.
    fn second_port(&mut self) -> Option<Vec<Received>> {
        None
    }
}

/// A device on one or two serial ports.
pub struct SerialConsole<P> {
    link: SerialLink<P>,
    /// A port to listen on, and what has come there.
    second: Option<(SerialLink<P>, Vec<Received>)>,
    opened: Instant,
}

impl<P: Read + Write> SerialConsole<P> {
    /// A device on a port, and perhaps on a second one.
    pub fn new(link: SerialLink<P>, second: Option<SerialLink<P>>) -> Self {
        Self { link, second: second.map(|link| (link, Vec::new())), opened: Instant::now() }
    }
}

impl<P: Read + Write> Console for SerialConsole<P> {
    fn send(&mut self, command: &str) -> io::Result<()> {
        self.link.send_command(command)
    }

    fn now_s(&self) -> f64 {
        self.opened.elapsed().as_secs_f64()
    }

    fn next(&mut self, until_s: f64) -> io::Result<Option<Received>> {
        let until = self.opened + Duration::from_secs_f64(until_s);
        let Some((second, heard)) = &mut self.second else { return self.link.next(Some(until)) };
        while Instant::now() < until {
            // Both are read in turn, before the system's buffer of 4 kB is full.
            heard.extend(second.next(Some(Instant::now() + TURN))?);
            if let Some(received) = self.link.next(Some(Instant::now() + TURN))? {
                return Ok(Some(received));
            }
            if self.link.is_disconnected() {
                break;
            }
        }
        Ok(None)
    }

    fn counters(&self) -> DecoderCounters {
        self.link.counters()
    }

    fn second_port(&mut self) -> Option<Vec<Received>> {
        self.second.as_mut().map(|(_, heard)| std::mem::take(heard))
    }
}

/// Goes through the steps, and then sets what it has changed as it was. `progress` is called before each step.
///
/// # Errors
/// The port fails.
pub fn run(
    console: &mut impl Console,
    plan: &BenchPlan,
    mut progress: impl FnMut(&Step, usize, usize),
) -> io::Result<Transcript> {
    let steps = plan.steps();
    let mut transcript = Transcript::default();
    for (index, step) in steps.iter().enumerate() {
        if step.topic == Topic::Reads && verdicts::reads_are_wrong(&transcript)
            || step.needs_sensor && verdicts::is_deaf(&transcript)
        {
            continue;
        }
        progress(step, index, steps.len());
        if step.topic == Topic::Bursts {
            console.second_port();
        }
        let received = ask(console, step)?;
        if step.topic == Topic::Bursts {
            transcript.second_port = console.second_port();
        }
        transcript.push(step, received);
        if transcript.is_silent() {
            break;
        }
    }
    transcript.counters = console.counters();
    for command in transcript.settings_before() {
        console.send(&command)?;
        // The device takes some bytes at a time.
        let until_s = console.now_s() + 0.5;
        while console.next(until_s)?.is_some() {}
    }
    Ok(transcript)
}

/// Writes a row for each check, and then what is probably wrong.
///
/// # Errors
/// `out` cannot be written.
pub fn write_table(checks: &[Check], out: &mut impl Write) -> io::Result<()> {
    let width = |text: fn(&Check) -> &str| checks.iter().map(|check| text(check).chars().count()).max().unwrap_or(0);
    let (names, figures) = (width(|check| check.name).max(5), width(|check| check.measured.as_str()).max(8));
    writeln!(out, "      {:<names$}  {:<figures$}  limit", "check", "measured")?;
    for Check { name, measured, limit, cause } in checks {
        let verdict = match (cause, measured.is_empty()) {
            (Some(_), _) => "FAIL",
            (None, true) => "-",
            (None, false) => "pass",
        };
        let measured = Printable(measured).to_string();
        writeln!(out, "{verdict:<4}  {name:<names$}  {measured:<figures$}  {limit}")?;
    }
    let mut causes: Vec<&Cause> = Vec::new();
    for cause in checks.iter().filter_map(|check| check.cause.as_ref()) {
        if !causes.contains(&cause) {
            causes.push(cause);
        }
    }
    if !causes.is_empty() {
        writeln!(out, "\nProbably; begin with the first, from which others may follow:")?;
    }
    causes.iter().enumerate().try_for_each(|(index, cause)| writeln!(out, "{}. {cause}", index + 1))
}

/// Sends a command and receives until the answer is whole or its time is over.
fn ask(console: &mut impl Console, step: &Step) -> io::Result<Vec<Received>> {
    let until_s = console.now_s() + step.seconds;
    console.send(&step.command)?;
    let mut answer = Vec::new();
    while let Some(received) = console.next(until_s)? {
        let is_last = step.is_answered_by(&received);
        answer.push(received);
        if is_last {
            break;
        }
    }
    Ok(answer)
}

impl Transcript {
    /// Adds what was received after a step.
    pub fn push(&mut self, step: &Step, received: Vec<Received>) {
        self.answers.push(Answer { topic: step.topic, received });
    }

    /// Whether nothing has come.
    pub(crate) fn is_silent(&self) -> bool {
        self.answers.iter().all(|answer| answer.received.is_empty())
    }

    fn received(&self, topic: Topic) -> impl Iterator<Item = &Received> {
        self.answers.iter().filter(move |answer| answer.topic == topic).flat_map(|answer| &answer.received)
    }

    /// Lines of text, and log messages, on a topic.
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

    /// Commands that set rate, range, filter and reports as they were.
    fn settings_before(&self) -> Vec<String> {
        let Some(hello) = self.hello(Topic::Report) else { return Vec::new() };
        vec![
            format!("g {}", hello.gyro_full_scale),
            format!("n {}", hello.filter_taps_log2),
            format!("f {:.3}", hello.sample_rate_hz),
            "i 10".to_owned(),
        ]
    }
}

/// A line of text or a log message.
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
