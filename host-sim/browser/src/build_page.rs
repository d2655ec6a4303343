//! `cargo run -p browser -- [--quick] [FOLDER [UF2]]` builds the page. FOLDER/index.html has the program beside it, for a web server;
//! FOLDER/observatory.html has everything in one file, to be opened from a disk. FOLDER is `target/browser` if not given. UF2 is the image
//! of the Pico that the page offers. `--quick` builds faster, but a larger and slower program.

use clap::ValueEnum;
use flate2::Compression;
use flate2::write::GzEncoder;
use recordings::serial;
use reports::export::ExportFormat;
use sha2::{Digest, Sha256};
use std::collections::VecDeque;
use std::error::Error;
use std::ffi::OsString;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::{env, fs};

const PAGE: &str = include_str!("../page/page.html");
/// The style of the page, which follows the style of a report.
const STYLE: &str = include_str!("../page/style.css");
const SCRIPT: &str = concat!(include_str!("../page/page.js"), include_str!("../page/device.js"));
const WORKER: &str = include_str!("../page/worker.js");
const TARGET: &str = "wasm32-unknown-unknown";
/// Profiles of cargo: one for users of the page, and one for fast builds.
const PROFILE: &str = "browser";
const QUICK_PROFILE: &str = "quick-browser";
/// Names of the program and of the image of the Pico beside the page. The program is compressed, since some servers do
/// not compress it.
const PROGRAM: &str = "observatory.wasm.gz";
const IMAGE: &str = "observatory-pico.uf2";
/// The package of npm with `wasm-opt`, which makes the program a tenth smaller, and the features of WebAssembly that every browser with Web
/// Serial supports.
const OPTIMIZER: &str = "binaryen@132.0.0";
const FEATURES: [&str; 6] = [
    "--enable-bulk-memory",
    "--enable-multivalue",
    "--enable-mutable-globals",
    "--enable-nontrapping-float-to-int",
    "--enable-reference-types",
    "--enable-sign-ext",
];

fn main() -> ExitCode {
    let (options, mut paths): (VecDeque<OsString>, VecDeque<OsString>) =
        env::args_os().skip(1).partition(|of| *of == "--quick");
    let profile = if options.is_empty() { PROFILE } else { QUICK_PROFILE };
    let mut path = || paths.pop_front().map(PathBuf::from);
    match run(path(), path(), profile) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(folder: Option<PathBuf>, image: Option<PathBuf>, profile: &str) -> Result<(), Box<dyn Error>> {
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let target = env::var_os("CARGO_TARGET_DIR").map_or_else(|| workspace.join("target"), PathBuf::from);
    let folder = folder.unwrap_or_else(|| target.join("browser"));
    let image = image.map(|file| read(&file)).transpose()?;
    let program = compressed(&build(&workspace, &target, profile)?)?;
    fs::create_dir_all(&folder)?;
    let image_inside = image.as_ref().map(|image| Ok::<_, io::Error>(base64(&compressed(image)?))).transpose()?;
    let image_beside = image.as_ref().map(|_| IMAGE);
    let files = [
        ("index.html", page(image_beside, None).into_bytes()),
        ("observatory.html", page(image_inside.as_deref(), Some(&base64(&program))).into_bytes()),
        (PROGRAM, program),
    ];
    let files = files.into_iter().chain(image.map(|image| (IMAGE, image)));
    for (name, content) in files {
        let file = folder.join(name);
        fs::write(&file, &content).map_err(|error| format!("{}: {error}", file.display()))?;
        println!("{}, {} kB", file.display(), content.len() / 1000);
    }
    Ok(())
}

fn read(file: &Path) -> Result<Vec<u8>, String> {
    fs::read(file).map_err(|error| format!("{}: {error}", file.display()))
}

fn compressed(content: &[u8]) -> io::Result<Vec<u8>> {
    let mut compressed = GzEncoder::new(Vec::new(), Compression::best());
    compressed.write_all(content)?;
    compressed.finish()
}

/// Compiles the library for browsers in a profile of cargo.
fn build(workspace: &Path, target: &Path, profile: &str) -> Result<Vec<u8>, Box<dyn Error>> {
    // A separate folder: cargo, which runs this program, may hold the lock of its own.
    let target = target.join("browser-build");
    let status = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
        .current_dir(workspace)
        .env_remove("RUSTC_WORKSPACE_WRAPPER")
        .args(["rustc", "--locked", "--package", "browser", "--lib", "--crate-type", "cdylib"])
        .args(["--profile", profile, "--target", TARGET, "--target-dir"])
        .arg(&target)
        .status()
        .map_err(|error| format!("cargo does not start: {error}"))?;
    if !status.success() {
        return Err(format!("the page does not build; its target comes with: rustup target add {TARGET}").into());
    }
    let program = target.join(TARGET).join(profile).join("browser.wasm");
    Ok(read(&if profile == QUICK_PROFILE { program } else { optimized(program, &target.join("optimizer"))? })?)
}

/// Returns the program optimized by `wasm-opt`, which npm installs once in `folder`. Without npm it prints a note and returns the program
/// unchanged.
fn optimized(program: PathBuf, folder: &Path) -> Result<PathBuf, Box<dyn Error>> {
    let tool = folder.join("node_modules/.bin/wasm-opt");
    if !tool.exists() {
        fs::create_dir_all(folder)?;
        let mut npm = Command::new("npm");
        let install =
            npm.args(["install", "--no-save", "--no-audit", "--no-fund", "--prefix"]).arg(folder).arg(OPTIMIZER);
        if !install.status().is_ok_and(|status| status.success()) {
            eprintln!("note: npm does not install {OPTIMIZER}: the program is a tenth larger");
            return Ok(program);
        }
    }
    let smaller = program.with_extension("optimized.wasm");
    let status = Command::new(tool).args(FEATURES).arg("-Os").arg(program).arg("-o").arg(&smaller).status()?;
    if status.success() { Ok(smaller) } else { Err("wasm-opt fails".into()) }
}

/// The page. It has the compressed image of the Pico as text or its name, if there is one, and the program inside as text or beside it. Its
/// policy allows only the scripts of the page and of a report, by their hashes, and the request for the program. The script forbids that
/// request once the program is loaded.
fn page(image: Option<&str>, program: Option<&str>) -> String {
    let scripts = [SCRIPT, reports::page::SCRIPT].map(|script| format!("'sha256-{}'", base64(&Sha256::digest(script))));
    let connect = if program.is_some() { "" } else { " connect-src 'self';" };
    let policy = format!(
        "default-src 'none'; script-src {} 'wasm-unsafe-eval'; worker-src blob:; style-src 'unsafe-inline'; img-src data:;{connect} \
         base-uri 'none'; form-action 'none'",
        scripts.join(" ")
    );
    let [light, dark] = reports::page::figure_styles();
    let dark = format!("@media screen and (prefers-color-scheme: dark){{{dark}}}");
    let style = format!("{}{light}{dark}{STYLE}", reports::page::STYLE);
    let formats = ExportFormat::value_variants().iter().filter_map(ValueEnum::to_possible_value);
    let formats: String = formats.map(|format| format!("<option>{}</option>", format.get_name())).collect();
    let parts = [
        ("POLICY", policy.as_str()),
        ("STYLE", &style),
        ("FORMATS", &formats),
        ("BAUD", &serial::BAUD.to_string()),
        ("IMAGE", image.unwrap_or("")),
        ("WORKER", WORKER),
        ("PROGRAM", program.unwrap_or("")),
        ("SCRIPT", SCRIPT),
    ];
    parts.iter().fold(PAGE.to_owned(), |page, (name, text)| page.replacen(&format!("{{{{{name}}}}}"), text, 1))
}

/// Base 64 (RFC 4648).
fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for part in bytes.chunks(3) {
        let bits = part.iter().enumerate().fold(0, |bits, (at, byte)| bits | u32::from(*byte) << (16 - 8 * at));
        for digit in 0..4 {
            let is_used = digit <= part.len();
            text.push(if is_used { DIGITS[(bits >> (18 - 6 * digit)) as usize & 63] as char } else { '=' });
        }
    }
    text
}
