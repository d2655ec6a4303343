//! Prints the names of the types of allan-core that `defmt` prints, one a line.

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

/// The names of the types, each of which the compiler has found to have `defmt::Format`.
macro_rules! formatted {
    ($($name:ident $(<$($argument:literal),*>)?),* $(,)?) => {{
        fn has_format<T: defmt::Format>() {}
        $(has_format::<$name $(<$($argument),*>)?>();)*
        [$(stringify!($name)),*]
    }};
}

fn main() {
    let formatted = formatted![
        AddedTerm, AllanPoint, AngleRandomWalk, BiasInstability, Cascade<8, 4>, CoefficientUnit, Coupling<8>, Covariance,
        Covariate<8>, Curve<8>, CurveView, Discrepancy, FittedTerm, FractionalOctaves<8, 8>, Goodness, Hadamard<8, 4>,
        HadamardPoint, Interpolation, KurtosisRatio, LineCandidates, LowPass, Markov, Model, MovingAverageFilter,
        NewestDifferences<8>, NoiseTerm,
        OctaveSums, PhaseCounts, PowerLaw, Quantization, Quantizer, RateRamp, RateRandomWalk, Residual, Resonance,
        SampleError, Sensitivity, Shape, Sinusoid, SlopeEstimate, Snapshot<8, 4>, TableError, TimeStampError, TimeStamps, Trace,
        VarianceFractions,
    ];
    fn of_a_list<T: defmt::Format>() {}
    of_a_list::<List<f64, 4>>();
    for name in formatted.into_iter().chain(["List"]) {
        println!("{name}");
    }
}
