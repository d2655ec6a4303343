//! How many threads an analysis may use: as many as there are cores, or one where the recordings themselves are analysed side by
//! side. The result does not depend on it.

use measurement::{ChannelId, PerChannel};
use std::cell::Cell;
use std::num::NonZero;
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicUsize, Ordering};

thread_local! {
    static IS_ALONE: Cell<bool> = const { Cell::new(false) };
}

/// Runs `task`, and all that it analyses, on the thread of the caller alone.
pub fn on_one_thread<R>(task: impl FnOnce() -> R) -> R {
    /// Takes the restriction away again, also where the task panics.
    struct Restore(bool);
    impl Drop for Restore {
        fn drop(&mut self) {
            IS_ALONE.set(self.0);
        }
    }
    let _restore = Restore(IS_ALONE.replace(true));
    task()
}

/// Threads that the analysis may use on this thread.
#[must_use]
pub fn threads() -> usize {
    if IS_ALONE.get() { 1 } else { std::thread::available_parallelism().map_or(1, NonZero::get) }
}

/// Runs `task` for each of `items`, on as many threads as there are cores, and returns the results in the order of `items`.
pub fn in_parallel<T: Sync, R: Send>(items: &[T], task: impl Fn(&T) -> R + Sync) -> Vec<R> {
    let cores = threads();
    if cores == 1 {
        return items.iter().map(task).collect();
    }
    let next = AtomicUsize::new(0);
    let work = || {
        let taken = std::iter::from_fn(|| {
            let at = next.fetch_add(1, Ordering::Relaxed);
            Some((at, task(items.get(at)?)))
        });
        taken.collect::<Vec<_>>()
    };
    let mut results: Vec<(usize, R)> = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..cores.min(items.len())).map(|_| scope.spawn(work)).collect();
        // A panic in a task is passed on to the caller.
        let finished = workers.into_iter().map(|worker| worker.join().unwrap_or_else(|panic| resume_unwind(panic)));
        finished.flatten().collect()
    });
    results.sort_unstable_by_key(|(at, _)| *at);
    results.into_iter().map(|(_, result)| result).collect()
}

/// What `task` makes of each channel, on as many threads as there are cores.
pub(crate) fn per_channel<T: Send>(
    channels: impl Iterator<Item = ChannelId>,
    task: impl Fn(ChannelId) -> T + Sync,
) -> PerChannel<T> {
    in_parallel(&channels.collect::<Vec<_>>(), |&channel| task(channel)).into()
}

/// Runs `task` for each of `changed`, on as many threads as there are cores.
pub(crate) fn for_each<T: Send>(changed: &mut [T], task: impl Fn(&mut T) + Sync) {
    for_each_pair(changed, &vec![(); changed.len()], |changed, ()| task(changed));
}

/// Runs `task` for each of `changed` with the one of `others` at the same position, on as many threads as there are cores.
pub(crate) fn for_each_pair<T: Send, U: Sync>(changed: &mut [T], others: &[U], task: impl Fn(&mut T, &U) + Sync) {
    let threads = threads().min(changed.len()).max(1);
    let each = changed.len().div_ceil(threads).max(1);
    let work = |(changed, others): (&mut [T], &[U])| {
        changed.iter_mut().zip(others).for_each(|(changed, other)| task(changed, other));
    };
    let parts = changed.chunks_mut(each).zip(others.chunks(each));
    if threads == 1 {
        parts.for_each(work);
    } else {
        std::thread::scope(|scope| parts.for_each(|part| drop(scope.spawn(move || work(part)))));
    }
}
