//! Makes the source of the smaller estimator.

use std::path::PathBuf;

mod smaller;

fn main() {
    // Cargo runs a script again if its sources change, of whichever package, and this one reads nothing else.
    println!("cargo:rerun-if-changed=Cargo.toml");
    let larger = include_str!("src/cascade_24_8.rs");
    let folder = PathBuf::from(std::env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    std::fs::write(folder.join("cascade_20_4.rs"), smaller::smaller(larger)).expect("room");
}
