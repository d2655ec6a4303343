//! Models that a device learns from epochs with hidden effects, and the host's models for the same samples.

use adis16405_driver::{BURST_BYTES, Burst, SamplePeriod};
use emulation::RATE_HZ;
use firmware::epoch::EpochChannel;
use firmware::learner::{EpochFit, validate};
use firmware::{CHANNELS, Estimators, FIRST_CONFIG, FinishedEpoch, Statistics, TimedBurst};
use link::{LearnedMessage, Message, ValidationMessage};

/// The findings for [`emulation::four_effects`]: for each channel one of these terms.
pub(crate) const FOUND: [(&str, &[&str]); 3] =
    [("gyro x", &["temp "]), ("gyro y", &["Gauss-Markov, "]), ("gyro z", &["sinusoid, ", "resonance, "])];

/// Asserts that a line for each of these channels names one of its terms.
pub(crate) fn assert_told(lines: &[String], found: &[(&str, &[&str])]) {
    for (channel, terms) in found {
        let mut told = lines.iter().filter_map(|line| line.trim_start().strip_prefix(channel));
        assert!(told.any(|line| terms.iter().any(|term| line.trim_start().starts_with(term))), "{channel}: {lines:#?}");
    }
}

/// The models of the first epoch and their validations on the second, as sent by the device.
pub(crate) fn learned_on_device(messages: &[Message]) -> (Vec<LearnedMessage>, Vec<ValidationMessage>) {
    let (mut learned, mut validated) = (Vec::new(), Vec::new());
    for message in messages {
        match message {
            Message::Learned(message) if message.epoch == 0 => learned.push(message.clone()),
            Message::Validation(message) if message.epoch == 1 => validated.push(message.clone()),
            _ => {}
        }
    }
    (learned, validated)
}

/// The messages of [`learned_on_device`], computed on the host from the bursts of the sensor. `samples` are the numbers
/// of samples of one epoch or two, by channel, and `rates` the sample rates measured in each.
pub(crate) fn learned_on_host(
    bursts: &[(u64, [u8; BURST_BYTES])],
    samples: &[u64],
    rates: &[Option<f64>],
) -> (Vec<LearnedMessage>, Vec<ValidationMessage>) {
    assert_eq!(FIRST_CONFIG.sample_period(), SamplePeriod::nearest(RATE_HZ).expect("a rate"));
    let mut statistics = Statistics::new();
    let mut estimators = Estimators::new(&mut statistics, FIRST_CONFIG);
    let at_us = |sample: u64| (sample as f64 * 1e6 / RATE_HZ) as u64;
    estimators.accept_samples_after_settling(at_us(bursts[0].0));
    let mut bursts = bursts.iter();
    let mut epochs = Vec::new();
    for ((number, samples), rate_hz) in (0..).zip(samples.chunks(CHANNELS.len())).zip(rates) {
        // The gate may refuse the first sample of a step in its channel.
        let (fullest, most) = (0..).zip(samples).max_by_key(|(_, count)| **count).expect("a channel");
        // The first bursts after the start are not used while the filter settles.
        while estimators.channel(fullest).is_some_and(|estimator| estimator.len() < *most)
            && let Some((sample, bytes)) = bursts.next()
        {
            let arrival = TimedBurst { at_us: at_us(*sample), dropped: 0, burst: Some(Burst::from_bytes(bytes)) };
            estimators.process(arrival, 0);
        }
        let taken = |index| estimators.channel(index).expect("a channel of the device").len();
        assert_eq!((0..samples.len()).map(taken).collect::<Vec<u64>>(), samples, "samples of each channel");
        let mut epoch = FinishedEpoch::EMPTY;
        epoch.number = number;
        epoch.fill(&mut estimators);
        epoch.measured_hz = *rate_hz;
        epochs.push(epoch);
    }
    let (first, second) = (&epochs[0], epochs.get(1));
    let means = first.covariances().expect("no restart").means;
    let channel = |epoch, index| EpochChannel { epoch, index, scale: FinishedEpoch::scale(epoch, FIRST_CONFIG) };
    let fit = |index: usize| {
        let channel = channel(first, index);
        let mut fit = EpochFit::new(channel.estimate_regressors(&mut || true)?);
        fit.run(channel, &mut || true).then_some(fit)
    };
    let fits: Vec<EpochFit> = (0..6).map(|index| fit(index).expect("a fit that is not cancelled")).collect();
    let validation = |index: usize| validate(&fits[index].model(), Some(&means), channel(second?, index));
    let learned = fits.iter().enumerate().map(|(index, fit)| fit.message(index, first.number)).collect();
    (learned, (0..6).filter_map(validation).collect())
}
