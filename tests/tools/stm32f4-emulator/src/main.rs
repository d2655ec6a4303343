//! Runs an image for the STM32F405: `stm32f4-emulator IMAGE.elf`, with a [`Scenario`] on standard input and its
//! [`Outcome`](emulation::Outcome) on standard output.

mod bench;
mod microcontroller;
mod probe;
mod sensor;

use emulation::Scenario;
use std::error::Error;
use std::io::{Read, Write, stdin, stdout};
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let image = std::env::args_os().nth(1).ok_or("usage: stm32f4-emulator IMAGE.elf <SCENARIO >OUTCOME")?;
    let mut bytes = Vec::new();
    stdin().read_to_end(&mut bytes)?;
    let outcome = bench::run(Path::new(&image), Scenario::from_bytes(&bytes)?);
    stdout().write_all(&outcome.to_bytes())?;
    Ok(())
}
