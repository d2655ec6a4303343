//! The image for a Raspberry Pi Pico (RP2040).
//!
//! | pin | signal | at the sensor |
//! |---|---|---|
//! | GP17 | chip select, active low | CS |
//! | GP18, GP16, GP19 | SPI0 SCK, MISO, MOSI, mode 3 | SCLK, DOUT, DIN |
//! | GP20 | data ready, rising edge | DIO1 |
//! | GP0, GP1 | UART0 TX, RX, 460 800 Bd 8N1 | to the host |
//!
//! The sensor runs from 5 V. The RP2040's pins take 3.3 V: the sensor's outputs need a divider or level shifter if they
//! rise above that.
#![no_std]
#![no_main]

mod boot;
mod bus;
mod chip;
mod port;

use defmt_rtt as _;

/// The second stage of the boot loader, for the Pico's flash.
#[unsafe(link_section = ".boot2")]
#[unsafe(no_mangle)]
#[used]
static BOOT2_FIRMWARE: [u8; 256] = rp2040_boot2::BOOT_LOADER_W25Q080;

#[rtic::app(device = rp2040_hal::pac, peripherals = true)]
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
    use rp2040_hal::clocks::{Clock, init_clocks_and_plls};
    use rp2040_hal::fugit::RateExtU32;
    use rp2040_hal::gpio::{self, FunctionSioInput, PullDown, bank0::Gpio20};
    use rp2040_hal::{Sio, Spi, Watchdog, pac, spi, uart};

    const CRYSTAL_HZ: u32 = 12_000_000;
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
        edge: gpio::Pin<Gpio20, FunctionSioInput, PullDown>,
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
        let mut resets = device.RESETS;
        let boot = boot::report(&device.VREG_AND_CHIP_RESET, &device.WATCHDOG);
        let retained = boot::retained(boot.cause);
        let mut watchdog = Watchdog::new(device.WATCHDOG);
        let Ok(clocks) = init_clocks_and_plls(
            CRYSTAL_HZ,
            device.XOSC,
            device.CLOCKS,
            device.PLL_SYS,
            device.PLL_USB,
            &mut resets,
            &mut watchdog,
        ) else {
            panic!("clocks out of reach");
        };
        let sio = Sio::new(device.SIO);
        let pins = gpio::Pins::new(device.IO_BANK0, device.PADS_BANK0, sio.gpio_bank0, &mut resets);

        let core_hz = clocks.system_clock.freq().to_Hz();
        let chip = Microcontroller::start(device.TIMER, watchdog, &mut core, core_hz, &mut resets, &clocks);
        let uptime = Uptime::new(Microcontroller::counter());

        let line = uart::UartConfig::new(BAUD.Hz(), uart::DataBits::Eight, None, uart::StopBits::One);
        let lines = (pins.gpio0.into_function(), pins.gpio1.into_function());
        let serial = uart::UartPeripheral::new(device.UART0, lines, &mut resets)
            .enable(line, clocks.peripheral_clock.freq())
            .expect("a baud rate within reach");
        let (to_port, outgoing) = context.local.outgoing.split();
        let (incoming, received) = context.local.incoming.split();
        let port = Port::new(serial, outgoing, incoming);

        let peripheral = clocks.peripheral_clock.freq();
        let wires = (pins.gpio19.into_function(), pins.gpio16.into_function(), pins.gpio18.into_function());
        let spi = Spi::<_, _, _, 8>::new(device.SPI0, wires);
        let request = spi_clock::BURST_LIMIT_HZ.Hz();
        let spi = spi.init(&mut resets, peripheral, request, spi::FrameFormat::MotorolaSpi(embedded_hal::spi::MODE_3));
        let select = pins.gpio17.into_push_pull_output_in_state(gpio::PinState::High);
        let bus = Bus::new(spi, select, device.DMA, &mut resets);
        let spi_clock_hz = bus.clock_hz(peripheral.to_Hz());
        assert!(spi_clock_hz <= spi_clock::BURST_LIMIT_HZ, "serial clock above the burst limit");

        let edge = pins.gpio20.into_pull_down_input();
        edge.set_interrupt_enabled(gpio::Interrupt::EdgeHigh, true);

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
        (shared, Local { edge, arrivals, port, chip, received, start })
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
    #[task(binds = IO_IRQ_BANK0, priority = 3, local = [edge], shared = [uptime, bus, sampler])]
    fn data_ready(context: data_ready::Context) {
        measure(&SAMPLING_CYCLES, || {
            let data_ready::SharedResources { uptime, bus, sampler, .. } = context.shared;
            context.local.edge.clear_interrupt(gpio::Interrupt::EdgeHigh);
            (uptime, bus, sampler).lock(|uptime, bus, sampler| {
                if sampler.edge(uptime.at(Microcontroller::counter())) {
                    bus.start_burst();
                }
            });
        });
    }

    /// The burst is over.
    #[task(binds = DMA_IRQ_0, priority = 3, shared = [bus, sampler])]
    fn burst_read(context: burst_read::Context) {
        measure(&SAMPLING_CYCLES, || {
            let burst_read::SharedResources { bus, sampler, .. } = context.shared;
            (bus, sampler).lock(|bus, sampler| sampler.burst(bus.end_burst()));
        });
        rtic::pend(pac::Interrupt::SW0_IRQ);
    }

    /// An interrupt without a peripheral is the estimators' turn.
    #[task(binds = SW0_IRQ, priority = 2, local = [arrivals], shared = [estimators, outbox])]
    fn estimators(context: estimators::Context) {
        measure(&ESTIMATOR_CYCLES, || {
            let estimators::SharedResources { estimators, outbox, .. } = context.shared;
            (estimators, outbox).lock(|estimators, outbox| estimate(estimators, outbox, context.local.arrivals));
        });
        rtic::pend(pac::Interrupt::UART0_IRQ);
    }

    /// Above the sampling: it empties and fills queues of 32 bytes.
    #[task(binds = UART0_IRQ, priority = 4, local = [port])]
    fn port(context: port::Context) {
        context.local.port.serve();
    }

    /// Ten times a second, so that the main loop goes round without a sensor too.
    #[task(binds = SysTick, priority = 1)]
    fn wake(_: wake::Context) {}
}
