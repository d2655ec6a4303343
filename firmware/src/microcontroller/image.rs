//! The image of a board: retained memory, crash record, and the macro that connects the application with the interrupts.

use crate::crash_record::CrashRecord;
use crate::retained::{RetainedMemory, RetainedRam, blank_memory};
use core::panic::PanicInfo;
use cortex_m_rt::ExceptionFrame;
use link::{Boot, BootCause, ClockSource};

// These statics are not initialised at the start.

#[unsafe(link_section = ".uninit.retained")]
static RETAINED: RetainedMemory = blank_memory();

#[unsafe(link_section = ".uninit.crash_record")]
static CRASH_RECORD: CrashRecord = CrashRecord::blank();

/// Returns the cause of the start with the crash record, and the retained RAM, which is erased after power-on.
pub fn restore(cause: BootCause, clock: ClockSource) -> (Boot, RetainedRam) {
    let mut retained = RetainedRam::open(&RETAINED);
    if cause == BootCause::PowerOn {
        retained.clear();
    }
    let boot = Boot { cause, crash_record: CRASH_RECORD.take(), clock, ..Boot::default() };
    let (crystal, record) = (clock == ClockSource::Crystal, boot.crash_record.as_str());
    defmt::info!("start {=str}, crystal {=bool}, crash record: {=str}", cause.text(), crystal, record);
    (boot, retained)
}

/// Writes the place and the message of a panic into the crash record.
pub fn record_panic(info: &PanicInfo<'_>) {
    let (path, line) = info.location().map_or(("?", 0), |at| (at.file(), at.line()));
    // The paths of dependencies are too long for the record.
    let file = path.rsplit('/').next().unwrap_or(path);
    CRASH_RECORD.write(format_args!("panic at {file}:{line}: {}", info.message()));
    // The crash record contains the message.
    defmt::error!("panic at {=str}:{=u32}", path, line);
}

/// Writes a fault into the crash record. There is no frame after a stack overflow.
pub fn record_fault(frame: Option<&ExceptionFrame>) {
    match frame {
        Some(frame) => {
            defmt::error!("hard fault at {=u32:#010x}", frame.pc());
            CRASH_RECORD.write(format_args!("hard fault at {:#010x}, called from {:#010x}", frame.pc(), frame.lr()));
        }
        None => CRASH_RECORD.write(format_args!("stack overflow")),
    }
}

/// Defines the image of a board: start-up, interrupts and main loop.
///
/// `microcontroller` is a [`Microcontroller`](crate::microcontroller::Microcontroller), and `start` the function that starts clocks, watchdog and
/// pins: from the peripherals of `device` and [`UartQueues`](crate::microcontroller::UartQueues) it makes
/// [`BoardParts`](crate::microcontroller::BoardParts). Interrupts: data ready, end of a burst, UART, USB if any, and an unused one for the
/// estimators. The package needs the crates `rtic`, `heapless` and `cortex-m-rt`, and their features of this one.
///
/// | priority | interrupt |
/// |---|---|
/// | 4 | UART: short, so that no received byte is lost |
/// | 3 | data ready, end of a burst |
/// | 2 | estimators |
/// | 1 | SysTick: blinks the LED, wakes the main loop; USB, whose host waits |
/// | 0 | main loop: commands, probing, reports, learning |
#[macro_export]
macro_rules! observatory {
    (
        microcontroller: $microcontroller:ty;
        start: $start:path;
        device: $($device:ident)::+;
        data_ready: $edge:ident;
        end_of_burst: $burst_end:ident;
        uart: $serial:ident;
        $(usb: $usb_interrupt:ident;)?
        estimators: $free:ident;
    ) => {
        #[rtic::app(device = $($device)::+, peripherals = true)]
        mod app {
            use super::*;
            use $($device)::+::Interrupt;
            use heapless::spsc::Consumer;
            use $crate::microcontroller::context::{BoardContext, SharedEstimation, SharedSampling};
            use $crate::microcontroller::image::restore;
            use $crate::microcontroller::processor::{
                Blinker, ESTIMATOR_CYCLES, SAMPLING_CYCLES, count_lost_bytes, measure, start_systick,
            };
            use $crate::microcontroller::{BoardParts, Microcontroller, UartQueues};
            use $crate::{
                BurstQueue, Estimators, FIRST_CONFIG, FinishedEpoch, HostPort, MicrosecondCounter as _, ReceiveBuffer,
                ReceivedBytes, Receiver, ServedPort as _, Start, Statistics, TimedBurst, TransmitBuffer, TransmitQueue,
                WatchdogExtension, estimate, run,
            };

            type Mcu = $microcontroller;
            type Output = <Mcu as Microcontroller>::Output;

            #[shared]
            struct Shared {
                sampling: SharedSampling<Mcu>,
                estimation: SharedEstimation,
            }

            #[local]
            struct Local {
                bursts: Consumer<'static, TimedBurst>,
                uart: <Mcu as Microcontroller>::Uart,
                usb: Option<<Mcu as Microcontroller>::Usb>,
                reset_line: Option<Output>,
                blinker: Blinker<Output>,
                received: ReceivedBytes<'static>,
                start: Option<Start>,
            }

            #[init(local = [
                burst_queue: BurstQueue = BurstQueue::new(),
                statistics: Statistics = Statistics::new(),
                finished: FinishedEpoch = FinishedEpoch::EMPTY,
                transmit_buffer: TransmitBuffer = TransmitBuffer::new(),
                receive_buffer: ReceiveBuffer = ReceiveBuffer::new(),
            ])]
            fn init(context: init::Context) -> (Shared, Local) {
                let (to_port, transmit) = context.local.transmit_buffer.split();
                let (receive, received) = context.local.receive_buffer.split();
                let (to_estimators, bursts) = context.local.burst_queue.split();
                let BoardParts { cause, clock, core_hz, data_ready, bus, uart, usb, led, reset_line } =
                    $start(context.device, UartQueues { transmit, receive: Receiver::new(receive) });
                let (usb, usb_queues) = usb.unzip();
                let (to_usb, from_usb) = usb_queues.unzip();
                start_systick(context.core.SYST, core_hz);
                let (boot, retained) = restore(cause, clock);
                let estimation = SharedEstimation {
                    estimators: Estimators::new(context.local.statistics, FIRST_CONFIG),
                    transmit_queue: TransmitQueue::new(to_port).with_usb(to_usb),
                };
                let shared = Shared { sampling: SharedSampling::new(bus, data_ready, to_estimators), estimation };
                let start = Some(Start { boot, retained, finished: context.local.finished });
                let (blinker, received) = (Blinker::new(led, clock), ReceivedBytes { uart: received, usb: from_usb });
                (shared, Local { bursts, uart, usb, reset_line, blinker, received, start })
            }

            fn request_transmission() {
                rtic::pend(Interrupt::$serial);
                $(rtic::pend(Interrupt::$usb_interrupt);)?
            }

            #[idle(local = [reset_line, received, start], shared = [sampling, estimation])]
            fn idle(context: idle::Context) -> ! {
                let idle::LocalResources { reset_line, received, start, .. } = context.local;
                let idle::SharedResources { sampling, estimation, .. } = context.shared;
                let (shared, abandon_burst) = ((sampling, estimation), || rtic::pend(Interrupt::$burst_end));
                let board =
                    BoardContext::<Mcu, _, _>::new(shared, reset_line, received, request_transmission, abandon_burst);
                run(board, start.take().expect("the main loop starts once"))
            }

            #[task(binds = $edge, priority = 3, shared = [sampling])]
            fn data_ready(mut context: data_ready::Context) {
                measure(&SAMPLING_CYCLES, || context.shared.sampling.lock(|sampling| sampling.data_ready()));
            }

            #[task(binds = $burst_end, priority = 3, shared = [sampling])]
            fn transfer_ended(mut context: transfer_ended::Context) {
                measure(&SAMPLING_CYCLES, || context.shared.sampling.lock(|sampling| sampling.transfer_ended()));
                rtic::pend(Interrupt::$free);
            }

            #[task(binds = $free, priority = 2, local = [bursts], shared = [estimation])]
            fn estimators(mut context: estimators::Context) {
                measure(&ESTIMATOR_CYCLES, || {
                    context.shared.estimation.lock(|SharedEstimation { estimators, transmit_queue }| {
                        estimate(estimators, transmit_queue, context.local.bursts);
                    });
                });
                request_transmission();
            }

            #[task(binds = $serial, priority = 4, local = [uart])]
            fn uart(context: uart::Context) {
                count_lost_bytes(HostPort::Uart, context.local.uart.serve(Mcu::counter()));
            }

            $(#[task(binds = $usb_interrupt, priority = 1, local = [usb])]
            fn usb(context: usb::Context) {
                if let Some(port) = context.local.usb {
                    count_lost_bytes(HostPort::Usb, port.serve(Mcu::counter()));
                }
            })?

            #[task(binds = SysTick, priority = 1, local = [blinker, extension: WatchdogExtension = WatchdogExtension::START])]
            fn wake(context: wake::Context) {
                context.local.blinker.tick();
                Mcu::extend_watchdog(context.local.extension);
                // A stalled port raises no interrupt, so its interrupt is requested here.
                $(rtic::pend(Interrupt::$usb_interrupt);)?
            }
        }

        #[panic_handler]
        fn panic(info: &core::panic::PanicInfo<'_>) -> ! {
            $crate::microcontroller::image::record_panic(info);
            <$microcontroller as $crate::microcontroller::Microcontroller>::restart()
        }

        /// Passes on the exception frame; after a stack overflow it resets the stack pointer and passes none.
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
            $crate::microcontroller::image::record_fault(frame);
            <$microcontroller as $crate::microcontroller::Microcontroller>::restart()
        }
    };
}
