//! A simulated week of the device with a fault of every kind per day, and a shorter run with each fault once.
//!
//! No key is pressed after the start. The used samples are compared with those that the sensor delivered in good state,
//! and the coefficients with those of the same sensor without faults.

use embedded_hal::spi::SpiDevice;
use link::{ChannelMessage, Decoder, Health, Hello, Message, Received, ReportedCoefficient};
use simulation::{Device, FaultEnd, FrameFault};
use virtual_sensor::{NoiseModel, VirtualAdis16405};

const RATE_HZ: f64 = 204.8;
const SEED: u64 = 20;

/// A fault of the schedule.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Fault {
    /// A frame fault, for a time in s or until it ends by itself.
    Frames(FrameFault, FaultEnd, f64),
    /// A flag of DIAG_STAT, by its bit.
    Flag(u32),
    /// There are no data-ready edges for this time, s.
    NoDataReady(f64),
    /// The sensor resets itself.
    SensorReset,
    /// The sensor has no supply for this time, s.
    PowerOff(f64),
    /// The estimators' interrupt does not come until the watchdog restarts the device.
    StoppedEstimators,
    /// The serial port sends nothing for this time, s.
    StoppedPort(f64),
}

/// All faults, each once.
const FAULTS: [Fault; 22] = [
    Fault::Frames(FrameFault::Shifted, FaultEnd::Bursts(1), 1.0),
    Fault::Frames(FrameFault::ImpossibleRate, FaultEnd::Bursts(1), 1.0),
    Fault::Frames(FrameFault::Stale, FaultEnd::Bursts(5), 1.0),
    Fault::NoDataReady(0.015),
    Fault::Flag(0),
    Fault::Flag(1),
    Fault::Flag(2),
    Fault::Flag(3),
    Fault::Flag(4),
    Fault::Flag(5),
    Fault::Flag(6),
    Fault::Flag(8),
    Fault::Frames(FrameFault::LowSupply, FaultEnd::Never, 20.0),
    Fault::Frames(FrameFault::Frozen, FaultEnd::Reset, 20.0),
    Fault::Frames(FrameFault::Shifted, FaultEnd::Pulse, 10.0),
    Fault::Frames(FrameFault::Stale, FaultEnd::Reset, 10.0),
    Fault::Frames(FrameFault::Stuck { high: false }, FaultEnd::Never, 3.0),
    Fault::Frames(FrameFault::Stuck { high: true }, FaultEnd::Never, 3.0),
    Fault::NoDataReady(20.0),
    Fault::SensorReset,
    Fault::PowerOff(1.0),
    Fault::StoppedPort(5.0),
];

/// A device and the time up to which it has run.
struct Run {
    device: Device,
    now_s: f64,
}

/// Last report of a run.
struct Report {
    hello: Hello,
    health: Health,
    channels: Vec<ChannelMessage>,
}

impl Run {
    fn new() -> Self {
        // The random walk hides flicker noise of longer times.
        let model = NoiseModel { longest_tau_s: 300.0, ..NoiseModel::paper() };
        let part = VirtualAdis16405::new(model, SEED);
        let mut device = Device::new(part, Device::blank_memory()).with_restarts();
        device.press(b"i0\r");
        Self { device, now_s: 0.0 }
    }

    fn to(&mut self, until_s: f64) -> Vec<u8> {
        self.now_s = self.now_s.max(until_s);
        self.device.run_until((self.now_s * 1e6) as u64)
    }

    fn inflict(&mut self, fault: Fault) {
        let lasting = |run: &mut Self, seconds: f64| drop(run.to(run.now_s + seconds));
        match fault {
            Fault::Frames(fault, end, seconds) => {
                self.device.faults().frames = Some((fault, end));
                lasting(self, seconds);
                self.device.faults().frames = None;
            }
            Fault::Flag(bit) => self.device.faults().status |= 1 << bit,
            Fault::NoDataReady(seconds) => {
                self.device.faults().no_data_ready = true;
                lasting(self, seconds);
                self.device.faults().no_data_ready = false;
            }
            Fault::SensorReset => {
                let Ok(()) = self.device.bus().clone().write(&[0xBE, 0x80]);
            }
            Fault::PowerOff(seconds) => {
                self.device.bus().part_mut().power_off();
                lasting(self, seconds);
                self.device.bus().part_mut().power_on();
            }
            Fault::StoppedEstimators => {
                let restarts = self.device.restarts();
                self.device.faults().no_estimators = true;
                while self.device.restarts() == restarts {
                    lasting(self, 0.1);
                }
                self.device.faults().no_estimators = false;
            }
            Fault::StoppedPort(seconds) => {
                self.device.faults().no_transmission = true;
                lasting(self, seconds);
                self.device.faults().no_transmission = false;
            }
        }
    }

    /// Requests a report and waits for it.
    fn report(&mut self) -> Report {
        self.device.press(b"r");
        let bytes = self.to(self.now_s + 0.1);
        let (mut decoder, mut hello, mut health, mut channels) = (Decoder::new(), None, None, Vec::new());
        for received in bytes.into_iter().filter_map(|byte| decoder.push(byte)).filter_map(Received::message) {
            match received {
                Message::Hello(message) => hello = Some(message),
                Message::Health(message) => health = Some(message),
                Message::Channel(message) => channels.push(message),
                _ => {}
            }
        }
        let (hello, health) = (hello.expect("a report"), health.expect("a report"));
        assert!(hello.sampling, "{hello:?}");
        Report { hello, health, channels }
    }

    /// Number of samples that the sensor delivered in good state.
    fn usable(&self) -> f64 {
        self.device.usable_us() as f64 * 1e-6 * RATE_HZ
    }
}

/// Prints and returns the fraction of the good samples that are in the statistics. Every damaged burst counts as used.
fn share_used(run: &Run, report: &Report) -> f64 {
    let damaged = run.device.faults().damaged;
    let used = report.channels.iter().map(|channel| channel.samples).min().expect("channels");
    let share = (used - damaged) as f64 / run.usable();
    println!("{used} samples used, {damaged} bursts damaged, {:.0} good: {:.4} %", run.usable(), 100.0 * share);
    println!("{:?}", report.health);
    share
}

/// No counter is near its maximum, and the counters of bursts and samples are consistent.
fn assert_counters(report: &Report) {
    let health = &report.health;
    let largest = [health.bursts, health.used, health.error_alarm, health.lost_edges, health.repeated];
    assert!(largest.into_iter().all(|counter| counter < u32::MAX / 2), "{health:?}");
    assert!(health.used <= health.bursts, "{health:?}");
    assert!(health.partly_used <= health.used && health.marked <= health.used, "{health:?}");
    for channel in &report.channels {
        assert!(channel.lost + channel.refused <= channel.missing, "{channel:?}");
    }
}

/// Every coefficient agrees with that of the sensor without faults: their 95 % bounds overlap.
fn assert_coefficients(report: &Report, undisturbed: &Report) {
    for (found, expected) in report.channels.iter().zip(&undisturbed.channels) {
        for (found, expected) in found.coefficients.iter().zip(&expected.coefficients) {
            let bounds = |term: &ReportedCoefficient| (term.low, term.value, term.high);
            println!("{:?}: {:?}, without faults {:?}", found.term, bounds(found), bounds(expected));
            assert!(found.low <= expected.high && expected.low <= found.high, "{found:?}, {expected:?}");
        }
    }
}

/// Twenty minutes with each fault once. A loss costs at most 1.5 s: 0.3 s of start-up, a probe, and up to a second before the next step.
#[test]
fn twenty_minutes_with_every_fault_once() {
    let (mut run, mut twin) = (Run::new(), Run::new());
    for (at, fault) in FAULTS.into_iter().enumerate() {
        run.to(20.0 + 50.0 * at as f64);
        let before = run.usable();
        let samples = run.report().channels[0].samples;
        run.inflict(fault);
        run.to(run.now_s + 25.0);
        let lost = run.usable() - before - (run.report().channels[0].samples - samples) as f64;
        println!("{fault:?}: {:.2} s of good samples lost", lost / RATE_HZ);
        assert!(lost < 1.5 * RATE_HZ, "{fault:?}");
    }
    run.inflict(Fault::StoppedEstimators);
    run.to(1200.0);
    let report = run.report();
    assert_eq!((report.hello.boot.starts, run.device.restarts()), (2, 1));
    assert!(share_used(&run, &report) > 0.99);
    assert_counters(&report);
    twin.to(1200.0);
    assert_coefficients(&report, &twin.report());
}

/// A week at 204.8 samples a second: 124 million samples.
#[test]
#[ignore = "long: a simulated week takes minutes; run with --long"]
fn a_week_with_every_fault_every_day() {
    const DAY_S: f64 = 86_400.0;
    let twin = std::thread::spawn(|| {
        let mut twin = Run::new();
        twin.to(7.0 * DAY_S);
        twin.report()
    });
    let mut run = Run::new();
    for day in 0..7 {
        let start_s = f64::from(day) * DAY_S;
        for (at, fault) in FAULTS.into_iter().enumerate() {
            run.to(start_s + 3_600.0 * (at as f64 + 0.5));
            run.inflict(fault);
        }
        run.to(start_s + 22.7 * 3_600.0);
        // The watchdog, or the last step of recovery, restarts the device every other day.
        run.inflict(if day % 2 == 0 { Fault::StoppedEstimators } else { Fault::NoDataReady(60.0) });
        run.to(start_s + DAY_S);
        let report = run.report();
        assert!(share_used(&run, &report) > 0.999, "day {day}");
        assert_counters(&report);
        assert_eq!(run.device.restarts(), day + 1);
    }
    let report = run.report();
    let starts = report.hello.boot.starts;
    assert_eq!((starts, report.hello.boot.restored_channels), (8, 8));
    assert_coefficients(&report, &twin.join().expect("the sensor without faults"));
}
