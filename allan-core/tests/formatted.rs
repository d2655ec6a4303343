//! With the feature `defmt`, every public value can be printed by a microcontroller.

use allan_core::fit::Goodness;
use allan_core::host::NewestDifferences;
use allan_core::model::{Discrepancy, FittedTerm};
use allan_core::regression::{Covariate, Sensitivity};
use allan_core::slope_method::SlopeEstimate;
use allan_core::telegraph::KurtosisRatio;
use allan_core::term::{
    AngleRandomWalk, BiasInstability, CoefficientUnit, LowPass, Markov, MovingAverageFilter, Quantization, RateRamp,
    RateRandomWalk, Resonance, Shape, Sinusoid,
};
use allan_core::trace::{AddedTerm, LineCandidates, Residual, Trace};
use allan_core::*;
use std::path::Path;

/// The names of the types, each of which the compiler has found to have `defmt::Format`.
macro_rules! formatted {
    ($($name:ident $(<$($argument:literal),*>)?),* $(,)?) => {{
        fn has_format<T: defmt::Format>() {}
        $(has_format::<$name $(<$($argument),*>)?>();)*
        [$(stringify!($name)),*]
    }};
}

/// The public types of the sources that have `Debug`: values, not the steps of a computation.
fn public_values(folder: &Path, names: &mut Vec<String>) {
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            public_values(&path, names);
            continue;
        }
        let source = std::fs::read_to_string(&path).expect("a source file");
        let mut has_debug = false;
        for line in source.lines() {
            let declared = ["pub struct ", "pub enum "].iter().find_map(|start| line.strip_prefix(start));
            if let Some(declared) = declared.filter(|_| has_debug) {
                let end = declared.find(|letter: char| !letter.is_alphanumeric()).unwrap_or(declared.len());
                names.push(declared[..end].to_owned());
            }
            has_debug = line.starts_with("#[derive(Debug") || (has_debug && line.starts_with("#["));
        }
    }
}

#[test]
fn every_public_value_can_be_printed_by_defmt() {
    let mut formatted: Vec<&str> = formatted![
        AddedTerm, AllanPoint, AngleRandomWalk, BiasInstability, Cascade<8, 4>, CoefficientUnit, Coupling<8>, Covariance,
        Covariate<8>, Curve<8>, CurveView, Discrepancy, FittedTerm, FractionalOctaves<8, 8>, Goodness, Hadamard<8, 4>,
        HadamardPoint, Interpolation, KurtosisRatio, LineCandidates, LowPass, Markov, Model, MovingAverageFilter,
        NewestDifferences<8>, NoiseTerm,
        OctaveSums, PhaseCounts, PowerLaw, Quantization, Quantizer, RateRamp, RateRandomWalk, Residual, Resonance,
        SampleError, Sensitivity, Shape, Sinusoid, SlopeEstimate, Snapshot<8, 4>, TableError, TimeStampError, TimeStamps, Trace,
        VarianceFractions,
    ]
    .to_vec();
    fn of_a_list<T: defmt::Format>() {}
    of_a_list::<List<f64, 4>>();
    formatted.push("List");
    formatted.sort_unstable();
    let mut public = Vec::new();
    public_values(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), &mut public);
    public.sort();
    assert_eq!(formatted, public);
}
