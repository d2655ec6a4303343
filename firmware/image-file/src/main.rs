//! `cargo run -p image-file -- BOARD [FILE]` builds the image of a board as it is to be flashed, writes the file that the board's
//! boot loader takes, and says how to load it.

use image_file::flash_contents::{self, ImageError};
use image_file::uf2;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::{env, fs};

/// A board whose image this checkout builds.
struct Board {
    name: &'static str,
    /// Program and features of the package `firmware`.
    program: &'static str,
    features: &'static str,
    target: &'static str,
    extension: &'static str,
    convert: fn(&[u8]) -> Result<Vec<u8>, ImageError>,
    /// Instructions to load the file; its name replaces `FILE`.
    load: &'static str,
}

/// STM32: in its boot loader, which the pin BOOT0 selects, the board is a device for dfu-util (https://dfu-util.sourceforge.net).
const DFU: &str = "connect BOOT0 to 3.3 V and press reset, or type bootsel at a board that runs this firmware, and then
  dfu-util --alt 0 --dfuse-address 0x08000000:leave --download FILE
and take BOOT0 to ground: the next restart would end in the boot loader";

const BOARDS: [Board; 4] = [
    Board {
        name: "pico",
        program: "observatory-pico",
        features: "board-pico",
        target: "thumbv6m-none-eabi",
        extension: "uf2",
        convert: uf2::from_elf,
        load: "hold BOOTSEL while you plug the board in, and copy FILE to the drive RPI-RP2 that appears;
a board that runs this firmware shows the drive after the command bootsel",
    },
    Board {
        name: "feather",
        program: "observatory-feather",
        features: "board-feather",
        target: "thumbv7em-none-eabihf",
        extension: "bin",
        convert: flash_contents::stm32f405,
        load: DFU,
    },
    // This image has a serial port on USB, which has not run yet.
    Board {
        name: "feather-usb",
        program: "observatory-feather",
        features: "board-feather,feather-usb",
        target: "thumbv7em-none-eabihf",
        extension: "bin",
        convert: flash_contents::stm32f405,
        load: DFU,
    },
    Board {
        name: "h405",
        program: "observatory-h405",
        features: "board-h405",
        target: "thumbv7em-none-eabihf",
        extension: "bin",
        convert: flash_contents::stm32f405,
        load: DFU,
    },
];

fn main() -> ExitCode {
    match run(&env::args().skip(1).collect::<Vec<_>>()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &[String]) -> Result<(), Box<dyn Error>> {
    let names = BOARDS.map(|board| board.name).join(", ");
    let (name, out) = match arguments {
        [name] => (name, None),
        [name, out] => (name, Some(PathBuf::from(out))),
        _ => return Err(format!("usage: cargo run -p image-file -- BOARD [FILE], with a board of {names}").into()),
    };
    let board = BOARDS.iter().find(|board| board.name == name);
    let board = board.ok_or_else(|| format!("no board {name}: there are {names}"))?;
    let contents = (board.convert)(&build(board)?)?;
    let out = out.unwrap_or_else(|| format!("observatory-{}.{}", board.name, board.extension).into());
    fs::write(&out, &contents).map_err(|error| format!("{}: {error}", out.display()))?;
    println!("{}, {} kB: {}", out.display(), contents.len() / 1024, board.load.replace("FILE", &out.to_string_lossy()));
    Ok(())
}

/// Builds the image and returns its ELF.
fn build(board: &Board) -> Result<Vec<u8>, Box<dyn Error>> {
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    // A separate folder, as in the tests: cargo, which runs this program, may hold the lock of its own.
    let target = env::var_os("CARGO_TARGET_DIR").map_or_else(|| workspace.join("target"), PathBuf::from).join("image");
    fs::create_dir_all(&target).map_err(|error| format!("{}: {error}", target.display()))?;
    // Cargo writes the images of a board into one file for all features, and the tests may build others at the same time.
    let one_at_a_time = fs::File::create(target.join("building"))?;
    one_at_a_time.lock()?;
    let status = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
        .current_dir(&workspace)
        .args(["build", "--package", "firmware", "--bin", board.program, "--features", board.features])
        .args(["--profile", "image", "--locked", "--target", board.target, "--target-dir"])
        .arg(&target)
        .status()
        .map_err(|error| format!("cargo does not start: {error}"))?;
    if !status.success() {
        return Err(
            format!("the image does not build; its target comes with: rustup target add {}", board.target).into()
        );
    }
    let elf = target.join(board.target).join("image").join(board.program);
    Ok(fs::read(&elf).map_err(|error| format!("{}: {error}", elf.display()))?)
}
