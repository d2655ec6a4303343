//! Tips: names similar to one that does not exist.

use clap::error::{ContextKind, ContextValue};
use recordings::sample_stream::StreamError;
use recordings::{InputError, Reason, serial};
use simulation::ScenarioTextError;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Jaro similarity above which a name counts as misspelt; the argument parser has the same limit for options.
const SIMILAR: f64 = 0.7;

/// Options of other programs, with those of this program.
const OPTIONS: [(&str, &str); 4] =
    [("html", "-o report.html"), ("json", "-o report.json"), ("svg", "-o figures.svg"), ("yaml", "-o imu.yaml")];
/// Words that are not commands, with the commands to use instead.
const COMMANDS: [(&str, &str); 1] = [("explain", "analyze FILE --full")];

/// The name of a sensor that is neither included nor a file, and the names of the included ones.
#[derive(Debug, thiserror::Error)]
#[error("sensor {}: none of {}, and no profile file of this name", recordings::Printable(.0), .1.join(", "))]
pub(crate) struct UnknownSensor(pub(crate) String, pub(crate) Vec<&'static str>);

/// A serial port that does not exist.
#[derive(Debug, thiserror::Error)]
#[error("no such serial port")]
pub(crate) struct UnknownPort;

/// A serial port that the user may not open.
#[derive(Debug, thiserror::Error)]
#[error("permission denied")]
pub(crate) struct DeniedPort;

/// The most similar of `names`; `None` if none is similar.
pub(crate) fn similar_name<T: AsRef<str>>(name: &str, names: impl IntoIterator<Item = T>) -> Option<T> {
    let similarities = names.into_iter().map(|candidate| (strsim::jaro(name, candidate.as_ref()), candidate));
    let (similarity, nearest) = similarities.max_by(|a, b| a.0.total_cmp(&b.0))?;
    (similarity > SIMILAR).then_some(nearest)
}

/// Adds the option or command of this program to an error of the argument parser.
pub(crate) fn suggest(error: &mut clap::Error) {
    let known = |kind, names: &[(&'static str, &'static str)]| {
        let Some(ContextValue::String(given)) = error.get(kind) else { return None };
        let name = similar_name(given.trim_start_matches('-'), names.iter().map(|(name, _)| *name))?;
        names.iter().find(|(known, _)| *known == name).map(|(_, ours)| (*ours).to_owned())
    };
    let option = known(ContextKind::InvalidArg, &OPTIONS);
    let command = known(ContextKind::InvalidSubcommand, &COMMANDS);
    if let Some(option) = option {
        error.insert(ContextKind::SuggestedArg, ContextValue::String(option));
    }
    if let Some(command) = command {
        error.insert(ContextKind::SuggestedSubcommand, ContextValue::Strings(vec![command]));
    }
}

/// The probable meaning of the name that is the cause of `error`.
pub(crate) fn tip(error: &anyhow::Error) -> Option<String> {
    if let Some(UnknownSensor(name, known)) = error.downcast_ref() {
        return Some(format!("a similar sensor exists: {}", similar_name(name, known)?));
    }
    if let Some(UnknownPort) = error.downcast_ref() {
        let ports = serial::ports();
        let ports = if ports.is_empty() { "none".to_owned() } else { ports.join(", ") };
        return Some(format!("serial ports of this machine: {ports}"));
    }
    if let Some(DeniedPort) = error.downcast_ref() {
        return Some("on Linux: sudo usermod -aG dialout $USER, then log in again".to_owned());
    }
    if let Some(error) = error.downcast_ref::<ScenarioTextError>() {
        return similar_part(error);
    }
    let of_stream = || match error.downcast_ref()? {
        StreamError::Input(error) => Some(error),
        StreamError::TimeBase(_) => None,
    };
    let InputError { file, reason, .. } = error.downcast_ref().or_else(of_stream)?;
    match reason {
        Reason::Io(reason) if reason.kind() == ErrorKind::NotFound => {
            Some(format!("a similar file exists: {}", similar_file(file)?.display()))
        }
        Reason::UnknownTopic(topic) => {
            let (name, known) = topic.as_ref();
            // Each name is followed by its type in brackets.
            let known = known.split(", ").map(|topic| topic.split(" (").next().unwrap_or(topic));
            Some(format!("did you mean {}?", similar_name(name, known)?))
        }
        _ => None,
    }
}

/// The probable meaning of a misspelt part of a simulation's description.
fn similar_part(error: &ScenarioTextError) -> Option<String> {
    let similar = match error {
        ScenarioTextError::Kind(kind, known) => similar_name(kind, known.split(", "))?,
        ScenarioTextError::Channel(name) => {
            similar_name(name, adis16405_driver::Channel::ALL.map(|known| known.name()))?
        }
        ScenarioTextError::Unknown { key, known, .. } => similar_name(key, known.iter().copied())?,
        ScenarioTextError::Missing { key, given, .. } => {
            let similar = similar_name(key, given)?;
            return Some(format!("`{similar}` is no parameter of it; did you mean {key}?"));
        }
        _ => return None,
    };
    Some(format!("did you mean {similar}?"))
}

/// An existing file similar to a missing one: in each folder of its path the entry of this name, or the most similar one.
fn similar_file(file: &Path) -> Option<PathBuf> {
    let name = file.file_name()?.to_string_lossy();
    let parent = file.parent().unwrap_or(Path::new(""));
    let is_here = parent.as_os_str().is_empty();
    let folder = if is_here || parent.is_dir() { parent.to_owned() } else { similar_file(parent)? };
    let entries = fs::read_dir(if is_here { Path::new(".") } else { &folder }).ok()?;
    let names = entries.filter_map(|entry| Some(entry.ok()?.file_name().to_string_lossy().into_owned()));
    Some(folder.join(similar_name(&name, names)?))
}
