//! Sets the hash of the program's sources, and gives the linker the memory map of the board that a feature names.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::{env, fs};

/// Prefix of the features that name a board, as cargo spells them here. The rest is the name of its memory map.
const BOARD: &str = "CARGO_FEATURE_BOARD_";

/// Folders and files that a program is built from, relative to this package. State that a program retains over a restart is not valid for a
/// program of other sources.
const SOURCES: [&str; 8] = [
    "src",
    "memory",
    "Cargo.toml",
    "link/src",
    "../adis16405-driver/src",
    "../allan-core/src",
    "../Cargo.toml",
    "../Cargo.lock",
];

fn main() {
    println!("cargo:rustc-env=FIRMWARE_BUILD={}", build_hash());
    let bare_metal = env::var("CARGO_CFG_TARGET_OS").is_ok_and(|os| os == "none");
    let board = env::vars().find_map(|(name, _)| Some(name.strip_prefix(BOARD)?.to_lowercase()));
    let Some(board) = board.filter(|_| bare_metal) else { return };
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    fs::copy(format!("memory/{board}.x"), out.join("memory.x")).expect("the memory map is copied");
    println!("cargo:rustc-link-search={}", out.display());
    println!("cargo:rustc-link-search={}/memory", env::var("CARGO_MANIFEST_DIR").expect("cargo sets it"));
    // Functions with identical code are linked once.
    for argument in ["--nmagic", "--icf=all", "-Tlink.x", "-Tdefmt.x"] {
        println!("cargo:rustc-link-arg-bins={argument}");
    }
}

/// Hash of the sources, the compiler's target and profile, and the features.
fn build_hash() -> u32 {
    let mut hasher = DefaultHasher::new();
    for source in SOURCES {
        println!("cargo:rerun-if-changed={source}");
        hash_files(Path::new(source), &mut hasher);
    }
    let is_setting =
        |name: &str| name.starts_with("CARGO_FEATURE_") || ["TARGET", "PROFILE", "OPT_LEVEL"].contains(&name);
    let mut settings: Vec<(String, String)> = env::vars().filter(|(name, _)| is_setting(name)).collect();
    settings.sort();
    settings.hash(&mut hasher);
    hasher.finish() as u32
}

/// Hashes the names and contents of the files of a folder in the order of their names; for a missing file the name alone.
fn hash_files(path: &Path, hasher: &mut DefaultHasher) {
    path.hash(hasher);
    if let Ok(entries) = fs::read_dir(path) {
        let mut inside: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
        inside.sort();
        inside.iter().for_each(|entry| hash_files(entry, hasher));
    } else {
        fs::read(path).unwrap_or_default().hash(hasher);
    }
}
