//! The registers that hold something, as the data sheet lists them. Declared apart from the driver's table, so that a
//! wrong address in either shows.

/// A readable and writable register.
struct Row {
    address: u8,
    bits: u32,
    reset: u16,
    /// Reads back sign-extended to 16 bits.
    signed: bool,
}

const fn row(address: u8, bits: u32, reset: u16, signed: bool) -> Row {
    Row { address, bits, reset, signed }
}

const ROWS: [Row; 24] = [
    row(XGYRO_OFF, 13, 0x0000, true),
    row(XGYRO_OFF + 2, 13, 0x0000, true),
    row(XGYRO_OFF + 4, 13, 0x0000, true),
    row(XACCL_OFF, 12, 0x0000, true),
    row(XACCL_OFF + 2, 12, 0x0000, true),
    row(XACCL_OFF + 4, 12, 0x0000, true),
    row(XMAGN_HIF, 14, 0x0000, true),
    row(XMAGN_HIF + 2, 14, 0x0000, true),
    row(XMAGN_HIF + 4, 14, 0x0000, true),
    row(XMAGN_SIF, 12, 0x0800, false),
    row(XMAGN_SIF + 2, 12, 0x0800, false),
    row(XMAGN_SIF + 4, 12, 0x0800, false),
    row(0x32, 12, 0x0000, false),
    row(MSC_CTRL, 12, 0x0006, false),
    row(SMPL_PRD, 8, 0x0001, false),
    row(SENS_AVG, 11, 0x0402, false),
    row(0x3A, 9, 0x0000, false),
    row(0x40, 16, 0x0000, false),
    row(0x42, 16, 0x0000, false),
    row(0x44, 8, 0x0000, false),
    row(0x46, 8, 0x0000, false),
    row(0x48, 16, 0x0000, false),
    row(0x4A, 12, 0x0000, false),
    row(PROD_ID, 16, 16405, false),
];

/// First output, SUPPLY_OUT; the others follow in the order of a burst.
pub(super) const SUPPLY_OUT: u8 = 0x02;
/// Last output.
pub(super) const AUX_ADC: u8 = 0x18;
pub(super) const XGYRO_OFF: u8 = 0x1A;
pub(super) const XACCL_OFF: u8 = 0x20;
pub(super) const XMAGN_HIF: u8 = 0x26;
pub(super) const XMAGN_SIF: u8 = 0x2C;
pub(super) const MSC_CTRL: u8 = 0x34;
pub(super) const SMPL_PRD: u8 = 0x36;
pub(super) const SENS_AVG: u8 = 0x38;
pub(super) const DIAG_STAT: u8 = 0x3C;
pub(super) const GLOB_CMD: u8 = 0x3E;
const PROD_ID: u8 = 0x56;

/// MSC_CTRL bits that clear themselves: flash test and internal self-test, which pass at once here.
const SELF_CLEARING: u16 = 0x0C00;

/// The contents of the registers.
#[derive(Clone, Debug)]
pub(super) struct RegisterFile {
    words: [u16; 0x40],
}

impl RegisterFile {
    /// The values after reset.
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
        match ROWS.iter().find(|row| row.address == address & 0x7E) {
            Some(row) if row.signed => {
                let shift = 16 - row.bits;
                (((word << shift) as i16) >> shift) as u16
            }
            _ => word,
        }
    }

    /// Writes one byte; bits that the register does not have, and addresses that cannot be written, are ignored.
    pub(super) fn write(&mut self, address: u8, byte: u8) {
        let Some(row) = ROWS.iter().find(|row| row.address == address & 0x7E && row.address != PROD_ID) else {
            return;
        };
        let word = &mut self.words[usize::from(row.address / 2)];
        let bytes = word.to_be_bytes();
        let written = if address & 1 == 0 { [bytes[0], byte] } else { [byte, bytes[1]] };
        *word = u16::from_be_bytes(written) & (u16::MAX >> (16 - row.bits));
        if row.address == MSC_CTRL {
            *word &= !SELF_CLEARING;
        }
    }

    /// The register as a signed number: an offset or hard-iron correction.
    pub(super) fn signed(&self, address: u8) -> f64 {
        f64::from(self.read(address) as i16)
    }
}
