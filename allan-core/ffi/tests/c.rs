//! Compiles C programs against the static library and the header, and runs them on this machine and in an emulator.

#[path = "c/build.rs"]
mod build;

use allan_core::fit::{fit, fit_power_laws, goodness};
use allan_core::trace::{LineCandidates, Trace, trace_while};
use allan_core::{Cascade, Curve, Model, NoiseTerm};
use build::{ARM_GCC, ARM_TARGETS, Program, header_text, library, ours, run, tool};
use std::fmt::Write;
use system_tests::{generated_within, note_skipped};

/// The generator of `programs/curve.c`.
struct Samples(u64);

impl Iterator for Samples {
    type Item = i32;

    fn next(&mut self) -> Option<i32> {
        self.0 = self.0 * 16_807 % 2_147_483_647;
        Some((self.0 % 100) as i32)
    }
}

fn print_curve<const OCTAVES: usize>(text: &mut String, name: &str, curve: &Curve<OCTAVES>) {
    for p in curve.points() {
        let [tau, avar, low, high, edf] = [p.tau, p.avar, p.low, p.high, p.edf].map(f64::to_bits);
        let numbers = format!("{tau:016x} {avar:016x} {low:016x} {high:016x} {edf:016x}");
        writeln!(text, "{name} {} {} {numbers} {}", p.n, p.count, p.power_law as i32).expect("memory");
    }
}

fn print_terms(text: &mut String, name: &str, model: &Model) {
    for (term, kind) in model.terms().iter().zip(1..) {
        let [value, low, high] = [term.value, term.low, term.high].map(f64::to_bits);
        writeln!(text, "{name} {kind} {value:016x} {low:016x} {high:016x}").expect("memory");
    }
}

fn print_model(text: &mut String, name: &str, model: &Model, p_value: f64) {
    print_terms(text, name, model);
    writeln!(text, "{name} {:016x} {:016x}", p_value.to_bits(), model.avar(64).to_bits()).expect("memory");
}

/// The output of `programs/curve.c`, computed with the Rust library.
fn expected() -> String {
    let mut text = String::new();
    let (mut large, mut later, mut small) = (Cascade::<24, 8>::new(), Cascade::<24, 8>::new(), Cascade::<20, 4>::new());
    let mut samples = Samples(1);
    for sample in samples.by_ref().take(5_000) {
        large.push(sample);
        small.push(-sample);
    }
    large.gap(3);
    let mut slice = Vec::new();
    for _ in 0..5 {
        slice = samples.by_ref().take(1_000).collect();
        large.push_slice(&slice);
        later.push_slice(&slice[..700]);
    }
    small.push_slice(&slice);
    print_curve(&mut text, "restored", &small.curve(0.005));
    let curve = large.curve(0.01).scaled(0.05);
    print_curve(&mut text, "large", &curve);
    let model = fit(&curve, &NoiseTerm::BASELINE);
    print_model(&mut text, "fit", &model, goodness(&curve, &model).p_value);
    let model = fit_power_laws(&large.curve_without_confidence(0.01).scaled(0.05), &NoiseTerm::BASELINE);
    print_terms(&mut text, "power laws", &model);
    writeln!(text, "power laws: p is NaN: 1").expect("memory");
    let (mut trace, mut calls) = (Trace::baseline(&curve), 0);
    let completed = trace_while(&mut trace, &curve, LineCandidates::Curve, &[], &mut || {
        calls += 1;
        calls < 4
    });
    assert!(!completed);
    writeln!(text, "trace: the callback ended the search after {calls} calls").expect("memory");
    print_model(&mut text, "before", &trace.before, trace.before_goodness.p_value);
    large.merge(&later);
    print_curve(&mut text, "merged", &large.curve(0.01).scaled(0.05));
    writeln!(text, "13500 samples, 3 missing, saturated 0").expect("memory");
    text
}

#[test]
fn the_header_is_up_to_date() {
    let committed = std::fs::read_to_string(ours("include/allan_core.h")).unwrap_or_default();
    if committed != header_text() {
        let new = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("allan_core.h");
        std::fs::write(&new, header_text()).expect("room");
        panic!("include/allan_core.h is not what cbindgen makes of src/; that is now in {}", new.display());
    }
}

#[test]
fn c_computes_what_rust_computes() {
    let mut program = Program::on_host(&[ours("tests/programs/curve.c")], &["-O2"]);
    assert_eq!(run(program.command()), expected());
}

#[test]
fn wrong_arguments_are_refused_under_the_sanitizers() {
    let mut program = Program::on_host(
        &[ours("tests/programs/hostile.c")],
        &["-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"],
    );
    assert_eq!(run(program.command()), "");
}

#[test]
fn microcontrollers_compute_what_rust_computes() {
    let name = "microcontrollers_compute_what_rust_computes";
    for needed in [ARM_GCC, "qemu-system-arm"] {
        if !tool(needed) {
            return note_skipped(name, &format!("{needed} is not installed"));
        }
    }
    let expected = expected();
    for target in &ARM_TARGETS {
        let program = Program::on_board(&[ours("tests/programs/curve.c")], target);
        assert_eq!(run(&mut program.emulated(target)), expected, "{}", target.name);
    }
}

#[test]
fn the_example_of_the_documentation_runs() {
    let page = std::fs::read_to_string(ours("../../docs/c.md")).expect("docs/c.md");
    let block = |language: &str| {
        let (_, rest) = page.split_once(&format!("```{language}\n")).expect("a block");
        rest.split_once("```").expect("the end of the block").0.to_owned()
    };
    let folder = tempfile::tempdir().expect("a folder");
    let source = folder.path().join("example.c");
    std::fs::write(&source, block("c")).expect("room");
    assert_eq!(run(Program::on_host(&[source], &["-O2"]).command()), block("text"));
}

/// Rows of the table in docs/c.md, and the macro of `programs/flash.c`.
const PROGRAMS: [(&str, &str); 5] = [
    ("`init`, `push`, `gap`", "PUSH"),
    ("and `curve_without_confidence`", "VARIANCES"),
    ("and `allan_fit_power_laws`", "POWER_LAWS"),
    ("`init`, `push`, `gap` and `curve`", "CURVE"),
    ("and `allan_fit`", "FIT"),
];

/// A kB is 1,024 bytes. A twentieth may come with the compilers.
#[test]
fn the_flash_of_programs_is_in_the_docs() {
    if !tool(ARM_GCC) {
        return note_skipped("the_flash_of_programs_is_in_the_docs", &format!("{ARM_GCC} is not installed"));
    }
    let mut table = "| functions | flash |\n|---|---|\n".to_owned();
    for (row, part) in PROGRAMS {
        let size = f64::from(build::flash_bytes(&ARM_TARGETS[0], &ours("tests/programs/flash.c"), part)) / 1024.0;
        table += &format!("| {row} | {size:.1} kB |\n");
    }
    generated_within("docs/c.md", "flash", &table, 0.05);
}

#[test]
fn cmake_and_pkg_config_know_the_version() {
    let text = |file| std::fs::read_to_string(ours(file)).expect("a file");
    let [package, cmake] = [text("cmake/allan_core.pc.in"), text("cmake/allan_coreConfigVersion.cmake")];
    let whole = env!("CARGO_PKG_VERSION");
    assert!(package.contains(&format!("Version: {whole}\n")), "{package}");
    assert!(cmake.contains(&format!("set(PACKAGE_VERSION {whole})")), "{cmake}");
    let minor = concat!("FIND_VERSION_MINOR EQUAL ", env!("CARGO_PKG_VERSION_MINOR"));
    assert!(cmake.contains(minor), "{cmake}");
}

#[test]
fn cmake_finds_the_library() {
    if !tool("cmake") {
        return note_skipped("cmake_finds_the_library", "cmake is not installed");
    }
    let folder = tempfile::tempdir().expect("a folder");
    let prefix = build::install(folder.path());
    let built = folder.path().join("build");
    let mut configure = std::process::Command::new("cmake");
    configure.arg("-S").arg(ours("tests/programs")).arg("-B").arg(&built);
    run(configure.arg(format!("-DCMAKE_PREFIX_PATH={}", prefix.display())));
    run(std::process::Command::new("cmake").arg("--build").arg(&built));
    assert_eq!(run(&mut std::process::Command::new(built.join("curve"))), expected());
}

#[test]
fn pkg_config_finds_the_library() {
    if !tool("pkg-config") {
        return note_skipped("pkg_config_finds_the_library", "pkg-config is not installed");
    }
    let folder = tempfile::tempdir().expect("a folder");
    let prefix = build::install(folder.path());
    let mut query = std::process::Command::new("pkg-config");
    let flags =
        run(query.env("PKG_CONFIG_PATH", prefix.join("lib/pkgconfig")).args(["--cflags", "--libs", "allan_core"]));
    let program = folder.path().join("curve");
    let mut compile = std::process::Command::new("cc");
    run(compile.arg(ours("tests/programs/curve.c")).args(flags.split_whitespace()).arg("-o").arg(&program));
    assert_eq!(run(&mut std::process::Command::new(program)), expected());
    assert!(library(None).exists());
}
