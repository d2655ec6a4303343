//! The command `imunoise`.

#[cfg(feature = "mimalloc")]
mod allocator;

use std::process::ExitCode;

fn main() -> ExitCode {
    let prepare = |_is_simulation: bool| {
        #[cfg(feature = "mimalloc")]
        allocator::prepare(_is_simulation);
    };
    ExitCode::from(host_sim::command::run(std::env::args_os().collect(), prepare))
}
