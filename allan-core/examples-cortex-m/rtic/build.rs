//! Hands the linker the memory map of the STM32F405xG (RM0090, section 2.3).

use std::{env, fs, path::PathBuf};

fn main() {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    let map = "MEMORY { FLASH : ORIGIN = 0x08000000, LENGTH = 1024K RAM : ORIGIN = 0x20000000, LENGTH = 128K }\n";
    fs::write(out.join("memory.x"), map).expect("the memory map is written");
    println!("cargo:rustc-link-search={}", out.display());
    for argument in ["--nmagic", "-Tlink.x", "-Tdefmt.x"] {
        println!("cargo:rustc-link-arg-bins={argument}");
    }
    println!("cargo:rerun-if-changed=build.rs");
}
