//! The report of an analysis, and its rows as an Arrow table.

use anstream::StripStream;
use arrow_array::ffi_stream::FFI_ArrowArrayStream;
use arrow_array::{ArrayRef, Float64Array, Int64Array, RecordBatch, RecordBatchIterator, StringArray};
use arrow_schema::ffi::FFI_ArrowSchema;
use arrow_schema::{ArrowError, Field, Schema};
use clap::ValueEnum;
use host_sim::recording_analysis::Analysed;
use postcard::{from_bytes, to_allocvec};
use pyo3::exceptions::{PyKeyError, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyCapsule};
use reports::export::{self, AxisChoice, ExportFormat};
use reports::json::ReportJson;
use reports::rows::{ReportRow, rows};
use reports::saved_report::SavedReport;
use reports::terminal::Screen;
use reports::{figure, page};
use std::sync::Arc;

/// Columns of the report's text.
const COLUMNS: usize = 80;

/// The report behind `imunoise.Report`.
#[pyclass(frozen, name = "Report", module = "imunoise._native")]
pub(crate) struct NativeReport {
    pub(crate) analysed: Analysed,
    pub(crate) name: String,
}

fn failed(error: impl std::fmt::Display) -> PyErr {
    PyRuntimeError::new_err(error.to_string())
}

/// The value with this name.
fn named<T: ValueEnum>(what: &str, name: &str) -> PyResult<T> {
    T::from_str(name, true).map_err(|_| {
        let names = T::value_variants().iter().filter_map(ValueEnum::to_possible_value);
        let names: Vec<String> = names.map(|name| name.get_name().to_owned()).collect();
        PyValueError::new_err(format!("{what} {name} is none of {}", names.join(", ")))
    })
}

#[pymethods]
impl NativeReport {
    /// Name of the recording.
    fn name(&self) -> &str {
        &self.name
    }

    /// The report as JSON.
    fn json(&self, py: Python) -> PyResult<String> {
        let Analysed { report, reading } = &self.analysed;
        py.detach(|| serde_json::to_string_pretty(&ReportJson::new(report, reading.as_ref()))).map_err(failed)
    }

    /// The screen of the command, without colours.
    fn text(&self, py: Python) -> PyResult<String> {
        py.detach(|| {
            let mut text = StripStream::new(Vec::new());
            let screen = Screen { report: &self.analysed.report, source: Some(&self.name), columns: COLUMNS };
            screen.write(&mut text).map_err(failed)?;
            String::from_utf8(text.into_inner()).map_err(failed)
        })
    }

    /// The page, or only its first screen.
    fn page(&self, py: Python, is_whole: bool) -> String {
        let Analysed { report, reading } = &self.analysed;
        let make = if is_whole { page::html } else { page::first_screen };
        py.detach(|| make(report, Some(&self.name), reading.as_ref()))
    }

    /// The Allan deviation of a channel as an SVG document.
    fn figure(&self, channel: &str) -> PyResult<String> {
        let report = &self.analysed.report;
        let found = report.channels.iter().find(|of| of.name == channel);
        let names = || report.channels.iter().map(|of| of.name.as_str()).collect::<Vec<_>>().join(", ");
        let found = found.ok_or_else(|| PyKeyError::new_err(format!("no channel {channel} but {}", names())))?;
        Ok(figure::allan_deviation(report, found))
    }

    /// The noise in the format of another program, and the fields of the format that the report lacks. If the format has one number for
    /// three axes, `axis` selects their root mean square or the largest.
    fn export(&self, format: &str, axis: &str) -> PyResult<(String, Vec<String>)> {
        let format: ExportFormat = named("format", format)?;
        let axis: AxisChoice = named("axis", axis)?;
        let saved =
            SavedReport::new(&self.analysed.report).map_err(|error| PyValueError::new_err(error.to_string()))?;
        let exported = export::export(&saved, format, axis);
        let exported = exported.map_err(|error| PyValueError::new_err(error.to_string()))?;
        Ok((exported.text, exported.missing.iter().map(ToString::to_string).collect()))
    }

    /// The rows of the report.
    fn rows(&self) -> Rows {
        Rows { rows: rows(&self.analysed.report, &self.name, self.analysed.reading.as_ref()) }
    }
}

/// The rows of reports.
#[pyclass(frozen, module = "imunoise._native")]
pub(crate) struct Rows {
    rows: Vec<ReportRow>,
}

impl Rows {
    fn batch(&self) -> Result<RecordBatch, ArrowError> {
        let mut columns: Vec<(&str, ArrayRef, bool)> = Vec::new();
        macro_rules! texts {
            ($($name:ident)*) => {
                $(columns.push((stringify!($name), Arc::new(self.rows.iter().map(|row| row.$name.as_deref()).collect::<StringArray>()), true));)*
            };
        }
        macro_rules! numbers {
            ($($name:ident)*) => {
                $(columns.push((stringify!($name), Arc::new(self.rows.iter().map(|row| row.$name).collect::<Float64Array>()), true));)*
            };
        }
        macro_rules! stated_texts {
            ($($name:ident)*) => {
                $(columns.push((stringify!($name), Arc::new(StringArray::from_iter_values(self.rows.iter().map(|row| &row.$name))), false));)*
            };
        }
        stated_texts!(recording);
        texts!(sha256 version);
        stated_texts!(status);
        texts!(reason notes sensor);
        numbers!(rate_hz hours);
        stated_texts!(row);
        texts!(channel kind parameter);
        numbers!(value low high);
        texts!(unit validated);
        columns.push((
            "finding",
            Arc::new(self.rows.iter().map(|row| row.finding.map(u64::cast_signed)).collect::<Int64Array>()),
            true,
        ));
        let field = |(name, array, is_optional): &(&str, ArrayRef, bool)| {
            Field::new(*name, array.data_type().clone(), *is_optional)
        };
        let schema = Schema::new(columns.iter().map(field).collect::<Vec<Field>>());
        RecordBatch::try_new(Arc::new(schema), columns.into_iter().map(|(_, array, _)| array).collect())
    }
}

#[pymethods]
impl Rows {
    fn __len__(&self) -> usize {
        self.rows.len()
    }

    /// The table as a stream of Arrow's C data interface.
    #[pyo3(signature = (requested_schema = None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyCapsule>> {
        // A requested schema is optional for the producer, and this one has a fixed schema.
        drop(requested_schema);
        let batch = self.batch().map_err(failed)?;
        let schema = batch.schema();
        let stream = FFI_ArrowArrayStream::new(Box::new(RecordBatchIterator::new([Ok(batch)], schema)));
        PyCapsule::new_with_value(py, stream, c"arrow_array_stream")
    }

    /// The schema of the table.
    fn __arrow_c_schema__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyCapsule>> {
        let schema = FFI_ArrowSchema::try_from(self.batch().map_err(failed)?.schema().as_ref()).map_err(failed)?;
        PyCapsule::new_with_value(py, schema, c"arrow_schema")
    }

    /// The rows as lines of JSON, one object per line.
    fn json_lines(&self) -> PyResult<String> {
        let lines = self.rows.iter().map(|row| serde_json::to_string(row).map(|line| line + "\n"));
        lines.collect::<Result<String, _>>().map_err(failed)
    }

    /// The rows as bytes.
    fn state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        Ok(PyBytes::new(py, &to_allocvec(&self.rows).map_err(failed)?))
    }

    /// Restores the rows from a [`state`](Self::state).
    #[staticmethod]
    fn from_state(state: &[u8]) -> PyResult<Self> {
        let rows = from_bytes(state).map_err(|error| PyValueError::new_err(format!("no rows of reports: {error}")));
        Ok(Self { rows: rows? })
    }

    /// The row of a recording without a report.
    #[staticmethod]
    fn of_failure(recording: &str, reason: &str) -> Self {
        Self { rows: vec![ReportRow::failed(recording, reason, env!("CARGO_PKG_VERSION"))] }
    }

    /// The rows of all `tables`.
    #[staticmethod]
    fn joined(tables: Vec<PyRef<Self>>) -> Self {
        Self { rows: tables.iter().flat_map(|table| table.rows.clone()).collect() }
    }
}
