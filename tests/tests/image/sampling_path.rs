//! No panic can be reached from the interrupts between the sensor and the statistics, nor from that of the UART: shown on the images,
//! by the branches of their code. None of it calls through a pointer, so that the branches are all that is called.
//!
//! That of USB is not among them: the stack of USB is other people's, has panics, and runs below sampling and estimating.

use crate::bench::{TARGET, feather_image, image};
use crate::images;
use object::{Object, ObjectSymbol, SymbolKind};
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::path::Path;
use std::process::Command;

const M0_PLUS: &str = "thumbv6m-none-eabi";

/// What the code of a function does, as far as it matters here.
#[derive(Default)]
struct Function {
    name: String,
    bytes: u64,
    callees: BTreeSet<u64>,
    /// A call or a branch to an address in a register, or an instruction that is undefined on purpose.
    untraced: Vec<String>,
}

/// The functions of an image by their addresses, read from its disassembly.
fn functions(image: &Path) -> BTreeMap<u64, Function> {
    let elf = std::fs::read(image).expect("the image");
    let elf = object::File::parse(&*elf).expect("an ELF");
    let mut functions = BTreeMap::<u64, Function>::new();
    for symbol in elf.symbols().filter(|symbol| symbol.kind() == SymbolKind::Text && symbol.size() > 0) {
        let function = functions.entry(symbol.address() & !1).or_default();
        function.bytes = function.bytes.max(symbol.size());
    }
    let run = Command::new("arm-none-eabi-objdump")
        .args(["--disassemble", "--demangle", "--no-show-raw-insn"])
        .arg(image)
        .output();
    let text = String::from_utf8(run.expect("binutils for ARM").stdout).expect("names in UTF-8");
    let addresses: Vec<(u64, u64)> =
        functions.iter().map(|(&start, function)| (start, start + function.bytes)).collect();
    let around = |address: u64| {
        let before = addresses.partition_point(|&(start, _)| start <= address);
        addresses[..before].last().filter(|&&(_, end)| address < end).map(|&(start, _)| start)
    };
    for line in text.lines() {
        if let Some((address, name)) = line.strip_suffix(">:").and_then(|line| line.split_once(" <")) {
            let address = u64::from_str_radix(address, 16).expect("an address");
            if let Some(function) = functions.get_mut(&address) {
                name.clone_into(&mut function.name);
            }
        } else if let Some((address, instruction)) = line.trim_start().split_once(":\t") {
            let Some(start) = u64::from_str_radix(address, 16).ok().and_then(around) else { continue }; // between functions
            let (operation, operands) = instruction.split_once('\t').unwrap_or((instruction, ""));
            let target = operands.split_once(" <").map(|(before, _)| before.rsplit(' ').next().unwrap_or(before));
            let target = target.and_then(|target| u64::from_str_radix(target, 16).ok());
            let function = functions.get_mut(&start).expect("a function");
            match (operation, target) {
                (branch, Some(target)) if branch.starts_with(['b', 'c']) && around(target) != Some(start) => {
                    function.callees.insert(around(target).unwrap_or(target));
                }
                (branch, None) if branch.starts_with("bl") || branch.starts_with("bx") && operands != "lr" => {
                    function.untraced.push(instruction.to_owned());
                }
                // An addition to the counter is a jump by a table, within the function.
                (load, None) if operands.starts_with("pc,") && !load.starts_with("add") && !load.starts_with('c') => {
                    function.untraced.push(instruction.to_owned());
                }
                ("udf", _) => function.untraced.push(instruction.to_owned()),
                _ => {}
            }
        }
    }
    functions
}

/// What a search from an interrupt finds: functions and bytes of code that can run, and the paths to what must not be there.
struct Reached {
    functions: usize,
    bytes: u64,
    findings: Vec<String>,
}

/// Follows all branches from a function.
fn search(functions: &BTreeMap<u64, Function>, from: &str) -> Reached {
    let (&root, _) = functions.iter().find(|(_, function)| function.name == from).expect("a function of this name");
    let (mut before, mut open) = (BTreeMap::from([(root, root)]), VecDeque::from([root]));
    let mut reached = Reached { functions: 0, bytes: 0, findings: Vec::new() };
    while let Some(address) = open.pop_front() {
        let path = || {
            let steps = std::iter::successors(Some(address), |step| Some(before[step]).filter(|next| next != step));
            let names = steps.map(|step| functions.get(&step).map_or("no function", |function| &function.name));
            names.collect::<Vec<_>>().join(" <- ")
        };
        let Some(function) = functions.get(&address) else {
            reached.findings.push(path());
            continue;
        };
        reached.functions += 1;
        reached.bytes += function.bytes;
        if ["panic", "unwrap_failed", "expect_failed", "_fail", "begin_unwind"]
            .iter()
            .any(|part| function.name.contains(part))
        {
            reached.findings.push(path());
            continue; // What a panic calls matters no more.
        }
        if !function.untraced.is_empty() {
            reached.findings.push(format!("{} in {}", function.untraced.join("; "), path()));
        }
        for &callee in &function.callees {
            before.entry(callee).or_insert_with(|| {
                open.push_back(callee);
                address
            });
        }
    }
    reached
}

#[test]
fn no_panic_is_reached_from_the_interrupts_of_the_sampling_path() {
    let boards = [
        ("STM32-H405", image().to_owned(), ["EXTI0", "DMA2_STREAM0", "CAN1_TX", "USART2"]),
        (
            "Feather with USB",
            images::build("feather", TARGET, &["feather-usb"]),
            ["EXTI4", "DMA2_STREAM0", "CAN1_TX", "USART3"],
        ),
        ("Feather", feather_image().to_owned(), ["EXTI4", "DMA2_STREAM0", "CAN1_TX", "USART3"]),
        ("Pico", images::build("pico", M0_PLUS, &[]), ["IO_IRQ_BANK0", "DMA_IRQ_0", "SW0_IRQ", "UART0_IRQ"]),
    ];
    let mut findings = String::new();
    for (board, image, interrupts) in boards {
        let functions = functions(&image);
        for (interrupt, role) in interrupts.iter().zip(["data ready", "end of a burst", "estimators", "UART"]) {
            let Reached { functions, bytes, findings: found } = search(&functions, interrupt);
            println!("{board:<16} {role:<14} {interrupt:<12} {functions:>3} functions, {bytes:>6} bytes");
            found.iter().for_each(|path| findings += &format!("{board}: {path}\n"));
        }
        // The search finds what it looks for: the main loop has panics, and calls through pointers.
        let main = search(&functions, "main").findings.join("\n");
        assert!(main.contains("panic_bounds_check <- ") && main.contains("blx"), "{board}: {main}");
    }
    assert_eq!(findings, "", "\n{findings}");
}
