//! The register map: address, name, access and width, and the SPI frames.

/// True if a register may be read and written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Access {
    /// Read only.
    Read,
    /// Read and write.
    ReadWrite,
    /// Write only: GLOB_CMD, whose address starts a burst read when it is read, and SLP_CNT.
    Write,
}

macro_rules! registers {
    ($($(#[$doc:meta])* $variant:ident $name:literal $address:literal $access:ident $bits:literal,)*) => {
        /// A register of the ADIS16405, named as in the data sheet. The discriminant is the address of its lower byte.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
        #[repr(u8)]
        #[non_exhaustive]
        pub enum Register { $($(#[$doc])* $variant = $address,)* }

        impl Register {
            /// All registers in the order of their addresses.
            pub const ALL: &'static [Register] = &[$(Register::$variant,)*];

            /// Name in the data sheet.
            pub const fn name(self) -> &'static str {
                match self { $(Register::$variant => $name,)* }
            }

            /// True if the register can be read, written, or both.
            pub const fn access(self) -> Access {
                match self { $(Register::$variant => Access::$access,)* }
            }

            /// Number of bits that hold a value, counted from bit 0: 8 to 16.
            pub const fn bits(self) -> u32 {
                match self { $(Register::$variant => $bits,)* }
            }
        }
    };
}

registers! {
    /// Number of flash writes.
    FlashCnt "FLASH_CNT" 0x00 Read 16,
    /// Supply voltage.
    SupplyOut "SUPPLY_OUT" 0x02 Read 16,
    /// Angular rate about x.
    XgyroOut "XGYRO_OUT" 0x04 Read 16,
    /// Angular rate about y.
    YgyroOut "YGYRO_OUT" 0x06 Read 16,
    /// Angular rate about z.
    ZgyroOut "ZGYRO_OUT" 0x08 Read 16,
    /// Specific force along x.
    XacclOut "XACCL_OUT" 0x0A Read 16,
    /// Specific force along y.
    YacclOut "YACCL_OUT" 0x0C Read 16,
    /// Specific force along z.
    ZacclOut "ZACCL_OUT" 0x0E Read 16,
    /// Magnetic field along x.
    XmagnOut "XMAGN_OUT" 0x10 Read 16,
    /// Magnetic field along y.
    YmagnOut "YMAGN_OUT" 0x12 Read 16,
    /// Magnetic field along z.
    ZmagnOut "ZMAGN_OUT" 0x14 Read 16,
    /// Internal temperature.
    TempOut "TEMP_OUT" 0x16 Read 16,
    /// Auxiliary analog input.
    AuxAdc "AUX_ADC" 0x18 Read 16,
    /// Gyro bias correction x, 0.0125 °/s per count.
    XgyroOff "XGYRO_OFF" 0x1A ReadWrite 13,
    /// Gyro bias correction y, 0.0125 °/s per count.
    YgyroOff "YGYRO_OFF" 0x1C ReadWrite 13,
    /// Gyro bias correction z, 0.0125 °/s per count.
    ZgyroOff "ZGYRO_OFF" 0x1E ReadWrite 13,
    /// Accelerometer bias correction x, 3.33 mg per count.
    XacclOff "XACCL_OFF" 0x20 ReadWrite 12,
    /// Accelerometer bias correction y, 3.33 mg per count.
    YacclOff "YACCL_OFF" 0x22 ReadWrite 12,
    /// Accelerometer bias correction z, 3.33 mg per count.
    ZacclOff "ZACCL_OFF" 0x24 ReadWrite 12,
    /// Hard-iron correction x, 0.5 mgauss per count.
    XmagnHif "XMAGN_HIF" 0x26 ReadWrite 14,
    /// Hard-iron correction y, 0.5 mgauss per count.
    YmagnHif "YMAGN_HIF" 0x28 ReadWrite 14,
    /// Hard-iron correction z, 0.5 mgauss per count.
    ZmagnHif "ZMAGN_HIF" 0x2A ReadWrite 14,
    /// Soft-iron factor x, 0x0800 = 1.
    XmagnSif "XMAGN_SIF" 0x2C ReadWrite 12,
    /// Soft-iron factor y, 0x0800 = 1.
    YmagnSif "YMAGN_SIF" 0x2E ReadWrite 12,
    /// Soft-iron factor z, 0x0800 = 1.
    ZmagnSif "ZMAGN_SIF" 0x30 ReadWrite 12,
    /// Digital inputs and outputs.
    GpioCtrl "GPIO_CTRL" 0x32 ReadWrite 12,
    /// Self-tests, data-ready line, on-chip compensation.
    MscCtrl "MSC_CTRL" 0x34 ReadWrite 12,
    /// Sample period: bit 7 time base, bits 6:0 NS.
    SmplPrd "SMPL_PRD" 0x36 ReadWrite 8,
    /// Gyro range (bits 10:8) and filter taps (bits 2:0).
    SensAvg "SENS_AVG" 0x38 ReadWrite 11,
    /// Sleep: bits 7:0 in units of 0.5 s, bit 8 without end (data sheet Rev. B, Table 16).
    SlpCnt "SLP_CNT" 0x3A Write 9,
    /// Status and error flags ([`Diagnosis`](crate::Diagnosis)); a read clears them.
    DiagStat "DIAG_STAT" 0x3C Read 16,
    /// Commands, one bit each. A read frame with this address starts a burst read.
    GlobCmd "GLOB_CMD" 0x3E Write 8,
    /// Threshold of alarm 1.
    AlmMag1 "ALM_MAG1" 0x40 ReadWrite 16,
    /// Threshold of alarm 2.
    AlmMag2 "ALM_MAG2" 0x42 ReadWrite 16,
    /// Samples over which alarm 1 takes the rate of change.
    AlmSmpl1 "ALM_SMPL1" 0x44 ReadWrite 8,
    /// Samples over which alarm 2 takes the rate of change.
    AlmSmpl2 "ALM_SMPL2" 0x46 ReadWrite 8,
    /// Alarm sources and outputs.
    AlmCtrl "ALM_CTRL" 0x48 ReadWrite 16,
    /// Auxiliary analog output.
    AuxDac "AUX_DAC" 0x4A ReadWrite 12,
    /// Product identity: the part number in decimal.
    ProdId "PROD_ID" 0x56 Read 16,
}

impl Register {
    /// Address of the lower byte; the upper byte is at the next address.
    pub const fn address(self) -> u8 {
        self as u8
    }

    /// The bits inside the register's width. Compare only these: the part sends offset registers sign-extended.
    pub const fn mask(self) -> u16 {
        if self.bits() >= 16 { u16::MAX } else { (1 << self.bits()) - 1 }
    }

    /// The frame that requests the register's value. The part sends the value during the next frame.
    pub const fn read_frame(self) -> [u8; 2] {
        [self.address(), 0]
    }

    /// The frame that writes the lower byte of `value`.
    pub const fn write_low_frame(self, value: u16) -> [u8; 2] {
        [0x80 | self.address(), value.to_be_bytes()[1]]
    }

    /// The frame that writes the upper byte of `value`.
    pub const fn write_high_frame(self, value: u16) -> [u8; 2] {
        [0x80 | (self.address() + 1), value.to_be_bytes()[0]]
    }
}
