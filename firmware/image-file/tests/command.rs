//! Runs the command as a user does, and decodes the files that it writes by the definitions of their formats.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

/// Runs the command for a board and returns the file and the output.
fn run(board: &str, file: &Path) -> (Vec<u8>, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_image-file")).arg(board).arg(file).output().expect("it starts");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    (std::fs::read(file).expect("the file"), String::from_utf8(output.stdout).expect("text"))
}

fn word(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(bytes[at..at + 4].try_into().expect("4 bytes"))
}

/// The payload of every block by its address (<https://github.com/microsoft/uf2>, File format).
fn pages(uf2: &[u8]) -> BTreeMap<u32, &[u8]> {
    assert_eq!(uf2.len() % 512, 0);
    let count = uf2.len() / 512;
    let mut pages = BTreeMap::new();
    for (number, block) in uf2.chunks(512).enumerate() {
        let [magic0, magic1, flags, address, size, block_number, blocks, family] =
            [0, 4, 8, 12, 16, 20, 24, 28].map(|at| word(block, at));
        assert_eq!((magic0, magic1, word(block, 508)), (0x0A32_4655, 0x9E5D_5157, 0x0AB1_6F30), "block {number}");
        // The boot ROM takes only blocks of its family and of 256 bytes (RP2040 data sheet, section 2.8.4.2).
        assert_eq!((flags, size, family), (0x2000, 256, 0xE48B_FF56), "block {number}");
        assert_eq!((block_number as usize, blocks as usize), (number, count));
        assert_eq!(address % 256, 0);
        assert!(pages.insert(address, &block[32..32 + 256]).is_none(), "{address:#x} twice");
    }
    pages
}

#[test]
fn the_pico_boots_what_is_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let (uf2, said) = run("pico", &folder.path().join("observatory.uf2"));
    assert!(said.contains("RPI-RP2") && said.contains("observatory.uf2"), "{said}");
    let pages = pages(&uf2);
    let addresses: Vec<u32> = pages.keys().copied().collect();
    assert!(addresses.windows(2).all(|pair| pair[1] == pair[0] + 256), "no page is missing between the others");
    // The boot ROM runs the second stage, the first 256 bytes, only if its last word is the CRC of the others (data sheet, section
    // 2.8.1.3.1: polynomial 0x04c11db7, initial value of all ones, neither reflected nor inverted).
    let stage = pages[&0x1000_0000];
    assert_eq!(crc::Crc::<u32>::new(&crc::CRC_32_MPEG_2).checksum(&stage[..252]), word(stage, 252));
    // The vector table follows the second stage: the stack ends in RAM, and the program begins in flash, in Thumb code.
    let vectors = pages[&0x1000_0100];
    assert!((0x2000_0000..=0x2004_2000).contains(&word(vectors, 0)), "{:#x}", word(vectors, 0));
    assert!(pages.contains_key(&(word(vectors, 4) & !0xFF)) && word(vectors, 4) & 1 == 1, "{:#x}", word(vectors, 4));
}

#[test]
fn the_feather_boots_what_is_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let (contents, said) = run("feather", &folder.path().join("observatory.bin"));
    assert!(said.contains("dfu-util --alt 0 --dfuse-address 0x08000000:leave --download"), "{said}");
    // The processor loads stack pointer and program counter from the beginning of flash (RM0090 section 2.4). The stack ends at the end of
    // the core-coupled memory.
    assert_eq!(word(&contents, 0), 0x1001_0000);
    let reset = word(&contents, 4);
    assert!((0x0800_0000..0x0800_0000 + contents.len() as u32).contains(&reset) && reset & 1 == 1, "{reset:#x}");
}

#[test]
fn a_wrong_name_is_answered_with_the_right_ones() {
    for (arguments, expected) in
        [(&["uno"][..], "no board uno: there are pico, feather, feather-usb, h405"), (&[], "usage: cargo run")]
    {
        let output = Command::new(env!("CARGO_BIN_EXE_image-file")).args(arguments).output().expect("it starts");
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success() && errors.contains(expected), "{errors}");
    }
}
