//! The next part of a file on another thread.

use std::io::{self, ErrorKind, Read};
use std::panic::resume_unwind;
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::Duration;

const PART_BYTES: usize = 1 << 16;
const PARTS_AHEAD: usize = 4;

pub(crate) struct ReadAhead {
    parts: Receiver<io::Result<Vec<u8>>>,
    /// `None` after the end.
    thread: Option<JoinHandle<()>>,
    part: Vec<u8>,
    read: usize,
}

impl ReadAhead {
    /// Reads `input` until its end, an error, or a drop; an error if the system has no thread left.
    pub(crate) fn new(mut input: impl Read + Send + 'static) -> io::Result<Self> {
        let (send, parts) = sync_channel(PARTS_AHEAD);
        let read_all = move || {
            loop {
                let mut part = vec![0; PART_BYTES];
                let read = match input.read(&mut part) {
                    Ok(0) => return,
                    Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                    read => read,
                };
                let is_failed = read.is_err();
                let read = read.map(|count| {
                    part.truncate(count);
                    part
                });
                if send.send(read).is_err() || is_failed {
                    return;
                }
            }
        };
        let thread = Some(thread::Builder::new().spawn(read_all)?);
        Ok(Self { parts, thread, part: Vec::new(), read: 0 })
    }

    /// The next bytes of a pipe, none if there are none within `wait`; `None` at the end.
    pub(crate) fn next_part(&self, wait: Duration) -> io::Result<Option<Vec<u8>>> {
        match self.parts.recv_timeout(wait) {
            Ok(part) => part.map(Some),
            Err(RecvTimeoutError::Timeout) => Ok(Some(Vec::new())),
            Err(RecvTimeoutError::Disconnected) => Ok(None),
        }
    }
}

impl Read for ReadAhead {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while self.read == self.part.len() {
            match self.parts.recv() {
                Ok(part) => (self.part, self.read) = (part?, 0),
                Err(_) => {
                    // A panic of the reader is passed on.
                    self.thread.take().map_or(Ok(()), JoinHandle::join).unwrap_or_else(|panic| resume_unwind(panic));
                    return Ok(0);
                }
            }
        }
        let count = (&self.part[self.read..]).read(buffer)?;
        self.read += count;
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Some bytes, then an error.
    struct Damaged {
        given: usize,
        count: usize,
    }

    impl Read for Damaged {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            if self.given == self.count {
                return Err(ErrorKind::InvalidInput.into());
            }
            let count = buffer.len().min(1000).min(self.count - self.given);
            buffer[..count].iter_mut().zip(self.given..).for_each(|(byte, at)| *byte = at as u8);
            self.given += count;
            Ok(count)
        }
    }

    #[test]
    fn all_bytes_before_an_error_are_read_and_then_the_error() {
        for count in [0, 1, PART_BYTES, 10 * PART_BYTES + 7] {
            let mut bytes = Vec::new();
            let error = ReadAhead::new(Damaged { given: 0, count }).unwrap().read_to_end(&mut bytes).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::InvalidInput);
            assert_eq!(bytes, (0..count).map(|at| at as u8).collect::<Vec<u8>>());
        }
    }

    #[test]
    fn a_reader_that_is_not_read_to_its_end_ends_its_thread() {
        let (ended, wait) = sync_channel::<()>(1);
        struct Endless(#[expect(dead_code, reason = "dropped with the thread")] std::sync::mpsc::SyncSender<()>);
        impl Read for Endless {
            fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
                Ok(buffer.len())
            }
        }
        let mut reader = ReadAhead::new(Endless(ended)).unwrap();
        reader.read_exact(&mut [0; 10]).unwrap();
        drop(reader);
        assert!(wait.recv().is_err());
    }
}
