//! SHA-256 of a file.

use crate::input::{FileBytes, OpenBytes, may_begin_threads};
use sha2::{Digest, Sha256};
use std::fmt::Write as _;
use std::io::{self, ErrorKind, Read};
use std::thread::{self, JoinHandle};

const PART_BYTES: usize = 1 << 18;

/// Made on another thread if allowed.
#[derive(Debug)]
pub struct FileHash(HashState);

#[derive(Debug)]
enum HashState {
    Running(JoinHandle<io::Result<String>>),
    Made(io::Result<String>),
}

impl FileHash {
    /// Begins to read `files` in order.
    pub fn begin(files: &[FileBytes]) -> io::Result<Self> {
        let inputs: Vec<OpenBytes> = files.iter().map(FileBytes::open).collect::<Result<_, _>>()?;
        Ok(Self(if may_begin_threads() {
            HashState::Running(thread::Builder::new().spawn(move || sha256(inputs))?)
        } else {
            HashState::Made(sha256(inputs))
        }))
    }

    /// In hexadecimal digits.
    pub fn finish(self) -> io::Result<String> {
        match self.0 {
            HashState::Running(thread) => {
                thread.join().unwrap_or_else(|_| Err(io::Error::other("the hash was not made")))
            }
            HashState::Made(hash) => hash,
        }
    }
}

fn sha256(inputs: impl IntoIterator<Item = impl Read>) -> io::Result<String> {
    let mut hash = Sha256::new();
    let mut part = vec![0; PART_BYTES];
    for mut input in inputs {
        loop {
            match input.read(&mut part) {
                Ok(0) => break,
                Ok(count) => hash.update(&part[..count]),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
    }
    let mut text = String::new();
    for byte in hash.finalize() {
        let _ = write!(text, "{byte:02x}");
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::sha256;

    /// FIPS 180-2, appendix B.
    #[test]
    fn the_published_examples_have_their_hashes() {
        for (message, expected) in [
            (b"abc".to_vec(), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"),
            (vec![b'a'; 1_000_000], "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0"),
        ] {
            assert_eq!(sha256([message.as_slice()]).expect("memory"), expected);
        }
    }
}
