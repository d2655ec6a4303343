//! Serialised curves and models: the same after a round trip, refused where a value is impossible.

use allan_core::fit::fit_shapes;
use allan_core::term::{LowPass, Markov, MovingAverageFilter};
use allan_core::{Cascade, Curve, Model, NoiseTerm};

fn curve() -> Curve<12> {
    let mut cascade = Cascade::<12, 8>::new();
    let mut state = 1_u64;
    for _ in 0..10_000 {
        state = state * 16_807 % 2_147_483_647;
        cascade.push((state % 100) as i32);
    }
    cascade.curve(0.01)
}

#[test]
fn curves_and_models_survive_a_round_trip() {
    let curve = curve();
    let kinds = [
        NoiseTerm::Filtered(MovingAverageFilter::bartlett(4)),
        NoiseTerm::Markov(Markov { time_constant: 0.3 }),
        NoiseTerm::RateRandomWalk,
        NoiseTerm::LowPass(LowPass::butterworth(3.0)),
    ];
    let model = fit_shapes(&curve, &kinds);
    let bytes = postcard::to_stdvec(&(&curve, &model)).unwrap();
    assert_eq!(postcard::from_bytes::<(Curve<12>, Model)>(&bytes).unwrap(), (curve.clone(), model.clone()));
    let text = serde_json::to_string(&(&curve, &model)).unwrap();
    // JSON as it is read here rounds to a digit of the 16th decimal.
    let (read_curve, read_model) = serde_json::from_str::<(Curve<12>, Model)>(&text).unwrap();
    for (read, written) in read_curve.points().iter().zip(curve.points()) {
        assert_eq!((read.n, read.count, read.power_law), (written.n, written.count, written.power_law));
        assert!((read.avar / written.avar - 1.0).abs() < 1e-15 && (read.high / written.high - 1.0).abs() < 1e-15);
    }
    assert_eq!(read_curve.points().len(), curve.points().len());
    assert!(read_model.terms().iter().map(|term| term.kind).eq(kinds));
}

#[test]
fn a_damaged_curve_is_refused_with_the_row() {
    let text = serde_json::to_string(&curve()).unwrap();
    let refused = |from: &str, to: &str| {
        assert!(text.contains(from), "{from} in {text}");
        serde_json::from_str::<Curve<12>>(&text.replacen(from, to, 1)).unwrap_err().to_string()
    };
    assert!(refused("\"n\":2,", "\"n\":1,").contains("averaging factor in row 1"));
    assert!(refused("\"overlap\":1", "\"overlap\":17").contains("overlap is not 1 to 16"));
    assert!(refused("\"sample_period\":0.01", "\"sample_period\":0.0").contains("sample period"));
    assert!(refused("\"avar\":", "\"avar\":-").contains("variance in row 0"));
}

#[test]
fn a_term_with_an_impossible_shape_is_refused() {
    let filter = NoiseTerm::Filtered(MovingAverageFilter { stages: 2, taps: 8, decimation: 6.1 });
    let text = serde_json::to_string(&filter).unwrap();
    for (from, to) in [("\"taps\":8", "\"taps\":0"), ("\"stages\":2", "\"stages\":3"), ("6.1", "0.5"), ("6.1", "null")]
    {
        assert!(text.contains(from), "{from} in {text}");
        assert!(serde_json::from_str::<NoiseTerm>(&text.replace(from, to)).is_err(), "{to}");
    }
    let text = serde_json::to_string(&NoiseTerm::Markov(Markov { time_constant: 1.5 })).unwrap();
    assert!(serde_json::from_str::<NoiseTerm>(&text).is_ok());
    assert!(serde_json::from_str::<NoiseTerm>(&text.replace("1.5", "-1.5")).is_err());
    let text = serde_json::to_string(&NoiseTerm::LowPass(LowPass { frequency: 3.0, damping: 0.75 })).unwrap();
    assert!(serde_json::from_str::<NoiseTerm>(&text).is_ok());
    assert!(serde_json::from_str::<NoiseTerm>(&text.replace("0.75", "1.0")).is_err(), "no oscillation");
}
