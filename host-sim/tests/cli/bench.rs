//! `bench` on the simulated device: everything passes on a sound one, and each deliberate fault is named.

use ::host_sim::bench::{self, BenchPlan, Cause, Check, Console};
use link::{Decoder, DecoderCounters, Received};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use simulation::{Device, FaultEnd, FrameFault, LineFault, RandomFault};
use std::collections::VecDeque;
use std::io;
use system_tests::generated;
use virtual_sensor::{NoiseModel, OutputRegister, VirtualAdis16405};

/// Time of the device between two looks at what it has sent, µs.
const STEP_US: u64 = 5_000;

/// A plan that takes a device half a minute.
const SHORT: BenchPlan = BenchPlan { reads: 20_000, noise_s: 4.0, bursts_s: 5.0 };

/// A device whose time goes on while it is listened to.
struct VirtualConsole {
    device: Device,
    now_us: u64,
    decoder: Decoder,
    received: VecDeque<Received>,
    /// Probability with which a byte is lost on the serial port.
    loss: f64,
    random: ChaCha8Rng,
    /// The data line is interrupted for some bursts while they are counted.
    is_loose: bool,
    /// Raw streams so far.
    streams: u32,
    /// The second port loses every message of this number.
    second_loses: Option<usize>,
    second: Vec<Received>,
}

impl VirtualConsole {
    fn new(part: VirtualAdis16405) -> Self {
        let device = Device::new(part, Device::blank_memory()).with_restarts();
        Self::with_device(device)
    }

    fn with_device(device: Device) -> Self {
        Self {
            device,
            now_us: 0,
            decoder: Decoder::new(),
            received: VecDeque::new(),
            loss: 0.0,
            random: ChaCha8Rng::seed_from_u64(1),
            is_loose: false,
            streams: 0,
            second_loses: None,
            second: Vec::new(),
        }
    }

    fn run(&mut self, plan: &BenchPlan) -> Vec<Check> {
        // Behind the first probe.
        self.now_us = 500_000;
        self.device.run_until(self.now_us);
        let transcript = bench::run(self, plan, |_, _, _| {}).expect("a port that does not fail");
        let checks = bench::checks(&transcript);
        let mut table = Vec::new();
        bench::write_table(&checks, &mut table).expect("memory");
        println!("{}", String::from_utf8(table).expect("text"));
        checks
    }
}

impl Console for VirtualConsole {
    fn send(&mut self, command: &str) -> io::Result<()> {
        self.device.press(format!("{command}\r").as_bytes());
        self.streams += u32::from(command == "w 1");
        // The third stream is that of the bursts that are counted.
        if self.streams == 3 && std::mem::take(&mut self.is_loose) {
            self.device.faults().frames = Some((FrameFault::Stuck { high: true }, FaultEnd::Bursts(8)));
        }
        Ok(())
    }

    fn now_s(&self) -> f64 {
        self.now_us as f64 * 1e-6
    }

    fn next(&mut self, until_s: f64) -> io::Result<Option<Received>> {
        while self.received.is_empty() && self.now_s() < until_s {
            // Requests to the sensor take time on its bus.
            self.now_us = self.now_us.max(self.device.bus().part().now() / 1000) + STEP_US;
            let sent = self.device.run_until(self.now_us);
            let kept = sent.into_iter().filter(|_| self.loss == 0.0 || !self.random.random_bool(self.loss));
            self.received.extend(kept.filter_map(|byte| self.decoder.push(byte)));
        }
        let received = self.received.pop_front();
        self.second.extend(received.clone());
        Ok(received)
    }

    fn counters(&self) -> DecoderCounters {
        self.decoder.counters()
    }

    fn second_port(&mut self) -> Option<Vec<Received>> {
        let every = self.second_loses?;
        let mut heard = std::mem::take(&mut self.second);
        let mut number = 0;
        heard.retain(|_| {
            number += 1;
            number % every != 0
        });
        Some(heard)
    }
}

fn part() -> VirtualAdis16405 {
    VirtualAdis16405::new(NoiseModel::paper(), 7)
}

/// A part of another model.
fn part_with(change: impl FnOnce(&mut NoiseModel)) -> VirtualAdis16405 {
    let mut model = NoiseModel::paper();
    change(&mut model);
    VirtualAdis16405::new(model, 7)
}

fn faulty(fault: FrameFault) -> VirtualConsole {
    let console = VirtualConsole::new(part());
    console.device.faults().frames = Some((fault, FaultEnd::Never));
    console
}

fn random(fault: LineFault, probability: f64) -> VirtualConsole {
    let console = VirtualConsole::new(part());
    console.device.faults().random = Some(RandomFault::new(fault, probability, 3));
    console
}

#[test]
fn a_sound_device_passes_every_check() {
    let mut console = VirtualConsole::new(part());
    console.second_loses = Some(usize::MAX);
    let checks = console.run(&SHORT);
    assert!(checks.len() >= 20, "{}", checks.len());
    for check in &checks {
        assert!(check.cause.is_none() && !check.measured.is_empty(), "{check:?}");
    }
    assert_eq!(console.device.bus().part().violations(), []);
}

/// The settings are those of before.
#[test]
fn the_bench_leaves_the_settings_as_they_were() {
    let mut console = VirtualConsole::new(part());
    console.device.press(b"f 102.4\rg 150\rn 3\r");
    console.run(&SHORT);
    console.send("s").expect("a port");
    let until_s = console.now_s() + 1.0;
    let mut lines = Vec::new();
    while let Some(received) = console.next(until_s).expect("a port") {
        if let Received::Text(line) = received {
            lines.push(line.as_str().to_owned());
        }
    }
    assert!(lines.iter().any(|line| line.starts_with("rate 102.4") && line.ends_with("SENS_AVG 0x0203")), "{lines:?}");
}

/// A deliberate fault, and the cause that is named first.
fn faults() -> Vec<(&'static str, VirtualConsole, Cause)> {
    let mut unpowered = part();
    unpowered.power_off();
    let mut other = part();
    other.set_prod_id(16350);
    let mut broken = part();
    broken.break_sensor(OutputRegister::GyroY);
    // A part from the factory has written its flash before.
    let mut written = part();
    written.select();
    written.transfer(0xBE08);
    written.deselect();
    written.advance_to(200_000_000);
    let deaf = VirtualConsole::new(written);
    deaf.device.faults().frames = Some((FrameFault::Requests(0), FaultEnd::Never));
    let no_edges = VirtualConsole::new(part());
    no_edges.device.faults().no_data_ready = true;
    let floating = VirtualConsole::new(part());
    floating.device.faults().oscillates = true;
    let mut lossy = VirtualConsole::new(part());
    lossy.loss = 1e-4;
    let mut loose = VirtualConsole::new(part());
    loose.is_loose = true;
    let mut two_ports = VirtualConsole::new(part());
    two_ports.second_loses = Some(20);
    let supply = |volts| part_with(|model| model.channel_mut(OutputRegister::Supply).bias = volts);
    let shaken = part_with(|model| model.channel_mut(OutputRegister::GyroZ).angle_random_walk *= 4.0);
    let tilted = part_with(|model| model.channel_mut(OutputRegister::AcclZ).bias = -0.6);
    let fast = VirtualConsole::with_device(Device::new(part(), Device::blank_memory()).with_fixed_clock(2_000_000));
    vec![
        ("no 5 V", VirtualConsole::new(unpowered), Cause::NoSupply),
        ("DOUT open, pulled low", faulty(FrameFault::Stuck { high: false }), Cause::DataLow),
        ("CS open, DOUT pulled high", faulty(FrameFault::Stuck { high: true }), Cause::DataHigh),
        ("wrong SPI mode", faulty(FrameFault::Late), Cause::SpiMode),
        ("DIN open", deaf, Cause::RequestsLost),
        ("bit stuck", faulty(FrameFault::StuckBit { bit: 0, high: false }), Cause::StuckBits(1)),
        ("another sensor", VirtualConsole::new(other), Cause::OtherProduct(16350)),
        ("divider in DOUT", faulty(FrameFault::OnesLost(501)), Cause::OnesLost),
        ("crosstalk on DOUT", random(LineFault::AnswerBits, 1e-4), Cause::BitErrors),
        ("bit of DIN stuck", faulty(FrameFault::Requests(0xFFFE)), Cause::WritesDamaged(0x0101)),
        ("SCK too fast", fast, Cause::SckTooFast),
        ("DIO1 on another pin", no_edges, Cause::NoDataReady),
        ("DIO1 open and oscillating", floating, Cause::DataReadyFloats),
        ("DIO1 with a bad contact", random(LineFault::LostEdge, 0.02), Cause::EdgesLost),
        ("DIO1 rings", random(LineFault::DoubledEdge, 0.02), Cause::EdgesAdded),
        ("SCLK rings", random(LineFault::ExtraClock, 0.01), Cause::ClockEdges),
        ("loose wire of DOUT", loose, Cause::LooseData),
        ("VCC on 3.3 V", VirtualConsole::new(supply(3.3)), Cause::SupplyLow(3_300)),
        ("a supply of 4.6 V", VirtualConsole::new(supply(4.6)), Cause::SupplyLow(4_600)),
        ("gyro y broken", VirtualConsole::new(broken), Cause::SelfTest(String::new())),
        ("sensor frozen", faulty(FrameFault::Frozen), Cause::Frozen),
        ("old data", faulty(FrameFault::Stale), Cause::NothingNew),
        ("vibration", VirtualConsole::new(shaken), Cause::TooNoisy),
        ("scale wrong", VirtualConsole::new(tilted), Cause::Moving),
        ("serial wires too long", lossy, Cause::LinkLoss),
        ("USB loses bytes", two_ports, Cause::PortsDiffer),
    ]
}

/// The same but for what the cause quotes.
fn is_same(one: &Cause, other: &Cause) -> bool {
    match (one, other) {
        (Cause::SupplyLow(a), Cause::SupplyLow(b)) => a.abs_diff(*b) < 20,
        (Cause::SelfTest(sensors), Cause::SelfTest(_)) => sensors.contains("gyro_y"),
        _ => one == other,
    }
}

#[test]
fn each_deliberate_fault_is_named_in_the_docs() {
    let mut wrong = Vec::new();
    let mut table = "| fault | what `bench` says first |\n|---|---|\n".to_owned();
    for (name, mut console, expected) in faults() {
        println!("{name}");
        let checks = console.run(&SHORT);
        let causes: Vec<&Cause> = checks.iter().filter_map(|check| check.cause.as_ref()).collect();
        match causes.first() {
            Some(first) if is_same(first, &expected) => table += &format!("| {name} | {first} |\n"),
            _ => wrong.push(format!("{name}: {causes:?}")),
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    generated("docs/bench.md", "faults", &table);
}
