//! The twelve output registers: order, field, unit and scale, from the data sheet.

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

    /// Width of the data field: 14 bits, but 12 for supply, temperature and auxiliary input.
    pub(crate) const fn bits(self) -> u32 {
        match self {
            Self::Supply | Self::Temp | Self::AuxAdc => 12,
            _ => 14,
        }
    }

    /// Least and greatest count: two's complement, but offset binary for supply and auxiliary input.
    pub(crate) const fn limits(self) -> (i16, i16) {
        match self {
            Self::Supply | Self::AuxAdc => (0, (1 << self.bits()) - 1),
            _ => (-1 << (self.bits() - 1), (1 << (self.bits() - 1)) - 1),
        }
    }

    /// Size of one count in the unit of the output; `gyro_lsb` is that of the gyros, °/s, which the range sets.
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
