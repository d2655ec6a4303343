//! A recording that is replayed at some speed: the analysis is repeated on the part that has been replayed, whenever that has
//! grown by a quarter.

use super::LiveSource;
use anyhow::{Result, anyhow};
use measurement::Measurement;
use noise_analysis::analysis::analyze;
use noise_analysis::report::Report;
use reports::formatting::count;
use reports::live::LiveView;
use reports::rounding::{plain, span};
use reports::summary;
use std::io::{self, Write};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// Length of the first part that is analysed, s, and how much longer the next one is: on the screen, and in lines.
const FIRST_S: f64 = 10.0;
const GROWTH: f64 = 1.25;
const GROWTH_OF_LINES: f64 = 2.0;

/// A recording and how much of it has been replayed.
pub(crate) struct GrowingRecording {
    measurement: Measurement,
    name: String,
    /// Seconds of the recording in a second; infinite for no waiting.
    speed: f64,
    started: Instant,
    /// Sample periods at which the next analysis begins.
    next: u64,
    /// Sample periods in the analysis that is under way, and in the last report.
    under_way: Option<(u64, JoinHandle<Report>)>,
    analyzed: u64,
    report: Option<Report>,
}

impl GrowingRecording {
    /// A replay of `measurement` that starts now.
    pub(crate) fn new(measurement: Measurement, name: String, speed: f64) -> Self {
        let next = (FIRST_S * measurement.sample_rate_hz).ceil() as u64;
        let started = Instant::now();
        Self { measurement, name, speed, started, next, under_way: None, analyzed: 0, report: None }
    }

    /// The last report, if the recording was long enough for one.
    pub(crate) fn into_report(self) -> Option<Report> {
        self.report
    }

    /// Sample periods that have been replayed.
    fn replayed(&self) -> u64 {
        let periods = self.started.elapsed().as_secs_f64() * self.speed * self.measurement.sample_rate_hz;
        // Infinity times no time is no number.
        if periods.is_nan() { self.measurement.periods() } else { (periods as u64).min(self.measurement.periods()) }
    }

    /// Writes a line a channel for every doubling of the replayed part, each when it has been replayed, and returns the report
    /// on the whole.
    ///
    /// # Errors
    /// `out` cannot be written.
    pub(crate) fn write_lines(mut self, until: Option<Instant>, out: &mut impl Write) -> io::Result<Option<Report>> {
        let periods = self.measurement.periods();
        let mut length = self.next.min(periods);
        while until.is_none_or(|until| Instant::now() < until) {
            while self.replayed() < length {
                if until.is_some_and(|until| Instant::now() >= until) {
                    return Ok(self.report);
                }
                thread::sleep(Duration::from_millis(20));
            }
            let report = analyze(&self.measurement.before(length));
            let time = span(length as f64 / self.measurement.sample_rate_hz);
            for table in summary::coefficient_tables(&report) {
                for row in table.rows.iter().filter(|row| !row.channel.is_empty()) {
                    let [n, b, k] = &row.coefficients;
                    let [of_n, of_b, of_k] = &table.units;
                    let (title, axis, error) = (table.title, &row.label, &row.error);
                    writeln!(
                        out,
                        "{time}: {title} {axis}, N {n} {of_n}, B {b} {of_b}, K {k} {of_k}, σ off by {error}"
                    )?;
                }
            }
            writeln!(out, "{time}: {} samples, {} findings", count(report.samples), report.findings.len())?;
            out.flush()?;
            self.report = Some(report);
            if length == periods {
                break;
            }
            length = ((length as f64 * GROWTH_OF_LINES) as u64).min(periods);
        }
        Ok(self.report)
    }

    fn status(&self) -> String {
        let (replayed, periods) = (self.replayed(), self.measurement.periods());
        let length = |periods: u64| span(periods as f64 / self.measurement.sample_rate_hz);
        let speed = if self.speed.is_finite() {
            format!("{} times real time", plain(self.speed, 3))
        } else {
            "no waiting".to_owned()
        };
        let state = match (&self.under_way, replayed == periods && self.analyzed == periods) {
            (_, true) => "end of the recording".to_owned(),
            (Some((periods, _)), _) => format!("analysing {}", length(*periods)),
            (None, _) => speed,
        };
        format!("replayed {} of {}, {state}", length(replayed), length(periods))
    }
}

impl LiveSource for GrowingRecording {
    fn advance(&mut self, deadline: Instant) -> Result<bool> {
        if let Some((periods, analysis)) = self.under_way.take() {
            if analysis.is_finished() {
                let report = analysis.join().map_err(|_| anyhow!("the analysis of {periods} sample periods failed"))?;
                (self.analyzed, self.report) = (periods, Some(report));
            } else {
                self.under_way = Some((periods, analysis));
            }
        }
        let (replayed, periods) = (self.replayed(), self.measurement.periods());
        let is_due = replayed >= self.next || (replayed == periods && self.analyzed < periods);
        if self.under_way.is_none() && is_due {
            let part = self.measurement.before(replayed);
            self.under_way = Some((replayed, thread::spawn(move || analyze(&part))));
            self.next = (replayed as f64 * GROWTH).ceil() as u64;
        }
        thread::sleep(deadline.saturating_duration_since(Instant::now()));
        Ok(true)
    }

    fn view(&self) -> LiveView {
        match &self.report {
            Some(report) => {
                let refused: u64 = report.dropped.iter().filter(|(cause, _)| *cause != "gap").map(|(_, of)| of).sum();
                let lost = report.dropped.get("gap").copied().unwrap_or(0);
                let flagged: u64 = report.flagged.values().sum();
                let health = format!(
                    "Health: {} samples used, {} lost, {} refused, {} used with a warning.",
                    count(report.samples),
                    count(lost),
                    count(refused),
                    count(flagged)
                );
                LiveView::from_report(report, Some(&self.name), health, self.status())
            }
            None => LiveView {
                headline: self.name.clone(),
                sentences: "The first analysis comes after 10 s of the recording.".to_owned(),
                status: self.status(),
                ..LiveView::default()
            },
        }
    }
}
