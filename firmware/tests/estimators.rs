//! Sampling and estimating without a board: order, gaps by cause, the raw stream.

use adis16405_driver::{BURST_BYTES, Burst, Channel, Config, Counts};
use firmware::{Arrival, Arrivals, CHANNELS, Estimators, Outbox, Outgoing, Sampler, Statistics, estimate};
use link::{Decoder, Message, Raw, Received};

/// The default configuration samples at 819.2 Hz.
const PERIOD_US: f64 = 1e6 / 819.2;
/// The supply in counts of 2.418 mV: 5.00 V.
const SUPPLY: i16 = 2068;

/// A good burst whose inertial counts are those of no other `k` nearby.
fn burst(k: i16) -> Burst {
    Burst::from_counts(&Counts::new([SUPPLY, k, 2 * k, 3, 4, 5, 6, 7, 8, 9, 10, 11]))
}

/// Time of the edge of sample period `period`.
fn at_us(period: u32) -> u64 {
    (f64::from(period) * PERIOD_US) as u64
}

fn arrival(period: u32, burst: Option<Burst>) -> Arrival {
    Arrival { at_us: at_us(period), dropped: 0, burst }
}

/// Allan's sum worked out by hand: counts 0, 1, 3 have first differences 1, 2, whose squares sum to 5.
#[test]
fn counts_reach_the_estimators() {
    let mut statistics = Statistics::new();
    let mut estimators = Estimators::new(&mut statistics, Config::default());
    for (period, k) in (0..).zip([0, 1, 3]) {
        assert!(!estimators.take(arrival(period, Some(burst(k))), 0));
    }
    let sums = |channel| {
        let index = CHANNELS.iter().position(|&other| other == channel).unwrap();
        let estimator = estimators.get(index).unwrap();
        (estimator.len(), estimator.sum_of_squares(0).unwrap())
    };
    assert_eq!(sums(Channel::GyroX), (3, (5, 2)));
    assert_eq!(sums(Channel::GyroY), (3, (20, 2)));
    assert_eq!(sums(Channel::AcclX), (3, (0, 2)));
    assert_eq!(sums(Channel::Temp), (3, (0, 2)));
    assert_eq!(sums(Channel::Supply), (3, (0, 2)));
}

/// Nothing straddles what was lost: of 1, lost, 5, 9 only the step from 5 to 9 counts.
#[test]
fn losses_are_gaps_and_are_counted_by_cause() {
    let zeros = Some(Burst::from_bytes(&[0; BURST_BYTES]));
    let ones = Some(Burst::from_bytes(&[0xFF; BURST_BYTES]));
    let cases = [(None, 1, 0), (zeros, 1, 0), (ones, 1, 0), (None, 4, 0), (None, 4, 2), (None, 4, 3)];
    for (lost, periods, dropped) in cases {
        let mut statistics = Statistics::new();
        let mut estimators = Estimators::new(&mut statistics, Config::default());
        estimators.take(arrival(0, Some(burst(1))), 0);
        estimators.take(Arrival { dropped, ..arrival(periods, lost) }, 4);
        estimators.take(arrival(periods + 1, Some(burst(5))), 0);
        estimators.take(arrival(periods + 2, Some(burst(9))), 0);
        let case = format!("{lost:?}, {periods} periods, {dropped} dropped");
        let estimator = estimators.get(0).unwrap();
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

/// An edge between two samples is noise on the line: its burst is no sample, and no sample is missing.
#[test]
fn a_stray_edge_is_no_sample() {
    let mut statistics = Statistics::new();
    let mut estimators = Estimators::new(&mut statistics, Config::default());
    estimators.take(arrival(0, Some(burst(1))), 0);
    estimators.take(Arrival { at_us: 500, ..arrival(0, Some(burst(1))) }, 0);
    estimators.take(arrival(1, Some(burst(2))), 0);
    let estimator = estimators.get(0).unwrap();
    assert_eq!((estimator.len(), estimator.missing(), estimator.sum_of_squares(0)), (2, 0, Some((1, 1))));
    assert_eq!(estimators.health().stray_edges, 1);
}

/// After a silence in which the sensor may have been reset its samples are not used until it was checked.
#[test]
fn after_a_silence_samples_wait_for_the_check() {
    let mut statistics = Statistics::new();
    let mut estimators = Estimators::new(&mut statistics, Config::default());
    estimators.trust(0);
    estimators.take(arrival(0, Some(burst(1))), 0);
    for (period, k) in [(100, 2), (101, 3)] {
        estimators.take(arrival(period, Some(burst(k))), 0);
        assert!(estimators.is_doubtful());
    }
    estimators.trust(at_us(101) + 1);
    estimators.take(arrival(102, Some(burst(4))), 0);
    let estimator = estimators.get(0).unwrap();
    assert_eq!((estimator.len(), estimator.missing()), (2, 101));
    let health = estimators.health();
    assert_eq!((health.lost_edges, health.unchecked, health.used), (99, 2, 2));
}

#[test]
fn a_stuck_data_line_raises_doubt() {
    for bytes in [[0; BURST_BYTES], [0xFF; BURST_BYTES]] {
        let mut statistics = Statistics::new();
        let mut estimators = Estimators::new(&mut statistics, Config::default());
        let mut doubtful = |period| {
            estimators.take(arrival(period, Some(Burst::from_bytes(&bytes))), 0);
            estimators.is_doubtful()
        };
        assert_eq!((0..20).position(&mut doubtful), Some(15));
    }
}

#[test]
fn a_full_queue_is_counted_with_the_next_burst_that_fits() {
    let mut queue = Arrivals::new();
    let (producer, mut consumer) = queue.split();
    let mut sampler = Sampler::new(producer);
    let capacity = consumer.capacity() as u64;
    assert!(!sampler.edge(0), "nobody asked for samples");
    sampler.run(true);
    let mut sample = |at_us: u64| {
        assert!(sampler.edge(at_us));
        assert!(!sampler.edge(at_us + 1), "a burst is on the bus");
        sampler.burst(Some(&burst(at_us as i16).to_bytes()));
    };
    (0..capacity + 7).for_each(&mut sample);
    let mut arrived = |count| -> Vec<(u64, u32)> {
        (0..count).map_while(|_| consumer.dequeue()).map(|arrival| (arrival.at_us, arrival.dropped)).collect()
    };
    assert!(arrived(1000).into_iter().eq((0..capacity).map(|at_us| (at_us, 0))));
    sample(1000);
    sample(1001);
    assert_eq!(arrived(3), [(1000, 7), (1001, 0)]);
}

/// The raw stream holds every burst, usable or not, each with its place: those that are lost leave a gap in the numbers.
#[test]
fn the_raw_stream_is_what_came_off_the_bus() {
    let (mut arrivals, mut outgoing, mut statistics) = (Arrivals::new(), Outgoing::new(), Statistics::new());
    let (mut producer, mut consumer) = arrivals.split();
    let (to_port, mut port) = outgoing.split();
    let mut outbox = Outbox::new(to_port);
    let mut estimators = Estimators::new(&mut statistics, Config::default());
    estimators.set_raw(true);
    let mut expected = Vec::new();
    for period in (0..40).chain(50..58) {
        let bytes = if period % 7 == 0 { [0; BURST_BYTES] } else { burst(period as i16).to_bytes() };
        let burst = Burst::from_bytes(&bytes);
        expected.push((u64::from(period), at_us(period), burst.words.map(|word| word.0.to_be_bytes())));
        producer.enqueue(arrival(period, Some(burst))).unwrap();
        estimate(&mut estimators, &mut outbox, &mut consumer);
    }
    let mut decoder = Decoder::new();
    let received = std::iter::from_fn(|| port.dequeue()).filter_map(|byte| decoder.push(byte));
    let mut found = Vec::new();
    for message in received.filter_map(Received::message) {
        let Message::Raw(Raw { first, at_us, sens_avg, bursts }) = message else { panic!("{message:?}") };
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

/// A line that nobody empties: messages of the raw stream are dropped whole, counted, and missed by their numbers.
#[test]
fn what_the_line_cannot_take_is_counted() {
    let (mut arrivals, mut outgoing, mut statistics) = (Arrivals::new(), Outgoing::new(), Statistics::new());
    let (mut producer, mut consumer) = arrivals.split();
    let (to_port, mut port) = outgoing.split();
    let mut outbox = Outbox::new(to_port);
    let mut estimators = Estimators::new(&mut statistics, Config::default());
    estimators.set_raw(true);
    let mut decoder = Decoder::new();
    for period in 0..320 {
        producer.enqueue(arrival(period, Some(burst(period as i16)))).unwrap();
        estimate(&mut estimators, &mut outbox, &mut consumer);
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
