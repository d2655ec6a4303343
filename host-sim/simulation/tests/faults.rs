//! The firmware's application on the host with faults of the sensor, the bus, the board and its own tasks. Each is
//! detected, reported by its cause, counted, recovered from, and costs no more samples than stated.

use adis16405_driver::{BURST_BYTES, BURST_REQUEST};
use embedded_hal::spi::SpiDevice;
use link::{BootCause, Decoder, Health, Hello, Message, Received};
use simulation::{Device, FaultEnd, FrameFault};
use virtual_sensor::{NoiseModel, ViolationKind, VirtualAdis16405};

const SECOND: u64 = 1_000_000;
const RATE_HZ: f64 = 204.8;

fn part() -> VirtualAdis16405 {
    VirtualAdis16405::new(NoiseModel::paper(), 1)
}

fn device() -> Device {
    let mut device = Device::new(part(), Device::blank_memory()).with_restarts();
    device.press(b"i0\r");
    device
}

/// Messages of a device.
#[derive(Default)]
struct Heard {
    logs: Vec<String>,
    lines: Vec<String>,
    hello: Option<Hello>,
    health: Option<Health>,
    /// Number of channels with coefficients.
    fitted: usize,
}

/// Sends `keys`, runs for `seconds`, and requests a report.
fn report_after(device: &mut Device, keys: &str, seconds: f64) -> Heard {
    device.press(keys.as_bytes());
    let now_us = device.bus().part().now() / 1000;
    let mut bytes = device.run_until(now_us + (seconds * 1e6) as u64);
    device.press(b"r");
    let now_us = device.bus().part().now() / 1000;
    bytes.extend(device.run_until(now_us + 2000));
    let (mut decoder, mut heard) = (Decoder::new(), Heard::default());
    for received in bytes.into_iter().filter_map(|byte| decoder.push(byte)) {
        match received {
            Received::Message { message: Message::Log(text), .. } => heard.logs.push(text.as_str().to_owned()),
            Received::Message { message: Message::Hello(hello), .. } => heard.hello = Some(hello),
            Received::Message { message: Message::Health(health), .. } => heard.health = Some(health),
            Received::Message { message: Message::Channel(report), .. } => {
                heard.fitted += usize::from(!report.coefficients.is_empty());
            }
            Received::Message { .. } => {}
            Received::Text(line) => heard.lines.push(line.as_str().to_owned()),
        }
    }
    heard
}

/// A part answers wrongly at the usual times of the bus. The fifth step switches to longer times, and the log says so.
#[test]
fn a_part_that_needs_longer_times_gets_them() {
    let mut device = device();
    device.run_until(2 * SECOND);
    device.faults().frames = Some((FrameFault::Shifted, FaultEnd::SlowBus));
    let heard = report_after(&mut device, "", 10.0);
    let steps: Vec<&String> = heard.logs.iter().filter(|line| line.contains("unusable bursts: ")).collect();
    assert_eq!(steps.len(), 5, "{:#?}", heard.logs);
    assert!(steps[4].ends_with("slow timing of the bus"), "{}", steps[4]);
    let health = heard.health.expect("a report");
    assert_eq!(
        (health.recoveries, health.rereads, health.bus_resets, health.sensor_resets),
        (1, 1, 2, 2),
        "{health:?}"
    );
    assert!(f64::from(health_after(&mut device, 2.0).used - health.used) > 1.9 * RATE_HZ, "samples flow");
    assert_eq!(device.restarts(), 0);
}

fn health_after(device: &mut Device, seconds: f64) -> Health {
    report_after(device, "", seconds).health.expect("a report")
}

/// DIAG_STAT keeps its flags until it is read. Each flag is read once, counted by its cause, logged, and costs no
/// sample.
#[test]
fn a_latched_error_flag_is_read_and_told_by_its_cause() {
    type Counter = fn(&Health) -> u32;
    let causes: [(u32, &str, Counter); 8] = [
        (0, "supply_low", |health| health.diag_supply_low),
        (1, "supply_high", |health| health.diag_supply_high),
        (2, "flash_update", |health| health.diag_flash_update),
        (3, "spi", |health| health.diag_spi),
        (4, "over_range", |health| health.diag_over_range),
        (6, "flash_checksum", |health| health.diag_flash_checksum),
        (9, "alarm", |health| health.diag_alarm),
        (12, "self_test", |health| health.diag_self_test),
    ];
    let mut device = device();
    let before = health_after(&mut device, 2.0);
    assert_eq!((before.diag_reads, before.marked), (0, 0), "{before:?}");
    for (reads, (bit, name, counter)) in (1..).zip(causes) {
        device.faults().status = 1 << bit;
        let heard = report_after(&mut device, "", 5.0);
        let health = heard.health.expect("a report");
        assert_eq!((counter(&health), health.diag_reads), (1, reads), "{name}: {health:?}");
        assert_eq!((health.used, health.lost_edges, health.recoveries), (health.bursts, 0, 0), "{name}: {health:?}");
        assert_eq!((health.marked, health.error_alarm), (reads, reads), "one burst of each flag: {health:?}");
        assert!(heard.logs.iter().any(|log| log.ends_with(name)), "{name}: {:?}", heard.logs);
    }
    assert_eq!(device.bus().part().violations(), []);
}

/// A frame of eight clocks sets the sensor's SPI flag.
#[test]
fn a_flag_of_the_sensor_itself_is_read() {
    for keys in ["", "f 819.2\r"] {
        let mut device = device();
        report_after(&mut device, keys, 2.0);
        {
            let mut part = device.bus().part_mut();
            part.select();
            part.transfer_byte(0);
            part.deselect();
        }
        let health = health_after(&mut device, 2.0);
        assert_eq!((health.diag_spi, health.used, health.lost_edges), (1, health.bursts, 0), "{health:?}");
    }
}

/// The supply is 4.70 V, as from a USB port. Every sample is used and marked, and the coefficients are reported. The
/// register is read once a second.
#[test]
fn a_board_on_a_weak_usb_port_reports_coefficients() {
    for (keys, rate_hz) in [("", RATE_HZ), ("f 819.2\r", 819.2)] {
        let mut device = device();
        device.faults().frames = Some((FrameFault::LowSupply, FaultEnd::Never));
        let heard = report_after(&mut device, keys, 20.0);
        let health = heard.health.expect("a report");
        assert!(f64::from(health.used) > 19.5 * rate_hz, "{health:?}");
        assert_eq!((health.used, health.marked, health.lost_edges), (health.bursts, health.bursts, 0), "{health:?}");
        assert!((19..=20).contains(&health.diag_supply_low), "{health:?}");
        assert_eq!((heard.fitted, health.recoveries), (6, 0));
        assert_eq!(heard.logs.iter().filter(|log| log.contains("DIAG_STAT 0x0001 supply_low")).count(), 1);
        assert_eq!(device.bus().part().violations(), []);
    }
}

/// The first step that removes a fault of every burst ends it, and each step is counted.
#[test]
fn the_first_step_that_helps_ends_a_fault() {
    let cases = [
        // The columns are fault, end, re-reads, bus resets, sensor resets.
        (FrameFault::Shifted, FaultEnd::Bursts(16), [1, 0, 0]),
        (FrameFault::Shifted, FaultEnd::Pulse, [1, 1, 0]),
        (FrameFault::Stale, FaultEnd::Reset, [1, 1, 1]),
        (FrameFault::Frozen, FaultEnd::Reset, [1, 1, 1]),
        (FrameFault::Stuck { high: false }, FaultEnd::Reset, [1, 1, 1]),
        (FrameFault::Stuck { high: true }, FaultEnd::Pulse, [1, 1, 0]),
    ];
    for (fault, end, steps) in cases {
        let mut device = device();
        health_after(&mut device, 5.0);
        device.faults().frames = Some((fault, end));
        let heard = report_after(&mut device, "", 20.0);
        let health = heard.health.expect("a report");
        assert_eq!([health.rereads, health.bus_resets, health.sensor_resets], steps, "{fault:?}: {health:?}");
        assert!(health.recoveries >= 1 && device.restarts() == 0, "{fault:?}: {health:?}");
        let before = health.used;
        let used = health_after(&mut device, 10.0).used - before;
        assert!(f64::from(used) > 9.95 * RATE_HZ, "{fault:?}: {used} samples in 10 s");
        assert!(heard.logs.iter().any(|log| log.ends_with("probing it")), "{:?}", heard.logs);
    }
}

/// If the RST line is connected, its step follows the software reset.
#[test]
fn a_sensor_that_takes_no_command_is_reset_by_its_line() {
    let mut device = device().with_reset_line();
    health_after(&mut device, 5.0);
    device.faults().frames = Some((FrameFault::Stuck { high: true }, FaultEnd::ResetLine));
    let health = health_after(&mut device, 10.0);
    let steps = [health.rereads, health.bus_resets, health.sensor_resets, health.reset_lines];
    assert_eq!(steps, [1, 1, 1, 1], "{health:?}");
    let used = health_after(&mut device, 10.0).used - health.used;
    assert!(f64::from(used) > 9.95 * RATE_HZ, "{used} samples in 10 s");
    assert_eq!(device.restarts(), 0);
}

/// A single refused burst, or a rate that one gyro cannot measure, causes no recovery step.
#[test]
fn a_refused_burst_costs_that_burst() {
    for (fault, refused, partly) in [(FrameFault::Shifted, 1, 0), (FrameFault::ImpossibleRate, 0, 1)] {
        let mut device = device();
        health_after(&mut device, 5.0);
        device.faults().frames = Some((fault, FaultEnd::Bursts(1)));
        let health = health_after(&mut device, 5.0);
        assert_eq!((health.bursts - health.used, health.partly_used), (refused, partly), "{health:?}");
        assert_eq!((health.lost_edges, health.recoveries, health.rereads), (0, 0, 0), "{health:?}");
    }
}

/// While DIO1 is off every probe succeeds. This counts as one loss, not one per second, and the steps rise.
#[test]
fn an_interrupted_data_ready_line_is_one_loss() {
    let mut device = device();
    health_after(&mut device, 5.0);
    device.faults().no_data_ready = true;
    let heard = report_after(&mut device, "", 20.0);
    let health = heard.health.expect("a report");
    assert_eq!(health.recoveries, 1, "{health:?}");
    assert!(health.rereads == 1 && health.bus_resets >= 4 && health.sensor_resets >= 8, "{health:?}");
    assert_eq!(device.restarts(), 0);
    device.faults().no_data_ready = false;
    let used = health_after(&mut device, 10.0).used - health.used;
    // The next step comes within a second, and takes half a second if it resets the sensor.
    assert!(f64::from(used) > 8.4 * RATE_HZ, "{used} samples in 10 s");
}

/// An oscillating line would leave the processor no time. It is masked after 16 edges, again at each step of recovery, and reported.
/// Sampling goes on when the oscillation has ended.
#[test]
fn an_oscillating_data_ready_line_is_masked_and_told() {
    let mut device = device();
    let before = health_after(&mut device, 5.0);
    let edges_before = device.edges();
    device.faults().oscillates = true;
    let heard = report_after(&mut device, "", 10.0);
    let health = heard.health.expect("a report");
    let edges = device.edges() - edges_before;
    // There are ten steps of recovery, one a second, and each accepts edges again.
    assert!((8..=12).contains(&health.data_ready_masked), "{health:?}");
    assert!(edges <= 16 * u64::from(health.data_ready_masked) + 16, "{edges} interrupts");
    assert!(
        heard.logs.iter().any(|log| log.contains("the data-ready line oscillates and is masked")),
        "{:?}",
        heard.logs
    );
    assert_eq!((health.recoveries, device.restarts()), (1, 0), "{health:?}");
    device.faults().oscillates = false;
    let used = health_after(&mut device, 10.0).used - health.used;
    assert!(f64::from(used) > 8.3 * RATE_HZ, "{used} samples in 10 s, {} before", before.used);
}

/// After 30 failed steps the microcontroller is restarted, once, with its statistics.
#[test]
fn after_thirty_failed_steps_the_microcontroller_is_restarted_once() {
    let mut device = device();
    let used = health_after(&mut device, 5.0).used;
    device.faults().no_data_ready = true;
    let heard = report_after(&mut device, "", 120.0);
    assert_eq!(device.restarts(), 1);
    let hello = heard.hello.expect("a report");
    assert_eq!((hello.boot.cause, hello.boot.starts, hello.boot.restored_channels), (BootCause::Software, 2, 8));
    assert!(heard.logs.iter().any(|log| log.ends_with("restarting the microcontroller")), "{:?}", heard.logs);
    device.faults().no_data_ready = false;
    let after = health_after(&mut device, 10.0).used;
    assert!(f64::from(after) > 8.4 * RATE_HZ, "{after} samples in 10 s, {used} before");
}

/// A sensor that was never present causes no restart.
#[test]
fn an_absent_sensor_does_not_restart_the_microcontroller() {
    let mut absent = part();
    absent.power_off();
    let mut device = Device::new(absent, Device::blank_memory()).with_restarts();
    device.press(b"i0\r");
    let heard = report_after(&mut device, "", 120.0);
    assert_eq!(device.restarts(), 0);
    assert_eq!(heard.health.expect("a report").recoveries, 0);
    assert!(heard.logs.len() < 20, "{} logs", heard.logs.len());
    device.bus().part_mut().power_on();
    assert!(f64::from(health_after(&mut device, 10.0).used) > 8.2 * RATE_HZ);
}

/// A stopped task is detected although the main loop runs: the watchdog is not fed and restarts the microcontroller.
#[test]
fn a_stopped_task_is_ended_by_the_watchdog() {
    for estimators in [true, false] {
        let mut device = device();
        report_after(&mut device, "i 1\r", 5.0);
        device.faults().no_estimators = estimators;
        device.faults().no_transmission = !estimators;
        let now_us = device.bus().part().now() / 1000;
        // A stop is detected within 2 s or 10 s, and then the watchdog takes 8 s.
        let limit_s = if estimators { 11 } else { 20 };
        device.run_until(now_us + limit_s * SECOND);
        assert_eq!(device.restarts(), 1, "estimators: {estimators}");
        *device.faults() = simulation::InjectedFaults::default();
        let heard = report_after(&mut device, "", 5.0);
        assert_eq!(heard.hello.expect("a report").boot.cause, BootCause::Watchdog);
        assert_eq!(device.restarts(), 1);
    }
}

/// After power-on the sensor takes 220 to 290 ms, and is not clocked in this time.
#[test]
fn a_cold_sensor_is_not_clocked() {
    let mut cold = part();
    cold.power_off();
    cold.power_on();
    for cause in [BootCause::PowerOn, BootCause::BrownOut, BootCause::Unknown] {
        let mut device = Device::started_by(cause, cold.clone(), Device::blank_memory());
        device.press(b"i0\r");
        let health = health_after(&mut device, 3.0);
        assert_eq!(device.bus().part().violations(), [], "{cause:?}");
        // The start takes 290 ms, and the self-test 48 ms at this rate.
        let sampled_s = f64::from(health.used + health.settling) / RATE_HZ;
        assert!((2.57..2.7).contains(&sampled_s), "{cause:?}: {health:?}");
    }
}

/// A dip of the supply restarts the sensor. It is not clocked while it starts up, then it is configured again.
#[test]
fn a_sensor_that_lost_its_supply_is_not_clocked_while_it_starts() {
    let mut device = device();
    let before = health_after(&mut device, 5.0);
    device.bus().part_mut().power_off();
    device.bus().part_mut().power_on();
    let health = health_after(&mut device, 5.0);
    let busy = |violation: &virtual_sensor::Violation| matches!(violation.kind, ViolationKind::Busy { .. });
    assert!(!device.bus().part().violations().iter().any(busy), "{:?}", device.bus().part().violations());
    assert_eq!(health.recoveries, 1);
    assert!(f64::from(health.used - before.used) > 4.5 * RATE_HZ, "{health:?}");
}

/// Below 182 SPS the sensor needs 300 kHz and a stall of 75 µs. The clock changes with the rate, in both directions.
#[test]
fn slow_rates_are_sampled_with_a_slow_clock() {
    let mut device = device();
    let cases = [("f 163.84\r", 163.84, 300_000), ("f 50\r", 1638.4 / 33.0, 300_000), ("f 819.2\r", 819.2, 1_000_000)];
    for (reads, (keys, rate_hz, clock_hz)) in (1..).zip(cases) {
        let heard = report_after(&mut device, keys, 20.0);
        let (hello, health) = (heard.hello.expect("a report"), heard.health.expect("a report"));
        assert!((hello.sample_rate_hz / rate_hz - 1.0).abs() < 1e-6, "{hello:?}");
        assert_eq!(hello.spi_clock_hz, clock_hz);
        assert_eq!(health.used, health.bursts);
        let sampled = health.used + health.settling;
        assert!((f64::from(sampled) / (20.0 * rate_hz) - 1.0).abs() < 0.03, "{health:?}");
        device.faults().status = 1;
        assert_eq!(health_after(&mut device, 2.0).diag_supply_low, reads);
    }
    assert_eq!(device.bus().part().violations(), []);
}

/// The injector damages a burst as stated, and does nothing without a fault.
#[test]
fn the_injector_damages_what_it_says() {
    let mut device = device();
    health_after(&mut device, 1.0);
    let burst = |device: &Device| {
        let mut answer = [0; BURST_BYTES];
        let Ok(()) = device.bus().clone().transfer(&mut answer, &BURST_REQUEST);
        answer
    };
    assert!(burst(&device)[2..].iter().step_by(2).all(|byte| byte & 0x40 == 0));
    device.faults().frames = Some((FrameFault::Shifted, FaultEnd::Bursts(3)));
    let health = health_after(&mut device, 1.0);
    assert_eq!((health.shifted, device.faults().frames), (3, None), "{health:?}");
}
