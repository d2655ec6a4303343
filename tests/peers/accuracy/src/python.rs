//! The peers in Python, which `peers.py` runs in a process of its own.

use crate::case::Coefficients;
use anyhow::{Context, Result, ensure};
use serde::Deserialize;
use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

/// A running `peers.py`.
pub(crate) struct Python {
    child: Child,
    series: ChildStdin,
    answers: BufReader<ChildStdout>,
}

/// What one method says of each series of a batch.
#[derive(Debug, Deserialize)]
pub(crate) struct Answer {
    pub(crate) method: String,
    /// N, B, K a series.
    pub(crate) coefficients: Vec<Coefficients>,
}

impl Python {
    /// Starts `peers.py` with `interpreter`, in whose environment the peers are installed.
    pub(crate) fn start(interpreter: &str) -> Result<Self> {
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/peers.py");
        let mut child = Command::new(interpreter)
            .arg(script)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .with_context(|| interpreter.to_owned())?;
        let series = child.stdin.take().context("no standard input")?;
        let answers = BufReader::new(child.stdout.take().context("no standard output")?);
        Ok(Self { child, series, answers })
    }

    /// Sends a batch and waits for the answers of every method.
    pub(crate) fn ask(&mut self, batch: &[Vec<f64>], kinds: &[&str]) -> Result<Vec<Answer>> {
        writeln!(self.series, "{} {} {}", batch.len(), batch[0].len(), kinds.join(","))?;
        for series in batch {
            let bytes: Vec<u8> = series.iter().flat_map(|value| value.to_le_bytes()).collect();
            self.series.write_all(&bytes)?;
        }
        self.series.flush()?;
        let mut line = String::new();
        ensure!(self.answers.read_line(&mut line)? > 0, "peers.py ended: see its message above");
        Ok(serde_json::from_str(&line)?)
    }
}

impl Drop for Python {
    fn drop(&mut self) {
        // It waits for the next batch; there is nobody to tell if it is gone already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
