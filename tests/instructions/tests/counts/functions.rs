//! Errors and instructions of libm and micromath on the target, compared with the table in `allan-core/src/math.rs`.

use crate::image::{Counts, M0_PLUS, M4F};
use statrs::function::gamma::ln_gamma;

/// The reference is the host's C library, or statrs.
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

/// The largest error, relative to the result if that is above 1.
fn error(counts: &Counts, library: &str, name: &str) -> Option<f64> {
    let function = format!("{library} {name}");
    let results = counts.results.iter().filter(|(name, ..)| *name == function);
    let errors = results.map(|&(_, argument, result)| {
        let (argument, result) = match library {
            // micromath gets the argument rounded to f32.
            "micromath" => (f64::from(f64::from_bits(argument) as f32), f64::from(f32::from_bits(result as u32))),
            _ => (f64::from_bits(argument), f64::from_bits(result)),
        };
        let expected = reference(name, argument);
        (result - expected).abs() / expected.abs().max(1.0)
    });
    errors.reduce(f64::max)
}

const NAMES: [&str; 8] = ["sqrt", "ln", "log2", "exp", "expm1", "floor", "abs", "ln_gamma"];

/// The row of a function in the table: error and instructions on both cores, of libm and of micromath.
fn row(name: &str) -> Vec<&'static str> {
    let source = include_str!("../../../../allan-core/src/math.rs");
    let start = format!("//! | `{name}` |");
    let row = source.lines().find_map(|line| line.strip_prefix(&start));
    row.unwrap_or_else(|| panic!("no row for {name}")).trim_end_matches(" |").split(" | ").map(str::trim).collect()
}

pub(crate) fn errors_and_instructions_are_those_of_their_table() {
    for name in NAMES {
        let row = row(name);
        for (library, cells) in ["libm", "micromath"].into_iter().zip(row.chunks(2)) {
            let Some(error) = error(M4F.counts(), library, name) else {
                assert_eq!(cells, ["—", "—"], "{library} has no {name}");
                continue;
            };
            println!("{library} {name}: error {error:.0e}");
            let documented: f64 = cells[0].parse().expect("an error");
            // The table has one digit, and the last bit may change with the compiler.
            assert!(
                error <= 1.5 * documented && error >= documented / 4.0,
                "{library} {name}: {error:.0e}, not {documented:.0e}"
            );
            for (core, documented) in [M4F, M0_PLUS].into_iter().zip(cells[1].split(", ")) {
                let count = core.counts().number(&format!("{library} {name}"));
                let documented: f64 = documented.parse().expect("a number of instructions");
                println!("{library} {name}: {count} instructions");
                assert!(
                    (count - documented).abs() <= 0.1 * documented + 4.0,
                    "{library} {name}: {count} instructions, not {documented}"
                );
            }
        }
    }
}

pub(crate) fn both_cores_give_the_same_bits() {
    for ((name, argument, m4f), (.., m0_plus)) in M4F.counts().results.iter().zip(&M0_PLUS.counts().results) {
        // This holds for micromath too, as the compiler emits no fused multiply-add for the floating-point unit.
        assert_eq!(m4f, m0_plus, "{name} of {}", f64::from_bits(*argument));
    }
}

pub(crate) fn libm_has_an_error_below_1e_14() {
    for name in NAMES {
        let error = error(M4F.counts(), "libm", name).expect("a function of libm");
        assert!(error < 1e-14, "{name}: {error}");
    }
}
