//! The image for an STM32F405 or STM32F427 with an 8 MHz crystal (Olimex STM32-H405 and the like).
//!
//! | pin | signal | at the sensor |
//! |---|---|---|
//! | PA4 | chip select, active low | CS |
//! | PA5, PA6, PA7 | SPI1 SCK, MISO, MOSI, mode 3 | SCLK, DOUT, DIN |
//! | PB0 | data ready, rising edge | DIO1 |
//! | PA2, PA3 | USART2 TX, RX, 460 800 Bd 8N1 | to the host |
//!
//! The sensor runs from 5 V, its outputs are read by 5 V tolerant pins and its inputs take 3.3 V.
#![no_std]
#![no_main]

mod boot;
mod bus;
mod chip;
mod port;

use defmt_rtt as _;

#[rtic::app(device = stm32f4xx_hal::pac, peripherals = true)]
mod app {
    use crate::boot;
    use crate::bus::Bus;
    use crate::chip::{ESTIMATOR_CYCLES, Microcontroller, SAMPLING_CYCLES, measure};
    use crate::port::{Incoming, Port};
    use firmware::{
        Arrival, Arrivals, CHANNELS, Estimator, Estimators, FIRST_CONFIG, Locks, Outbox, Outgoing, Sampler, Start,
        Uptime, estimate, run, spi_clock,
    };
    use heapless::spsc::Consumer;
    use stm32f4xx_hal::gpio::{Edge, ExtiPin, Input, PB0, PinState};
    use stm32f4xx_hal::{pac, prelude::*, rcc, serial, spi};

    const CRYSTAL_HZ: u32 = 8_000_000;
    const CORE_HZ: u32 = 168_000_000;
    const SPI_BUS_HZ: u32 = 84_000_000;
    const BAUD: u32 = 460_800;

    #[shared]
    struct Shared {
        uptime: Uptime,
        bus: Bus,
        sampler: Sampler<'static>,
        estimators: Estimators<'static>,
        outbox: Outbox<'static>,
    }

    #[local]
    struct Local {
        data_ready: PB0<Input>,
        arrivals: Consumer<'static, Arrival>,
        port: Port,
        chip: Microcontroller,
        received: Consumer<'static, u8>,
        start: Option<Start>,
    }

    #[init(local = [
        queue: Arrivals = Arrivals::new(),
        cascades: [Estimator; CHANNELS.len()] = [const { Estimator::new() }; CHANNELS.len()],
        outgoing: Outgoing = Outgoing::new(),
        incoming: Incoming = Incoming::new(),
    ])]
    fn init(context: init::Context) -> (Shared, Local) {
        let (device, mut core) = (context.device, context.core);
        let boot = boot::report(&device.RCC);
        let retained = boot::retained(boot.cause);
        let clocks = rcc::Config::hse(CRYSTAL_HZ.Hz()).sysclk(CORE_HZ.Hz()).pclk1(42.MHz()).pclk2(SPI_BUS_HZ.Hz());
        let mut rcc = device.RCC.freeze(clocks);
        let gpioa = device.GPIOA.split(&mut rcc);
        let gpiob = device.GPIOB.split(&mut rcc);

        let chip = Microcontroller::start(device.TIM2, device.IWDG, &mut core, &mut rcc);
        let uptime = Uptime::new(Microcontroller::counter());

        let line = serial::Config::default().baudrate(BAUD.bps());
        let usart = device.USART2.serial((gpioa.pa2, gpioa.pa3), line, &mut rcc).expect("a baud rate within reach");
        let (to_port, outgoing) = context.local.outgoing.split();
        let (incoming, received) = context.local.incoming.split();
        let port = Port::new(usart, outgoing, incoming);

        let request = spi_clock::fastest_at_most(rcc.clocks.pclk2().raw(), spi_clock::BURST_LIMIT_HZ)
            .expect("a prescaler for the burst limit");
        let mode = spi::Mode { polarity: spi::Polarity::IdleHigh, phase: spi::Phase::CaptureOnSecondTransition };
        let pins = (Some(gpioa.pa5), Some(gpioa.pa6), Some(gpioa.pa7));
        let spi = device.SPI1.spi(pins, mode, request.Hz(), &mut rcc);
        let select = gpioa.pa4.into_push_pull_output_in_state(PinState::High);
        let bus = Bus::new(spi, select, device.DMA2, &mut rcc);
        let spi_clock_hz = bus.clock_hz(rcc.clocks.pclk2().raw());
        assert!(spi_clock_hz <= spi_clock::BURST_LIMIT_HZ, "serial clock above the burst limit");

        let mut data_ready = gpiob.pb0.into_pull_down_input();
        data_ready.make_interrupt_source(&mut device.SYSCFG.constrain(&mut rcc));
        let mut exti = device.EXTI;
        data_ready.trigger_on_edge(&mut exti, Edge::Rising);
        data_ready.enable_interrupt(&mut exti);

        defmt::info!("SCK {=u32} Hz", spi_clock_hz);
        let (producer, arrivals) = context.local.queue.split();
        let shared = Shared {
            uptime,
            bus,
            sampler: Sampler::new(producer),
            estimators: Estimators::new(context.local.cascades, FIRST_CONFIG),
            outbox: Outbox::new(to_port),
        };
        let start = Some(Start { spi_clock_hz, boot, retained });
        (shared, Local { data_ready, arrivals, port, chip, received, start })
    }

    #[idle(local = [chip, received, start], shared = [uptime, bus, sampler, estimators, outbox])]
    fn idle(context: idle::Context) -> ! {
        let shared = context.shared;
        let locks = Locks {
            uptime: shared.uptime,
            bus: shared.bus,
            sampler: shared.sampler,
            estimators: shared.estimators,
            outbox: shared.outbox,
        };
        let start = context.local.start.take().expect("the main loop starts once");
        run(context.local.chip, locks, context.local.received, start)
    }

    /// A new sample: the burst begins, and goes on by itself.
    #[task(binds = EXTI0, priority = 3, local = [data_ready], shared = [uptime, bus, sampler])]
    fn data_ready(context: data_ready::Context) {
        measure(&SAMPLING_CYCLES, || {
            let data_ready::SharedResources { uptime, bus, sampler, .. } = context.shared;
            context.local.data_ready.clear_interrupt_pending_bit();
            (uptime, bus, sampler).lock(|uptime, bus, sampler| {
                if sampler.edge(uptime.at(Microcontroller::counter())) {
                    bus.start_burst();
                }
            });
        });
    }

    /// The burst is over.
    #[task(binds = DMA2_STREAM0, priority = 3, shared = [bus, sampler])]
    fn burst_read(context: burst_read::Context) {
        measure(&SAMPLING_CYCLES, || {
            let burst_read::SharedResources { bus, sampler, .. } = context.shared;
            (bus, sampler).lock(|bus, sampler| sampler.burst(bus.end_burst()));
        });
        rtic::pend(pac::Interrupt::CAN1_TX);
    }

    /// CAN is not used: its interrupt is the estimators' turn.
    #[task(binds = CAN1_TX, priority = 2, local = [arrivals], shared = [estimators, outbox])]
    fn estimators(context: estimators::Context) {
        measure(&ESTIMATOR_CYCLES, || {
            let estimators::SharedResources { estimators, outbox, .. } = context.shared;
            (estimators, outbox).lock(|estimators, outbox| estimate(estimators, outbox, context.local.arrivals));
        });
        rtic::pend(pac::Interrupt::USART2);
    }

    /// Above the sampling: a handful of instructions, and a byte waits no longer than 21 µs.
    #[task(binds = USART2, priority = 4, local = [port])]
    fn port(context: port::Context) {
        context.local.port.serve();
    }

    /// Ten times a second, so that the main loop goes round without a sensor too.
    #[task(binds = SysTick, priority = 1)]
    fn wake(_: wake::Context) {}
}
