//! Signals that end the program: interrupt, hang-up, termination.
//!
//! The running command may handle the first signal and then ends in good order. Any other signal removes incomplete files and ends the
//! program.

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

/// Exit status of a program that a signal has ended, less the number of the signal, as in shells.
const ENDED_BY_SIGNAL: i32 = 128;

/// Attempts to remove a folder, in which a command may still create a file or two.
const ATTEMPTS_TO_REMOVE: usize = 8;

/// Returns true if it handles the signal.
type Action = Box<dyn FnMut() -> bool + Send>;

static ACTION: LazyLock<Mutex<Option<Action>>> = LazyLock::new(Mutex::default);
static INCOMPLETE: LazyLock<Mutex<Vec<PathBuf>>> = LazyLock::new(Mutex::default);

fn lock<T>(shared: &'static Mutex<T>) -> MutexGuard<'static, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Starts to wait for signals. A hang-up that the caller ignores, as with `nohup`, is ignored.
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

/// Starts to wait for an interrupt of the terminal, the only signal of this system.
///
/// # Errors
/// The system refuses.
#[cfg(not(unix))]
pub(crate) fn watch() -> Result<()> {
    const SIGINT: i32 = 2;
    ctrlc::set_handler(|| take(SIGINT)).context("signals")
}

/// Lets the action handle a signal, or ends the program.
fn take(signal: i32) {
    let is_taken_up = lock(&ACTION).as_mut().is_some_and(|action| action());
    if !is_taken_up {
        // The lock is held until the program ends, so that no more folders are created. A file may still be created in a folder that is
        // being removed; the next attempt removes it.
        let incomplete = lock(&INCOMPLETE);
        for folder in incomplete.iter() {
            let _is_removed = (0..ATTEMPTS_TO_REMOVE).any(|_| fs::remove_dir_all(folder).is_ok());
        }
        process::exit(ENDED_BY_SIGNAL + signal);
    }
}

/// True if the program was started with `signal` ignored; false if the system does not say.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}

/// Sets the action for later signals; it returns true if it handles one.
pub(crate) fn on_signal(action: impl FnMut() -> bool + Send + 'static) {
    *lock(&ACTION) = Some(Box::new(action));
}

/// A folder of incomplete files. It is removed when this is dropped, or when a signal ends the program.
pub(crate) struct IncompleteFiles {
    // This field is dropped first: a signal before the next drop still finds the name.
    folder: TempDir,
    _name: RemovedAtSignal,
}

/// The name of a folder that is removed if a signal ends the program before this is dropped.
struct RemovedAtSignal(PathBuf);

impl IncompleteFiles {
    /// Creates the folder in `place`; a signal meanwhile waits until the folder is registered.
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
