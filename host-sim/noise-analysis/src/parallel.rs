//! Threads and cancellation of an analysis. It uses as many threads as there are cores, or as many as the caller says: one if the
//! recordings themselves are analysed side by side. The result does not depend on the number.

use measurement::{ChannelId, PerChannel};
use std::cell::{Cell, RefCell};
use std::mem;
use std::num::NonZero;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::rc::Rc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{LazyLock, Mutex, PoisonError};

thread_local! {
    static MOST_THREADS: Cell<usize> = const { Cell::new(usize::MAX) };
    static IS_CANCELLED: RefCell<Option<Rc<dyn Fn() -> bool>>> = const { RefCell::new(None) };
}

/// Runs `task`, and all that it analyses, on the thread of the caller alone.
pub fn on_one_thread<R>(task: impl FnOnce() -> R) -> R {
    on_at_most(1, task)
}

/// Runs `task`, and all that it analyses, on at most so many threads, one of which is that of the caller.
pub fn on_at_most<R>(threads: usize, task: impl FnOnce() -> R) -> R {
    /// Takes the restriction away again, also where the task panics.
    struct Restore(usize);
    impl Drop for Restore {
        fn drop(&mut self) {
            MOST_THREADS.set(self.0);
        }
    }
    let _restore = Restore(MOST_THREADS.replace(threads.max(1)));
    task()
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cancelled;

/// Runs `task` on this thread; an analysis in it ends soon after `is_cancelled`, which is asked many times a second, is true.
///
/// # Errors
/// It was cancelled.
pub fn cancellable<R>(is_cancelled: impl Fn() -> bool + 'static, task: impl FnOnce() -> R) -> Result<R, Cancelled> {
    let before = IS_CANCELLED.replace(Some(Rc::new(is_cancelled)));
    // A task that panics drops what it holds, so no half-done state is seen.
    let result = catch_unwind(AssertUnwindSafe(task));
    IS_CANCELLED.set(before);
    result.map_err(|panic| if panic.is::<Cancelled>() { Cancelled } else { resume_unwind(panic) })
}

/// Ends the task of [`cancellable`] by unwinding, if it is cancelled.
fn end_if_cancelled() {
    let is_cancelled = IS_CANCELLED.with_borrow(Option::clone);
    if is_cancelled.is_some_and(|is_cancelled| is_cancelled()) {
        resume_unwind(Box::new(Cancelled));
    }
}

/// Threads that the analysis may use on this thread.
#[must_use]
pub fn threads() -> usize {
    /// Asked for once: the system answers out of several files.
    static CORES: LazyLock<usize> = LazyLock::new(|| std::thread::available_parallelism().map_or(1, NonZero::get));
    MOST_THREADS.get().min(*CORES)
}

/// Runs `task` for each of `items`, on as many threads as there are cores, and returns the results in the order of `items`.
pub fn in_parallel<T: Sync, R: Send>(items: &[T], task: impl Fn(&T) -> R + Sync) -> Vec<R> {
    let next = AtomicUsize::new(0);
    let results = Mutex::new(Vec::from_iter(items.iter().map(|_| None)));
    on_threads(threads().min(items.len()), &|| {
        while let Some((at, item)) = taken(&next, items) {
            // The other threads take no more either.
            let rest = Rest(&next, items.len());
            end_if_cancelled();
            let result = task(item);
            mem::forget(rest);
            results.lock().unwrap_or_else(PoisonError::into_inner)[at] = Some(result);
        }
    });
    results.into_inner().unwrap_or_else(PoisonError::into_inner).into_iter().flatten().collect()
}

/// Takes all other items away when it is dropped.
struct Rest<'a>(&'a AtomicUsize, usize);

impl Drop for Rest<'_> {
    fn drop(&mut self) {
        self.0.store(self.1, Ordering::Relaxed);
    }
}

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
        // Their own tasks share the number of threads, if that is limited.
        let most = MOST_THREADS.get();
        let of_each = if most == usize::MAX { most } else { most / count };
        let workers: Vec<_> = (1..count).map(|_| scope.spawn(move || on_at_most(of_each, work))).collect();
        let work = || on_at_most(of_each, work);
        work();
        workers.into_iter().for_each(|worker| worker.join().unwrap_or_else(|panic| resume_unwind(panic)));
    });
}

/// The results of two tasks, the second of which is done on the thread of the caller.
pub(crate) fn both<A: Send, B>(first: impl FnOnce() -> A + Send, second: impl FnOnce() -> B) -> (A, B) {
    end_if_cancelled();
    if threads() <= 1 {
        return (first(), second());
    }
    std::thread::scope(|scope| {
        let most = MOST_THREADS.get();
        let of_each = if most == usize::MAX { most } else { most / 2 };
        let first = scope.spawn(move || on_at_most(of_each, first));
        let second = on_at_most(of_each, second);
        (first.join().unwrap_or_else(|panic| resume_unwind(panic)), second)
    })
}

/// Applies `task` to each channel, on as many threads as there are cores.
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
