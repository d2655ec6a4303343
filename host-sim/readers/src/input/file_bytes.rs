//! Re-readable bytes: file, copy or memory.

use crate::input::{InputError, Reason};
use std::fs::{self, File};
use std::io::{self, Cursor, ErrorKind, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tempfile::NamedTempFile;

/// Bytes under the user's name, shared by clones.
#[derive(Debug, Clone)]
pub struct FileBytes {
    name: PathBuf,
    /// `None` for the file itself.
    copy: Option<BytesCopy>,
    /// Compression whose data end early, so that these bytes do.
    cut: Option<&'static str>,
}

#[derive(Debug, Clone)]
enum BytesCopy {
    File(Arc<NamedTempFile>),
    Memory(Arc<[u8]>),
}

impl<P: AsRef<Path> + ?Sized> From<&P> for FileBytes {
    fn from(file: &P) -> Self {
        Self { name: file.as_ref().to_owned(), copy: None, cut: None }
    }
}

impl From<&Self> for FileBytes {
    fn from(bytes: &Self) -> Self {
        bytes.clone()
    }
}

impl FileBytes {
    pub fn in_memory(name: &Path, bytes: impl Into<Arc<[u8]>>) -> Self {
        Self { name: name.to_owned(), copy: Some(BytesCopy::Memory(bytes.into())), cut: None }
    }

    pub fn in_temporary_file(name: &Path, file: NamedTempFile) -> Self {
        Self { name: name.to_owned(), copy: Some(BytesCopy::File(Arc::new(file))), cut: None }
    }

    /// Perhaps decompressed from `compression`, in a temporary file if possible; up to its early end.
    pub(crate) fn copied(name: &Path, mut input: impl Read, compression: &'static str) -> io::Result<Self> {
        let cut = |copied: io::Result<_>| match copied {
            Err(error) if error.kind() == ErrorKind::UnexpectedEof => Ok(Some(compression)),
            copied => copied.map(|_| None),
        };
        if cfg!(target_family = "wasm") {
            let mut bytes = Vec::new();
            let cut = cut(input.read_to_end(&mut bytes).map(|read| read as u64))?;
            return Ok(Self { cut, ..Self::in_memory(name, bytes) });
        }
        let mut copy = NamedTempFile::new()?;
        let cut = cut(io::copy(&mut input, &mut copy))?;
        copy.flush()?;
        Ok(Self { cut, ..Self::in_temporary_file(name, copy) })
    }

    pub(crate) fn cut(&self) -> Option<&'static str> {
        self.cut
    }

    /// As the user named it.
    #[must_use]
    pub fn name(&self) -> &Path {
        &self.name
    }

    /// `None` in memory.
    pub(crate) fn file(&self) -> Option<&Path> {
        match &self.copy {
            None => Some(&self.name),
            Some(BytesCopy::File(file)) => Some(file.path()),
            Some(BytesCopy::Memory(_)) => None,
        }
    }

    /// Opens them at their beginning.
    pub fn open(&self) -> io::Result<OpenBytes> {
        match (&self.copy, self.file()) {
            (Some(BytesCopy::Memory(bytes)), _) => Ok(OpenBytes::Memory(Cursor::new(Arc::clone(bytes)))),
            (_, file) => File::open(file.unwrap_or(&self.name)).map(OpenBytes::File),
        }
    }

    pub fn head(&self, most: u64) -> io::Result<Vec<u8>> {
        let mut head = Vec::new();
        self.open()?.take(most).read_to_end(&mut head)?;
        Ok(head)
    }

    /// `None` of a pipe.
    pub(crate) fn length(&self) -> io::Result<Option<u64>> {
        match (&self.copy, self.file()) {
            (Some(BytesCopy::Memory(bytes)), _) => Ok(Some(bytes.len() as u64)),
            (_, file) => {
                let metadata = fs::metadata(file.unwrap_or(&self.name))?;
                Ok(Some(metadata.len()).filter(|_| metadata.is_file()))
            }
        }
    }

    /// A fault of the file as a whole.
    #[must_use]
    pub fn error(&self, reason: Reason) -> InputError {
        InputError::file(&self.name, reason)
    }
}

pub enum OpenBytes {
    File(File),
    Memory(Cursor<Arc<[u8]>>),
}

impl Read for OpenBytes {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::File(file) => file.read(buffer),
            Self::Memory(bytes) => bytes.read(buffer),
        }
    }
}

impl Seek for OpenBytes {
    fn seek(&mut self, position: SeekFrom) -> io::Result<u64> {
        match self {
            Self::File(file) => file.seek(position),
            Self::Memory(bytes) => bytes.seek(position),
        }
    }
}
