//! `record`, `bench` and `demo`: the report of a device, whose recording is kept, or of the virtual sensor.

use crate::analyze::analyze_recording;
use crate::bench::{self, BenchPlan, SerialConsole};
use crate::cli::BenchArguments;
use crate::interrupt;
use crate::output::{self, note, progress_bar};
use crate::tip::{DeniedPort, UnknownPort};
use adis16405_driver::GyroRange;
use anyhow::{Context, Error, Result, ensure};
use noise_analysis::report::Report;
use observatory::message_text::summary;
use recordings::Printable;
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

/// A link to the device on a serial port. The error has a tip if the port does not exist or may not be opened.
pub(crate) fn open_link(port: &str, baud: u32) -> Result<SerialLink<impl Read + Write + use<>>> {
    ensure!(!Path::new(port).is_file(), "is a file and no serial port; `imunoise {}` analyses it", Printable(port));
    let port = serial::open(port, baud).map_err(|error| match error.kind() {
        ErrorKind::NotFound => UnknownPort.into(),
        ErrorKind::PermissionDenied => DeniedPort.into(),
        _ => Error::from(error),
    })?;
    Ok(SerialLink::new(port))
}

/// Checks a device and prints the result of each check.
pub(crate) fn bench_device(arguments: &BenchArguments) -> Result<()> {
    let BenchArguments { port, baud, second, reads, seconds } = arguments;
    let open = |port: &str| open_link(port, *baud).with_context(|| port.to_owned());
    let mut console = SerialConsole::new(open(port)?, second.as_deref().map(open).transpose()?);
    let plan = BenchPlan { reads: *reads, bursts_s: *seconds, ..BenchPlan::default() };
    let bar = progress_bar(0, "{msg} {wide_bar} {pos}/{len} steps {elapsed}");
    let transcript = bench::run(&mut console, &plan, |step, index, steps| {
        bar.set_length(steps as u64);
        bar.set_position(index as u64);
        bar.set_message(step.command.clone());
    });
    bar.finish_and_clear();
    let checks = bench::checks(&transcript.with_context(|| port.to_owned())?);
    output::print(|out| bench::write_table(&checks, out))?;
    let failed = checks.iter().filter(|check| check.cause.is_some()).count();
    ensure!(failed == 0, "{failed} of {} checks failed", checks.len());
    Ok(())
}

/// Writes `seconds` of the raw bursts of the device on `port` to the frame log `log` and reports on them.
pub(crate) fn record_device(log: &Path, port: &str, baud: u32, seconds: f64) -> Result<Report> {
    let mut link = open_link(port, baud).with_context(|| port.to_owned())?;
    // A signal ends the recording: the device is told, and the bursts received are analysed. A second signal ends the program.
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
        summary(&recorded.counters)
    ));
    let recording = simulation::replay(log, GyroRange::default())?.recording;
    analyze_recording(recording, None).with_context(|| port.to_owned())
}
