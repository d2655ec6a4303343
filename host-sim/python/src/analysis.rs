//! The analysis of a recording, which is a file, bytes, or arrays.

use crate::arrays::Arrays;
use crate::report::NativeReport;
use host_sim::recording_analysis::{AnalysisError, AnalysisOptions, RecordingSource, analyze as analyze_recording};
use noise_analysis::parallel::{cancellable, on_at_most};
use pyo3::exceptions::{PyFileNotFoundError, PyKeyboardInterrupt, PyPermissionError, PyValueError};
use pyo3::prelude::*;
use recordings::{ReadMonitor, read_on_one_thread};
use std::io::ErrorKind;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

pyo3::create_exception!(
    imunoise,
    RecordingError,
    PyValueError,
    "A recording that cannot be read, or does not say all that is needed."
);

/// Time between two checks for signals in Python.
const INTERVAL: Duration = Duration::from_millis(20);

/// A signal, such as Ctrl-C, that Python received while compiled code runs.
struct Interruption {
    raised: Mutex<(Instant, Option<PyErr>)>,
}

impl Interruption {
    fn new() -> Arc<Self> {
        Arc::new(Self { raised: Mutex::new((Instant::now(), None)) })
    }

    /// True if a signal ends the work. Python handles signals only on its main thread.
    fn is_raised(&self) -> bool {
        let mut raised = self.raised.lock().unwrap_or_else(PoisonError::into_inner);
        if raised.1.is_none() && raised.0.elapsed() > INTERVAL {
            raised.1 = Python::attach(|py| py.check_signals()).err();
            raised.0 = Instant::now();
        }
        raised.1.is_some()
    }

    /// The exception of the signal.
    fn take(&self) -> Option<PyErr> {
        self.raised.lock().unwrap_or_else(PoisonError::into_inner).1.take()
    }
}

/// A recording, by the kind of Python object.
#[derive(FromPyObject)]
pub(crate) enum Source<'py> {
    Arrays(PyRef<'py, Arrays>),
    Bytes(Vec<u8>),
    File(PathBuf),
}

/// Analyses a recording on `threads` threads, including that of the caller.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "they are those of the function of Python")]
pub(crate) fn analyze(
    py: Python,
    source: Source,
    name: String,
    rate: Option<f64>,
    columns: Vec<String>,
    units: Vec<String>,
    topic: Option<String>,
    sensor: Option<String>,
    quick: bool,
    threads: usize,
) -> PyResult<NativeReport> {
    if threads == 0 {
        return Err(PyValueError::new_err("threads is 0: it must be 1 or more"));
    }
    let mut notes = Vec::new();
    let source = match source {
        Source::Arrays(arrays) => {
            notes.clone_from(&arrays.notes);
            RecordingSource::Arrays(name.clone(), Arc::clone(&arrays.table))
        }
        Source::Bytes(bytes) => RecordingSource::Bytes(name.clone(), bytes.into()),
        Source::File(file) => RecordingSource::File(file),
    };
    let options = AnalysisOptions { rate_hz: rate, columns, units, topic, sensor, is_quick: quick };
    let interruption = Interruption::new();
    let analysed = py.detach(|| {
        let (of_reading, of_analysis) = (Arc::clone(&interruption), Arc::clone(&interruption));
        let monitor = ReadMonitor::asking(move || of_reading.is_raised());
        let work = || cancellable(move || of_analysis.is_raised(), || analyze_recording(source, options, &monitor));
        on_at_most(threads, || if threads == 1 { read_on_one_thread(work) } else { work() })
    });
    if let Some(exception) = interruption.take() {
        return Err(exception);
    }
    let mut analysed = analysed.map_err(|_| PyKeyboardInterrupt::new_err(()))?.map_err(exception)?;
    if let Some(reading) = &mut analysed.reading {
        reading.notes.extend(notes);
    }
    Ok(NativeReport { analysed, name })
}

fn exception(AnalysisError { text, system }: AnalysisError) -> PyErr {
    match system {
        Some(ErrorKind::NotFound) => PyFileNotFoundError::new_err(text),
        Some(ErrorKind::PermissionDenied) => PyPermissionError::new_err(text),
        _ => RecordingError::new_err(text),
    }
}

/// Runs the command with these words, the first of which is the program's name, and returns its exit code.
#[pyfunction]
pub(crate) fn command(py: Python, words: Vec<std::ffi::OsString>) -> u8 {
    py.detach(|| host_sim::command::run(words, |_is_simulation| {}))
}
