//! How many threads an analysis may use: as many as there are cores, or one where the recordings themselves are analysed side by
//! side. The result does not depend on it.

use measurement::{ChannelId, PerChannel};
use std::cell::Cell;
use std::num::NonZero;
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{LazyLock, Mutex, PoisonError};

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
    /// Asked for once: the system answers out of several files.
    static CORES: LazyLock<usize> = LazyLock::new(|| std::thread::available_parallelism().map_or(1, NonZero::get));
    if IS_ALONE.get() { 1 } else { *CORES }
}

/// Runs `task` for each of `items`, on as many threads as there are cores, and returns the results in the order of `items`.
pub fn in_parallel<T: Sync, R: Send>(items: &[T], task: impl Fn(&T) -> R + Sync) -> Vec<R> {
    let next = AtomicUsize::new(0);
    let results = Mutex::new(Vec::from_iter(items.iter().map(|_| None)));
    on_threads(threads().min(items.len()), &|| {
        while let Some((at, item)) = taken(&next, items) {
            let result = task(item);
            results.lock().unwrap_or_else(PoisonError::into_inner)[at] = Some(result);
        }
    });
    results.into_inner().unwrap_or_else(PoisonError::into_inner).into_iter().flatten().collect()
}

/// The next item, and its position.
fn taken<'a, T>(next: &AtomicUsize, items: &'a [T]) -> Option<(usize, &'a T)> {
    let at = next.fetch_add(1, Ordering::Relaxed);
    Some((at, items.get(at)?))
}

/// Runs `work` on `count` threads at the same time, one of which is that of the caller: it has memory at hand that a new thread takes
/// from the system. A panic is passed on. It is not generic, so that what starts and joins threads is compiled once.
fn on_threads(count: usize, work: &(dyn Fn() + Sync)) {
    if count <= 1 {
        return work();
    }
    std::thread::scope(|scope| {
        let workers: Vec<_> = (1..count).map(|_| scope.spawn(work)).collect();
        work();
        workers.into_iter().for_each(|worker| worker.join().unwrap_or_else(|panic| resume_unwind(panic)));
    });
}

/// The results of two tasks, the second of which is done on the thread of the caller.
pub(crate) fn both<A: Send, B>(first: impl FnOnce() -> A + Send, second: impl FnOnce() -> B) -> (A, B) {
    if threads() <= 1 {
        return (first(), second());
    }
    std::thread::scope(|scope| {
        let first = scope.spawn(first);
        let second = second();
        (first.join().unwrap_or_else(|panic| resume_unwind(panic)), second)
    })
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
    let pairs: Vec<_> = changed.iter_mut().zip(others).map(Mutex::new).collect();
    in_parallel(&pairs, |pair| {
        let (changed, other) = &mut *pair.lock().unwrap_or_else(PoisonError::into_inner);
        task(changed, other);
    });
}
