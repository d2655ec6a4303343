//! `record`, and the command without a subcommand: the report of a device, of which a recording is left, or of the virtual sensor.

use crate::analyze::analyze_recording;
use crate::interrupt;
use crate::output::{note, progress_bar};
use crate::tip::UnknownPort;
use adis16405_driver::GyroRange;
use anyhow::{Context, Error, Result};
use host_sim::monitor;
use noise_analysis::report::Report;
use recordings::serial::{self, SerialLink};
use simulation::Simulation;
use std::io::{ErrorKind, Read, Write};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// The report of the virtual sensor.
pub(crate) fn simulate(simulation: &Simulation) -> Result<Report> {
    let bar = progress_bar(simulation.samples()?, "{msg} {wide_bar} {pos}/{len} samples, {eta} left");
    bar.set_message("virtual ADIS16405");
    let recording = simulation.run(|taken| bar.set_position(taken));
    bar.finish_and_clear();
    analyze_recording(recording?, None).context("virtual sensor")
}

/// A link to the device on a serial port. If there is no such port, the error leads to the names of those that there are.
pub(crate) fn open_link(port: &str, baud: u32) -> Result<SerialLink<impl Read + Write + use<>>> {
    let port = serial::open(port, baud).map_err(|error| match error.kind() {
        ErrorKind::NotFound => UnknownPort.into(),
        _ => Error::from(error),
    })?;
    Ok(SerialLink::new(port))
}

/// Writes `seconds` of the raw bursts of the device on `port` to the frame log `log` and reports on them.
pub(crate) fn record_device(log: &Path, port: &str, baud: u32, seconds: f64) -> Result<Report> {
    let mut link = open_link(port, baud).with_context(|| port.to_owned())?;
    // At a signal the recording ends, the device is told, and what came until then is analysed; a second one ends the program.
    let is_interrupted = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&is_interrupted);
    interrupt::on_signal(move || !flag.swap(true, Ordering::Relaxed));
    let recorded = serial::record(&mut link, log, seconds, || is_interrupted.load(Ordering::Relaxed))
        .with_context(|| format!("{port}, {}", log.display()))?;
    match recorded.lost_after {
        Some(bursts) => {
            note(format_args!("the device hung up or fell silent after {bursts} bursts, which are analysed"))
        }
        None if recorded.interrupted => note(format_args!("interrupted; the recording until then is analysed")),
        None => {}
    }
    if recorded.restarts > 0 {
        note(format_args!("the device restarted {} times; time goes on by the host's clock", recorded.restarts));
    }
    note(format_args!(
        "{} bursts, {} missing between them; {}",
        recorded.bursts,
        recorded.missing,
        monitor::summary(&recorded.counters)
    ));
    let recording = simulation::replay(log, GyroRange::default())?.recording;
    analyze_recording(recording, None).with_context(|| port.to_owned())
}
