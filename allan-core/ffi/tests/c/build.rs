//! Builds the static library, and C programs with it.

#[path = "../../smaller.rs"]
mod smaller;

use std::path::{Path, PathBuf};
use std::process::Command;
use tempfile::TempDir;

pub(crate) const ARM_GCC: &str = "arm-none-eabi-gcc";

/// A microcontroller: Rust's target, the compiler's options, and the board that QEMU emulates.
pub(crate) struct ArmTarget {
    pub(crate) name: &'static str,
    options: &'static [&'static str],
    board: &'static str,
}

/// For the Cortex-M0+, whose board QEMU lacks, a Cortex-M3 executes the instructions of ARMv6-M.
pub(crate) const ARM_TARGETS: [ArmTarget; 2] = [
    ArmTarget {
        name: "thumbv7em-none-eabihf",
        options: &["-mcpu=cortex-m4", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"],
        board: "mps2-an386",
    },
    ArmTarget { name: "thumbv6m-none-eabi", options: &["-mcpu=cortex-m0plus"], board: "mps2-an385" },
];

/// A file of this crate.
pub(crate) fn ours(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// True if a tool starts.
pub(crate) fn tool(name: &str) -> bool {
    Command::new(name).arg("--version").output().is_ok()
}

/// The output of a command that must succeed.
pub(crate) fn run(command: &mut Command) -> String {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let (text, errors) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{command:?}: {}\n{text}\n{errors}", output.status);
    text.into_owned()
}

/// The header that cbindgen makes of the sources.
pub(crate) fn header_text() -> String {
    let folder = tempfile::tempdir().expect("a folder");
    let larger = std::fs::read_to_string(ours("src/cascade_24_8.rs")).expect("a source file");
    std::fs::write(folder.path().join("cascade_20_4.rs"), smaller::smaller(&larger)).expect("room");
    let mut header = Command::new(system_tests::tool("c-header"));
    header.arg(ours("."));
    for file in ["status", "storage", "cascade_24_8", "cascade_20_4", "quantizer", "curve", "model", "trace"] {
        let made = folder.path().join(format!("{file}.rs"));
        header.arg(if made.exists() { made } else { ours(&format!("src/{file}.rs")) });
    }
    run(&mut header)
}

/// The static library for a target, compiled for size, or for this machine.
pub(crate) fn library(target: Option<&str>) -> PathBuf {
    // For this machine as the tests are compiled: the assertions and the checks for overflow are on.
    let (folder, profile) = match target {
        Some(_) => (system_tests::image_folder(), "image"),
        None => (system_tests::target_folder(), "dev"),
    };
    let mut cargo = system_tests::cargo();
    cargo.args(["build", "--quiet", "--package", "allan-core-ffi", "--locked", "--profile", profile]);
    cargo.arg("--target-dir").arg(&folder);
    if let Some(target) = target {
        cargo.args(["--target", target]);
    }
    run(&mut cargo);
    let profile = if profile == "dev" { "debug" } else { profile };
    folder.join(target.unwrap_or("")).join(profile).join("liballan_core.a")
}

/// Copies the library, the header and the files for CMake and pkg-config to where users have them.
pub(crate) fn install(folder: &Path) -> PathBuf {
    let prefix = folder.join("prefix");
    run(Command::new("sh").arg(ours("install.sh")).arg(library(None)).arg(&prefix));
    prefix
}

/// Bytes of flash of a program without start-up code, of which the macro `part` chooses the calls.
pub(crate) fn flash_bytes(target: &ArmTarget, source: &Path, part: &str) -> u32 {
    let folder = tempfile::tempdir().expect("a folder");
    let program = folder.path().join("program");
    let mut compiler = Command::new(ARM_GCC);
    compiler.args(["-mthumb", "-Os", "-Wall", "-Wextra", "-Werror", "-nostartfiles", "-Wl,-ereset,--gc-sections"]);
    compiler.args(target.options).arg(format!("-D{part}")).arg("-I").arg(ours("include")).arg(source);
    run(compiler.arg(library(Some(target.name))).arg("-lm").arg("-o").arg(&program));
    let sizes = run(Command::new("arm-none-eabi-size").arg(&program));
    // A row of titles; then code with constants, and initialised data, both of which lie in the flash.
    let row = sizes.lines().nth(1).expect("a row of sizes");
    row.split_whitespace().take(2).map(|size| size.parse::<u32>().expect("a size")).sum()
}

/// A linked program.
pub(crate) struct Program {
    folder: TempDir,
    command: Command,
}

impl Program {
    fn linked(sources: &[PathBuf], mut compiler: Command, libraries: &[&str], library: &Path) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("program");
        compiler.args(["-std=c11", "-Wall", "-Wextra", "-Werror", "-I"]).arg(ours("include"));
        run(compiler.args(sources).arg(library).args(libraries).arg("-o").arg(&path));
        Self { command: Command::new(path), folder }
    }

    /// A program for this machine.
    pub(crate) fn on_host(sources: &[PathBuf], options: &[&str]) -> Self {
        let mut compiler = Command::new("cc");
        compiler.args(options);
        Self::linked(sources, compiler, &["-lm", "-lpthread", "-ldl"], &library(None))
    }

    /// A program for an emulated board.
    pub(crate) fn on_board(sources: &[PathBuf], target: &ArmTarget) -> Self {
        let mut compiler = Command::new(ARM_GCC);
        compiler.args(["-mthumb", "-Os", "--specs=rdimon.specs"]).args(target.options);
        compiler.arg("-T").arg(ours("tests/programs/board.ld")).arg(ours("tests/programs/startup.c"));
        Self::linked(sources, compiler, &["-lm"], &library(Some(target.name)))
    }

    /// The command that runs it.
    pub(crate) fn command(&mut self) -> &mut Command {
        &mut self.command
    }

    /// The command that runs it in the emulator.
    pub(crate) fn emulated(&self, target: &ArmTarget) -> Command {
        let mut qemu = Command::new("qemu-system-arm");
        qemu.args(["-M", target.board, "-nographic", "-monitor", "none", "-serial", "none"]);
        qemu.args(["-semihosting-config", "enable=on,target=native", "-kernel"])
            .arg(self.folder.path().join("program"));
        qemu
    }
}
