//! Code shared by the tests of several crates: measured recordings, the program, generated documentation, pseudo-terminals, and the report
//! of a skipped test.
//!
//! The tests of the whole noise observatory are in `tests/`.

mod flight_log;
mod generated;
pub mod stm32f4;

/// Compiles the example with both libraries.
#[cfg(doctest)]
#[doc = include_str!("../../docs/libraries.md")]
struct Libraries;

pub use flight_log::FlightLog;
pub use generated::{generated, generated_within, writes_docs};
use serial2::SerialPort;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::os::fd::AsRawFd;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

/// Two connected pseudo-terminals whose reads and writes end after `timeout`, and the name of the second one.
pub fn pseudo_terminals(timeout: Duration) -> (SerialPort, SerialPort, String) {
    let (mut near, far) = SerialPort::pair().expect("a pseudo-terminal");
    near.set_read_timeout(timeout).and_then(|()| near.set_write_timeout(timeout)).expect("a timeout");
    let name = std::fs::read_link(format!("/proc/self/fd/{}", far.as_raw_fd())).expect("a name");
    (near, far, name.display().to_string())
}

/// The path of a measured recording in the folder of `ADIS_RECORDINGS`. If it does not exist, the test is reported as
/// skipped and should return. A test of the architecture checks that only this function reads the variable.
pub fn recording(test: &str, file: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("ADIS_RECORDINGS").map(PathBuf::from);
    let path = folder.map(|folder| folder.join(file)).filter(|path| path.exists());
    if path.is_none() {
        note_skipped(test, &format!("{file} is not in the folder that ADIS_RECORDINGS names"));
    }
    path
}

/// Reports on standard error that a test was skipped, and appends `TEST: REASON` to the file of `SKIPPED_TESTS`, from
/// which `run.sh` counts them.
pub fn note_skipped(test: &str, reason: &str) {
    // The test harness would capture the output of `eprintln!`.
    writeln!(std::io::stderr(), "skipped {test}: {reason}").expect("standard error");
    if let Some(file) = std::env::var_os("SKIPPED_TESTS") {
        let mut file = OpenOptions::new().create(true).append(true).open(file).expect("the file for skipped tests");
        // A single write keeps the lines of simultaneous tests intact.
        file.write_all(format!("{test}: {reason}\n").as_bytes()).expect("room");
    }
}

/// The path of the program: that of `IMUNOISE`, or else built by cargo in the profile of the tests.
pub fn host_sim() -> PathBuf {
    if let Some(program) = std::env::var_os("IMUNOISE") {
        return program.into();
    }
    let arguments = ["build", "--quiet", "--locked", "--package", "host-sim", "--bin", "imunoise"];
    assert!(cargo().args(arguments).status().expect("cargo runs").success(), "imunoise does not build");
    let test = std::env::current_exe().expect("the path of this test");
    test.ancestors().nth(2).expect("target/debug").join("imunoise")
}

/// The path of a program of the workspace `tests/tools`, which is built if it does not exist.
pub fn tool(name: &str) -> PathBuf {
    let target = target_folder().join("programs");
    let mut build = cargo();
    build.current_dir(workspace().join("tests/tools")).args(["programs", "--target-dir"]).arg(&target);
    let status = build.status().expect("cargo runs");
    assert!(status.success(), "{name} does not build");
    target.join("release").join(name)
}

/// A program for a microcontroller.
#[derive(Debug, Clone, Copy)]
pub struct Image<'a> {
    pub package: &'a str,
    pub program: &'a str,
    /// Rust's name of the target.
    pub target: &'a str,
    pub profile: &'a str,
    /// Further arguments of cargo, such as features.
    pub arguments: &'a [&'a str],
    /// An environment variable and its value for the compilation.
    pub variable: Option<(&'a str, &'a str)>,
}

impl Image<'_> {
    /// Builds the image `observatory-{board}` as for flashing, with `further` features, and returns the path of its
    /// ELF.
    pub fn of_board(board: &str, target: &str, further: &[&str]) -> PathBuf {
        let (feature, program) = (format!("board-{board}"), format!("observatory-{board}"));
        let copy = [&[program.as_str()], further].concat().join("-");
        let features = [&[feature.as_str()], further].concat().join(",");
        let arguments = &["--features", &features];
        Image { package: "firmware", program: &program, target, profile: "image", arguments, variable: None }
            .build(&copy)
    }

    /// Builds the program and returns the path of a copy of its ELF with the name `copy`. The copy is needed, since cargo overwrites a
    /// program that is built with other features.
    pub fn build(self, copy: &str) -> PathBuf {
        let folder = image_folder();
        // Another test may build the same program with other features.
        let _building = one_at_a_time(&folder.join("building"));
        let status = cargo()
            .args(["build", "--quiet", "--locked", "--package", self.package, "--bin", self.program])
            .args(["--target", self.target, "--profile", self.profile])
            .args(self.arguments)
            .arg("--target-dir")
            .arg(&folder)
            .envs(self.variable)
            .status()
            .expect("cargo starts");
        assert!(status.success(), "{self:?} does not build; its target comes with `rustup target add`");
        let copy = folder.join(copy).with_extension("elf");
        let built = folder.join(self.target).join(self.profile).join(self.program);
        replace(&copy, |partial| std::fs::copy(built, partial).map(drop));
        copy
    }
}

/// Runs a script of the workspace with the Python of `ADIS_PYTHON`, and returns its output; `None`, with a note, without Python.
pub fn python(test: &str, script: &str, arguments: &[&str]) -> Option<Vec<u8>> {
    let Some(python) = std::env::var_os("ADIS_PYTHON").filter(|python| Path::new(python).exists()) else {
        note_skipped(test, "ADIS_PYTHON names no Python with the packages of tests/requirements.txt");
        return None;
    };
    let output = Command::new(python).arg(workspace().join(script)).args(arguments).output().expect("Python starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Some(output.stdout)
}

/// The folder of files that other programs wrote, with their contents in `truth.json`; `None`, with a note, without Python.
pub fn recorded_samples(test: &str) -> Option<PathBuf> {
    const SCRIPT: &str = "host-sim/recordings/tests/make_samples.py";
    let script = std::fs::read(workspace().join(SCRIPT)).expect("the script");
    let folder = target_folder().join("tmp/samples");
    // The first test writes the files; they stay while the script does not change.
    let _writing = one_at_a_time(&folder.with_extension("lock"));
    let written_by = folder.join("written-by.py");
    if std::fs::read(&written_by).ok().as_ref() != Some(&script) {
        // The writers of bags refuse an existing file.
        let _ = std::fs::remove_dir_all(&folder);
        python(test, SCRIPT, &[folder.to_str().expect("UTF-8")])?;
        std::fs::write(written_by, script).expect("room");
    }
    Some(folder)
}

/// Waits until no other process holds this file, which is created with its folder. It is held until it is dropped. Each test is a process.
pub fn one_at_a_time(file: &Path) -> File {
    std::fs::create_dir_all(file.parent().expect("a folder")).expect("a folder");
    let held = File::create(file).expect("a file");
    held.lock().expect("a lock");
    held
}

/// Writes a file under another name and then renames it, since another test may read the old one.
fn replace(file: &Path, write: impl FnOnce(&Path) -> std::io::Result<()>) {
    let partial = file.with_extension(std::process::id().to_string());
    write(&partial).expect("room");
    std::fs::rename(partial, file).expect("the same folder");
}

/// The folder of the workspace.
pub fn workspace() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the tests are a folder of the workspace")
}

/// The target folder of the workspace.
pub fn target_folder() -> PathBuf {
    workspace().join(std::env::var_os("CARGO_TARGET_DIR").unwrap_or_else(|| "target".into()))
}

/// The target folder of programs for microcontrollers.
pub fn image_folder() -> PathBuf {
    target_folder().join("image")
}

/// The cargo that runs the tests, started in the workspace.
pub fn cargo() -> Command {
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.current_dir(workspace());
    cargo
}
