//! The explanation of a recording as text and as pictures.

mod picture;
pub mod text;

pub use picture::picture;
