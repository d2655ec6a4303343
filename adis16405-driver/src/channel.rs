//! The twelve outputs: their fields, units and scales.

use crate::config::GyroRange;

/// An output register, in the order of a burst read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Channel {
    /// Supply voltage, SUPPLY_OUT.
    Supply,
    /// Angular rate about x, XGYRO_OUT.
    GyroX,
    /// Angular rate about y, YGYRO_OUT.
    GyroY,
    /// Angular rate about z, ZGYRO_OUT.
    GyroZ,
    /// Specific force along x, XACCL_OUT.
    AcclX,
    /// Specific force along y, YACCL_OUT.
    AcclY,
    /// Specific force along z, ZACCL_OUT.
    AcclZ,
    /// Magnetic field along x, XMAGN_OUT.
    MagnX,
    /// Magnetic field along y, YMAGN_OUT.
    MagnY,
    /// Magnetic field along z, ZMAGN_OUT.
    MagnZ,
    /// Internal temperature, TEMP_OUT.
    Temp,
    /// Auxiliary analog input, AUX_ADC.
    AuxAdc,
}

impl Channel {
    /// All channels in burst order.
    pub const ALL: [Channel; 12] = [
        Channel::Supply,
        Channel::GyroX,
        Channel::GyroY,
        Channel::GyroZ,
        Channel::AcclX,
        Channel::AcclY,
        Channel::AcclZ,
        Channel::MagnX,
        Channel::MagnY,
        Channel::MagnZ,
        Channel::Temp,
        Channel::AuxAdc,
    ];

    /// The gyroscopes, then the accelerometers.
    pub const INERTIAL: [Channel; 6] =
        [Channel::GyroX, Channel::GyroY, Channel::GyroZ, Channel::AcclX, Channel::AcclY, Channel::AcclZ];

    /// Name in reports and file headers, such as `gyro_x`.
    pub const fn name(self) -> &'static str {
        match self {
            Channel::Supply => "supply",
            Channel::GyroX => "gyro_x",
            Channel::GyroY => "gyro_y",
            Channel::GyroZ => "gyro_z",
            Channel::AcclX => "accl_x",
            Channel::AcclY => "accl_y",
            Channel::AcclZ => "accl_z",
            Channel::MagnX => "magn_x",
            Channel::MagnY => "magn_y",
            Channel::MagnZ => "magn_z",
            Channel::Temp => "temp",
            Channel::AuxAdc => "aux_adc",
        }
    }

    /// Width of the data field in bits: 12 for supply, temperature and auxiliary input, else 14.
    ///
    /// Sources disagree on 12 or 14 bits for the supply; its data need 12 (5 V is count 2068).
    pub const fn bits(self) -> u32 {
        match self {
            Channel::Supply | Channel::Temp | Channel::AuxAdc => 12,
            _ => 14,
        }
    }

    /// True for two's complement, false for offset binary (supply, auxiliary input).
    pub const fn signed(self) -> bool {
        !matches!(self, Channel::Supply | Channel::AuxAdc)
    }

    /// Least and greatest count that the field can hold.
    pub const fn limits(self) -> (i16, i16) {
        if self.signed() {
            let half = 1i16 << (self.bits() - 1);
            (-half, half - 1)
        } else {
            (0, (1i16 << self.bits()) - 1)
        }
    }

    /// Unit of [`lsb`](Self::lsb): `V`, `deg/s`, `g`, `gauss` or `degC`.
    pub const fn unit(self) -> &'static str {
        match self {
            Channel::Supply | Channel::AuxAdc => "V",
            Channel::GyroX | Channel::GyroY | Channel::GyroZ => "deg/s",
            Channel::AcclX | Channel::AcclY | Channel::AcclZ => "g",
            Channel::MagnX | Channel::MagnY | Channel::MagnZ => "gauss",
            Channel::Temp => "degC",
        }
    }

    /// Size of one count in [`unit`](Self::unit); only the gyroscopes depend on `range`.
    ///
    /// For the temperature sources give 0.14 °C and 0.1357 °C; 0.14 °C, which most drivers use, is taken here.
    pub const fn lsb(self, range: GyroRange) -> f64 {
        match self {
            Channel::Supply => 2.418e-3,
            Channel::GyroX | Channel::GyroY | Channel::GyroZ => range.lsb(),
            Channel::AcclX | Channel::AcclY | Channel::AcclZ => 3.33e-3,
            Channel::MagnX | Channel::MagnY | Channel::MagnZ => 0.5e-3,
            Channel::Temp => 0.14,
            Channel::AuxAdc => 0.806e-3,
        }
    }

    /// Value at count 0 in [`unit`](Self::unit): 25 for the temperature, else 0.
    pub const fn zero(self) -> f64 {
        match self {
            Channel::Temp => 25.0,
            _ => 0.0,
        }
    }
}
