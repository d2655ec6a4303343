//! One call of allan-core, named by the environment variable `ALLAN_CALL` at compile time, or no call.

use allan_core::fit::{fit, fit_power_laws, fit_shapes, goodness};
use allan_core::regression::CovariateRegression;
use allan_core::term::Markov;
use allan_core::trace::{LineCandidates, trace};
use allan_core::{
    Cascade, Coupling, Curve, FractionalOctaves, Hadamard, Model, NoiseTerm, Quantizer, Snapshot, TimeStamps,
};
use core::hint::black_box;

const CALL: &str = match option_env!("ALLAN_CALL") {
    Some(call) => call,
    None => "",
};

pub(crate) fn run() {
    // These values exist also in the image without a call.
    let mut cascade = black_box(Cascade::<24, 8>::new());
    let mut curve = black_box(Curve::<24>::empty());
    let mut bytes = black_box([0_u8; 4_500]);
    match CALL {
        "Cascade::push" => cascade.push(black_box(1)),
        "Cascade::push_slice" => cascade.push_slice(black_box(&[1, 2, 3])),
        "Cascade::gap" => {
            // The next push closes the gap.
            cascade.gap(black_box(1));
            cascade.push(black_box(1));
        }
        "Cascade::merge" => cascade.merge(&black_box(Cascade::new())),
        "Cascade::reset" => black_box(&mut cascade).reset(),
        "Cascade::restore" => cascade.restore(black_box(1), black_box(1), |_| black_box(Default::default())),
        "Cascade::snapshot_into" => cascade.snapshot_into(&mut black_box(Snapshot::empty())),
        "Cascade::curve" => curve = cascade.curve(black_box(0.01)),
        "Cascade::curve_without_confidence" => curve = cascade.curve_without_confidence(black_box(0.01)),
        "Cascade::allan_variance" => _ = black_box(cascade.allan_variance(black_box(10))),
        "Serialize" => _ = black_box(postcard::to_slice(&cascade, &mut bytes).is_ok()),
        "Cascade::read_serialized" => {
            let read = cascade.read_serialized(&mut postcard::Deserializer::from_bytes(&bytes));
            black_box(read.is_ok());
        }
        "Quantizer::count" => {
            _ = black_box(black_box(Quantizer::new(0.5, 0.25)).map(|each| each.count(black_box(1.5_f32))))
        }
        "TimeStamps::push" => {
            _ = black_box(black_box(TimeStamps::new(1_000)).map(|mut each| each.push(&mut cascade, black_box(7), 1)));
        }
        "Coupling::observe" => black_box(Coupling::new()).observe(&cascade, black_box(&cascade)),
        "Hadamard::observe" => black_box(Hadamard::new()).observe(&cascade),
        "FractionalOctaves::observe" => black_box(FractionalOctaves::new()).observe(&cascade),
        "Coupling::points" => _ = black_box(black_box(Coupling::<24>::new()).points()),
        "Hadamard::points" => _ = black_box(black_box(Hadamard::new()).points(&cascade, black_box(0.01))),
        "FractionalOctaves::curve" => {
            _ = black_box(black_box(FractionalOctaves::new()).curve::<96>(&cascade, black_box(0.01)));
        }
        "Curve::from_points" => {
            _ = black_box(Curve::<24>::from_points(
                black_box(0.01),
                black_box(1_000),
                8,
                black_box(&[(1, 1.0), (2, 0.5)]),
            ));
        }
        "fit::fit_shapes" => {
            let markov = NoiseTerm::Markov(Markov { time_constant: black_box(1.0) });
            _ = black_box(fit_shapes(&curve, &[NoiseTerm::AngleRandomWalk, markov]));
        }
        "fit::fit" => _ = black_box(fit(&curve, &NoiseTerm::BASELINE)),
        "fit::fit_power_laws" => _ = black_box(fit_power_laws(&curve, &NoiseTerm::BASELINE)),
        "fit::goodness" => _ = black_box(goodness(&curve, &black_box(Model::new(1.0, [])))),
        "trace::trace" => _ = black_box(trace(&curve, LineCandidates::Curve, &[])),
        "CovariateRegression::sensitivities" => {
            let regression: CovariateRegression<24> = CovariateRegression {
                channel: &curve,
                covariates: black_box::<&[_]>(&[]),
                covariance: &|_, _, _| black_box(None),
            };
            _ = black_box(regression.sensitivities());
        }
        _ => {}
    }
    black_box((&cascade, &curve, &bytes));
}
