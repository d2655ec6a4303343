//! Sampling and estimating without a board: order, gaps and counters by cause, the raw stream.

use adis16405_driver::{BURST_BYTES, Burst, Channel, Config, Counts, GyroRange, OutputWord, SamplePeriod};
use allan_core::model::FittedTerm;
use firmware::{
    BurstQueue, CHANNELS, ChannelSums, EdgeAction, Estimators, Sampler, Statistics, TimedBurst, TransmitBuffer,
    TransmitQueue, estimate,
};
use link::{Decoder, Health, Message, RawMessage, Received};

/// The default configuration samples at 819.2 Hz.
const PERIOD_US: f64 = 1e6 / 819.2;
/// The supply in counts of 2.418 mV: 5.00 V.
const SUPPLY: i16 = 2068;

/// Samples that the default filter, of 2^2 taps a stage, mixes with earlier ones: 2N = 8, and 6.2 ms of the analogue part, which is 5.1
/// periods and one begun.
const SETTLING: u32 = 8 + 6;
/// Samples after the first probe from which the gate against gross errors learns the noise.
const LEARNING: u32 = 32;

/// A valid burst whose inertial counts depend on `k`.
fn burst(k: i16) -> Burst {
    Burst::from_counts(&Counts::new([SUPPLY, k, 2 * k, 3, 4, 5, 6, 7, 8, 9, 10, 11]))
}

/// Time of the edge of sample period `period`.
fn at_us(period: u32) -> u64 {
    (f64::from(period) * PERIOD_US) as u64
}

fn timed(period: u32, burst: Option<Burst>) -> TimedBurst {
    TimedBurst { at_us: at_us(period), dropped: 0, burst }
}

/// Sums worked out by hand: counts 0, 1, 3 have first differences 1, 2, whose squares sum to 5.
#[test]
fn counts_reach_the_estimators() {
    let mut statistics = Statistics::new();
    let mut estimators = Estimators::new(&mut statistics, Config::default());
    for (period, k) in (0..).zip([0, 1, 3]) {
        assert!(!estimators.process(timed(period, Some(burst(k))), 0));
    }
    let sums = |channel| {
        let index = CHANNELS.iter().position(|&other| other == channel).unwrap();
        let estimator = estimators.channel(index).unwrap();
        (estimator.len(), estimator.sum_of_squares(0).unwrap())
    };
    assert_eq!(sums(Channel::GyroX), (3, (5, 2)));
    assert_eq!(sums(Channel::GyroY), (3, (20, 2)));
    assert_eq!(sums(Channel::AcclX), (3, (0, 2)));
    assert_eq!(sums(Channel::Temp), (3, (0, 2)));
    assert_eq!(sums(Channel::Supply), (3, (0, 2)));
}

/// No difference spans a lost sample: of 1, lost, 5, 9 only the step from 5 to 9 counts.
#[test]
fn losses_are_gaps_and_are_counted_by_cause() {
    let zeros = Some(Burst::from_bytes(&[0; BURST_BYTES]));
    let ones = Some(Burst::from_bytes(&[0xFF; BURST_BYTES]));
    let cases = [(None, 1, 0), (zeros, 1, 0), (ones, 1, 0), (None, 4, 0), (None, 4, 2), (None, 4, 3)];
    for (lost, periods, dropped) in cases {
        let mut statistics = Statistics::new();
        let mut estimators = Estimators::new(&mut statistics, Config::default());
        estimators.process(timed(0, Some(burst(1))), 0);
        estimators.process(TimedBurst { dropped, ..timed(periods, lost) }, 4);
        estimators.process(timed(periods + 1, Some(burst(5))), 0);
        estimators.process(timed(periods + 2, Some(burst(9))), 0);
        let case = format!("{lost:?}, {periods} periods, {dropped} dropped");
        let estimator = estimators.channel(0).unwrap();
        assert_eq!((estimator.len(), estimator.missing()), (3, u64::from(periods)), "{case}");
        assert_eq!(estimator.sum_of_squares(0), Some((16, 1)), "{case}");
        let health = estimators.health();
        assert_eq!((health.used, health.queue_peak, health.queue_full), (3, 5, dropped), "{case}");
        assert_eq!(health.lost_edges, periods - 1 - dropped, "{case}");
        assert_eq!(health.bus_errors, u32::from(lost.is_none()), "{case}");
        let stuck = (u32::from(lost == zeros), u32::from(lost == ones));
        assert_eq!((health.stuck_low, health.stuck_high), stuck, "{case}");
    }
}

/// The burst at an edge between two samples is not used, and no sample counts as missing.
#[test]
fn a_spurious_edge_is_no_sample() {
    let mut statistics = Statistics::new();
    let mut estimators = Estimators::new(&mut statistics, Config::default());
    estimators.process(timed(0, Some(burst(1))), 0);
    estimators.process(TimedBurst { at_us: 500, ..timed(0, Some(burst(1))) }, 0);
    estimators.process(timed(1, Some(burst(2))), 0);
    let estimator = estimators.channel(0).unwrap();
    assert_eq!((estimator.len(), estimator.missing(), estimator.sum_of_squares(0)), (2, 0, Some((1, 1))));
    assert_eq!(estimators.health().spurious_edges, 1);
}

/// The sensor may have been reset during a silence, so its samples are not used until it is probed.
#[test]
fn after_a_silence_samples_are_not_used_before_the_probe() {
    let mut statistics = Statistics::new();
    let mut estimators = Estimators::new(&mut statistics, Config::default());
    estimators.process(timed(0, Some(burst(1))), 0);
    for (period, k) in [(100, 2), (101, 3)] {
        estimators.process(timed(period, Some(burst(k))), 0);
        assert!(estimators.is_suspect());
    }
    estimators.accept_samples_after_settling(at_us(101) + 1);
    let unused = SETTLING + LEARNING;
    for period in 102..=102 + unused {
        estimators.process(timed(period, Some(burst(4))), 0);
    }
    let estimator = estimators.channel(0).unwrap();
    assert_eq!((estimator.len(), estimator.missing()), (2, 101 + u64::from(unused)));
    let health = estimators.health();
    assert_eq!((health.lost_edges, health.suspect, health.used, health.settling), (99, 2, 2, unused));
}

#[test]
fn a_sensor_with_a_stuck_data_line_is_suspect() {
    for bytes in [[0; BURST_BYTES], [0xFF; BURST_BYTES]] {
        let mut statistics = Statistics::new();
        let mut estimators = Estimators::new(&mut statistics, Config::default());
        let mut suspect = |period| {
            estimators.process(timed(period, Some(Burst::from_bytes(&bytes))), 0);
            estimators.is_suspect()
        };
        assert_eq!((0..20).position(&mut suspect), Some(15));
    }
}

#[test]
fn a_full_queue_is_counted_with_the_next_burst_that_fits() {
    let mut queue = BurstQueue::new();
    let (producer, mut consumer) = queue.split();
    let mut sampler = Sampler::new(producer);
    let capacity = consumer.capacity() as u64;
    assert_eq!(sampler.data_ready(0), EdgeAction::Ignore, "sampling is disabled");
    sampler.set_enabled(true);
    let mut sample = |k: u64| {
        let at_us = 1_000 * k;
        assert_eq!(sampler.data_ready(at_us), EdgeAction::StartBurst);
        assert_eq!(sampler.data_ready(at_us + 1), EdgeAction::Ignore, "a burst is being transferred");
        sampler.transfer_ended(Some(&burst(k as i16).to_bytes()));
    };
    (0..capacity + 7).for_each(&mut sample);
    let mut queued = |count| -> Vec<(u64, u32)> {
        (0..count).map_while(|_| consumer.dequeue()).map(|timed| (timed.at_us, timed.dropped)).collect()
    };
    assert!(queued(1000).into_iter().eq((0..capacity).map(|k| (1_000 * k, 0))));
    sample(1000);
    sample(1001);
    assert_eq!(queued(3), [(1_000_000, 7), (1_001_000, 0)]);
}

/// The raw stream contains every burst, usable or not, with its sample number and time. Lost bursts leave a gap in the numbers.
#[test]
fn the_raw_stream_contains_every_burst() {
    let (mut bursts, mut buffer, mut statistics) = (BurstQueue::new(), TransmitBuffer::new(), Statistics::new());
    let (mut producer, mut consumer) = bursts.split();
    let (to_port, mut port) = buffer.split();
    let mut transmit_queue = TransmitQueue::new(to_port);
    let mut estimators = Estimators::new(&mut statistics, Config::default());
    estimators.set_raw_stream(true);
    let mut expected = Vec::new();
    for period in (0..40).chain(50..58) {
        let bytes = if period % 7 == 0 { [0; BURST_BYTES] } else { burst(period as i16).to_bytes() };
        let burst = Burst::from_bytes(&bytes);
        expected.push((u64::from(period), at_us(period), burst.words.map(|word| word.0.to_be_bytes())));
        producer.enqueue(timed(period, Some(burst))).unwrap();
        estimate(&mut estimators, &mut transmit_queue, &mut consumer);
    }
    let mut decoder = Decoder::new();
    let received = std::iter::from_fn(|| port.dequeue()).filter_map(|byte| decoder.push(byte));
    let mut found = Vec::new();
    for message in received.filter_map(Received::message) {
        let Message::Raw(RawMessage { first, at_us, sens_avg, bursts }) = message else { panic!("{message:?}") };
        assert_eq!(sens_avg, Config::default().sens_avg());
        let (mut number, mut time) = (first, at_us);
        for burst in bursts {
            number += u64::from(burst.periods);
            time += u64::from(burst.after_us);
            found.push((number, time, burst.words));
        }
    }
    assert_eq!(found.len(), 48, "three full messages");
    assert_eq!(found, expected);
}

/// While the serial port sends nothing, raw messages are dropped completely, counted, and missing by their sequence numbers.
#[test]
fn raw_messages_without_room_are_dropped_and_counted() {
    let (mut bursts, mut buffer, mut statistics) = (BurstQueue::new(), TransmitBuffer::new(), Statistics::new());
    let (mut producer, mut consumer) = bursts.split();
    let (to_port, mut port) = buffer.split();
    let mut transmit_queue = TransmitQueue::new(to_port);
    let mut estimators = Estimators::new(&mut statistics, Config::default());
    estimators.set_raw_stream(true);
    let mut decoder = Decoder::new();
    for period in 0..320 {
        producer.enqueue(timed(period, Some(burst(period as i16)))).unwrap();
        estimate(&mut estimators, &mut transmit_queue, &mut consumer);
        if period == 303 || period == 319 {
            std::iter::from_fn(|| port.dequeue()).for_each(|byte| drop(decoder.push(byte)));
        }
    }
    let (dropped, counters) = (u64::from(estimators.health().raw_dropped), decoder.counters());
    assert!(dropped > 0);
    assert_eq!((counters.frames + counters.missing, counters.missing), (20, dropped));
    assert_eq!(counters.bad_frames, 0);
    assert_eq!(estimators.health().used, 320, "the estimators lose nothing");
}

/// Normal random numbers by Box and Muller, from a linear congruential generator (Knuth's MMIX constants).
struct Normal(u64);

impl Normal {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    }

    fn next(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (std::f64::consts::TAU * self.uniform()).cos()
    }
}

/// Counts of a sensor at rest.
const AT_REST: [i16; 12] = [SUPPLY, 11, 12, 13, 4, 5, 6, 7, 8, 9, 10, 11];

fn with_rate(gyro_x: i16) -> Burst {
    let mut counts = AT_REST;
    counts[1] = gyro_x;
    Burst::from_counts(&Counts::new(counts))
}

/// A burst with one clock too many: every bit arrives one place to the left.
fn shifted(burst: &Burst) -> Burst {
    let next = |k: usize| burst.words.get(k + 1).map_or(0, |word| word.0 >> 15);
    Burst { words: core::array::from_fn(|k| OutputWord(burst.words[k].0 << 1 | next(k))) }
}

fn health_after(bursts: impl IntoIterator<Item = Burst>) -> Health {
    let mut statistics = Statistics::new();
    let mut estimators = Estimators::new(&mut statistics, Config::default());
    for (period, burst) in (0..).zip(bursts) {
        estimators.process(timed(period, Some(burst)), 0);
    }
    estimators.health()
}

#[test]
fn damaged_bursts_are_counted_by_cause() {
    // The sensor cannot measure beyond ±7000 counts of 0.05 deg/s.
    let damaged = [
        with_rate(1),
        with_rate(7_001),
        with_rate(2),
        with_rate(-7_001),
        with_rate(3),
        shifted(&with_rate(4)),
        with_rate(5),
    ];
    let health = health_after(damaged);
    assert_eq!((health.bursts, health.used, health.partly_used), (7, 6, 2), "{health:?}");
    assert_eq!((health.impossible_rate, health.shifted, health.frozen, health.x_sign), (2, 1, 0, 0), "{health:?}");
}

/// The default filter of two averages of four samples is eight samples long. The 33rd equal burst is the first after four filter lengths of
/// equal ones. After 16 more the sensor is in trouble.
#[test]
fn a_frozen_sensor_is_counted() {
    let health = health_after(core::iter::repeat_n(with_rate(1), 600));
    assert_eq!((health.bursts, health.frozen, health.used), (48, 16, 32), "{health:?}");
    assert_eq!(health.suspect, 600 - 48);
}

/// Samples and missing samples of every channel after these bursts.
fn samples_after(bursts: &[Burst]) -> [(u64, u64); CHANNELS.len()] {
    let mut statistics = Statistics::new();
    let mut estimators = Estimators::new(&mut statistics, Config::default());
    for (period, burst) in (0..).zip(bursts) {
        estimators.process(timed(period, Some(*burst)), 0);
    }
    core::array::from_fn(|index| {
        let estimator = estimators.channel(index).unwrap();
        (estimator.len(), estimator.missing())
    })
}

/// A rate that the sensor cannot measure is missing in that gyro only, and a word that was not refreshed in its channel
/// only.
#[test]
fn a_sample_that_is_refused_in_one_channel_is_missing_in_that_channel_alone() {
    let mut stale = with_rate(2);
    stale.words[Channel::AcclY as usize].0 &= 0x7FFF;
    let samples = samples_after(&[with_rate(1), with_rate(7_001), stale, with_rate(3)]);
    let mut expected = [(4, 0); CHANNELS.len()];
    (expected[0], expected[4]) = ((3, 1), (3, 1));
    assert_eq!(samples, expected);
}

/// The supply is 4.70 V, as from a USB port, with the error flag that the sensor sets then. Each burst has a warning, and no sample is
/// lost.
#[test]
fn a_low_supply_and_the_error_flag_mark_samples_and_refuse_none() {
    let low = |k: i16| {
        let mut burst = with_rate(k);
        burst.words[0] = OutputWord::from_counts(Channel::Supply, 1944);
        burst.words.iter_mut().for_each(|word| word.0 |= 0x4000);
        burst
    };
    let bursts: Vec<Burst> = (0..100).map(low).collect();
    assert_eq!(samples_after(&bursts), [(100, 0); CHANNELS.len()]);
    let health = health_after(bursts);
    assert_eq!((health.used, health.supply, health.error_alarm), (100, 100, 100), "{health:?}");
}

/// A bus that damages every other burst is in trouble; one that damages a quarter of them, or one a second, is not.
#[test]
fn scattered_unusable_bursts_are_no_trouble() {
    let suspect_with_one_in = |every: u32| {
        let mut statistics = Statistics::new();
        let mut estimators = Estimators::new(&mut statistics, Config::default());
        (0..10_000_u32).any(|period| {
            let good = with_rate((period % 100) as i16);
            let burst = if period % every == 0 { shifted(&good) } else { good };
            estimators.process(timed(period, Some(burst)), 0);
            estimators.is_suspect()
        })
    };
    assert_eq!([2, 4, 819].map(suspect_with_one_in), [true, false, false]);
}

/// Two averages of `taps` samples each, as in the sensor (data sheet Rev. B, Fig. 15).
struct Filter {
    stages: [std::collections::VecDeque<f64>; 2],
}

impl Filter {
    fn new(taps: usize) -> Self {
        Self { stages: core::array::from_fn(|_| vec![0.0; taps].into()) }
    }

    fn push(&mut self, value: f64) -> f64 {
        self.stages.iter_mut().fold(value, |value, stage| {
            stage.pop_front();
            stage.push_back(value);
            stage.iter().sum::<f64>() / stage.len() as f64
        })
    }
}

/// A self-test displaces the outputs (data sheet Rev. B, page 15), and the filter holds the displacement for 2N samples. A
/// sensor at rest is tested every two seconds: no sample of the displacement reaches the statistics, and the samples of the gap
/// are no more than the filter and 7 ms of the analogue part take.
#[test]
fn samples_that_the_filter_mixes_with_a_self_test_are_a_gap() {
    for taps_log2 in [0, 2, 4, 6] {
        let config = Config::new(GyroRange::Dps300, taps_log2, SamplePeriod::nearest(819.2).unwrap()).unwrap();
        let mut statistics = Statistics::new();
        let mut estimators = Estimators::new(&mut statistics, config);
        let mut filter = Filter::new(1 << taps_log2);
        let (tests, mut period) = (5, 0);
        for _ in 0..tests {
            // The test takes 12 ms, in which no burst is read.
            for _ in 0..10 {
                filter.push(800.0);
                period += 1;
            }
            estimators.accept_samples_after_settling(at_us(period) - 1);
            for _ in 0..1638 {
                let mut counts = AT_REST;
                // Changing counts keep the sensor from looking frozen.
                counts[2] = (period % 7) as i16;
                counts[1] = filter.push(0.0).round() as i16;
                estimators.process(timed(period, Some(Burst::from_counts(&Counts::new(counts)))), 0);
                period += 1;
            }
        }
        let (estimator, health) = (estimators.channel(0).unwrap(), estimators.health());
        assert_eq!(estimator.sum_of_squares(0).map(|(squares, _)| squares), Some(0), "2^{taps_log2} taps");
        let most = tests * ((2 << taps_log2) + (0.007 * 819.2) as u32 + 1) + LEARNING;
        assert!((1..=most).contains(&health.settling), "2^{taps_log2} taps: {health:?}");
        assert_eq!(health.used + health.settling, tests * 1638, "{health:?}");
    }
}

/// A part's clock is within 3 % of its nominal rate (data sheet Rev. B, Table 1). If it is 3 % slow, the averaging times of the same counts
/// are 3 % longer, and with white noise N is larger by the root of that.
#[test]
fn averaging_times_are_by_the_measured_rate() {
    let config = Config::default();
    let mut state = 1_u64;
    let mut noise = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 56) as i16 % 64
    };
    let counts: Vec<i16> = (0..4096).map(|_| noise()).collect();
    let random_walk = |clock: f64| {
        let mut statistics = Statistics::new();
        let mut estimators = Estimators::new(&mut statistics, config);
        for (period, &k) in (0..).zip(&counts) {
            let at_us = (f64::from(period) * PERIOD_US / clock) as u64;
            estimators.process(TimedBurst { at_us, dropped: 0, burst: Some(burst(k)) }, 0);
        }
        let sums = ChannelSums::from_estimator(estimators.channel(0).unwrap());
        let scale = estimators.scale();
        assert!((scale.rate_hz() / (819.2 * clock) - 1.0).abs() < 1e-5, "{scale:?}");
        sums.fit_baseline(Channel::GyroX, scale).terms()[0].value
    };
    let ratio = random_walk(0.97) / random_walk(1.0);
    assert!((ratio / (1.0_f64 / 0.97).sqrt() - 1.0).abs() < 1e-3, "{ratio}");
}

/// Sixteen edges in a millisecond, 13 times a sensor's rate, mask the line whether sampling is enabled or not.
#[test]
fn an_oscillating_line_is_to_be_masked() {
    for enabled in [true, false] {
        let mut queue = BurstQueue::new();
        let mut sampler = Sampler::new(queue.split().0);
        sampler.set_enabled(enabled);
        assert!((0..1000).all(|k| sampler.data_ready(833 * k) != EdgeAction::Mask), "an external clock of 1.2 kHz");
        assert_eq!((0..100).position(|k| sampler.data_ready(900_000 + k) == EdgeAction::Mask), Some(15));
        assert!(sampler.activity().is_masked && sampler.activity().masked == 1);
        sampler.set_enabled(true);
        assert!(!sampler.activity().is_masked);
    }
}

/// One bit in a million of the words is flipped, flags included; the noise is that of a gyro of 0.0368 deg/√s at 204.8 samples a
/// second, 10.5 counts. Ten flips of a channel in 700,000 samples raise its variance by a fifth, N by 10 %: without the gate N is
/// outside its bounds.
#[test]
fn bit_errors_leave_n_within_its_bounds() {
    const SIGMA: f64 = 10.5;
    const SAMPLES: u32 = 2_000_000;
    const FLIPS_A_BIT: f64 = 1e-6;
    let config = Config::new(GyroRange::Dps300, 0, SamplePeriod::nearest(204.8).unwrap()).unwrap();
    let mut random = Normal(7);
    let mut statistics = Statistics::new();
    let mut estimators = Estimators::new(&mut statistics, config);
    let (mut flips, mut to_next) = (0, 0.0);
    for period in 0..SAMPLES {
        let mut counts = AT_REST;
        counts[1..7].iter_mut().for_each(|count| *count = (SIGMA * random.next()).round() as i16);
        let mut burst = Burst::from_counts(&Counts::new(counts));
        // Flips are independent: the number of bits between two has an exponential distribution.
        let bits = 12.0 * 16.0;
        while to_next < bits {
            let bit = to_next as usize;
            burst.words[bit / 16].0 ^= 1 << (bit % 16);
            flips += 1;
            to_next += 1.0 - random.uniform().ln() / FLIPS_A_BIT;
        }
        to_next -= bits;
        estimators
            .process(TimedBurst { at_us: (f64::from(period) * 1e6 / 204.8) as u64, dropped: 0, burst: Some(burst) }, 0);
    }
    let health = estimators.health();
    println!("{flips} flips; {health:?}");
    // Rounding to counts adds a variance of 1/12.
    let truth = 0.05 * (SIGMA * SIGMA + 1.0 / 12.0).sqrt() / 204.8_f64.sqrt();
    for (index, lsb) in [(0, 1.0), (1, 1.0), (2, 1.0), (3, 3.33e-3 / 0.05), (4, 3.33e-3 / 0.05), (5, 3.33e-3 / 0.05)] {
        let sums = ChannelSums::from_estimator(estimators.channel(index).unwrap());
        let n = sums.fit_baseline(CHANNELS[index], estimators.scale()).terms()[0];
        let truth = truth * lsb;
        println!("{:?}: N {:.6} ({:.6} to {:.6}), truth {truth:.6}", CHANNELS[index], n.value, n.low, n.high);
        // The 95 % bounds are widened by half, so that they hold for six channels together.
        let (low, high) = (1.5 * n.low - 0.5 * n.value, 1.5 * n.high - 0.5 * n.value);
        assert!((low..high).contains(&truth), "{:?}: {n:?}, truth {truth}", CHANNELS[index]);
    }
    assert!(health.gross_errors > 0 && health.gross_errors < flips, "{health:?}");
    assert_eq!(health.recoveries, 0);
}

/// Ten seconds of noise from a probe on, in which these samples of gyro x are wrong by so many counts.
fn random_walk_with_errors(errors: &[(u32, i16)]) -> (FittedTerm, Health) {
    let config = Config::new(GyroRange::Dps300, 0, SamplePeriod::nearest(204.8).unwrap()).unwrap();
    let mut statistics = Statistics::new();
    let mut estimators = Estimators::new(&mut statistics, config);
    estimators.accept_samples_after_settling(0);
    let mut normal = Normal(5);
    for period in 1..2049_u32 {
        let mut counts = AT_REST;
        counts[1..7].iter_mut().for_each(|count| *count = (10.5 * normal.next()).round() as i16);
        counts[1] += errors.iter().find(|&&(at, _)| at == period).map_or(0, |&(_, error)| error);
        let burst = Some(Burst::from_counts(&Counts::new(counts)));
        let at_us = (f64::from(period) * 1e6 / 204.8) as u64;
        estimators.process(TimedBurst { at_us, dropped: 0, burst }, 0);
    }
    let sums = ChannelSums::from_estimator(estimators.channel(0).unwrap());
    (sums.fit_baseline(CHANNELS[0], estimators.scale()).terms()[0], estimators.health())
}

/// A bit of 4,096 counts is flipped in any of the first 300 samples after a start, and another within sixteen samples. N stays within its
/// bounds, since these samples are not used or are refused.
#[test]
fn gross_errors_after_a_start_and_close_together_leave_n_within_its_bounds() {
    let (sound, _) = random_walk_with_errors(&[]);
    let single = (1..300).map(|at| vec![(at, 4096)]);
    let pairs = (1..17).flat_map(|apart| [1024, -2048].map(|error| vec![(1000, 4096), (1000 + apart, error)]));
    for errors in single.chain(pairs) {
        let (found, health) = random_walk_with_errors(&errors);
        assert!((sound.low..sound.high).contains(&found.value), "{errors:?}: {found:?}, without {sound:?}");
        let unused = 2 + 2 + LEARNING; // 2N, and 6.2 ms of the analogue part
        let expected = errors.iter().filter(|&&(at, _)| at > unused).count() as u32;
        // The last settling sample is the level to compare with: after an error in it, the next two samples are
        // refused.
        let spare = 2 * u32::from(errors[0].0 == unused);
        assert!((expected..=expected + spare).contains(&health.gross_errors), "{errors:?}: {health:?}");
    }
}
