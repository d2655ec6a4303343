//! The register map of the data sheet, and the contents of the registers. It is written independently of the driver's,
//! so that tests of one against the other reveal a wrong entry in either.

/// An output register, in the order of a burst read (SUPPLY_OUT at 0x02 to AUX_ADC at 0x18).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum OutputRegister {
    /// SUPPLY_OUT, V.
    Supply,
    /// XGYRO_OUT, °/s.
    GyroX,
    /// YGYRO_OUT, °/s.
    GyroY,
    /// ZGYRO_OUT, °/s.
    GyroZ,
    /// XACCL_OUT, g.
    AcclX,
    /// YACCL_OUT, g.
    AcclY,
    /// ZACCL_OUT, g.
    AcclZ,
    /// XMAGN_OUT, gauss.
    MagnX,
    /// YMAGN_OUT, gauss.
    MagnY,
    /// ZMAGN_OUT, gauss.
    MagnZ,
    /// TEMP_OUT, °C.
    Temp,
    /// AUX_ADC, V.
    AuxAdc,
}

impl OutputRegister {
    /// All output registers in burst order.
    pub const ALL: [Self; 12] = [
        Self::Supply,
        Self::GyroX,
        Self::GyroY,
        Self::GyroZ,
        Self::AcclX,
        Self::AcclY,
        Self::AcclZ,
        Self::MagnX,
        Self::MagnY,
        Self::MagnZ,
        Self::Temp,
        Self::AuxAdc,
    ];

    /// The gyros.
    pub const GYROS: [Self; 3] = [Self::GyroX, Self::GyroY, Self::GyroZ];

    /// The gyros, then the accelerometers.
    pub const INERTIAL: [Self; 6] = [Self::GyroX, Self::GyroY, Self::GyroZ, Self::AcclX, Self::AcclY, Self::AcclZ];

    /// Width of the data field: 14 bits, but 12 for temperature and auxiliary input (data sheet Rev. B, Table 9).
    pub(crate) const fn bits(self) -> u32 {
        match self {
            Self::Temp | Self::AuxAdc => 12,
            _ => 14,
        }
    }

    /// Least and greatest count: two's complement, but unsigned for supply and auxiliary input.
    pub(crate) const fn limits(self) -> (i16, i16) {
        match self {
            Self::Supply | Self::AuxAdc => (0, (1 << self.bits()) - 1),
            _ => (-1 << (self.bits() - 1), (1 << (self.bits() - 1)) - 1),
        }
    }

    /// Size of one count in the unit of the output; `gyro_lsb` is the size for the gyros, °/s, which depends on the
    /// range.
    pub(crate) const fn lsb(self, gyro_lsb: f64) -> f64 {
        match self {
            Self::Supply => 2.418e-3,
            Self::GyroX | Self::GyroY | Self::GyroZ => gyro_lsb,
            Self::AcclX | Self::AcclY | Self::AcclZ => 3.33e-3,
            Self::MagnX | Self::MagnY | Self::MagnZ => 0.5e-3,
            Self::Temp => 0.14,
            Self::AuxAdc => 0.806e-3,
        }
    }

    /// Value at count 0 in the unit of the output: 25 °C for the temperature, else 0.
    pub(crate) const fn zero(self) -> f64 {
        match self {
            Self::Temp => 25.0,
            _ => 0.0,
        }
    }
}

/// A register: its entry in the register map.
struct Entry {
    address: u8,
    bits: u32,
    reset: u16,
    access: Access,
    storage: Storage,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Access {
    Read,
    Write,
    ReadWrite,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Storage {
    /// The value is lost in a reset.
    Volatile,
    /// The value is backed up in flash.
    Flash,
    /// The value is backed up in flash; two's complement, read back with its sign extended to 16 bits.
    FlashSigned,
}

const fn entry(address: u8, bits: u32, reset: u16, access: Access, storage: Storage) -> Entry {
    Entry { address, bits, reset, access, storage }
}

/// The first output register; the others follow in the order of a burst read.
pub(crate) const SUPPLY_OUT: u8 = 0x02;
/// The last output register.
pub(crate) const AUX_ADC: u8 = 0x18;
pub(crate) const FLASH_CNT: u8 = 0x00;
pub(crate) const XGYRO_OFF: u8 = 0x1A;
pub(crate) const XACCL_OFF: u8 = 0x20;
pub(crate) const XMAGN_HIF: u8 = 0x26;
pub(crate) const XMAGN_SIF: u8 = 0x2C;
pub(crate) const GPIO_CTRL: u8 = 0x32;
pub(crate) const MSC_CTRL: u8 = 0x34;
pub(crate) const MSC_CTRL_UPPER: u8 = 0x35;
pub(crate) const SMPL_PRD: u8 = 0x36;
pub(crate) const SENS_AVG: u8 = 0x38;
pub(crate) const SENS_AVG_UPPER: u8 = 0x39;
pub(crate) const SLP_CNT: u8 = 0x3A;
pub(crate) const SLP_CNT_UPPER: u8 = 0x3B;
pub(crate) const DIAG_STAT: u8 = 0x3C;
pub(crate) const GLOB_CMD: u8 = 0x3E;
pub(crate) const ALM_MAG1: u8 = 0x40;
pub(crate) const ALM_SMPL1: u8 = 0x44;
pub(crate) const ALM_CTRL: u8 = 0x48;
pub(crate) const AUX_DAC: u8 = 0x4A;
pub(crate) const PROD_ID: u8 = 0x56;

const REGISTER_MAP: [Entry; 39] = {
    use Access::{Read, ReadWrite, Write};
    use Storage::{Flash, FlashSigned, Volatile};
    [
        entry(FLASH_CNT, 16, 0x0000, Read, Flash),
        entry(SUPPLY_OUT, 16, 0x0000, Read, Volatile),
        entry(0x04, 16, 0x0000, Read, Volatile),
        entry(0x06, 16, 0x0000, Read, Volatile),
        entry(0x08, 16, 0x0000, Read, Volatile),
        entry(0x0A, 16, 0x0000, Read, Volatile),
        entry(0x0C, 16, 0x0000, Read, Volatile),
        entry(0x0E, 16, 0x0000, Read, Volatile),
        entry(0x10, 16, 0x0000, Read, Volatile),
        entry(0x12, 16, 0x0000, Read, Volatile),
        entry(0x14, 16, 0x0000, Read, Volatile),
        entry(0x16, 16, 0x0000, Read, Volatile),
        entry(AUX_ADC, 16, 0x0000, Read, Volatile),
        entry(XGYRO_OFF, 13, 0x0000, ReadWrite, FlashSigned),
        entry(0x1C, 13, 0x0000, ReadWrite, FlashSigned),
        entry(0x1E, 13, 0x0000, ReadWrite, FlashSigned),
        entry(XACCL_OFF, 12, 0x0000, ReadWrite, FlashSigned),
        entry(0x22, 12, 0x0000, ReadWrite, FlashSigned),
        entry(0x24, 12, 0x0000, ReadWrite, FlashSigned),
        entry(XMAGN_HIF, 14, 0x0000, ReadWrite, FlashSigned),
        entry(0x28, 14, 0x0000, ReadWrite, FlashSigned),
        entry(0x2A, 14, 0x0000, ReadWrite, FlashSigned),
        entry(XMAGN_SIF, 12, 0x0800, ReadWrite, Flash),
        entry(0x2E, 12, 0x0800, ReadWrite, Flash),
        entry(0x30, 12, 0x0800, ReadWrite, Flash),
        entry(GPIO_CTRL, 12, 0x0000, ReadWrite, Volatile),
        entry(MSC_CTRL, 12, 0x0006, ReadWrite, Flash),
        entry(SMPL_PRD, 8, 0x0001, ReadWrite, Flash),
        entry(SENS_AVG, 11, 0x0402, ReadWrite, Flash),
        entry(SLP_CNT, 9, 0x0000, Write, Volatile),
        entry(DIAG_STAT, 16, 0x0000, Read, Volatile),
        entry(GLOB_CMD, 8, 0x0000, Write, Volatile),
        entry(ALM_MAG1, 16, 0x0000, ReadWrite, Flash),
        entry(0x42, 16, 0x0000, ReadWrite, Flash),
        entry(ALM_SMPL1, 8, 0x0000, ReadWrite, Flash),
        entry(0x46, 8, 0x0000, ReadWrite, Flash),
        entry(ALM_CTRL, 16, 0x0000, ReadWrite, Flash),
        entry(AUX_DAC, 12, 0x0000, ReadWrite, Volatile),
        entry(PROD_ID, 16, 16405, Read, Flash),
    ]
};

/// Offsets and hard-iron corrections, which a factory restore sets to 0 (data sheet Rev. B, Tables 10 to 12; page 13 calls Table 12 "Figure
/// 12").
const CALIBRATION: std::ops::RangeInclusive<u8> = XGYRO_OFF..=0x2A;

fn find(address: u8) -> Option<&'static Entry> {
    REGISTER_MAP.iter().find(|entry| entry.address == address & 0x7E)
}

/// True if the register at `address` (of either byte) exists and can be read.
pub(crate) fn readable(address: u8) -> bool {
    find(address).is_some_and(|entry| entry.access != Access::Write)
}

/// True if the byte at `address` exists and can be written.
pub(crate) fn writable(address: u8) -> bool {
    find(address).is_some_and(|entry| entry.access != Access::Read && (address & 1 == 0 || entry.bits > 8))
}

/// True if `address` is the upper byte of a writable register of 8 bits.
pub(crate) fn is_unused_byte(address: u8) -> bool {
    address & 1 == 1 && find(address).is_some_and(|entry| entry.access != Access::Read && entry.bits <= 8)
}

/// The contents of the registers as a read returns them; signed ones have their sign extended.
#[derive(Clone, Debug)]
pub(crate) struct RegisterFile {
    words: [u16; 0x40],
}

impl RegisterFile {
    /// Every register with the factory default of the data sheet.
    pub(crate) fn new() -> Self {
        let mut words = [0; 0x40];
        for entry in &REGISTER_MAP {
            words[usize::from(entry.address / 2)] = entry.reset;
        }
        Self { words }
    }

    /// The word that a read of `address` (of either byte) returns; 0 if there is no register.
    pub(crate) fn read(&self, address: u8) -> u16 {
        self.words[usize::from(address & 0x7F) / 2]
    }

    /// The value of a signed register (an offset or a hard-iron correction), in its counts.
    pub(crate) fn read_signed(&self, address: u8) -> f64 {
        f64::from(self.read(address) as i16)
    }

    /// Writes one byte, as a write frame does. Bits outside the register's width are dropped.
    pub(crate) fn write_byte(&mut self, address: u8, byte: u8) {
        let [upper, lower] = self.words[usize::from(address & 0x7F) / 2].to_be_bytes();
        let written = if address & 1 == 0 { [upper, byte] } else { [byte, lower] };
        self.store(address, u16::from_be_bytes(written));
    }

    /// Sets a whole register, as the part itself does. Bits outside the register's width are dropped.
    pub(crate) fn store(&mut self, address: u8, word: u16) {
        if let Some(entry) = find(address) {
            let shift = 16 - entry.bits;
            let signed = entry.storage == Storage::FlashSigned;
            let field = word << shift;
            self.words[usize::from(entry.address / 2)] =
                if signed { (field as i16 >> shift) as u16 } else { field >> shift };
        }
    }

    /// Copies the registers that are backed up in flash from `other`.
    pub(crate) fn copy_flash_registers(&mut self, other: &Self) {
        for entry in REGISTER_MAP.iter().filter(|entry| entry.storage != Storage::Volatile) {
            self.words[usize::from(entry.address / 2)] = other.words[usize::from(entry.address / 2)];
        }
    }

    /// Resets offsets and hard-iron corrections.
    pub(crate) fn restore_calibration(&mut self) {
        for entry in REGISTER_MAP.iter().filter(|entry| CALIBRATION.contains(&entry.address)) {
            self.words[usize::from(entry.address / 2)] = entry.reset;
        }
    }
}
