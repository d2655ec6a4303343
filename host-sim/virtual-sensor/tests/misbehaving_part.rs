//! The driver on a misbehaving part: cold, strict about chip select, with a latched flag of DIAG_STAT, or responsive
//! only to its reset line.

use std::cell::Cell;
use std::convert::Infallible;
use std::pin::pin;
use std::rc::Rc;
use std::task::{Context, Poll, Waker};

use adis16405_driver::{
    Adis16405, Burst, BurstValidator, ChannelMask, Config, Diagnosis, Error, Faults, Product, Register, SamplePeriod,
    SelectDuringStall, Sleep, Timing,
};
use embedded_hal::digital::{ErrorType, OutputPin};
use embedded_hal_async::delay::DelayNs;

use virtual_sensor::{
    Activity, BusyAnswers, DiagnosisFlag, EmulatedBus, NoiseModel, OutputRegister, Strictness, ViolationKind,
    VirtualAdis16405, VirtualDelay,
};

fn driver(bus: &EmulatedBus) -> Adis16405<EmulatedBus, VirtualDelay> {
    Adis16405::new(bus.clone(), bus.delay(), Config::default())
}

/// A driver with times that `change` has modified.
fn timed_driver(bus: &EmulatedBus, change: impl FnOnce(&mut Timing)) -> Adis16405<EmulatedBus, VirtualDelay> {
    let mut timing = Timing::DEFAULT;
    change(&mut timing);
    driver(bus).with_timing(timing)
}

/// A part that needs chip select high for `least_high_ns` between frames.
fn strict(least_high_ns: u64) -> EmulatedBus {
    let mut part = VirtualAdis16405::new(NoiseModel::noiseless(), 1);
    part.set_strictness(Strictness::Pedantic { least_high_ns });
    EmulatedBus::new(part)
}

#[test]
fn the_default_keeps_chip_select_high_for_the_whole_stall() {
    let bus = strict(16_000);
    let mut imu = driver(&bus);
    imu.start_up().unwrap();
    for _ in 0..20 {
        bus.wait_for_data();
        imu.read().unwrap();
    }
    assert_eq!(bus.part().violations(), []);

    // The shortest times that the part accepts are 9 µs after a burst and, at 1 MHz, 24 µs after a frame, of which one comes every 40 µs.
    let bus = strict(9_000);
    let mut imu = timed_driver(&bus, |timing| {
        timing.stall_ns.normal = 9_000;
        timing.sck_hz = Some(1_000_000);
    });
    imu.start_up().unwrap();
    bus.wait_for_data();
    imu.read().unwrap();
    assert_eq!(bus.part().violations(), []);
}

/// If chip select is low during the stall, it is high only between two transactions: for the set time, or not at all.
#[test]
fn with_chip_select_low_during_the_stall_its_high_time_is_what_is_set() {
    for (select_high_ns, least_high_ns, sound) in [(1_000, 1_000, true), (999, 1_000, false), (0, 1, false)] {
        let bus = strict(least_high_ns);
        let mut imu = timed_driver(&bus, |timing| {
            timing.stall_select = SelectDuringStall::Low;
            timing.select_high_ns = select_high_ns;
        });
        assert_eq!(imu.start_up() == Ok(Product::Adis16405), sound, "{select_high_ns} of {least_high_ns} ns");
        assert_eq!(bus.part().violation_count() == 0, sound);
        if !sound {
            let high_ns = u64::from(select_high_ns);
            let kind = ViolationKind::SelectHigh { high_ns, least_ns: least_high_ns };
            assert_eq!(bus.part().violations()[0].kind, kind);
        }
    }
}

#[test]
fn a_pause_after_a_frame_is_at_least_the_least_time_of_chip_select_high() {
    let bus = strict(30_000);
    let mut imu = timed_driver(&bus, |timing| timing.select_high_ns = 30_000);
    imu.start_up().unwrap();
    assert_eq!(bus.part().violations(), []);
}

/// A delay that does not end at its nth call.
struct HangingDelay {
    delay: VirtualDelay,
    left: Rc<Cell<Option<usize>>>,
}

impl DelayNs for HangingDelay {
    async fn delay_ns(&mut self, ns: u32) {
        match self.left.get() {
            Some(0) => {
                self.left.set(None);
                std::future::pending().await
            }
            left => self.left.set(left.map(|left| left - 1)),
        }
        DelayNs::delay_ns(&mut self.delay, ns).await;
    }
}

/// Polls a future once and drops it; returns its value if it was ready.
fn poll_once<T>(future: impl Future<Output = T>) -> Option<T> {
    match pin!(future).poll(&mut Context::from_waker(Waker::noop())) {
        Poll::Ready(output) => Some(output),
        Poll::Pending => None,
    }
}

#[test]
fn a_stall_that_a_dropped_future_cut_short_is_kept_before_the_next_frame() {
    // An init takes 2 + 2 + 2 + 4 frames, each with its stall.
    for at in 0..10 {
        let bus = strict(1_000);
        let left = Rc::new(Cell::new(Some(at)));
        let delay = HangingDelay { delay: bus.delay(), left: Rc::clone(&left) };
        let mut imu = Adis16405::new_async(bus.clone(), delay, Config::default());
        assert_eq!(poll_once(imu.init()), None, "dropped at stall {at}");
        assert_eq!(poll_once(imu.init()), Some(Ok(Product::Adis16405)));
        assert_eq!(bus.part().violations(), [], "dropped at stall {at}");
    }
}

#[test]
fn a_cold_part_is_left_alone_until_it_has_started_up() {
    for answers in [BusyAnswers::Zeros, BusyAnswers::Ones, BusyAnswers::Garbage] {
        for start_up_ms in [220, 290] {
            let cold = || {
                let mut part = VirtualAdis16405::new(NoiseModel::noiseless(), 1);
                part.set_busy_answers(answers);
                part.set_start_up_ns(Some(start_up_ms * 1_000_000));
                part.power_on();
                EmulatedBus::new(part)
            };
            let bus = cold();
            let error = driver(&bus).init().unwrap_err();
            assert!(matches!(error, Error::Product { .. }), "{error:?}");
            assert_eq!(bus.part().violations()[0].kind, ViolationKind::Busy { activity: Activity::StartUp });

            let bus = cold();
            let mut imu = driver(&bus);
            assert_eq!(imu.start_up(), Ok(Product::Adis16405));
            bus.wait_for_data();
            assert!(imu.read().is_ok());
            assert_eq!(bus.part().violations(), []);
        }
    }
}

#[test]
fn each_latched_flag_is_a_warning_until_its_diagnosis_is_read() {
    // The flags of the supply clear by themselves.
    for flag in DiagnosisFlag::ALL.into_iter().skip(2) {
        let bus = strict(1_000);
        let mut imu = driver(&bus);
        imu.start_up().unwrap();
        bus.part_mut().latch_flag(flag);
        // Without noise all samples are equal.
        let mut warnings = || {
            bus.wait_for_data();
            imu.read().unwrap().warnings() - Faults::REPEATED
        };
        assert_eq!([warnings(), warnings(), warnings()], [Faults::ERROR_ALARM; 3], "{flag:?}");
        assert_eq!(imu.diagnosis(), Ok(Diagnosis::from_bits_retain(flag.bit())));
        bus.wait_for_data();
        assert_eq!(imu.read().unwrap().warnings() - Faults::REPEATED, Faults::empty(), "{flag:?}");
    }
}

/// A sensor sets the error flag in all words of a burst or in none. In a single word it is a bit that the bus has
/// inverted.
#[test]
fn an_error_flag_in_one_word_alone_refuses_the_burst() {
    let bus = strict(1_000);
    let mut imu = driver(&bus);
    imu.start_up().unwrap();
    bus.wait_for_data();
    let sound = imu.burst().unwrap();
    for word in 0..12 {
        let mut bytes = sound.to_bytes();
        // The answer to the burst's own frame comes first; the flag is bit 14 of a word, and the upper byte comes first.
        bytes[2 + 2 * word] ^= 0x40;
        let validity = BurstValidator::default().validate(&Burst::from_bytes(&bytes));
        assert_eq!((validity.faults, validity.refused), (Faults::ERROR_ALARM | Faults::MIXED_ALARM, ChannelMask::ALL));
    }
}

/// A part at 4.70 V, as from a USB port, continues to measure.
#[test]
fn a_supply_outside_its_window_refuses_a_sample_only_if_that_is_asked_for() {
    for (volts, is_asked_for) in [(4.7, false), (5.3, false), (4.7, true)] {
        let mut model = NoiseModel::noiseless();
        model.channel_mut(OutputRegister::Supply).bias = volts;
        let bus = EmulatedBus::new(VirtualAdis16405::new(model, 1));
        let mut imu = driver(&bus);
        if is_asked_for {
            imu = imu.with_refused_faults(Faults::REFUSED | Faults::SUPPLY);
        }
        imu.start_up().unwrap();
        bus.wait_for_data();
        let faults = Faults::SUPPLY | Faults::ERROR_ALARM;
        let result = imu.read().map(|sample| sample.warnings());
        assert_eq!(result, if is_asked_for { Err(Error::Unusable(faults)) } else { Ok(faults) });
    }
}

/// A reset line that cannot be driven low, or not high again.
struct BrokenLine {
    low: Result<(), Broken>,
    high: Result<(), Broken>,
}

#[derive(Clone, Copy, Debug)]
struct Broken;

impl embedded_hal::digital::Error for Broken {
    fn kind(&self) -> embedded_hal::digital::ErrorKind {
        embedded_hal::digital::ErrorKind::Other
    }
}

impl ErrorType for BrokenLine {
    type Error = Broken;
}

impl OutputPin for BrokenLine {
    fn set_low(&mut self) -> Result<(), Broken> {
        self.low
    }

    fn set_high(&mut self) -> Result<(), Broken> {
        self.high
    }
}

#[test]
fn the_reset_line_revives_a_part_that_hears_no_command() {
    let bus = strict(1_000);
    let mut line = bus.reset_line();
    let period = SamplePeriod::nearest_millihz(204_800).unwrap();
    let config = Config::default().with_sample_period(period);
    let mut imu = Adis16405::new(bus.clone(), bus.delay(), config);
    imu.start_up().unwrap();
    imu.set_accl_offsets([1, 2, 3]).unwrap();
    imu.sleep(Sleep::Indefinite).unwrap();
    let before = bus.part().now();
    assert_eq!(imu.hardware_reset(&mut line), Ok(Product::Adis16405));
    // The reset takes 100 µs low, 170 ms of recovery, and some frames.
    let took_ns = bus.part().now() - before;
    assert!((170_100_000..172_000_000).contains(&took_ns), "{took_ns} ns");
    assert!(imu.is_ready());
    assert_eq!(imu.read_register(Register::SmplPrd), Ok(u16::from(period.register())), "configured again");
    assert_eq!(imu.accl_offsets(), Ok([0; 3]), "not in flash");
    bus.wait_for_data();
    assert!(imu.read().is_ok());
    assert_eq!(bus.part().violations(), []);

    let ready = poll_once(async {
        let mut imu = Adis16405::new_async(bus.clone(), bus.delay(), config);
        imu.hardware_reset(&mut line).await
    });
    assert_eq!(ready, Some(Ok(Product::Adis16405)));
    assert_eq!(bus.part().violations(), []);
}

#[test]
fn a_reset_that_fails_leaves_the_driver_not_ready() {
    for (low, high) in [(Err(Broken), Ok(())), (Ok(()), Err(Broken))] {
        let bus = strict(1_000);
        let mut imu = driver(&bus);
        imu.start_up().unwrap();
        let error: Error<Infallible> = imu.hardware_reset(&mut BrokenLine { low, high }).unwrap_err();
        assert_eq!(error, Error::Pin);
        assert_eq!(error.to_string(), "a pin of the controller failed");
        assert_eq!(imu.read(), Err(Error::NotReady));
        imu.init().unwrap();
        bus.wait_for_data();
        assert!(imu.read().is_ok());
    }
    // The pulse is too short for the part.
    let bus = strict(1_000);
    let mut imu = timed_driver(&bus, |timing| timing.reset_pulse_us = 9);
    imu.start_up().unwrap();
    imu.hardware_reset(&mut bus.reset_line()).unwrap();
    assert_eq!(bus.part().violations()[0].kind, ViolationKind::ResetPulse { low_ns: 9_000, least_ns: 10_000 });
}
