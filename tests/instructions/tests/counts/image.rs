//! Builds the counting images, runs them in QEMU and reads their output.

use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;
use system_tests::Image;

/// A core: the target for which the image is compiled, and the board on which it runs.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Core {
    target: &'static str,
    board: &'static str,
    images: &'static [&'static str],
    counts: &'static OnceLock<Counts>,
}

pub(crate) static M4F: Core = {
    static COUNTS: OnceLock<Counts> = OnceLock::new();
    Core {
        target: "thumbv7em-none-eabihf",
        board: "mps2-an386",
        images: &["count", "calls", "fitting"],
        counts: &COUNTS,
    }
};
pub(crate) static M0_PLUS: Core = {
    static COUNTS: OnceLock<Counts> = OnceLock::new();
    // The image `fitting` would take minutes to emulate without a floating-point unit.
    Core { target: "thumbv6m-none-eabi", board: "mps2-an385", images: &["count", "calls"], counts: &COUNTS }
};

impl Core {
    /// Rust's name of the target.
    pub(crate) fn target(self) -> &'static str {
        self.target
    }

    /// The counts of this core's images, which run at most once.
    pub(crate) fn counts(self) -> &'static Counts {
        self.counts.get_or_init(|| {
            let output = self.images.iter().map(|image| run(&build(self.target, image), self.board));
            Counts::parse(&output.collect::<String>())
        })
    }
}

/// The output of the images.
#[derive(Debug)]
pub(crate) struct Counts {
    numbers: HashMap<String, f64>,
    /// Library with function, bits of the argument, bits of the result.
    pub(crate) results: Vec<(String, u64, u64)>,
}

impl Counts {
    fn parse(text: &str) -> Self {
        let mut counts = Self { numbers: HashMap::new(), results: Vec::new() };
        let bits = |word: &str| u64::from_str_radix(word, 16).expect("a number in hexadecimal");
        for line in text.lines() {
            match line.split(' ').collect::<Vec<_>>()[..] {
                ["count" | "bytes", name, number] => counts.insert(name, number),
                ["early", "count", name, number] => counts.insert(&format!("early_{name}"), number),
                [library, name, number] => counts.insert(&format!("{library} {name}"), number),
                ["call", name, metric, number] => counts.insert(&format!("{name} {metric}"), number),
                [library, name, argument, result] => {
                    counts.results.push((format!("{library} {name}"), bits(argument), bits(result)));
                }
                _ => panic!("unknown line of the image: {line}"),
            }
        }
        counts
    }

    fn insert(&mut self, name: &str, number: &str) {
        self.numbers.insert(name.to_owned(), number.parse().expect("a number"));
    }

    /// The names of the calls that an image has counted.
    pub(crate) fn calls(&self) -> BTreeSet<&str> {
        let names = self.numbers.keys().filter_map(|name| name.split_once(' ')).map(|(call, _)| call);
        names.filter(|call| call.contains("::")).collect()
    }

    /// The number that an image printed under this name, if it did.
    pub(crate) fn get(&self, name: &str) -> Option<f64> {
        self.numbers.get(name).copied()
    }

    /// The number that an image printed under this name.
    pub(crate) fn number(&self, name: &str) -> f64 {
        self.get(name).unwrap_or_else(|| panic!("the image printed no {name}"))
    }
}

fn build(target: &str, image: &str) -> PathBuf {
    let arguments = &["--features", "on-target"];
    let image =
        Image { package: "instruction-counts", program: image, target, profile: "counted", arguments, variable: None };
    image.build(&format!("counted-{}-{target}", image.program))
}

/// Runs an image and returns its output. `-icount shift=0` makes an instruction take 1 ns of the board's time,
/// independent of the machine's load.
fn run(image: &Path, board: &str) -> String {
    let Output { status, stdout, stderr } = Command::new("qemu-system-arm")
        .args(["-M", board, "-nographic", "-monitor", "none", "-serial", "none", "-icount", "shift=0"])
        .args(["-semihosting-config", "enable=on,target=native", "-kernel"])
        .arg(image)
        .output()
        .expect("qemu-system-arm starts; it is the Debian package of that name");
    let output = String::from_utf8_lossy(&stdout).into_owned();
    assert!(status.success(), "{board}: {status}\n{output}\n{}", String::from_utf8_lossy(&stderr));
    output
}
