//! The analysis in a browser: functions that a page calls in a worker, without generated code between them.
//!
//! The page writes a request as JSON into the memory of [`reserve_request`], and the bytes of a recording into that of [`reserve_file`]. It
//! calls a function, and reads the answer at [`answer_pointer`]. A function returns 0 if the answer is the result, and 1 if it is the
//! message of an error. Meanwhile the function calls the imported function `progress`.

mod analysis;
mod connection;
mod host;
mod inspection;
mod recording_options;

use analysis::Recorded;
use anyhow::{Context, Result};
use connection::{Connection, ReceiveRequest};
use measurement::Measurement;
use noise_analysis::report::several;
use recording_options::RecordingOptions;
use reports::export::{AxisChoice, ExportFormat};
use reports::saved_report::SavedReport;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use simulation::Simulation;
use std::cell::RefCell;
use std::sync::Arc;

/// The requests of the page, and the answers.
#[derive(Default)]
struct Exchange {
    request: Vec<u8>,
    file: Option<Arc<[u8]>>,
    /// The recordings to be compared.
    measured: Vec<Measurement>,
    /// The connection to the device.
    connection: Option<Connection>,
    answer: Vec<u8>,
}

thread_local! {
    static EXCHANGE: RefCell<Exchange> = RefCell::default();
}

fn with<R>(change: impl FnOnce(&mut Exchange) -> R) -> R {
    EXCHANGE.with_borrow_mut(change)
}

/// Returns memory for a request of `bytes` bytes.
#[unsafe(no_mangle)]
pub extern "C" fn reserve_request(bytes: usize) -> *mut u8 {
    with(|exchange| {
        exchange.request = vec![0; bytes];
        exchange.request.as_mut_ptr()
    })
}

/// Returns memory for a recording of `bytes` bytes, which replaces the previous one.
#[unsafe(no_mangle)]
pub extern "C" fn reserve_file(bytes: usize) -> *mut u8 {
    with(|exchange| {
        exchange.file = None;
        let mut file: Arc<[u8]> = std::iter::repeat_n(0, bytes).collect();
        let pointer = Arc::get_mut(&mut file).map_or(std::ptr::null_mut(), <[u8]>::as_mut_ptr);
        exchange.file = Some(file);
        pointer
    })
}

/// Address of the first byte of the answer.
#[unsafe(no_mangle)]
pub extern "C" fn answer_pointer() -> *const u8 {
    with(|exchange| exchange.answer.as_ptr())
}

/// Length of the answer, bytes of UTF-8.
#[unsafe(no_mangle)]
pub extern "C" fn answer_length() -> usize {
    with(|exchange| exchange.answer.len())
}

/// A request with the name of a recording and the options for reading it.
#[derive(Deserialize)]
struct RecordingRequest {
    name: String,
    /// True for the first recording to be compared.
    #[serde(default, rename = "isFirst")]
    is_first: bool,
    #[serde(flatten)]
    options: RecordingOptions,
}

impl RecordingRequest {
    fn recorded(&self) -> Result<Recorded<'_>> {
        let bytes = with(|exchange| exchange.file.clone()).context("no recording")?;
        Ok(Recorded { name: &self.name, bytes, options: &self.options })
    }
}

/// The contents of a recording as HTML, with a form for each sensor.
#[unsafe(no_mangle)]
pub extern "C" fn inspect() -> u32 {
    answer(|request: RecordingRequest| inspection::html(&request.recorded()?))
}

/// The report of a recording, as a page and as JSON.
#[unsafe(no_mangle)]
pub extern "C" fn analyse() -> u32 {
    answer(|request: RecordingRequest| request.recorded()?.report())
}

/// A simulation to analyse.
#[derive(Deserialize)]
struct SimulationRequest {
    seconds: f64,
    seed: u64,
    /// True for N, B and K alone.
    plain: bool,
}

/// The report of a simulated recording, in the form of [`analyse`].
#[unsafe(no_mangle)]
pub extern "C" fn simulate() -> u32 {
    answer(|SimulationRequest { seconds, seed, plain }: SimulationRequest| {
        let simulation =
            if plain { Simulation::paper(seconds, seed) } else { Simulation::demonstration(seconds, seed) };
        analysis::simulated(&simulation)
    })
}

/// Keeps the samples of a recording for [`compare`]. The first one replaces all earlier ones.
#[unsafe(no_mangle)]
pub extern "C" fn keep() -> u32 {
    answer(|request: RecordingRequest| {
        let measurement = request.recorded()?.measurement()?;
        with(|exchange| {
            if request.is_first {
                exchange.measured.clear();
            }
            exchange.measured.push(measurement);
        });
        Ok(String::new())
    })
}

/// Compares the noise of the kept recordings.
#[unsafe(no_mangle)]
pub extern "C" fn compare() -> u32 {
    answer(|(): ()| {
        let measured = with(|exchange| std::mem::take(&mut exchange.measured));
        let mut text = Vec::new();
        reports::several::write_agreement(&several::compare(&measured)?, &mut text)?;
        Ok(String::from_utf8(text)?)
    })
}

/// A report to be written in the format of another program.
#[derive(Deserialize)]
struct ExportRequest {
    /// The report as JSON.
    report: String,
    /// Name of the format, as in the option `-o FORMAT=FILE` of the command.
    format: String,
    /// Choice for three axes, as in the option `--combine-axes` of the command.
    axis: String,
}

/// The noise of a report in the format of another program.
#[unsafe(no_mangle)]
pub extern "C" fn export() -> u32 {
    fn named<T: clap::ValueEnum>(name: &str) -> Result<T> {
        T::from_str(name, false).map_err(anyhow::Error::msg)
    }
    answer(|ExportRequest { report, format, axis }: ExportRequest| {
        let report = SavedReport::from_json(&report)?;
        Ok(reports::export::export(&report, named::<ExportFormat>(&format)?, named::<AxisChoice>(&axis)?)?.text)
    })
}

/// Starts a connection to a device; the request is the name of its port.
#[unsafe(no_mangle)]
pub extern "C" fn connect_device() -> u32 {
    answer(|name: String| {
        with(|exchange| exchange.connection = Some(Connection::new(name)));
        Ok(String::new())
    })
}

/// Processes bytes of the device, which are in the memory of [`reserve_file`]. The answer has the live view and the
/// lines.
#[unsafe(no_mangle)]
pub extern "C" fn receive_bytes() -> u32 {
    answer(|request: ReceiveRequest| {
        with(|exchange| {
            let bytes = exchange.file.take();
            connected(exchange)?.receive(bytes.as_deref().unwrap_or_default(), &request)
        })
    })
}

/// Starts the next step of the bench, or the first one if the request is true. The answer is its command, or the table.
#[unsafe(no_mangle)]
pub extern "C" fn bench_step() -> u32 {
    answer(|is_first: bool| {
        with(|exchange| {
            let connection = connected(exchange)?;
            if is_first {
                connection.begin_bench();
            }
            connection.step()
        })
    })
}

fn connected(exchange: &mut Exchange) -> Result<&mut Connection> {
    exchange.connection.as_mut().context("no device")
}

/// Serves the request that the page has written.
fn answer<T: DeserializeOwned>(serve: impl FnOnce(T) -> Result<String>) -> u32 {
    host::set_panic_hook();
    let request = with(|exchange| std::mem::take(&mut exchange.request));
    let served = serde_json::from_slice(&request).context("request").and_then(serve);
    let status = u32::from(served.is_err());
    // A message that quotes its input needs no escaping: the page sets it as text.
    let text = served.unwrap_or_else(|error| format!("{error:#}"));
    with(|exchange| exchange.answer = text.into_bytes());
    status
}
