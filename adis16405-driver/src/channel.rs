//! The gyro ranges and the twelve output channels: width, sign, unit and scale of each.

/// Full-scale range of the gyroscopes, SENS_AVG bits 10:8.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum GyroRange {
    /// ±300 °/s, 0.05 °/s per count.
    #[default]
    Dps300,
    /// ±150 °/s, 0.025 °/s per count; needs at least 2² filter taps.
    Dps150,
    /// ±75 °/s, 0.0125 °/s per count; needs at least 2⁴ filter taps.
    Dps75,
}

impl GyroRange {
    /// Size of one count in °/s.
    pub const fn lsb(self) -> f64 {
        match self {
            GyroRange::Dps300 => 0.05,
            GyroRange::Dps150 => 0.025,
            GyroRange::Dps75 => 0.0125,
        }
    }

    /// Size of one count in 10⁻⁶ °/s.
    pub const fn lsb_udps(self) -> i32 {
        match self {
            GyroRange::Dps300 => 50_000,
            GyroRange::Dps150 => 25_000,
            GyroRange::Dps75 => 12_500,
        }
    }

    /// The smallest M (log2 of the filter taps) that the data sheet allows with this range.
    pub const fn min_filter_taps_log2(self) -> u8 {
        match self {
            GyroRange::Dps300 => 0,
            GyroRange::Dps150 => 2,
            GyroRange::Dps75 => 4,
        }
    }

    /// The range that a SENS_AVG value selects; `None` for codes that the data sheet does not define.
    pub const fn from_sens_avg(sens_avg: u16) -> Option<Self> {
        match sens_avg >> 8 & 0b111 {
            0b100 => Some(GyroRange::Dps300),
            0b010 => Some(GyroRange::Dps150),
            0b001 => Some(GyroRange::Dps75),
            _ => None,
        }
    }

    /// The code in SENS_AVG bits 10:8.
    pub(crate) const fn sens_avg_code(self) -> u16 {
        match self {
            GyroRange::Dps300 => 0b100,
            GyroRange::Dps150 => 0b010,
            GyroRange::Dps75 => 0b001,
        }
    }
}

/// An output channel. The discriminants, 0 to 11, are the positions in a burst read.
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

    /// The gyroscopes x, y, z, then the accelerometers x, y, z.
    pub const INERTIAL: [Channel; 6] =
        [Channel::GyroX, Channel::GyroY, Channel::GyroZ, Channel::AcclX, Channel::AcclY, Channel::AcclZ];

    /// Name in reports and file headers, for example `gyro_x`.
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

    /// Width of the data field: 12 bits for temperature and auxiliary input, else 14 (data sheet Rev. B, Table 9).
    pub const fn bits(self) -> u32 {
        match self {
            Channel::Temp | Channel::AuxAdc => 12,
            _ => 14,
        }
    }

    /// True for two's complement, false for unsigned channels (supply, auxiliary input).
    pub const fn signed(self) -> bool {
        !matches!(self, Channel::Supply | Channel::AuxAdc)
    }

    /// Smallest and largest count that the data field can hold.
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
    /// The temperature has 0.14 °C (data sheet Rev. B, Tables 1 and 9); Analog Devices' register map gives 0.1357 °C.
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

    /// Value at count 0 in [`unit`](Self::unit): 25 for the temperature, else 0; values are `count · lsb + offset`.
    pub const fn offset(self) -> f64 {
        match self {
            Channel::Temp => 25.0,
            _ => 0.0,
        }
    }
}

/// A set of output channels, the bit n for the channel whose discriminant is n.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ChannelMask(u16);

impl ChannelMask {
    /// No channel.
    pub const EMPTY: Self = Self(0);
    /// All twelve channels.
    pub const ALL: Self = Self(0b1111_1111_1111);
    /// The channels of [`Channel::INERTIAL`].
    pub const INERTIAL: Self = Self(0b0000_0111_1110);

    /// The set with `channel` as well.
    #[must_use]
    pub const fn with(self, channel: Channel) -> Self {
        Self(self.0 | 1 << channel as u8)
    }

    /// True if `channel` is in the set.
    pub const fn contains(self, channel: Channel) -> bool {
        self.0 >> channel as u8 & 1 != 0
    }

    /// True if no channel is in the set.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }
}
