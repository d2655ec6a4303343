//! The counting images: built, run in QEMU, and what they said.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

/// A core, by the target that the image is compiled for and the board that it runs on.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Core {
    target: &'static str,
    board: &'static str,
    images: &'static [&'static str],
    counts: &'static OnceLock<Counts>,
}

pub(crate) static M4F: Core = {
    static COUNTS: OnceLock<Counts> = OnceLock::new();
    Core { target: "thumbv7em-none-eabihf", board: "mps2-an386", images: &["count", "fitting"], counts: &COUNTS }
};
pub(crate) static M0_PLUS: Core = {
    static COUNTS: OnceLock<Counts> = OnceLock::new();
    // A fit without a unit for floating point would take minutes to emulate.
    Core { target: "thumbv6m-none-eabi", board: "mps2-an385", images: &["count"], counts: &COUNTS }
};

impl Core {
    /// Runs the images at most once.
    pub(crate) fn counts(self) -> &'static Counts {
        self.counts.get_or_init(|| {
            let said = self.images.iter().map(|image| run(&build(self.target, image), self.board));
            Counts::parse(&said.collect::<String>())
        })
    }
}

/// What the images said.
#[derive(Debug)]
pub(crate) struct Counts {
    numbers: HashMap<String, f64>,
    /// Library and function, argument, answer.
    pub(crate) answers: Vec<(String, u64, u64)>,
}

impl Counts {
    fn parse(text: &str) -> Self {
        let mut counts = Self { numbers: HashMap::new(), answers: Vec::new() };
        let bits = |word: &str| u64::from_str_radix(word, 16).expect("a number in hexadecimal");
        for line in text.lines() {
            match line.split(' ').collect::<Vec<_>>()[..] {
                ["count" | "bytes", name, number] => counts.insert(name, number),
                ["early", "count", name, number] => counts.insert(&format!("early_{name}"), number),
                [library, name, number] => counts.insert(&format!("{library} {name}"), number),
                [library, name, argument, answer] => {
                    counts.answers.push((format!("{library} {name}"), bits(argument), bits(answer)));
                }
                _ => panic!("the image said: {line}"),
            }
        }
        counts
    }

    fn insert(&mut self, name: &str, number: &str) {
        self.numbers.insert(name.to_owned(), number.parse().expect("a number"));
    }

    pub(crate) fn of(&self, name: &str) -> f64 {
        *self.numbers.get(name).unwrap_or_else(|| panic!("the image counts {name}"))
    }
}

fn build(target: &str, image: &str) -> PathBuf {
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).expect("this crate is in tests/");
    let directory = std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| workspace.join("target"), PathBuf::from);
    // A directory of its own: the tests' own cargo may hold the lock of the other one.
    let directory = workspace.join(directory).join("instructions");
    let status = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
        .current_dir(workspace)
        .args(["build", "--package", "instruction-counts", "--bin", image, "--features", "on-target"])
        .args(["--release", "--locked", "--target", target, "--target-dir"])
        .arg(&directory)
        .status()
        .expect("cargo starts");
    assert!(status.success(), "the image does not build; its target comes with `rustup target add {target}`");
    directory.join(target).join("release").join(image)
}

/// One instruction takes 1 ns, whatever the machine is busy with.
fn run(image: &Path, board: &str) -> String {
    let Output { status, stdout, stderr } = Command::new("qemu-system-arm")
        .args(["-M", board, "-nographic", "-monitor", "none", "-serial", "none", "-icount", "shift=0"])
        .args(["-semihosting-config", "enable=on,target=native", "-kernel"])
        .arg(image)
        .output()
        .expect("qemu-system-arm starts; Debian has it in the package of that name");
    let said = String::from_utf8_lossy(&stdout).into_owned();
    assert!(status.success(), "{board}: {status}\n{said}\n{}", String::from_utf8_lossy(&stderr));
    said
}
