//! `read_on`: the asynchronous driver at the data-ready line of the virtual part, before, during and after its pulses.

use std::convert::Infallible;
use std::pin::pin;
use std::task::{Context, Poll, Waker};

use adis16405_driver::{Adis16405, Async, Config, Error, Faults, ImuSample};
use embedded_hal::digital::{ErrorKind, ErrorType};
use embedded_hal_async::digital::Wait;
use virtual_sensor::{EmulatedBus, NoiseModel, OutputRegister, VirtualAdis16405, VirtualDelay};

/// DIO1 of the part, or a faulty line. Time advances while the driver waits.
enum DataReady {
    Sound(EmulatedBus),
    StaysLow,
    StaysHigh,
    Fails,
}

#[derive(Debug)]
struct PinFault;

impl embedded_hal::digital::Error for PinFault {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Other
    }
}

impl ErrorType for DataReady {
    type Error = PinFault;
}

impl Wait for DataReady {
    async fn wait_for_high(&mut self) -> Result<(), PinFault> {
        match self {
            DataReady::Sound(bus) => {
                if !bus.part().pin(1) {
                    bus.wait_for_data().expect("a pulse");
                }
                Ok(())
            }
            DataReady::StaysLow => std::future::pending().await,
            DataReady::StaysHigh => Ok(()),
            DataReady::Fails => Err(PinFault),
        }
    }

    async fn wait_for_low(&mut self) -> Result<(), PinFault> {
        unreachable!("data ready is active high")
    }

    async fn wait_for_rising_edge(&mut self) -> Result<(), PinFault> {
        unreachable!("the edge may have come")
    }

    async fn wait_for_falling_edge(&mut self) -> Result<(), PinFault> {
        unreachable!("data ready is active high")
    }

    async fn wait_for_any_edge(&mut self) -> Result<(), PinFault> {
        unreachable!("the edge may have come")
    }
}

type Imu = Adis16405<EmulatedBus, VirtualDelay, Async>;

/// Polls once; `None` if the future waits.
fn poll_once<T>(future: impl Future<Output = T>) -> Option<T> {
    match pin!(future).poll(&mut Context::from_waker(Waker::noop())) {
        Poll::Ready(output) => Some(output),
        Poll::Pending => None,
    }
}

/// A part at 819.2 SPS whose first sample is due.
fn start() -> (EmulatedBus, Imu) {
    let bus = EmulatedBus::new(VirtualAdis16405::new(NoiseModel::paper(), 3));
    let mut imu = Adis16405::new_async(bus.clone(), bus.delay(), Config::default());
    poll_once(imu.init()).expect("ready").expect("a part");
    (bus, imu)
}

fn read_on(imu: &mut Imu, line: &mut DataReady) -> Result<ImuSample, Error<Infallible>> {
    poll_once(imu.read_on(line)).expect("a pulse")
}

#[test]
fn every_pulse_gives_its_sample_once() {
    let (bus, mut imu) = start();
    let mut line = DataReady::Sound(bus.clone());
    bus.wait_for_data();
    let first = bus.part().samples();
    for number in first..first + 1000 {
        let sample = read_on(&mut imu, &mut line).expect("a sample");
        assert_eq!(bus.part().samples(), number, "the next sample");
        let counts = OutputRegister::GYROS.map(|register| bus.part().counts()[register as usize]);
        assert_eq!(sample.counts().gyro(), counts);
    }
    assert_eq!(bus.part().violations(), []);
}

#[test]
fn a_pulse_that_has_begun_is_read_at_once() {
    let (bus, mut imu) = start();
    let began_ns = bus.wait_for_data().expect("a pulse");
    bus.advance_to(began_ns + 90_000);
    let number = bus.part().samples();
    assert!(read_on(&mut imu, &mut DataReady::Sound(bus.clone())).is_ok());
    assert_eq!(bus.part().samples(), number);
    // The time is 90 µs, 26 bytes at 1 MHz, and 16 µs of stall.
    assert_eq!(bus.part().now(), began_ns + 90_000 + 208_000 + 16_000);
}

/// A task is late: its read begins less than a burst's 208 µs before the next sample, whose pulse lasts 100 µs. The read ends within that
/// pulse, so another read follows at once.
#[test]
fn a_pulse_during_a_read_is_read_by_the_next_call_if_it_is_still_high() {
    for (lead_ns, is_over) in [(150_000, false), (100_000, true)] {
        let (bus, mut imu) = start();
        bus.wait_for_data();
        let (number, next_ns) = (bus.part().samples(), bus.part().next_data_ready());
        bus.advance_to(next_ns - lead_ns);
        assert!(poll_once(imu.read()).expect("ready").is_ok());
        assert_eq!(bus.part().samples(), number + 1, "the sample came during the read");
        let next = read_on(&mut imu, &mut DataReady::Sound(bus.clone()));
        assert!(next.is_ok(), "{next:?}");
        assert_eq!(bus.part().samples(), number + 1 + u64::from(is_over), "{lead_ns} ns before the pulse");
    }
}

#[test]
fn a_line_without_pulses_is_told_and_costs_nothing() {
    let (bus, mut imu) = start();
    let frames_until = bus.part().now();
    assert_eq!(poll_once(imu.read_on(&mut DataReady::StaysLow)), None, "waits, and is dropped");
    assert_eq!(bus.part().now(), frames_until, "nothing was sent");
    assert_eq!(read_on(&mut imu, &mut DataReady::Fails), Err(Error::Pin));

    bus.wait_for_data();
    assert!(read_on(&mut imu, &mut DataReady::StaysHigh).is_ok());
    let again = read_on(&mut imu, &mut DataReady::StaysHigh);
    assert!(matches!(again, Err(Error::Unusable(faults)) if faults.contains(Faults::NO_NEW_DATA)), "{again:?}");
    assert!(read_on(&mut imu, &mut DataReady::Sound(bus)).is_ok());
}
