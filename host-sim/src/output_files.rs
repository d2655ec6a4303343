//! The files that a command writes: none of them is a file that it reads, whatever its name, and each is complete or as it was.

use crate::interrupt::IncompleteFile;
use anyhow::{Context, Result, bail};
use std::fs::{self, File, OpenOptions};
#[cfg(unix)]
use std::io;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// Longest ending of the name of a file that the one beside it keeps, bytes: writers choose the compression by it.
const LONGEST_ENDING: usize = 32;

/// What a name stands for: a file that exists, or one that does not.
#[derive(Debug, Clone, PartialEq, Eq)]
enum FileIdentity {
    /// Device and inode, which all names and links of a file have in common. No file is held open for it.
    #[cfg(unix)]
    Inode(u64, u64),
    /// The path without links.
    Name(PathBuf),
}

impl FileIdentity {
    fn new(file: &Path) -> Self {
        #[cfg(unix)]
        if let Some(identity) = Self::of_existing(file) {
            return identity;
        }
        let name = || {
            let folder = fs::canonicalize(folder_of(file));
            folder.map_or(file.to_owned(), |folder| folder.join(file.file_name().unwrap_or_default()))
        };
        Self::Name(fs::canonicalize(file).unwrap_or_else(|_| name()))
    }

    #[cfg(unix)]
    fn of_existing(file: &Path) -> Option<Self> {
        use std::os::fd::AsFd;
        use std::os::unix::fs::MetadataExt;
        let metadata = if is_standard_stream(file) {
            io::stdin().as_fd().try_clone_to_owned().and_then(|stdin| File::from(stdin).metadata())
        } else {
            fs::metadata(file)
        };
        metadata.ok().map(|metadata| Self::Inode(metadata.dev(), metadata.ino()))
    }
}

/// Whether `-` is given for a file: standard input or standard output.
pub(crate) fn is_standard_stream(file: &Path) -> bool {
    file.as_os_str() == "-"
}

fn folder_of(file: &Path) -> &Path {
    file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Writes the files of a command that reads some others.
#[derive(Debug, Clone, Default)]
pub(crate) struct OutputFiles {
    inputs: Vec<FileIdentity>,
}

impl OutputFiles {
    /// Of a command that reads `inputs`; `-` is standard input.
    pub(crate) fn beside<'a>(inputs: impl IntoIterator<Item = &'a Path>) -> Self {
        Self { inputs: inputs.into_iter().map(FileIdentity::new).collect() }
    }

    /// Refuses a file that the command reads.
    fn check_identity(&self, file: &Path) -> Result<()> {
        if self.inputs.contains(&FileIdentity::new(file)) {
            bail!("is an input; it would be overwritten");
        }
        Ok(())
    }

    /// Checks before any work that `files` can be written, and that they are different ones and no inputs.
    ///
    /// # Errors
    /// Names the file.
    pub(crate) fn check_all(&self, files: &[&Path]) -> Result<()> {
        for (position, file) in files.iter().enumerate() {
            self.check(file)?;
            let identity = FileIdentity::new(file);
            if files[..position].iter().any(|other| FileIdentity::new(other) == identity) {
                bail!("{}: named twice as an output", file.display());
            }
        }
        Ok(())
    }

    /// Checks before any work that `file` can be written and is no input. A file that exists keeps its content.
    ///
    /// # Errors
    /// Names the file.
    pub(crate) fn check(&self, file: &Path) -> Result<()> {
        let check = || -> Result<()> {
            self.check_identity(file)?;
            match fs::metadata(file) {
                // A pipe or a device is not opened twice.
                Ok(metadata) if !metadata.is_file() && !metadata.is_dir() => return Ok(()),
                Ok(_) => drop(OpenOptions::new().write(true).open(file)?),
                Err(_) => {}
            }
            file_beside(&target(file)).map(drop)?;
            Ok(())
        };
        check().with_context(|| file.display().to_string())
    }

    /// Refuses a `folder` in which a name with one of `endings`, which the command may write, is that of an input.
    ///
    /// # Errors
    /// Names the file.
    pub(crate) fn check_folder(&self, folder: &Path, endings: &[&str]) -> Result<()> {
        let entries = fs::read_dir(folder).with_context(|| folder.display().to_string())?;
        for file in entries.filter_map(|entry| Some(entry.ok()?.path())) {
            if file.extension().is_some_and(|ending| endings.iter().any(|known| ending == *known)) {
                self.check_identity(&file).with_context(|| file.display().to_string())?;
            }
        }
        Ok(())
    }

    /// Writes `content` to `file`.
    ///
    /// # Errors
    /// As [`write_with`](Self::write_with).
    pub(crate) fn write(&self, file: &Path, content: &[u8]) -> Result<()> {
        self.write_with(file, |file| Ok(fs::write(file, content)?))
    }

    /// Writes `file` with `write`, which is given a file of the same ending beside it; that takes the name when it is complete.
    ///
    /// # Errors
    /// The file is an input, or cannot be written; it is then as it was. The error names it.
    pub(crate) fn write_with<R>(&self, file: &Path, write: impl FnOnce(&Path) -> Result<R>) -> Result<R> {
        let replace = || -> Result<R> {
            self.check_identity(file)?;
            let metadata = fs::metadata(file);
            if metadata.is_ok_and(|metadata| !metadata.is_file()) {
                return write(file);
            }
            let target = target(file);
            let beside = file_beside(&target)?;
            let incomplete = IncompleteFile::new(beside.path());
            let written = write(beside.path())?;
            beside.persist(&target)?;
            drop(incomplete);
            Ok(written)
        };
        replace().with_context(|| file.display().to_string())
    }

    /// Writes `file` through a buffer.
    ///
    /// # Errors
    /// As [`write_with`](Self::write_with).
    pub(crate) fn write_buffered(
        &self,
        file: &Path,
        write: impl FnOnce(&mut BufWriter<File>) -> Result<()>,
    ) -> Result<()> {
        self.write_with(file, |file| {
            let mut out = BufWriter::new(File::create(file)?);
            write(&mut out)?;
            Ok(out.flush()?)
        })
    }
}

/// The file that `file` leads to, which is replaced, and not a link to it.
fn target(file: &Path) -> PathBuf {
    fs::canonicalize(file).unwrap_or_else(|_| file.to_owned())
}

/// An empty file beside `file`, with its ending, and its permissions if it exists.
fn file_beside(file: &Path) -> Result<NamedTempFile> {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let start = (name.len().saturating_sub(LONGEST_ENDING)..=name.len()).find(|at| name.is_char_boundary(*at));
    let ending = start.map_or("", |start| &name[start..]);
    let mut beside = tempfile::Builder::new();
    beside.prefix(".").suffix(ending);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // Those of a new file, less what the user's mask takes.
        let mode = fs::metadata(file).map_or(0o666, |metadata| metadata.permissions().mode());
        beside.permissions(fs::Permissions::from_mode(mode));
    }
    Ok(beside.tempfile_in(folder_of(file))?)
}
