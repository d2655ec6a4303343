//! Every register against the data sheet: address, width, reset value, sign extension, access, flash.

use virtual_sensor::{NoiseModel, NoteKind, ViolationKind, VirtualAdis16405};

/// The readable and writable registers: address, bits, reset value, sign-extended, in flash.
const WRITABLE: [(u8, u32, u16, bool, bool); 23] = [
    (0x1A, 13, 0x0000, true, true),
    (0x1C, 13, 0x0000, true, true),
    (0x1E, 13, 0x0000, true, true),
    (0x20, 12, 0x0000, true, true),
    (0x22, 12, 0x0000, true, true),
    (0x24, 12, 0x0000, true, true),
    (0x26, 14, 0x0000, true, true),
    (0x28, 14, 0x0000, true, true),
    (0x2A, 14, 0x0000, true, true),
    (0x2C, 12, 0x0800, false, true),
    (0x2E, 12, 0x0800, false, true),
    (0x30, 12, 0x0800, false, true),
    (0x36, 8, 0x0001, false, true),
    (0x38, 11, 0x0402, false, true),
    (0x40, 16, 0x0000, false, true),
    (0x42, 16, 0x0000, false, true),
    (0x44, 8, 0x0000, false, true),
    (0x46, 8, 0x0000, false, true),
    (0x48, 16, 0x0000, false, true),
    (0x4A, 12, 0x0000, false, false),
    // Only the directions are writable: the levels of inputs come from the pins.
    (0x32, 4, 0x0000, false, false),
    // The upper byte starts self-tests.
    (0x34, 8, 0x0006, false, true),
    (0x56, 0, 16405, false, true),
];

fn part() -> VirtualAdis16405 {
    VirtualAdis16405::new(NoiseModel::noiseless(), 1)
}

/// Exchanges one frame after a pause that suits either power mode.
fn frame(part: &mut VirtualAdis16405, word: u16) -> u16 {
    part.advance_to(part.now() + 150_000);
    part.select();
    let answer = part.transfer(word);
    part.deselect();
    answer
}

fn read(part: &mut VirtualAdis16405, address: u8) -> u16 {
    frame(part, u16::from(address) << 8);
    frame(part, 0x0000)
}

fn write(part: &mut VirtualAdis16405, address: u8, byte: u8) {
    frame(part, 0x8000 | u16::from(address) << 8 | u16::from(byte));
}

fn extended(word: u16, bits: u32, signed: bool) -> u16 {
    let field = i32::from(word) % (1 << bits);
    (if signed && field >= 1 << (bits - 1) { field - (1 << bits) } else { field }) as u16
}

#[test]
fn registers_have_their_reset_values() {
    let mut part = part();
    for (address, _, reset, ..) in WRITABLE {
        assert_eq!(read(&mut part, address), reset, "{address:#04x}");
        assert_eq!(read(&mut part, address + 1), reset, "either byte's address reads all 16 bits: {address:#04x}");
    }
    assert_eq!(part.violations(), []);
}

#[test]
fn bytes_are_written_one_by_one_into_the_width_of_the_register() {
    for (address, bits, reset, signed, _) in WRITABLE.into_iter().filter(|(_, bits, ..)| *bits > 0) {
        for byte in 0..=255u8 {
            let mut part = part();
            write(&mut part, address, byte);
            let lower = reset & 0xFF00 | u16::from(byte);
            assert_eq!(read(&mut part, address), extended(lower, bits, signed), "{address:#04x} {byte:#04x}");
            if bits > 8 {
                write(&mut part, address + 1, byte);
                let mut both = u16::from(byte) << 8 | u16::from(byte);
                if address == 0x38 {
                    // The ranges of ±150 and ±75 °/s need M ≥ 2 and M ≥ 4 (Table 17), and raise M to it.
                    let least = [0, 4, 2, 0, 0, 0, 0, 0][usize::from(byte & 0b111)];
                    both = both & !0b111 | (both & 0b111).max(least);
                }
                assert_eq!(read(&mut part, address), extended(both, bits, signed), "{address:#04x} {byte:#04x}");
            }
        }
    }
}

#[test]
fn access_to_what_cannot_be_read_or_written_is_a_violation() {
    let plain: Vec<u8> = WRITABLE.iter().filter(|row| row.1 > 0).map(|row| row.0).collect();
    for address in 0..0x80u8 {
        let row = WRITABLE.iter().find(|row| row.0 == address & 0x7E && plain.contains(&row.0));
        // GPIO_CTRL and MSC_CTRL have 12 bits, SLP_CNT 9, GLOB_CMD 8.
        let bits = match address & 0x7E {
            0x32 | 0x34 => 12,
            0x3A => 9,
            0x3E => 8,
            _ => row.map_or(0, |row| row.1),
        };
        let writable = bits > 0 && (address & 1 == 0 || bits > 8);
        let mut written = part();
        write(&mut written, address, 0);
        let kinds: Vec<_> = written.violations().iter().map(|violation| violation.kind).collect();
        // Drivers write 0 to the upper bytes of registers of 8 bits, which gets a note.
        let unused = matches!(address, 0x37 | 0x3F | 0x45 | 0x47);
        let expected = [ViolationKind::Address { address, write: true }];
        assert_eq!(kinds, if writable || unused { &[][..] } else { &expected[..] }, "write to {address:#04x}");
        let notes: Vec<_> = written.notes().iter().map(|note| note.kind).collect();
        let expected = [NoteKind::UnusedByte { address }];
        assert_eq!(notes, if unused { &expected[..] } else { &[][..] }, "write to {address:#04x}");

        let readable = matches!(address & 0x7E, 0x00..=0x38 | 0x3C | 0x40..=0x4A | 0x56);
        if address & 0x7E != 0x3E {
            let mut asked = part();
            frame(&mut asked, u16::from(address) << 8);
            let kinds: Vec<_> = asked.violations().iter().map(|violation| violation.kind).collect();
            let expected = [ViolationKind::Address { address, write: false }];
            assert_eq!(kinds, if readable { &[][..] } else { &expected[..] }, "read of {address:#04x}");
        }
    }
}

#[test]
fn a_flash_update_preserves_registers_over_a_reset() {
    for (address, bits, reset, signed, kept) in WRITABLE.into_iter().filter(|(_, bits, ..)| *bits > 0) {
        let mut part = part();
        write(&mut part, address, 0x07);
        let changed = extended(reset & 0xFF00 | 0x07, bits, signed);
        for (update, expected) in [(false, reset), (true, if kept { changed } else { reset })] {
            write(&mut part, address, 0x07);
            if update {
                write(&mut part, 0x3E, 0x08);
                part.advance_to(part.now() + 100_000_000);
            }
            write(&mut part, 0x3E, 0x80);
            part.advance_to(part.now() + 170_000_000);
            assert_eq!(read(&mut part, address), expected, "{address:#04x}, flash update: {update}");
        }
        assert_eq!(read(&mut part, 0x00), 1, "FLASH_CNT");
        assert!(
            part.violations().iter().all(|violation| matches!(violation.kind, ViolationKind::Configuration { .. }))
        );
    }
}
