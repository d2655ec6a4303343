//! The image on an emulated STM32F427 with a crystal, a sensor and a terminal.

use crate::exti::Exti;
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
use rigless::soc::stm32f427::peripherals::{gpio::Pin, spi::Select};
use rigless::soc::{Bus, Error};
use rigless::time::VirtualNanos;
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
        Ok(Self { microcontroller: Microcontroller { part, exti: Exti::default(), exti_slot } })
    }

    fn sensor(&mut self) -> Option<&mut Sensor> {
        self.microcontroller.part.spi[SPI1].chip_mut(0)
    }

    fn drive_data_ready(&mut self, at: VirtualNanos, high: bool) {
        let Microcontroller { part, exti, exti_slot } = &mut self.microcontroller;
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

/// Runs the emulator in stretches that end where the sensor's data-ready line changes.
struct Plant {
    end: u64,
    /// When the pulse under way ends.
    falls: Option<u64>,
    /// Samples that the data-ready line has announced.
    samples: u64,
}

impl Plant {
    fn next_stop(&self, bench: &mut Bench, now: u64) -> VirtualNanos {
        let ready = bench.sensor().map_or(u64::MAX, |sensor| sensor.part.next_data_ready());
        let next = ready.min(self.falls.unwrap_or(u64::MAX)).min(now + STRIDE_NS).min(self.end);
        VirtualNanos(next.max(now + 1))
    }
}

impl Driver<Bench> for Plant {
    fn on_stop(&mut self, session: &mut Session<Bench>, stop: Stop, _host: &mut dyn Host) -> Option<VirtualNanos> {
        let now = stop.at.0;
        if now >= self.end {
            return None;
        }
        let bench = session.board_mut();
        if self.falls.is_some_and(|falls| now >= falls) {
            self.falls = None;
            bench.drive_data_ready(stop.at, false);
        }
        let samples = bench.sensor().map_or(0, |sensor| {
            sensor.part.advance_to(now);
            sensor.part.samples()
        });
        if samples > self.samples {
            self.samples = samples;
            self.falls = Some(now + PULSE_NS);
            bench.drive_data_ready(stop.at, true);
        }
        Some(self.next_stop(bench, now))
    }
}

/// What a run leaves to look at.
pub(crate) struct Outcome {
    pub(crate) sensor: Option<Sensor>,
    pub(crate) received: Vec<(u64, u8)>,
    /// What the emulator found wrong with the image: accesses to nothing, registers without a model, resets.
    pub(crate) complaints: Vec<String>,
}

/// Boots the image and runs it for `seconds`, pressing `keys` at their times in ns.
pub(crate) fn run(image: &Path, sensor: Option<Sensor>, keys: &[(u64, u8)], seconds: u64) -> Outcome {
    let terminal = Terminal { keys: keys.iter().copied().collect(), ..Terminal::default() };
    let bench = Bench::new(sensor, terminal).expect("the emulator knows the part");
    let plant = Plant { end: seconds * 1_000_000_000, falls: None, samples: 0 };
    let session = Session::new(Box::new(bench), 0, VirtualNanos(STRIDE_NS)).expect("the emulator takes the board");
    let images = [Image::read(image, None).expect("the image is an ELF")];
    let finished = emulator::run(session, &Start::new(&images), plant).expect("the emulator runs to the end");
    let mut session = finished.session;
    let complaints = complaints(&session);
    let part = &mut session.board_mut().microcontroller.part;
    let received = part.usart[USART2].chip_mut::<Terminal>().map(|terminal| std::mem::take(&mut terminal.received));
    let sensor = part.spi[SPI1].chip_mut::<Sensor>(0).cloned();
    Outcome { sensor, received: received.unwrap_or_default(), complaints }
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
