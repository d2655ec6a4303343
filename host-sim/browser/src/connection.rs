//! A device that the page has opened by Web Serial: its live view, its lines, and the steps of the bench.

use anyhow::{Context, Result};
use link::{Decoder, Message, Received};
use observatory::bench::{self, BenchPlan, BenchRun};
use observatory::latest_messages::LatestMessages;
use observatory::message_text::MessageFormatter;
use reports::page;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// An open port.
#[derive(Default)]
pub(crate) struct Connection {
    decoder: Decoder,
    messages: LatestMessages,
    formatter: MessageFormatter,
    bench: Option<BenchRun>,
}

/// Request that accompanies bytes of the device.
#[derive(Deserialize)]
pub(crate) struct ReceiveRequest {
    /// Time since the last byte was received, s.
    silence_s: f64,
}

/// The results of received bytes.
#[derive(Serialize)]
struct ReceivedParts {
    /// The live view.
    html: String,
    lines: Vec<String>,
    /// Number of bursts of the raw stream.
    bursts: usize,
    /// True if the answer to the step of the bench is complete.
    is_answered: bool,
}

/// The next step of the bench, or its end.
#[derive(Serialize)]
#[serde(untagged)]
enum BenchStep {
    Ask {
        command: String,
        seconds: f64,
        position: usize,
        steps: usize,
    },
    /// The end: the settings to restore one after the other, each followed by a pause.
    End {
        table: String,
        restore: Vec<String>,
        pause_s: f64,
    },
}

impl Connection {
    /// A connection to the device on the port `name`.
    pub(crate) fn new(name: String) -> Self {
        Self { messages: LatestMessages::new(name), ..Self::default() }
    }

    /// Processes bytes of the device.
    pub(crate) fn receive(&mut self, bytes: &[u8], ReceiveRequest { silence_s }: &ReceiveRequest) -> Result<String> {
        let mut parts = ReceivedParts { html: String::new(), lines: Vec::new(), bursts: 0, is_answered: false };
        for received in bytes.iter().filter_map(|byte| self.decoder.push(*byte)) {
            match &received {
                Received::Message { message: Message::Raw(raw), .. } => parts.bursts += raw.bursts.len(),
                received => parts.lines.extend(self.formatter.lines(received)),
            }
            if let Some(bench) = &mut self.bench {
                parts.is_answered |= bench.take(received.clone());
            }
            self.messages.take(received);
        }
        let silence = Duration::try_from_secs_f64(*silence_s).unwrap_or_default();
        parts.html = page::live(&self.messages.view(silence, &self.decoder.counters()));
        Ok(serde_json::to_string(&parts)?)
    }

    /// Starts the bench.
    pub(crate) fn begin_bench(&mut self) {
        self.bench = Some(BenchRun::new(&BenchPlan::default(), self.decoder.counters()));
    }

    /// The next step, or the table after the last one.
    pub(crate) fn step(&mut self) -> Result<String> {
        let bench = self.bench.as_mut().context("no bench")?;
        let step = match bench.begin_step() {
            Some((position, step)) => {
                let steps = bench.steps();
                BenchStep::Ask { command: step.command, seconds: step.seconds, position, steps }
            }
            None => {
                let transcript = self.bench.take().context("no bench")?.finish(self.decoder.counters());
                let mut table = Vec::new();
                bench::write_table(&bench::checks(&transcript), &mut table)?;
                let (table, restore) = (String::from_utf8(table)?, transcript.settings_before());
                BenchStep::End { table, restore, pause_s: bench::SETTING_S }
            }
        };
        Ok(serde_json::to_string(&step)?)
    }
}
