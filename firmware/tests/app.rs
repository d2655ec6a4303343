//! The application and the acquisition on the host, without a board.

use adis16405_driver::{Adis16405, Burst, Channel, Config, Counts};
use embedded_hal::spi::{ErrorType, Operation, SpiDevice};
use firmware::{Acquisition, App, Arrival, Queue, Settings, Sink, log_frame};
use link::{Decoder, Encoder, Message};

const INTERVAL_US: u64 = 1_000_000;

/// The supply in counts of 2.418 mV: 5.00 V.
const SUPPLY: i16 = 2068;

fn app(report_interval_us: u64) -> App {
    let settings = Settings { config: Config::default(), product_id: 16405, spi_clock_hz: 656_250, report_interval_us };
    App::new(settings, Encoder::new())
}

/// A good burst whose inertial counts are those of no other `k` nearby.
fn burst(k: i16) -> Burst {
    Burst::fresh(&Counts::new([SUPPLY, k, 2 * k, 3, 4, 5, 6, 7, 8, 9, 10, 11]))
}

fn arrival(k: i16) -> Arrival {
    Arrival { dropped: 0, burst: Some(burst(k)) }
}

/// Decodes what it takes; refuses while `full`.
#[derive(Default)]
struct Host {
    full: bool,
    decoder: Decoder,
    messages: Vec<Message>,
}

impl Sink for Host {
    fn offer(&mut self, frame: &[u8]) -> bool {
        if !self.full {
            let received = frame.iter().filter_map(|&byte| self.decoder.push(byte));
            self.messages.extend(received.map(|received| received.message));
        }
        !self.full
    }
}

/// Hello, six channels, health.
fn is_report(messages: &[Message]) -> bool {
    let [Message::Hello(_), channels @ .., Message::Health(_)] = messages else { return false };
    let numbers = channels.iter().map(|message| match message {
        Message::Channel(report) => report.channel,
        _ => 0,
    });
    numbers.eq(1..=6)
}

#[test]
fn a_report_is_due_at_every_interval() {
    let mut app = app(INTERVAL_US);
    let mut host = Host::default();
    assert!(!app.poll(INTERVAL_US - 1, &mut host));
    assert!(host.messages.is_empty());
    for now in [INTERVAL_US, 2 * INTERVAL_US, 2 * INTERVAL_US + 1] {
        while app.poll(now, &mut host) {}
    }
    let (first, second) = host.messages.split_at(8);
    assert!(is_report(first) && is_report(second), "{:?}", host.messages);
}

/// The main loop was away for five intervals: one report makes up for it, and the next one is in time.
#[test]
fn reports_do_not_pile_up() {
    let mut app = app(INTERVAL_US);
    let mut host = Host::default();
    while app.poll(5 * INTERVAL_US + 7, &mut host) {}
    while app.poll(6 * INTERVAL_US - 1, &mut host) {}
    assert!(is_report(&host.messages));
    while app.poll(6 * INTERVAL_US, &mut host) {}
    assert_eq!(host.messages.len(), 16);
}

#[test]
fn a_report_is_sent_on_request_and_only_once_at_a_time() {
    let mut app = app(0);
    let mut host = Host::default();
    app.command(b'x');
    assert!(!app.poll(u64::MAX, &mut host));
    app.command(b'r');
    app.poll(0, &mut host);
    app.command(b'r');
    while app.poll(0, &mut host) {}
    assert!(is_report(&host.messages));
}

#[test]
fn a_full_line_delays_a_report_and_loses_nothing() {
    let mut app = app(0);
    let mut host = Host::default();
    app.command(b'r');
    for round in 0.. {
        host.full = round % 3 != 0;
        if !app.poll(0, &mut host) {
            break;
        }
    }
    assert!(is_report(&host.messages));
    assert_eq!(host.decoder.counters().missing, 0);
}

/// Allan's sum worked out by hand: counts 0, 1, 3 have first differences 1, 2, whose squares sum to 5.
#[test]
fn counts_reach_the_estimators() {
    let mut app = app(0);
    for k in [0, 1, 3] {
        app.take(arrival(k), 0);
    }
    let report = app.channel(Channel::GyroX).unwrap();
    let point = report.points[0];
    assert_eq!((report.samples, point.n, point.sum, point.count), (3, 1, 5, 2));
    assert_eq!(app.channel(Channel::GyroY).unwrap().points[0].sum, 20);
    assert_eq!(app.channel(Channel::AcclX).unwrap().points[0].sum, 0);
    assert_eq!(app.channel(Channel::Temp), None);
}

/// Nothing straddles what was lost: of 1, lost, 5, 9 only the step from 5 to 9 counts.
#[test]
fn losses_are_gaps_and_are_counted_by_cause() {
    let stuck = Burst::from_bytes(&[0; 26]);
    let lost = [
        Arrival { dropped: 0, burst: None },
        Arrival { dropped: 0, burst: Some(stuck) },
        Arrival { dropped: 3, burst: None },
    ];
    for (case, missing) in [(lost[0], 1), (lost[1], 1), (lost[2], 4)] {
        let mut app = app(0);
        app.take(arrival(1), 0);
        app.take(case, 4);
        app.take(arrival(5), 0);
        app.take(arrival(9), 0);
        let report = app.channel(Channel::GyroX).unwrap();
        assert_eq!((report.samples, report.missing), (3, missing), "{case:?}");
        assert_eq!((report.points[0].sum, report.points[0].count), (16, 1), "{case:?}");
        let health = app.health();
        assert_eq!(health.used, 3);
        assert_eq!(health.queue_peak, 5);
        assert_eq!(health.queue_full, case.dropped);
        assert_eq!(health.bus_errors, u32::from(case.burst.is_none()));
        assert_eq!(health.stuck_low, u32::from(case.burst.is_some()));
    }
}

#[test]
fn a_long_log_line_is_cut() {
    let frame = log_frame(&mut Encoder::new(), format_args!("{:>500}", "end"));
    assert!(frame.is_some_and(|frame| frame.len() < 200));
}

/// A bus that answers one burst after the other.
struct Bus {
    transfers: i16,
}

impl ErrorType for Bus {
    type Error = core::convert::Infallible;
}

impl SpiDevice for Bus {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Self::Error> {
        for operation in operations {
            if let Operation::Transfer(answer, _) = operation {
                self.transfers += 1;
                answer.copy_from_slice(&burst(self.transfers).to_bytes()[..]);
            }
        }
        Ok(())
    }
}

#[test]
fn a_full_queue_is_counted_with_the_next_burst_that_fits() {
    let mut queue = Queue::new();
    let (producer, mut consumer) = queue.split();
    let mut acquisition = Acquisition::new(Adis16405::new(Bus { transfers: 0 }, Config::default()), producer);
    let capacity = consumer.capacity();
    for _ in 0..capacity + 7 {
        acquisition.on_data_ready();
    }
    let mut next = || consumer.dequeue().map(|arrival| (arrival.dropped, arrival.burst));
    for k in 1..=capacity as i16 {
        assert_eq!(next(), Some((0, Some(burst(k)))));
    }
    assert_eq!(next(), None);
    acquisition.on_data_ready();
    acquisition.on_data_ready();
    let k = capacity as i16 + 8;
    assert_eq!(next(), Some((7, Some(burst(k)))));
    assert_eq!(next(), Some((0, Some(burst(k + 1)))));
}
