//! The files that a command writes: none of them is a file that it reads, whatever its name; each is complete or as it was; and one that
//! exists is overwritten where the user says so.

use crate::interrupt::IncompleteFiles;
use anyhow::{Context, Result, bail};
use recordings::file_format::files_of_bag;
use same_file::Handle;
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use tempfile::{PathPersistError, TempPath};

/// True if `-` is given for a file: standard input or standard output.
pub(crate) fn is_standard_stream(file: &Path) -> bool {
    file.as_os_str() == "-"
}

/// Place where a file is or will be, without links.
fn place(file: &Path) -> PathBuf {
    let in_folder = || Some(fs::canonicalize(folder_of(file)).ok()?.join(file.file_name()?));
    fs::canonicalize(file).ok().or_else(in_folder).unwrap_or_else(|| file.to_owned())
}

fn folder_of(file: &Path) -> &Path {
    file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Writes the files of a command that reads some others.
#[derive(Debug, Clone, Default)]
pub(crate) struct OutputFiles {
    /// Places of the files that are read; `-` is standard input.
    inputs: Vec<PathBuf>,
    overwrites: bool,
}

impl OutputFiles {
    /// Outputs of a command that reads `inputs`, where `-` is standard input; files that exist are refused unless it `overwrites` them.
    pub(crate) fn new<'a>(inputs: impl IntoIterator<Item = &'a Path>, overwrites: bool) -> Self {
        let place = |file: &Path| if is_standard_stream(file) { file.to_owned() } else { place(file) };
        let files = |input: &Path| [vec![place(input)], files_of_bag(input).unwrap_or_default()].concat();
        Self { inputs: inputs.into_iter().flat_map(files).collect(), overwrites }
    }

    /// Refuses a file that the command reads, under any of its names.
    fn check_identity(&self, file: &Path) -> Result<()> {
        // No more than two files are held open. A pipe is no output that is replaced, and must not be opened twice.
        let is_file = |file: &Path| fs::metadata(file).is_ok_and(|metadata| metadata.is_file());
        let handle = |file: &Path| if is_file(file) { Handle::from_path(file).ok() } else { None };
        let (place, output) = (place(file), handle(file));
        let is_output = |input: &PathBuf| {
            let handle = || if is_standard_stream(input) { Handle::stdin().ok() } else { handle(input) };
            *input == place || output.as_ref().is_some_and(|output| handle().as_ref() == Some(output))
        };
        if self.inputs.iter().any(is_output) {
            bail!("is an input; it would be overwritten");
        }
        Ok(())
    }

    /// Refuses an input, and a file that exists and must not be overwritten.
    fn check_name(&self, file: &Path) -> Result<()> {
        self.check_identity(file)?;
        if !self.overwrites && fs::metadata(file).is_ok_and(|metadata| metadata.is_file()) {
            bail!("exists already; -f overwrites it");
        }
        Ok(())
    }

    /// Checks before any work that `files` can be written, and that they are different ones and no inputs; `-` is standard output.
    ///
    /// # Errors
    /// Names the file.
    pub(crate) fn check_all(&self, files: &[PathBuf]) -> Result<()> {
        let mut places: Vec<PathBuf> = Vec::new();
        for file in files {
            if !is_standard_stream(file) {
                self.check(file)?;
            }
            let place = place(file);
            if places.contains(&place) {
                bail!("{}: named twice as an output", file.display());
            }
            places.push(place);
        }
        Ok(())
    }

    /// Checks before any work that `file` can be written, is no input, and does not exist unless it may be overwritten.
    ///
    /// # Errors
    /// Names the file.
    pub(crate) fn check(&self, file: &Path) -> Result<()> {
        let check = || -> Result<()> {
            self.check_name(file)?;
            match fs::metadata(file) {
                // A pipe or a device is not opened twice.
                Ok(metadata) if !metadata.is_file() && !metadata.is_dir() => return Ok(()),
                Ok(_) => drop(OpenOptions::new().write(true).open(file)?),
                Err(_) => {}
            }
            let target = target(file);
            incomplete_file(&target, IncompleteFiles::in_folder(folder_of(&target))?.path()).map(drop)
        };
        check().with_context(|| file.display().to_string())
    }

    /// Writes `content` to `file`.
    ///
    /// # Errors
    /// As [`write_with`](Self::write_with).
    pub(crate) fn write(&self, file: &Path, content: &[u8]) -> Result<()> {
        self.write_with(file, |file| Ok(fs::write(file, content)?))
    }

    /// Writes `file` with `write`, which is given a file of the same name in a folder beside it; that takes its place when it is complete.
    ///
    /// # Errors
    /// The file is an input, must not be overwritten, or cannot be written; it is then as it was. The error names it.
    pub(crate) fn write_with<R>(&self, file: &Path, write: impl FnOnce(&Path) -> Result<R>) -> Result<R> {
        let replace = || -> Result<R> {
            self.check_name(file)?;
            if fs::metadata(file).is_ok_and(|metadata| !metadata.is_file()) {
                return write(file);
            }
            let target = target(file);
            let folder = IncompleteFiles::in_folder(folder_of(&target))?;
            let incomplete = incomplete_file(&target, folder.path())?;
            let written = write(&incomplete)?;
            self.persist(incomplete, &target)?;
            Ok(written)
        };
        replace().with_context(|| file.display().to_string())
    }

    /// Gives a complete file its name.
    fn persist(&self, complete: TempPath, target: &Path) -> io::Result<()> {
        let complete = if self.overwrites {
            complete
        } else {
            match complete.persist_noclobber(target) {
                Err(PathPersistError { error, path }) if error.kind() != ErrorKind::AlreadyExists => path,
                persisted => return persisted.map_err(Into::into),
            }
        };
        // Not every file system can refuse to replace a file.
        complete.persist(target).map_err(Into::into)
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

/// An empty file in `folder` that will be `file`: with its name, by whose ending writers choose the compression, and its permissions if it
/// exists.
fn incomplete_file(file: &Path, folder: &Path) -> Result<TempPath> {
    let incomplete = folder.join(file.file_name().unwrap_or_default());
    let mut options = OpenOptions::new();
    options.write(true).create_new(true);
    #[cfg(unix)]
    {
        use std::os::unix::fs::{OpenOptionsExt, PermissionsExt};
        // Those of a new file, less what the user's mask takes.
        options.mode(fs::metadata(file).map_or(0o666, |metadata| metadata.permissions().mode()));
    }
    options.open(&incomplete)?;
    Ok(TempPath::try_from_path(incomplete)?)
}
