//! The register map, as the data sheet lists it. Declared apart from the driver's table, so that a wrong address in either
//! shows.

/// A register and what is known of it.
struct Row {
    address: u8,
    bits: u32,
    reset: u16,
    access: Access,
    kind: Kind,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Access {
    Read,
    Write,
    ReadWrite,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// A plain number, lost in a reset.
    Volatile,
    /// A plain number, kept in flash.
    Kept,
    /// Two's complement, kept in flash, reads back sign-extended to 16 bits.
    KeptSigned,
}

const fn row(address: u8, bits: u32, reset: u16, access: Access, kind: Kind) -> Row {
    Row { address, bits, reset, access, kind }
}

/// First output, SUPPLY_OUT; the others follow in the order of a burst.
pub(super) const SUPPLY_OUT: u8 = 0x02;
/// Last output.
pub(super) const AUX_ADC: u8 = 0x18;
pub(super) const FLASH_CNT: u8 = 0x00;
pub(super) const XGYRO_OFF: u8 = 0x1A;
pub(super) const XACCL_OFF: u8 = 0x20;
pub(super) const XMAGN_HIF: u8 = 0x26;
pub(super) const XMAGN_SIF: u8 = 0x2C;
pub(super) const GPIO_CTRL: u8 = 0x32;
pub(super) const MSC_CTRL: u8 = 0x34;
pub(super) const MSC_CTRL_UPPER: u8 = 0x35;
pub(super) const SMPL_PRD: u8 = 0x36;
pub(super) const SENS_AVG: u8 = 0x38;
pub(super) const SLP_CNT: u8 = 0x3A;
pub(super) const SLP_CNT_UPPER: u8 = 0x3B;
pub(super) const DIAG_STAT: u8 = 0x3C;
pub(super) const GLOB_CMD: u8 = 0x3E;
pub(super) const ALM_MAG1: u8 = 0x40;
pub(super) const ALM_SMPL1: u8 = 0x44;
pub(super) const ALM_CTRL: u8 = 0x48;
pub(super) const AUX_DAC: u8 = 0x4A;
pub(super) const PROD_ID: u8 = 0x56;

const ROWS: [Row; 39] = {
    use Access::{Read, ReadWrite, Write};
    use Kind::{Kept, KeptSigned, Volatile};
    [
        row(FLASH_CNT, 16, 0x0000, Read, Kept),
        row(SUPPLY_OUT, 16, 0x0000, Read, Volatile),
        row(0x04, 16, 0x0000, Read, Volatile),
        row(0x06, 16, 0x0000, Read, Volatile),
        row(0x08, 16, 0x0000, Read, Volatile),
        row(0x0A, 16, 0x0000, Read, Volatile),
        row(0x0C, 16, 0x0000, Read, Volatile),
        row(0x0E, 16, 0x0000, Read, Volatile),
        row(0x10, 16, 0x0000, Read, Volatile),
        row(0x12, 16, 0x0000, Read, Volatile),
        row(0x14, 16, 0x0000, Read, Volatile),
        row(0x16, 16, 0x0000, Read, Volatile),
        row(AUX_ADC, 16, 0x0000, Read, Volatile),
        row(XGYRO_OFF, 13, 0x0000, ReadWrite, KeptSigned),
        row(0x1C, 13, 0x0000, ReadWrite, KeptSigned),
        row(0x1E, 13, 0x0000, ReadWrite, KeptSigned),
        row(XACCL_OFF, 12, 0x0000, ReadWrite, KeptSigned),
        row(0x22, 12, 0x0000, ReadWrite, KeptSigned),
        row(0x24, 12, 0x0000, ReadWrite, KeptSigned),
        row(XMAGN_HIF, 14, 0x0000, ReadWrite, KeptSigned),
        row(0x28, 14, 0x0000, ReadWrite, KeptSigned),
        row(0x2A, 14, 0x0000, ReadWrite, KeptSigned),
        row(XMAGN_SIF, 12, 0x0800, ReadWrite, Kept),
        row(0x2E, 12, 0x0800, ReadWrite, Kept),
        row(0x30, 12, 0x0800, ReadWrite, Kept),
        row(GPIO_CTRL, 12, 0x0000, ReadWrite, Volatile),
        row(MSC_CTRL, 12, 0x0006, ReadWrite, Kept),
        row(SMPL_PRD, 8, 0x0001, ReadWrite, Kept),
        row(SENS_AVG, 11, 0x0402, ReadWrite, Kept),
        row(SLP_CNT, 9, 0x0000, Write, Volatile),
        row(DIAG_STAT, 16, 0x0000, Read, Volatile),
        row(GLOB_CMD, 8, 0x0000, Write, Volatile),
        row(ALM_MAG1, 16, 0x0000, ReadWrite, Kept),
        row(0x42, 16, 0x0000, ReadWrite, Kept),
        row(ALM_SMPL1, 8, 0x0000, ReadWrite, Kept),
        row(0x46, 8, 0x0000, ReadWrite, Kept),
        row(ALM_CTRL, 16, 0x0000, ReadWrite, Kept),
        row(AUX_DAC, 12, 0x0000, ReadWrite, Volatile),
        row(PROD_ID, 16, 16405, Read, Kept),
    ]
};

/// Offsets, hard and soft iron: what a factory restore resets.
const CALIBRATION: std::ops::RangeInclusive<u8> = XGYRO_OFF..=0x30;

fn row_of(address: u8) -> Option<&'static Row> {
    ROWS.iter().find(|row| row.address == address & 0x7E)
}

/// True if the register at `address` (of either byte) exists and can be read.
pub(super) fn readable(address: u8) -> bool {
    row_of(address).is_some_and(|row| row.access != Access::Write)
}

/// True if the byte at `address` exists and can be written.
pub(super) fn writable(address: u8) -> bool {
    row_of(address).is_some_and(|row| row.access != Access::Read && (address & 1 == 0 || row.bits > 8))
}

/// The contents of the registers.
#[derive(Clone, Debug)]
pub(super) struct RegisterFile {
    words: [u16; 0x40],
}

impl RegisterFile {
    /// The values that a new part has.
    pub(super) fn reset() -> Self {
        let mut words = [0; 0x40];
        for row in &ROWS {
            words[usize::from(row.address / 2)] = row.reset;
        }
        Self { words }
    }

    /// What the register at `address` (of either byte) reads; 0 where there is none.
    pub(super) fn read(&self, address: u8) -> u16 {
        let word = self.words[usize::from(address & 0x7F) / 2];
        match row_of(address) {
            Some(row) if row.kind == Kind::KeptSigned => {
                let shift = 16 - row.bits;
                (((word << shift) as i16) >> shift) as u16
            }
            _ => word,
        }
    }

    /// The register as a signed number: an offset or hard-iron correction.
    pub(super) fn signed(&self, address: u8) -> f64 {
        f64::from(self.read(address) as i16)
    }

    /// Writes one byte, as the bus does; bits that the register does not have are lost.
    pub(super) fn write(&mut self, address: u8, byte: u8) {
        let [upper, lower] = self.words[usize::from(address & 0x7F) / 2].to_be_bytes();
        let written = if address & 1 == 0 { [upper, byte] } else { [byte, lower] };
        self.store(address, u16::from_be_bytes(written));
    }

    /// Sets a register, as the part itself does.
    pub(super) fn store(&mut self, address: u8, word: u16) {
        if let Some(row) = row_of(address) {
            self.words[usize::from(row.address / 2)] = word & (u16::MAX >> (16 - row.bits));
        }
    }

    /// Takes over what `other` keeps in flash.
    pub(super) fn keep(&mut self, other: &Self) {
        for row in ROWS.iter().filter(|row| row.kind != Kind::Volatile) {
            self.words[usize::from(row.address / 2)] = other.words[usize::from(row.address / 2)];
        }
    }

    /// Forgets the user's calibration.
    pub(super) fn restore_calibration(&mut self) {
        for row in ROWS.iter().filter(|row| CALIBRATION.contains(&row.address)) {
            self.words[usize::from(row.address / 2)] = row.reset;
        }
    }
}
