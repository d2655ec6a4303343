//! Hands the linker the memory map of the Pico: the second stage of the boot loader, 2 MB of flash, 264 kB of RAM (RP2040 data sheet,
//! sections 2.6 and 2.8.1.3).

use std::{env, fs, path::PathBuf};

fn main() {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    let map = "MEMORY {
        BOOT2 : ORIGIN = 0x10000000, LENGTH = 0x100
        FLASH : ORIGIN = 0x10000100, LENGTH = 2048K - 0x100
        RAM : ORIGIN = 0x20000000, LENGTH = 264K
    }\n";
    fs::write(out.join("memory.x"), map).expect("the memory map is written");
    println!("cargo:rustc-link-search={}", out.display());
    for argument in ["--nmagic", "-Tlink.x", "-Tlink-rp.x", "-Tdefmt.x"] {
        println!("cargo:rustc-link-arg-bins={argument}");
    }
    println!("cargo:rerun-if-changed=build.rs");
}
