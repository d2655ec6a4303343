//! Prints the C header of allan-core: `c-header allan-core/ffi FILE.rs…`, with the folder of `cbindgen.toml` and the sources in their
//! order.

use std::error::Error;
use std::io::stdout;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args_os().skip(1).map(PathBuf::from);
    let folder = arguments.next().ok_or("usage: c-header FOLDER FILE.rs…")?;
    let config = cbindgen::Config::from_file(folder.join("cbindgen.toml"))?;
    let builder = cbindgen::Builder::new().with_config(config);
    let builder = arguments.fold(builder, |builder, file| builder.with_src(file));
    builder.generate()?.write(stdout());
    Ok(())
}
