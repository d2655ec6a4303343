//! The limit of a test that knows an effect's channel and shape, as that behind the strength does, but not the noise.
//!
//! The slowest noise goes through few periods in a record, and a test has to see both its size and the effect in them:
//! Student's distribution with few degrees of freedom. A method that also has to find out channel and shape sees no more.

use adis16405_driver::Channel;
use measurement::Measurement;
use noise_analysis::detectors::bias::SIGNIFICANCE;
use noise_analysis::detectors::block_means::BlockMeans;
use noise_analysis::detectors::block_means::NoiseGrids;
use noise_analysis::detectors::gls_regression::GlsRegression;
use noise_analysis::series::Series;
use virtual_sensor::InjectedEffect;

/// Whether such a test sees `effect` at the probability of chance that the analysis asks for; `None` for effects that are
/// not a known course of the level. `begin_s` is when the recording begins, counted from the part's start.
pub(crate) fn sees(effect: &InjectedEffect, measurement: &Measurement, begin_s: f64) -> Option<bool> {
    let series = |channel: Channel| Series::of(measurement, &measurement.profile.channels[channel as usize]);
    let own = series(simulation::channel(*effect.channels().first()?));
    let blocks = BlockMeans::from_series(&own)?;
    let shape = match effect {
        InjectedEffect::RateRamp { .. } => blocks.ramp(),
        InjectedEffect::BiasStep { time_s, .. } => blocks.step_at(((time_s - begin_s) / own.period_s).max(0.0) as u64),
        InjectedEffect::Temperature { .. } => BlockMeans::from_series(&series(Channel::Temp))?.means,
        InjectedEffect::Supply { .. } => BlockMeans::from_series(&series(Channel::Supply))?.means,
        _ => return None,
    };
    let noises = NoiseGrids::default().get(&blocks);
    let estimate = GlsRegression::new(&blocks, &noises, &[]).estimate(&shape)?;
    Some(estimate.p_value < SIGNIFICANCE)
}

#[cfg(test)]
mod tests {
    use super::super::super::{Group, case};
    use super::*;
    use virtual_sensor::OutputRegister;

    /// Far above the limit it sees what is there; of what is no course it says nothing.
    #[test]
    fn a_gross_course_is_seen_and_an_absent_one_is_not() {
        let seen = |effect: &InjectedEffect| {
            let mut simulation = case(Group::Nothing, 100.0, 3).simulation;
            simulation.scenario.effects = vec![effect.clone()];
            let recording = simulation.run(|_| ()).unwrap();
            sees(effect, &recordings::timeline::measurement(&recording, None).unwrap(), 0.2)
        };
        let channel = OutputRegister::GyroX;
        let step = |size: f64| InjectedEffect::BiasStep { channel, time_s: 50.0, size };
        assert_eq!([seen(&step(1.0)), seen(&step(0.0))], [Some(true), Some(false)]);
        let ramp = |slope: f64| InjectedEffect::RateRamp { channel, slope };
        assert_eq!([seen(&ramp(0.05)), seen(&ramp(0.0))], [Some(true), Some(false)]);
        assert_eq!(seen(&InjectedEffect::Supply { channel, sensitivity: 100.0 }), Some(true));
        assert_eq!(seen(&InjectedEffect::Temperature { channel, sensitivity: 10.0 }), Some(true));
        assert_eq!(seen(&InjectedEffect::FilterBandwidth { taps_log2: 2 }), None);
    }
}
