//! Runs the program within its limits, and checks the properties of every run.

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::Duration;

/// Limits for an input below 1 MB: seconds of processor time, MB of memory.
const MOST_SECONDS: u32 = 20;
const MOST_MB: u64 = 500;
/// Largest input for which the limits apply, bytes.
const SMALL: u64 = 1_000_000;
/// Time between two readings of the memory of a run.
const LOOK: Duration = Duration::from_millis(3);
/// Time after which a run counts as hanging, also if it uses no processor time.
const MOST_WAIT: Duration = Duration::from_secs(120);

/// Result of a run.
pub(crate) struct Run {
    /// Exit code; `None` if a signal ended the run.
    pub(crate) code: Option<i32>,
    pub(crate) stdout: Vec<u8>,
    pub(crate) errors: String,
    peak_mb: u64,
}

/// The program with its arguments, before it is started.
pub(crate) struct Program<'a> {
    pub(crate) folder: &'a Path,
    pub(crate) arguments: Vec<String>,
    /// A file for standard input.
    pub(crate) input: Option<&'a Path>,
    /// Size limit of a file in blocks of 512 bytes, as on a full disk.
    pub(crate) most_blocks: Option<u32>,
}

impl<'a> Program<'a> {
    pub(crate) fn new(folder: &'a Path, arguments: &[&str]) -> Self {
        let arguments = arguments.iter().map(|&argument| argument.to_owned()).collect();
        Self { folder, arguments, input: None, most_blocks: None }
    }

    /// Starts the program in its folder, under limits of the system for processor time and files.
    pub(crate) fn start(&self) -> Child {
        let disk = self.most_blocks.map_or_else(String::new, |blocks| format!("trap '' XFSZ; ulimit -f {blocks}; "));
        let script = format!("{disk}ulimit -t {MOST_SECONDS}; exec \"$@\"");
        let input = self.input.map_or_else(Stdio::null, |file| std::fs::File::open(file).expect("an input").into());
        Command::new("sh")
            .args(["-c", &script, "sh"])
            .arg(system_tests::host_sim())
            .args(&self.arguments)
            .current_dir(self.folder)
            .env("HOME", self.folder)
            .stdin(input)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("a shell")
    }

    pub(crate) fn run(&self) -> Run {
        Run::of(self.start())
    }
}

impl Run {
    /// Waits for the end of `child`.
    pub(crate) fn of(mut child: Child) -> Self {
        let status_file = format!("/proc/{}/status", child.id());
        let [stdout, stderr] =
            [drained(child.stdout.take().expect("a pipe")), drained(child.stderr.take().expect("a pipe"))];
        let (mut peak_mb, mut waited) = (0, Duration::ZERO);
        let status = loop {
            if let Some(status) = child.try_wait().expect("a child") {
                break status;
            }
            peak_mb = peak_mb.max(peak(&status_file));
            thread::sleep(LOOK);
            waited += LOOK;
            assert!(waited < MOST_WAIT, "a run that does not end");
        };
        let [stdout, stderr] = [stdout, stderr].map(|reader| reader.join().expect("a reader"));
        Self { code: status.code(), stdout, errors: String::from_utf8_lossy(&stderr).into_owned(), peak_mb }
    }

    /// The fault of a run on `bytes` bytes of input, if any; its exit code must be one of `codes`.
    pub(crate) fn fault(&self, codes: &[i32], bytes: u64) -> Option<String> {
        let Some(code) = self.code else { return Some("a signal ended it: no end within its bounds".to_owned()) };
        if !codes.contains(&code) {
            return Some(format!("exit code {code}"));
        }
        if bytes < SMALL && self.peak_mb > MOST_MB {
            return Some(format!("{} MB", self.peak_mb));
        }
        let is_unprintable = |letter: char| letter.is_control() && letter != '\n';
        if self.errors.contains(is_unprintable) || String::from_utf8_lossy(&self.stdout).contains(is_unprintable) {
            return Some("a control character".to_owned());
        }
        let lines: Vec<&str> = self.errors.lines().filter(|line| !line.starts_with("note: ")).collect();
        match (code, lines.as_slice()) {
            (0, []) | (2, [_, ..]) => None,
            (0, _) => Some("messages of a run that succeeds".to_owned()),
            (3, [warning]) if warning.starts_with("warning: ") => None,
            // An error has one line; or it is followed by the table of columns and a command, or, without a known
            // column, by the options that assign columns.
            (_, [error, rest @ ..])
                if error.starts_with("error: ")
                    && error.len() < 2000
                    && (rest.is_empty()
                        || rest.iter().any(|line| {
                            line.starts_with("  imunoise ") || line.contains("; say which with --columns ")
                        })) =>
            {
                None
            }
            _ => Some("no clear error".to_owned()),
        }
    }
}

/// Reads everything that comes through a pipe.
fn drained(mut pipe: impl std::io::Read + Send + 'static) -> thread::JoinHandle<Vec<u8>> {
    thread::spawn(move || {
        let mut all = Vec::new();
        // The pipe ends with the process.
        let _ = pipe.read_to_end(&mut all);
        all
    })
}

/// The largest memory of a process so far, MB.
fn peak(status_file: &str) -> u64 {
    let text = std::fs::read_to_string(status_file).unwrap_or_default();
    let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|line| line.split_whitespace().next()?.parse::<u64>().ok()).map_or(0, |kilobytes| kilobytes / 1024)
}
