//! The image on an emulated STM32F427 with a crystal, a sensor and a terminal.

use crate::exti::Exti;
use crate::memory;
use crate::sensor::Sensor;
use crate::terminal::Terminal;
use rigless::cpu::armv7m as cpu;
use rigless::device::{ErasedDevice, Level, ResetCause};
use rigless::emulator::{self, Driver, Host, Start, Stop};
use rigless::image::Image;
use rigless::machine::{Board, Target, armv7m};
use rigless::mcu::{Mcu, Operate};
use rigless::session::Session;
use rigless::snapshot::Store;
use rigless::soc::stm32f427::Stm32f427;
use rigless::soc::stm32f427::generated::rcc;
use rigless::soc::stm32f427::peripherals::{gpio::Pin, spi::Select};
use rigless::soc::{Bus, Error};
use rigless::time::VirtualNanos;
use std::collections::VecDeque;
use std::num::{NonZeroU32, NonZeroU64};
use std::path::Path;

const CRYSTAL_HZ: u64 = 8_000_000;
const CORE_HZ: NonZeroU64 = NonZeroU64::new(168_000_000).unwrap();
const SUPPLY_MV: u32 = 3300;
const CHIP_SELECT: u8 = 4; // PA4
const DATA_READY: u8 = 0; // PB0
const PORT_B: usize = 1;
const SPI1: usize = 0;
const USART2: usize = 1;
const TIM2: std::ops::Range<u64> = 0x4000_0000..0x4000_0400;
/// Control register of the stream that receives bursts, and its bit that has the end raise an interrupt (RM0090 section
/// 10.5.5).
const DMA2_S0CR: u64 = 0x4002_6410;
const TCIE: u64 = 1 << 4;
/// Longest stretch that the emulator runs without looking at the sensor's clock and the keys.
const STRIDE_NS: u64 = 1_000_000;
/// Length of the data-ready pulse.
const PULSE_NS: u64 = 100_000;

/// The part, with the external interrupt controller that the emulator lacks.
#[derive(Debug)]
struct Microcontroller {
    part: Stm32f427,
    exti: Exti,
    exti_slot: usize,
    rcc_slot: usize,
    /// The next reset is one by the supply, which the emulator does not model.
    browning_out: bool,
}

impl Mcu for Microcontroller {
    fn bus(&self) -> &Bus {
        self.part.bus()
    }

    fn bus_mut(&mut self) -> &mut Bus {
        self.part.bus_mut()
    }

    fn reset(&mut self, at: VirtualNanos, cause: ResetCause) {
        self.part.reset(at, cause);
        self.exti = Exti::default();
        if std::mem::take(&mut self.browning_out) {
            let (registers, _) = self.part.bus_mut().drive(at, self.rcc_slot);
            let flags = registers.get(rcc::Register::Csr);
            registers.set(rcc::Register::Csr, rcc::csr::BORRSTF.set(flags, 1));
        }
    }

    fn poll(&mut self, now: VirtualNanos) {
        self.part.poll(now);
    }

    fn split(&mut self, slot: usize) -> (&mut Bus, Option<&mut dyn ErasedDevice>) {
        if slot == self.exti_slot {
            return (self.part.bus_mut(), Some(&mut self.exti));
        }
        self.part.split(slot)
    }
}

#[derive(Debug)]
struct Bench {
    microcontroller: Microcontroller,
}

impl Store for Bench {}

impl Bench {
    fn new(sensor: Option<Sensor>, terminal: Terminal) -> Result<Self, Error> {
        let mut part = Stm32f427::new()?;
        part.rcc.attach_crystals(CRYSTAL_HZ, 0);
        part.set_supply(SUPPLY_MV);
        if let Some(sensor) = sensor {
            let select = Select { port: "GPIOA", pin: Pin::new(CHIP_SELECT).unwrap(), active: Level::Low };
            part.spi[SPI1].attach_selected(sensor, select);
        }
        part.usart[USART2].attach(terminal);
        let exti_slot = part.bus().slot("EXTI")?;
        let rcc_slot = part.bus().slot("RCC")?;
        let microcontroller = Microcontroller { part, exti: Exti::default(), exti_slot, rcc_slot, browning_out: false };
        Ok(Self { microcontroller })
    }

    fn sensor(&mut self) -> Option<&mut Sensor> {
        self.microcontroller.part.spi[SPI1].chip_mut(0)
    }

    fn drive_data_ready(&mut self, at: VirtualNanos, high: bool) {
        let Microcontroller { part, exti, exti_slot, .. } = &mut self.microcontroller;
        let level = if high { Level::High } else { Level::Low };
        part.drive_port(at, PORT_B, |port, registers, context| {
            port.drive(Pin::new(DATA_READY).unwrap(), Some(level), registers, context);
        });
        let (registers, mut context) = part.bus_mut().drive(at, *exti_slot);
        exti.drive(usize::from(DATA_READY), high, registers, &mut context);
    }
}

impl Board for Bench {
    fn name(&self) -> &'static str {
        "observatory-f405"
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
            instructions_per_second: CORE_HZ,
            boot: "flash",
        };
        let windows = cpu::windows(Mcu::bus(&self.microcontroller));
        let core = core.spec_with_parts(&windows, armv7m::Fpu::FpV4Sp, armv7m::MpuRegions::Eight);
        vec![Target::new("stm32f427", &mut self.microcontroller, core)]
    }
}

/// What happens to the device during a run.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Event {
    /// The part resets itself, as after a dip of its supply.
    PartReset,
    /// The data line to the processor is held at this byte, or let go.
    Stuck(Option<u8>),
    /// So many of the next data-ready edges do not reach the processor.
    LoseEdges(u32),
    /// The plug is pulled: no edges, and zeros on the data line; or put back.
    Unplugged(bool),
    /// The reset pin is pulsed.
    ResetPin,
    /// The supply dips: memory loses what it held, and the part restarts.
    BrownOut,
    /// The end of the next burst raises no interrupt, as if a bit of the DMA's control register had flipped.
    LoseBurstEnd,
    /// The next access to the timer is answered with a bus error.
    BusError,
    /// Every word pair of memory that holds this value becomes 0.
    Lose(u64),
}

/// Runs the emulator in stretches that end where the sensor's data-ready line changes.
struct Plant {
    end: u64,
    /// When the pulse under way ends.
    falls: Option<u64>,
    /// Samples that the data-ready line has announced.
    samples: u64,
    /// Edges still to be swallowed.
    swallow: u64,
    lose_burst_end: bool,
    events: VecDeque<(u64, Event)>,
    work: Vec<Work>,
}

/// How many instructions were executed by a time in ns.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Work {
    pub(crate) at: u64,
    pub(crate) instructions: u64,
    pub(crate) samples: u64,
}

impl Plant {
    fn next_stop(&self, bench: &mut Bench, now: u64) -> VirtualNanos {
        let ready = bench.sensor().map_or(u64::MAX, |sensor| sensor.part.next_data_ready());
        let next = ready.min(self.falls.unwrap_or(u64::MAX)).min(now + STRIDE_NS).min(self.end);
        // Within a frame the part is a byte behind.
        VirtualNanos(next.max(now + 1_000))
    }

    fn happen(&mut self, event: Event, session: &mut Session<Bench>, stop: Stop, host: &mut dyn Host) {
        let Some(sensor) = session.board_mut().sensor() else { return };
        match event {
            Event::PartReset => {
                sensor.part.select();
                sensor.part.transfer(0xBE80); // GLOB_CMD bit 7
                sensor.part.deselect();
            }
            Event::Stuck(byte) => sensor.stuck = byte,
            Event::LoseEdges(edges) => self.swallow = u64::from(edges),
            Event::Unplugged(out) => {
                sensor.stuck = out.then_some(0);
                self.swallow = if out { u64::MAX } else { 0 };
            }
            Event::ResetPin => session.reset_by_pin(stop.at, stop.instruction_count, host),
            Event::BrownOut => {
                memory::fill_with_noise(host);
                session.board_mut().microcontroller.browning_out = true;
                session.reset_by_pin(stop.at, stop.instruction_count, host);
            }
            Event::LoseBurstEnd => self.lose_burst_end = true,
            Event::BusError => session.fail_next(TIM2.start, TIM2.end),
            Event::Lose(value) => memory::lose(host, value),
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
        if now >= self.end {
            return None;
        }
        // Between frames: what happens to the part must not mix with what it is being sent.
        let between = |session: &mut Session<Bench>| session.board_mut().sensor().is_none_or(|sensor| !sensor.selected);
        while between(session)
            && let Some((_, event)) = self.events.pop_front_if(|&mut (at, _)| now >= at)
        {
            self.happen(event, session, stop, host);
        }
        let fallen = self.falls.take_if(|falls| now >= *falls).is_some();
        if fallen && std::mem::take(&mut self.lose_burst_end) {
            // The pulse is shorter than a burst.
            memory::clear_bits(session, host, DMA2_S0CR, TCIE);
        }
        let bench = session.board_mut();
        if fallen {
            bench.drive_data_ready(stop.at, false);
        }
        let samples = bench.sensor().map_or(0, |sensor| {
            sensor.advance_to(now);
            sensor.part.samples()
        });
        if samples > self.samples {
            self.samples = samples;
            if self.swallow > 0 {
                self.swallow -= 1;
            } else {
                self.falls = Some(now + PULSE_NS);
                bench.drive_data_ready(stop.at, true);
            }
        }
        Some(self.next_stop(bench, now))
    }
}

/// What is done with the image.
#[derive(Default)]
pub(crate) struct Scenario {
    pub(crate) sensor: Option<Sensor>,
    /// Keys that are pressed, by rising time in s.
    pub(crate) keys: Vec<(f64, Vec<u8>)>,
    /// What happens, by rising time in s.
    pub(crate) events: Vec<(f64, Event)>,
    pub(crate) seconds: f64,
}

/// What a run leaves to look at.
pub(crate) struct Outcome {
    pub(crate) sensor: Option<Sensor>,
    pub(crate) received: Vec<(u64, u8)>,
    /// What the emulator found wrong with the image: accesses to nothing, registers without a model, resets.
    pub(crate) complaints: Vec<String>,
    /// Once a virtual second, and at the end.
    pub(crate) work: Vec<Work>,
}

/// Boots the image and runs it.
pub(crate) fn run(image: &Path, scenario: Scenario) -> Outcome {
    let ns = |seconds: f64| (seconds * 1e9) as u64;
    let keys = scenario.keys.iter().flat_map(|(at, keys)| keys.iter().map(move |&key| (ns(*at), key)));
    let terminal = Terminal { keys: keys.collect(), ..Terminal::default() };
    let bench = Bench::new(scenario.sensor, terminal).expect("the emulator knows the part");
    let plant = Plant {
        end: ns(scenario.seconds),
        falls: None,
        samples: 0,
        swallow: 0,
        lose_burst_end: false,
        events: scenario.events.into_iter().map(|(at, event)| (ns(at), event)).collect(),
        work: Vec::new(),
    };
    let session = Session::new(Box::new(bench), 0, VirtualNanos(STRIDE_NS)).expect("the emulator takes the board");
    let images = [Image::read(image, None).expect("the image is an ELF")];
    let finished = emulator::run(session, &Start::new(&images), plant).expect("the emulator runs to the end");
    let (mut session, work) = (finished.session, finished.driver.work);
    let complaints = complaints(&session);
    let part = &mut session.board_mut().microcontroller.part;
    let received = part.usart[USART2].chip_mut::<Terminal>().map(|terminal| std::mem::take(&mut terminal.received));
    let sensor = part.spi[SPI1].chip_mut::<Sensor>(0).cloned();
    Outcome { sensor, received: received.unwrap_or_default(), complaints, work }
}

fn complaints(session: &Session<Bench>) -> Vec<String> {
    let unmapped = session.unmapped().into_iter().map(|access| access.to_string());
    let refused = session.refused().iter().map(|(address, fault)| format!("refused {address:#x}: {fault:?}"));
    let unrouted = session.unrouted().iter().map(|line| format!("unrouted {line:?}"));
    let resets = session.resets().iter().map(|reset| format!("reset {reset:?}"));
    let told = session.told().map(|told| format!("{} {}: {}", told.instance, told.register, told.reason));
    // The pins' way to the interrupt controller is what the bench drives by itself.
    let unimplemented = session.unimplemented().values().filter(|register| register.instance != "SYSCFG");
    let unimplemented = unimplemented.map(|register| format!("no model for {register:?}"));
    unmapped.chain(refused).chain(unrouted).chain(resets).chain(told).chain(unimplemented).collect()
}
