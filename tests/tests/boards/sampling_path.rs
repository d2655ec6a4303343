//! The sampling path of each image: the machine code that the two sampling interrupts and the interrupt of the
//! estimators reach.

use super::bench::{TARGET, feather_image, image};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::Path;
use std::process::Command;
use system_tests::Image;

/// The target of the Pico.
const PICO: &str = "thumbv6m-none-eabi";
/// Functions that are called only by their address, and the closure that calls the encoder of messages.
const CALLS_BY_ADDRESS: [&str; 2] = ["firmware::transmit::TransmitQueue::send", "link::frame::CobsFlavor"];
const CALLED_BY_ADDRESS: &str = "firmware::transmit::TransmitQueue::send::{{closure}}";
/// Checks that remain in other crates: the called function, and a part of the place. A queue of `heapless` divides by its number of slots,
/// which each end has in memory. `postcard` takes the slice `[..=last]` of the bytes of an integer that it has just written. The HAL of the
/// RP2040 takes only 0 or 1 from the register that distinguishes its cores.
const LEFT: [(&str, &str); 3] = [
    ("core::panicking::panic_const::panic_const_rem_by_zero", "/src/spsc.rs:"),
    ("RangeToInclusive<usize> as core::slice::index::SliceIndex", "/slice/index.rs:"),
    ("core::panicking::panic_fmt", "/src/sio.rs:"),
];

/// A call within the code of an image.
struct Call {
    to: u32,
    /// File and line of the source.
    place: String,
}

/// A function of an image, from the disassembler.
#[derive(Default)]
struct Function {
    name: String,
    calls: Vec<Call>,
    calls_by_address: bool,
}

/// The functions of an image, by their addresses.
fn functions(image: &Path) -> BTreeMap<u32, Function> {
    let output = Command::new("arm-none-eabi-objdump")
        .args(["--disassemble", "--demangle", "--line-numbers", "--no-show-raw-insn"])
        .arg(image)
        .output()
        .expect("arm-none-eabi-objdump, of the package binutils-arm-none-eabi");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let listing = String::from_utf8(output.stdout).expect("names in UTF-8");
    let address = |text: &str| u32::from_str_radix(text.trim(), 16).ok();
    let (mut functions, mut place) = (BTreeMap::<u32, Function>::new(), "");
    for line in listing.lines() {
        if line.starts_with('/') {
            place = line;
        } else if let Some((start, name)) = line.strip_suffix(">:").and_then(|line| line.split_once(" <"))
            && let Some(start) = address(start)
        {
            functions.insert(start, Function { name: name.to_owned(), ..Function::default() });
        } else if let [_, mnemonic, arguments, ..] = line.split('\t').collect::<Vec<_>>()[..]
            && let Some(mut function) = functions.last_entry()
        {
            let target = arguments.split_once(" <").and_then(|(target, _)| address(target));
            match (mnemonic.trim_end_matches(".n").trim_end_matches(".w"), target) {
                ("b" | "bl", Some(to)) => function.get_mut().calls.push(Call { to, place: place.to_owned() }),
                ("blx", None) => function.get_mut().calls_by_address = true,
                ("bx", None) if arguments != "lr" => function.get_mut().calls_by_address = true,
                _ => {}
            }
        }
    }
    functions
}

/// True if a function panics, or decides whether to panic.
fn is_panic(name: &str) -> bool {
    [
        "core::slice::index::SliceIndex",
        "core::panicking::",
        "unwrap_failed",
        "expect_failed",
        "_fail",
        "rust_begin_unwind",
    ]
    .iter()
    .any(|part| name.contains(part))
}

/// Asserts that no function that these interrupts reach panics, and returns the entries of [`LEFT`] that are reached.
fn assert_no_panic(image: &Path, interrupts: [&str; 3]) -> BTreeSet<&'static str> {
    let functions = functions(image);
    let is_root = |name: &str| interrupts.contains(&name) || name == CALLED_BY_ADDRESS;
    let mut open: Vec<u32> = functions.iter().filter(|(_, of)| is_root(&of.name)).map(|(&start, _)| start).collect();
    assert_eq!(open.len(), interrupts.len() + 1, "{interrupts:?} in {}", image.display());
    let mut reached: BTreeSet<u32> = open.iter().copied().collect();
    let (mut panics, mut left) = (Vec::new(), BTreeSet::new());
    while let Some(start) = open.pop() {
        let function = &functions[&start];
        let is_known = CALLS_BY_ADDRESS.iter().any(|name| function.name.contains(name));
        assert!(is_known || !function.calls_by_address, "{} calls a function by its address", function.name);
        for Call { to, place } in &function.calls {
            let (&called, of) = functions.range(..=*to).next_back().expect("a function");
            let kept = LEFT.iter().find(|(name, part)| of.name.contains(name) && place.contains(part));
            match is_panic(&of.name) {
                true if let Some((name, _)) = kept => drop(left.insert(*name)),
                true => panics.push(format!("{} calls {} at {place}", function.name, of.name)),
                false if reached.insert(called) => open.push(called),
                false => {}
            }
        }
    }
    assert!(panics.is_empty(), "{}: {panics:#?}", image.display());
    println!("{}: {} functions, checks left in {left:?}", image.display(), reached.len());
    left
}

/// The sampling interrupts validate a burst and queue it. The interrupt of the estimators adds it to all sums and sends the raw stream.
#[test]
fn the_sampling_path_of_each_image_has_no_panic() {
    let h405 = ["EXTI0", "DMA2_STREAM0", "CAN1_TX"];
    let feather = ["EXTI4", "DMA2_STREAM0", "CAN1_TX"];
    let pico = ["IO_IRQ_BANK0", "DMA_IRQ_0", "SW0_IRQ"];
    let images = [
        (image(), h405),
        (feather_image(), feather),
        (&Image::of_board("feather", TARGET, &["feather-usb"]), feather),
        (&Image::of_board("pico", PICO, &[]), pico),
    ];
    let left: BTreeSet<&str> =
        images.into_iter().flat_map(|(image, interrupts)| assert_no_panic(image, interrupts)).collect();
    assert_eq!(left, BTreeSet::from(LEFT.map(|(name, _)| name)), "checks that are left");
}

/// The main loop panics if a check fails, so the search must find its panics.
#[test]
fn the_main_loop_has_panics() {
    let functions = functions(image());
    let calls = functions.values().filter(|of| of.name.starts_with("firmware::app::run"));
    assert!(calls.flat_map(|of| &of.calls).any(|call| functions.get(&call.to).is_some_and(|of| is_panic(&of.name))));
}

/// The functions that run while the Pico's flash executes commands.
const IN_RAM: [&str; 1] = ["operate_flash"];
/// Addresses of the flash.
const FLASH: Range<u32> = 0x1000_0000..0x1100_0000;

/// The flash cannot be read while it executes commands. The functions that command it are in RAM, call no function in flash by its address,
/// and contain no address there. They call the boot ROM and the copy of the second stage through pointers.
#[test]
fn code_that_runs_while_the_flash_is_busy_does_not_use_it() {
    let image = Image::of_board("pico", PICO, &[]);
    let output = Command::new("arm-none-eabi-objdump")
        .args(["--disassemble-all", "--section=.data", "--demangle", "--no-show-raw-insn"])
        .arg(&image)
        .output()
        .expect("arm-none-eabi-objdump, of the package binutils-arm-none-eabi");
    let listing = String::from_utf8(output.stdout).expect("names in UTF-8");
    let mut functions = BTreeMap::<&str, usize>::new();
    let mut inside = None;
    for line in listing.lines() {
        if let Some((start, name)) = line.strip_suffix(">:").and_then(|line| line.split_once(" <")) {
            inside = IN_RAM.into_iter().find(|function| name.ends_with(function));
            let start = u32::from_str_radix(start, 16).expect("an address");
            assert!(inside.is_none() || (0x2000_0000..0x2004_2000).contains(&start), "{line}");
        } else if let Some(function) = inside
            && let [_, instruction @ ..] = &line.split('\t').collect::<Vec<_>>()[..]
        {
            *functions.entry(function).or_default() += 1;
            let numbers = instruction.iter().flat_map(|part| part.split(|c: char| !c.is_ascii_alphanumeric()));
            let in_flash = numbers.filter_map(|word| u32::from_str_radix(word.trim_start_matches("0x"), 16).ok());
            let in_flash: Vec<u32> = in_flash.filter(|number| FLASH.contains(number)).collect();
            assert!(in_flash.is_empty(), "{function} uses {in_flash:x?}: {line}");
            assert!(instruction.first().is_none_or(|mnemonic| *mnemonic != "bl"), "{function} calls: {line}");
        }
    }
    assert!(functions.len() == IN_RAM.len() && functions.values().all(|&lines| lines > 10), "{functions:?}");
}
