//! The assessment of a model against simulated data: predicted errors of integration, and innovations.

use allan_core::model::FittedTerm;
use allan_core::term::Markov;
use allan_core::{Model, NoiseTerm};
use noise_analysis::report::assessment::innovations::{Innovations, filter_innovations};
use noise_analysis::report::assessment::navigation::integrated_errors;
use noise_analysis::samples::uniform_series::UniformSeries;
use virtual_sensor::NoiseSource;
use virtual_sensor::{NoiseModel, OutputRegister};

const PERIOD: f64 = 0.02;
const SAMPLES: usize = 150_000;
/// N, B and K of the paper's gyroscope.
const NOISE: [f64; 3] = [0.0368, 0.0093, 0.0013];

fn simulated(noise: [f64; 3], seed: u64) -> Vec<f64> {
    let mut model = NoiseModel::noiseless();
    let gyro = model.channel_mut(OutputRegister::GyroZ);
    gyro.bias = 3.0;
    [gyro.angle_random_walk, gyro.bias_instability, gyro.rate_random_walk] = noise;
    let mut source = NoiseSource::new(&model, seed, PERIOD);
    (0..SAMPLES).map(|_| source.sample()[OutputRegister::GyroZ as usize]).collect()
}

fn model(extra: Option<FittedTerm>) -> Model {
    let terms = NoiseTerm::BASELINE.into_iter().zip(NOISE).map(|(kind, value)| FittedTerm::exact(kind, value));
    Model::new(PERIOD, terms.chain(extra))
}

#[test]
fn the_predicted_error_is_that_of_simulated_data() {
    // Twelve records of 50 min: the mean square against the prediction, as χ² with all their degrees of freedom.
    let mut sums = [(0.0, 0.0); 3];
    let mut inside = 0;
    for seed in 0..12 {
        for (sum, drift) in
            sums.iter_mut().zip(integrated_errors(&model(None), &UniformSeries::new(PERIOD, simulated(NOISE, seed))))
        {
            let observed = drift.observed.expect("a long record");
            sum.0 += observed.edf * (observed.value / drift.predicted).powi(2);
            sum.1 += observed.edf;
            inside += usize::from((observed.low..=observed.high).contains(&drift.predicted));
        }
    }
    for (sum, edf) in sums {
        assert!((sum / edf - 1.0).abs() < 4.0 * (2.0 / edf).sqrt(), "{sum} of {edf}");
    }
    // Fewer than 30 of 36 95 % intervals hold the prediction once in two thousand.
    assert!(inside >= 30, "{inside} of 36");
}

#[test]
fn missing_samples_widen_the_bounds_without_shifting_the_error() {
    let mut values = simulated(NOISE, 3);
    let whole = integrated_errors(&model(None), &UniformSeries::new(PERIOD, values.clone()));
    values.iter_mut().step_by(50).for_each(|value| *value = f64::NAN);
    values[60_000..70_000].fill(f64::NAN);
    for (whole, holed) in whole.iter().zip(integrated_errors(&model(None), &UniformSeries::new(PERIOD, values))) {
        let (whole, holed) = (whole.observed.expect("long"), holed.observed.expect("long"));
        assert!(holed.edf < whole.edf && (holed.low..holed.high).contains(&whole.value), "{whole:?} {holed:?}");
    }
    assert!(
        integrated_errors(&model(None), &UniformSeries::new(PERIOD, vec![1.0; 3000]))
            .iter()
            .all(|drift| drift.observed.is_none())
    );
}

fn of(values: Vec<f64>, model: &Model) -> Innovations {
    filter_innovations(model, &UniformSeries::new(PERIOD, values)).expect("a long record")
}

#[test]
fn the_innovations_of_a_true_model_are_white_and_of_the_expected_variance() {
    let (mut consistent, mut white) = (0, 0);
    for seed in 0..12 {
        let found = of(simulated(NOISE, 100 + seed), &model(None));
        consistent += usize::from((found.low..found.high).contains(&found.normalised));
        white += usize::from(found.whiteness_p > 0.05);
    }
    // Fewer than 9 of 12 events with a probability of 95 % happen once in five thousand.
    assert!(consistent >= 9 && white >= 9, "{consistent} consistent, {white} white");
}

#[test]
fn the_innovations_of_a_wrong_model_are_not_white_or_not_of_the_expected_variance() {
    // A Markov process that the model lacks: of 0.03 deg/s, over 2 s.
    let time_constant = 2.0;
    let mut source = NoiseModel::noiseless();
    source.channel_mut(OutputRegister::GyroX).angle_random_walk = 1.0;
    let mut white = NoiseSource::new(&source, 5, 1.0);
    let decay = f64::exp(-PERIOD / time_constant);
    let mut state = 0.0;
    let mut values = simulated(NOISE, 7);
    for value in &mut values {
        state = decay * state + 0.03 * (1.0 - decay * decay).sqrt() * white.sample()[OutputRegister::GyroX as usize];
        *value += state;
    }
    let lacking = of(values.clone(), &model(None));
    assert!(lacking.whiteness_p < 1e-6 && lacking.normalised > lacking.high, "{lacking:?}");
    let knowing = of(values, &model(Some(FittedTerm::exact(NoiseTerm::Markov(Markov { time_constant }), 0.03))));
    assert!(knowing.whiteness_p > 1e-3, "{knowing:?}");
    assert!((knowing.normalised - 1.0).abs() < 4.0 * (2.0 / knowing.count as f64).sqrt(), "{knowing:?}");
    // Too much N is seen as well.
    let [n, b, k] = NOISE;
    let terms =
        NoiseTerm::BASELINE.into_iter().zip([1.1 * n, b, k]).map(|(kind, value)| FittedTerm::exact(kind, value));
    let loud = of(simulated(NOISE, 8), &Model::new(PERIOD, terms));
    assert!(loud.normalised < loud.low, "{loud:?}");
    assert_eq!(filter_innovations(&model(None), &UniformSeries::new(PERIOD, vec![0.0; 100])), None);
}
