//! Both fronts of the driver, blocking and asynchronous, which differ in `async` and `.await`.

/// Makes the methods of a mode and the functions that carry out their requests. The mode's bus traits must be in scope.
macro_rules! front {
    ($mode:ident, $new:ident, [$($async:tt)?], [$($await:tt)*]) => {
        use core::pin::pin;
        use core::task::Poll;
        use embedded_hal::digital::OutputPin;

        use crate::alarms::{Alarm, AlarmNumber};
        use crate::burst::{BURST_BYTES, BURST_REQUEST, Burst, burst_with_gaps};
        use crate::calibration::{FactoryRestore, GyroBias, OnChipCompensation};
        use crate::channel::GyroRange;
        use crate::clock::SamplePeriod;
        #[cfg(doc)]
        use crate::clock::Timing;
        use crate::commands::{Product, Sleep};
        use crate::config::Config;
        use crate::driver::{Adis16405, procedures};
        use crate::error::{Diagnosis, Error, FlashUpdate};
        use crate::pins::{DacLevel, DioSignal, Gpio};
        use crate::fronts::methods;
        use crate::protocol::{BusRequest, Protocol, ProtocolError, RequestSlot, resume};
        use crate::register::Register;
        use crate::sample::ImuSample;
        use crate::self_test::{FlashTest, SelfTest, Stimulus};
        use crate::spacing::{FramePauses, LONGEST_DELAY_US, SensorBus};

        impl<SPI: SpiDevice<u8>, D: DelayNs> Adis16405<SPI, D, $mode> {
            /// A driver for a part to be configured with `config`; `delay` keeps all pauses. Nothing is sent before
            /// [`init`](Self::init).
            pub fn $new(spi: SPI, delay: D, config: Config) -> Self {
                Self::with_state(spi, delay, config)
            }

            /// Reads all twelve outputs in one transaction of 26 bytes, 208 µs at 1 MHz.
            ///
            /// # Errors
            /// [`Error::Spi`]; [`read`](Self::read) or a [`BurstValidator`](crate::BurstValidator) decides whether the data are
            /// usable.
            pub $($async)? fn burst(&mut self) -> Result<Burst, Error<SPI::Error>> {
                let mut answer = [0; BURST_BYTES];
                let pauses = self.state.burst_pauses();
                let (mut whole, mut words);
                let operations: &mut [_] = match self.state.timing.word_gap_ns {
                    0 => {
                        whole = [Operation::Transfer(&mut answer, &BURST_REQUEST), Operation::DelayNs(pauses.low_ns)];
                        &mut whole
                    }
                    gap_ns => {
                        words = burst_with_gaps(&mut answer, gap_ns, pauses.low_ns);
                        &mut words
                    }
                };
                transact(&mut self.bus, pauses, operations)$($await)*.map_err(Error::Spi)?;
                Ok(Burst::from_bytes(&answer))
            }

            /// Reads a burst at a data-ready edge and validates it together with earlier ones
            /// ([`BurstValidator`](crate::BurstValidator)).
            ///
            /// [`burst`](Self::burst) and [`sample_from`](Self::sample_from) give the sample without a check.
            ///
            /// # Errors
            /// [`Error::Unusable`] with the faults of the burst, [`Error::NotReady`] if the driver [is not](Self::is_ready),
            /// [`Error::Spi`].
            pub $($async)? fn read(&mut self) -> Result<ImuSample, Error<SPI::Error>> {
                if !self.is_ready() {
                    return Err(Error::NotReady);
                }
                let burst = self.burst()$($await)*?;
                self.checked_sample(burst).map_err(Error::Unusable)
            }

            /// Resets the part by `line` (RST, active low): low for [`Timing::reset_pulse_us`], silence for
            /// [`Timing::reset_us`], then [`init`](Self::init). Use it when the part does not answer, not even to
            /// [`software_reset`](Self::software_reset).
            ///
            /// `line` must be high before, and may be open-drain. SMPL_PRD from flash may select low-power mode.
            ///
            /// # Errors
            /// [`Error::Pin`] if the line cannot be driven, and those of [`init`](Self::init).
            pub $($async)? fn hardware_reset(&mut self, line: &mut impl OutputPin) -> Result<Product, Error<SPI::Error>> {
                self.state.mark_registers_unknown();
                line.set_low().map_err(|_| Error::Pin)?;
                self.bus.delay.delay_us(self.state.timing.reset_pulse_us)$($await)*;
                line.set_high().map_err(|_| Error::Pin)?;
                self.bus.delay.delay_us(self.state.timing.reset_us)$($await)*;
                self.init()$($await)*
            }
        }

        procedures!(methods, [$mode [$($async)?] [$($await)*]]);

        $($async)? fn run<SPI: SpiDevice<u8>, D: DelayNs, T>(
            bus: &mut SensorBus<SPI, D>,
            slot: &RequestSlot,
            procedure: impl Future<Output = Result<T, ProtocolError>>,
        ) -> Result<T, Error<SPI::Error>> {
            let mut procedure = pin!(procedure);
            loop {
                match resume(procedure.as_mut()) {
                    Poll::Ready(result) => return result.map_err(Error::with_bus_error),
                    Poll::Pending => perform(bus, slot)$($await)*.map_err(Error::Spi)?,
                }
            }
        }

        /// Carries out the request in the slot and responds to it. Not inlined, so that all methods share one copy in flash.
        #[inline(never)]
        $($async)? fn perform<SPI: SpiDevice<u8>, D: DelayNs>(
            bus: &mut SensorBus<SPI, D>,
            slot: &RequestSlot,
        ) -> Result<(), SPI::Error> {
            let mut answer = [0; 2];
            match slot.placed() {
                BusRequest::Frame { bytes, pauses } => {
                    let mut frame = [Operation::Transfer(&mut answer, &bytes), Operation::DelayNs(pauses.low_ns)];
                    transact(bus, pauses, &mut frame)$($await)*?;
                }
                BusRequest::ChipSelectPulse { pauses } => {
                    transact(bus, pauses, &mut [Operation::DelayNs(pauses.low_ns)])$($await)*?;
                }
                BusRequest::Pause { mut us } => {
                    while us > 0 {
                        let step_us = us.min(LONGEST_DELAY_US);
                        bus.delay.delay_us(step_us)$($await)*;
                        us -= step_us;
                    }
                }
            }
            slot.respond(answer);
            Ok(())
        }

        /// Runs a transaction after the rest of an interrupted pause, then keeps the pause with chip select high.
        $($async)? fn transact<SPI: SpiDevice<u8>, D: DelayNs>(
            bus: &mut SensorBus<SPI, D>,
            pauses: FramePauses,
            operations: &mut [Operation<'_, u8>],
        ) -> Result<(), SPI::Error> {
            pause(bus)$($await)*;
            bus.pending_pause_ns = pauses.high_ns;
            let result = bus.spi.transaction(pauses.operations(operations))$($await)*;
            pause(bus)$($await)*;
            result
        }

        $($async)? fn pause<SPI, D: DelayNs>(bus: &mut SensorBus<SPI, D>) {
            if bus.pending_pause_ns > 0 {
                bus.delay.delay_ns(bus.pending_pause_ns)$($await)*;
                bus.pending_pause_ns = 0;
            }
        }
    };
}

/// Makes the methods that call a procedure of the [`Protocol`](crate::protocol::Protocol).
macro_rules! methods {
    ($front:tt $(
        $(#[$doc:meta])*
        $kind:ident fn $name:ident $([const $length:ident: usize])? ($($argument:ident: $type:ty),*) -> $output:ty;
    )*) => {
        methods! { @mode $front $(
            {@$kind $front [$(#[$doc])*] $name [$(const $length: usize)?] [$($argument: $type,)*] [$($argument),*] $output}
        )* }
    };
    (@mode [$mode:ident $async:tt $await:tt] $({$($method:tt)*})*) => {
        impl<SPI: SpiDevice<u8>, D: DelayNs> Adis16405<SPI, D, $mode> {
            $(methods! { $($method)* })*
        }
    };
    (
        @plain [$mode:ident [$($async:tt)?] [$($await:tt)*]]
        [$($doc:tt)*] $name:ident [$($n:tt)*] [$($declared:tt)*] [$($passed:tt)*] $output:ty
    ) => {
        $($doc)*
        pub $($async)? fn $name<$($n)*>(&mut self, $($declared)*) -> Result<$output, Error<SPI::Error>> {
            let slot = RequestSlot::new();
            run(&mut self.bus, &slot, Protocol::new(&slot, &mut self.state).$name($($passed)*))$($await)*
        }
    };
    (
        @stimulating [$mode:ident [$($async:tt)?] [$($await:tt)*]]
        [$($doc:tt)*] $name:ident [] [$($declared:tt)*] [$($passed:tt)*] $output:ty
    ) => {
        $($doc)*
        pub $($async)? fn $name(&mut self, $($declared)*) -> Result<$output, Error<SPI::Error>> {
            let slot = RequestSlot::new();
            let mut protocol = Protocol::new(&slot, &mut self.state);
            let result = run(&mut self.bus, &slot, protocol.$name($($passed)*))$($await)*;
            if self.state.stimulated {
                // The first error is reported; `stimulated` in the state tells whether this attempt succeeded.
                let _ = self.stop_stimulus()$($await)*;
            }
            result
        }
    };
}

pub(crate) use {front, methods};
