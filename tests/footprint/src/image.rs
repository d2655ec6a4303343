//! Builds the image with some features, and reads its size in flash from its ELF.
#![cfg_attr(target_os = "none", no_std)]
#![cfg(not(target_os = "none"))]

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};
use system_tests::Image;

/// The target of a Cortex-M4F.
pub const M4F: &str = "thumbv7em-none-eabihf";
/// The target of a Cortex-M0+.
pub const M0_PLUS: &str = "thumbv6m-none-eabi";

/// Builds the image for a target with these features, optimised as the firmware is, and returns the path of its ELF.
pub fn build(target: &str, features: &str) -> PathBuf {
    build_with_call(target, features, "")
}

/// Builds the image as [`build`] does, with the call of allan-core that the feature `calls` links.
fn build_with_call(target: &str, features: &str, call: &str) -> PathBuf {
    let image = Image {
        package: "driver-footprint",
        program: "footprint",
        target,
        profile: "image",
        arguments: &["--features", &format!("on-target,{features}")],
        variable: Some(("ALLAN_CALL", call)),
    };
    image.build(&format!("footprint-{target}-{features}-{}", call.replace("::", "-")))
}

/// The ELF of the image with these features.
pub fn built(target: &str, features: &str) -> Vec<u8> {
    built_with_call(target, features, "")
}

fn built_with_call(target: &str, features: &str, call: &str) -> Vec<u8> {
    std::fs::read(build_with_call(target, features, call)).expect("the image is readable")
}

/// Bytes of flash of the image: those that its program headers load (ELF of 32 bits, little-endian).
pub fn flash_bytes(elf: &[u8]) -> u32 {
    const LOAD: u32 = 1;
    let word = |at: usize| u32::from_le_bytes(elf[at..at + 4].try_into().expect("four bytes"));
    let half = |at: usize| usize::from(u16::from_le_bytes(elf[at..at + 2].try_into().expect("two bytes")));
    assert_eq!((&elf[..4], elf[4]), (&b"\x7fELF"[..], 1), "a 32-bit ELF");
    let (table, entry, entries) = (word(28) as usize, half(42), half(44));
    let headers = (0..entries).map(|index| table + index * entry);
    headers.filter(|&header| word(header) == LOAD).map(|header| word(header + 16)).sum()
}

/// Bytes of flash that these features add to the image without them.
pub fn added_bytes(target: &str, features: &str) -> u32 {
    flash_bytes(&built(target, features)) - flash_bytes(&built(target, ""))
}

/// Bytes of flash that a call of allan-core adds to an image without calls; 0 if the image does not know the call.
pub fn call_bytes(target: &str, call: &str) -> u32 {
    let bytes = |call: &str| flash_bytes(&built_with_call(target, "calls", call));
    static WITHOUT: Mutex<BTreeMap<String, u32>> = Mutex::new(BTreeMap::new());
    let mut without = WITHOUT.lock().unwrap_or_else(PoisonError::into_inner);
    let without = *without.entry(target.to_owned()).or_insert_with(|| bytes(""));
    bytes(call).saturating_sub(without)
}

/// Names of the functions in an image that are part of a panic.
pub fn panic_symbols(elf: &[u8]) -> Vec<String> {
    use object::{Object, ObjectSymbol, SymbolKind};
    let elf = object::File::parse(elf).expect("an ELF");
    let functions = elf.symbols().filter(|symbol| symbol.kind() == SymbolKind::Text);
    let names = functions.filter_map(|symbol| symbol.name().ok().map(str::to_owned));
    let is_panic =
        |name: &String| ["panic", "unwrap_failed", "expect_failed", "int_log10"].iter().any(|part| name.contains(part));
    names.filter(is_panic).collect()
}
