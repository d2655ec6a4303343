//! Calls of allan-core, with arguments and results that the compiler must not optimise away.

use allan_core::Cascade;
use core::hint::black_box;

pub(crate) fn run() {
    let mut cascade = Cascade::<24, 8>::new();
    cascade.push(black_box(1));
    cascade.push_slice(black_box(&[1, 2, 3]));
    cascade.gap(black_box(3));
    let cascade = black_box(cascade);
    #[cfg(any(feature = "variances", feature = "curve"))]
    report(&cascade);
    #[cfg(feature = "two-fits")]
    {
        let mut short = Cascade::<16, 4>::new();
        short.push(black_box(1));
        let curve = black_box(short).curve(black_box(0.01));
        black_box(allan_core::fit::fit(&curve, &allan_core::NoiseTerm::BASELINE));
    }
    black_box(&cascade);
}

#[cfg(any(feature = "variances", feature = "curve"))]
fn report(cascade: &Cascade<24, 8>) {
    #[cfg(feature = "variances")]
    {
        let curve = black_box(cascade.curve_without_confidence(black_box(0.01)));
        #[cfg(feature = "power-laws")]
        black_box(allan_core::fit::fit_power_laws(&curve, &allan_core::NoiseTerm::BASELINE));
        black_box(&curve);
    }
    #[cfg(feature = "curve")]
    {
        let curve = black_box(cascade.curve(black_box(0.01)));
        #[cfg(feature = "fit")]
        black_box(allan_core::fit::fit(&curve, &allan_core::NoiseTerm::BASELINE));
        #[cfg(feature = "trace")]
        black_box(allan_core::trace::trace(&curve, allan_core::trace::LineCandidates::Curve, &[]));
        black_box(&curve);
    }
}
