//! Signals that end the program: an interrupt of the terminal, a hang-up, a request to end.
//!
//! The first one may be taken up by what runs, which then ends in good order; any other removes the files that are not complete and ends
//! the program.

use anyhow::{Context, Result};
#[cfg(unix)]
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
#[cfg(unix)]
use signal_hook::iterator::Signals;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process;
use std::sync::{LazyLock, Mutex, MutexGuard, PoisonError};
#[cfg(unix)]
use std::thread;
use tempfile::{Builder, TempDir};

/// Exit status of a program that a signal has ended, as shells have it, less the number of the signal.
const ENDED_BY_SIGNAL: i32 = 128;

/// A command makes a file or two in a folder.
const ATTEMPTS_TO_REMOVE: usize = 8;

/// Takes a signal up, or does not.
type Action = Box<dyn FnMut() -> bool + Send>;

static ACTION: LazyLock<Mutex<Option<Action>>> = LazyLock::new(Mutex::default);
static INCOMPLETE: LazyLock<Mutex<Vec<PathBuf>>> = LazyLock::new(Mutex::default);

fn lock<T>(shared: &'static Mutex<T>) -> MutexGuard<'static, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Begins to wait for signals. A hang-up that the caller ignores, as `nohup` makes it, is ignored here too.
///
/// # Errors
/// The system refuses.
#[cfg(unix)]
pub(crate) fn watch() -> Result<()> {
    let signals = [SIGINT, SIGTERM, SIGHUP].into_iter().filter(|signal| *signal != SIGHUP || !is_ignored(SIGHUP));
    let mut signals = Signals::new(signals.collect::<Vec<_>>()).context("signals")?;
    thread::spawn(move || signals.forever().for_each(take));
    Ok(())
}

/// Begins to wait for an interrupt of the terminal, the only signal that the system has.
///
/// # Errors
/// The system refuses.
#[cfg(not(unix))]
pub(crate) fn watch() -> Result<()> {
    const SIGINT: i32 = 2;
    ctrlc::set_handler(|| take(SIGINT)).context("signals")
}

/// Has the action take a signal up, or ends the program.
fn take(signal: i32) {
    let is_taken_up = lock(&ACTION).as_mut().is_some_and(|action| action());
    if !is_taken_up {
        // Locked until the program has ended: no folder is made any more. In one that is being removed a file may still be made, which the
        // next attempt removes.
        let incomplete = lock(&INCOMPLETE);
        for folder in incomplete.iter() {
            let _is_removed = (0..ATTEMPTS_TO_REMOVE).any(|_| fs::remove_dir_all(folder).is_ok());
        }
        process::exit(ENDED_BY_SIGNAL + signal);
    }
}

/// True if the program was started with `signal` ignored, where the system says it.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}

/// Has `action` decide about the signals that come from now on: it returns whether it takes one up.
pub(crate) fn on_signal(action: impl FnMut() -> bool + Send + 'static) {
    *lock(&ACTION) = Some(Box::new(action));
}

/// A folder of files that are not complete, removed when this is dropped, or when a signal ends the program.
pub(crate) struct IncompleteFiles {
    // Removed before it is forgotten: a signal between the two finds it.
    folder: TempDir,
    _name: RemovedAtSignal,
}

/// The name of a folder that is removed if a signal ends the program before this is dropped.
struct RemovedAtSignal(PathBuf);

impl IncompleteFiles {
    /// Makes the folder in `place`; a signal meanwhile waits until the folder is known.
    ///
    /// # Errors
    /// The folder cannot be made.
    pub(crate) fn in_folder(place: &Path) -> io::Result<Self> {
        let mut incomplete = lock(&INCOMPLETE);
        let folder = Builder::new().prefix(".").tempdir_in(place)?;
        let name = folder.path().to_owned();
        incomplete.push(name.clone());
        Ok(Self { folder, _name: RemovedAtSignal(name) })
    }

    pub(crate) fn path(&self) -> &Path {
        self.folder.path()
    }
}

impl Drop for RemovedAtSignal {
    fn drop(&mut self) {
        lock(&INCOMPLETE).retain(|folder| *folder != self.0);
    }
}
