//! Procedures that end early, by an error of the bus at any of their frames or because their future is dropped there:
//! what they leave in the part, and what the driver knows of it.

use std::cell::RefCell;
use std::rc::Rc;

use adis16405_driver::{
    Adis16405, Burst, Config, Error, Faults, GyroRange, SelectDuringStall, SharedDelay, Stimulus, Timing,
};
use embedded_hal::delay::DelayNs;
use embedded_hal::spi::{ErrorType, Operation, SpiDevice};

const MSC_CTRL: u8 = 0x34;
const SENS_AVG: u8 = 0x38;
/// MSC_CTRL bits 9 and 8, the stimuli of the manual self-test.
const STIMULI: u16 = 0x0300;

/// A part whose registers hold what is written, and whose answers come one frame later.
struct Part {
    registers: [u16; 0x40],
    answer: u16,
    /// The supply word of a burst, and all others of it.
    burst: [u16; 2],
    /// Transactions so far.
    transactions: usize,
    /// Transactions of these numbers fail, and the part does not receive them.
    failing: std::ops::Range<usize>,
}

/// A handle on a part.
#[derive(Clone)]
struct Bus(Rc<RefCell<Part>>);

#[derive(Debug, PartialEq, Eq)]
struct BusFault;

impl embedded_hal::spi::Error for BusFault {
    fn kind(&self) -> embedded_hal::spi::ErrorKind {
        embedded_hal::spi::ErrorKind::Other
    }
}

impl Bus {
    /// A part with reset values whose transactions of the numbers `failing` fail.
    fn new(failing: std::ops::Range<usize>) -> Self {
        let mut registers = [0; 0x40];
        for (address, value) in [(0x56, 16405), (0x36, 0x0001), (SENS_AVG, 0x0402), (MSC_CTRL, 0x0006)] {
            registers[usize::from(address / 2)] = value;
        }
        Self(Rc::new(RefCell::new(Part {
            registers,
            answer: 0,
            burst: [0x8000 | 2068, 0x8000],
            transactions: 0,
            failing,
        })))
    }

    fn register(&self, address: u8) -> u16 {
        self.0.borrow().registers[usize::from(address / 2)]
    }

    fn transactions(&self) -> usize {
        self.0.borrow().transactions
    }

    /// No further transaction fails.
    fn repair(&self) {
        self.0.borrow_mut().failing = 0..0;
    }
}

impl ErrorType for Bus {
    type Error = BusFault;
}

impl SpiDevice for Bus {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), BusFault> {
        let mut part = self.0.borrow_mut();
        part.transactions += 1;
        if part.failing.contains(&(part.transactions - 1)) {
            return Err(BusFault);
        }
        for operation in operations {
            match operation {
                Operation::Transfer(answer, request) if answer.len() == 2 => {
                    answer.copy_from_slice(&part.answer.to_be_bytes());
                    let (address, byte) = (request[0] & 0x7F, request[1]);
                    let register = &mut part.registers[usize::from(address / 2)];
                    if request[0] & 0x80 == 0 {
                        part.answer = *register;
                    } else {
                        let mut bytes = register.to_be_bytes();
                        bytes[usize::from(1 - address % 2)] = byte;
                        *register = u16::from_be_bytes(bytes);
                    }
                }
                Operation::Transfer(answer, _) => {
                    answer.chunks_exact_mut(2).for_each(|word| word.copy_from_slice(&part.burst[1].to_be_bytes()));
                    answer[2..4].copy_from_slice(&part.burst[0].to_be_bytes());
                }
                _ => (),
            }
        }
        Ok(())
    }
}

struct NoDelay;

impl DelayNs for NoDelay {
    fn delay_ns(&mut self, _: u32) {}
}

/// The number of transactions of a call that meets no fault.
fn transactions_of(call: impl Fn(&mut Adis16405<Bus, NoDelay>)) -> usize {
    let bus = Bus::new(0..0);
    call(&mut Adis16405::new(bus.clone(), NoDelay, Config::default()));
    bus.transactions()
}

#[test]
fn a_stimulus_is_switched_off_after_a_single_error_of_the_bus() {
    for stimulus in [Stimulus::Positive, Stimulus::Negative] {
        let whole = transactions_of(|imu| drop(imu.stimulus_response(stimulus)));
        for at in 0..whole {
            let bus = Bus::new(at..at + 1);
            let mut imu = Adis16405::new(bus.clone(), NoDelay, Config::default());
            assert_eq!(imu.stimulus_response(stimulus), Err(Error::Spi(BusFault)));
            assert_eq!(bus.register(MSC_CTRL), 0x0006, "{stimulus:?}, error at transaction {at} of {whole}");
        }
    }
}

#[test]
fn init_switches_off_a_stimulus_that_a_failed_bus_has_left_on() {
    let whole = transactions_of(|imu| drop(imu.stimulus_response(Stimulus::Positive)));
    let mut left_on = 0;
    for at in 0..whole {
        let bus = Bus::new(at..usize::MAX);
        let mut imu = Adis16405::new(bus.clone(), NoDelay, Config::default());
        assert_eq!(imu.stimulus_response(Stimulus::Positive), Err(Error::Spi(BusFault)));
        left_on += u32::from(bus.register(MSC_CTRL) & STIMULI != 0);
        bus.repair();
        assert_eq!(imu.read(), Err(Error::NotReady));
        imu.init().unwrap();
        assert!(imu.read().is_ok());
        assert_eq!(bus.register(MSC_CTRL), 0x0006, "error at transaction {at} of {whole}");
    }
    assert!(left_on > 50, "the failures must cover the time of the stimulus: {left_on}");
}

/// The range byte of SENS_AVG is written by the fifth transaction, after two reads.
#[test]
fn after_an_error_the_range_is_that_of_the_part() {
    let whole = transactions_of(|imu| imu.set_range(GyroRange::Dps150).unwrap());
    assert_eq!(whole, 8);
    for at in 0..whole {
        let bus = Bus::new(at..at + 1);
        let mut imu = Adis16405::new(bus.clone(), NoDelay, Config::default());
        assert_eq!(imu.set_range(GyroRange::Dps150), Err(Error::Spi(BusFault)));
        assert!(!imu.is_ready());
        assert_eq!(imu.read(), Err(Error::NotReady));
        // Whether the part has received a write that failed cannot be known.
        if at != 4 {
            let range = GyroRange::from_sens_avg(bus.register(SENS_AVG));
            assert_eq!(Some(imu.config().range()), range, "error at transaction {at} of {whole}");
        }
        imu.init().unwrap();
        assert_eq!(Some(imu.read().unwrap().range()), GyroRange::from_sens_avg(bus.register(SENS_AVG)));
    }
}

#[test]
fn read_gives_a_sample_or_says_why_not() {
    let bus = Bus::new(0..0);
    let mut imu = Adis16405::new(bus.clone(), NoDelay, Config::default());
    assert_eq!(imu.read(), Err(Error::NotReady), "before init");
    imu.init().unwrap();
    assert_eq!(imu.read().unwrap().supply_uv(), 2068 * 2418);

    // A bus on which nothing answers reads zeros, which would be a rate of 0 °/s.
    bus.0.borrow_mut().burst = [0; 2];
    let error = imu.read().unwrap_err();
    assert!(matches!(error, Error::Unusable(faults) if faults.contains(Faults::STUCK_LOW)), "{error:?}");
    assert_eq!(error.to_string(), "the burst is not usable: stuck_low");
    assert_eq!((imu.fault_counters().bursts, imu.fault_counters().unusable), (2, 1));

    bus.0.borrow_mut().failing = 0..usize::MAX;
    assert_eq!(imu.read(), Err(Error::Spi(BusFault)));
    assert_eq!(imu.stimulus_response(Stimulus::Positive), Err(Error::Spi(BusFault)));
    assert!(imu.is_ready(), "no stimulus was switched on");
}

/// Before, an error after the command left the bias of the host in place beside that of the part.
#[test]
fn an_interrupted_auto_null_leaves_no_stale_bias_on_the_host() {
    let bus = Bus::new(0..0);
    let mut imu = Adis16405::new(bus.clone(), NoDelay, Config::default());
    imu.init().unwrap();
    imu.set_gyro_offsets([-40, 0, 0]).unwrap();
    let command = bus.transactions();
    bus.0.borrow_mut().failing = command + 1..usize::MAX;
    assert_eq!(imu.auto_null(), Err(Error::Spi(BusFault)));
    assert_eq!(imu.sample_from(Burst::default()).host_bias_x(), 0);
    assert!(imu.x_sign_at_risk(), "XGYRO_OFF may have become negative");
}

/// One delay serves the stalls of the SPI device and the pauses of the driver.
#[test]
fn a_shared_delay_serves_both_the_spi_device_and_the_driver() {
    struct Total(u64);
    impl DelayNs for Total {
        fn delay_ns(&mut self, ns: u32) {
            self.0 += u64::from(ns);
        }
    }
    /// An SPI device that passes the stalls on to its delay, as those of embedded-hal-bus do.
    struct Device<D>(Bus, D);
    impl<D> ErrorType for Device<D> {
        type Error = BusFault;
    }
    impl<D: DelayNs> SpiDevice for Device<D> {
        fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), BusFault> {
            for operation in operations.iter() {
                if let Operation::DelayNs(ns) = operation {
                    self.1.delay_ns(*ns);
                }
            }
            SpiDevice::transaction(&mut self.0, operations)
        }
    }
    let bus = Bus::new(0..0);
    let delay = SharedDelay::new(Total(0));
    let mut timing = Timing::DEFAULT;
    timing.stall_select = SelectDuringStall::Low;
    let mut imu = Adis16405::new(Device(bus.clone(), &delay), &delay, Config::default()).with_timing(timing);
    imu.start_up().unwrap();
    let frames = bus.transactions() as u64;
    // 290 ms of start-up; the stall of low-power mode after the first four frames, that of normal mode after the others, and
    // 1 µs of chip select high after each.
    assert_eq!(delay.release().0, 290_000_000 + 4 * 96_667 + (frames - 4) * 32_000 + frames * 1_000);
}

/// Futures that are dropped while a transaction is under way.
#[cfg(feature = "async")]
mod dropped {
    use std::pin::pin;
    use std::task::{Context, Poll, Waker};

    use super::*;

    /// A bus on which the transactions that fail on [`Bus`] do not end.
    struct HangingBus(Bus);

    impl ErrorType for HangingBus {
        type Error = BusFault;
    }

    impl embedded_hal_async::spi::SpiDevice for HangingBus {
        async fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), BusFault> {
            match SpiDevice::transaction(&mut self.0, operations) {
                Ok(()) => Ok(()),
                Err(BusFault) => std::future::pending().await,
            }
        }
    }

    impl embedded_hal_async::delay::DelayNs for NoDelay {
        async fn delay_ns(&mut self, _: u32) {}
    }

    /// Polls a future once and drops it; its value if it was ready.
    fn poll_once<T>(future: impl Future<Output = T>) -> Option<T> {
        match pin!(future).poll(&mut Context::from_waker(Waker::noop())) {
            Poll::Ready(output) => Some(output),
            Poll::Pending => None,
        }
    }

    #[test]
    fn init_switches_off_a_stimulus_that_a_dropped_future_has_left_on() {
        let whole = transactions_of(|imu| drop(imu.stimulus_response(Stimulus::Negative)));
        let mut left_on = 0;
        for at in 0..whole {
            let bus = Bus::new(at..at + 1);
            let mut imu = Adis16405::new_async(HangingBus(bus.clone()), NoDelay, Config::default());
            assert_eq!(poll_once(imu.stimulus_response(Stimulus::Negative)), None);
            left_on += u32::from(bus.register(MSC_CTRL) & STIMULI != 0);
            poll_once(imu.init()).unwrap().unwrap();
            assert_eq!(bus.register(MSC_CTRL), 0x0006, "dropped at transaction {at} of {whole}");
        }
        assert!(left_on > 50, "the futures must be dropped during the stimulus too: {left_on}");
    }
}
