//! An emulated STM32F427, a superset of the STM32F405, with a crystal, a sensor and a terminal.

use crate::microcontroller::{Microcontroller, clear_bits, clear_in_memory, fill_memory_with_noise, read, write};
use crate::probe::Probe;
use crate::sensor::{Sensor, Terminal};
use emulation::{
    DBGMCU_APB1_FZ, EXTI_FTSR, EXTI_IMR, EXTI_RTSR, Event, FLASH_CR, FLASH_OPTCR, FLASH_SR, ODR, OSPEEDR, Outcome,
    PUPDR, SPI1_CR1, SPI1_CRCPR, SYSCFG_EXTICR, SYSCFG_MEMRMP, Scenario, Wiring, Work, gpio,
};
use rigless::cpu::armv7m as cpu;
use rigless::device::Level;
use rigless::emulator::{self, Driver, Host, Start, Stop};
use rigless::image::Image;
use rigless::machine::{Board, Target, armv7m};
use rigless::mcu::{Mcu, Operate};
use rigless::session::Session;
use rigless::snapshot::Store;
use rigless::soc::Error;
use rigless::soc::stm32f427::Stm32f427;
use rigless::soc::stm32f427::peripherals::{gpio::Pin, spi::Select};
use rigless::time::VirtualNanos;
use std::collections::{BTreeMap, VecDeque};
use std::num::{NonZeroU32, NonZeroU64};
use std::path::Path;

const CORE_HZ: NonZeroU64 = NonZeroU64::new(168_000_000).unwrap();
/// Instructions per second of a slow core.
const SLOW_HZ: NonZeroU64 = NonZeroU64::new(21_000_000).unwrap();
const SUPPLY_MV: u32 = 3300;
const CHIP_SELECT: u8 = 4; // PA4
const SPI1: usize = 0;
const TIM2: std::ops::Range<u64> = 0x4000_0000..0x4000_0400;
/// Reset register of the bus of TIM2, and the bit that holds it in reset (RM0090 section 6.3.8).
const RCC_APB1RSTR: u64 = 0x4002_3820;
const TIM2RST: u64 = 1;
/// Control register of the DMA stream that receives bursts, and its bit that enables the interrupt at the end of a
/// transfer (RM0090 section 10.5.5).
const DMA2_S0CR: u64 = 0x4002_6410;
const TCIE: u64 = 1 << 4;
/// The bit of that register that enables the stream.
const EN: u64 = 1;
/// Registers that a run returns in addition to those of the ports.
const CONFIGURATION: [u64; 12] = [
    FLASH_SR,
    FLASH_CR,
    FLASH_OPTCR,
    SPI1_CR1,
    SPI1_CRCPR,
    SYSCFG_EXTICR[0],
    SYSCFG_EXTICR[1],
    EXTI_IMR,
    EXTI_RTSR,
    EXTI_FTSR,
    DBGMCU_APB1_FZ,
    SYSCFG_MEMRMP,
];
/// Longest time that the emulator runs before it checks the sensor's clock and the events, ns.
const STRIDE_NS: u64 = 1_000_000;
/// Length of the data-ready pulse, ns.
const PULSE_NS: u64 = 100_000;

#[derive(Debug)]
struct Bench {
    microcontroller: Microcontroller,
    wiring: Wiring,
    instructions_per_second: NonZeroU64,
}

impl Store for Bench {}

impl Bench {
    fn new(scenario: &Scenario, sensor: Option<Sensor>, terminal: Terminal) -> Result<Self, Error> {
        let wiring = scenario.wiring;
        let mut part = Stm32f427::new()?;
        part.rcc.attach_crystals(wiring.crystal_hz, 0);
        part.set_supply(SUPPLY_MV);
        if let Some(sensor) = sensor {
            let select = Select { port: "GPIOA", pin: Pin::new(CHIP_SELECT).unwrap(), active: Level::Low };
            part.spi[SPI1].attach_selected(sensor, select);
        }
        part.usart[wiring.usart].attach(terminal);
        let instructions_per_second = if scenario.slow_core { SLOW_HZ } else { CORE_HZ };
        let mut microcontroller = Microcontroller::new(part)?;
        microcontroller.crystal_fails = scenario.crystal_fails;
        Ok(Self { microcontroller, wiring, instructions_per_second })
    }

    fn sensor(&mut self) -> Option<&mut Sensor> {
        self.microcontroller.part.spi[SPI1].chip_mut(0)
    }
}

impl Board for Bench {
    fn name(&self) -> &'static str {
        "observatory"
    }

    fn target_names(&self) -> Vec<&'static str> {
        vec!["stm32f427"]
    }

    fn mcu(&mut self, target: usize) -> Option<&mut dyn Mcu> {
        (target == 0).then_some(&mut self.microcontroller)
    }

    fn targets(&mut self) -> Vec<Target<'_>> {
        let interrupt_lines = u32::from(Operate::cpu(&self.microcontroller).interrupt_lines);
        let core = armv7m::Core {
            variant: armv7m::Variant::M4,
            clock_hz: CORE_HZ,
            interrupt_lines: NonZeroU32::new(interrupt_lines).unwrap(),
            priority_bits: 4,
            refclk_divider: NonZeroU32::new(8).unwrap(),
            instructions_per_second: self.instructions_per_second,
            boot: "flash",
        };
        let windows = cpu::windows(Mcu::bus(&self.microcontroller));
        let core = core.spec_with_parts(&windows, armv7m::Fpu::FpV4Sp, armv7m::MpuRegions::Eight);
        vec![Target::new("stm32f427", &mut self.microcontroller, core)]
    }
}

/// Runs the emulator up to each change of the sensor's data-ready line, and executes the events.
struct Plant {
    end: u64,
    /// Time in ns at which the data-ready pulse under way ends.
    pulse_end: Option<u64>,
    /// Number of the sensor's samples at the last stop.
    samples: u64,
    /// Number of data-ready edges still to be withheld from the processor.
    edges_to_lose: u64,
    /// Time in ns until which the data-ready line oscillates, and its level.
    oscillates_until: u64,
    oscillating_level: bool,
    /// Bits of the DMA stream's control register to be cleared within the next burst.
    burst_fault: u64,
    led_level: u64,
    led_changes: u32,
    registers: BTreeMap<u64, u64>,
    probe: Option<Probe>,
    events: VecDeque<(u64, Event)>,
    work: Vec<Work>,
}

impl Plant {
    fn next_stop(&self, bench: &mut Bench, now: u64) -> VirtualNanos {
        let ready = bench.sensor().map_or(u64::MAX, |sensor| sensor.part.next_data_ready());
        let next = ready.min(self.pulse_end.unwrap_or(u64::MAX)).min(now + STRIDE_NS).min(self.end);
        // Within a frame the sensor is one byte behind, so its next edge may lie in the past.
        VirtualNanos(next.max(now + 1_000))
    }

    fn carry_out(&mut self, event: Event, session: &mut Session<Bench>, stop: Stop, host: &mut dyn Host) {
        let Some(sensor) = session.board_mut().sensor() else { return };
        sensor.advance_to(stop.at.0);
        match event {
            Event::SensorReset => {
                sensor.part.select();
                sensor.part.transfer(0xBE80); // GLOB_CMD bit 7
                sensor.part.deselect();
            }
            Event::WriteRegister(frame) => {
                sensor.part.select();
                sensor.part.transfer(frame);
                sensor.part.deselect();
            }
            Event::SensorSleep => {
                sensor.part.select();
                sensor.part.transfer(0xBB01); // SLP_CNT bit 8
                sensor.part.deselect();
            }
            Event::Stuck(byte) => sensor.stuck_at = byte,
            Event::Oscillate(time_ns) => self.oscillates_until = stop.at.0 + time_ns,
            Event::LoseEdges(edges) => self.edges_to_lose = u64::from(edges),
            Event::Unplugged(out) => {
                sensor.stuck_at = out.then_some(0);
                self.edges_to_lose = if out { u64::MAX } else { 0 };
            }
            Event::ResetPin => session.reset_by_pin(stop.at, stop.instruction_count, host),
            Event::BrownOut => {
                fill_memory_with_noise(host);
                session.board_mut().microcontroller.brown_out = true;
                session.reset_by_pin(stop.at, stop.instruction_count, host);
            }
            Event::LoseBurstEnd => self.burst_fault = TCIE,
            Event::StopReceiving => self.burst_fault = EN,
            Event::ChangeRegister(address, value) => write(session, host, address, value),
            Event::StopCounter => write(session, host, RCC_APB1RSTR, TIM2RST),
            Event::BusError => session.fail_next(TIM2.start, TIM2.end),
            Event::ClearInMemory(value) => clear_in_memory(host, value),
        }
    }
}

impl Driver<Bench> for Plant {
    fn on_stop(&mut self, session: &mut Session<Bench>, stop: Stop, host: &mut dyn Host) -> Option<VirtualNanos> {
        let now = stop.at.0;
        let samples = self.samples;
        if self.work.last().is_none_or(|last| now >= last.at + 1_000_000_000) || now >= self.end {
            self.work.push(Work { at: now, instructions: stop.instruction_count, samples });
        }
        if let Some(probe) = &mut self.probe {
            probe.poll(host);
        }
        let (port, pin) = session.board_mut().wiring.led;
        let led_level = read(session, host, gpio(port, ODR)) >> pin & 1;
        self.led_changes += u32::from(std::mem::replace(&mut self.led_level, led_level) != led_level);
        if now >= self.end {
            let ports = (0..3).flat_map(|port| [gpio(port, OSPEEDR), gpio(port, PUPDR)]);
            for address in ports.chain(CONFIGURATION) {
                self.registers.insert(address, read(session, host, address));
            }
            return None;
        }
        // Events wait for the end of a frame, since some of them send the sensor a frame.
        let between_frames =
            |session: &mut Session<Bench>| session.board_mut().sensor().is_none_or(|sensor| !sensor.selected);
        while between_frames(session)
            && let Some((_, event)) = self.events.pop_front_if(|&mut (at, _)| now >= at)
        {
            self.carry_out(event, session, stop, host);
        }
        let pulse_ended = self.pulse_end.take_if(|end| now >= *end).is_some();
        if pulse_ended && self.burst_fault != 0 {
            // The burst is still under way, since it lasts longer than the pulse.
            clear_bits(session, host, DMA2_S0CR, std::mem::take(&mut self.burst_fault));
        }
        let bench = session.board_mut();
        let (port, pin) = bench.wiring.data_ready;
        if pulse_ended {
            bench.microcontroller.drive_pin(stop.at, port, pin, false);
        }
        let samples = bench.sensor().map_or(0, |sensor| {
            sensor.advance_to(now);
            sensor.part.samples()
        });
        if samples > self.samples {
            self.samples = samples;
            if self.edges_to_lose > 0 {
                self.edges_to_lose -= 1;
            } else {
                self.pulse_end = Some(now + PULSE_NS);
                bench.microcontroller.drive_pin(stop.at, port, pin, true);
            }
        }
        if now < self.oscillates_until {
            self.oscillating_level = !self.oscillating_level;
            bench.microcontroller.drive_pin(stop.at, port, pin, self.oscillating_level);
            return Some(VirtualNanos(now + 4_000));
        }
        Some(self.next_stop(bench, now))
    }
}

/// Boots the image and runs it.
pub(crate) fn run(image: &Path, scenario: Scenario) -> Outcome {
    let ns = |seconds: f64| (seconds * 1e9) as u64;
    let keys = scenario.keys.iter().flat_map(|(at, keys)| keys.iter().map(move |&key| (ns(*at), key)));
    let terminal = Terminal { keys: keys.collect(), ..Terminal::default() };
    let sensor = scenario.sensor.map(|sensor| Sensor::new(sensor.part()));
    let bench = Bench::new(&scenario, sensor, terminal).expect("the emulator knows the part");
    let plant = Plant {
        end: ns(scenario.seconds),
        pulse_end: None,
        samples: 0,
        edges_to_lose: 0,
        oscillates_until: 0,
        oscillating_level: false,
        burst_fault: 0,
        led_level: 0,
        led_changes: 0,
        registers: BTreeMap::new(),
        probe: scenario.probe.map(Probe::new),
        events: scenario.events.into_iter().map(|(at, event)| (ns(at), event)).collect(),
        work: Vec::new(),
    };
    let session = Session::new(Box::new(bench), 0, VirtualNanos(STRIDE_NS)).expect("the emulator takes the board");
    let images = [Image::read(image, None).expect("the image is an ELF")];
    let finished = emulator::run(session, &Start::new(&images), plant).expect("the emulator runs to the end");
    let Plant { work, led_changes, registers, probe, .. } = finished.driver;
    let log = probe.map_or_else(Vec::new, |probe| probe.lines(image));
    let mut session = finished.session;
    let diagnostics = diagnostics(&session);
    let part = &mut session.board_mut().microcontroller.part;
    let received =
        part.usart[scenario.wiring.usart].chip_mut::<Terminal>().map(|terminal| std::mem::take(&mut terminal.received));
    let sensor = part.spi[SPI1].chip_mut::<Sensor>(0).map(|sensor| sensor.record());
    Outcome { sensor, received: received.unwrap_or_default(), diagnostics, work, led_changes, registers, log }
}

fn diagnostics(session: &Session<Bench>) -> Vec<String> {
    let unmapped = session.unmapped().into_iter().map(|access| access.to_string());
    let refused = session.refused().iter().map(|(address, fault)| format!("refused {address:#x}: {fault:?}"));
    let unrouted = session.unrouted().iter().map(|line| format!("unrouted {line:?}"));
    let resets = session.resets().iter().map(|reset| format!("reset {reset:?}"));
    let reported = session.told().map(|told| format!("{} {}: {}", told.instance, told.register, told.reason));
    // SYSCFG routes pins to the interrupt controller, which `Microcontroller::drive_pin` does here.
    let unimplemented = session.unimplemented().values().filter(|register| register.instance != "SYSCFG");
    let unimplemented = unimplemented.map(|register| format!("no model for {register:?}"));
    unmapped.chain(refused).chain(unrouted).chain(resets).chain(reported).chain(unimplemented).collect()
}
