//! The compared methods: this project's fit, the crate imu-calib, and the Python packages that `peers.py` runs in its
//! own process.

use crate::case::{Case, Coefficients, SAMPLE_PERIOD, SAMPLES};
use allan_core::model::FittedTerm;
use allan_core::{Cascade, Model, NoiseTerm, fit::fit};
use anyhow::{Context, Result, ensure};
use imu_calib::allan::{AllanConfig, AllanEstimator, Sensor};
use noise_analysis::report::assessment::record_length::relative_error;
use noise_analysis::samples::uniform_series::UniformSeries;
use noise_analysis::spectra::SampleSpectrum;
use serde::Deserialize;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

/// Standard deviation of the white noise in counts. Rounding adds 1/12 count² to the variance, a part in 10⁷.
const COUNTS: f64 = 1000.0;

/// This project's fit of `kinds` to the curve of a series; coefficients and bounds are in the unit of the series.
pub(crate) fn fitted(case: &Case, series: &[f64], kinds: &[NoiseTerm]) -> Model {
    let lsb = case.truth[0] / SAMPLE_PERIOD.sqrt() / COUNTS;
    let mut cascade = Cascade::<24, 8>::new();
    for value in series {
        cascade.push((value / lsb).round() as i32);
    }
    fit(&cascade.curve(SAMPLE_PERIOD), kinds).scaled(lsb)
}

/// The model fitted to all samples by their likelihood, starting from `model`.
pub(crate) fn fitted_to_samples(series: &[f64], model: &Model) -> Option<Model> {
    SampleSpectrum::of_samples(&UniformSeries::new(SAMPLE_PERIOD, series.to_vec()), &[])?.fitted(model)
}

/// The terms of the case.
pub(crate) fn true_kinds(case: &Case) -> Vec<NoiseTerm> {
    NoiseTerm::BASELINE.into_iter().zip(case.truth).filter(|(_, value)| *value > 0.0).map(|(kind, _)| kind).collect()
}

/// Lower bound of the relative standard error of N, B, K for an unbiased method.
pub(crate) fn limit(case: &Case) -> [Option<f64>; 3] {
    let truth = Model::new(
        SAMPLE_PERIOD,
        NoiseTerm::BASELINE.into_iter().zip(case.truth).map(|(kind, value)| FittedTerm::exact(kind, value)),
    );
    std::array::from_fn(|term| {
        (case.truth[term] > 0.0).then(|| relative_error(&truth, term, SAMPLES as f64 * SAMPLE_PERIOD))?
    })
}

/// N, B, K of a model.
pub(crate) fn fitted_coefficients(model: &Model) -> Coefficients {
    NoiseTerm::BASELINE.map(|kind| model.terms().iter().find(|term| term.kind == kind).map(|term| term.value))
}

/// True for each of N, B, K whose 95 % interval contains the true value; `None` if the case does not have it.
pub(crate) fn covered(case: &Case, model: &Model) -> [Option<bool>; 3] {
    let mut truth = case.truth.into_iter();
    NoiseTerm::BASELINE.map(|kind| {
        let truth = truth.next()?;
        let term = model.terms().iter().find(|term| term.kind == kind)?;
        Some((term.low..=term.high).contains(&truth))
    })
}

/// N and K by imu-calib, from slopes of the non-overlapping curve; `None` if the crate returns an error.
pub(crate) fn imu_calib_coefficients(series: &[f64]) -> Result<Coefficients> {
    let mut estimator = AllanEstimator::with_rate(AllanConfig::default(), 1.0 / SAMPLE_PERIOD)?;
    for (at, &value) in series.iter().enumerate() {
        estimator.push(at as f64 * SAMPLE_PERIOD, [0.0; 3], [value; 3]);
    }
    let result = estimator.finish()?;
    let first = |axes: Result<[f64; 3]>| axes.ok().map(|[x, ..]| x);
    Ok([first(result.noise_density_per_axis(Sensor::Gyro)), None, first(result.random_walk_per_axis(Sensor::Gyro))])
}

/// A script of this folder that runs.
pub(crate) struct Python {
    child: Child,
    series: ChildStdin,
    answers: BufReader<ChildStdout>,
}

/// The coefficients of one method for each series of a batch.
#[derive(Debug, Deserialize)]
pub(crate) struct Answer {
    pub(crate) method: String,
    /// N, B, K for each series.
    pub(crate) coefficients: Vec<Coefficients>,
}

impl Python {
    /// Starts a `script` of this folder with `interpreter`, which must have its packages.
    pub(crate) fn start(interpreter: &str, script: &str) -> Result<Self> {
        let mut child = Command::new(interpreter)
            .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join(script))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .with_context(|| interpreter.to_owned())?;
        let series = child.stdin.take().context("no standard input")?;
        let answers = BufReader::new(child.stdout.take().context("no standard output")?);
        Ok(Self { child, series, answers })
    }

    /// Sends a batch and waits for the results of every method.
    pub(crate) fn ask(&mut self, batch: &[Vec<f64>], kinds: &[&str]) -> Result<Vec<Answer>> {
        writeln!(self.series, "{} {} {}", batch.len(), batch[0].len(), kinds.join(","))?;
        for series in batch {
            let bytes: Vec<u8> = series.iter().flat_map(|value| value.to_le_bytes()).collect();
            self.series.write_all(&bytes)?;
        }
        self.series.flush()?;
        let mut line = String::new();
        ensure!(self.answers.read_line(&mut line)? > 0, "the script ended: see its message above");
        Ok(serde_json::from_str(&line)?)
    }
}

impl Drop for Python {
    fn drop(&mut self) {
        // The script waits for the next batch. An error means that it has already ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
