//! Runs independent recordings on several threads.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// Results of `work` in the order of the items. `progress` gets the numbers of finished and of all items. No item is
/// started after an error.
///
/// # Errors
/// The first one in the order of the items.
pub(crate) fn map<I: Sync, T: Send, E: Send>(
    items: &[I],
    jobs: usize,
    work: impl Fn(&I) -> Result<T, E> + Sync,
    progress: impl Fn(usize, usize) + Sync,
) -> Result<Vec<T>, E> {
    let (next, done, failed) = (AtomicUsize::new(0), AtomicUsize::new(0), AtomicBool::new(false));
    let results = Mutex::new(Vec::with_capacity(items.len()));
    std::thread::scope(|scope| {
        for _ in 0..jobs.clamp(1, items.len().max(1)) {
            scope.spawn(|| {
                while !failed.load(Ordering::Relaxed) {
                    let at = next.fetch_add(1, Ordering::Relaxed);
                    let Some(item) = items.get(at) else { break };
                    let result = work(item);
                    failed.fetch_or(result.is_err(), Ordering::Relaxed);
                    // The list is valid after a panic, since only `push` changes it.
                    results.lock().unwrap_or_else(PoisonError::into_inner).push((at, result));
                    progress(done.fetch_add(1, Ordering::Relaxed) + 1, items.len());
                }
            });
        }
    });
    let mut results = results.into_inner().unwrap_or_else(PoisonError::into_inner);
    results.sort_by_key(|(at, _)| *at);
    results.into_iter().map(|(_, result)| result).collect()
}
