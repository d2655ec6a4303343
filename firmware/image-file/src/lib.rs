//! The flash contents of an image, as the files that boot loaders take: UF2 for the RP2040, plain bytes for the STM32.
#![deny(missing_docs)]

pub mod flash_contents;
pub mod uf2;
