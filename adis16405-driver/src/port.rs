//! The border between procedures, which know the part, and shells, which know the bus.
//!
//! A procedure is an `async fn` that never waits for anything but the answer to a [`Step`] it has asked for. A shell
//! polls it, carries each step out (blocking or asynchronous, it makes no difference) and puts the answer back. So every
//! protocol sequence exists once, without I/O in it, and can be driven by a test without a bus.

use core::cell::Cell;
use core::future::poll_fn;
use core::pin::Pin;
use core::task::{Context, Poll, Waker};

/// One thing that a shell does for a procedure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Step {
    /// Exchange a 16-bit frame in a transaction of its own, with a stall at its end.
    Frame { request: [u8; 2], stall_ns: u32 },
    /// Hold chip select low without a clock.
    Select { ns: u32 },
    /// Leave the bus alone.
    Pause { us: u32 },
}

/// Where steps and answers change hands.
#[derive(Debug)]
pub(crate) struct Port {
    step: Cell<Step>,
    answer: Cell<Option<[u8; 2]>>,
}

impl Port {
    pub(crate) const fn new() -> Self {
        Self { step: Cell::new(Step::Pause { us: 0 }), answer: Cell::new(None) }
    }

    /// Procedure's side: asks for a step and waits for its answer.
    pub(crate) async fn perform(&self, step: Step) -> [u8; 2] {
        self.step.set(step);
        poll_fn(|_| match self.answer.take() {
            Some(answer) => Poll::Ready(answer),
            None => Poll::Pending,
        })
        .await
    }

    /// Shell's side: runs the procedure up to its next step, or to its end.
    pub(crate) fn resume<T>(&self, procedure: Pin<&mut impl Future<Output = T>>) -> Result<T, Step> {
        // A procedure is woken by its answer alone.
        match procedure.poll(&mut Context::from_waker(Waker::noop())) {
            Poll::Ready(output) => Ok(output),
            Poll::Pending => Err(self.step.get()),
        }
    }

    /// Shell's side: what the part sent during a frame; zeros for the other steps.
    pub(crate) fn answer(&self, answer: [u8; 2]) {
        self.answer.set(Some(answer));
    }
}
