//! libm and micromath on the target: the table in `allan-core/src/math.rs`.

use crate::image::{Counts, M0_PLUS, M4F};
use statrs::function::gamma::ln_gamma;

/// The host's functions, which come from its C library, and statrs's.
fn reference(name: &str, x: f64) -> f64 {
    match name {
        "sqrt" => x.sqrt(),
        "ln" => x.ln(),
        "log2" => x.log2(),
        "exp" => x.exp(),
        "expm1" => x.exp_m1(),
        "floor" => x.floor(),
        "abs" => x.abs(),
        "ln_gamma" => ln_gamma(x),
        _ => panic!("no reference for {name}"),
    }
}

/// Largest error, relative to the answer where that is above 1.
fn error(counts: &Counts, library: &str, name: &str) -> Option<f64> {
    let asked = format!("{library} {name}");
    let answers = counts.answers.iter().filter(|(name, ..)| *name == asked);
    let errors = answers.map(|&(_, argument, answer)| {
        let (argument, answer) = match library {
            // The argument that the function was given had the precision of its answer.
            "micromath" => (f64::from(f64::from_bits(argument) as f32), f64::from(f32::from_bits(answer as u32))),
            _ => (f64::from_bits(argument), f64::from_bits(answer)),
        };
        let expected = reference(name, argument);
        (answer - expected).abs() / expected.abs().max(1.0)
    });
    errors.reduce(f64::max)
}

const NAMES: [&str; 8] = ["sqrt", "ln", "log2", "exp", "expm1", "floor", "abs", "ln_gamma"];

/// The table's row of a function: error and instructions on both cores, of libm and of micromath.
fn row(name: &str) -> Vec<&'static str> {
    let source = include_str!("../../../../allan-core/src/math.rs");
    let start = format!("//! | `{name}` |");
    let row = source.lines().find_map(|line| line.strip_prefix(&start));
    row.unwrap_or_else(|| panic!("no row for {name}")).trim_end_matches(" |").split(" | ").map(str::trim).collect()
}

#[test]
fn the_table_in_the_documentation_is_what_the_target_does() {
    for name in NAMES {
        let row = row(name);
        for (library, cells) in ["libm", "micromath"].into_iter().zip(row.chunks(2)) {
            let Some(error) = error(M4F.counts(), library, name) else {
                assert_eq!(cells, ["—", "—"], "{library} has no {name}");
                continue;
            };
            println!("{library} {name}: error {error:.0e}");
            let told: f64 = cells[0].parse().expect("an error");
            // One digit is told; the last bit may move with the compiler.
            assert!(error <= 1.5 * told && error >= told / 4.0, "{library} {name}: {error:.0e}, not {told:.0e}");
            for (core, told) in [M4F, M0_PLUS].into_iter().zip(cells[1].split(", ")) {
                let count = core.counts().of(&format!("{library} {name}"));
                let told: f64 = told.parse().expect("a number of instructions");
                println!("{library} {name}: {count} instructions");
                assert!((count - told).abs() <= 0.1 * told + 4.0, "{library} {name}: {count} instructions, not {told}");
            }
        }
    }
}

#[test]
fn both_cores_answer_alike() {
    for ((name, argument, m4f), (.., m0_plus)) in M4F.counts().answers.iter().zip(&M0_PLUS.counts().answers) {
        // micromath's f32 goes through a unit that fuses nothing: the same bits, too.
        assert_eq!(m4f, m0_plus, "{name} of {}", f64::from_bits(*argument));
    }
}

#[test]
fn reported_figures_are_good_to_the_last_digits() {
    for name in NAMES {
        let error = error(M4F.counts(), "libm", name).expect("libm has them all");
        assert!(error < 1e-14, "{name}: {error}");
    }
}
