//! Hands the linker the board's memory map; does nothing for a host build.

use std::{env, fs, path::PathBuf};

/// Feature of each board, as cargo spells it here, and its memory map.
const BOARDS: [(&str, &str); 3] = [
    ("CARGO_FEATURE_BOARD_H405", "memory/f405.x"),
    ("CARGO_FEATURE_BOARD_FEATHER", "memory/f405.x"),
    ("CARGO_FEATURE_BOARD_PICO", "memory/rp2040.x"),
];

fn main() {
    println!("cargo:rerun-if-changed=memory");
    let bare_metal = env::var("CARGO_CFG_TARGET_OS").is_ok_and(|os| os == "none");
    let board = BOARDS.iter().find(|(feature, _)| env::var_os(feature).is_some());
    let Some((_, map)) = board.filter(|_| bare_metal) else { return };
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    fs::copy(map, out.join("memory.x")).expect("the memory map is copied");
    println!("cargo:rustc-link-search={}", out.display());
    // Functions that are the same to the byte are linked once.
    for argument in ["--nmagic", "--icf=all", "-Tlink.x", "-Tdefmt.x"] {
        println!("cargo:rustc-link-arg-bins={argument}");
    }
}
