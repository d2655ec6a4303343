//! The files that a command writes. None of them is one of its inputs, under any name. Each is either complete or unchanged. An existing
//! file is overwritten only if the user allows it.

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

/// Path of an existing or future file, without links.
fn place(file: &Path) -> PathBuf {
    let in_folder = || Some(fs::canonicalize(folder_of(file)).ok()?.join(file.file_name()?));
    fs::canonicalize(file).ok().or_else(in_folder).unwrap_or_else(|| file.to_owned())
}

fn folder_of(file: &Path) -> &Path {
    file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Writes the output files of a command with the given inputs.
#[derive(Debug, Clone, Default)]
pub(crate) struct OutputFiles {
    /// Paths of the input files; `-` is standard input.
    inputs: Vec<PathBuf>,
    overwrites: bool,
}

impl OutputFiles {
    /// Outputs of a command that reads `inputs`, where `-` is standard input. Unless it `overwrites`, existing files are refused.
    pub(crate) fn new<'a>(inputs: impl IntoIterator<Item = &'a Path>, overwrites: bool) -> Self {
        let place = |file: &Path| if is_standard_stream(file) { file.to_owned() } else { place(file) };
        let files = |input: &Path| [vec![place(input)], files_of_bag(input).unwrap_or_default()].concat();
        Self { inputs: inputs.into_iter().flat_map(files).collect(), overwrites }
    }

    /// Refuses a file that the command reads, under any of its names.
    fn check_identity(&self, file: &Path) -> Result<()> {
        // At most two files are open at once. A pipe is not replaced, and must not be opened twice.
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

    /// Checks before any work that `files` can be written, are different, and are not inputs; `-` is standard output.
    ///
    /// # Errors
    /// The error names the file.
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

    /// Checks before any work that `file` can be written, is not an input, and does not exist unless it may be
    /// overwritten.
    ///
    /// # Errors
    /// The error names the file.
    pub(crate) fn check(&self, file: &Path) -> Result<()> {
        let check = || -> Result<()> {
            self.check_name(file)?;
            match fs::metadata(file) {
                // A pipe or a device must not be opened twice.
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
    /// Those of [`write_with`](Self::write_with).
    pub(crate) fn write(&self, file: &Path, content: &[u8]) -> Result<()> {
        self.write_with(file, |file| Ok(fs::write(file, content)?))
    }

    /// Writes a file of the same name in a folder beside `file` with `write`. When it is complete, it replaces `file`.
    ///
    /// # Errors
    /// The file is an input, must not be overwritten, or cannot be written. It is unchanged then, and the error names
    /// it.
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

    /// Moves a complete file to its name.
    fn persist(&self, complete: TempPath, target: &Path) -> io::Result<()> {
        let complete = if self.overwrites {
            complete
        } else {
            match complete.persist_noclobber(target) {
                Err(PathPersistError { error, path }) if error.kind() != ErrorKind::AlreadyExists => path,
                persisted => return persisted.map_err(Into::into),
            }
        };
        // Some file systems cannot refuse to replace a file.
        complete.persist(target).map_err(Into::into)
    }

    /// Writes `file` through a buffer.
    ///
    /// # Errors
    /// Those of [`write_with`](Self::write_with).
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

/// The file to be replaced: the target of `file` if it is a link.
fn target(file: &Path) -> PathBuf {
    fs::canonicalize(file).unwrap_or_else(|_| file.to_owned())
}

/// Creates an empty file in `folder` that will become `file`. It has the same name, since writers choose the compression by its ending, and
/// the same permissions if `file` exists.
fn incomplete_file(file: &Path, folder: &Path) -> Result<TempPath> {
    let incomplete = folder.join(file.file_name().unwrap_or_default());
    let mut options = OpenOptions::new();
    options.write(true).create_new(true);
    #[cfg(unix)]
    {
        use std::os::unix::fs::{OpenOptionsExt, PermissionsExt};
        // A new file has the default permissions less the user's mask.
        options.mode(fs::metadata(file).map_or(0o666, |metadata| metadata.permissions().mode()));
    }
    options.open(&incomplete)?;
    Ok(TempPath::try_from_path(incomplete)?)
}
