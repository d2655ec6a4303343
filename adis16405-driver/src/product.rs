//! Which part answers.

/// A part that this driver knows; PROD_ID holds its number.
///
/// Both have the same registers and scales; they differ in the temperature range over which they were calibrated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Product {
    /// ADIS16400, PROD_ID 0x4010.
    Adis16400,
    /// ADIS16405, PROD_ID 0x4015.
    Adis16405,
}

impl Product {
    /// The part whose PROD_ID reads `prod_id`; `None` for every other.
    pub const fn from_prod_id(prod_id: u16) -> Option<Self> {
        match prod_id {
            16400 => Some(Product::Adis16400),
            16405 => Some(Product::Adis16405),
            _ => None,
        }
    }

    /// What PROD_ID reads: the number of the part.
    pub const fn prod_id(self) -> u16 {
        match self {
            Product::Adis16400 => 16400,
            Product::Adis16405 => 16405,
        }
    }
}
