//! `simulate`: a recording of a virtual sensor whose noise, effects and faults the arguments describe.

use crate::cli::{ChannelNoise, RecordingFormat, SimulateArguments};
use crate::output::{note, progress_bar};
use crate::output_files::OutputFiles;
use crate::recording_file;
use anyhow::{Context, Result};
use simulation::Simulation;

/// Length of the recording without the option, s.
const DEFAULT_S: f64 = 3600.0;

/// Runs the simulation and writes the recording.
pub(crate) fn run(arguments: &SimulateArguments) -> Result<()> {
    let out = &arguments.out;
    let files = OutputFiles::new([], arguments.force);
    files.check(out)?;
    let simulation = simulation(arguments)?;
    let sampled_hz = simulation.sampled_hz()?;
    if (sampled_hz / simulation.rate_hz - 1.0).abs() > 1e-9 {
        note(format_args!("the part has no rate of {} Hz: it samples at {sampled_hz} Hz", simulation.rate_hz));
    }
    let bar = progress_bar(simulation.samples()?, "{msg} {wide_bar} {pos}/{len} samples, {eta} left");
    bar.set_message("virtual ADIS16405");
    let format = recording_file::format_of(out, arguments.format)?;
    // A frame log is written while the bus is read, since it has the configuration and every fault.
    let recording = match format {
        RecordingFormat::Frames => {
            files.write_with(out, |out| Ok(simulation.run_logged(out, |taken| bar.set_position(taken))?))?
        }
        RecordingFormat::Table | RecordingFormat::Npy => simulation.run(|taken| bar.set_position(taken))?,
    };
    bar.finish_and_clear();
    match format {
        RecordingFormat::Frames => Ok(()),
        RecordingFormat::Table | RecordingFormat::Npy => recording_file::write(&recording, out, format, &files),
    }
}

/// The simulation that the arguments describe.
fn simulation(arguments: &SimulateArguments) -> Result<Simulation> {
    let seconds = arguments.seconds.unwrap_or(DEFAULT_S);
    let mut simulation = Simulation::paper(seconds, arguments.seed);
    (simulation.rate_hz, simulation.range) = (arguments.rate, arguments.range.into());
    let least_taps = 1 << simulation.range.min_filter_taps_log2();
    simulation.set_taps(arguments.taps.unwrap_or(least_taps))?;
    // Values for one channel override those for all channels of a kind.
    let (of_one, of_all): (Vec<&ChannelNoise>, _) =
        arguments.noise.iter().partition(|noise| !noise.prefix.ends_with('_'));
    for ChannelNoise { prefix, coefficients } in of_all.into_iter().chain(of_one) {
        simulation.set_coefficients(prefix, coefficients).context("--noise")?;
    }
    arguments.environment.iter().try_for_each(|text| simulation.set_environment(text)).context("--environment")?;
    arguments.effect.iter().try_for_each(|text| simulation.add_effect(text)).context("--effect")?;
    arguments.fault.iter().try_for_each(|text| simulation.add_fault(text)).context("--fault")?;
    Ok(simulation)
}
