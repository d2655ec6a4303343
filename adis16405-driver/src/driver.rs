//! The driver's settings, and the table of methods that `blocking` and `asynch` expand.

use core::marker::PhantomData;

use crate::burst::Burst;
use crate::clock::{PerClockMode, Timing};
use crate::config::Config;
use crate::protocol::DriverState;
use crate::sample::ImuSample;
use crate::spacing::SensorBus;
use crate::validity::{BurstValidator, FaultCounters, Faults, Validity};

/// Type parameter of a driver over a blocking [`SpiDevice`](embedded_hal::spi::SpiDevice).
#[derive(Clone, Copy, Debug)]
pub enum Blocking {}

/// Type parameter of a driver over an asynchronous `SpiDevice` of embedded-hal-async.
#[cfg(feature = "async")]
#[derive(Clone, Copy, Debug)]
pub enum Async {}

/// An ADIS16405 or ADIS16400 on an SPI bus: blocking, or asynchronous with `MODE` = `Async` (feature `async`).
///
/// Every 16-bit frame is a transaction, followed by the stall of [`Timing`] with the delay `D`.
///
/// The SPI device must support [`Operation::DelayNs`](embedded_hal::spi::Operation::DelayNs) only for
/// [`wake`](Self::wake), [`SelectDuringStall::Low`](crate::SelectDuringStall::Low) and [`Timing::word_gap_ns`].
#[derive(Debug)]
pub struct Adis16405<SPI, D, MODE = Blocking> {
    pub(crate) bus: SensorBus<SPI, D>,
    pub(crate) state: DriverState,
    validator: BurstValidator,
    mode: PhantomData<MODE>,
}

impl<SPI, D, MODE> Adis16405<SPI, D, MODE> {
    pub(crate) fn with_state(spi: SPI, delay: D, config: Config) -> Self {
        let (state, validator) = (DriverState::new(config), BurstValidator::default());
        Self { bus: SensorBus::new(spi, delay), state, validator, mode: PhantomData }
    }

    /// Sets the least stall after frames and bursts, ns, for both power modes; the read rate is kept
    /// ([`Timing::frame_stall_ns`]).
    #[must_use]
    pub fn with_stall_ns(mut self, stall_ns: u32) -> Self {
        self.state.timing.stall_ns = PerClockMode { normal: stall_ns, low_power: stall_ns };
        self
    }

    /// States the SCK of single frames, Hz: slower clocks have shorter stalls; the default is the mode's fastest
    /// ([`Timing::sck_hz`]).
    #[must_use]
    pub fn with_sck_hz(mut self, sck_hz: u32) -> Self {
        self.state.timing.sck_hz = Some(sck_hz);
        self
    }

    /// Sets all times that the driver keeps.
    #[must_use]
    pub fn with_timing(mut self, timing: Timing) -> Self {
        self.state.timing = timing;
        self.state.mode = timing.clock_mode(self.state.config.smpl_prd());
        self
    }

    /// Sets whether changed registers are read back and compared, in the bits inside their width. The default is true.
    #[must_use]
    pub fn with_verified_writes(mut self, verify: bool) -> Self {
        self.state.verify = verify;
        self
    }

    /// Sets the faults with which [`read`](Self::read) refuses a sample, [`Faults::REFUSED`] by default. Others are
    /// [warnings](ImuSample::warnings).
    #[must_use]
    pub fn with_refused_faults(mut self, faults: Faults) -> Self {
        self.validator = self.validator.with_refused_faults(faults);
        self
    }

    /// Accepts `prod_id` as the PROD_ID of an ADIS16405. A working part that answers 0x0003 is known.
    #[must_use]
    pub fn with_prod_id(mut self, prod_id: u16) -> Self {
        self.state.prod_id = Some(prod_id);
        self
    }

    /// The configuration that [`init`](Self::init) writes, or the one that was set since.
    pub fn config(&self) -> Config {
        self.state.config
    }

    /// True if the part has its [configuration](Self::config) and no stimulus: [`init`](Self::init) or
    /// [`configure`](Self::configure) succeeded, and no procedure was left unfinished since. If false, call
    /// [`init`](Self::init).
    pub fn is_ready(&self) -> bool {
        self.state.configured && !self.state.stimulated
    }

    /// The number of bursts that [`read`](Self::read) has validated, and how many had each fault.
    pub fn fault_counters(&self) -> &FaultCounters {
        self.validator.counters()
    }

    /// The times that the driver keeps.
    pub fn timing(&self) -> Timing {
        self.state.timing
    }

    /// True if XGYRO_OFF was negative when last seen: x rates may lack their sign after a burst
    /// ([`GyroBias`](crate::GyroBias)). [`keep_negative_x_bias_on_host`](Self::keep_negative_x_bias_on_host) removes
    /// the risk.
    pub fn x_sign_at_risk(&self) -> bool {
        self.state.x_sign_at_risk
    }

    /// A burst as a sample with the present range and host-side bias, without the checks of [`read`](Self::read).
    pub fn sample_from(&self, burst: Burst) -> ImuSample {
        ImuSample::new(burst.counts(), self.state.config.range()).with_host_bias_x(self.state.host_bias_x)
    }

    /// The next burst of this part as a sample if it is usable, else its faults.
    pub(crate) fn checked_sample(&mut self, burst: Burst) -> Result<ImuSample, Faults> {
        self.validator = self.validator.with_x_sign_at_risk(self.state.x_sign_at_risk);
        let validity = self.validator.validate(&burst);
        let Validity { faults, .. } = validity;
        if validity.is_usable() { Ok(self.sample_from(burst).with_warnings(faults)) } else { Err(faults) }
    }

    /// Returns the SPI device and the delay.
    pub fn release(self) -> (SPI, D) {
        (self.bus.spi, self.bus.delay)
    }
}

/// The methods that run a procedure of [`Protocol`](crate::protocol::Protocol) of the same name; `$make_methods` makes
/// each of them. `stimulating` methods switch the stimulus off after an error; others are `plain`.
macro_rules! procedures {
    ($make_methods:ident, $front:tt) => {
        $make_methods! {
            $front

            /// Reads PROD_ID and returns the connected part.
            ///
            /// # Errors
            /// [`Error::Product`] if PROD_ID is not that of a supported part.
            plain fn identity() -> Product;

            /// Checks that an ADIS16405 or ADIS16400 answers, writes the configuration, and moves a negative correction
            /// of gyro x from the part to the driver
            /// ([`keep_negative_x_bias_on_host`](Self::keep_negative_x_bias_on_host)).
            ///
            /// Low-power timing applies until SMPL_PRD is read, unless the driver has configured the part before; SCK
            /// must suit it. A stimulus left on is switched off first. Only bytes that differ are written, the lower
            /// one first (in SENS_AVG the range first), and read back.
            ///
            /// # Errors
            /// [`Error::Product`] if PROD_ID is not that of a supported part, [`Error::Verify`] if a register did not
            /// take its value.
            plain fn init() -> Product;

            /// Waits for [`Timing::start_up_us`], then [`init`](Self::init).
            ///
            /// # Errors
            /// Those of [`init`](Self::init).
            plain fn start_up() -> Product;

            /// Resets the part (GLOB_CMD bit 7), leaves the bus silent for [`Timing::reset_us`], then
            /// [`init`](Self::init).
            ///
            /// Registers are loaded from flash, volatile ones (GPIO, sleep, auxiliary DAC) reset. If SMPL_PRD in flash
            /// selects low-power mode, SCK must not exceed 300 kHz until `init` has ended.
            ///
            /// # Errors
            /// Those of [`init`](Self::init).
            plain fn software_reset() -> Product;

            /// Sets sample period, gyro range and filter; above SMPL_PRD = 0x08 SCK must not exceed 300 kHz.
            ///
            /// # Errors
            /// [`Error::Verify`] if a register did not take its value.
            plain fn configure(config: Config) -> ();

            /// Sets the period of the internal sample clock.
            ///
            /// # Errors
            /// [`Error::Verify`].
            plain fn set_sample_period(period: SamplePeriod) -> ();

            /// Sets the rate nearest to `hz`, samples per second, and returns it.
            /// [`set_sample_period`](Self::set_sample_period) needs no double precision.
            ///
            /// # Errors
            /// [`Error::Config`] if `hz` is not finite and positive, [`Error::Verify`].
            plain fn set_sample_rate(hz: f64) -> f64;

            /// Sets the gyro range.
            ///
            /// # Errors
            /// [`Error::Config`] if the range needs more filter taps than are set, [`Error::Verify`].
            plain fn set_range(range: GyroRange) -> ();

            /// Sets the filter: two cascaded averages of 2^M samples.
            ///
            /// # Errors
            /// [`Error::Config`] if M is above 6 or too small for the range, [`Error::Verify`].
            plain fn set_filter_taps_log2(filter_taps_log2: u8) -> ();

            /// Reads a register in two frames; undefined bits are returned as sent.
            ///
            /// # Errors
            /// [`Error::WriteOnly`] for GLOB_CMD (reading it would start a burst) and SLP_CNT.
            plain fn read_register(register: Register) -> u16;

            /// Reads `N` registers in `N` + 1 frames: each frame brings the answer to the one before.
            ///
            /// # Errors
            /// [`Error::WriteOnly`] as for [`read_register`](Self::read_register); nothing is sent then.
            plain fn read_registers[const N: usize](registers: [Register; N]) -> [u16; N];

            /// Writes a register without reading it back: the lower byte, then the upper one if the register is wider
            /// than 8 bits.
            ///
            /// # Errors
            /// [`Error::ReadOnly`] if it cannot be written.
            plain fn write_register(register: Register, value: u16) -> ();

            /// Sets the bits of `mask` to those of `value`: reads, writes changed bytes, the lower one first, and reads
            /// back ([`with_verified_writes`](Self::with_verified_writes)).
            ///
            /// # Errors
            /// [`Error::ReadOnly`], [`Error::WriteOnly`], [`Error::Verify`] if the bits did not take their value.
            plain fn update_register(register: Register, mask: u16, value: u16) -> ();

            /// Reads DIAG_STAT, which clears it.
            ///
            /// # Errors
            /// [`Error::Spi`].
            plain fn diagnosis() -> Diagnosis;

            /// Runs the internal self-test (MSC_CTRL bit 10) and waits for its end; switches a manual self-test off.
            ///
            /// # Errors
            /// [`Error::Deadline`] if it does not end within twice its usual time, [`Error::Product`] if the part does
            /// not answer, [`Error::Verify`].
            plain fn self_test() -> SelfTest;

            /// Runs the flash test (MSC_CTRL bit 11) and waits for its end; switches a manual self-test off.
            ///
            /// # Errors
            /// Those of [`self_test`](Self::self_test).
            plain fn flash_test() -> FlashTest;

            /// Runs a manual self-test (MSC_CTRL bit 8 or 9): response of gyros and accelerometers x, y, z in counts,
            /// differences of means over eight samples. The part must be still; limits are in its data sheet.
            ///
            /// # Errors
            /// [`Error::Verify`] if MSC_CTRL did not take the bits. After an error the method tries to switch the
            /// stimulus off. If that fails too, or if the future is dropped, the sensors stay deflected until
            /// [`stop_stimulus`](Self::stop_stimulus), [`init`](Self::init) or [`self_test`](Self::self_test) succeeds.
            stimulating fn stimulus_response(stimulus: Stimulus) -> [i16; 6];

            /// Switches the stimulus off (MSC_CTRL bits 9 and 8); outputs settle after the filter's length.
            ///
            /// # Errors
            /// [`Error::Verify`] if MSC_CTRL did not take the bits.
            plain fn stop_stimulus() -> ();

            /// The bias correction of the gyros, as applied by the part and by the driver.
            ///
            /// # Errors
            /// [`Error::Spi`].
            plain fn gyro_offsets() -> GyroBias;

            /// Sets the gyros' bias correction x, y, z in counts of 0.0125 °/s, −4096 to 4095, added to the outputs;
            /// the driver applies a negative x ([`GyroBias`]).
            ///
            /// # Errors
            /// [`Error::Value`] if an offset does not fit, [`Error::Verify`].
            plain fn set_gyro_offsets(offsets: [i16; 3]) -> GyroBias;

            /// If XGYRO_OFF is negative, moves its value to the driver: see [`GyroBias`].
            ///
            /// # Errors
            /// [`Error::Verify`].
            plain fn keep_negative_x_bias_on_host() -> GyroBias;

            /// The bias correction of the accelerometers x, y, z in counts of 3.33 mg.
            ///
            /// # Errors
            /// [`Error::Spi`].
            plain fn accl_offsets() -> [i16; 3];

            /// Sets the bias correction of the accelerometers x, y, z in counts of 3.33 mg, −2048 to 2047.
            ///
            /// # Errors
            /// [`Error::Value`] if an offset does not fit, [`Error::Verify`].
            plain fn set_accl_offsets(offsets: [i16; 3]) -> ();

            /// The hard-iron correction x, y, z in counts of 0.5 mgauss.
            ///
            /// # Errors
            /// [`Error::Spi`].
            plain fn hard_iron() -> [i16; 3];

            /// Sets the hard-iron correction x, y, z in counts of 0.5 mgauss, −8192 to 8191.
            ///
            /// # Errors
            /// [`Error::Value`] if a correction does not fit, [`Error::Verify`].
            plain fn set_hard_iron(offsets: [i16; 3]) -> ();

            /// The soft-iron factors x, y, z in units of 1/2048.
            ///
            /// # Errors
            /// [`Error::Spi`].
            plain fn soft_iron() -> [u16; 3];

            /// Sets the soft-iron factors x, y, z in units of 1/2048 (0x0800 = 1), 0 to 4095.
            ///
            /// # Errors
            /// [`Error::Value`] if a factor does not fit, [`Error::Verify`].
            plain fn set_soft_iron(factors: [u16; 3]) -> ();

            /// Runs the auto-null (GLOB_CMD bit 0): the still part sets its gyro offsets from its outputs; the driver
            /// applies a negative x ([`GyroBias`]).
            ///
            /// The flash is written, one of 10,000 cycles (data sheet Rev. B, page 13 and Table 1), counted by
            /// [`flash_writes`](Self::flash_writes).
            ///
            /// # Errors
            /// [`Error::Product`] if the part does not answer after the command, [`Error::Verify`].
            plain fn auto_null() -> GyroBias;

            /// Runs the precision auto-null (GLOB_CMD bit 4): [`auto_null`](Self::auto_null) over 30 s
            /// ([`Timing::precision_auto_null_us`]) offline, still, with a silent bus. A sibling part kept a mean
            /// residual of 0.05 °/s. The delay may feed a watchdog.
            ///
            /// # Errors
            /// Those of [`auto_null`](Self::auto_null).
            plain fn precision_auto_null() -> GyroBias;

            /// Restores the factory calibration (GLOB_CMD bit 1): offsets and hard-iron correction become 0 and are
            /// written to flash, one of 10,000 cycles. Configures the part again, and returns the overwritten
            /// corrections.
            ///
            /// # Errors
            /// Those of [`init`](Self::init).
            plain fn factory_restore() -> FactoryRestore;

            /// The number of flash writes so far, FLASH_CNT.
            ///
            /// # Errors
            /// [`Error::Spi`].
            plain fn flash_writes() -> u16;

            /// Writes the settings to flash (GLOB_CMD bit 3), with DIAG_STAT and FLASH_CNT before and after.
            ///
            /// # Errors
            /// [`Error::FlashUpdate`] if DIAG_STAT reports a failure of this update, or if FLASH_CNT did not change.
            plain fn flash_update() -> FlashUpdate;

            /// The pin and polarity of the data-ready signal; `None` if it is off.
            ///
            /// # Errors
            /// [`Error::Spi`].
            plain fn data_ready() -> Option<DioSignal>;

            /// Sets the pin and polarity of the data-ready signal; `None` switches it off.
            ///
            /// # Errors
            /// [`Error::Verify`].
            plain fn set_data_ready(signal: Option<DioSignal>) -> ();

            /// The corrections between sensors that the part applies.
            ///
            /// # Errors
            /// [`Error::Spi`].
            plain fn compensation() -> OnChipCompensation;

            /// Sets the corrections between sensors that the part applies.
            ///
            /// # Errors
            /// [`Error::Verify`].
            plain fn set_compensation(compensation: OnChipCompensation) -> ();

            /// The setting of an alarm; `None` if it has no source.
            ///
            /// # Errors
            /// [`Error::Spi`].
            plain fn alarm(number: AlarmNumber) -> Option<Alarm>;

            /// Sets an alarm, or switches it off with `None`; it is off while its registers change.
            ///
            /// # Errors
            /// [`Error::Value`] if the threshold is outside the limits of the channel, [`Error::Verify`].
            plain fn set_alarm(number: AlarmNumber, alarm: Option<Alarm>) -> ();

            /// Sets the pin and polarity of the alarm signal; `None` switches it off.
            ///
            /// # Errors
            /// [`Error::Verify`].
            plain fn set_alarm_output(signal: Option<DioSignal>) -> ();

            /// Sets whether alarms compare filtered data.
            ///
            /// # Errors
            /// [`Error::Verify`].
            plain fn set_alarm_filtering(filtered: bool) -> ();

            /// The direction and level of the general-purpose lines.
            ///
            /// # Errors
            /// [`Error::Spi`].
            plain fn gpio() -> Gpio;

            /// Sets the direction of the general-purpose lines, and the level of outputs.
            ///
            /// # Errors
            /// [`Error::Verify`].
            plain fn set_gpio(gpio: Gpio) -> ();

            /// Sets the auxiliary analog output: writes AUX_DAC, then latches it (GLOB_CMD bit 2).
            ///
            /// # Errors
            /// [`Error::Verify`].
            plain fn set_aux_dac(level: DacLevel) -> ();

            /// Sends the part to sleep; leave the bus silent until it ends, or call [`wake`](Self::wake).
            ///
            /// # Errors
            /// [`Error::Spi`]; SLP_CNT is not read back.
            plain fn sleep(sleep: Sleep) -> ();

            /// Wakes the part by a chip-select pulse ([`Timing::wake_pulse_ns`]), waits for [`Timing::wake_us`], and
            /// identifies it. The pulse is known from one source and was not tested on a part; a reset wakes it too.
            ///
            /// # Errors
            /// [`Error::Product`] if the part does not answer.
            plain fn wake() -> Product;
        }
    };
}

pub(crate) use procedures;
