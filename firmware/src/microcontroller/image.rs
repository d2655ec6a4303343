//! The image: the application's parts in the interrupts of a board.

/// Makes an image of a board file.
///
/// `start` takes the peripherals of `device` and the [`Line`](crate::microcontroller::Line) and returns the
/// [`Parts`](crate::microcontroller::Parts), of these types. The interrupts are those of the data-ready edge, of the end
/// of a burst, of the serial port, and one without a peripheral for the estimators.
///
/// | priority | interrupt |
/// |---|---|
/// | 4 | the serial port: a handful of instructions, so that no byte is lost |
/// | 3 | data ready, end of a burst |
/// | 2 | the estimators |
/// | 1 | SysTick, which only wakes |
/// | 0 | the main loop: commands, fit, report |
#[macro_export]
macro_rules! observatory {
    (
        device: $($device:ident)::+;
        start: $start:ident;
        microcontroller: $microcontroller:ty;
        data_ready: $data_ready:ty, $edge:ident;
        bus: $bus:ty, $burst_end:ident;
        port: $port:ty, $serial:ident;
        estimators: $free:ident;
    ) => {
        #[rtic::app(device = $($device)::+, peripherals = true)]
        mod app {
            use super::*;
            use $($device)::+::Interrupt;
            use heapless::spsc::Consumer;
            use $crate::spi_clock::BURST_LIMIT_HZ;
            use $crate::microcontroller::{
                Bus as _, DataReady as _, ESTIMATOR_CYCLES, Incoming, Line, Microcontroller, Parts, Port as _, Processor,
                SAMPLING_CYCLES, count_lost_bytes, measure, survivors,
            };
            use $crate::{
                Arrival, Arrivals, Epoch, Estimators, FIRST_CONFIG, Locks, Outbox, Outgoing, Sampler, Start, Statistics,
                Uptime, estimate, run,
            };

            #[shared]
            struct Shared {
                uptime: Uptime,
                bus: $bus,
                sampler: Sampler<'static>,
                estimators: Estimators<'static>,
                outbox: Outbox<'static>,
            }

            #[local]
            struct Local {
                data_ready: $data_ready,
                arrivals: Consumer<'static, Arrival>,
                port: $port,
                processor: Processor<$microcontroller>,
                received: Consumer<'static, u8>,
                start: Option<Start>,
            }

            #[init(local = [
                queue: Arrivals = Arrivals::new(),
                statistics: Statistics = Statistics::new(),
                finished: Epoch = Epoch::EMPTY,
                outgoing: Outgoing = Outgoing::new(),
                incoming: Incoming = Incoming::new(),
            ])]
            fn init(context: init::Context) -> (Shared, Local) {
                let (to_port, outgoing) = context.local.outgoing.split();
                let (incoming, received) = context.local.incoming.split();
                let (to_estimators, arrivals) = context.local.queue.split();
                let Parts { cause, core_hz, spi_clock_hz, microcontroller, data_ready, bus, port } =
                    $start(context.device, Line { outgoing, incoming });
                assert!(spi_clock_hz <= BURST_LIMIT_HZ, "serial clock above the burst limit");
                defmt::info!("{=u32} Hz, SCK {=u32} Hz", core_hz, spi_clock_hz);
                let transmit = || rtic::pend(Interrupt::$serial);
                let processor = Processor::new(microcontroller, core_hz, context.core.SYST, transmit);
                let (boot, retained) = survivors::recall(cause);
                let shared = Shared {
                    uptime: Uptime::new(<$microcontroller>::counter()),
                    bus,
                    sampler: Sampler::new(to_estimators),
                    estimators: Estimators::new(context.local.statistics, FIRST_CONFIG),
                    outbox: Outbox::new(to_port),
                };
                let start = Some(Start { spi_clock_hz, boot, retained, finished: context.local.finished });
                (shared, Local { data_ready, arrivals, port, processor, received, start })
            }

            #[idle(local = [processor, received, start], shared = [uptime, bus, sampler, estimators, outbox])]
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
                run(context.local.processor, locks, context.local.received, start)
            }

            /// A new sample: the burst begins, and goes on by itself.
            #[task(binds = $edge, priority = 3, local = [data_ready], shared = [uptime, bus, sampler])]
            fn data_ready(context: data_ready::Context) {
                measure(&SAMPLING_CYCLES, || {
                    let data_ready::SharedResources { uptime, bus, sampler, .. } = context.shared;
                    context.local.data_ready.clear();
                    (uptime, bus, sampler).lock(|uptime, bus, sampler| {
                        if sampler.edge(uptime.at(<$microcontroller>::counter())) {
                            bus.start_burst();
                        }
                    });
                });
            }

            /// The burst is over.
            #[task(binds = $burst_end, priority = 3, shared = [bus, sampler])]
            fn burst_read(context: burst_read::Context) {
                measure(&SAMPLING_CYCLES, || {
                    let burst_read::SharedResources { bus, sampler, .. } = context.shared;
                    (bus, sampler).lock(|bus, sampler| sampler.burst(bus.end_burst()));
                });
                rtic::pend(Interrupt::$free);
            }

            #[task(binds = $free, priority = 2, local = [arrivals], shared = [estimators, outbox])]
            fn estimators(context: estimators::Context) {
                measure(&ESTIMATOR_CYCLES, || {
                    let estimators::SharedResources { estimators, outbox, .. } = context.shared;
                    (estimators, outbox).lock(|estimators, outbox| estimate(estimators, outbox, context.local.arrivals));
                });
                rtic::pend(Interrupt::$serial);
            }

            #[task(binds = $serial, priority = 4, local = [port])]
            fn port(context: port::Context) {
                count_lost_bytes(context.local.port.serve());
            }

            #[task(binds = SysTick, priority = 1)]
            fn wake(_: wake::Context) {}
        }

        #[panic_handler]
        fn panic(info: &core::panic::PanicInfo<'_>) -> ! {
            $crate::microcontroller::survivors::panicked(info);
            <$microcontroller as $crate::microcontroller::Microcontroller>::restart()
        }

        /// With what the processor stacked, unless there was no memory for it: then on a new stack.
        #[unsafe(naked)]
        #[unsafe(export_name = "HardFault")]
        unsafe extern "C" fn hard_fault() -> ! {
            core::arch::naked_asm!(
                "mrs r0, MSP",
                "ldr r1, =_stack_end",
                "cmp r0, r1",
                "bhs 2f",
                "ldr r1, =_stack_start",
                "msr MSP, r1",
                "movs r0, #0",
                "2:",
                "bl {faulted}",
                ".ltorg",
                faulted = sym faulted,
            )
        }

        extern "C" fn faulted(frame: Option<&cortex_m_rt::ExceptionFrame>) -> ! {
            $crate::microcontroller::survivors::faulted(frame);
            <$microcontroller as $crate::microcontroller::Microcontroller>::restart()
        }
    };
}
